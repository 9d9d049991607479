"""Stresses below the surface of a half-space under uniform tractions on the cells of its grid.

Stresses of point forces (Boussinesq, Cerruti) and line forces (Flamant) are averaged over cells by
Gauss's rule, which is exact to many digits from half a spacing below the surface on, and summed
over all cells by fast Fourier transforms. Sources: Johnson (1985), Contact Mechanics, sections 2.2,
2.3, 3.2 and 3.6.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.fft import irfftn, next_fast_len, rfftn

from contactopt.bodies.half_space import HalfSpaceBody
from contactopt.checks import check_number
from contactopt.errors import InputError

# Distance in longer sides of a cell within which the finer of two Gauss rules is used, and the
# points of both.
NEAR, FINE, COARSE = 8, 12, 3
PAIRS = {2: ((0, 0), (1, 1), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))}


def stress_below(body: HalfSpaceBody, force: np.ndarray, depths: Sequence[float]) -> np.ndarray:
    """Stress tensors (j, n0[, n1], 3, 3) below the points of a half-space at depths (j,), in the
    axes of the scene [stress].

    The forces (k, dim) are in the components of the body. In plane strain the third axis is that
    across the plane. InputError for a periodic surface and for depths of less than half a spacing.
    """
    if body.part.periodic:
        raise InputError(
            f"half-space '{body.name}' is periodic; stresses below the surface are those of a"
            " single one only."
        )
    least = max(body.spacing) / 2
    for depth in depths:
        check_number("a depth below the surface", depth, low=least * (1 - 1e-9), closed=True)
    dim, grid = len(body.components), body.grid
    padded = tuple(next_fast_len(2 * n, real=True) for n in grid)
    inward = np.ones(dim)
    inward[-1] = -body.outward  # the depth points along the last component, or against it
    spectra = [rfftn(part.reshape(grid), padded) for part in (force * inward).T]
    out = np.zeros((len(depths), *grid, 3, 3))
    for place, depth in enumerate(depths):
        for (a, b), kernels in zip(PAIRS[dim], _coefficients(body, padded, depth)):
            total = sum(rfftn(kernel) * spectrum for kernel, spectrum in zip(kernels, spectra))
            stress = irfftn(total, padded)[tuple(slice(n) for n in grid)] * inward[a] * inward[b]
            out[place, ..., a, b] = out[place, ..., b, a] = stress
        if dim == 2:
            out[place, ..., 2, 2] = body.part.material.nu * (
                out[place, ..., 0, 0] + out[place, ..., 1, 1]
            )
    return out / (body.thickness if dim == 2 else 1.0)


def von_mises(stress: np.ndarray) -> np.ndarray:
    """The von Mises stresses (...) of stress tensors (..., 3, 3)."""
    deviator = stress - np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.asarray(np.sqrt(1.5 * np.sum(deviator**2, axis=(-2, -1))))


def _coefficients(body: HalfSpaceBody, padded: tuple[int, ...], depth: float) -> np.ndarray:
    """Stress per force at a circulant's distances: (stress component, loaded one, *padded)."""
    offsets = [np.fft.fftfreq(m, 1 / m) for m in padded]
    out, longer = _mean(body, offsets, depth, COARSE), max(body.spacing)
    if depth >= NEAR * longer:
        return out
    near = [
        np.flatnonzero(h * np.abs(row) <= NEAR * longer) for row, h in zip(offsets, body.spacing)
    ]
    there: Any = (slice(None), slice(None), *np.ix_(*near))
    points = FINE if depth < 2 * longer else 2 * COARSE
    out[there] = _mean(body, [row[some] for row, some in zip(offsets, near)], depth, points)
    return out


def _mean(body: HalfSpaceBody, offsets: list[np.ndarray], depth: float, points: int) -> np.ndarray:
    nodes, weights = np.polynomial.legendre.leggauss(points)
    total: np.ndarray | float = 0.0
    if len(offsets) == 1:
        for a, p in zip(nodes, weights):
            total = total + p / 2 * flamant(body.spacing[0] * (offsets[0] + a / 2), depth)
        return np.asarray(total)
    for a, p in zip(nodes, weights):
        for b, q in zip(nodes, weights):
            x = body.spacing[0] * (offsets[0] + a / 2)[:, None]
            y = body.spacing[1] * (offsets[1] + b / 2)[None, :]
            total = total + p * q / 4 * boussinesq_cerruti(x, y, depth, body.part.material.nu)
    return np.asarray(total)


def flamant(x: np.ndarray, z: float) -> np.ndarray:
    """Stresses xx, zz, xz (3, 2, ...) at x and depth z under unit line forces along x and into the
    body [1 / length]. Source: Johnson (1985), sections 2.2, 2.3.
    """
    square = x**2 + z**2
    radial = [-2 / np.pi * x / square**2, -2 / np.pi * z / square**2]
    return np.array(
        [[r * x**2 for r in radial], [r * z**2 for r in radial], [r * x * z for r in radial]]
    )


def boussinesq_cerruti(x: np.ndarray, y: np.ndarray, z: float, nu: float) -> np.ndarray:
    """Stresses xx, yy, zz, xy, xz, yz (6, 3, ...) at x, y and depth z > 0 under unit point forces
    along x, y and into the body [1 / length^2]. Sources: Johnson (1985), sections 3.2 and 3.6.
    """
    x, y = np.broadcast_arrays(x, y)
    rho = np.sqrt(x**2 + y**2 + z**2)
    along = _cerruti(x, y, z, rho, nu)
    across = _cerruti(y, x, z, rho, nu)[[1, 0, 2, 3, 5, 4]]
    s, m = rho + z, 1 - 2 * nu
    # these have no singularity on the axis
    even, mixed = z / rho**3 - 1 / (rho * s), (2 * rho + z) / (rho**3 * s**2)
    down = np.array(
        [
            m * (even + x**2 * mixed) - 3 * z * x**2 / rho**5,
            m * (even + y**2 * mixed) - 3 * z * y**2 / rho**5,
            -3 * z**3 / rho**5,
            m * x * y * mixed - 3 * x * y * z / rho**5,
            -3 * x * z**2 / rho**5,
            -3 * y * z**2 / rho**5,
        ]
    )
    return np.stack([along, across, down / (2 * np.pi)], axis=1)


def _cerruti(x: np.ndarray, y: np.ndarray, z: float, rho: np.ndarray, nu: float) -> np.ndarray:
    """Stresses (xx, yy, zz, xy, xz, yz) under a unit point force along x."""
    s, m = rho + z, 1 - 2 * nu
    first, third, fifth = 1 / (rho * s**2), 1 / (rho**3 * s**2), 3 / rho**5
    cubic = 2 / (rho**2 * s**3)
    return np.array(
        [
            -fifth * x**3 + m * (x / rho**3 - 3 * x * first + x**3 * (third + cubic)),
            -fifth * x * y**2 + m * (x / rho**3 - x * first + x * y**2 * (third + cubic)),
            -fifth * x * z**2,
            -fifth * x**2 * y + m * (-y * first + x**2 * y * (third + cubic)),
            -fifth * x**2 * z,
            -fifth * x * y * z,
        ]
    ) / (2 * np.pi)
