"""The HDF5 files of the FCLib collection.

Local form: u = W r + q. Global form: M v = H r + f, u = H' v + w, from which W = H' M^-1 H and q =
H' M^-1 f + w. Format: FCLib 1.x.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from contactopt.errors import InputError
from contactopt.fclib.text import compact
from contactopt.files.writing import whole_file
from contactopt.linear.operators import has_entries
from contactopt.problem import InterfaceProblem

if TYPE_CHECKING:
    import h5py

MAGIC = b"\x89HDF\r\n\x1a\n"  # the first bytes of an HDF5 file
# bytes that need not be in the file, and how much smaller compression can make others
SMALL, PACKED = 2**20, 2000
COLUMNS = 256  # of H solved for at a time


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise InputError("FCLib files need h5py; install it with: pip install h5py") from error
    return h5py


def read_hdf5(path: Path) -> InterfaceProblem:
    """The problem in an HDF5 file, in local or in global form and in the units of the file.

    InputError if the file holds neither form, if its data lie in other files or are malformed, or
    if h5py is not installed. Exceptions of h5py are not caught here.
    """
    h5py = _h5py()
    with h5py.File(path, "r") as file:
        if "fclib_local" in file:
            return _read_local(_item(file, "fclib_local"))
        if "fclib_global" in file:
            return _read_global(_item(file, "fclib_global"))
        raise InputError("it holds neither 'fclib_local' nor 'fclib_global'")


def _item(group: h5py.Group, name: str) -> Any:
    """The group or data set of a path; InputError if it lies elsewhere or is not stored whole."""
    h5py = _h5py()
    for part in name.split("/"):
        if isinstance(group.get(part, getlink=True), h5py.ExternalLink):
            raise InputError(f"'{name}' is a link to another file, which is not followed")
        group = group[part]
    if isinstance(group, h5py.Dataset):
        if group.external or group.is_virtual:
            raise InputError(f"the data of '{name}' lie in another file, which is not read")
        if group.nbytes > SMALL + PACKED * group.id.get_storage_size():
            raise InputError(f"'{name}' announces more numbers, {group.size}, than are in the file")
    return group


def _array(group: h5py.Group, name: str) -> np.ndarray:
    return np.ravel(_item(group, name)[()])


def write(
    problem: InterfaceProblem, path: str | Path, title: str = "", description: str = ""
) -> None:
    """Write a problem in FCLib's local form; read() gives back the same numbers.

    With a balance (V, s) it is the mixed form u = W r + V lambda + q, R u-part zero: groups V, R
    and vectors/s. The file appears complete or not at all.

    Parameters
    ----------
    problem : The problem, under Coulomb's law.
    path : Where the file shall be.
    title, description : Texts that the file keeps about the problem.

    Raises
    ------
    InputError : On other laws than Coulomb's, which FCLib cannot express; on a Q that is known by
        its products only; on a folder that cannot be written to; and where h5py is not installed.
    """
    if not isinstance(problem, InterfaceProblem):
        raise InputError(
            f"what is written must be an InterfaceProblem; got {type(problem).__name__}."
        )
    law = problem.law
    if not (law.unilateral and law.proportional) or law.dilatant:
        raise InputError(
            "FCLib expresses Coulomb's law only; this problem"
            f" has {type(law).__name__} and cannot be written."
        )
    if not has_entries(problem.Q):
        raise InputError("Q is known by its products only; write problem.explicit().")
    h5py = _h5py()
    with whole_file(path) as beside, h5py.File(beside, "w") as file:
        group = file.create_group("fclib_local")
        group["spacedim"] = np.array([problem.dim], dtype=np.int32)
        group["info/title"], group["info/description"] = title, description
        _write_matrix(group.create_group("W"), sp.csc_matrix(problem.Q))
        group["vectors/q"], group["vectors/mu"] = problem.q.ravel(), problem.mu
        if len(problem.s):
            _write_matrix(group.create_group("V"), sp.csc_matrix(problem.V))
            _write_matrix(group.create_group("R"), sp.csc_matrix((len(problem.s), len(problem.s))))
            group["vectors/s"] = problem.s


def _read_local(group: h5py.Group) -> InterfaceProblem:
    _, q, mu = _vectors(group, "q")
    W = compact(_read_matrix(_item(group, "W"), (q.size, q.size)))
    if "V" in group and "R" in group:
        s = _array(group, "vectors/s")
        if _read_matrix(_item(group, "R"), (len(s), len(s))).nnz:
            raise InputError("its equality block R is not zero, which is not supported")
        V = _read_matrix(_item(group, "V"), (q.size, len(s))).toarray()
        return InterfaceProblem(W, q, mu, V, s)
    return InterfaceProblem(W, q, mu)


def _read_global(group: h5py.Group) -> InterfaceProblem:
    dim, w, mu = _vectors(group, "w")
    f = _array(group, "vectors/f").astype(float)
    M = _read_matrix(_item(group, "M"), (len(f), len(f)))
    H = _read_matrix(_item(group, "H"), (len(f), w.size))
    W = sp.csr_array(H.T @ _solved(M, H))
    q = H.T @ _solved(M, sp.csr_array(f[:, None])).toarray()[:, 0] + w.ravel()
    return InterfaceProblem(compact(W), q.reshape(-1, dim), mu)


def _solved(M: sp.csr_array, X: sp.csr_array) -> sp.csr_array:
    """M^-1 X. RuntimeError if M is singular.

    M^-1 is sparse if M has a small block for each rigid body, and is found by as many solutions as
    a block has rows.
    """
    factors, n = splu(sp.csc_array(M)), M.shape[0]
    count, body = connected_components(M, directed=False)
    sizes = np.bincount(body, minlength=count)
    if sizes.max(initial=0) <= 60:  # largest block of M that is inverted on its own
        order, place = np.argsort(body, kind="stable"), np.zeros(n, dtype=int)
        place[order] = np.arange(n) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        own = sp.csr_array((np.ones(n), (np.arange(n), body)), shape=(n, count))
        i, j = (own @ own.T).nonzero()
        found = factors.solve(np.eye(sizes.max(initial=0))[place])
        return sp.csr_array((found[i, place[j]], (i, j)), shape=M.shape) @ X
    X = sp.csc_array(X)
    parts = [
        sp.csc_array(factors.solve(X[:, i : i + COLUMNS].toarray()))
        for i in range(0, X.shape[1], COLUMNS)
    ]
    return sp.csr_array(sp.hstack(parts))


def _vectors(group: h5py.Group, name: str) -> tuple[int, np.ndarray, np.ndarray]:
    dim = int(_array(group, "spacedim")[0])
    if dim not in (2, 3):
        raise InputError(f"spacedim is {dim}, not 2 or 3")
    return dim, _array(group, f"vectors/{name}").reshape(-1, dim), _array(group, "vectors/mu")


def _read_matrix(group: h5py.Group, shape: tuple[int, int]) -> sp.csr_array:
    """nz = -2: compressed rows, -1: compressed columns, >= 0: triplets (p columns, i rows)."""
    m, n, nz = (int(_array(group, key)[0]) for key in ("m", "n", "nz"))
    if (m, n) != shape:
        raise InputError(f"a matrix is {m} by {n}, where the vectors need {shape[0]} by {shape[1]}")
    p, i, x = (_array(group, key) for key in ("p", "i", "x"))
    if nz >= 0:
        if min(len(p), len(i), len(x)) < nz:
            raise InputError("a matrix has fewer entries than it announces")
        return sp.csr_array(sp.coo_array((x[:nz], (i[:nz], p[:nz])), shape=shape))
    if nz not in (-1, -2) or len(p) != (n if nz == -1 else m) + 1:
        raise InputError("a matrix has an unknown or inconsistent storage")
    kind = sp.csc_array if nz == -1 else sp.csr_array
    matrix = kind((x[: p[-1]], i[: p[-1]], p), shape=shape)
    matrix.check_format(full_check=True)
    return sp.csr_array(matrix)


def _write_matrix(group: h5py.Group, matrix: sp.csc_matrix) -> None:
    m, n = matrix.shape
    for key, value in {"m": m, "n": n, "nz": -1, "nzmax": matrix.nnz}.items():
        group[key] = np.array([value], dtype=np.int32)
    group["p"], group["i"] = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
    group["x"] = matrix.data.astype(float)
