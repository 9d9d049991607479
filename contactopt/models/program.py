"""A convex program with names, and the parts that the programs of both forms share."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, ParamSpec

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

Reader = Callable[[], np.ndarray]
P = ParamSpec("P")
# from the letters of the docstrings to those of LaTeX, in this order
LATEX = (
    (r"sum over the contacts of ", r"\\sum\\, "),
    (r"(\w)\^-1", r"\1^{-1}"),
    (r"\b([A-Za-z]+)_([a-z]+)", r"\1_{\2}"),
    (r"\b(lambda|mu|kappa)\b|(?<=\b)(mu|lambda)(?=_)", r"\\\g<0>"),
    (r"'", r"^{\\top}"),
    (r"<=", r"\\leq"),
    (r">=", r"\\geq"),
    (r"\bmin ", r"\\min\\ "),
    (r"\bmax\(", r"\\max("),
    (r"subject to", r"\\quad\\text{subject to}\\quad"),
    (r"r in Coulomb\\?'?s cones", r"r \\in K"),
    (r"at each contact|where contacts may open|elsewhere|and", r"\\ \\text{\g<0>}\\ "),
)


@dataclass(frozen=True, eq=False)
class Program:
    """A cvxpy problem with its variables and parameters by name; solve with
    `program.problem.solve(solver=...)`.

    multipliers  after a solve, by name and with the signs of contactopt.problem. In the dual form
                 "gap" u_n (k,), "slip" u_t (k, d - 1), "approach" lambda of the plates (p,), ...;
                 in the primal form "reaction" r; each function says which. InputError before a
                 solve.
    statement    the program as mathematics, which `str` shows
    """

    problem: cp.Problem
    variables: dict[str, Any]
    parameters: dict[str, Any]
    readers: dict[str, Reader]
    name: str = "program"
    statement: str = ""

    @property
    def multipliers(self) -> dict[str, np.ndarray]:
        return {name: read() for name, read in self.readers.items()}

    def __str__(self) -> str:
        return self.statement

    def __repr__(self) -> str:
        size = sum(variable.size for variable in self.variables.values())
        names, value = ", ".join(self.variables), self.problem.value
        ends = "is not solved yet" if value is None else f"has the value {value:.6g}"
        return f"The convex program `{self.name}` in {names} ({size} unknowns) {ends}."

    def _repr_latex_(self) -> str:
        text = self.statement
        for pattern, by in LATEX:
            text = re.sub(pattern, by, text)
        return f"$\\displaystyle {text}$"


def stated(build: Callable[P, Program]) -> Callable[P, Program]:
    """The program carries the first paragraph of the docstring of the function that built it."""

    @wraps(build)
    def named(*args: P.args, **options: P.kwargs) -> Program:
        program = build(*args, **options)
        if program.statement:  # the other form, which another function built
            return program
        statement = " ".join((build.__doc__ or "").split("\n\n")[0].split()).removesuffix(".")
        return replace(program, name=build.__name__, statement=statement)

    return named


def dual_form(form: str) -> bool:
    """Whether a program is wanted in forces; InputError if the form is unknown."""
    if form not in ("primal", "dual"):
        raise InputError(
            f"unknown form {form!r}; choose 'dual' (in forces) or 'primal' (in displacements)."
        )
    return form == "dual"


def components(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the normal and of the tangential components in a flat vector."""
    blocks = np.arange(problem.q.size).reshape(problem.q.shape)
    return blocks[:, 0], blocks[:, 1:].ravel()


def pushing(problem: InterfaceProblem) -> np.ndarray:
    """Which plates' motions have a normal part; the others do not concern the normal problem."""
    return np.asarray(np.any(np.abs(problem.V[:: problem.dim]) > 1e-9, axis=0))


def cone_coefficient(problem: InterfaceProblem) -> np.ndarray:
    """mu (k,) of the cones |r_t| <= mu r_n; InputError if the law has none."""
    plain = problem.law.plain
    if not (plain.unilateral and plain.proportional):
        raise InputError(
            "this law has no cone of forces |r_t| <= mu r_n: use `tresca` or `bilateral`."
        )
    return np.asarray(plain.coefficient)


def corners(facets: int | None, dim: int) -> np.ndarray | None:
    """The corners (m, dim - 1) of the polygon inscribed in the unit disc; None for the disc."""
    if facets is not None and facets < 3:
        raise InputError(f"a polygon needs at least 3 facets; got {facets}.")
    if dim == 2:
        return np.array([[1.0], [-1.0]])
    if facets is None:
        return None
    angle = 2 * np.pi * (np.arange(facets) + 0.5) / facets
    return np.column_stack([np.cos(angle), np.sin(angle)])


def columns(t: cp.Expression, k: int) -> cp.Expression:
    """A flat vector of k blocks with the blocks as its columns."""
    return cp.reshape(t, (t.size // k, k), order="F")


def blockwise(blocks: np.ndarray | None, t: cp.Expression) -> cp.Expression:
    """The matrices (k, d, d), one for each block, times a flat vector; None for ones."""
    return t if blocks is None else sp.block_diag(list(blocks), format="csr") @ t


def matrix(Q: np.ndarray, name: str = "Q") -> Any:
    """Q as a constant with a name, known to be symmetric positive semidefinite."""
    return cp.psd_wrap(cp.Constant((Q + Q.T) / 2, name=name))


def dual(constraint: cp.Constraint, part: int | None = None) -> np.ndarray:
    """The multiplier of a constraint; InputError before a solve."""
    return answered(constraint.dual_value if part is None else constraint.dual_value[part])


def answered(value: np.ndarray | None) -> np.ndarray:
    """A value of a program; InputError before a solve."""
    if value is None:
        raise InputError("the program has no answer yet: solve it before reading its multipliers.")
    return np.asarray(value, dtype=float)
