"""The convex subproblems of a contact problem, as files that external solvers read.

Each of them is

    min  x' P x / 2 + c' x,   A x = b,   x >= lower,   |T_i x| <= R_i x + g_i  at every contact i,

and made at forces r that solve Coulomb's problem. Their answers are then known:

    normal      x = r_n at the given r_t: forces push                          answer r_n
    tangential  x = r_t at the given r_n: |r_t| <= mu r_n                      answer r_t
    tresca      x = (r_n, r_t): forces push, and |r_t| <= mu times that r_n    answer r
    associated  x = (r_n, r_t): |r_t| <= mu r_n, with r_n unknown, too         Coulomb's only
                                                                               where nothing slips

Unless Q is definite, answers with the same displacements are as good. In the plane all of them are
quadratic programs. In space those with friction are programs over second-order cones. Formats:
npz, as qpsolvers.Problem.save and qpbenchmark write it; CBF, the Conic Benchmark Format
(https://cblib.zib.de), in which t >= x' P x / 2 is the rotated cone (t, 1, F x) with F' F = P.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.errors import InputError
from contactopt.files.writing import whole_file
from contactopt.problem import InterfaceProblem


@dataclass(frozen=True, eq=False)
class ConvexProgram:
    """The program defined at the top, of n unknowns and m cones.

    P (n, n), c (n,), A (p, n), b (p,), lower (n,) with -inf where there is no bound;
    T (m, d) positions of the components that a cone bounds; R (m, n), g (m,) its bound
    """

    P: np.ndarray
    c: np.ndarray
    A: np.ndarray
    b: np.ndarray
    lower: np.ndarray
    T: np.ndarray
    R: sp.csr_array
    g: np.ndarray

    def value(self, x: np.ndarray) -> float:
        """Its cost at x."""
        return float(x @ self.P @ x / 2 + self.c @ x)


def convex_program(problem: InterfaceProblem, kind: str, r: np.ndarray) -> ConvexProgram:
    """Make the subproblem of a `kind` in PROGRAMS at forces r (k, dim), under Coulomb's law.

    InputError for another law, and for a Q that is unsymmetric or too large for an array.
    """
    law = problem.law
    plain = law.unilateral and law.proportional and not law.dilatant
    if not plain or law.stretch(problem.dim) is not None:
        raise InputError(f"programs are written for Coulomb's law, not for {type(law).__name__}.")
    if not problem.symmetric:
        raise InputError("Q is unsymmetric: its problem has no convex programs.")
    return PROGRAMS[kind](problem.explicit(), r)


def _part(
    problem: InterfaceProblem, r: np.ndarray, own: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """P, c, A, b of the components `own` where all other components are those of r."""
    Q = (problem.Q + problem.Q.T) / 2
    other = np.setdiff1d(np.arange(r.size), own)
    given = r.ravel()[other]
    c = problem.q.ravel()[own] + Q[np.ix_(own, other)] @ given
    moved = np.any(np.abs(problem.V[own]) > 1e-9, axis=0)
    A, b = problem.V[own][:, moved].T, -(problem.s + problem.V[other].T @ given)[moved]
    return Q[np.ix_(own, own)], c, A, b


def _pushing(contacts: int, dim: int) -> np.ndarray:
    """(k dim,) lower bounds: normal forces push."""
    lower = np.full((contacts, dim), -np.inf)
    lower[:, 0] = 0.0
    return lower.ravel()


def _normal(problem: InterfaceProblem, r: np.ndarray) -> ConvexProgram:
    k, n = problem.contacts, np.arange(r.size).reshape(r.shape)[:, 0]
    none = np.zeros((0, 1), dtype=int), sp.csr_array((0, k)), np.zeros(0)
    return ConvexProgram(*_part(problem, r, n), np.zeros(k), *none)


def _tangential(problem: InterfaceProblem, r: np.ndarray) -> ConvexProgram:
    t = np.arange(r.size).reshape(r.shape)[:, 1:].ravel()
    T = np.arange(t.size).reshape(len(r), -1)
    R, g = sp.csr_array((len(r), t.size)), problem.mu * np.maximum(r[:, 0], 0.0)
    return ConvexProgram(*_part(problem, r, t), np.full(t.size, -np.inf), T, R, g)


def _tresca(problem: InterfaceProblem, r: np.ndarray) -> ConvexProgram:
    x = np.arange(r.size)
    R, g = sp.csr_array((len(r), r.size)), problem.mu * np.maximum(r[:, 0], 0.0)
    lower, T = _pushing(*r.shape), x.reshape(r.shape)[:, 1:]
    return ConvexProgram(*_part(problem, r, x), lower, T, R, g)


def _associated(problem: InterfaceProblem, r: np.ndarray) -> ConvexProgram:
    k, x = len(r), np.arange(r.size)
    R = sp.csr_array((problem.mu, (np.arange(k), x.reshape(r.shape)[:, 0])), shape=(k, r.size))
    lower, T = _pushing(*r.shape), x.reshape(r.shape)[:, 1:]
    return ConvexProgram(*_part(problem, r, x), lower, T, R, np.zeros(k))


PROGRAMS: dict[str, Callable[[InterfaceProblem, np.ndarray], ConvexProgram]] = {
    "normal": _normal,
    "tangential": _tangential,
    "tresca": _tresca,
    "associated": _associated,
}


def write_npz(program: ConvexProgram, path: Path) -> None:
    """Write P, q, G, h, A, b, lb, ub for qpsolvers; InputError for a cone that is no interval."""
    import qpsolvers

    if program.T.shape[1] > 1:
        raise InputError("in space friction makes a cone program; write it as cbf.")
    G = h = A = b = None
    if len(program.g):
        pick = sp.csr_array(np.eye(len(program.c))[program.T[:, 0]])
        G = np.vstack([(sign * pick - program.R).toarray() for sign in (1, -1)])
        h = np.concatenate([program.g, program.g])
    if len(program.b):
        A, b = program.A, program.b
    upper = np.full(len(program.c), np.inf)
    made = qpsolvers.Problem(program.P, program.c, G, h, A, b, program.lower, upper)
    with whole_file(path) as beside, open(beside, "wb") as file:
        made.save(file)


def write_cbf(program: ConvexProgram, path: Path) -> None:
    """Write the program, with t >= x' P x / 2 as the last unknown, in version 1 of CBF."""
    n, bounded = len(program.c), np.flatnonzero(np.isfinite(program.lower))
    w, U = la.eigh(program.P)
    kept = w > 1e-14 * np.abs(w).max(initial=0.0)  # the others count as zero
    F = np.sqrt(w[kept])[:, None] * U[:, kept].T
    unit = sp.eye_array(n, format="csr")
    wide = program.T.shape[1] + 1
    order = np.arange(len(program.g) * wide).reshape(len(program.g), wide)
    cones = sp.vstack([program.R, unit[program.T.T.ravel()]], format="csr")
    sizes = np.concatenate([program.g, np.zeros(program.T.size)])
    # rows of a cone follow each other: its bound, then its components
    place = order.T.ravel().argsort()
    parts: list[tuple[str, sp.csr_array, np.ndarray]] = []
    if len(program.b):
        parts.append((f"L= {len(program.b)}", sp.csr_array(program.A), -program.b))
    if len(bounded):
        parts.append((f"L+ {len(bounded)}", unit[bounded], -program.lower[bounded]))
    if len(program.g):
        heads = "\n".join([f"Q {wide}"] * len(program.g))
        parts.append((heads, cones[place], sizes[place]))
    quadratic = sp.vstack([sp.csr_array((2, n)), sp.csr_array(F)], format="csr")
    parts.append((f"QR {len(F) + 2}", quadratic, np.eye(1, len(F) + 2, 1)[0]))
    matrix = sp.coo_array(sp.vstack([rows for _, rows, _ in parts]))
    first = matrix.shape[0] - len(F) - 2
    rows, columns = (np.append(part, end) for part, end in zip(matrix.coords, (first, n)))
    heads = "\n".join(head for head, _, _ in parts)
    constants = np.concatenate([constant for _, _, constant in parts])
    lines = ["VER\n1\n\nOBJSENSE\nMIN\n", f"VAR\n{n + 1} 1\nF {n + 1}\n"]
    lines += [f"CON\n{matrix.shape[0]} {heads.count(chr(10)) + 1}\n{heads}\n"]
    lines += _table("OBJACOORD", np.append(program.c, 1.0), np.arange(n + 1))
    lines += _table("ACOORD", np.append(matrix.data, 1.0), rows, columns)
    lines += _table("BCOORD", constants, np.arange(len(constants)))
    with whole_file(path) as beside:
        beside.write_text("\n".join(lines), "utf-8")


def _table(name: str, values: np.ndarray, *places: np.ndarray) -> Iterator[str]:
    kept = np.flatnonzero(values)
    yield f"{name}\n{len(kept)}"
    yield from (f"{' '.join(str(p[i]) for p in places)} {values[i]:.17g}" for i in kept)
    yield ""
