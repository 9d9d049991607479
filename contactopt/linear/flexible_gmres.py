"""GMRES with a preconditioner that may change, in the norm of given weights.

The basis is kept in single precision, which limits the reduction by one run to about 1e-5. Scalar
products do not use BLAS, whose threads would spin until the next call. Source: Saad (1993), A
flexible inner-outer preconditioned GMRES algorithm.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from contactopt.linear.deadline import check_time
from contactopt.linear.stacked import Vector, dot, norm

SINGLE = np.float32
RESTART, RUNS = 40, 3
FINEST = 1e-5  # reduction of the residual by one run that single precision can hold

Act = Callable[[Any], Any]


def flexible_gmres(product: Act, inverse: Act, right: Vector, weights: Vector, rtol: float) -> Any:
    """Solve A x = b, `inverse` may change, to |W (b - A x)| <= rtol |W b|, W = diag(weights)."""
    x, residual = 0.0 * right, right
    goal = rtol * norm(weights * right)
    for run in range(RUNS):
        size = norm(weights * residual)
        if size <= goal:
            break
        x = x + _run(product, inverse, residual, weights, max(goal / size, FINEST))
        if run + 1 < RUNS and goal:
            residual = right - product(x)
    return x


def _run(product: Act, inverse: Act, right: Vector, weights: Vector, rtol: float) -> Any:
    """One run of at most RESTART iterations from zero."""
    first = norm(weights * right)
    basis = [(weights * right / first).astype(SINGLE)]
    images: list[Any] = []
    H = np.zeros((RESTART + 1, RESTART))
    y: np.ndarray = np.zeros(0)
    for j in range(RESTART):
        check_time()
        # The product acts on the rounded vector that is kept, so that the rounding leaves no error.
        images.append(inverse(basis[j] / weights).astype(SINGLE))
        v = (weights * product(images[j].astype(float))).astype(SINGLE)
        for i, b in enumerate(basis):
            H[i, j] = dot(b, v)
            v = v - float(H[i, j]) * b
        H[j + 1, j] = norm(v)
        unit = np.zeros(j + 2)
        unit[0] = first
        y = np.asarray(np.linalg.lstsq(H[: j + 2, : j + 1], unit, rcond=None)[0])
        left = np.linalg.norm(unit - H[: j + 2, : j + 1] @ y)
        if left <= rtol * first or H[j + 1, j] <= FINEST * np.abs(H[: j + 1, j]).max():
            break
        basis.append(v / float(H[j + 1, j]))
    x = 0.0 * right
    for coefficient, image in zip(y, images):
        x = x + coefficient * image
    return x
