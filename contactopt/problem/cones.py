"""Projections of contact mechanics: half-line, interval or disc, Coulomb's cone; vectorised over
the contacts.

This is geometry alone. Which of them a contact obeys is the business of contactopt.problem.laws.
"""

from __future__ import annotations

import numpy as np


def split(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split blocks into their normal and tangential parts.

    Parameters
    ----------
    blocks : (k, dim) forces or displacements, normal component first.

    Returns
    -------
    The normal part (k,) and the tangential part (k, dim - 1). Both are views.
    """
    return blocks[:, 0], blocks[:, 1:]


def unit(t: np.ndarray) -> np.ndarray:
    """Compute the directions of vectors.

    Parameters
    ----------
    t : (k, d) vectors.

    Returns
    -------
    (k, d) vectors of length one; zero where t is zero.
    """
    length = np.linalg.norm(t, axis=1)[:, None]
    return np.divide(t, length, out=np.zeros(t.shape), where=length > 0)


def disc(t: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Nearest points of discs |t| <= radius; of intervals for d = 1.

    Parameters
    ----------
    t : (k, d) points.
    radius : (k,) radii, at least 0.

    Returns
    -------
    array (k, d) : The nearest points.
    """
    length = np.linalg.norm(t, axis=1)
    shrink = np.divide(radius, length, out=np.ones_like(length), where=length > radius)
    return np.asarray(t * shrink[:, None])


def coulomb_cone(r: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Nearest points of Coulomb's cones |r_t| <= mu r_n.

    Parameters
    ----------
    r : (k, dim) points, normal component first.
    mu : (k,) friction coefficients, at least 0.

    Returns
    -------
    array (k, dim) : The nearest points.
    """
    n, t = split(r)
    length = np.linalg.norm(t, axis=1)
    inside = (length <= mu * n) & (n >= 0)  # without friction a tension is outside, too
    polar = mu * length <= -n  # nearest point is the apex
    height = np.where(inside, n, np.where(polar, 0.0, (n + mu * length) / (1 + mu**2)))
    out = np.empty_like(r)
    out[:, 0] = height
    out[:, 1:] = disc(t, mu * np.maximum(height, 0.0))
    return out


def half_line_derivative(
    y: np.ndarray, low: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Projection on the half-line [low, inf), and its generalised derivative.

    Parameters
    ----------
    y : (k, 1) points.
    low : One number or (k,); it may be -inf.

    Returns
    -------
    arrays (k, 1) and (k, 1, 1) : The nearest points and the derivative, 0 or 1.
    """
    bound = np.broadcast_to(low, len(y))[:, None]
    return np.maximum(y, bound), (y > bound).astype(float)[:, :, None]


def disc_derivative(y: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projection on discs |y| <= radius, and its generalised derivative.

    Outside the disc the derivative is (radius / |y|) (I - y y' / |y|^2), which is zero for d = 1.

    Parameters
    ----------
    y : (k, d) points.
    radius : (k,) radii, at least 0.

    Returns
    -------
    arrays (k, d) and (k, d, d) : The nearest points and the derivative.
    """
    k, d = y.shape
    if d == 1:
        bound = np.broadcast_to(radius, (k,))[:, None]
        return np.minimum(np.maximum(y, -bound), bound), (np.abs(y) <= bound).astype(float)[
            :, :, None
        ]
    length = np.linalg.norm(y, axis=1)
    outside = length > radius
    unit = np.divide(y, length[:, None], out=np.zeros_like(y), where=length[:, None] > 0)
    D = np.broadcast_to(np.eye(d), (k, d, d)).copy()
    shrink = np.divide(radius, length, out=np.ones_like(length), where=outside)
    D[outside] = shrink[outside, None, None] * (D - unit[:, :, None] * unit[:, None, :])[outside]
    return disc(y, radius), D


def cylinder_derivative(
    y: np.ndarray, radius: np.ndarray, low: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Projection on the cylinders r_n >= low, |r_t| <= radius, and its generalised derivative.

    Parameters
    ----------
    y : (k, dim) points, normal component first.
    radius : (k,) radii, at least 0.
    low : One number or (k,); it may be -inf.

    Returns
    -------
    arrays (k, dim) and (k, dim, dim) : The nearest points and the derivative.
    """
    P, D = np.empty_like(y), np.zeros((*y.shape, y.shape[1]))
    P[:, :1], D[:, :1, :1] = half_line_derivative(y[:, :1], low)
    P[:, 1:], D[:, 1:, 1:] = disc_derivative(y[:, 1:], radius)
    return P, D


def disc_of_height(
    height: np.ndarray, t: np.ndarray, mu: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Projection of the tangential part alone, on discs whose radius is mu |height|, and its
    derivative.

    Parameters
    ----------
    height : (k,) normal components, which stay as they are.
    t : (k, dim - 1) tangential components.
    mu : (k,) friction coefficients.
    slope : (k,) derivative of |height| by the height, so that the radii grow by mu slope.

    Returns
    -------
    arrays (k, dim) and (k, dim, dim) : The heights beside the projected tangential components, and
        the derivative.
    """
    k, dim = len(t), t.shape[1] + 1
    bound, grow = mu * np.abs(height), mu * slope
    length = np.linalg.norm(t, axis=1)
    slip = length > bound
    P = np.concatenate([height[:, None], disc(t, bound)], axis=1)
    D = np.broadcast_to(np.eye(dim), (k, dim, dim)).copy()
    unit = t[slip] / length[slip, None]
    D[slip, 1:, 0] = grow[slip, None] * unit
    turn = (bound[slip] / length[slip])[:, None, None]
    D[slip, 1:, 1:] = turn * (np.eye(dim - 1) - unit[:, :, None] * unit[:, None, :])
    if dim == 2:
        D[slip, 1, 1] = 0.0
    return P, D


def coulomb_cone_derivative(y: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Projection on Coulomb's cones as in coulomb_cone(), and its generalised derivative.

    The derivative is the identity inside the cone and zero in its polar. Between them the nearest
    point is h (1, mu unit) with h = (y_n + mu |y_t|) / (1 + mu^2). The derivative projects on that
    ray and shrinks what is tangent to the disc.

    Parameters
    ----------
    y : (k, dim) points, normal component first.
    mu : (k,) friction coefficients, at least 0.

    Returns
    -------
    arrays (k, dim) and (k, dim, dim) : The nearest points and the derivative.
    """
    k, dim = y.shape
    n, t = split(y)
    length = np.linalg.norm(t, axis=1)
    polar = mu * length <= -n
    surface = ~polar & ((length > mu * n) | (mu == 0))
    D = np.zeros((k, dim, dim))
    D[~polar & ~surface] = np.eye(dim)
    m, size = mu[surface], length[surface]
    unit = np.divide(
        t[surface], size[:, None], out=np.zeros((len(m), dim - 1)), where=size[:, None] > 0
    )
    height = (n[surface] + m * size) / (1 + m**2)
    ray = np.concatenate([np.ones((len(m), 1)), m[:, None] * unit], axis=1)
    D[surface] = ray[:, :, None] * ray[:, None, :] / (1 + m**2)[:, None, None]
    if dim == 3:
        turn = np.divide(m * height, size, out=np.zeros(len(m)), where=size > 0)[:, None, None]
        D[surface, 1:, 1:] += turn * (np.eye(2) - unit[:, :, None] * unit[:, None, :])
    return coulomb_cone(y, mu), D
