"""Preconditioners of the interface operator Q = S1^-1 + S2^-1: approximate inverses of Q, O(k log k) per product.

Paper, section 5.2: the H^1/2 seminorm of a function on the contact line, extended by zero (E) to a closed curve of 2m
nodes, is a circulant matrix Q_c (27), the H^1 norm another, L_c (28); with m the smallest power of two >= k,
    P21 = E' Q_c E   (25),      P22 = (E' L_c^-1 Q_c E)^-1   (26),
up to a factor that no iteration sees. P21 resembles S1 + S2; the matrix that P22 inverts resembles Q itself. In 3D
the sum of P21 along both directions of the contact surface is P31 (29). Extension by zero belongs to functions that
vanish at the ends (H00^1/2), which a traction at a free edge does not:
    `neumann`, the square root of the Neumann Laplacian of the contact line or surface by the cosine transform,
needs no extension. Each acts on every component by itself. What is left are a few smooth motions of the two bodies against
each other, first of all the sway of a slender body: `deflated` solves for them exactly (balancing, Mandel 1993).
All need contact nodes that are evenly spaced on a line or a rectangle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.fft import dctn, idctn, irfft, rfft
from scipy.sparse.linalg import LinearOperator, cg

from contactopt.errors import InputError
from contactopt.problem import NOISE, InterfaceProblem

Grid = tuple[int, ...]  # contacts along the line, or along both sides of the rectangle
Product = Callable[[np.ndarray], np.ndarray]  # acts on arrays (*grid, j)

INNER = 1e-13  # relative accuracy of the Toeplitz solve inside P22, which makes it a fixed linear operator


def seminorm(m: int) -> np.ndarray:
    """First column (2m,) of the sparse circulant matrix of the H^1/2 seminorm, eq (27); about log2 m entries.

    Its rows sum to zero where m is a power of two: constants are the kernel of a seminorm.
    """
    column, top = np.zeros(2 * m), int(np.ceil(np.log2(m)))
    column[0] = 2 * np.sum(1 / np.arange(1, 2**top) ** 2.0)
    for i in range(1, top + 1):
        j = 2**i - 1
        if j < m:
            column[[j, -j]] -= np.sum(1 / np.arange(2 ** (i - 1), 2**i) ** 2.0)
    return column


def norm(m: int, h: float) -> np.ndarray:
    """First column (2m,) of the circulant matrix of the H^1 norm, eq (28)."""
    column = np.zeros(2 * m)
    column[0], column[[1, -1]] = 2 / h + h, -1 / h
    return column


def p21(grid: Grid) -> Product:
    """Eq (25): E' Q_c E on a line; on a rectangle the sum of it along both directions, P31, eq (29)."""
    lines = [_restricted(rfft(seminorm(_curve(k))).real, k, axis) for axis, k in enumerate(grid)]
    return lambda X: np.sum([line(X) for line in lines], axis=0)


def p22(grid: Grid) -> Product:
    """Eq (26): (E' L_c^-1 Q_c E)^-1, a Toeplitz system solved by conjugate gradients; on a line only.

    h is the spacing over a quarter of the contact line's length, so that units do not matter.
    """
    if len(grid) > 1:
        raise InputError("preconditioner 'p22' is for contact lines (2D); in 3D choose p21 or neumann.")
    (k,) = grid
    m = _curve(k)
    symbol = rfft(seminorm(m)).real / rfft(norm(m, 4 / (k - 1))).real
    product, guess = _restricted(symbol, k, 0), p21(grid)
    toeplitz = LinearOperator((k, k), matvec=lambda x: product(x.reshape(k, 1))[:, 0], dtype=float)
    near = LinearOperator((k, k), matvec=lambda x: guess(x.reshape(k, 1))[:, 0], dtype=float)

    def solve(X: np.ndarray) -> np.ndarray:
        return np.stack([cg(toeplitz, x, rtol=INNER, maxiter=500, M=near)[0] for x in X.T], axis=1)

    return solve


def neumann(grid: Grid) -> Product:
    """Square root of the Neumann Laplacian of the cells; its zero, the constants, is half the smallest other one."""
    squares = np.zeros(grid)
    for axis, k in enumerate(grid):
        along = 4 * np.sin(np.pi * np.arange(k) / (2 * k)) ** 2
        squares += along.reshape([-1 if i == axis else 1 for i in range(len(grid))])
    root, axes = np.sqrt(squares)[..., None], tuple(range(len(grid)))
    root[(0,) * len(grid)] = np.sort(root.ravel())[1] / 2
    return lambda X: idctn(root * dctn(X, axes=axes, norm="ortho"), axes=axes, norm="ortho")


# name -> (function of the grid of contacts, what it is)
PRECONDITIONERS: dict[str, tuple[Callable[[Grid], Product], str]] = {
    "p21": (p21, "circulant H^1/2 seminorm, extended by zero (paper, eqs (25) and, in 3D, (29))"),
    "p22": (p22, "inverse of the circulant H^-1/2 form, extended by zero (paper, eq (26)), 2D"),
    "neumann": (neumann, "square root of the Neumann Laplacian, by the cosine transform"),
}


