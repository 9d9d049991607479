"""Typical mistakes, made from the formula of the right answer.

A formula is an expression of Python in the quantities that an exercise gives. Every single change of
it is a mistake that somebody makes: a term with the wrong sign, a factor that is forgotten, a
division the wrong way round, a root or an exponent that is missing, one quantity in place of another,
a stiffness in place of a compliance, the number of the chapter in place of that of the exercise, or
a step on the way in place of the answer.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import cache
from itertools import combinations, product
from types import CodeType

import numpy as np

from experiments.course.verdict import rounded

FUNCTIONS = "sqrt exp log log10 sin cos tan arccos ceil floor hypot"
NAMES = {name: getattr(np, name) for name in FUNCTIONS.split()} | {"abs": abs, "pi": np.pi}
OTHERS = {
    "cos": "sin",
    "sin": "cos",
    "log": "log10",
    "ceil": "floor",
    "arccos": "cos",
    "tan": "sin",
}
# pairs of changes and products of quantities are tried up to here; more would match by chance
MOST_CHANGES, MOST_QUANTITIES = 60, 7
# changes that somebody makes less often than others, which explain an answer last, and never surely
SELDOM = (
    "is added to",
    "right angle",
    "is squared",
    "another exponent",
    "under a square root",
    "takes the place",
    "exchanged",
)
EXPONENTS = (0.5, 1 / 3, 2 / 3, 2.0, 3.0)
# what may be done besides to the number that a mistake gives
BESIDES: tuple[tuple[Callable[[float], float], str], ...] = (
    (lambda x: -x, "Besides, the sign is wrong."),
    (lambda x: 2 * x, "Besides, it is twice as large."),
    (lambda x: x / 2, "Besides, it is half as large."),
    (lambda x: 1e3 * x, "Besides, look at the units."),
    (lambda x: x / 1e3, "Besides, look at the units."),
    (lambda x: 1 / x, "Besides, it is one over that."),
)
# what a quantity is taken for: its half or double, or a number with the point in a wrong place
TAKEN = (
    (2.0, "twice as large"),
    (0.5, "half as large"),
    *(
        (10.0**n, "in another unit, or with its point in a wrong place")
        for n in (-3, -2, -1, 1, 2, 3)
    ),
)
COMPONENTS = "components"  # name of the number of components that a force has in space
WRONG_SIDE = "`{}` stands on the wrong side of a fraction"


def value(formula: str, given: dict[str, float]) -> float:
    """The number that a formula gives."""
    return _evaluated(_compiled(formula), given)


@cache
def _compiled(formula: str) -> CodeType:
    return compile(formula, "formula", "eval")


def _value(node: ast.expr, given: dict[str, float]) -> float:
    code = compile(ast.fix_missing_locations(ast.Expression(node)), "formula", "eval")
    return _evaluated(code, given)


def _evaluated(code: CodeType, given: dict[str, float]) -> float:
    with np.errstate(all="ignore"):
        return float(eval(code, {"__builtins__": {}}, NAMES | given))


Given = tuple[tuple[str, float], ...]
Found = tuple[tuple[float, str], ...]


@cache
def wrong_values(formula: str, given: Given, chapter: Given = ()) -> Found:
    """Numbers that a single mistake gives, each with the mistake in words, the likely ones first.

    chapter  the numbers that the quantities have in the text of the chapter
    """
    known, tree = dict(given), ast.parse(formula, mode="eval").body
    inside = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    tried = [(node, known, words) for node, words in changed(tree, known)]
    order = ("wrong side", *SELDOM)
    tried.sort(key=lambda one: max(order.index(w) + 1 if w in one[2] else 0 for w in order))
    seldom = sum(any(w in words for w in SELDOM) for _, _, words in tried)
    between = [
        (node, known, words) for node, words in (*_everywhere(tree), *_once_more(tree, known))
    ]
    between += [
        (tree, known | other, words)
        for other, words in misread(known, dict(chapter), inside, formula.startswith("ceil"))
    ]
    on_the_way = [
        (node, f"This is `{ast.unparse(node)}`, a step on the way.") for node in steps(tree)
    ]
    between += [(node, known, words) for node, words in on_the_way]
    tried[len(tried) - seldom : len(tried) - seldom] = between
    found: dict[float, tuple[float, list[str]]] = {}  # by ten digits
    right = value(formula, known)
    for node, quantities, words in tried:
        try:
            number = _value(node, quantities)
        except (ArithmeticError, ValueError, TypeError):
            continue
        if np.isfinite(number) and not np.isclose(number, right, rtol=1e-9):
            found.setdefault(rounded(number, 10), (number, []))[1].append(words)
    return tuple((number, told_of(ways)) for number, ways in found.values())


def told_of(ways: list[str]) -> str:
    """The likeliest way to a number, and another one that is as likely and no part of it."""
    first = ways[0]
    if first[0].isupper():
        return first
    if any(word in first for word in SELDOM):
        return f"Perhaps {first}: then this comes out."
    others = [
        other
        for other in ways[1:]
        if not (other[0].isupper() or any(word in other for word in ("all ", *SELDOM)))
        and not (_subject(first) in _subject(other) or _subject(other) in _subject(first))
    ]
    return f"This comes out if {', or if '.join([first, *others[:1]])}."


def _subject(words: str) -> str:
    """The part of a formula that the words are about."""
    return words.split("`")[-2] if "`" in words else words


def steps(tree: ast.expr) -> list[ast.expr]:
    """The parts of a formula that hold a quantity and are more than that, the largest first."""
    return [
        node
        for node in ast.walk(tree)
        if isinstance(node, (ast.BinOp, ast.Call))
        and node is not tree
        and any(isinstance(one, ast.Name) and one.id not in NAMES for one in ast.walk(node))
    ]


class _Without(ast.NodeTransformer):
    """Leaves an operation with a constant out wherever it stands: all squares, or all halves."""

    def __init__(self, op: type[ast.operator]) -> None:
        self.op = op

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        gone = isinstance(node.op, self.op) and isinstance(node.right, ast.Constant)
        return node.left if gone else node


def _everywhere(tree: ast.expr) -> Iterator[tuple[ast.expr, str]]:
    for op, told in ((ast.Pow, "exponents"), (ast.Div, "divisions by a number")):
        yield _Without(op).visit(deepcopy(tree)), f"all {told} are left out"


def _once_more(tree: ast.expr, given: dict[str, float]) -> Iterator[tuple[ast.expr, str]]:
    """The right answer times a quantity, or over it."""
    for name, number in given.items() if len(given) <= MOST_QUANTITIES else ():
        if abs(number) in (0.5, 1.0, 2.0):
            continue  # a factor of two is told as such
        for op, done in ((ast.Mult(), "multiplied"), (ast.Div(), "divided")):
            node = tree
            for times in ("once", "twice"):
                node = ast.BinOp(node, op, ast.Name(name, ast.Load()))
                yield node, f"This is the right answer, {done} {times} more by `{name}`."


def misread(
    given: dict[str, float], chapter: dict[str, float], inside: set[str], counts: bool
) -> Iterator[tuple[dict[str, float], str]]:
    """Quantities inside formulas that are mistaken wherever they stand, and the mistake in words."""
    given = {name: number for name, number in given.items() if name in inside}
    old = {name: number for name, number in chapter.items() if name in given}
    for names in (*((name,) for name in old), tuple(old)):
        told = " and ".join(f"`{name}`" for name in names)
        yield (
            {name: old[name] for name in names},
            f"This has the {told} of the text. The exercise gives another number.",
        )
    if given.get(COMPONENTS) == 3:
        yield {COMPONENTS: 2.0}, "a force has two components, as in the plane"
    for name, number in given.items():
        yield {name: -number}, f"the sign of `{name}` is wrong"
        yield {name: 0.0}, f"`{name}` is left out everywhere"
        yield {name: 1.0}, f"`{name}` is left out everywhere"
        if number:
            yield {name: 1 / number}, f"`1 / {name}` takes the part of `{name}`"
        for one in (1, -1) if counts and number == round(number) else ():
            yield {name: number + one}, f"`{name}` is one too {'many' if one > 0 else 'few'}"
    for (first, a), (second, b) in combinations(given.items(), 2):
        yield {first: b, second: a}, f"`{first}` and `{second}` are exchanged"
    for name in (one.removesuffix("_nn") for one in given if one.endswith("_nn")):
        entries = [f"{name}_{ij}" for ij in ("nn", "nt", "tt")]
        if all(one in given for one in entries):
            nn, nt, tt = (given[one] for one in entries)
            inverse = np.array([tt, -nt, nn]) / (nn * tt - nt**2)
            yield (
                dict(zip(entries, inverse.tolist(), strict=True)),
                f"the matrix `{name}` is confused with its inverse",
            )
            identity = dict(zip(entries, (1.0, 0.0, 1.0), strict=True))
            yield identity, f"the matrix `{name}` is left out"


@cache
def taken(formula: str, given: Given) -> Found:
    """Numbers that come out if one quantity is taken too large or too small."""
    known, found = dict(given), []
    for (factor, told), (name, number) in product(TAKEN, given):
        if formula.startswith("ceil") and number == round(number):
            continue  # a count has no unit
        wrong = value(formula, known | {name: factor * number})
        if np.isfinite(wrong):
            found.append((wrong, f"Perhaps `{name}` is taken {told}: then this comes out."))
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
            if name == "exp":
                power = ast.BinOp(ast.Constant(10.0), ast.Pow(), argument)
                yield power, "the base is 10, and not `e`"
                one = ast.Constant(1.0)
                yield ast.BinOp(one, ast.Add(), argument), "`exp(x)` is taken for 1 + x"
                inverse = ast.BinOp(one, ast.Div(), ast.BinOp(one, ast.Sub(), argument))
                yield inverse, "`exp(x)` is taken for 1 / (1 - x)"
            if name in ("sin", "cos", "tan"):
                turned = ast.BinOp(argument, ast.Mult(), ast.Constant(np.pi / 180))
                yield ast.Call(node.func, [turned], []), "radians are taken for degrees"
            for other, words in changed(argument, given):
                yield ast.Call(node.func, [other], []), words
        case ast.Name(name) if name in given:
            squared = ast.BinOp(node, ast.Pow(), ast.Constant(2.0))
            yield squared, f"`{name}` is squared"
            yield ast.BinOp(node, ast.Pow(), ast.Constant(0.5)), f"`{name}` is under a square root"
            for second, number in given.items():
                if number != given[name]:
                    told = f"`{second}` takes the place of `{name}`"
                    yield ast.Name(second, ast.Load()), told


def _changed_operation(
    left: ast.expr, op: ast.operator, right: ast.expr
) -> Iterator[tuple[ast.expr, str]]:
    first, second = ast.unparse(left), ast.unparse(right)
    match op:
        case ast.Add() | ast.Sub():
            flipped = ast.Sub() if isinstance(op, ast.Add) else ast.Add()
            yield ast.BinOp(left, flipped, right), f"the sign of `{second}` is wrong"
            yield left, f"`{second}` is left out"
            if isinstance(op, ast.Add):
                yield right, f"`{first}` is left out"
                sides = f"`{first}` and `{second}` are taken for the sides of a right angle"
                yield ast.Call(ast.Name("hypot", ast.Load()), [left, right], []), sides
            else:
                yield right, f"`{second}` is not subtracted from `{first}`"
            if isinstance(right, ast.BinOp) and isinstance(right.op, ast.Pow):
                whole = ast.BinOp(ast.BinOp(left, op, right.left), right.op, right.right)
                yield whole, f"the exponent of `{ast.unparse(right.left)}` stands outside a bracket"
        case ast.Mult():
            yield left, f"the factor `{second}` is left out"
            yield right, f"the factor `{first}` is left out"
            yield ast.BinOp(left, ast.Div(), right), WRONG_SIDE.format(second)
            yield ast.BinOp(right, ast.Div(), left), WRONG_SIDE.format(first)
            yield (
                ast.BinOp(left, ast.Add(), right),
                f"`{first}` is added to `{second}`, and not multiplied",
            )
            match left, right:
                case ast.BinOp(a, ast.Add() | ast.Sub(), b), ast.BinOp(c, ast.Add() | ast.Sub(), d):
                    terms = ast.BinOp(a, ast.Mult(), c), ast.BinOp(b, ast.Mult(), d)
                    told = f"`{first}` and `{second}` are multiplied term by term"
                    yield ast.BinOp(terms[0], left.op, terms[1]), told
        case ast.Div():
            yield left, f"the division by `{second}` is left out"
            yield ast.BinOp(left, ast.Mult(), right), WRONG_SIDE.format(second)
            if first != "1":
                upside_down = f"the fraction of `{first}` and `{second}` is upside down"
                yield ast.BinOp(right, ast.Div(), left), upside_down
                inverse = ast.BinOp(ast.Constant(1.0), ast.Div(), right)
                yield inverse, f"the factor `{first}` is left out"
                yield ast.BinOp(inverse, ast.Div(), left), WRONG_SIDE.format(first)
            both, rest = ast.BinOp(left, ast.Add(), right), ast.BinOp(right, ast.Sub(), left)
            yield ast.BinOp(left, op, both), f"you divide by `{first} + {second}`"
            yield ast.BinOp(left, op, rest), f"you divide by `{second} - {first}`"
        case ast.Pow():
            yield left, f"the exponent `{second}` of `{first}` is left out"
            yield (
                ast.BinOp(left, ast.Mult(), right),
                f"the exponent of `{first}` is taken for a factor",
            )
            for exponent in EXPONENTS:
                other = ast.BinOp(left, ast.Pow(), ast.Constant(exponent))
                yield other, f"`{first}` has another exponent than `{second}`"


@cache
def two_mistakes(formula: str, given: Given) -> Found:
    """Numbers that two likely mistakes give; of long formulas there are too many."""
    quantities, found = dict(given), []

    def likely(node: ast.expr) -> list[tuple[ast.expr, str]]:
        return [one for one in changed(node, quantities) if not any(w in one[1] for w in SELDOM)]

    once = likely(ast.parse(formula, mode="eval").body)
    for node, first in once if len(once) <= MOST_CHANGES else ():
        for other, second in likely(node):
            try:
                number = _value(other, quantities)
            except (ArithmeticError, ValueError, TypeError):
                continue
            if np.isfinite(number):
                found.append((number, f"Perhaps {first}, and {second}: then this comes out."))
    return tuple(found)
