"""Discrete problems of many rigid bodies: packings of discs or spheres, of blocks with several
contact points a face, and bodies that touch at random places in random directions.

One implicit time step of rigid bodies with inverse masses 1 / m and 1 / J: W = H M^-1 H', q = H v +
gap / step, H the contact velocities of the bodies' velocities. More contact components than
freedom: W is sparse and of deficient rank.
"""

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.spatial import Delaunay

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb


def packing(
    dim: int = 2,
    bodies: int = 25,
    seed: int = 0,
    mu: float = 0.5,
    points: int = 1,
    disorder: float = 0.3,
    shake: float = 1.0,
    spin: float = 0.0,
) -> InterfaceProblem:
    """A packing under its own weight on a fixed floor, read from the Delaunay graph of jittered
    lattice places.

    points    contacts per pair of bodies: one for discs, several for faces that touch
    disorder  jitter of the places over their distance; also the spread of the radii
    shake     random part of the free velocity, over that which gravity makes in the step
    spin      angle by which the frame of the observer turns in the step. Coriolis' forces make M,
              and with it W, unsymmetric
    """
    W, fall, shaken, gaps = parts_of_packing(dim, bodies, seed, points, disorder, spin)
    q = fall + shake * shaken
    q[:, 0] += gaps
    return InterfaceProblem(W, q, Coulomb(np.full(len(q), mu)))


def parts_of_packing(
    dim: int, bodies: int, seed: int, points: int = 1, disorder: float = 0.3, spin: float = 0.0
) -> tuple[sp.csr_array, np.ndarray, np.ndarray, np.ndarray]:
    """W, contact velocities (m, dim) that gravity makes in the step, random ones, and gaps (m,)."""
    if dim not in (2, 3) or bodies < 2**dim or points < 1:
        raise InputError("packing needs dim 2 or 3, at least 2^dim bodies, and points at least 1.")
    rng = np.random.default_rng(seed)
    side = int(np.ceil(bodies ** (1 / dim)))
    grid = np.stack(
        np.meshgrid(*[np.arange(side, dtype=float)] * dim, indexing="ij"), axis=-1
    ).reshape(-1, dim)[:bodies]
    places = grid + disorder * rng.uniform(-0.5, 0.5, grid.shape)
    pairs = _pairs(places, 1.5)
    fixed = places[:, -1] < 0.5
    pairs = pairs[~(fixed[pairs[:, 0]] & fixed[pairs[:, 1]])]
    radius = 0.5 * (1 + disorder * rng.uniform(-0.5, 0.5, len(places)))
    mass = radius**dim
    inertia = 0.4 * mass * radius**2
    turns = 1 if dim == 2 else 3
    inverse = np.concatenate(
        [np.repeat(1 / mass[:, None], dim, 1), np.repeat(1 / inertia[:, None], turns, 1)], axis=1
    )
    inverse[fixed] = 0.0
    pairs = np.repeat(pairs, points, axis=0)
    H = velocities(places, pairs, *_places_of_contact(places, pairs, points, rng))
    free = np.zeros((2, len(places), dim + turns))  # falling, shaken
    free[0, :, dim - 1] = -1.0
    free[1] = 0.3 * rng.normal(size=free[1].shape)
    free[:, fixed] = 0.0
    inertial = sp.diags_array(inverse.ravel())
    motion = free.reshape(2, -1).T
    if spin:  # (m I + 2 m spin [[0, -1], [1, 0]])^-1 m in the first two directions
        turned = np.eye(dim + turns)
        turned[:2, :2] = np.linalg.inv([[1, -2 * spin], [2 * spin, 1]])
        turned = sp.kron(sp.eye_array(len(places)), turned, format="csr")
        inertial, motion = turned @ inertial, turned @ motion
    fall, shaken = (H @ motion).T.reshape(2, -1, dim)
    gaps = np.maximum(0.0, rng.normal(size=len(fall)) - 0.5) * 0.2  # some are not touching yet
    return sp.csr_array(H @ inertial @ H.T), fall, shaken, gaps


