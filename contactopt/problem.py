"""The interface problem of frictional contact, its solution and its certificate. Knows nothing of finite elements.

    u = Q r + V lambda + q,      V' r + s = 0,                                     (paper, eq (14))
    u_n >= 0,  r_n >= 0,  u_n r_n = 0,        (Signorini; bilateral contact instead: u_n = 0)      (15)
    |r_t| <= mu |r_n|,  and where u_t != 0:  r_t = -mu |r_n| u_t / |u_t|.             (Coulomb)   (16)-(17)

One block per contact node, normal component first. r is the force on the upper body, r_n >= 0 in compression;
u is the relative displacement plus the initial gap, so that u_n is the gap that remains. In the paper's letters
R_n = -r_n and w_n - d = -u_n. V holds the rigid motions of bodies that are held only by a plate under a total force:
lambda is the plate's displacement, s collects minus what r must balance.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.cones import friction_cone, split
from contactopt.errors import InputError
from contactopt.operators import NOISE, Interface, InterfaceOperator, diagonal


class Status(Enum):
    """How a solve ended: a word for tables and a sentence for people."""

    SOLVED = "solved", "the natural-map residual is at most the tolerance"
    SETTLED = "settled", "the method ended by its own criterion, but the certificate is above the tolerance"
    ITERATION_LIMIT = "iteration_limit", "the iterations ran out with the certificate above the tolerance"
    TIME_LIMIT = "time_limit", "the time ran out with the certificate above the tolerance"
    CYCLING = "cycling", "the iteration came back to an earlier state, so it cannot converge; try relaxation"
    STALLED = "stalled", "the iterate no longer changes, but the certificate is above the tolerance"
    DIVERGED = "diverged", "the iterates grew without bound; the last finite one is kept"
    BACKEND_FAILED = "backend_failed", "a QP or conic backend gave no usable answer"

    def __init__(self, label: str, sentence: str):
        self.label = label
        self.sentence = sentence

    def __str__(self) -> str:
        return self.label


@dataclass(frozen=True, eq=False)
class InterfaceProblem:
    """Coulomb contact at k nodes in `dim` dimensions, as in the head of this module.

    Q            (k dim, k dim) compliance, symmetric positive semidefinite [length / force]: an array, or an
                 InterfaceOperator that knows it by its products only
    q            (k, dim) displacement at r = 0, lambda = 0 [length]; q_n holds the initial gap
    mu           (k,) friction coefficients
    V, s         (k dim, p) rigid motions and (p,) resultants [force]; p = 0 without a plate
    areas        (k,) nodal areas, force / area = traction; ones by default
    coordinates  (d, k) positions of the nodes, for output only; 0, 1, 2, ... by default
    bilateral    no separation: u_n = 0, friction bound mu |r_n|
    Raises InputError on wrong shapes, numbers that are not finite, negative mu, an unsymmetric Q or one with a negative
    diagonal (an indefinite Q is not looked for: its answers are certified like any other; an operator is taken at its
    word).
    """

    Q: Interface
    q: np.ndarray
    mu: np.ndarray
    V: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    areas: np.ndarray = field(default_factory=lambda: np.zeros(0))
    coordinates: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    bilateral: bool = False

    def __post_init__(self) -> None:
        q = np.atleast_2d(np.asarray(self.q, dtype=float))
        k, dim = q.shape
        if dim not in (2, 3):
            raise InputError(f"q must have 2 or 3 columns (normal first), one row per contact; got shape {q.shape}.")
        places = np.atleast_2d(self.coordinates if np.size(self.coordinates) else np.arange(k))
        implicit = isinstance(self.Q, InterfaceOperator)
        arrays: dict[str, tuple[Any, tuple[int, ...]]] = {
            "Q": (self.Q, (k * dim, k * dim)),
            "q": (q, (k, dim)),
            "mu": (np.broadcast_to(self.mu, (k,)) if np.ndim(self.mu) == 0 else self.mu, (k,)),
            "s": (self.s, (np.size(self.s),)),
            "V": (self.V if np.size(self.s) else np.zeros((k * dim, 0)), (k * dim, np.size(self.s))),
            "areas": (self.areas if np.size(self.areas) else np.ones(k), (k,)),
            "coordinates": (places, (len(places), k)),
        }
        for name, (value, shape) in arrays.items():
            array = self.Q if name == "Q" and implicit else np.array(value, dtype=float)
            if array.shape != shape:
                raise InputError(f"{name} must have shape {shape}; got {array.shape}.")
            if array is self.Q:
                continue
            if not np.all(np.isfinite(array)):
                raise InputError(f"{name} holds a number that is not finite.")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if np.any(self.mu < 0):
            raise InputError(f"the friction coefficient mu must not be negative; its least value is {self.mu.min():g}.")
        if isinstance(self.Q, InterfaceOperator):
            return
        if np.abs(self.Q - self.Q.T).max(initial=0.0) > 1e-2 * np.abs(self.Q).max(initial=0.0):
            raise InputError("Q must be symmetric (to 1 %); check the order of its rows and columns.")
        if np.diag(self.Q).min(initial=0.0) < -1e-12 * np.abs(self.Q).max(initial=0.0):
            raise InputError("Q must be positive semidefinite, but it has a negative diagonal entry; check its sign.")

    @property
    def contacts(self) -> int:
        return len(self.q)

    @property
    def dim(self) -> int:
        return int(self.q.shape[1])

    @cached_property
    def fingerprint(self) -> str:
        """Digest of the problem's data, for caching and for naming it in tables."""
        digest = hashlib.sha256(bytes([self.bilateral]))
        implicit = isinstance(self.Q, InterfaceOperator)
        probe = self.Q @ np.random.default_rng(0).normal(size=self.q.size) if implicit else self.Q
        for array in (probe, self.q, self.mu, self.V, self.s):
            digest.update(repr(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]

    def explicit(self) -> InterfaceProblem:
        """The same problem with Q an array."""
        return replace(self, Q=self.Q.to_dense()) if isinstance(self.Q, InterfaceOperator) else self

    def displacements(self, reactions: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
        """u = Q r + V lambda + q, (k, dim) [length]."""
        return (self.Q @ reactions.ravel() + self.V @ multipliers).reshape(self.q.shape) + self.q


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a solve ended: always the last iterate, whatever the status.

    reactions    (k, dim) nodal forces on the upper body, normal first [force]
    multipliers  (p,) displacements lambda of the plates [length]
    residual     the certificate: natural_map_residual(problem, reactions, multipliers)
    history      one mapping per outer iteration: residual, change (of the tangential force), seconds and, where Q is an
                 operator, products, the method's products with Q so far
    seconds      phase -> time
    """

    reactions: np.ndarray
    multipliers: np.ndarray
    status: Status
    residual: float
    iterations: int
    method: str
    history: tuple[dict[str, float], ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    message: str = ""

    @property
    def products(self) -> int:
        """Products with Q that the method took, of which the certificate has its own; 0 where Q is an array."""
        return int(self.history[-1].get("products", 0)) if self.history else 0

    @property
    def solved(self) -> bool:
        return self.status is Status.SOLVED


@dataclass(frozen=True)
class Scales:
    """Units in which a problem is dimensionless: force, length, and one length per multiplier."""

    force: float
    length: float
    multipliers: np.ndarray

    def to_physical(self, reactions: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return reactions * self.force, multipliers * self.multipliers

    def to_dimensionless(self, reactions: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return reactions / self.force, multipliers / self.multipliers


def dimensionless(problem: InterfaceProblem) -> tuple[InterfaceProblem, Scales]:
    """The same problem with mean diagonal of Q one, forces of order one and unit columns of V.

    The force scale is the mean force that the balance asks of a node or, without a balance, the force that closes
    the root-mean-square of q at one node. Every change of units of the input gives the same numbers here.
    A component that cannot move (on a symmetry plane, say) carries no force that matters: a unit compliance there
    makes that force zero instead of undetermined.
    """
    d = diagonal(problem.Q)
    compliance = float(np.mean(d[d > 0])) if np.any(d > 0) else 1.0
    columns = np.linalg.norm(problem.V, axis=0)
    total = np.abs(problem.V).sum(axis=0)
    resultant = np.divide(np.abs(problem.s), total, out=np.zeros(len(problem.s)), where=total > 0)
    force = float(resultant.max(initial=0.0)) or float(np.sqrt(np.mean(problem.q**2))) / compliance or 1.0
    length = force * compliance
    columns = np.where(columns > 0, columns, 1.0)
    implicit = isinstance(problem.Q, InterfaceOperator)
    sizes = d if implicit else np.abs(problem.Q).max(axis=1)
    moves = [sizes, *np.abs(problem.V.T), np.abs(problem.q.ravel())]
    rigid = np.all([size <= NOISE * size.max(initial=0.0) for size in moves], axis=0)
    Q: Interface
    if isinstance(problem.Q, InterfaceOperator):
        Q = problem.Q.scaled(1 / compliance, rigid.astype(float))
    else:
        entries = np.array(problem.Q / compliance)
        entries[rigid, rigid] = 1.0
        Q = entries
    scaled = replace(
        problem,
        Q=Q,
        q=problem.q / length,
        V=problem.V / columns,
        s=problem.s / (columns * force),
    )
    return scaled, Scales(force, length, length / columns)


@np.errstate(over="ignore", invalid="ignore")  # numbers beyond the range of floats are no solution
def natural_map_residual(
    problem: InterfaceProblem, reactions: np.ndarray, multipliers: np.ndarray | None = None, rho: float | None = None
) -> float:
    """How far reactions are from a solution, dimensionless: the certificate of every answer.

    With K the product of the friction cones and w = q + V lambda,
        |r - proj_K(r - rho (u + mu |u_t| n))| / max(|r|, rho |w|, rho |u|),
    which is zero exactly at the solutions; for bilateral contact K allows tension and the bound is mu |r_n|.
    rho = 1 without a plate is the measure of Siconos and FCLib, which depends on units. By default rho [force/length]
    makes |r| and the smaller of rho |w|, rho |Q r| comparable, so that no choice of units can hide an error: the
    result is the same in all units. A relative error of the balance V' r + s = 0 counts as well: the larger is given.

    reactions    (k, dim) forces, normal first
    multipliers  (p,) displacements of the plates; None: those that fit best, by least squares
    Raises InputError on shapes that do not fit; returns inf if a reaction is not finite.
    Source: Acary, Bremond, Huber (2018), On solving contact problems with Coulomb friction: formulations and
    numerical comparisons.
    """
    r = np.asarray(reactions, dtype=float)
    if r.shape != problem.q.shape:
        raise InputError(f"reactions must have shape {problem.q.shape}, normal first; got {r.shape}.")
    if not np.all(np.isfinite(r)):
        return np.inf
    lam = fit_multipliers(problem, r) if multipliers is None else np.asarray(multipliers, dtype=float)
    if lam.shape != problem.s.shape:
        raise InputError(f"multipliers must have shape {problem.s.shape}; got {lam.shape}.")
    if not np.all(np.isfinite(lam)):
        return np.inf
    w = problem.q + (problem.V @ lam).reshape(r.shape)
    moved = (problem.Q @ r.ravel()).reshape(r.shape)
    u = moved + w
    if rho is None:
        rho = balanced_step(r, moved, u, w)
    size = max(np.linalg.norm(r), rho * np.linalg.norm(w), rho * np.linalg.norm(u))
    gap = 0.0
    if size != 0:
        gap = float(np.linalg.norm(r - friction_cone(r, u, rho, problem.mu, problem.bilateral)) / size)
    worst = np.max([gap, balance_residual(problem, r)])
    return float(worst) if np.isfinite(worst) else np.inf


def balanced_step(r: np.ndarray, moved: np.ndarray, u: np.ndarray, w: np.ndarray) -> float:
    """rho = |r| / min(max(|u|, |w|), 1e6 |Q r|): the step of the natural map at which no choice of units hides an error.

    The second term counts where r is next to nothing (open contact): there |r| alone says nothing about the scale.
    """
    force, change, *distances = (float(np.linalg.norm(x)) for x in (r, moved, u, w))
    distance = min(max(distances), 1e6 * change)
    return force / distance if force > 0 and distance > 0 else 1.0


def balance_residual(problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """Largest relative error of V' r + s = 0 [-]."""
    if len(problem.s) == 0:
        return 0.0
    error = np.abs(problem.V.T @ reactions.ravel() + problem.s)
    size = np.abs(problem.V).T @ np.abs(reactions.ravel()) + np.abs(problem.s)
    return float(np.max(np.divide(error, size, out=np.zeros_like(error), where=size > 0)))


def fit_multipliers(problem: InterfaceProblem, reactions: np.ndarray) -> np.ndarray:
    """The lambda that fits the reactions best: least squares on the components whose displacement must vanish.

    Those are u_n where r_n > 0 and u_t where |r_t| < mu r_n. With none, zeros.
    """
    if len(problem.s) == 0:
        return np.zeros(0)
    r_n, r_t = split(reactions)
    size = np.abs(r_n).max(initial=0.0)
    pressed = np.abs(r_n) > 1e-8 * size
    stuck = pressed & (np.linalg.norm(r_t, axis=1) < (1 - 1e-6) * problem.mu * np.abs(r_n))
    rows = np.concatenate([pressed[:, None], np.repeat(stuck[:, None], problem.dim - 1, axis=1)], axis=1).ravel()
    if not rows.any():
        return np.zeros(len(problem.s))
    u = (problem.Q @ reactions.ravel())[rows] + problem.q.ravel()[rows]
    return np.asarray(np.linalg.lstsq(problem.V[rows], -u, rcond=None)[0])
