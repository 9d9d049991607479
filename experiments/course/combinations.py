"""Answers that are made of the numbers of an exercise: another quantity than the one asked for."""

from __future__ import annotations

import ast
from collections.abc import Callable
from functools import cache
from itertools import combinations, product
from math import isclose

import numpy as np

from experiments.course.mistakes import MOST_QUANTITIES, Found, Given, steps, value
from experiments.course.verdict import rounded

# an answer fits to a number by chance unless it gives so many digits
ENOUGH_DIGITS = 4
ANOTHER = "This is the value of `{}`, and another quantity is asked for."


def fits(answer: float, number: float) -> bool:
    """Whether an answer is a number to all its digits, which are too many for a coincidence."""
    if not isclose(answer, number, rel_tol=0.6 * 10 ** (1 - ENOUGH_DIGITS)):
        return False  # quickly: most numbers are far away
    digits = len(f"{abs(answer):.12e}".split("e")[0].replace(".", "").rstrip("0"))
    exact = isclose(answer, number, rel_tol=1e-9)
    return exact or (digits >= ENOUGH_DIGITS and answer == rounded(number, digits))


@cache
def _sums(formula: str, given: Given) -> Found:
    """Sums and differences of a quantity and a quantity, a step of the formula or its value."""
    known, tree = dict(given), ast.parse(formula, mode="eval").body
    parts, found = dict(known), []
    for (first, a), (second, b) in combinations(known.items(), 2):
        if first.split("_")[0] != second.split("_")[0] or "_" not in first:
            continue  # a mean is taken of quantities of one kind
        found += [((a + b) / 2, ANOTHER.format(f"({first} + {second}) / 2"))]
        if a * b > 0:
            found += [((a * b) ** 0.5, ANOTHER.format(f"sqrt({first} * {second})"))]
            harmonic = f"2 * {first} * {second} / ({first} + {second})"
            found += [(2 * a * b / (a + b), ANOTHER.format(harmonic))]
    for node in (tree, *steps(tree)):
        parts[ast.unparse(node)] = value(ast.unparse(node), known)
    for (first, a), (second, b) in product(known.items(), parts.items()):
        if first != second:
            found += [(a + b, ANOTHER.format(f"{first} + {second}"))]
            found += [(a - b, ANOTHER.format(f"{first} - {second}"))]
            found += [(b - a, ANOTHER.format(f"{second} - {first}"))]
    return tuple(found)


def product_of_two(
    answer: float, given: dict[str, float], same: Callable[[float, float], bool]
) -> str | None:
    """What is told of an answer that is a product or a fraction of two of the given quantities."""
    known = {name: x for name, x in given.items() if abs(x) not in (0.0, 0.5, 1.0, 2.0)}
    for (first, a), (second, b) in combinations(known.items(), 2) if len(known) <= 4 else ():
        for number, told in ((a * b, f"{first} * {second}"), (a / b, f"{first} / {second}")):
            if same(answer, number):
                return ANOTHER.format(told)
        if same(answer, b / a):
            return ANOTHER.format(f"{second} / {first}")
    return None


def quantity(
    answer: float, given: dict[str, float], formula: str, counts: bool = False
) -> str | None:
    """What is told of an answer that is made of the given quantities: a sum, a difference, or,
    unless it is a count, a product of powers with a simple factor.
    """
    known = {name: number for name, number in given.items() if number}
    if not known or len(known) > MOST_QUANTITIES:
        return None
    for number, told in _sums(formula, tuple(known.items())):
        if fits(answer, number):
            return told
    if counts:
        return None  # some product is near any whole number
    known = {name: number for name, number in known.items() if abs(number) not in (1.0, 2.0)}
    exponents: tuple[float, ...] = (0, 1, -1, 2, -2) if len(known) <= 4 else (0, 1, -1)
    exponents += (0.5, -0.5) if len(known) <= 3 else ()
    powers = np.array(list(product(exponents, repeat=len(known))), dtype=float)
    powers = powers[np.argsort(abs(powers).sum(axis=1), kind="stable")][1:]  # the first is all 0
    with np.errstate(invalid="ignore"):  # roots of negative numbers
        numbers = np.prod(np.array(list(known.values())) ** powers, axis=1)
    for factor, name in (
        (1.0, ""),
        (2.0, "2 * "),
        (0.5, "0.5 * "),
        (4.0, "4 * "),
        (0.25, "0.25 * "),
    ):
        near = np.flatnonzero(np.isclose(factor * numbers, answer, rtol=1e-3, atol=0))
        for k in near:
            if fits(answer, factor * numbers[k]):
                parts = [
                    one if power == 1 else f"{one}**{power:g}"
                    for one, power in zip(known, powers[k], strict=True)
                    if power
                ]
                return ANOTHER.format(name + " * ".join(parts))
    return None
