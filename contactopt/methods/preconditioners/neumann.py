"""`neumann`: the square root of the Laplacian of the contacts, by cosine transforms.

A traction does not vanish at a free end of a contact line or surface: the Laplacian is even there.
It is odd where a plane of symmetry or an axis holds a component. That makes cosine and sine
transforms; a closed line has neither end, and takes the Fourier transform. On a line the spacing
does not matter: in terms of nodal forces the kernel of Q is log |x_i - x_j|, a function of the node
numbers up to smooth terms. On a surface the kernel is 1 / |x_i - x_j|, and a direction with uneven
spacing has eigenvectors of its own: a matrix as small as one side of the grid.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.linalg as la
from scipy.fft import dct, dst, fft, idct, idst

from contactopt.defaults import CLOSE
from contactopt.methods.preconditioners.constants import DISPERSION, SPLIT
from contactopt.methods.preconditioners.grid import Grid, GridMap, OnGrid, cells_along

# held at the (first, last) contact -> transform, its inverse, type, shift of the frequencies pi (j
# + shift) / k
TRANSFORMS = {
    (False, False): (dct, idct, 2, 0.0),
    (True, False): (dst, idst, 4, 0.5),
    (False, True): (dct, idct, 4, 0.5),
    (True, True): (dst, idst, 2, 1.0),
}


@dataclass(frozen=True, eq=False)
class Direction:
    """The Laplacian -d^2/dx^2 along one side of the grid, which has k contacts.

    waves     (k,) squared wave numbers times the squared spacing, from 0 to 4 [-]
    squares   (k,) eigenvalues [1 / length^2]
    forward   transforms an array to eigenvectors along one of its axes;   backward  is its inverse
    """

    waves: np.ndarray
    squares: np.ndarray
    forward: Callable[[np.ndarray, int], np.ndarray]
    backward: Callable[[np.ndarray, int], np.ndarray]


def _closed_line(k: int) -> Direction:
    """The Laplacian around a closed line of k even nodes, by the Hartley transform."""

    def hartley(x: np.ndarray, axis: int) -> np.ndarray:
        spectrum = fft(x, axis=axis, norm="ortho")
        return np.asarray(spectrum.real - spectrum.imag)

    waves = 4 * np.sin(np.pi * np.arange(k) / k) ** 2
    return Direction(waves, waves, hartley, hartley)


def _direction(ticks: np.ndarray, held: np.ndarray, line: bool) -> Direction:
    """The Laplacian along `ticks`, odd at the ends that are held; a line counts as even."""
    to, back, kind, shift = TRANSFORMS[bool(held[0]), bool(held[1])]
    k, steps = len(ticks), np.diff(ticks)
    waves = 4 * np.sin(np.pi * (np.arange(k) + shift) / (2 * k)) ** 2
    if line or np.ptp(steps) <= CLOSE * steps.mean():
        forward, backward = (partial(act, type=kind, norm="ortho") for act in (to, back))
        squares = waves / steps.mean() ** 2
        return Direction(
            waves, squares, lambda x, i: forward(x, axis=i), lambda x, i: backward(x, axis=i)
        )
    cells, stiffness = cells_along(ticks), np.zeros(k)
    stiffness[:-1] += 1 / steps
    stiffness[1:] += 1 / steps
    stiffness[[0, -1]] += 2 / steps[[0, -1]] * held
    values, vectors = la.eigh_tridiagonal(
        stiffness / cells, -1 / steps / np.sqrt(cells[:-1] * cells[1:])
    )

    def along(matrix: np.ndarray) -> Callable[[np.ndarray, int], np.ndarray]:
        return lambda x, axis: np.moveaxis(np.tensordot(matrix, x, (1, axis)), 0, axis)

    return Direction(waves, np.maximum(values, 0.0), along(vectors.T), along(vectors))


def _root_on_grid(grid: Grid) -> tuple[GridMap, GridMap]:
    """Square root of the weighted Laplacian, and its inverse; constants have half its least."""
    parts = [_root(grid, component) for component in range(len(grid.held))]
    weight = grid.weights.reshape(grid.shape)

    def product(X: np.ndarray, power: int) -> np.ndarray:
        out = np.empty(X.shape)
        for i, (root, directions) in enumerate(parts):
            x = weight**power * X[..., i]
            for axis, d in enumerate(directions):
                x = d.forward(x, axis)
            x = root**power * x
            for axis, d in enumerate(directions):
                x = d.backward(x, axis)
            out[..., i] = weight**power * x
        return out

    return partial(product, power=1), partial(product, power=-1)


neumann = OnGrid(_root_on_grid)


def _root(grid: Grid, component: int) -> tuple[np.ndarray, list[Direction]]:
    """Square root of the symbol of a component, without units, and the directions.

    On a surface the Laplacian is that of bilinear elements with sides 1 and a: where the waves
    along the two directions are x and y, it is a x + y / a - (a + 1 / a) x y / 6. A half-space
    gives way less, by a factor of 1 - nu, to tangential tractions that vary along their own
    direction than to those that vary across it. With bilinear elements the difference is larger,
    the more so the shorter the wave.
    """
    held = grid.held[component]
    if grid.closed:
        directions = [_closed_line(*grid.shape)]
    else:
        directions = [_direction(t, h, len(grid.ticks) == 1) for t, h in zip(grid.ticks, held)]
    waves = np.meshgrid(*(d.waves for d in directions), indexing="ij")
    squares = sum(np.meshgrid(*(d.squares for d in directions), indexing="ij"))
    # the mean is scaled out later
    spacing = [1.0 if grid.closed else np.ptp(t) / (len(t) - 1) for t in grid.ticks]
    total = np.maximum(sum(waves), 1e-300)
    if len(waves) == 2:
        (x, y), a = waves, spacing[1] / spacing[0]
        squares = squares * (1 - (a + 1 / a) / 6 * x * y / np.maximum(a * x + y / a, 1e-300))
    root = np.sqrt(squares * np.prod(spacing) ** (2 / len(waves)))
    if 0 < component <= len(waves):
        own = waves[component - 1]
        root /= 1 - own / total * ((SPLIT if len(waves) == 2 else 0.0) + DISPERSION * own / 4)
    if root.flat[0] <= 1e-6 * root.flat[1]:
        root.flat[0] = np.partition(root.ravel(), 1)[1] / 2
    return root, directions
