"""Typical mistakes, made from the formula of the right answer.

A formula is an expression of Python in the quantities that an exercise gives. Every single change of
it is a mistake that somebody makes: a term with the wrong sign, a factor that is forgotten, a
division the wrong way round, a root or an exponent that is missing, one quantity in place of another.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from itertools import permutations, product

import numpy as np

NAMES = {
    name: getattr(np, name)
    for name in (
        "sqrt",
        "exp",
        "log",
        "log10",
        "sin",
        "cos",
        "tan",
        "arccos",
        "ceil",
        "floor",
        "hypot",
    )
} | {"abs": abs, "pi": np.pi}
OTHERS = {
    "cos": "sin",
    "sin": "cos",
    "log": "log10",
    "ceil": "floor",
    "arccos": "cos",
    "tan": "sin",
}
# pairs of changes and products of powers are tried up to here; more would match by chance
MOST_CHANGES, MOST_QUANTITIES, EXACT = 60, 7, 1e-6
EXPONENTS = (0.5, 1 / 3, 2 / 3, 2.0, 3.0)
# what a whole answer may be multiplied by, and what this means
FACTORS = (
    (-1.0, "Besides, the sign is wrong."),
    (2.0, "Besides, it is twice as large."),
    (0.5, "Besides, it is half as large."),
    (1e3, "Besides, look at the units."),
    (1e-3, "Besides, look at the units."),
)


def value(formula: str, given: dict[str, float]) -> float:
    """The number that a formula gives."""
    return _value(ast.parse(formula, mode="eval").body, given)


def _value(node: ast.expr, given: dict[str, float]) -> float:
    code = compile(ast.fix_missing_locations(ast.Expression(node)), "formula", "eval")
    with np.errstate(all="ignore"):
        return float(eval(code, {"__builtins__": {}}, NAMES | given))


def wrong_values(formula: str, given: dict[str, float]) -> list[tuple[float, str]]:
    """Numbers that a single mistake gives, each with the mistake in words."""
    return list(_wrong_values(formula, tuple(given.items())))


@cache
def _wrong_values(
    formula: str, given: tuple[tuple[str, float], ...]
) -> tuple[tuple[float, str], ...]:
    quantities, found = dict(given), []
    right = value(formula, quantities)
    for node, words in changed(ast.parse(formula, mode="eval").body, quantities):
        try:
            number = _value(node, quantities)
        except (ArithmeticError, ValueError, TypeError):
            continue
        if np.isfinite(number) and not np.isclose(number, right, rtol=1e-9):
            found.append((number, f"This comes out if {words}."))
    return tuple(found)


def changed(node: ast.expr, given: dict[str, float]) -> Iterator[tuple[ast.expr, str]]:
    """Every expression with one change, and the change in words."""
    match node:
        case ast.BinOp(left, op, right):
            for other, words in changed(left, given):
                yield ast.BinOp(other, op, right), words
            for other, words in changed(right, given):
                yield ast.BinOp(left, op, other), words
            yield from _changed_operation(left, op, right)
        case ast.UnaryOp(ast.USub(), operand):
            yield operand, f"the sign of `{ast.unparse(operand)}` is wrong"
            for other, words in changed(operand, given):
                yield ast.UnaryOp(ast.USub(), other), words
        case ast.Call(ast.Name(name), [argument]):
            if name != "abs":
                yield argument, f"`{name}` is left out"
            if name in OTHERS:
                other_name = ast.Name(OTHERS[name], ast.Load())
                yield ast.Call(other_name, [argument], []), f"`{OTHERS[name]}` replaces `{name}`"
            if name in ("sin", "cos", "tan"):
                turned = ast.BinOp(argument, ast.Mult(), ast.Constant(np.pi / 180))
                yield ast.Call(node.func, [turned], []), "radians are taken for degrees"
            for other, words in changed(argument, given):
                yield ast.Call(node.func, [other], []), words
        case ast.Name(name) if name in given:
            squared = ast.BinOp(node, ast.Pow(), ast.Constant(2.0))
            yield squared, f"`{name}` is squared"
            yield ast.BinOp(node, ast.Pow(), ast.Constant(0.5)), f"`{name}` is under a square root"
            for other in given:
                if given[other] != given[name]:
                    told = f"`{other}` takes the place of `{name}`"
                    yield ast.Name(other, ast.Load()), told


def _changed_operation(
    left: ast.expr, op: ast.operator, right: ast.expr
) -> Iterator[tuple[ast.expr, str]]:
    first, second = ast.unparse(left), ast.unparse(right)
    match op:
        case ast.Add() | ast.Sub():
            flipped = ast.Sub() if isinstance(op, ast.Add) else ast.Add()
            yield ast.BinOp(left, flipped, right), f"the sign of `{second}` is wrong"
            yield left, f"`{second}` is left out"
            yield right, f"`{first}` is left out"
        case ast.Mult():
            yield left, f"the factor `{second}` is left out"
            yield right, f"the factor `{first}` is left out"
            yield ast.BinOp(left, ast.Div(), right), f"you divide by `{second}`: multiply by it"
            yield ast.BinOp(right, ast.Div(), left), f"you divide by `{first}`: multiply by it"
        case ast.Div():
            yield left, f"the division by `{second}` is left out"
            yield ast.BinOp(left, ast.Mult(), right), f"you multiply by `{second}`: divide by it"
            yield ast.BinOp(right, ast.Div(), left), f"`{first}` and `{second}` are exchanged"
        case ast.Pow():
            yield left, f"the exponent `{second}` of `{first}` is left out"
            for exponent in EXPONENTS:
                other = ast.BinOp(left, ast.Pow(), ast.Constant(exponent))
                yield other, f"`{first}` has another exponent than `{second}`"


@cache
def two_mistakes(
    formula: str, given: tuple[tuple[str, float], ...]
) -> tuple[tuple[float, str], ...]:
    """Numbers that two mistakes give; of long formulas there are too many."""
    quantities, found = dict(given), []
    once = list(changed(ast.parse(formula, mode="eval").body, quantities))
    for node, first in once if len(once) <= MOST_CHANGES else ():
        for other, second in changed(node, quantities):
            try:
                number = _value(other, quantities)
            except (ArithmeticError, ValueError, TypeError):
                continue
            if np.isfinite(number):
                found.append((number, f"This comes out if {first}, and {second}."))
    return tuple(found)


def quantity(answer: float, given: dict[str, float], close: float) -> str | None:
    """What an answer is if it is made of the given quantities: one of them, a sum, a difference, or
    a product of powers with a simple factor.
    """
    known = {name: number for name, number in given.items() if number}
    for (first, a), (second, b) in permutations(known.items(), 2):
        for number, name in ((a + b, f"{first} + {second}"), (a - b, f"{first} - {second}")):
            if np.isclose(answer, number, rtol=close, atol=0):
                return name
    if not known or len(known) > MOST_QUANTITIES:
        return None
    exponents = (0, 1, -1, 2, -2) if len(known) <= 4 else (0, 1, -1)
    powers = np.array(list(product(exponents, repeat=len(known))))
    powers = powers[np.argsort(abs(powers).sum(axis=1), kind="stable")]
    numbers = np.prod(np.array(list(known.values())) ** powers.astype(float), axis=1)
    short = abs(powers).sum(axis=1) <= 2  # more of them come out by chance
    for factor, name in (
        (1.0, ""),
        (2.0, "2 * "),
        (0.5, "0.5 * "),
        (4.0, "4 * "),
        (0.25, "0.25 * "),
    ):
        near = np.where(short & (factor == 1), close, EXACT)
        for k in np.flatnonzero(abs(factor * numbers - answer) <= near * abs(answer))[:1]:
            parts = [
                one if power == 1 else f"{one}**{power}"
                for one, power in zip(known, powers[k], strict=True)
                if power
            ]
            return name + " * ".join(parts or ["1"])
    return None
