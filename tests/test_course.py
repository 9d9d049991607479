"""The chapters run; every exercise passes its right answer, which is found in two ways."""

import json
import os
import re
import runpy
import subprocess
import sys
from functools import cache
from pathlib import Path

import cvxpy as cp
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from contactopt import InterfaceProblem, laws, solve
from contactopt.teaching import Slider
from experiments.course import grader
from experiments.course.feedback import Displacements, Forces, Numbers, Open, State, judge_forces
from experiments.course.grader import check, exercise, exercises, grade, hint, right_answer, table

ROOT = Path(__file__).parents[1]
CHAPTERS = {
    path.stem: path for path in sorted((ROOT / "experiments" / "course").glob("chapter_*.py"))
}
NUMBERS = [number for chapter in range(1, 8) for number in exercises(chapter)]
# what somebody may try who has not read the question
NUMBERS_AT_HAND = {
    *range(-10, 11),
    *np.arange(-5, 6) / 10,
    *(100.0, 1000.0, 1e6, np.pi, np.e, np.sqrt(2)),
}


@pytest.fixture
def generate(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "experiments" / "site"))
    import generate

    return generate


@pytest.fixture(autouse=True)
def _start_afresh():
    grader.PROGRESS.clear()
    yield
    plt.close("all")


def asked(text):
    return re.findall(r"^# \*\*(\d\.\d+)\*\*", text, re.M)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CHAPTERS))
def test_a_chapter_runs_and_its_solutions_are_right(name, tmp_path, monkeypatch, capsys):
    """The solutions run one after the other, as in their notebook."""
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    plt.close("all")
    names = runpy.run_path(str(CHAPTERS[name]), run_name="__main__")
    assert plt.get_fignums(), "a chapter draws the mechanical system"
    told = re.findall(r"^Exercise (\S+): (.*?)\.", capsys.readouterr().out, re.M)
    numbers = asked(CHAPTERS[name].read_text())
    assert told == [(number, "not answered yet") for number in numbers]
    for number in numbers:
        exec(compile(exercise(number).solution, f"solution {number}", "exec"), names)
        assert grade(number, names["answer"]).right, number
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("answer", "told"), [("99.0", "not right yet"), ("0.978", "right")])
def test_a_script_grades_the_answer_that_stands_in_it(answer, told, tmp_path, capsys):
    text = CHAPTERS["chapter_7_duality"].read_text()
    path = tmp_path / "mine.py"
    path.write_text(text.replace("answer = ...  # value", f"answer = {answer}  # value", 1))
    runpy.run_path(str(path))
    assert f"Exercise 7.1: {told}." in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("folder", [ROOT, ROOT / "experiments" / "course"])
def test_a_chapter_finds_the_exercises_from_its_own_folder_and_from_that_of_the_repository(folder):
    script = ROOT / "experiments" / "course" / "chapter_7_duality.py"
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = [sys.executable, os.path.relpath(script, folder)]
    done = subprocess.run(
        command, cwd=folder, env=env | {"MPLBACKEND": "Agg"}, capture_output=True, text=True
    )
    assert "0 of 9 exercises are right." in done.stdout, done.stderr


@cache
def example(number):
    """A right answer, from the kind of the exercise."""
    right = right_answer(number)
    if isinstance(right, Numbers):
        return right.value
    if isinstance(right, Open):
        return right.example
    if isinstance(right, State):
        return (max(right.q, 0.0), max(-right.q / right.Q, 0.0))
    found = solve(right.problem, tol=1e-10)
    moved = right.problem.displacements(found.reactions, found.multipliers)
    return moved[0] if isinstance(right, Displacements) else found.reactions


@pytest.mark.parametrize("number", NUMBERS)
def test_an_exercise_passes_the_right_answer_and_tells_what_is_wrong_with_others(number):
    assert grade(number, example(number)).right
    mistakes = grader.mistakes(number)
    assert len(mistakes) >= 3
    for answer, told in mistakes:
        verdict = grade(number, answer)
        assert not verdict.right
        assert verdict.kind == told or (" " in told and told in verdict.sentence), (answer, verdict)
    assert len({told for _, told in mistakes}) >= 2


@pytest.mark.parametrize("number", NUMBERS)
def test_guesses_and_answers_to_other_exercises_do_not_pass(number):
    of_numbers = isinstance(right_answer(number), Numbers)
    for guess in NUMBERS_AT_HAND if of_numbers else (0.0, 0.5, 1.0, -1.0):
        assert not grade(number, np.full(right_answer(number).shapes[0], guess)).right, guess
    for other in NUMBERS:
        if other != number and not isinstance(right_answer(other), Open):
            answer = example(other)  # one of another shape is refused for its shape
            if np.shape(answer) in right_answer(number).shapes:
                assert not grade(number, answer).right, other
    rng = np.random.default_rng(3)
    for size in (0.0, 5e-324, 1e-300, 1e-9, 1e9, 1e99):
        tried = size * rng.choice([-1.0, 1.0], size=right_answer(number).shapes[0])
        assert not grade(number, tried).right, tried


