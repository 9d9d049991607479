"""Velocities of rigid bodies where they touch."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp


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
