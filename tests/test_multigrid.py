"""Multigrid keeps its word on bodies of every kind, and its pieces are what they say."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve
from test_linear import BODIES, made, system

from contactopt import scenes
from contactopt.bodies.body import build_body
from contactopt.bodies.solvers import multigrid
from contactopt.bodies.solvers.constants import RTOL
from contactopt.bodies.solvers.multigrid import conjugate_gradients, nodal_blocks
from contactopt.bodies.solvers.system import Submatrix, System
from contactopt.errors import BackendError, InputError
from contactopt.linear.budget import NextBest, TooDear, open_budget


def energy(A, x):
    return np.sqrt(x @ (A @ x))


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("rtol", [1e-2, 1e-6, 1e-10])
def test_multigrid_keeps_its_word_in_the_energy_norm(body, rtol):
    A, *_, last = args = BODIES[body]
    b = np.zeros(A.shape[0])
    b[last] = np.random.default_rng(0).standard_normal(len(last))
    x = spsolve(A.tocsc(), b)
    error = energy(A, made("multigrid", args).solve(b, rtol) - x)
    assert error <= 2 * rtol * energy(A, x)


@pytest.mark.parametrize(
    "scene, part, sizes",
    [
        (scenes.flat_punch(2), "lower", (16, 32, 64)),
        (scenes.sphere(), "upper", (8, 16, 32)),
        (scenes.flat_punch(3), "upper", (4, 8, 16)),
        (scenes.flat_punch(3), "lower", (4, 8, 16)),
    ],
    ids=["plane", "axisymmetric", "solid punch", "solid foundation"],
)
def test_iterations_of_multigrid_are_bounded_as_the_mesh_is_refined(scene, part, sizes):
    counts = []
    for elements in sizes:
        A, *_, last = args = system(scene, getattr(scene, part), elements)
        solver = made("multigrid", args)
        b = np.zeros(A.shape[0])
        b[last] = np.random.default_rng(0).standard_normal(len(last))
        counts.append(conjugate_gradients(solver.A, solver.cycle, b, RTOL).cycles)
    assert max(counts) <= 25 and counts[2] <= counts[1] + 4, counts


def test_iterations_do_not_depend_on_units_and_vanish_without_load():
    A, *rest = BODIES["solid foundation"]
    b = np.random.default_rng(0).standard_normal(A.shape[0])
    answers = []
    # beyond the range of single precision
    for force, length in ((1.0, 1.0), (1e9, 1.0), (1e-30, 1e-6)):
        solver = made("multigrid", System(force / length * A, *rest))
        x, cycles = conjugate_gradients(solver.A, solver.cycle, force * b, RTOL)
        answers.append((x / length, cycles))
        assert not np.any(solver.solve(0 * b))
        assert solver.solve(np.zeros((len(b), 0))).shape == (len(b), 0)
    for x, cycles in answers[1:]:
        assert np.linalg.norm(x - answers[0][0]) <= 1e-7 * np.linalg.norm(answers[0][0])
        assert cycles == answers[0][1] > 0


def test_a_rough_solve_tells_nothing_of_the_cost_of_others():
    """Its first digit takes the most V-cycles: a good way was left for a product to two digits."""
    solver = made("multigrid", BODIES["solid foundation"])
    b = np.random.default_rng(0).standard_normal(BODIES["solid foundation"].A.shape[0])
    with open_budget(NextBest("coupled", "explicit", "superlu", 1e9, 1e7, None)):
        solver.solve(b, 1e-2)
        with pytest.raises(TooDear):
            solver.solve(b)


def test_a_block_is_the_matrix_without_the_other_rows():
    """Multigrid for a Submatrix, which copies nothing, is multigrid for its rows and columns."""
    A, *rest = BODIES["solid punch"]
    n = A.shape[0]
    whole = sp.csr_matrix(sp.block_diag([np.eye(2), A, np.eye(3)]))
    b = np.random.default_rng(0).standard_normal(n)
    blocks = Submatrix(whole, np.arange(2, n + 2)), A
    found = (made("multigrid", System(own, *rest)).solve(b) for own in blocks)
    assert np.array_equal(*found)


@pytest.mark.parametrize("degree", [1, 2])
def test_blocks_of_the_stiffness_are_those_of_its_rows(degree):
    """Of a body with held components at some nodes and others that are held altogether."""
    scene = scenes.make_scene("punch-3d", degree=degree)
    body = build_body(scene, scene.lower, 3, scene.zone)
    dofs, free = body.unknowns, body.free
    node, component = np.empty((2, dofs.size), dtype=int)
    node[dofs], component[dofs] = np.arange(dofs.shape[1]), np.arange(len(dofs))[:, None]
    known = node[free], component[free], len(dofs)
    fast, place, present = nodal_blocks(Submatrix(body.A, free), *known)
    slow, *others = nodal_blocks(body.A[free][:, free], *known)
    assert len(present) < dofs.shape[1] and len(place) < fast.shape[0]
    assert fast.blocksize == (3, 3) and abs(fast - slow).max() == 0
    assert np.array_equal(place, others[0]) and np.array_equal(present, others[1])


def test_accuracy_that_cannot_be_had(monkeypatch):
    solver = made("multigrid", BODIES["solid foundation"])
    b = np.ones(solver.n)
    with pytest.raises(InputError, match="rtol"):
        solver.solve(b, 0.0)
    with pytest.raises(BackendError, match="multigrid"):
        solver.solve(b * np.nan)
    monkeypatch.setattr(multigrid, "MOST_ITERATIONS", 3)
    with pytest.raises(BackendError, match="within 3 iterations"):
        solver.solve(b)