def test_there_are_sixty_eight_exercises_in_three_levels():
    levels = [exercise(number).level for number in NUMBERS]
    assert len(NUMBERS) == 68 and set(levels) == {1, 2, 3}
    assert min(levels.count(level) for level in (1, 2, 3)) >= 12
    kinds = {type(right_answer(number)) for number in NUMBERS}
    assert kinds == {Numbers, Open, State, Forces, Displacements}


@pytest.mark.parametrize("name", list(CHAPTERS))
def test_questions_and_records_agree_and_no_answer_stands_in_a_chapter(name):
    text, chapter = CHAPTERS[name].read_text(), int(name.split("_")[1])
    assert asked(text) == list(exercises(chapter))
    for number, level in re.findall(r"^# \*\*(\d\.\d+)\*\* \((.*?)\.\)", text, re.M):
        assert level.lower() == grader.LEVELS[exercise(number).level]
    cells = [cell for cell in re.split(r"^(?=# %%)", text, flags=re.M) if "exercise" in cell[:30]]
    for number, cell in zip(exercises(chapter), cells, strict=True):
        line, call = cell.strip().splitlines()[1:]
        place, told = line.split("  # ")
        assert re.fullmatch(r"answer = (\.\.\.|\((\.\.\.(, )?)+\))", place)
        assert told == exercise(number).asks
        assert call == f'check("{number}", answer)'


@pytest.mark.parametrize("number", NUMBERS)
def test_the_hints_are_three_sentences_of_their_own_and_the_solution_is_short(number):
    task = exercise(number)
    assert len(set(task.hints)) == 3 and all(hint.endswith((".", "?")) for hint in task.hints)
    code = [line for line in task.solution.strip().splitlines() if not line.startswith("#")]
    assert any(line.startswith(("answer = ", "        ", "    answer")) for line in code)
    assert len(code) <= 16


@pytest.mark.parametrize("name", list(CHAPTERS))
def test_a_chapter_has_all_its_parts_and_folds_what_only_draws(name, generate):
    text = CHAPTERS[name].read_text()
    for part in (
        "## The mechanical system",
        "rimal",
        "ual",
        "## The optimality conditions",
        "KKT",
        "cvxpy",
        "## What fails",
    ):
        assert part in text, part
    (notebook,) = (
        page for path, page in generate.notebook("course", name, text) if path.suffix == ".ipynb"
    )
    folded = [
        cell
        for cell in json.loads(notebook)["cells"]
        if cell["metadata"].get("jupyter", {}).get("source_hidden")
    ]
    assert len(folded) == text.count('tags=["hide-input"]') > 0
    assert all(re.search(r"\b(ax|plt)\.", "".join(cell["source"])) for cell in folded), (
        "only drawings are folded"
    )


@pytest.mark.parametrize(
    ("answer", "kind"),
    [
        ("3.86", "type"),
        (None, "type"),
        (True, "type"),
        ({}, "type"),
        ([[1.0], [2.0, 3.0]], "type"),
        (cp.Variable(2), "type"),
        ((0.0, cp.Variable()), "type"),
        (1j, "type"),
        ((0.0, np.nan), "type"),
        ((0.0, np.inf), "type"),
        ((1e300, 0.0), "type"),
        (3.86, "shape"),
        ((0.0, 3.86, 0.0), "shape"),
    ],
)
def test_what_is_no_answer_gets_one_sentence(answer, kind):
    verdict = grade("1.1", answer)
    assert not verdict.right and verdict.kind == kind
    assert verdict.sentence.endswith("Give 2 numbers: gap [mm], force [N].")


def test_rounding_to_three_digits_and_arrays_of_one_number_are_right():
    assert grade("3.5", (3.63, 1.91, 1.15)).right and not grade("3.5", (3.63, 1.90, 1.15)).right
    assert grade("1.2", np.array([2.64])).right and not grade("1.2", 2.65).right
    assert grade("6.7", 218).right and not grade("6.7", 217.9).right
    assert grade("1.2", 2640.0).kind == "unit"


# two nodes in space; each case spoils one condition at the second node
PRESSED = InterfaceProblem(
    np.diag([1.0, 1.0, 1.0, 1.0, 2.0, 2.0]), [[-1.0, 0.2, 0.0], [-1.0, 3.0, 4.0]], 0.5
)


@pytest.mark.parametrize(
    ("second", "kind"),
    [
        ((-1.0, 0.0, 0.0), "tension"),
        ((1.0, -0.4, -0.5), "bound"),
        ((0.5, 0.0, 0.0), "penetration"),
        ((1.5, -0.45, -0.6), "distance"),
        ((1.0, 0.3, 0.1), "along"),
        ((1.0, -0.5, 0.0), "direction"),
        ((1.0, -0.27, -0.36), "loose"),
    ],
)
def test_every_condition_of_mechanics_is_told_with_its_contact(second, kind):
    right = solve(PRESSED, tol=1e-10).reactions
    assert judge_forces(PRESSED, right).right and np.allclose(right[1], (1, -0.3, -0.4))
    verdict = judge_forces(PRESSED, np.array([right[0], second]))
    assert (verdict.kind, verdict.contact) == (kind, 1) and "Contact 1 " in verdict.sentence


