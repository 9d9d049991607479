"""Coulomb friction in 2D as a linear complementarity problem (LCP), solved by Lemke's method.

Split r_t = -mu r_n + x and u_t = v - y with v, y >= 0. Then 0 <= x = r_t + mu r_n and
0 <= mu r_n - r_t = 2 mu r_n - x say |r_t| <= mu r_n, x v = 0 says r_t = -mu r_n where u_t > 0,
(2 mu r_n - x) y = 0 says r_t = mu r_n where u_t < 0: the law is
    0 <= (r_n, x, y)  complementary to  (u_n, v = u_t + y, 2 mu r_n - x) >= 0,
with u = Q r + V lambda + q and r linear in (r_n, x). A free lambda is a - b with a, b >= 0,
complementary to -(V' r + s) >= 0 and V' r + s >= 0: together they are the balance. Lemke's method
pivots with the covering vector of ones; lexicographic ties keep degenerate problems from cycling.
It may end on a ray (rare: measured for mu >= 2 only). Then a form with 4k unknowns is tried, r_t =
b - c with b, c >= 0 and |u_t| bounded by y: its matrix is copositive for every Q >= 0 and mu, so
that for positive definite Q and plates that press no ray exists, up to rounding.

Sources: Lemke (1965), Bimatrix equilibrium points; Klarbring (1986), A mathematical programming
approach to three-dimensional contact problems with friction; Stewart, Trinkle (1996).
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contactopt.errors import InputError
from contactopt.linear.deadline import check_time
from contactopt.methods.method import NATIVE, Iterate, Method
from contactopt.methods.notes import note
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.law import Law

logger = logging.getLogger(__name__)

MOST_CONTACTS = 300  # contacts: the tableau has 2 (4 x 300)^2 entries
PIVOT, TIE = 1e-10, 1e-12  # least pivot; relative distance of equal ratios


@dataclass(frozen=True)
class Lemke(Method):
    """Lemke's method. InputError in 3D and for more than 300 contacts."""

    def solves(self, law: Law) -> bool:
        return law.unilateral and law.proportional and not law.dilatant

    unsymmetric: ClassVar[bool] = True

    def backends(self, dim: int) -> tuple[str, str]:
        if dim != 2:
            raise InputError(
                "the method 'lemke' needs a 2D problem: in 3D friction is no LCP; use 'auto'."
            )
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        if problem.dim != 2 or problem.contacts > MOST_CONTACTS:
            raise InputError(
                f"the method 'lemke' needs a 2D problem of at most {MOST_CONTACTS} contacts; use"
                " 'auto'."
            )
        for copositive in (False, True):
            M, q, C = complementarity_problem(problem, copositive)
            z = lemke(M, q)
            if z is not None:
                a, b = np.split(z[len(z) - 2 * len(problem.s) :], 2)
                yield (C @ z[: C.shape[1]]).reshape(problem.q.shape), a - b
                return
        note(logger, "Lemke's method ended on a ray, so it has no answer")


def complementarity_problem(
    problem: InterfaceProblem, copositive: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A plane problem of k contacts as 0 <= z, M z + q >= 0, z'(M z + q) = 0; `copositive` chooses
    the form with 4 k unknowns. Returns M (m, m), q (m,) and C (2 k, c) with r = C z[:c]; lambda is
    last in z.
    """
    k, p = problem.contacts, len(problem.s)
    normal, tangent, eye = np.eye(2 * k)[:, ::2], np.eye(2 * k)[:, 1::2], np.eye(k)
    if copositive:
        R = C = np.hstack([normal, tangent, -tangent])
        F, E = np.vstack([0 * eye, eye, eye]), np.hstack([np.diag(problem.mu), -eye, -eye])
    else:
        R, C = np.hstack([normal, tangent]), np.hstack([normal - tangent * problem.mu, tangent])
        F, E = np.vstack([0 * eye, eye]), np.hstack([2 * np.diag(problem.mu), -eye])
    V, none = np.hstack([problem.V, -problem.V]), np.zeros((k + 2 * p, k + 2 * p))
    M = np.block([[R.T @ problem.Q @ C, np.hstack([F, R.T @ V])], [np.vstack([E, -V.T @ C]), none]])
    return M, np.concatenate([R.T @ problem.q.ravel(), np.zeros(k), -problem.s, problem.s]), C


def lemke(M: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    """z >= 0 with M z + q >= 0, z'(M z + q) = 0 by pivots on w - M z - z0 = q; None on a ray."""
    m = len(q)
    if np.all(q >= 0):
        return np.zeros(m)
    columns = np.hstack([np.eye(m), -M, -np.ones((m, 1)), q[:, None]])  # w, z, z0, right side
    T, basis, enter, cover = columns.copy(), np.arange(m), 2 * m, 2 * m
    row = int(np.flatnonzero(q == q.min())[-1])  # the lexicographic least of (q_i, e_i)
    for _ in range(50 * m):
        check_time()
        T[row] /= T[row, enter]
        T -= np.outer(np.where(np.arange(m) == row, 0.0, T[:, enter]), T[row])
        out, basis[row] = int(basis[row]), enter
        if out == cover:
            z = np.zeros(2 * m)
            # again, without the pivots' rounding errors
            z[basis] = np.linalg.solve(columns[:, basis], q)
            return np.where(z > 1e-13 * z.max(), z, 0.0)[m:]
        enter = out + m if out < m else out - m
        rows = np.flatnonzero(T[:, enter] > PIVOT)
        for column in (2 * m + 1, *range(m)):  # right side, then the inverse of the basis
            if len(rows) == 0:
                return None
            ratio = T[rows, column] / T[rows, enter]
            rows = rows[ratio <= ratio.min() + TIE * max(1.0, abs(ratio.min()))]
            if len(rows) == 1 or np.any(basis[rows] == cover):
                break
        row = int(next((i for i in rows if basis[i] == cover), rows[0]))
    return None
