"""Q as a sparse matrix, symmetric or not, and the kernels that work on it."""

import numpy as np
import pytest
import scipy.sparse as sp

from contactopt import InputError, InterfaceProblem, fclib, natural_map_residual, solve
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.families.packings import packing
from contactopt.linear.operators import asymmetry, block, dense, diagonal, held, shifted
from contactopt.methods.kernels.interior import interior_iterates
from contactopt.methods.kernels.sparse_blocks import SparseBlocks
from contactopt.problem import dimensionless


@pytest.fixture(scope="module")
def stack():
    return packing(2, 36, seed=1, mu=0.4, points=2)


def test_a_packing_is_a_family_of_the_benchmark():
    made = FAMILIES["packing"](dim=3, bodies=9, mu=0.2)
    assert sp.issparse(made.Q) and made.dim == 3 and np.all(made.mu == 0.2)
    for wrong in ({"dim": 4}, {"bodies": 3}, {"points": 0}):
        with pytest.raises(InputError, match="packing needs"):
            packing(**wrong)


def test_both_forms_are_the_same_problem(stack):
    array = InterfaceProblem(stack.Q.toarray(), stack.q, stack.mu)
    assert sp.issparse(stack.Q) and array.fingerprint == stack.fingerprint
    assert np.array_equal(diagonal(stack.Q), diagonal(array.Q))
    assert np.array_equal(held(stack.Q), held(array.Q))
    some = np.array([0, 3, 5, 8])
    assert np.array_equal(dense(block(stack.Q, some)), block(array.Q, some))
    added = np.arange(float(stack.q.size))
    assert np.allclose(dense(shifted(stack.Q, added)), shifted(array.Q, added), rtol=1e-15)
    a, b = dimensionless(stack)[0], dimensionless(array)[0]
    assert sp.issparse(a.Q) and np.allclose(dense(a.Q), b.Q, rtol=1e-15)
    r = np.random.default_rng(0).normal(size=stack.q.shape)
    assert natural_map_residual(stack, r) == pytest.approx(
        natural_map_residual(array, r), rel=1e-12
    )


@pytest.mark.parametrize("dim,mu", [(2, 0.0), (2, 0.5), (3, 0.0), (3, 0.7), (3, 1e5)])
def test_every_friction_coefficient(dim, mu):
    solution = solve(packing(dim, 27, mu=mu), time_limit=20)
    assert solution.solved, solution.message


def test_unsymmetric_compliance_is_solved_as_it_stands():
    Q = packing(2, 25).Q.toarray()
    noise = np.random.default_rng(0).normal(size=Q.shape) * (Q != 0)
    # x' Q x > 0
    Q = sp.csr_array(Q + 0.5 * np.diag(np.diag(Q)) + 0.05 * np.abs(Q).max() * (noise - noise.T))
    problem = InterfaceProblem(Q, packing(2, 25).q, 0.3)
    assert not problem.symmetric and asymmetry(problem.Q) > 0.02
    solution = solve(problem)
    u = problem.displacements(solution.reactions, solution.multipliers)
    assert solution.solved and u[:, 0].min() > -1e-7
    assert np.abs(u[:, 0] * solution.reactions[:, 0]).max() < 1e-6

    for method in ("tresca", "acary_cadoux", "alternating"):
        with pytest.raises(InputError, match="unsymmetric"):
            solve(problem, method)


def test_a_plate_on_a_sparse_compliance():
    V = np.tile(np.eye(3), (8, 1))
    Q = sp.csr_array(np.diag(np.tile([1.0, 0.5, 0.7], 8)))
    problem = InterfaceProblem(Q, np.zeros((8, 3)), 0.5, V, [-4.0, 0.3, -0.2])
    solution = solve(problem)
    assert solution.solved and np.allclose(solution.reactions, np.array([4.0, -0.3, 0.2]) / 8)
    *_, (_, error) = interior_iterates(dimensionless(problem)[0], SparseBlocks(Q, 3))
    assert error < 1e-6


