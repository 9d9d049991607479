"""The paper's circulant preconditioners P21, P22 and P31 (section 5.2)."""

import numpy as np
from scipy.fft import fft, ifft, irfft, rfft
from scipy.sparse.linalg import LinearOperator, cg

from contactopt.errors import InputError
from contactopt.methods.preconditioners.grid import Grid, GridMap, OnGrid

# relative accuracy of the Toeplitz solve inside P22, which makes it a fixed linear operator
INNER = 1e-13


def seminorm(m: float) -> np.ndarray:
    """The first column (2 m,) of the H^1/2 seminorm's matrix, eq (27), on a closed curve."""
    column, top = np.zeros(round(2 * m)), int(np.ceil(np.log2(m)))
    column[0] = 2 * np.sum(1 / np.arange(1, 2**top) ** 2.0)
    for i in range(1, top + 1):
        j = 2**i - 1
        if j < m:
            column[[j, -j]] -= np.sum(1 / np.arange(2 ** (i - 1), 2**i) ** 2.0)
    return column


def norm(m: float, h: float) -> np.ndarray:
    """First column (2 m,) of the circulant matrix of the H^1 norm, eq (28), at node distance h."""
    column = np.zeros(round(2 * m))
    column[0], column[[1, -1]] = 2 / h + h, -1 / h
    return column


def extended(grid: Grid) -> tuple[GridMap, None]:
    """P21 = E' Q_c E of eq (25) on a line, or the sum P31 of eq (29); the inverse is expensive."""
    if grid.closed:
        symbol, smallest = _closed_symbol(*grid.shape)
        return _circular(np.maximum(symbol, smallest / 2)), None
    lines = [
        restricted_circulant(rfft(seminorm(closed_curve(k))).real, k, axis)
        for axis, k in enumerate(grid.shape)
    ]
    return lambda X: np.sum([line(X) for line in lines], axis=0), None


def inverse_of_extended(grid: Grid) -> tuple[GridMap, GridMap]:
    """P22 = (E' L_c^-1 Q_c E)^-1 of eq (26), and its inverse; InputError on a surface."""
    if len(grid.shape) > 1:
        raise InputError(
            "preconditioner 'p22' is for contact lines (2D); in 3D choose p21 or neumann."
        )
    (k,) = grid.shape
    if grid.closed:
        symbol, smallest = _closed_symbol(k)
        symbol = np.maximum(symbol, smallest / 2) / fft(norm(k / 2, 4 / k)).real
        return _circular(1 / symbol), _circular(symbol)
    m = closed_curve(k)
    symbol = rfft(seminorm(m)).real / rfft(norm(m, 4 / (k - 1))).real
    product, guess = restricted_circulant(symbol, k, 0), extended(grid)[0]
    toeplitz = LinearOperator((k, k), matvec=lambda x: product(x.reshape(k, 1))[:, 0], dtype=float)
    near = LinearOperator((k, k), matvec=lambda x: guess(x.reshape(k, 1))[:, 0], dtype=float)

    def solve(X: np.ndarray) -> np.ndarray:
        return np.stack([cg(toeplitz, x, rtol=INNER, maxiter=500, M=near)[0] for x in X.T], axis=1)

    return solve, product


p21 = OnGrid(extended)
p22 = OnGrid(inverse_of_extended)


def _closed_symbol(k: int) -> tuple[np.ndarray, float]:
    """Eigenvalues (k,), of sum zero, of the seminorm on a closed curve, and the least positive."""
    symbol = fft(seminorm(k / 2)).real
    symbol = symbol - symbol[0]
    return symbol, float(symbol[1:].min())


def _circular(symbol: np.ndarray) -> GridMap:
    """Circulant matrix with that (real, symmetric) symbol (k,) along the first axis."""
    return lambda X: np.asarray(ifft(symbol[:, None] * fft(X, axis=0), axis=0).real)


def closed_curve(k: int) -> int:
    """Half the number of nodes of the closed curve: a power of two, at least k contacts."""
    return int(2 ** np.ceil(np.log2(k)))


def restricted_circulant(symbol: np.ndarray, k: int, axis: int) -> GridMap:
    """E' C E along one axis of k nodes, for a circulant C of size 2 m with eigenvalues `symbol`."""
    n = 2 * (len(symbol) - 1)

    def product(X: np.ndarray) -> np.ndarray:
        lines = np.moveaxis(X, axis, -1)
        return np.moveaxis(irfft(symbol * rfft(lines, n=n), n=n)[..., :k], -1, axis)

    return product
