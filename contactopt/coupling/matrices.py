"""The matrices of a reduced scene for other codes, as arrays in one file or as Matrix Market files.

Every body with a stiffness has, under its name:

    K, f        stiffness (n, n) and loads (n,), before supports and plates
    N, g, p     the displacements that supports and plates leave: U = g + N v with the unknowns v
                (m,) and the forces p (m,) of plates on them, so that
                N' K N v = N' (f - K g + B' r) + p
    B           (k dim, n) signed map: contact forces B' r on the body, and its share B U of u
    points      (N, dim) of the nodes, and unknowns (N, dim), the numbers of theirs in U
    NAME        (f, j) nodes of the facets of each contact surface, as `facets.NAME`

and of the scene Q, q, V, s and mu of contactopt.problem.interface_problem: u = Q r + V lambda + q,
V' r + s = 0.
"""

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.coupling.reduction import Reduction
from contactopt.files.writing import whole_file, whole_folder


def matrices_of(reduction: Reduction) -> dict[str, Any]:
    """The arrays and sparse matrices listed at the top, by names such as 'upper.K'."""
    problem = reduction.problem.explicit()
    found: dict[str, Any] = {name: getattr(problem, name) for name in ("Q", "q", "V", "s", "mu")}
    for body, B in zip(reduction.bodies, reduction.maps):
        own = body.view
        if own is None:
            continue
        n, m = len(own.load), len(own.free)
        free = sp.csr_matrix((np.ones(m), (own.free, np.arange(m))), (n, m))
        made = {
            "K": own.A,
            "f": own.load,
            "N": sp.csr_matrix(sp.hstack([free, sp.csr_matrix(own.motion)])),
            "g": own.prescribed,
            "p": np.concatenate([np.zeros(m), own.plate_forces]),
            "B": B,
            "points": own.locations.T,
            "unknowns": own.unknowns.T,
        }
        made |= {f"facets.{name}": faces for name, faces in own.facets.items()}
        found |= {f"{body.name}.{name}": value for name, value in made.items()}
    return found


def write_matrices(reduction: Reduction, path: Path, form: str) -> None:
    """Write them as NumPy's npz, or into a folder of Matrix Market files."""
    from scipy.io import mmwrite

    found = matrices_of(reduction)
    if form == "mtx":
        with whole_folder(path) as folder:
            for name, value in found.items():
                given = value if sp.issparse(value) else np.atleast_2d(np.asarray(value).T).T
                mmwrite(folder / f"{name}.mtx", given, precision=17)
        return
    flat: dict[str, Any] = {}
    for name, value in found.items():
        if sp.issparse(value):
            own = sp.csr_matrix(value)
            flat |= {f"{name}.{part}": getattr(own, part) for part in ("data", "indices", "indptr")}
            flat[f"{name}.shape"] = own.shape
        else:
            flat[name] = value
    with whole_file(path) as file, file.open("wb") as opened:
        np.savez(opened, **flat)