@pytest.mark.parametrize(
    "change,words",
    [
        ({"Q": sp.csr_array(np.eye(2) * 1j)}, "real"),
        ({"Q": sp.csr_array(np.eye(3))}, "shape"),
        ({"Q": sp.csr_array(np.diag([1.0, np.nan]))}, "not finite"),
        ({"Q": sp.csr_array(np.diag([1.0, -1.0]))}, "semidefinite"),
        ({"Q": "compliance"}, "numbers"),
        ({"q": [[1.0, 2.0], [3.0]]}, "numbers"),
        ({"V": np.ones((2, 1))}, "V has columns but s is empty"),
    ],
)
def test_what_is_no_problem_is_refused(change, words):
    with pytest.raises(InputError, match=words):
        InterfaceProblem(**({"Q": np.eye(2), "q": [[-1.0, 0.0]], "mu": 0.3} | change))


def as_text(problem, storage):
    k, d = problem.q.shape
    n, Q = k * d, dense(problem.Q)
    out = [d, k, storage, n, n]
    if storage == 0:
        out += [n, n, *Q.T.ravel()]
    elif storage == 1:
        pairs = [
            (i, j)
            for i in range(k)
            for j in range(k)
            if np.any(Q[i * d : i * d + d, j * d : j * d + d])
        ]
        ends = [d * (i + 1) for i in range(k)]
        rows = np.cumsum([0] + [sum(i == row for i, _ in pairs) for row in range(k)])
        out += [len(pairs), k, k, *ends, *ends, k + 1, len(pairs), *rows, *(j for _, j in pairs)]
        for number, (i, j) in enumerate(pairs):
            out += [number, *Q[i * d : i * d + d, j * d : j * d + d].T.ravel()]
    else:
        columns = sp.csc_array(Q)
        out += [f"CSparse\n{n}-by-{n}, nzmax: {columns.nnz} nnz: {columns.nnz}, 1-norm: 1\n"]
        for j in range(n):
            a, b = columns.indptr[j : j + 2]
            out += [f"\n col {j} : locations {a} to {b - 1}\n"]
            out += [
                f"{columns.indices[e]} : {columns.data[e]!r}\n".replace("np.float64(", "").replace(
                    ")", ""
                )
                for e in range(a, b)
            ]
    words = [*out, *problem.q.ravel(), *problem.mu]
    return (
        " ".join(
            w if isinstance(w, str) else repr(float(w)) if isinstance(w, float) else str(w)
            for w in words
        )
        + "\nend"
    )


@pytest.mark.parametrize("storage", [0, 1, 2])
def test_the_text_format_is_read_in_all_storages(storage, tmp_path):
    problem = packing(2, 9, seed=2)
    path = tmp_path / "problem.dat"
    path.write_text(as_text(problem, storage))
    assert fclib.read(path).fingerprint == problem.fingerprint


@pytest.mark.parametrize("text,words", [
    ("3 1", "numbers"),
    ("4 1 0 4 4", "dimension"),
    ("2 1000000000000 0 2000000000000 2000000000000 2000000000000 2000000000000 1.0", "numbers"),
    ("2 1 0 3 3", "does not fit"),
    ("2 1 9 2 2 1 1", "storage"),
    ("2 1 1 2 2 5000000000 1 1 2 2", "numbers"),
    ("2 1 2 2 2 no matrix", "header"),
    ("2 1 2 2 2\n2-by-2, nzmax: 9 nnz: 1000000000, 1-norm: 1\n", "does not fit"),
    ("2 1 0 2 2 2 2 1 0 0 x 0 0 0.3", "usable"),
])  # fmt: skip
def test_malformed_text_is_refused(text, words, tmp_path):
    path = tmp_path / "bad.dat"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        fclib.read(path)
    assert "bad.dat" in str(caught.value)
