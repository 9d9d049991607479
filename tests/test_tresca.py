from dataclasses import replace

import numpy as np
import pytest

from contactopt import (
    InputError,
    InterfaceProblem,
    Material,
    Part,
    Rigid,
    Scene,
    Support,
    reduce,
    scenes,
    solve,
)
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.methods.tresca_iteration import Tresca, TrescaProblem
from contactopt.problem import dimensionless
from contactopt.problem.laws.bilateral import Bilateral
from contactopt.problem.laws.coulomb import Coulomb


@pytest.fixture(scope="module")
def dragged() -> InterfaceProblem:
    """A square block, nu = .2, 40 x 40 elements, clamped on top, moved down and four times as far
    sideways.
    """
    grid = np.linspace(0.0, 1.0, 41)
    mesh = rename(tensor_mesh(grid, grid), contact="y-", top="y+")
    block = Part("block", mesh, Material(1.0, 0.2), (Support("top", {"x": 0.4, "y": -0.1}),))
    return reduce(Scene("dragged block", block, Rigid("plane"), 0.2))


@pytest.mark.parametrize("mu,iterations", [(0.2, 9), (0.5, 13), (1.0, 20), (1.5, 30), (2.0, 47)])
def test_more_friction_needs_more_iterations(dragged, mu, iterations):
    """Numbers of an independent prototype on a block of these proportions, to 1e-8."""
    solution = solve(replace(dragged, law=mu), Tresca(), tol=1e-8)
    assert solution.solved and abs(solution.iterations - iterations) <= max(2, 0.1 * iterations)


def test_too_much_friction_for_a_fixed_point_is_none_for_newton(dragged):
    problem = replace(dragged, law=3.0)
    assert solve(problem, Tresca(), max_iterations=200).status.label == "iteration_limit"
    assert solve(problem, Tresca(relaxation=0.5), max_iterations=200).solved
    assert solve(problem, "newton").solved


@pytest.mark.parametrize("dim,backend", [(2, "clarabel"), (2, "osqp"), (3, "scs")])
def test_other_backends_give_the_same(dim, backend):
    problem = reduce(scenes.flat_punch(dim, elements=3))
    ours, other = solve(problem, Tresca()), solve(problem, Tresca(backend))
    assert ours.solved and other.solved
    assert np.allclose(ours.reactions, other.reactions, atol=1e-6 * np.abs(ours.reactions).max())


@pytest.mark.parametrize("bilateral", [False, True])
def test_the_convex_problem_is_solved_to_rounding(cube, bilateral):
    """Every iterate obeys both laws for its own bounds, some of them zero."""
    problem, _ = dimensionless(cube)
    problem = replace(problem, law=(Bilateral if bilateral else Coulomb)(problem.mu))
    g = np.where(np.arange(cube.contacts) % 3 == 0, 0.0, 0.05)
    r, lam = TrescaProblem("clarabel", problem).solve(g, np.zeros(problem.q.shape))
    u = problem.displacements(r, lam)
    assert np.abs(problem.V.T @ r.ravel() + problem.s).max() < 1e-12
    assert np.allclose(
        r[:, 0], r[:, 0] - u[:, 0] if bilateral else np.maximum(r[:, 0] - u[:, 0], 0), atol=1e-12
    )
    size, slip = np.linalg.norm(r[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
    assert np.all(size <= g + 1e-12) and (slip > 1e-3).any()
    assert np.allclose(r[:, 1:] * slip[:, None], -g[:, None] * u[:, 1:], atol=1e-11)


def test_settings_are_checked():
    assert Tresca().backends(2) == ("proxqp", "proxqp")
    assert Tresca().backends(3) == ("clarabel", "clarabel")
    with pytest.raises(InputError, match="unknown conic backend 'proxqp'"):
        Tresca("proxqp").backends(3)
