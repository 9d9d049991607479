"""Many small problems of one size at once: compiled sweeps on each, then Newton's method on all
that are left, vectorised.

Each step solves (I - D + D rho Q) dr = P(r - rho u) - r for every problem that is not solved yet
(contactopt.methods.kernels.semismooth), all in one call of LAPACK. What these steps do not solve,
the default method solves. Every answer has the certificate of contactopt.problem.certificate.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from contactopt.checks import check_number, real_array
from contactopt.defaults import TOL
from contactopt.errors import InputError
from contactopt.methods.driver import solve
from contactopt.methods.small import solve_small
from contactopt.problem import InterfaceProblem, Solution, Status, natural_map_residual
from contactopt.problem.laws.coulomb import Coulomb

STEPS = 20  # Newton steps, beyond which a problem is left to the default method
RIDGE = 1e-12  # of the mean compliance, for directions without any
NAME = "Newton's method in a batch"


def solve_batch(Q: ArrayLike, q: ArrayLike, mu: ArrayLike, tol: float = TOL) -> list[Solution]:
    """Solve many small problems of one size, without plates, under Coulomb friction.

    Parameters
    ----------
    Q : (b, k dim, k dim) compliances [length / force]
    q : (b, k, dim) displacements without forces, normal first [length]
    mu : friction coefficients: one, (k,) of the contacts of every problem, or (b, k)
    tol : bound on the certificate of each answer [-]

    Returns
    -------
    The b solutions, each with its status and its certificate.

    Raises
    ------
    InputError : on shapes that do not fit and numbers that are not finite
    """
    check_number("tol", tol, low=0.0)
    return solve_all(problems_of(Q, q, mu), tol)


def problems_of(Q: ArrayLike, q: ArrayLike, mu: ArrayLike) -> list[InterfaceProblem]:
    """The problems of a batch; InputError as of `solve_batch`."""
    compliance, gaps = real_array("Q", Q), real_array("q", q)
    if gaps.ndim != 3 or gaps.shape[2] not in (2, 3):
        raise InputError(
            f"q must have shape (problems, contacts, 2 or 3); got {gaps.shape}. A single problem is"
            " an InterfaceProblem."
        )
    b, k, dim = gaps.shape
    if compliance.shape != (b, k * dim, k * dim):
        raise InputError(f"Q must have shape {(b, k * dim, k * dim)}; got {compliance.shape}.")
    friction = real_array("mu", mu)
    if friction.shape not in ((), (k,), (b, k)):
        raise InputError(f"mu must be a number, {(k,)} or {(b, k)}; got {friction.shape}.")
    if not b:
        return []
    # the problem with the least entries is checked, and the others share its checks
    laws, least = np.broadcast_to(friction, (b, k)), compliance.diagonal(0, 1, 2)
    first = int(np.argmin(least.min(axis=1, initial=0.0)))
    Coulomb(laws.min(axis=0, initial=0.0))
    whole = InterfaceProblem(compliance[first], gaps[first], laws[first])
    return [whole.altered(Q=Q, q=q, law=Coulomb(mu)) for Q, q, mu in zip(compliance, gaps, laws)]


def solve_all(problems: list[InterfaceProblem], tol: float) -> list[Solution]:
    """The solutions of problems of one size as `problems_of` makes them."""
    if not problems or not problems[0].contacts:
        return [solve(problem, tol=tol) for problem in problems]
    found = [solve_small(problem, tol)[0] for problem in problems]
    rest = [problem for problem, solution in zip(problems, found) if solution is None]
    others = _by_newton(rest, tol) if rest else iter(())
    return [next(others) if solution is None else solution for solution in found]


def _by_newton(problems: list[InterfaceProblem], tol: float) -> Iterator[Solution]:
    """The solutions by Newton's method, of those that it does not solve by the default method."""
    forces, counts = _newton(
        np.stack([problem.Q for problem in problems]),
        np.stack([problem.q for problem in problems]),
        np.stack([problem.mu for problem in problems]),
    )
    none = np.zeros(0)
    for problem, r, steps in zip(problems, forces, counts):
        residual = natural_map_residual(problem, r, none)
        if residual <= tol:
            yield Solution(r, none, Status.SOLVED, residual, int(steps), NAME)
        else:
            yield solve(problem, tol=tol)


@np.errstate(all="ignore")  # what overflows is no solution, and is left to the default method
def _newton(Q: np.ndarray, q: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces (b, k, dim) that Newton's steps from no force reach, and how many steps (b,)."""
    (b, k, dim), n = q.shape, Q.shape[1]
    compliance = Q.diagonal(0, 1, 2).reshape(b, k, dim).mean(axis=2)
    least = RIDGE * np.maximum(compliance.mean(axis=1), np.finfo(float).tiny)
    rho = 1 / np.maximum(compliance, least[:, None])
    r, left, one = np.zeros(q.shape), np.arange(b), np.eye(dim)
    counts = np.zeros(b, dtype=int)
    own = np.arange(k)
    for _ in range(STEPS):
        at = r[left]
        u = (Q[left] @ at.reshape(-1, n, 1)).reshape(at.shape) + q[left]
        law = Coulomb(mu[left].ravel())
        P, D = law.project((at - rho[left, :, None] * u).reshape(-1, dim))
        error = P.reshape(at.shape) - at
        residual, size = np.linalg.norm(error, axis=(1, 2)), np.linalg.norm(at, axis=(1, 2))
        goes_on = residual > 1e-13 * size  # else rounding is left
        r[left] = at + error  # within the bounds of the law; the same forces at a solution
        left, at, error, D = left[goes_on], at[goes_on], error[goes_on], D.reshape(-1, k, dim, dim)
        if not len(left):
            break
        D = D[goes_on]
        scaled = D * rho[left][:, :, None, None]
        M = (scaled @ Q[left].reshape(-1, k, dim, n)).reshape(-1, k, dim, k, dim)
        M[:, own, :, own, :] += (one - D + least[left, None, None, None] * scaled).swapaxes(0, 1)
        step = _solved(M.reshape(-1, n, n), error.reshape(-1, n, 1))
        r[left] = at + step.reshape(at.shape)
        counts[left] += 1
    return r, counts


def _solved(M: np.ndarray, right: np.ndarray) -> np.ndarray:
    """M^-1 right of each matrix M (b, n, n); numbers that are none where M is singular."""
    try:
        return np.asarray(np.linalg.solve(M, right))
    except np.linalg.LinAlgError:
        if len(M) == 1:
            return np.full(right.shape, np.nan)
    return np.concatenate([_solved(M[i : i + 1], right[i : i + 1]) for i in range(len(M))])
