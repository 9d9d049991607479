"""Problems of the FCLib collection (HDF5) in and out.

Local form: u = W r + q. Global form: M v = H r + f, u = H' v + w, from which W = H' M^-1 H and q = H' M^-1 f + w.
Format: FCLib 1.x, https://frictionalcontactlibrary.github.io. Needs h5py (`pip install 'contactopt[fclib]'`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.errors import InputError
from contactopt.files import whole_file
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise InputError("FCLib files need h5py; install it with: pip install h5py") from error
    return h5py


def read(path: str | Path) -> InterfaceProblem:
    """The problem in an FCLib file, local or global form; a stored solution is ignored.

    Equality constraints are kept: V, s from `R, vectors/s` of the mixed form are the problem's balance.
    Raises InputError, naming the file, if it is missing or malformed.
    """
    h5py = _h5py()
    try:
        with h5py.File(path, "r") as file:
            if "fclib_local" in file:
                return _read_local(file["fclib_local"])
            if "fclib_global" in file:
                return _read_global(file["fclib_global"])
            raise InputError("it holds neither 'fclib_local' nor 'fclib_global'")
    except InputError as error:
        raise InputError(f"'{path}' is not a usable FCLib file: {error}") from error
    except (OSError, KeyError, ValueError, IndexError, TypeError, RuntimeError) as error:
        raise InputError(f"'{path}' is not a usable FCLib file: {error}") from error


def write(problem: InterfaceProblem, path: str | Path, title: str = "", description: str = "") -> None:
    """Write a problem in FCLib's local form; read() gives back the same numbers.

    With a balance (V, s) it is the mixed form u = W r + V lambda + q, R u-part zero: groups V, R and vectors/s.
    The file appears complete or not at all. Raises InputError for other laws than Coulomb's, which FCLib cannot express.
    """
    law = problem.law
    if not (law.unilateral and law.proportional) or law.dilatant:
        raise InputError(
            f"FCLib knows Coulomb's law only; this problem has {type(law).__name__} and cannot be written."
        )
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


def _read_local(group: Any) -> InterfaceProblem:
    _, q, mu = _vectors(group, "q")
    W = _read_matrix(group["W"]).toarray()
    if "V" in group and "R" in group:
        if _read_matrix(group["R"]).nnz:
            raise InputError("its equality block R is not zero, which is not supported")
        return InterfaceProblem(W, q, Coulomb(mu), _read_matrix(group["V"]).toarray(), np.ravel(group["vectors/s"][()]))
    return InterfaceProblem(W, q, Coulomb(mu))


def _read_global(group: Any) -> InterfaceProblem:
    dim, w, mu = _vectors(group, "w")
    M, H = _read_matrix(group["M"]), _read_matrix(group["H"])
    if M.shape[0] != H.shape[0]:
        raise InputError(f"M is {M.shape} and H is {H.shape}")
    factors = splu(M.tocsc())
    X = factors.solve(H.toarray())
    W = H.T @ X
    q = H.T @ factors.solve(np.ravel(group["vectors/f"][()]).astype(float)) + w.ravel()
    return InterfaceProblem(W, q.reshape(-1, dim), Coulomb(mu))


def _vectors(group: Any, name: str) -> tuple[int, np.ndarray, np.ndarray]:
    dim = int(np.ravel(group["spacedim"][()])[0])
    if dim not in (2, 3):
        raise InputError(f"spacedim is {dim}, not 2 or 3")
    return dim, np.ravel(group[f"vectors/{name}"][()]).reshape(-1, dim), np.ravel(group["vectors/mu"][()])


def _read_matrix(group: Any) -> sp.csr_matrix:
    """nz = -2: compressed rows, -1: compressed columns, >= 0: triplets (p columns, i rows)."""
    m, n, nz = (int(np.ravel(group[key][()])[0]) for key in ("m", "n", "nz"))
    p, i, x = (np.ravel(group[key][()]) for key in ("p", "i", "x"))
    if nz >= 0:
        if min(len(p), len(i), len(x)) < nz:
            raise InputError("a matrix has fewer entries than it announces")
        return sp.coo_matrix((x[:nz], (i[:nz], p[:nz])), (m, n)).tocsr()
    if nz not in (-1, -2) or len(p) != (n if nz == -1 else m) + 1:
        raise InputError("a matrix has an unknown or inconsistent storage")
    kind = sp.csc_matrix if nz == -1 else sp.csr_matrix
    matrix = kind((x[: p[-1]], i[: p[-1]], p), (m, n))
    matrix.check_format(full_check=True)
    return matrix.tocsr()


def _write_matrix(group: Any, matrix: sp.csc_matrix) -> None:
    for key, value in (("m", matrix.shape[0]), ("n", matrix.shape[1]), ("nz", -1), ("nzmax", matrix.nnz)):
        group[key] = np.array([value], dtype=np.int32)
    group["p"], group["i"] = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
    group["x"] = matrix.data.astype(float)
