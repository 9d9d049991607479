"""All solutions of a small 2D problem, by a mixed-integer linear program (MILP) over the states of
its contacts.

Each contact is open (r = 0, u_n >= 0), sticks (u = 0, |r_t| <= mu r_n), or slips forwards or
backwards (u_n = 0, r_t = -+ mu r_n, +- u_t >= 0): four binaries with sum one, and linear
constraints that a bound M of r or u switches off. HiGHS finds a combination of states; the linear
system of these states gives the point without M and its tolerances; the natural map certifies it; a
cut removes every combination that has this point, and the search goes on until none is left.
Degenerate points, where several combinations meet, are therefore found once.

M is no guess. With Z a basis of ker V' and r0 >= 0 purely normal forces that balance the plates, (r
- r0) . u =
-r0_n . u_n - mu r_n . |u_t| <= 0 at every solution, so that r = r0 + Z y obeys y'A y + g'y <= 0, A
= Z'Q Z, g = Z'(Q r0 + q), an ellipsoid: |r_i + (Z A^-1 g)_i / 2 - r0_i| <= sqrt((Z A^-1 Z')_ii
g'A^-1 g) /
2. The same line gives r0_n . u_n <= g'A^-1 g / 4, which bounds u_n, then lambda, then u_t. This
needs A positive definite and r0 > 0.

A combination whose linear system is singular may have a continuum of solutions, all of the same
four states; it is represented by one of its points. Time grows exponentially with the number of
contacts in the worst case.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from scipy.optimize import Bounds, LinearConstraint, linprog, milp

from contactopt.checks import check_number
from contactopt.errors import BackendError, InputError
from contactopt.problem import (
    InterfaceProblem,
    Solution,
    Status,
    dimensionless,
    natural_map_residual,
)

MOST_CONTACTS = 24  # contacts
CERTIFIED = 1e-8  # natural-map residual of a solution
SAME = 1e-7  # relative size of what counts as zero when a point is given its states
OPEN, STICK, FORWARD, BACKWARD = range(4)


def all_solutions(problem: InterfaceProblem, limit: int = 100) -> list[Solution]:
    """Find every solution of a small 2D problem with Coulomb's law.

    Parameters
    ----------
    problem : with at most 24 contacts
    limit : number of solutions after which the search ends

    Returns
    -------
    The solutions, each certified; an empty list if there is none.

    Raises
    ------
    InputError : in 3D, for other laws, for more than 24 contacts, for a Q that is not positive
        definite on the forces that keep the balance, and for plates that do not press
    BackendError : if the solver HiGHS fails
    """
    check_number("limit", limit, low=0.0)
    law = problem.law
    coulomb = law.unilateral and law.proportional and not law.dilatant
    if problem.dim != 2 or not coulomb or problem.contacts > MOST_CONTACTS:
        raise InputError(
            f"all_solutions needs a 2D problem of Coulomb's law with at most {MOST_CONTACTS}"
            " contacts; use solve."
        )
    scaled, scales = dimensionless(problem)
    program, found = _Program(scaled), list[Solution]()
    while len(found) < limit and (combination := program.search()) is not None:
        states, near = combination
        r, lam = program.point(states, near)
        reactions, multipliers = scales.to_physical(r, lam)
        residual = natural_map_residual(problem, reactions, multipliers)
        possible = np.eye(4, dtype=bool)[states]
        if residual <= CERTIFIED:
            possible |= _states_of(scaled, r, lam)
            answer = reactions, multipliers, Status.SOLVED, residual
            found.append(Solution(*answer, program.searches, "all_solutions"))
        program.exclude(possible)
    return found


class _Program:
    """The MILP of a dimensionless problem: unknowns r (2k), lambda (p), binaries (k, 4)."""

    def __init__(self, problem: InterfaceProblem):
        k, p, mu = problem.contacts, len(problem.s), problem.mu
        self.problem, self.searches = problem, 0
        r_n, r_t = (np.hstack([np.eye(2 * k)[i::2], np.zeros((k, p))]) for i in (0, 1))
        force, displacement, multipliers = _bounds(problem)
        R, U_n, U_t = force[:, 0], displacement[:, 0], displacement[:, 1]
        # without friction only FORWARD is used, with slip of either sign
        bond, free = 2 * mu * R, (mu == 0) * U_t
        K = np.hstack([problem.Q, problem.V])
        rows: list[tuple[np.ndarray, tuple[np.ndarray, ...], np.ndarray, np.ndarray]] = []
        zero, none = np.zeros(k), np.full(k, np.inf)
        q_n, q_t = problem.q.T
        rows.append((r_n, (R, zero, zero, zero), -none, R))  # open: r_n = 0
        rows.append((K[::2], (zero, zero, zero, zero), -q_n, none))
        rows.append((K[::2], (-U_n, zero, zero, zero), -none, -q_n))  # closed: u_n = 0
        for side, t, forward, backward in ((1, r_t, bond, zero), (-1, -r_t, zero, bond)):
            rows.append((t + mu[:, None] * r_n, (zero,) * 4, zero, none))
            rows.append((t + mu[:, None] * r_n, (zero, zero, forward, backward), -none, bond))
            grow = (U_t, zero, U_t, free) if side > 0 else (U_t, zero, free, U_t)
            rows.append((side * K[1::2], tuple(-x for x in grow), -none, -side * q_t))
        A = np.vstack([np.hstack([a, *(np.diag(x) for x in b)]) for a, b, _, _ in rows])
        low, high = (np.concatenate([row[i] for row in rows]) for i in (2, 3))
        balance = np.hstack([problem.V.T, np.zeros((p, p + 4 * k))])
        one = np.hstack([np.zeros((k, 2 * k + p)), *[np.eye(k)] * 4])
        self.A = np.vstack([A, balance, one])
        self.low = np.concatenate([low, -problem.s, np.ones(k)])
        self.high = np.concatenate([high, -problem.s, np.ones(k)])
        lower = np.column_stack([zero, -force[:, 1]]).ravel()
        used = np.concatenate([np.ones(k), mu > 0, np.ones(k), mu > 0])
        self.bounds = Bounds(
            np.concatenate([lower, -multipliers, np.zeros(4 * k)]),
            np.concatenate([force.ravel(), multipliers, used]),
        )
        self.integer = np.concatenate([np.zeros(2 * k + p), np.ones(4 * k)])

    def search(self) -> tuple[np.ndarray, np.ndarray] | None:
        """States (k,) and unknowns (2k + p,) of a combination not yet excluded, if there is one."""
        self.searches += 1
        n, k = len(self.problem.Q) + len(self.problem.s), self.problem.contacts
        answer = milp(
            np.zeros(len(self.integer)),
            constraints=LinearConstraint(self.A, self.low, self.high),
            bounds=self.bounds,
            integrality=self.integer,
        )
        if answer.status == 2:  # infeasible
            return None
        if answer.x is None:
            raise BackendError(f"MILP backend 'highs' failed: {answer.message}")
        return np.argmax(answer.x[n:].reshape(4, k), axis=0), answer.x[:n]

    def point(self, states: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The solution r (k, 2), lambda (p,) of these states' linear system nearest to `near`."""
        problem, k = self.problem, self.problem.contacts
        A, b = np.hstack([problem.Q, problem.V]), -problem.q.ravel()
        shut, opened, slips = np.flatnonzero(states != OPEN), states == OPEN, states >= FORWARD
        for i in np.flatnonzero(opened | slips):
            for row in (2 * i, 2 * i + 1) if opened[i] else (2 * i + 1,):
                A[row], b[row] = 0.0, 0.0
                A[row, row] = 1.0
            if slips[i]:
                A[2 * i + 1, 2 * i] = problem.mu[i] * (1 if states[i] == FORWARD else -1)
        A = np.vstack([A, np.hstack([problem.V.T, np.zeros((len(problem.s),) * 2)])])
        x = near - np.linalg.lstsq(A, A @ near - np.concatenate([b, -problem.s]), rcond=None)[0]
        r = np.zeros((k, 2))
        r[shut] = x[: 2 * k].reshape(k, 2)[shut] + 0.0  # no -0
        return r, x[2 * k :]

    def exclude(self, possible: np.ndarray) -> None:
        """Cut every combination that takes each contact's state from its `possible` ones (k, 4)."""
        cut = np.concatenate([np.zeros(len(self.integer) - possible.size), possible.T.ravel()])
        self.A = np.vstack([self.A, cut])
        self.low, self.high = np.append(self.low, -np.inf), np.append(self.high, len(possible) - 1)


