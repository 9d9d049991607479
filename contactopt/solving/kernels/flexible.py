"""GMRES with a preconditioner that may change from iteration to iteration, in the norm of given weights.

The basis is kept in single precision, which halves its memory and limits the reduction by one run to about 1e-5; Newton's
steps ask for less. Scalar products do not use BLAS, whose threads would spin until the next call.

Source: Saad (1993), A flexible inner-outer preconditioned GMRES algorithm.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from contactopt.solving.deadline import check_time

SINGLE = np.float32
RESTART, RUNS = 40, 3
FINEST = 1e-5  # reduction of the residual by one run that single precision can hold

Act = Callable[[np.ndarray], np.ndarray]


def flexible_gmres(product: Act, inverse: Act, right: np.ndarray, weights: np.ndarray, rtol: float) -> np.ndarray:
    """x (n,) with |W (right - A x)| <= rtol |W right|, W = diag(weights), or the best after RUNS runs of RESTART iterations.

    Parameters
    ----------
    product : x -> A x
    inverse : r -> an approximation of A^-1 r
    right, weights : (n,) right side, and positive weights of its entries
    rtol : relative size of the residual
    """
    x, residual = np.zeros(len(right)), right
    goal = rtol * _norm(weights * right)
    for run in range(RUNS):
        size = _norm(weights * residual)
        if size <= goal:
            break
        x += _run(product, inverse, residual, weights, max(goal / size, FINEST))
        if run + 1 < RUNS and goal:
            residual = right - product(x)
    return x


def _run(product: Act, inverse: Act, right: np.ndarray, weights: np.ndarray, rtol: float) -> np.ndarray:
    """One run of at most RESTART iterations from zero."""
    n, first = len(right), _norm(weights * right)
    basis = [(weights * right / first).astype(SINGLE)]
    images: list[np.ndarray] = []
    H = np.zeros((RESTART + 1, RESTART))
    y: np.ndarray = np.zeros(0)
    for j in range(min(RESTART, n)):
        check_time()
        # The product acts on the rounded vector that is kept, so that the rounding leaves no error.
        images.append(inverse(basis[j] / weights).astype(SINGLE))
        v = (weights * product(images[j].astype(float))).astype(SINGLE)
        for i, b in enumerate(basis):
            H[i, j] = np.einsum("i,i", b, v)
            v -= SINGLE(H[i, j]) * b
        H[j + 1, j] = _norm(v)
        unit = np.zeros(j + 2)
        unit[0] = first
        y = np.asarray(np.linalg.lstsq(H[: j + 2, : j + 1], unit, rcond=None)[0])
        left = np.linalg.norm(unit - H[: j + 2, : j + 1] @ y)
        if left <= rtol * first or H[j + 1, j] <= FINEST * np.abs(H[: j + 1, j]).max():
            break
        basis.append(v / SINGLE(H[j + 1, j]))
    x = np.zeros(n)
    for coefficient, image in zip(y, images):
        x += coefficient * image
    return x


def _norm(x: np.ndarray) -> float:
    return float(np.sqrt(np.einsum("i,i", x, x)))
