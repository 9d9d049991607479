"""Projections of contact mechanics: half-line, interval or disc, Coulomb's cone; vectorised over
the contacts.

This is geometry alone. Which of them a contact obeys is the business of contactopt.problem.laws.
A function that ends in `_derivative` gives the nearest points and the generalised derivative of the
projection.
"""

import numpy as np

DIRECTIONS = 16  # of the polygon in a disc


def split(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Views of the normal part (k,) and of the tangential part (k, dim - 1) of blocks."""
    return blocks[:, 0], blocks[:, 1:]


def lengths(t: np.ndarray) -> np.ndarray:
    """Lengths (k,) of vectors (k, d)."""
    if t.shape[1] == 1:
        return np.asarray(np.abs(t[:, 0]))
    return np.asarray(np.sqrt(np.vecdot(t, t)))


def unit(t: np.ndarray) -> np.ndarray:
    """Directions of vectors (k, d): of length one, and zero where t is zero."""
    length = lengths(t)[:, None]
    return np.divide(t, length, out=np.zeros(t.shape), where=length > 0)


def simplex_steps(entries: int) -> int:
    """The steps that a linear program with so many entries may take: about five seconds' worth."""
    return 300 + int(1e9 / max(entries, 1))


def polygon(dim: int) -> tuple[np.ndarray, float]:
    """Directions (j, dim - 1) of a regular polygon, and by what it is wider than its inner disc."""
    if dim == 2:
        return np.array([[1.0], [-1.0]]), 1.0
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return np.stack([np.cos(angle), np.sin(angle)], axis=1), 1 / np.cos(np.pi / DIRECTIONS)


def disc(t: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Nearest points of discs |t| <= radius (k,) to t (k, d); of intervals for d = 1."""
    length = lengths(t)
    shrink = np.divide(radius, length, out=np.ones_like(length), where=length > radius)
    return np.asarray(t * shrink[:, None])


def coulomb_cone(r: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Nearest points of Coulomb's cones |r_t| <= mu r_n to r (k, dim), normal component first."""
    n, t = split(r)
    length = lengths(t)
    inside = (length <= mu * n) & (n >= 0)  # without friction a tension is outside, too
    polar = mu * length <= -n  # nearest point is the apex
    height = np.where(inside, n, np.where(polar, 0.0, (n + mu * length) / (1 + mu**2)))
    return np.column_stack([height, disc(t, mu * np.maximum(height, 0.0))])


def half_line_derivative(
    y: np.ndarray, low: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Projection of y (k, 1) on the half-line [low, inf), and its derivative (k, 1, 1)."""
    bound = np.broadcast_to(low, len(y))[:, None]
    return np.maximum(y, bound), (y > bound).astype(float)[:, :, None]


def disc_derivative(y: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projection of y (k, d) on discs |y| <= radius, and its generalised derivative (k, d, d)."""
    k, d = y.shape
    if d == 1:
        bound = np.broadcast_to(radius, (k,))[:, None]
        inside = np.abs(y) <= bound
        return np.minimum(np.maximum(y, -bound), bound), inside.astype(float)[:, :, None]
    length = lengths(y)
    outside = length > radius
    D = np.broadcast_to(np.eye(d), (k, d, d)).copy()
    shrink = np.divide(radius, length, out=np.ones_like(length), where=outside)
    D[outside] = shrink[outside, None, None] * _across(unit(y[outside]))
    return np.asarray(y * shrink[:, None]), D


def cylinder_derivative(
    y: np.ndarray, radius: np.ndarray, low: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Projection of y (k, dim) on cylinders r_n >= low, |r_t| <= radius, and its derivative."""
    P, D = np.empty_like(y), np.zeros((*y.shape, y.shape[1]))
    P[:, :1], D[:, :1, :1] = half_line_derivative(y[:, :1], low)
    P[:, 1:], D[:, 1:, 1:] = disc_derivative(y[:, 1:], radius)
    return P, D


def disc_of_height(
    height: np.ndarray, t: np.ndarray, mu: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """t (k, dim - 1) projected on discs of radius mu |height|, and its derivative."""
    k, dim = len(t), t.shape[1] + 1
    bound, length = mu * np.abs(height), lengths(t)
    slip = length > bound
    size = np.where(slip, length, 1.0)
    share, way = np.where(slip, bound / size, 1.0), t * (slip / size)[:, None]
    P, D = np.empty((k, dim)), np.zeros((k, dim, dim))
    P[:, 0], P[:, 1:] = height, t * share[:, None]
    D[:, 0, 0], D[:, 1:, 0] = 1.0, (mu * slope)[:, None] * way
    D[:, 1:, 1:] = share[:, None, None] * _across(way)
    return P, D


def coulomb_cone_derivative(y: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projection of y (k, dim) on Coulomb's cones, and its generalised derivative (k, dim, dim):
    identity inside, zero in the polar. Between them the nearest point is h (1, mu unit), h = (y_n +
    mu |y_t|) / (1 + mu^2), and the derivative projects on that ray and shrinks what is tangent.
    """
    k, dim = y.shape
    n, t = split(y)
    length = lengths(t)
    polar = mu * length <= -n
    surface = ~polar & ((length > mu * n) | (mu == 0))
    D = np.zeros((k, dim, dim))
    D[~polar & ~surface] = np.eye(dim)
    m, size, way = mu[surface], length[surface], unit(t[surface])
    ray = np.concatenate([np.ones((len(m), 1)), m[:, None] * way], axis=1)
    D[surface] = ray[:, :, None] * ray[:, None, :] / (1 + m**2)[:, None, None]
    if dim == 3:
        height = (n[surface] + m * size) / (1 + m**2)
        turn = np.divide(m * height, size, out=np.zeros(len(m)), where=size > 0)
        D[surface, 1:, 1:] += turn[:, None, None] * _across(way)
    return coulomb_cone(y, mu), D


def _across(way: np.ndarray) -> np.ndarray:
    """I - e e' (k, d, d) for directions e (k, d)."""
    return np.asarray(np.eye(way.shape[1]) - way[:, :, None] * way[:, None, :])