def test_the_verdict_is_the_same_in_other_units():
    for force, length in ((1e-3, 1e3), (1e6, 1e-6)):
        mapped = InterfaceProblem(PRESSED.Q * length / force, PRESSED.q * length, PRESSED.law)
        right = solve(PRESSED, tol=1e-10).reactions * force
        assert judge_forces(mapped, right).right
        for second, kind in (((1.0, -0.5, 0.0), "direction"), ((0.5, 0, 0), "penetration")):
            assert (
                judge_forces(mapped, np.array([right[0], np.multiply(second, force)])).kind == kind
            )


def test_forces_are_judged_by_their_own_law():
    """The force of associated friction is right where the exercise asks for it."""
    Q, q = [[1.0, -1.0], [-1.0, 2.0]], [[-3.0, 5.0]]
    other = InterfaceProblem(Q, q, laws.Associated(np.array([0.5])))
    force = solve(other).reactions
    assert judge_forces(other, force).right
    assert judge_forces(InterfaceProblem(Q, q, 0.5), force).kind == "associated"


def test_a_failure_counts_hints_come_in_three_steps_and_the_table_tells(capsys):
    check("1.1", ...)
    check("1.1", (..., 3.0))
    check("1.1", (0.0, -3.86))
    assert "The floor pulls with 3.86 N" in capsys.readouterr().out
    for number in (1, 2, 3):
        hint("1.1")
        assert f"Hint {number} of 3" in capsys.readouterr().out
    hint("1.1")
    assert "6.5 - 4.4 * 0.6" in capsys.readouterr().out
    check("1.1", (0.0, 3.86))
    check("1.1", (0.0, 3.0))  # what was right stays right
    check("1.2", 1.0)
    capsys.readouterr()
    table(1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["1.1", "pen", "and", "paper", "right", "3", "solution"]
    assert "not right yet" in lines[2] and "not answered" in lines[3]
    assert lines[-1] == "1 of 9 exercises are right."


def test_an_unknown_number_is_named():
    with pytest.raises(KeyError, match=r"no exercise '9.1'"):
        check("9.1", 1.0)


@pytest.mark.parametrize("number", ["2.1", "4.3"])
def test_the_worst_contact_is_drawn(number):
    plt.close("all")
    bad = np.array(example(number), dtype=float)
    bad[..., 0] *= 0.5
    check(number, bad)
    assert len(plt.get_fignums()) == 1


@pytest.mark.parametrize("name", list(CHAPTERS))
def test_nbgrader_gets_an_answer_and_a_graded_cell_for_each_exercise(name):
    from experiments.course import nbgrader

    marked = [
        (cell["metadata"]["nbgrader"], "".join(cell["source"]))
        for cell in json.loads(nbgrader.source_notebook(CHAPTERS[name].read_text()))["cells"]
        if "nbgrader" in cell["metadata"]
    ]
    answers = [text for mark, text in marked if mark["solution"]]
    tests = [(mark, text) for mark, text in marked if mark["grade"]]
    chapter = exercises(int(name.split("_")[1]))
    assert len(answers) == len(tests) == len(chapter)
    assert len({mark["grade_id"] for mark, _ in marked}) == len(marked)
    for task, answer, (mark, text) in zip(chapter.values(), answers, tests):
        assert mark["points"] == task.level and mark["locked"] and not mark["solution"]
        assert "### BEGIN SOLUTION" in answer and task.solution.strip() in answer
        exec(text, {"answer": example(task.number)})
        with pytest.raises(AssertionError):
            exec(text, {"answer": "a lot"})


def test_solutions_stand_in_a_notebook_of_their_own():
    from experiments.course import nbgrader

    for name, path in CHAPTERS.items():
        text = path.read_text()
        solved = nbgrader.solved(text)
        assert "= ..." not in solved and solved.count("check(") == text.count("check(")
        for task in exercises(int(name.split("_")[1])).values():
            assert task.solution.strip() in solved and task.solution.strip() not in text


def test_a_slider_holds_one_picture_for_every_value():
    def draw(value):
        fig, ax = plt.subplots()
        ax.plot([0, value])
        return fig

    before = len(plt.get_fignums())
    html = Slider("load <F>", [0.0, 1.0, 2.0], draw, start=1)._repr_html_()
    assert html.count("data:image/png;base64,") == 3 and 'max="2"' in html and 'value="1"' in html
    assert "load &lt;F&gt;" in html and "<F>" not in html and "http" not in html
    assert html.count("display: block") == 1
    assert len(plt.get_fignums()) == before
