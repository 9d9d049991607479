"""What every host shares; it runs in the host's own Python, which has NumPy alone."""

import os

import numpy as np

E, NU = 70.0, 0.3
LAM, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
FILE, COUNT = os.environ.get("BLOCK_FILE", ""), int(os.environ.get("BLOCK_COUNT", "8"))


def give(K, points, cells, unknowns):
    """Write a stiffness (scipy sparse), points (N, 3), tetrahedra (m, 4) and the numbers of the
    unknowns of each point (N, 3) for contactopt.
    """
    K = K.tocoo()
    faces = np.concatenate([np.delete(cells, corner, axis=1) for corner in range(4)])
    level = points[:, 2][faces]
    np.savez(
        FILE,
        entries=K.data,
        places=np.stack([K.row, K.col]),
        points=points,
        cells=cells,
        unknowns=unknowns,
        contact=faces[np.all(np.abs(level) < 1e-9, axis=1)],
        fixed=unknowns[np.abs(points[:, 2] + 1) < 1e-9].ravel(),
    )
