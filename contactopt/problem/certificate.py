"""The certificate of every answer: how far reactions are from solving an interface problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.errors import InputError
from contactopt.problem.cones import split
from contactopt.problem.interface_problem import InterfaceProblem


@dataclass(frozen=True, eq=False)
class Moved:
    """Q r, known from displacements that are carried along with the forces r.

    value     (k dim,) [length]
    accuracy  error of these displacements in the energy norm, relative to them: how far the bodies are from equilibrium
    """

    value: np.ndarray
    accuracy: float


@np.errstate(over="ignore", invalid="ignore")  # numbers beyond the range of floats are no solution
def natural_map_residual(
    problem: InterfaceProblem,
    reactions: np.ndarray,
    multipliers: np.ndarray | None = None,
    rho: float | None = None,
    moved: Moved | None = None,
) -> float:
    """How far reactions are from a solution, dimensionless: the certificate of every answer.

    With K the product of the law's sets of forces, g its opening (Coulomb: the friction cones and mu |u_t|) and
    w = q + V lambda,
        |r - proj_K(r - rho (u + g n))| / max(|r|, rho |w|, rho |u|),
    which is zero exactly at the solutions (contactopt.problem.laws).
    rho = 1 without a plate is the measure of Siconos and FCLib, which depends on units. By default rho [force/length]
    makes |r| and the smaller of rho |w|, rho |Q r| comparable, so that no choice of units can hide an error: the
    result is the same in all units. A relative error of the balance V' r + s = 0 counts as well: the larger is given.

    reactions    (k, dim) forces, normal first
    multipliers  (p,) displacements of the plates; None: those that fit best, by least squares
    moved        Q r where it is known already; then its accuracy counts as well, and the largest of all is given
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
    under = (problem.Q @ r.ravel() if moved is None else moved.value).reshape(r.shape)
    u = under + w
    if rho is None:
        rho = balanced_step(r, under, u, w)
    size = max(np.linalg.norm(r), rho * np.linalg.norm(w), rho * np.linalg.norm(u))
    gap = 0.0
    if size != 0:
        gap = float(np.linalg.norm(r - problem.law.natural_map(r, u, rho)) / size)
    worst = np.max([gap, balance_residual(problem, r), 0.0 if moved is None else moved.accuracy])
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

    Those are u_n where r_n > 0 and u_t where |r_t| is below the friction bound. With none, zeros.
    """
    if len(problem.s) == 0:
        return np.zeros(0)
    r_n, r_t = split(reactions)
    size = np.abs(r_n).max(initial=0.0)
    pressed = np.abs(r_n) > 1e-8 * size
    stuck = pressed & (np.linalg.norm(r_t, axis=1) < (1 - 1e-6) * problem.law.bound(r_n))
    rows = np.concatenate([pressed[:, None], np.repeat(stuck[:, None], problem.dim - 1, axis=1)], axis=1).ravel()
    if not rows.any():
        return np.zeros(len(problem.s))
    u = (problem.Q @ reactions.ravel())[rows] + problem.q.ravel()[rows]
    return np.asarray(np.linalg.lstsq(problem.V[rows], -u, rcond=None)[0])
