"""Problems of other codes, read where they lie; the files are not part of the project."""

from pathlib import Path

import numpy as np
import pytest

from contactopt import InputError, InterfaceProblem, fclib, siconos_residual, solve
from contactopt.linear.operators import dense
from contactopt.problem.laws.bilateral import Bilateral

h5py = pytest.importorskip("h5py")

FOLDER = Path(__file__).parents[2] / "shared" / "fclib"
FILES = sorted(FOLDER.glob("*.hdf5"))
FULL_RANK = ("Box_Stacks", "CubeH8")


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem[:20])
def test_every_problem_of_the_collection_is_certified(path):
    problem = fclib.read(path)
    tol = 1e-12 if path.name.startswith(FULL_RANK) else 1e-8
    solution = solve(problem, tol=tol)
    assert solution.solved, solution.message
    assert (
        siconos_residual(problem, solution.reactions, solution.multipliers) <= 1e-8
    )  # the published measure, its own units
    u = problem.displacements(solution.reactions, solution.multipliers)
    r_n, r_t = solution.reactions[:, 0], np.linalg.norm(solution.reactions[:, 1:], axis=1)
    assert np.all(r_t <= problem.mu * r_n + 1e-6 * np.abs(solution.reactions).max())
    assert u[:, 0].min() >= -1e-6 * np.abs(problem.q).max()


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem[:20])
def test_round_trip_of_the_collection_is_exact(path, tmp_path):
    problem = fclib.read(path)
    fclib.write(problem, tmp_path / "again.hdf5")
    assert fclib.read(tmp_path / "again.hdf5").fingerprint == problem.fingerprint


def test_round_trip_with_a_balance_is_exact(punch, cube, tmp_path):
    for problem in (punch, cube):
        fclib.write(problem, tmp_path / "scene.hdf5", "punch", "a plate under a total force")
        again = fclib.read(tmp_path / "scene.hdf5")
        assert again.fingerprint == problem.fingerprint
        assert np.array_equal(again.V, problem.V) and np.array_equal(again.s, problem.s)
        assert not list(tmp_path.glob("tmp*"))


def global_file(path, storage):
    """M = diag(2, 4, 8), H a rotation: W = H' M^-1 H by hand."""
    M, H = np.diag([2.0, 4.0, 8.0]), np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    f, w = np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.5, 0.25])
    with h5py.File(path, "w") as file:
        group = file.create_group("fclib_global")
        group["spacedim"] = np.array([3], dtype=np.int32)
        for name, matrix in (("M", M), ("H", H)):
            store(group.create_group(name), matrix, storage)
        group["vectors/f"], group["vectors/w"], group["vectors/mu"] = f, w, np.array([0.3])
    return H.T @ np.linalg.inv(M) @ H, H.T @ np.linalg.inv(M) @ f + w


def store(group, matrix, storage):
    rows, columns = np.nonzero(matrix)
    values = matrix[rows, columns]
    if storage == "columns":
        order = np.lexsort((rows, columns))
        p, i, nz = np.searchsorted(columns[order], np.arange(matrix.shape[1] + 1)), rows[order], -1
        values = values[order]
    elif storage == "rows":
        p, i, nz = np.searchsorted(rows, np.arange(matrix.shape[0] + 1)), columns, -2
    else:
        p, i, nz = columns, rows, len(values)
    for key, value in (
        ("m", matrix.shape[0]),
        ("n", matrix.shape[1]),
        ("nz", nz),
        ("nzmax", len(values)),
    ):
        group[key] = np.array([value], dtype=np.int32)
    group["p"], group["i"], group["x"] = p.astype(np.int32), i.astype(np.int32), values


@pytest.mark.parametrize("storage", ["columns", "rows", "triplets"])
def test_global_form_is_condensed(storage, tmp_path):
    W, q = global_file(tmp_path / "g.hdf5", storage)
    problem = fclib.read(tmp_path / "g.hdf5")
    assert np.allclose(dense(problem.Q), W, atol=1e-15)
    assert np.allclose(problem.q.ravel(), q, atol=1e-15)
    assert solve(problem, tol=1e-12).solved


def damaged(change):
    def make(path):
        global_file(path, "columns")
        with h5py.File(path, "a") as file:
            change(file)

    return make


@pytest.mark.parametrize("make,words", [
    (lambda path: path.write_text("not hdf5"), "usable FCLib file"),
    (lambda path: None, "usable FCLib file"),
    (lambda path: h5py.File(path, "w").close(), "neither"),
    (damaged(lambda f: f["fclib_global"].__delitem__("M")), "usable FCLib file"),
    (damaged(lambda f: f["fclib_global/spacedim"].__setitem__(0, 5)), "spacedim is 5"),
    (damaged(lambda f: f["fclib_global/vectors/mu"].__setitem__(0, -1.0)), "must not be negative"),
    (damaged(lambda f: f["fclib_global/vectors/w"].__setitem__(0, np.nan)), "not finite"),
    (damaged(lambda f: f["fclib_global/H/i"].__setitem__(0, 77)), "usable FCLib file"),
    (damaged(lambda f: f["fclib_global/M/nz"].__setitem__(0, -7)), "storage"),
    (damaged(lambda f: f["fclib_global/M/x"].__setitem__(0, 0.0)), "usable FCLib file"),
])  # fmt: skip
def test_malformed_files_are_refused_by_name(make, words, tmp_path):
    make(tmp_path / "bad.hdf5")
    with pytest.raises(InputError, match=words) as caught:
        fclib.read(tmp_path / "bad.hdf5")
    assert "bad.hdf5" in str(caught.value)


def test_bilateral_contact_cannot_be_written(tmp_path):
    problem = InterfaceProblem(np.eye(2), np.zeros((1, 2)), Bilateral(0.3))
    with pytest.raises(InputError, match="Bilateral"):
        fclib.write(problem, tmp_path / "x.hdf5")
    assert not list(tmp_path.iterdir())