def _states_of(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Which states (k, 4) a point has, more than one where it is degenerate."""
    u = problem.displacements(r, lam)
    near_r = SAME * np.abs(r).max(initial=0.0)
    near_u = SAME * max(np.abs(u).max(), np.abs(problem.q).max())
    u_n, u_t, r_n, r_t = np.abs(u[:, 0]), u[:, 1], r[:, 0], r[:, 1]
    shut, bound = u_n <= near_u, problem.mu * r_n
    return np.stack(
        [
            r_n <= near_r,
            shut & (np.abs(u_t) <= near_u),
            shut & (np.abs(r_t + bound) <= near_r) & (u_t >= -near_u),
            shut & (np.abs(r_t - bound) <= near_r) & (u_t <= near_u),
        ],
        axis=1,
    )


def _bounds(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds of |r| (k, 2), |u| (k, 2), |lambda| (p,) at every solution, from the module's head."""
    k, p = problem.contacts, len(problem.s)
    r0, Z, V_n = np.zeros(2 * k), np.eye(2 * k), problem.V[::2]
    if p:
        least = linprog(  # the largest least normal force that balances the plates
            np.append(np.zeros(k), -1.0),
            A_ub=np.hstack([-np.eye(k), np.ones((k, 1))]),
            b_ub=np.zeros(k),
            A_eq=np.hstack([V_n.T, np.zeros((p, 1))]),
            b_eq=-problem.s,
            bounds=[(0, None)] * k + [(0, 1.0)],
        )
        if not least.success or least.x[-1] <= SAME or np.linalg.matrix_rank(V_n) < p:
            raise InputError(
                "all_solutions needs plates that press the bodies together and do not drag them."
            )
        r0[::2], Z = least.x[:k], la.null_space(problem.V.T)
    A, g = Z.T @ problem.Q @ Z, Z.T @ (problem.Q @ r0 + problem.q.ravel())
    eigenvalues = la.eigvalsh((A + A.T) / 2) if A.size else np.ones(1)
    if eigenvalues.min() <= len(A) * 1e-12 * eigenvalues.max():
        raise InputError(
            "all_solutions needs a positive definite Q; reactions of a singular one are not unique."
        )
    G = Z @ np.linalg.solve(A, Z.T)
    energy = float(g @ np.linalg.solve(A, g)) if A.size else 0.0
    center = r0 - Z @ np.linalg.solve(A, g) / 2 if A.size else r0
    force = (np.abs(center) + np.sqrt(np.diag(G) * energy) / 2).reshape(k, 2) * 1.01 + SAME
    force[:, 1] = np.minimum(force[:, 1], problem.mu * force[:, 0])
    elastic = (np.abs(problem.Q) @ force.ravel()).reshape(k, 2) + np.abs(problem.q)
    multipliers = np.zeros(p)
    if p:
        multipliers = np.abs(np.linalg.pinv(V_n)) @ (energy / 4 / r0[::2] + elastic[:, 0])
    displacement = elastic + (np.abs(problem.V) @ multipliers).reshape(k, 2)
    return force, displacement, multipliers
