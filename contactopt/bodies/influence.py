"""Displacements of a half-plane or half-space under uniform tractions on cells of its surface, in
closed form.

The half-space fills z <= 0, so that its outward normal is +z. A force F at the origin moves the
surface point (x, y) at the distance rho by (Boussinesq; Cerruti; G is the shear modulus, nu
Poisson's ratio)

    2 pi G u_z = (1 - nu) F_z / rho - (1 - 2 nu)/2 (x F_x + y F_y) / rho^2
    2 pi G u_x = ((1 - nu) / rho + nu x^2 / rho^3) F_x + nu x y / rho^3 F_y
                 + (1 - 2 nu)/2 x F_z / rho^2

and u_y likewise. A line force on a half-plane makes displacements that grow without end (Flamant).
They are measured from the point that lies `depth` beneath the line force, d below:

    pi G u_z = (1 - nu) (ln(d / |x|) - 1 / (2 (1 - nu))) F_z - pi (1 - 2 nu)/4 sign(x) F_x
    pi G u_x = (1 - nu) (ln(d / |x|) + 1 / (2 (1 - nu))) F_x + pi (1 - 2 nu)/4 sign(x) F_z

Integrals over a cell have antiderivatives. Far from the cell their differences would cancel most
digits, and there Gauss's rule is exact to rounding. All coefficients are displacements at the
middle of a cell per unit of total force on another cell.

Sources: Love (1929), The stress produced in a semi-infinite solid by pressure on part of the
boundary; Johnson (1985), Contact Mechanics, sections 2.2, 3.2 and 3.6.
"""

from collections.abc import Callable

import numpy as np

from contactopt.material import Material, lame

# Number of the longer sides of a cell from the loaded one from which on Gauss's rule with that many
# points a side is used, farthest last.
GAUSS = ((12, 8), (64, 3))

ROWS = 16  # of the offsets that are computed at a time, so that all stays in the cache

Antiderivative = Callable[[np.ndarray, np.ndarray], np.ndarray]


def half_space_influence(
    material: Material, spacing: tuple[float, ...], offsets: tuple[np.ndarray, ...]
) -> dict[tuple[int, int], np.ndarray]:
    """Influence coefficients of rectangular cells on a half-space.

    spacing are the sides of a cell along x and y [length], offsets whole numbers (i,) and (j,) of
    cells along x and y between the cell that is loaded and the one that moves. Returns (moved
    component, loaded component) -> coefficients (i, j) [length / force] for the components x, y, z
    = 0, 1, 2. Pairs with the first number larger than the second are left out: u_a under F_b is
    minus u_b under F_a for the pairs of z with x and y, and equal to it for x with y.

    Sources: Love (1929); Johnson (1985), sections 3.2 and 3.6.
    """
    G, nu = lame(material)[1], material.nu
    over = _means(spacing, offsets)
    scale = 1 / (2 * np.pi * G)
    reciprocal = over["xx"] + over["yy"]
    return {
        (0, 0): scale * ((1 - nu) * reciprocal + nu * over["xx"]),
        (1, 1): scale * ((1 - nu) * reciprocal + nu * over["yy"]),
        (2, 2): scale * (1 - nu) * reciprocal,
        (0, 1): scale * nu * over["xy"],
        (0, 2): scale * (0.5 - nu) * over["x"],
        (1, 2): scale * (0.5 - nu) * over["y"],
    }


def half_plane_influence(
    material: Material, spacing: float, offsets: np.ndarray, depth: float
) -> dict[tuple[int, int], np.ndarray]:
    """Influence coefficients of strips of a width on a half-plane in plane strain, per unit of
    length across it.

    depth is that of the point beneath each force from which its displacements are measured
    [length]. Returns (moved component, loaded component) -> coefficients (i,) [length^2 / force]
    for the components x, y = 0, 1 with y the outward normal; else as in half_space_influence.

    Source: Johnson (1985), sections 2.2 and 2.3.
    """
    G, nu = lame(material)[1], material.nu
    x, b = spacing * np.abs(offsets), spacing / 2
    near, points = GAUSS[0]
    nodes, weights = np.polynomial.legendre.leggauss(points)
    far = np.sum(weights / 2 * np.log(np.maximum(x[:, None] + b * nodes, b)), axis=1)
    mean_log = np.where(np.abs(offsets) <= near, (_x_log(x + b) - _x_log(x - b)) / spacing - 1, far)
    same, turn = (1 - nu) / (np.pi * G), 1 / (2 * (1 - nu))
    return {
        (0, 0): same * (np.log(depth) - mean_log + turn),
        (1, 1): same * (np.log(depth) - mean_log - turn),
        (0, 1): (1 - 2 * nu) / (4 * G) * np.sign(offsets),
    }


