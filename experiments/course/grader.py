"""Exercises that grade themselves, tell what is wrong, and give three hints before the solution.

    check("1.1", answer)    grades an answer and counts the attempt
    hint("1.1")             gives the next hint; after the third the solution
    table(1)                shows the state of every exercise of a chapter

The question of an exercise stands in its chapter N, its hints and its solution in
`exercises_N.toml`, and what grades the answer in `exercises_N.py`. The right answer is computed
there, and never stands in a notebook.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from experiments.course.feedback import Right, as_numbers, draw
from experiments.course.mistakes import value
from experiments.course.quantities import Numbers, by_hand
from experiments.course.verdict import CLOSE, Verdict

FOLDER = Path(__file__).parent
LEVELS = {1: "pen and paper", 2: "program", 3: "think"}


@dataclass(frozen=True)
class Exercise:
    """One exercise.

    number    chapter.number
    right     computes the right answer: numbers, or one of the kinds of `feedback`; None where the
              record has formulas
    mistakes  answers that are typically wrong, or functions that compute them; and what to tell
              about each of them, or the kind of error that `feedback` finds by itself
    level     1 to 3, in LEVELS
    asks      what the answer holds, with units
    hints     three, each says more
    solution  lines that a student can run in the chapter; they end with the answer
    formulas  of the numbers of the answer, in the quantities that are given, from which mistakes
              are made; close is the relative error that counts as right, least and most are bounds
              that mechanics gives, each with its reason; chapter_text has the numbers of the same
              quantities in the text of the chapter
    """

    number: str
    right: Callable[[], Any] | None
    mistakes: tuple[tuple[Any, str], ...]
    level: int
    asks: str
    hints: list[str]
    solution: str
    formulas: tuple[str, ...] = ()
    given: dict[str, float] = field(default_factory=dict)
    close: float = CLOSE
    least: tuple[float, str] | None = None
    most: tuple[float, str] | None = None
    chapter_text: dict[str, float] = field(default_factory=dict)


@dataclass
class Progress:
    """What a student has done with an exercise."""

    state: str = "not answered"
    attempts: int = 0
    hints: int = 0


PROGRESS: dict[str, Progress] = {}


@cache
def exercises(chapter: int) -> dict[str, Exercise]:
    """The exercises of a chapter by their numbers."""
    texts = tomllib.loads((FOLDER / f"exercises_{chapter}.toml").read_text(encoding="utf-8"))
    chapter_text = texts.pop("text", {})
    graded = import_module(f"experiments.course.exercises_{chapter}").GRADED
    found = {}
    for number, text in texts.items():
        right, *computed = graded.get(number, (None,))
        told = [(wrong_value(one, text), words) for one, words in text.pop("mistakes", ())]
        found[number] = Exercise(
            number, right, (*told, *computed), **text, chapter_text=chapter_text
        )
    return found


def wrong_value(formula: Any, text: dict[str, Any]) -> Any:
    """A wrong answer from its formula, or from one formula for each number of the answer."""
    if isinstance(formula, str):
        return value(formula, text.get("given", {}))
    return tuple(wrong_value(one, text) for one in formula)


def exercise(number: str) -> Exercise:
    """An exercise by its number, such as "1.1"."""
    chapter = str(number).split(".")[0]
    found = exercises(int(chapter)) if chapter in "1234567" and chapter else {}
    if number not in found:
        raise KeyError(f"there is no exercise {number!r}; the numbers look like '1.1'.")
    return found[number]


@cache
def right_answer(number: str) -> Right:
    """The right answer as a kind of `feedback`; it is computed once."""
    task = exercise(number)
    if task.right is None:
        return by_hand(
            task.formulas, task.given, task.close, task.least, task.most, task.chapter_text
        )
    found = task.right()
    if isinstance(found, Numbers):
        return replace(found, chapter=task.chapter_text)
    plain = isinstance(found, (int, float, tuple, list, np.ndarray))
    return Numbers(found) if plain else found


@cache
def mistakes(number: str) -> list[tuple[Any, str]]:
    """The wrong answers that the record of an exercise tells, computed once."""
    found = exercise(number).mistakes
    return [(wrong() if callable(wrong) else wrong, told) for wrong, told in found]


def grade(number: str, answer: Any) -> Verdict:
    """Grade an answer; nothing is printed or counted."""
    task, right = exercise(number), right_answer(number)
    given = as_numbers(answer, right, task.asks)
    if isinstance(given, Verdict):
        return given
    if isinstance(right, Numbers):
        return right.verdict(given, mistakes(number))
    return right.verdict(given)


def check(number: str, answer: Any) -> None:
    """Grade an answer, print the verdict, and count the attempt; `...` is no answer yet."""
    if answer is ... or (isinstance(answer, (tuple, list)) and any(a is ... for a in answer)):
        print(f"Exercise {number}: not answered yet. hint({number!r}) gives a first hint.")
        return
    verdict, done = grade(number, answer), PROGRESS.setdefault(number, Progress())
    done.attempts += 1
    if verdict.right:
        done.state = "right"
    elif done.state != "right":
        done.state = "not right yet"
    print(f"Exercise {number}: {verdict.sentence.strip()}")
    if not verdict.right:
        print(f"hint({number!r}) gives {_next(done.hints)}.")
        _show(number, answer, verdict)


def hint(number: str) -> None:
    """Print the next hint to an exercise; after the third one its solution."""
    task, done = exercise(number), PROGRESS.setdefault(number, Progress())
    if done.hints < 3:
        print(f"Hint {done.hints + 1} of 3 to exercise {number}: {task.hints[done.hints]}")
    else:
        print(f"Solution of exercise {number}:\n\n{task.solution.strip()}")
    done.hints = min(done.hints + 1, 4)


def table(chapter: int) -> None:
    """Print the state of every exercise of a chapter: level, attempts, and hints that were read."""
    print(f"{'exercise':<10}{'level':<18}{'state':<16}{'attempts':>9}{'hints':>10}")
    tasks = exercises(chapter)
    for number, task in tasks.items():
        done = PROGRESS.get(number, Progress())
        hints = "solution" if done.hints > 3 else str(done.hints)
        print(f"{number:<10}{LEVELS[task.level]:<18}{done.state:<16}{done.attempts:>9}{hints:>10}")
    right = sum(PROGRESS.get(number, Progress()).state == "right" for number in tasks)
    print(f"{right} of {len(tasks)} exercises are right.")


def _next(read: int) -> str:
    return ("a first hint", "a second hint", "a third hint", "the solution")[min(read, 3)]


def _show(number: str, answer: Any, verdict: Verdict) -> None:
    """Draw the worst contact where the answer is forces."""
    right = right_answer(number)
    if verdict.contact is not None and hasattr(right, "problem"):
        draw(right.problem, right.forces(np.asarray(answer, dtype=float)), verdict.contact)
