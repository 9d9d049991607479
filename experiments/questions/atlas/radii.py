"""The iterations linearised at a solution: one step of each maps a small error D r to M D r.

Coulomb's law near a solution whose contacts each stick, slip or are open (open ones drop out) is
B D r = 0, with one row per component of the closed contacts,

    normal       Q_n D r,
    tangential   G D r_t + H Q_t D r + mu d D r_n,

where d is the direction of slip (zero in stick), H = I in stick and I - d d' in slip, and G = 0 in
stick and d d' + (|u_t| / mu r_n) (I - d d') in slip.
C D r = mu d . Q_t D r is what slip adds to the opening of the gap.

    tresca                friction bounds one step late: (B - N) D r+ = -N D r,  N = mu d n'
    alternating           r_n one step late in the tangential rows, r_t late in the normal rows
    nsgs                  B = L + U by contacts, L with its diagonal blocks: L D r+ = -U D r
    acary_cadoux          the opening mu |u_t| one step late: (B - n C) D r+ = -n C D r

The iteration converges near this solution if the spectral radius of M is below 1, and leaves it if
it is above. An eigenvalue +1 says that the solution itself stops being isolated (M D r = D r if and
only if B D r = 0), which is another event: there the iteration goes to another solution. It fails
where the radius passes 1 at -1 or at a complex pair. One contact in the plane, Q = (a, b; b, c),
slip with e = sign(d):
    tresca, alternating  M = mu e b / a: a cycle from mu = a / |b| on, for the slip with e b < 0.
    acary_cadoux         M = 1 - (a - mu e b) / (a - 2 mu e b + mu^2 c): a cycle if
                         a - 3 mu e b + 2 mu^2 c < 0, possible if b^2 > 8 a c / 9; for b = 0 it is
                         1 - 1 / (1 + mu^2 c / a), which crawls when mu is large.
    nsgs                 exact in one step.
Newton's method has no radius: near a solution it is exact in one step. For a = c = 1 it cycles
between an open and a sticking contact if the sticking forces r - Q^-1 u pull, |u_t| / r_n >
(1 - b^2) / |b|, and the open contact looks as if it stuck, |u_t| / r_n < |b| (mu^2 - 1). Such a
load exists if and only if mu > 1 / |b|, where the solution stops being unique (for other loads).
The penalty method solves another problem, whose u_n = -r_n / kappa: at a slipping contact this is
an error rho (r_n / kappa) sqrt(1 + mu^2) / F of the certificate, in its yardsticks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.linalg as la
from scipy.optimize import brentq

from contactopt.methods.enumeration import all_solutions
from contactopt.problem import InterfaceProblem, dimensionless
from contactopt.problem.certificate import yardsticks
from experiments.questions.atlas.problems import FAILED, PEER_ITERATIONS, PEERS, Case, draw, run

ITERATIONS, BEGUN = 500, 1e-2  # of `solve`; relative error of the forces that it begins with
AROUND = 1.05  # what a prediction may be wrong by
RANGE, GRID = (0.05, 50.0), 60  # friction coefficients that are looked through, and how many
RESOLVED = 0.01  # relative accuracy of an observed threshold


class Linearised:
    """The matrices defined at the top at forces r (k, dim) and displacements u (k, dim)."""

    def __init__(self, problem: InterfaceProblem, r: np.ndarray, u: np.ndarray):
        dim, mu, size = r.shape[1], problem.mu, np.linalg.norm(r[:, 1:], axis=1)
        closed = r[:, 0] > 0
        slip = closed & (np.linalg.norm(u[:, 1:], axis=1) > 0)
        self.closed, self.dim = closed, dim
        d = np.where(slip[:, None], -r[:, 1:] / np.where(size > 0, size, 1.0)[:, None], 0.0)
        along, eye = d[:, :, None] * d[:, None, :], np.eye(dim - 1)
        speed = np.linalg.norm(u[:, 1:], axis=1) / np.where(slip, mu * r[:, 0], 1.0)
        H = la.block_diag(*(eye - along)[closed])
        G = la.block_diag(
            *(slip[:, None, None] * (along + speed[:, None, None] * (eye - along)))[closed]
        )
        rows = np.repeat(closed, dim)
        self.Q = Q = problem.Q[np.ix_(rows, rows)]
        part = np.arange(len(Q)).reshape(-1, dim)
        self.n, self.t = n, t = part[:, 0], part[:, 1:].ravel()
        identity = np.eye(len(Q))
        self.N = np.zeros_like(Q)
        self.N[np.ix_(t, n)] = la.block_diag(*(mu[:, None] * d)[closed][:, :, None])
        self.B = Q.copy()
        self.B[t] = G @ identity[t] + H @ Q[t] + self.N[t]
        self.C = np.zeros_like(Q)
        self.C[n] = self.N[np.ix_(t, n)].T @ Q[t]
        self.r, self.u, self.mu = r[closed], u[closed], mu[closed]

    def tresca(self) -> np.ndarray:
        return np.linalg.solve(self.B - self.N, -self.N)

    def alternating(self) -> np.ndarray:
        n, t, Q, B = self.n, self.t, self.Q, self.B
        normal = -np.linalg.solve(Q[np.ix_(n, n)], Q[np.ix_(n, t)])
        return np.asarray(normal @ -np.linalg.solve(B[np.ix_(t, t)], B[np.ix_(t, n)]))

    def nsgs(self) -> np.ndarray:
        block = np.arange(len(self.B)) // self.dim
        lower = np.where(block[:, None] >= block, self.B, 0.0)
        return np.linalg.solve(lower, lower - self.B)

    def acary_cadoux(self) -> np.ndarray:
        return np.linalg.solve(self.B - self.C, -self.C)


# method -> the iteration whose radius it has
ITERATIONS_OF = {
    "tresca": "tresca", "alternating": "alternating", "lagrangian": "alternating", "nsgs": "nsgs",
    "acary_cadoux": "acary_cadoux", "apg": "acary_cadoux", "siconos NSGS": "nsgs",
    "siconos TFP": "tresca", "siconos PFP": "alternating", "siconos ACLMFP": "acary_cadoux",
}  # fmt: skip


def rate(name: str, case: Case, mu: float) -> tuple[float, complex]:
    """The radius of a method at the solution of a problem with this friction coefficient, and its
    eigenvalue."""
    case = case.loaded(mu=np.full(len(case.mu), mu))
    problem, scales = dimensionless(case.problem())
    r = scales.to_dimensionless(case.r, np.zeros(0))[0]
    M = getattr(Linearised(problem, r, case.u / scales.length), ITERATIONS_OF[name])()
    values = la.eigvals(M)
    at = int(np.argmax(np.abs(values)))
    return float(np.abs(values[at])), complex(values[at])


def threshold(name: str, case: Case, cold: bool = False) -> float | None:
    """The least mu at which the radius reaches the level above which a method fails; None where
    there is none, where another solution is near it (an eigenvalue +1), or where the states of the
    contacts have no linear map. A method that begins `cold` has more to do.
    """
    peer = name.split()[0] in PEERS
    begun = 1.0 if cold or peer else BEGUN
    level = (FAILED / begun) ** (1 / (PEER_ITERATIONS if peer else ITERATIONS))
    low: float | None = None
    try:
        for mu in np.geomspace(*RANGE, GRID):
            if rate(name, case, mu)[0] >= level:
                break
            low = mu
        if low is None or low == mu:
            return None
        star = brentq(lambda mu: rate(name, case, mu)[0] - level, low, mu, xtol=1e-6)
        value, later = rate(name, case, star)[1], rate(name, case, AROUND * star)[0]
    except np.linalg.LinAlgError:
        return None
    leaves = abs(value.imag) < 1e-9 and value.real > 0 and later >= 1
    return None if leaves or not _alone(case, star) else float(star)


def _alone(case: Case, mu: float) -> bool:
    """Whether a problem of the plane has one solution a little above and below mu."""
    near = [case.loaded(mu=np.full(len(case.mu), x)) for x in (mu / AROUND, mu * AROUND)]
    return all(len(all_solutions(one.problem())) == 1 for one in near)


def fails(name: str, case: Case, mu: float, cold: bool = False) -> bool:
    """Whether a method fails on the problem with this friction coefficient, begun near the
    solution, or `cold` without forces, as peers always do.
    """
    case = case.loaded(mu=np.full(len(case.mu), mu))
    error = np.random.default_rng(0).normal(size=case.r.shape)
    start = None if cold else case.r * (1 + BEGUN * error)
    return run(name, replace(case, start=start)).failed


def observed(fails: Callable[[float], bool], star: float) -> float:
    """Where a method begins to fail, if that is within 5 % of the predicted mu; nan if not."""
    low, high = star / AROUND, star * AROUND
    if fails(low) or not fails(high):
        return float("nan")
    while high / low > 1 + RESOLVED:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if fails(middle) else (middle, high)
    return float(np.sqrt(low * high))


def fresh(name: str, seed: int) -> tuple[Case, float]:
    """The first problem of a seed for which a threshold is predicted, and the threshold."""
    random = np.random.default_rng([seed, 1])
    while True:
        case = draw(random, int(random.integers(1, 4)), 2, {"weak"})
        star = threshold(name, case)
        if star is not None and rate(name, case, AROUND * star)[0] >= 1:  # it does not only crawl
            return case, star


def one_contact(b: float, mu: float, e: float, slip: float = 1.0, force: float = 1.0) -> Case:
    """One contact in the plane, Q = (1, b; b, 1), that slips with e by so much."""
    none = np.zeros((2, 0))
    r, u = np.array([[force, 0.0]]), np.array([[0.0, e * slip]])
    Q = np.array([[1.0, b], [b, 1.0]])
    return Case(Q, u, np.array([mu]), none, np.zeros(0), r, u).loaded()


def pair(ratio: float, b: float, mu: float = 0.5) -> Case:
    """Two contacts that do not feel each other, the second one stiffer by this ratio; both slip."""
    one = one_contact(b, mu, 1.0)
    none = np.zeros((4, 0))
    Q, q = la.block_diag(one.Q, ratio * one.Q), np.zeros((2, 2))
    return Case(Q, q, np.full(2, mu), none, np.zeros(0), np.tile(one.r, (2, 1)),
                np.tile(one.u, (2, 1))).loaded()  # fmt: skip


def newton_load(b: float, mu: float) -> Case:
    """The load of one contact on which Newton's method cycles if any does, in the middle of the
    window defined at the top."""
    slip = np.sqrt((1 - b**2) * max(mu**2 - 1, 0.01))
    return one_contact(b, mu, -np.sign(b), slip)


def penalty_error(case: Case, factor: float) -> float:
    """The certificate of the penalty method that its penetration makes."""
    problem = case.problem()
    yard = yardsticks(problem, case.r, case.u - case.q, case.q)
    slip = np.any(case.u[:, 1:] != 0, axis=1)
    mean = np.diag(problem.Q).mean()
    error = yard.rho * case.r[:, 0] * mean / factor * np.sqrt(1 + slip * case.mu**2)
    return float((error / yard.force).max())
