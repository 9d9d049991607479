"""Rigid bodies that touch at random places in random directions."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb


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
