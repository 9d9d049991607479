"""Preconditioners of the interface operator Q = S1^-1 + S2^-1: approximate inverses of Q, O(k log k) per product.

Paper, section 5.2: the H^1/2 seminorm of a function on the contact line, extended by zero (E) to a closed curve of 2m
nodes, is a circulant matrix Q_c (27), the H^1 norm another, L_c (28); with m the smallest power of two >= k,
    P21 = E' Q_c E   (25),      P22 = (E' L_c^-1 Q_c E)^-1   (26),
up to a factor that no iteration sees. P21 resembles S1 + S2; the matrix that P22 inverts resembles Q itself. Extension by
zero belongs to functions that vanish at the ends (H00^1/2), which a traction at a free edge does not:
    `neumann`, the square root of the Neumann Laplacian of the contact line by the cosine transform,
needs no extension. Each acts on every component by itself. What is left are a few smooth motions of the two bodies against
each other, first of all the sway of a slender body: `deflated` solves for them exactly (balancing, Mandel 1993).
All need evenly spaced contact nodes on a line.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.fft import dct, idct, irfft, rfft
from scipy.sparse.linalg import LinearOperator, cg

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem

Product = Callable[[np.ndarray], np.ndarray]  # acts along the first axis of (k, j)

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


def p21(k: int) -> Product:
    """Eq (25): E' Q_c E."""
    return _restricted(rfft(seminorm(_curve(k))).real, k)


def p22(k: int) -> Product:
    """Eq (26): (E' L_c^-1 Q_c E)^-1, a Toeplitz system solved by conjugate gradients.

    h is the spacing over a quarter of the contact line's length, so that units do not matter.
    """
    m = _curve(k)
    symbol = rfft(seminorm(m)).real / rfft(norm(m, 4 / (k - 1))).real
    product, guess = _restricted(symbol, k), p21(k)
    toeplitz = LinearOperator((k, k), matvec=lambda x: product(x.reshape(k, 1))[:, 0], dtype=float)
    near = LinearOperator((k, k), matvec=lambda x: guess(x.reshape(k, 1))[:, 0], dtype=float)

    def solve(X: np.ndarray) -> np.ndarray:
        return np.stack([cg(toeplitz, x, rtol=INNER, maxiter=500, M=near)[0] for x in X.T], axis=1)

    return solve


def neumann(k: int) -> Product:
    """Square root of the Neumann Laplacian of k cells; its zero, the constants, is half the next eigenvalue."""
    root = 2 * np.sin(np.pi * np.arange(k) / (2 * k))
    root[0] = root[1] / 2
    return lambda X: idct(root[:, None] * dct(X, axis=0, norm="ortho"), axis=0, norm="ortho")


# name -> (function of the number of contacts, what it is)
PRECONDITIONERS: dict[str, tuple[Callable[[int], Product], str]] = {
    "p21": (p21, "circulant H^1/2 seminorm, extended by zero (paper, eq (25))"),
    "p22": (p22, "inverse of the circulant H^-1/2 form, extended by zero (paper, eq (26))"),
    "neumann": (neumann, "square root of the Neumann Laplacian, by the cosine transform"),
}


def preconditioner(problem: InterfaceProblem, name: str) -> LinearOperator:
    """The named approximate inverse of problem.Q, (k dim, k dim), the same for every component.

    Raises InputError for an unknown name, fewer than 3 contacts, or nodes that are not evenly spaced on a line.
    """
    if name not in PRECONDITIONERS:
        raise InputError(f"unknown preconditioner {name!r}; choose from {', '.join(PRECONDITIONERS)}.")
    order = _along_the_line(problem)
    product = PRECONDITIONERS[name][0](problem.contacts)
    scale = 1 / np.mean(np.diag(problem.Q))

    def apply(x: np.ndarray) -> np.ndarray:
        out = np.empty(problem.q.shape)
        out[order] = scale * product(x.reshape(problem.q.shape)[order])
        return out.ravel()

    return LinearOperator((problem.q.size, problem.q.size), matvec=apply, rmatvec=apply, dtype=float)


def smooth_motions(problem: InterfaceProblem) -> np.ndarray:
    """(k dim, 2 dim): constant and linear functions along the line in every component: translations, tilt, stretch."""
    place = problem.coordinates[0] - problem.coordinates[0].mean()
    place = place / (np.abs(place).max() or 1.0)
    one = np.eye(problem.dim)
    return np.concatenate([np.kron(f[:, None], one) for f in (np.ones(problem.contacts), place)], axis=1)


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


def _restricted(symbol: np.ndarray, k: int) -> Product:
    """E' C E for the circulant matrix with that (real, symmetric) symbol."""
    n = 2 * (len(symbol) - 1)
    return lambda X: irfft(symbol[:, None] * rfft(X, n=n, axis=0), n=n, axis=0)[:k]


def _along_the_line(problem: InterfaceProblem) -> np.ndarray:
    """Order of the contacts along the line."""
    x = problem.coordinates
    order = np.argsort(x[0])
    steps = np.diff(x[:, order], axis=1)
    if (
        problem.contacts < 3
        or problem.dim != 2
        or np.abs(steps - steps.mean(axis=1, keepdims=True)).max() > 1e-6 * np.abs(steps).max()
    ):
        raise InputError("the preconditioners need at least 3 contact nodes, evenly spaced on a line.")
    return order
