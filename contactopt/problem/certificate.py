"""The certificate of every answer: how far reactions are from solving an interface problem.

Two yardsticks of the problem and of the answer make the certificate dimensionless, a force F and a
length L. With d = Q r, w = q + V lambda and u = d + w, |.| the length of one contact's block and F0
the largest |r_i|:

    L = the largest of  a_i |d_i|        displacements that the forces make where they act,
                        max(-w_n, 0)     overlaps that the forces must remove,
                        min |w_n|        the narrowest gap,
                        1e-6 a_i |q_i|   what rounding leaves of gaps that motions closed,
                        1e-6 c min(F0, S)   and of displacements that cancel, as those of a uniform
                                         pressure on a periodic half-space,
        with the weight a_i = min(1, |r_i| / (1e-6 F0));
    F = min(F0, max(L / c, S)), at least 1e-5 max(L / c, S), with the mean compliance
        c = sum |r_i| c_i / sum |r_i|, c_i the mean of the diagonal of Q over block i, and the force
        on a plate S = max_j |s_j| / max_i |V_ij|.

L does not grow with the gaps of distant contacts, which stay open. F does not grow with forces that
move nothing (the null space of Q): a force counts only as far as it makes a displacement or holds a
plate.

With the contact law's map P (for Coulomb friction the map of Alart and Curnier) the error of
contact i is

    e_i = |r_i - P(r_i - rho_i u_i)| / F,       rho_i = (F / L) min(max(c / c_i, 1), 1e4),

which is zero at all contacts exactly at the solutions. A contact much stiffer than the mean has a
larger rho_i, because there a small error of the displacement is a large error of the force. The
certificate is the largest of all e_i, of (|r_t| - mu r_n) / F, and of the relative errors |V_j' r +
s_j| / max(|s_j|, max_i |V_ij| F) of the balance. Forces of more than 1e4 F hide errors below their
own rounding, 2^-52 |r_i| / F, which counts as one more error. Where s_j is not zero F is at most F0
there: a body that flies away from all contacts, which makes L and F as large as one likes, balances
nothing.

What a certificate of at most tol promises for Coulomb friction, at every contact:

    penetration          u_n >= -tol L
    tension              r_n >= -tol F
    complementarity      r_n <= tol F  or  u_n <= tol L
    friction bound       |r_t| <= mu r_n + tol F
    sticking             |u_t| <= tol L  where  |r_t| < mu r_n - (1 + mu) tol F
    slip direction       friction across the direction of slip is at most  tol F (1 + mu r_n L / (F
                         |u_t|))
    balance              |V_j' r + s_j| <= tol max(|s_j|, max_i |V_ij| F)

Under orthotropic friction P projects on ellipses, and the bound is that in the direction of r_t.
The certificate does not bound the distance to a solution: where Q is nearly singular, forces that
differ much have displacements that differ little (`amplification` says how much). It is the same in
all units, and costs one product with Q.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from contactopt.errors import InputError
from contactopt.linear.stacked import Stacked
from contactopt.problem.cones import lengths
from contactopt.problem.interface_problem import InterfaceProblem
from contactopt.problem.laws.law import Law
from contactopt.problem.scaling import along_rest, immovable

ACTS = 1e-6  # share of the largest force from which on a contact's displacement counts fully in L
# share of a closed gap, or of a displacement that cancels, below which its remainder is rounding
ROUNDED = 1e-6
DUST = 1e-5  # share of the force that closes the gaps below which forces are rounding
# rounding of r - rho u, over r, and how many times F the forces are from where on it counts
ROUNDING, UNSEEN = 2.0**-52, 1e4
# share of a gap, or of the largest motion, up to which what motions leave of a gap is none: they
# are known to the rounding of the few equations that give them
CANCELLED = 16 * ROUNDING


@dataclass(frozen=True, eq=False)
class Moved:
    """Q r, known from displacements that are carried along with the forces r.

    value          (k dim,) [length]
    accuracy       relative error of these displacements in the energy norm
    displacements  (N,) the unknowns X of contactopt.linear.saddle_point [length]
    """

    value: np.ndarray
    accuracy: float
    displacements: Stacked | None = None


@dataclass(frozen=True)
class Yardsticks:
    """What errors are compared with: force F, length L, steps rho (k,) of the natural map."""

    force: float
    length: float
    rho: np.ndarray

    def errors(self, law: Law, r: np.ndarray, u: np.ndarray) -> np.ndarray:
        """e_i (k,) as defined at the top, for forces r and displacements u, both (k, dim)."""
        return lengths(r - law.mapped(r - self.rho[:, None] * u)) / self.force


@np.errstate(all="ignore")  # numbers beyond the range of floats are no solution
def natural_map_residual(
    problem: InterfaceProblem,
    reactions: np.ndarray,
    multipliers: np.ndarray | None = None,
    moved: Moved | None = None,
) -> float:
    """How far reactions are from a solution, dimensionless: the certificate, as at the top of this
    module.

    Parameters
    ----------
    problem : the interface problem
    reactions : (k, dim) forces, normal first [force]
    multipliers : (p,) displacements of the plates [length]; None: those that fit best
        (`fit_multipliers`)
    moved : Q r where it is known already; then its accuracy counts as well

    Returns
    -------
    The largest relative error [-], 0 at a solution; inf if a number is not finite.

    Raises
    ------
    InputError : On shapes that do not fit.
    """
    r, lam = _checked(problem, reactions, multipliers)
    if not (np.isfinite(r).all() and np.isfinite(lam).all()):
        return np.inf
    if len(r) == 0:
        return balance_residual(problem, r)
    d = np.asarray(problem.Q @ r.ravel() if moved is None else moved.value).reshape(r.shape)
    w = problem.q
    if len(lam):
        moved_by = (problem.V @ lam).reshape(r.shape)
        w = w + moved_by
        largest = float(np.max(problem.reach * np.abs(lam)))
        sizes = np.maximum(np.abs(problem.q), np.where(moved_by != 0, largest, 0.0))
        w[np.abs(w) <= CANCELLED * sizes] = 0.0
    u = d + w
    measure = yardsticks(problem, r, d, w)
    beyond = lengths(r[:, 1:]) - problem.law.bound_along(r)
    largest = float(lengths(r).max()) / measure.force
    worst = max(
        float(measure.errors(problem.law, r, u).max()),
        ROUNDING * largest if largest > UNSEEN else 0.0,
        float(beyond.max()) / measure.force,
        balance_residual(problem, r, measure.force),
        0.0 if moved is None else moved.accuracy,
    )
    return worst if np.isfinite(worst) else np.inf


def yardsticks(
    problem: InterfaceProblem, r: np.ndarray, d: np.ndarray, w: np.ndarray
) -> Yardsticks:
    """Force F, length L and steps rho, as above, for r and finite d = Q r and w = q + V lambda."""
    size, gap = lengths(r), w[:, 0]
    largest = float(size.max())
    weight = np.minimum(1.0, size / (ACTS * largest)) if largest > 0 else np.zeros(len(r))
    away = np.abs(gap)
    overlap = -gap if problem.law.unilateral else np.where(problem.law.lowest < 0, away, -gap)
    length = max(
        float((weight * lengths(d)).max()),
        float(overlap.max()),
        float(away.min()),
        ROUNDED * float((weight * problem.gaps).max()),
    )
    compliance, plates = problem.compliances, _plate_force(problem)
    work, total = float(size @ compliance), float(size @ (compliance > 0))
    if not total > 0:
        work, total = float(compliance.sum()), float(np.count_nonzero(compliance))
    mean = work / total if total > 0 else 0.0
    length = max(length, ROUNDED * mean * min(largest, plates))
    if length == 0:
        length = _least_displacement(r, d + w)
    natural = max(length / mean if mean > 0 else 0.0, plates)
    force = max(min(largest, natural), DUST * natural) if natural > 0 else largest
    force = force or 1.0  # no force, and none that would make a displacement: any number serves
    if length == 0:
        return Yardsticks(force, 0.0, np.zeros(len(r)))
    stiff = np.minimum(np.maximum(mean * problem.stiffnesses, 1.0), 1e4)  # times the mean rho
    return Yardsticks(force, length, stiff * (force / length))


def _plate_force(problem: InterfaceProblem) -> float:
    """S = max_j |s_j| / max_i |V_ij|, the force on a plate [force]; 0 without a plate."""
    if len(problem.s) == 0:
        return 0.0
    reach = problem.reach
    return float(
        np.max(np.divide(np.abs(problem.s), reach, out=np.zeros(len(reach)), where=reach > 0))
    )


def _least_displacement(r: np.ndarray, u: np.ndarray) -> float:
    """The least |u_i| of contacts that bear force or overlap; 0 without any."""
    size = np.linalg.norm(u, axis=1)
    counts = ((np.any(r != 0, axis=1)) | (u[:, 0] < 0)) & (size > 0)
    return float(size[counts].min()) if counts.any() else 0.0


def balance_residual(
    problem: InterfaceProblem, reactions: np.ndarray, force: float | None = None
) -> float:
    """The largest relative error [-] of the balance V' r + s = 0: |V_j' r + s_j| / max(|s_j|, max_i
    |V_ij| F), where F [force] is `force`, or the largest |r_i|. It is 0 without a balance, and
    infinite where a resultant that must vanish has no yardstick F.
    """
    if len(problem.s) == 0:
        return 0.0
    r = np.asarray(reactions, dtype=float)
    largest = float(np.linalg.norm(r, axis=1).max(initial=0.0))
    force = largest if force is None else force
    error = np.abs(problem.V.T @ r.ravel() + problem.s)
    sizes = np.where(problem.s == 0, force, min(force, largest))
    size = np.maximum(np.abs(problem.s), problem.reach * sizes)
    relative = np.divide(error, size, out=np.full_like(error, np.inf), where=size > 0)
    return float(np.max(np.where(error > 0, relative, 0.0)))


def amplification(
    problem: InterfaceProblem, reactions: np.ndarray, multipliers: np.ndarray
) -> float:
    """How many times the certificate bounds |dr_i| / F of forces, to first order: the condition of
    the solution, infinite if the forces are not unique.

    The derivative of natural map and balance is M = [[I - D + D rho Q, D rho V], [V', 0]], D that
    of P. The certificate bounds every block of M (dr, dlambda), so the largest sum of norms in a
    block row of M^-1 bounds dr. It needs the entries of Q, and no contact between two states.
    """
    k, dim = problem.q.shape
    if k == 0:
        return 0.0
    problem, r = along_rest(problem, np.asarray(reactions, dtype=float))
    d = (problem.Q @ r.ravel()).reshape(r.shape)
    w = problem.q + (problem.V @ multipliers).reshape(r.shape)
    measure = yardsticks(problem, r, d, w)
    D = problem.law.project(r - measure.rho[:, None] * (d + w))[1].copy()
    D[~problem.law.rough, 1:] = 0.0  # no friction, no tangential force
    D[immovable(problem).reshape(k, dim)] = 0.0
    rows = la.block_diag(*(measure.rho[:, None, None] * D))
    reach = np.where(problem.reach > 0, problem.reach, 1.0)
    V, size = problem.V / reach, np.maximum(np.abs(problem.s) / reach / measure.force, 1.0)
    _, felt, motions = la.svd(rows @ V, full_matrices=False)
    Z = motions[felt > 1e-12 * felt.max(initial=0.0)].T  # the rest moves nothing held
    scale, n = measure.length / measure.force, k * dim
    M = np.block(
        [
            [np.eye(n) - la.block_diag(*D) + rows @ problem.Q, scale * rows @ V @ Z],
            [(V @ Z).T, np.zeros((Z.shape[1],) * 2)],
        ]
    )
    try:
        inverse = np.linalg.inv(M)[:n].reshape(k, dim, -1)
    except np.linalg.LinAlgError:
        return np.inf
    blocks = inverse[:, :, :n].reshape(k, dim, k, dim).transpose(0, 2, 1, 3)
    own = np.linalg.norm(blocks, 2, axis=(2, 3)).sum(axis=1)
    return float((own + np.linalg.norm(inverse[:, :, n:], axis=1) @ (abs(Z).T @ size)).max())


def siconos_residual(
    problem: InterfaceProblem, reactions: np.ndarray, multipliers: np.ndarray | None = None
) -> float:
    """The measure by which Siconos and the FCLib collection compare methods; for comparison, not
    for a verdict.

    With K the product of the friction cones it is
    |r - proj_K(r - (u + mu |u_t| n))| / max(|q|, |r|, |u|), where |.| is the norm of all components
    together. It depends on units, and forces that move nothing or one distant open contact make it
    as small as one likes. The balance of a plate is not in it.

    Parameters
    ----------
    problem : the interface problem
    reactions : (k, dim) forces, normal first [force]
    multipliers : (p,) displacements of the plates [length]; None: those that fit best
        (`fit_multipliers`)

    Returns
    -------
    The residual [-], 0 at a solution.

    Source: Acary, Bremond, Huber (2018), On solving contact problems with Coulomb friction:
    formulations and numerical comparisons; De Saxce, Feng (1998) for the map.
    """
    r, lam = _checked(problem, reactions, multipliers)
    u = problem.displacements(r, lam)
    size = max(np.linalg.norm(problem.q), np.linalg.norm(r), np.linalg.norm(u))
    error = np.linalg.norm(r - problem.law.natural_map(r, u, 1.0))
    return float(error / size) if size > 0 else 0.0


def fit_multipliers(problem: InterfaceProblem, reactions: np.ndarray) -> np.ndarray:
    """The multipliers (p,) that fit best: u_n = 0 where pressed, u_t = 0 where sticking."""
    r = np.asarray(reactions, dtype=float)
    rows = np.repeat(problem.law.sticking(r)[:, None], problem.dim, axis=1)
    rows[:, 0] = problem.law.pressed(r)
    rows = rows.ravel()
    if len(problem.s) == 0 or not rows.any():
        return np.zeros(len(problem.s))
    u = (problem.Q @ r.ravel())[rows] + problem.q.ravel()[rows]
    V = problem.V[rows]
    columns = np.linalg.norm(V, axis=0)
    columns[columns == 0] = 1.0
    return np.asarray(np.linalg.lstsq(V / columns, -u, rcond=None)[0] / columns)


def _checked(
    problem: InterfaceProblem, reactions: np.ndarray, multipliers: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    try:
        r = np.asarray(reactions, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"reactions must be an array of numbers; got {type(reactions).__name__}."
        ) from error
    if r.shape != problem.q.shape:
        raise InputError(
            f"reactions must have shape {problem.q.shape}, normal first; got {r.shape}."
        )
    if multipliers is None:
        lam = fit_multipliers(problem, r) if np.all(np.isfinite(r)) else np.zeros(len(problem.s))
    else:
        lam = np.asarray(multipliers, dtype=float)
    if lam.shape != problem.s.shape:
        raise InputError(f"multipliers must have shape {problem.s.shape}; got {lam.shape}.")
    return r, lam
