"""Functions of the place that a scene file writes as text: '0.3 + 0.1 * x', 'where(x < 5, 0.2,
0.4)'.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.errors import InputError

LONGEST = 500  # characters
FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(np, name)
    for name in (
        "sqrt",
        "exp",
        "log",
        "sin",
        "cos",
        "tan",
        "arctan2",
        "abs",
        "minimum",
        "maximum",
        "where",
        "hypot",
    )
}
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: operator.pow,
    ast.USub: operator.neg, ast.UAdd: operator.pos,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
}  # fmt: skip


@dataclass(frozen=True)
class Expression:
    """A function of points (dim, k) -> (k,), written in the names of their components, numbers, pi
    and FUNCTIONS.

    Raises InputError for text that is anything else.
    """

    text: str
    components: tuple[str, ...]

    def __post_init__(self) -> None:
        self(np.ones((len(self.components), 1)), check=False)

    def __call__(self, points: np.ndarray, check: bool = True) -> np.ndarray:
        try:
            if len(self.text) > LONGEST:
                raise SyntaxError(f"it has more than {LONGEST} characters")
            tree = ast.parse(self.text, mode="eval").body
            with np.errstate(all="ignore"):
                names = dict(zip(self.components, np.array(points, dtype=float))) | {
                    "pi": np.float64(np.pi)
                }
                value = np.broadcast_to(
                    np.asarray(_value(tree, names), dtype=float), points.shape[1:]
                )
        except (SyntaxError, TypeError, ValueError, RecursionError, MemoryError) as error:
            said = error.msg if isinstance(error, SyntaxError) else str(error)
            raise InputError(
                f"the expression {self.text[:60]!r} cannot be computed ({said}); use numbers,"
                f" {', '.join(self.components)}, pi, + - * / **, < <= > >=, and"
                f" {', '.join(FUNCTIONS)}."
            ) from error
        if check and not np.all(np.isfinite(value)):
            where = ", ".join(f"{x:.6g}" for x in points[:, int(np.argmin(np.isfinite(value)))])
            raise InputError(f"the expression {self.text!r} has no finite value at ({where}).")
        return value


def _value(node: ast.expr, names: Mapping[str, Any]) -> Any:
    """The value of a part of the expression; numbers are floating-point from the start, so that
    none grows without end.
    """
    if (
        isinstance(node, ast.Constant)
        and isinstance(node.value, (int, float))
        and not isinstance(node.value, bool)
    ):
        return np.float64(node.value) if abs(node.value) < 1e300 else np.float64(np.inf)
    if isinstance(node, ast.Name) and node.id in names:
        return names[node.id]
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](_value(node.left, names), _value(node.right, names))
    if isinstance(node, ast.UnaryOp) and type(node.op) in OPERATORS:
        return OPERATORS[type(node.op)](_value(node.operand, names))
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPERATORS:
        return OPERATORS[type(node.ops[0])](
            _value(node.left, names), _value(node.comparators[0], names)
        )
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in FUNCTIONS
        and not node.keywords
    ):
        return FUNCTIONS[node.func.id](*(_value(part, names) for part in node.args))
    raise SyntaxError(f"{ast.unparse(node)[:40]!r} is not known")
