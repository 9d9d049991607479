"""Answers that are numbers, and what is told about wrong ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import permutations, product
from math import isclose
from typing import Any

import numpy as np

from experiments.course.combinations import ANOTHER, fits, product_of_two, quantity
from experiments.course.mistakes import (
    BESIDES,
    misread,
    taken,
    told_of,
    two_mistakes,
    value,
    wrong_values,
)
from experiments.course.verdict import CLOSE, DIGITS, RIGHT, Verdict, rounded, shortened, wrong

MISSING = "A factor of {} is missing, or one too many."
UNIT = "Your answer is {:g} times the right one. Look at the units, or at the decimal point."
# kind, factor that makes the answer right, and what is told; these come before the formula
SCALED = (
    ("sign", -1.0, "The size is right, the sign is not. Look at the arrows again."),
    *(("unit", f, UNIT.format(1 / f)) for f in (1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)),
    *(("half", f, MISSING.format("two")) for f in (2.0, 0.5)),
)
# and these, which stand for their inverses too, after it
LOST = tuple(
    ("factor", f, told)
    for factor, told in (
        (np.pi, MISSING.format("pi")),
        (2 * np.pi, MISSING.format("2 pi")),
        (4.0, MISSING.format("four")),
        (10.0, "The decimal point is in a wrong place."),
        (100.0, "The decimal point is in a wrong place, or percent and shares are mixed up."),
        (180 / np.pi, "Radians and degrees are mixed up."),
        (9.81, "A factor of 9.81 is missing, or one too many: a load in N is no mass in kg."),
        (3.0, MISSING.format("three")),
        (np.sqrt(2), MISSING.format("the square root of two")),
    )
    for f in (factor, 1 / factor)
)
# functions of the right answer that somebody gives in its place
ANGLE = "This is the angle whose tangent is the right answer."
RELATED: tuple[tuple[Callable[[float], float], str], ...] = (
    (lambda x: 1 / x, "This is one over the right answer."),
    (lambda x: -1 / x, "This is one over the right answer, with the wrong sign."),
    (lambda x: 2 / x, "This is twice one over the right answer."),
    (lambda x: 0.5 / x, "This is half of one over the right answer."),
    (lambda x: x**2, "A square root is missing. Look at the exponents."),
    (np.sqrt, "A square is missing. Look at the exponents."),
    (lambda x: 1 - x, "This is one minus the right answer."),
    (lambda x: x - 1, "This is the right answer minus one: a change, and not a ratio."),
    (lambda x: np.degrees(np.arctan(x)), ANGLE),
    (np.arctan, ANGLE),
    (
        lambda x: np.sin(np.arctan(x)),
        "This is the sine of the angle whose tangent is the right answer.",
    ),
    (np.log10, "This is the logarithm of the right answer."),
    (np.log, "This is the logarithm of the right answer."),
    (np.exp, "This is the exponential of the right answer."),
)


@dataclass(frozen=True)
class Numbers:
    """The answer agrees with numbers to a relative error, or is rounded to three digits; integers
    are exact.

    formulas  of the numbers, from which mistakes are made; given are the quantities in them
    least, most  what mechanics allows: pairs of a number and the sentence that says why
    chapter  the numbers that the same quantities have in the text of the chapter
    """

    value: Any
    close: float = CLOSE
    formulas: tuple[str, ...] = ()
    given: dict[str, float] = field(default_factory=dict)
    least: tuple[float, str] | None = None
    most: tuple[float, str] | None = None
    chapter: dict[str, float] = field(default_factory=dict)

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        return [np.shape(self.value)]

    @property
    def counts(self) -> bool:
        return np.asarray(self.value).dtype.kind == "i"

    def agrees(self, answer: Any, value: Any) -> bool:
        """Whether two answers are the same to the accuracy that is asked for."""
        a, b = np.asarray(answer, dtype=float), np.asarray(value, dtype=float)
        if a.shape != b.shape or self.counts:
            return np.array_equal(a, b)
        least = 0.1 * self.close * float(np.abs(b).max(initial=0.0))
        three = np.array([rounded(x, 3) for x in b.ravel()]).reshape(b.shape)
        same = np.isclose(a, b, rtol=self.close, atol=least) | np.isclose(a, three, rtol=1e-12)
        return bool(same.all())

    def resembles(self, answer: Any, value: Any) -> bool:
        """Whether an answer is this wrong value, perhaps rounded to two digits."""
        a, b = np.asarray(answer, dtype=float), np.asarray(value, dtype=float)
        if a.shape != b.shape or self.counts:
            return np.array_equal(a, b)
        pairs = zip(a.ravel(), b.ravel(), strict=True)
        return self.agrees(a, b) or all(_same_digits(x, y, self.close) for x, y in pairs)

    def verdict(self, answer: np.ndarray, listed: Sequence[tuple[Any, str]] = ()) -> Verdict:
        """What is told; `listed` are wrong answers of this exercise with their sentences."""
        value = np.asarray(self.value, dtype=float)
        if self.agrees(answer, value):
            return RIGHT
        if not self.counts and self._rounded(answer, value):
            return DIGITS
        for same in (self.agrees, self.resembles):  # another mistake may have the same two digits
            for other, told in listed:
                if " " in told and same(answer, other):
                    return wrong("mistake", told)
        if value.size == 1:
            alone = float(answer.ravel()[0])
            return self._one(alone, 0, listed) or self._size(answer, value)
        return self._several(answer, value)

    def _rounded(self, answer: np.ndarray, value: np.ndarray) -> bool:
        """Whether all digits that are given are right, but too few."""
        pairs = zip(answer.ravel(), value.ravel(), strict=True)
        return all(
            abs(a - b) <= 1e-3 * self.close
            or any(np.isclose(a, shortened(b, n), rtol=1e-9).any() for n in (2, 3))
            or (np.isclose(a, rounded(b, 1), rtol=1e-9) and np.isclose(a, b, rtol=0.05))
            or abs(a - b) <= 0.1 * self.close * abs(value).max()
            for a, b in pairs
        )

    def _one(self, answer: float, i: int, listed: Sequence[tuple[Any, str]] = ()) -> Verdict | None:
        """What is wrong with number i, if it is a typical mistake; the likeliest come first."""
        right = float(np.ravel(self.value)[i])
        if self.counts and answer != round(answer):
            return wrong("count", "A count is a whole number.")
        if self.counts and abs(answer - right) == 1:
            return wrong("count", "It is one too many or one too few. Look at the ends again.")
        if self.counts and right > 99 and answer in shortened(right, 2):
            return wrong("count", "The first digits are right, but a count is exact.")
        return (
            _scaled(answer, right, self.agrees_alone)
            or (None if self.counts else _scaled(answer, right, _same_digits, SCALED[:-2]))
            or self._from_formula(answer, i, likely=True)
            or self._given(answer)
            or self._related(answer, right)
            or self._from_formula(answer, i, likely=False)
            or _besides(answer, listed)
            or self._made_of_two(answer)
            or self._two_mistakes(answer, i)
            or self._other_quantity(answer, i)
            or self._taken(answer, i)
            or (None if self.counts else _scaled(answer, right, _same_digits, SCALED[-2:]))
            or self._outside(answer)
        )

    def _outside(self, answer: float) -> Verdict | None:
        for bound, side in ((self.least, -1), (self.most, 1)):
            if bound and side * (answer - bound[0]) > 0:
                return wrong("bound", bound[1])
        return None

    def _formula(self, i: int) -> str:
        return self.formulas[i] if i < len(self.formulas) else repr(float(np.ravel(self.value)[i]))

    def _from_formula(self, answer: float, i: int, likely: bool) -> Verdict | None:
        """One mistake, likely or not: to all digits that are given, nearly, or rounded."""
        given = tuple(self.given.items())
        mistakes = [
            one
            for one in wrong_values(self._formula(i), given, tuple(self.chapter.items()))
            if one[1].startswith("Perhaps") != likely
        ]
        for same in (fits, self.agrees_alone, *(() if self.counts else (_same_digits,))):
            for number, told in mistakes:
                # two digits fit to the square of a quantity by chance
                if same(answer, number) and (same is not _same_digits or "twice more" not in told):
                    name = self._name(answer)
                    return wrong("formula", f"This is `{name}`. {told}" if name else told)
        return None

    def _name(self, answer: float) -> str | None:
        """The quantity that has this number in the exercise, unless the number says too little."""
        for name, number in self.given.items():
            if abs(number) not in (0.0, 1.0, 2.0) and self.agrees_alone(answer, number):
                return name
        return None

    def _given(self, answer: float) -> Verdict | None:
        """Whether an answer is a number that the exercise gives."""
        for name, number in self.given.items():
            if number and self.agrees_alone(answer, number):
                return wrong("combination", ANOTHER.format(name))
        return None

    def _made_of_two(self, answer: float) -> Verdict | None:
        told = product_of_two(answer, self.given, self.agrees_alone)
        return wrong("combination", told) if told else None

    def _misread(self, answer: np.ndarray, good: int) -> Verdict | None:
        """Whether all numbers follow from one quantity that was mistaken, as two of them show."""
        if len(self.formulas) != answer.size or good > answer.size - 2:
            return None
        inside = {name for name in self.given if any(name in one for one in self.formulas)}
        for other, told in misread(self.given, self.chapter, inside, self.counts):
            try:
                numbers = [value(one, self.given | other) for one in self.formulas]
            except ArithmeticError:
                continue
            if self.resembles(answer, numbers):
                return wrong("formula", told_of([told]))
        return None

    def _related(self, answer: float, right: float) -> Verdict | None:
        """Whether an answer is a factor or a function away from the right one."""
        with np.errstate(all="ignore"):
            ways = [(right / factor, kind, told) for kind, factor, told in LOST if not self.counts]
            ways += [(float(f(np.float64(right))), "related", told) for f, told in RELATED]
        near = [one for one in ways if self.agrees_alone(answer, one[0])]
        best = min(near, key=lambda one: abs(one[0] - answer), default=None)
        return wrong(*best[1:]) if best else None

    def _two_mistakes(self, answer: float, i: int) -> Verdict | None:
        """A mistake in the formula, and a sign, a factor of two or a unit besides; or two."""
        formula, given = self._formula(i), tuple(self.given.items())
        for change, besides in BESIDES:
            for number, told in wrong_values(formula, given, tuple(self.chapter.items())):
                alone = any(w in told for w in ("of the text", "right answer", "Perhaps"))
                if number and not alone and fits(answer, change(number)):
                    return wrong("formula", f"{told} {besides}")
        for number, told in two_mistakes(formula, given):
            if fits(abs(answer), abs(number)):
                return wrong("formula", told)
        return None

    def _taken(self, answer: float, i: int) -> Verdict | None:
        """Whether a quantity was taken in another unit, or its half or double."""
        for number, told in taken(self._formula(i), tuple(self.given.items())):
            if fits(answer, number) or self.agrees_alone(answer, number):
                return wrong("formula", told)
        return None

    def _other_quantity(self, answer: float, i: int) -> Verdict | None:
        """Whether an answer is another number of the exercise, or made of its numbers."""
        if answer == 0:
            return wrong("zero", "Zero would mean that nothing acts here. Look at the loads again.")
        told = quantity(answer, self.given, self._formula(i), self.counts)
        return wrong("combination", told) if told else None

    def _place(self, answer: float, i: int) -> Verdict | None:
        """Whether an answer is another one of the right numbers."""
        for j, right in enumerate(np.ravel(np.asarray(self.value, dtype=float))):
            if j != i and right and self.agrees_alone(answer, right):
                return wrong("place", f"This is the right number {j + 1}: it belongs there only.")
        return None

    def agrees_alone(self, answer: float, right: float) -> bool:
        """Whether one number is right by itself."""
        if self.counts:
            return answer == right
        if not isclose(answer, right, rel_tol=0.05):
            return False  # quickly: most numbers are far away
        return abs(answer - right) <= self.close * abs(right) or answer == rounded(right, 3)

    def _several(self, answer: np.ndarray, value: np.ndarray) -> Verdict:
        if value.size <= 5 and any(self.resembles(p, value) for p in permutations(answer)):
            return wrong("order", "These are the right numbers in a wrong order.")
        for kind, factor, told in SCALED:
            if self.agrees(factor * answer, value):
                return wrong(kind, told)
        pairs = list(zip(answer.ravel(), value.ravel(), strict=True))
        good = [i + 1 for i, (a, b) in enumerate(pairs) if self._good(a, b, value)]
        whole = self._misread(answer, len(good))
        if whole:
            return whole
        told: dict[str, list[str]] = {}  # the numbers that share a sentence
        for i, (a, b) in enumerate(pairs):
            found = None if self._good(a, b, value) else self._place(a, i) or self._one(float(a), i)
            if found:
                told.setdefault(found.sentence.removeprefix("not right yet. "), []).append(
                    f"{i + 1}"
                )
        parts = [f"Of your {value.size} numbers these are right: {good}."] if good else []
        for one, numbers in told.items():
            parts.append(f"Number{'s' * (len(numbers) > 1)} {' and '.join(numbers)}: {one}")
        return wrong("part", " ".join(parts)) if parts else self._size(answer, value)

    def _good(self, a: float, b: float, value: np.ndarray) -> bool:
        least = 0.1 * self.close * abs(value).max()
        return self.agrees_alone(a, b) or (not self.counts and abs(a - b) <= least)

    def _size(self, answer: np.ndarray, value: np.ndarray) -> Verdict:
        """The last word: in which direction the answer is off."""
        a, b = float(abs(answer).max()), float(abs(value).max())
        if a > 2 * b or b > 2 * a:
            told = "more than twice" if a > b else "less than half"
            return wrong("size", f"Your answer is {told} as large as it should be.")
        if np.allclose(answer, value, rtol=0, atol=0.03 * b):
            return wrong(
                "near", "You are within 3 percent: a small term is missing, or some digits."
            )
        return wrong("size", "The size is plausible, but the value is not right.")


def by_hand(
    formulas: Sequence[str],
    given: dict[str, float],
    close: float = CLOSE,
    least: tuple[float, str] | None = None,
    most: tuple[float, str] | None = None,
    chapter: dict[str, float] | None = None,
) -> Numbers:
    """Numbers that have formulas; formulas that begin with ceil give integers."""
    found = [value(formula, given) for formula in formulas]
    numbers: Any = [int(x) for x in found] if formulas[0].startswith("ceil") else found
    whole = numbers[0] if len(numbers) == 1 else tuple(numbers)
    return Numbers(whole, close, tuple(formulas), given, least, most, chapter or {})


def _scaled(
    answer: float,
    right: float,
    same: Callable[[float, float], bool],
    ways: Sequence[tuple[str, float, str]] = SCALED,
) -> Verdict | None:
    """Whether an answer has the wrong sign, another unit or a factor of two."""
    found = (wrong(kind, told) for kind, factor, told in ways if same(answer, right / factor))
    return next(found, None)


def _besides(answer: float, listed: Sequence[tuple[Any, str]]) -> Verdict | None:
    """Whether an answer is a wrong answer of this exercise with another mistake besides."""
    for (other, told), (change, besides) in product(listed, BESIDES):
        if " " in told and other and fits(answer, change(float(other))):
            return wrong("mistake", f"{told} {besides}")
    return None


def _same_digits(answer: float, value: float, close: float = CLOSE) -> bool:
    """Whether an answer is this number, perhaps rounded to two or three digits."""
    if not isclose(answer, value, rel_tol=0.06):
        return False  # quickly: most numbers are far away
    if abs(answer - value) <= close * abs(value):
        return True
    return any(isclose(answer, rounded(value, n), rel_tol=1e-9) for n in (2, 3))
