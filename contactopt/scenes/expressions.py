"""Functions of the place that a scene file writes as text: '0.3 + 0.1 * x', 'where(x < 5, 0.2,
0.4)'.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.checks import place_words
from contactopt.errors import InputError

LONGEST = 500  # characters
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "arctan2": np.arctan2, "abs": np.abs, "minimum": np.minimum, "maximum": np.maximum,
    "where": np.where, "hypot": np.hypot,
}  # fmt: skip
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow, ast.USub: operator.neg, ast.UAdd: operator.pos,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
}  # fmt: skip


@dataclass(frozen=True)
class Expression:
    """A function of points (dim, k) -> (k,), written in the names of their components, numbers, pi
    and FUNCTIONS; InputError for text that is anything else.
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
            names = dict(zip(self.components, np.array(points, dtype=float)))
            with np.errstate(all="ignore"):
                made = np.asarray(_value(tree, names | {"pi": np.float64(np.pi)}), dtype=float)
            value = np.broadcast_to(made, points.shape[1:])
        except (SyntaxError, TypeError, ValueError, RecursionError, MemoryError) as error:
            said = error.msg if isinstance(error, SyntaxError) else str(error)
            raise InputError(
                f"the expression {self.text[:60]!r} cannot be computed ({said}); use numbers,"
                f" {', '.join(self.components)}, pi, + - * / **, < <= > >=, and"
                f" {', '.join(FUNCTIONS)}."
            ) from error
        if check and not np.all(np.isfinite(value)):
            where = place_words(points[:, int(np.argmin(np.isfinite(value)))])
            raise InputError(f"the expression {self.text!r} has no finite value at ({where}).")
        return value


def _value(node: ast.expr, names: Mapping[str, Any]) -> Any:
    """The value of a part of the expression, of floats from the start: none grows without end."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        number: Any = node.value
        return np.float64(number if abs(number) < 1e300 else np.inf)
    if isinstance(node, ast.Name) and node.id in names:
        return names[node.id]
    function, parts = None, []
    if isinstance(node, ast.BinOp):
        function, parts = OPERATORS.get(type(node.op)), [node.left, node.right]
    elif isinstance(node, ast.UnaryOp):
        function, parts = OPERATORS.get(type(node.op)), [node.operand]
    elif isinstance(node, ast.Compare) and len(node.ops) == 1:
        function, parts = OPERATORS.get(type(node.ops[0])), [node.left, *node.comparators]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function, parts = FUNCTIONS.get(node.func.id), node.args
    if function is None:
        raise SyntaxError(f"{ast.unparse(node)[:40]!r} is not known")
    return function(*(_value(part, names) for part in parts))