def _x_log(x: np.ndarray) -> np.ndarray:
    return np.asarray(x * np.log(np.abs(np.where(x == 0, 1.0, x))))


def _half_y2(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """x ln(y + rho), with y + rho = x^2 / (rho - y) where y is negative."""
    rho = np.hypot(x, y)
    sum_ = np.where(y >= 0, y + rho, x**2 / np.where(rho - y > 0, rho - y, 1.0))
    return np.asarray(x * np.log(np.where(sum_ > 0, sum_, 1.0)))


def _first_over_square(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """y ln(rho) + x arctan(y / x)."""
    rho = np.hypot(x, y)
    angle = np.arctan(np.divide(y, x, out=np.zeros_like(x), where=x != 0))
    return np.asarray(y * np.log(np.where(rho > 0, rho, 1.0)) + x * angle)


# antiderivatives along x and y of x^2/rho^3, y^2/rho^3, x y/rho^3, x/rho^2 and y/rho^2
WHOLE: dict[str, Antiderivative] = {
    "xx": lambda x, y: _half_y2(y, x),
    "yy": _half_y2,
    "xy": lambda x, y: -np.hypot(x, y),
    "x": _first_over_square,
    "y": lambda x, y: _first_over_square(y, x),
}


def _means(spacing: tuple[float, ...], offsets: tuple[np.ndarray, ...]) -> dict[str, np.ndarray]:
    """Means of the functions of WHOLE over the cell at each offset (i, j)."""
    farthest, longer = GAUSS[-1][1], max(spacing)

    def within(reach: int) -> list[np.ndarray]:
        return [
            np.flatnonzero(h * np.abs(along) <= reach * longer)
            for h, along in zip(spacing, offsets)
        ]

    out = _by_gauss(spacing, offsets, farthest)
    near = within(GAUSS[1][0])
    for name, value in _by_gauss(
        spacing, (offsets[0][near[0]], offsets[1][near[1]]), GAUSS[0][1]
    ).items():
        out[name][np.ix_(*near)] = value
    some = within(GAUSS[0][0])
    (hx, hy), corners = spacing, [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    x, y = np.meshgrid(hx * offsets[0][some[0]], hy * offsets[1][some[1]], indexing="ij")
    for name, whole in WHOLE.items():
        mean = sum(sign * whole(x + a * hx / 2, y + b * hy / 2) for a, b, sign in corners) / (
            hx * hy
        )
        out[name][np.ix_(*some)] = mean
    return out


def _by_gauss(
    spacing: tuple[float, ...], offsets: tuple[np.ndarray, ...], points: int
) -> dict[str, np.ndarray]:
    """The same by Gauss's rule, with that many points a side; worthless next to the loaded cell."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    out = {name: np.zeros((len(offsets[0]), len(offsets[1]))) for name in WHOLE}
    pairs = [((a, p), (b, q)) for a, p in zip(nodes, weights) for b, q in zip(nodes, weights)]
    for start in range(0, len(offsets[0]), ROWS):
        rows = slice(start, start + ROWS)
        for (a, p), (b, q) in pairs:
            x = spacing[0] * (offsets[0][rows] + a / 2)[:, None]
            y = spacing[1] * (offsets[1] + b / 2)[None, :]
            square = np.maximum(x**2 + y**2, (1e-9 * spacing[0]) ** 2)
            first = p * q / 4 / square
            third = first / np.sqrt(square)
            out["xx"][rows] += x**2 * third
            out["yy"][rows] += y**2 * third
            out["xy"][rows] += (x * y) * third
            out["x"][rows] += x * first
            out["y"][rows] += y * first
    return out