def _pairs(places: np.ndarray, longest: float) -> np.ndarray:
    """(m, 2) neighbours in the Delaunay graph that are no further apart than that."""
    corners = Delaunay(places).simplices
    n = corners.shape[1]
    edges = np.concatenate([corners[:, [a, b]] for a in range(n) for b in range(a)])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    return edges[np.linalg.norm(places[edges[:, 0]] - places[edges[:, 1]], axis=1) <= longest]


def _places_of_contact(
    places: np.ndarray, pairs: np.ndarray, points: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Where each pair of bodies touches (m, dim), and the frame there (m, dim, dim)."""
    dim = places.shape[1]
    axis = places[pairs[:, 1]] - places[pairs[:, 0]]
    normal = axis / np.linalg.norm(axis, axis=1)[:, None]
    frame = np.linalg.qr(
        np.concatenate([normal[:, :, None], rng.normal(size=(len(pairs), dim, dim - 1))], axis=2)
    )[0]
    frame[:, :, 0] = normal
    where = places[pairs].mean(axis=1)
    if points > 1:  # spread over a face
        spread = 0.25 * rng.uniform(-1, 1, (len(pairs), dim - 1))
        where = where + np.einsum("mij,mj->mi", frame[:, :, 1:], spread)
    return where, frame


def velocities(
    places: np.ndarray, pairs: np.ndarray, where: np.ndarray, frame: np.ndarray
) -> sp.csr_array:
    """H (dim m, freedom): velocity of the second body of each pair relative to the first, in the
    contact's frame, from the velocities and spins of all bodies.

    The n bodies are at `places`; `pairs` (m, 2) of them touch at `where` (m, dim), and the normal,
    the first column of `frame` (m, dim, dim), points from the first to the second. The columns of H
    go body by body: dim velocities, then one spin in 2D, or three in 3D.
    """
    dim = places.shape[1]
    freedom = 3 if dim == 2 else 6
    i, j, x = [], [], []
    rows = np.arange(len(pairs))[:, None] * dim + np.arange(dim)
    for side, sign in ((1, 1.0), (0, -1.0)):
        arm = where - places[pairs[:, side]]
        move = np.swapaxes(frame, 1, 2)  # (m, dim components, dim)
        if dim == 2:
            spin = np.einsum("mai,mi->ma", move, np.stack([-arm[:, 1], arm[:, 0]], axis=1))[
                :, :, None
            ]
        else:
            spin = np.cross(arm[:, None, :], move)
        block = sign * np.concatenate([move, spin], axis=2)
        columns = pairs[:, side, None, None] * freedom + np.arange(freedom)
        i.append(np.broadcast_to(rows[:, :, None], block.shape).ravel())
        j.append(np.broadcast_to(columns, block.shape).ravel())
        x.append(block.ravel())
    shape = (len(pairs) * dim, len(places) * freedom)
    return sp.csr_array(
        sp.coo_array((np.concatenate(x), (np.concatenate(i), np.concatenate(j))), shape=shape)
    )


def rigid_bodies(
    bodies: int = 10, contacts: int = 30, mu: float = 0.5, seed: int = 0
) -> InterfaceProblem:
    """Random bodies and frames: Q = H' M^-1 H of low rank, q = H' v: a solution exists."""
    if bodies < 2 or contacts < 1:
        raise InputError("rigid_bodies needs at least two bodies and one contact.")
    rng = np.random.default_rng(seed)
    H = np.zeros((3 * contacts, 6 * bodies))
    for c in range(contacts):
        frame = la.qr(rng.normal(size=(3, 3)))[0]
        pair = rng.choice(bodies, 2, replace=False)
        for body, sign in zip(pair, (1.0, -1.0)):
            arm = rng.normal(size=3)
            force = np.hstack([frame, np.cross(arm, frame)])
            H[3 * c : 3 * c + 3, 6 * body : 6 * body + 6] = sign * force
    inverse_mass = 10 ** rng.uniform(-1, 1, 6 * bodies)
    q = (H @ rng.normal(size=6 * bodies)).reshape(-1, 3)
    return InterfaceProblem((H * inverse_mass) @ H.T, q, Coulomb(np.full(contacts, mu)))