def preconditioner(problem: InterfaceProblem, name: str) -> LinearOperator:
    """The named approximate inverse of problem.Q, (k dim, k dim), the same for every component.

    In 3D `neumann` is scaled on both sides by the fourth root of the inverse diagonal of Q: nodes at the edge of the contact
    are softer (with and without: reports/preconditioner_conditions).
    Raises InputError for an unknown name, fewer than 3 contacts a side, or nodes not evenly spaced on a line or rectangle.
    """
    if name not in PRECONDITIONERS:
        raise InputError(f"unknown preconditioner {name!r}; choose from {', '.join(PRECONDITIONERS)}.")
    grid, order = _grid(problem)
    product = PRECONDITIONERS[name][0](grid)
    diagonal = np.diag(problem.Q).reshape(problem.q.shape)
    mean = float(np.mean(diagonal))
    diagonal = np.where(diagonal > NOISE * mean, diagonal, mean)  # a component that cannot move
    weight = (mean / diagonal) ** 0.25 if name == "neumann" and problem.dim == 3 else np.ones_like(diagonal)

    def apply(x: np.ndarray) -> np.ndarray:
        sorted_ = (weight * x.reshape(problem.q.shape))[order]
        out = np.empty(problem.q.shape)
        out[order] = product(sorted_.reshape(*grid, problem.dim)).reshape(problem.q.shape)
        return (weight * out).ravel() / mean

    return LinearOperator((problem.q.size, problem.q.size), matvec=apply, rmatvec=apply, dtype=float)


def smooth_motions(problem: InterfaceProblem) -> np.ndarray:
    """(k dim, dim^2): constant and linear functions of the place in every component: translations, tilts, stretches."""
    place = problem.coordinates[: problem.dim - 1]
    place = place - place.mean(axis=1, keepdims=True)
    functions = [np.ones(problem.contacts), *(x / (np.abs(x).max() or 1.0) for x in place)]
    return np.concatenate([np.kron(f[:, None], np.eye(problem.dim)) for f in functions], axis=1)


def deflated(P: LinearOperator, Q: LinearOperator | np.ndarray, Z: np.ndarray) -> LinearOperator:
    """P made exact on the columns of Z (n, j): c (I - Z A^-1 Z'Q) P (I - Q Z A^-1 Z') + Z A^-1 Z' with A = Z'QZ.

    The factor c puts the eigenvalues of P Q about 1, where those of the exact part are. Needs j + 1 products with Q once;
    each application adds O(n j).
    """
    QZ = np.asarray(Q @ Z)
    A = np.linalg.inv(Z.T @ QZ)
    x = np.random.default_rng(0).normal(size=len(Z))
    x -= Z @ (A @ (QZ.T @ x))
    Qx = np.asarray(Q @ x)
    c = float(x @ Qx) / float(Qx @ (P @ Qx))

    def apply(x: np.ndarray) -> np.ndarray:
        coarse = A @ (Z.T @ x)
        y = c * (P @ (x - QZ @ coarse))
        return np.asarray(y - Z @ (A @ (QZ.T @ y)) + Z @ coarse)

    return LinearOperator(P.shape, matvec=apply, rmatvec=apply, dtype=float)


def _curve(k: int) -> int:
    """Half the number of nodes of the closed curve: a power of two, at least k."""
    return int(2 ** np.ceil(np.log2(k)))


def _restricted(symbol: np.ndarray, k: int, axis: int) -> Product:
    """E' C E along one axis of k nodes for the circulant matrix with that (real, symmetric) symbol."""
    n = 2 * (len(symbol) - 1)

    def product(X: np.ndarray) -> np.ndarray:
        lines = np.moveaxis(X, axis, -1)
        return np.moveaxis(irfft(symbol * rfft(lines, n=n), n=n)[..., :k], -1, axis)

    return product


def _grid(problem: InterfaceProblem) -> tuple[Grid, np.ndarray]:
    """Contacts along each direction, and the order of the contacts in that grid."""
    x = problem.coordinates[: problem.dim - 1]
    size = np.ptp(problem.coordinates, axis=1).max(initial=0.0)
    ticks, places = [], []
    for row in x:
        order = np.argsort(row)
        starts = np.concatenate([[True], np.diff(row[order]) > 1e-6 * size])
        place = np.empty(len(row), dtype=int)
        place[order] = np.cumsum(starts) - 1
        ticks.append(row[order][starts])
        places.append(place)
    grid = tuple(len(t) for t in ticks)
    steps = [np.diff(t) for t in ticks]
    even = all(len(s) > 1 and np.ptp(s) < 1e-6 * s.mean() for s in steps)
    order = np.lexsort(places[::-1])
    if not even or np.prod(grid) != problem.contacts or np.any(np.diff(np.ravel_multi_index(places, grid)[order]) != 1):
        raise InputError(
            "the preconditioners need contact nodes evenly spaced on a line or a rectangle, 3 or more a side."
        )
    return grid, order
