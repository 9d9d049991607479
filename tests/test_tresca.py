from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import one_contact

from contactopt import (
    InputError,
    InterfaceProblem,
    Material,
    Part,
    Rigid,
    Scene,
    Support,
    fclib,
    reduce,
    scenes,
    solve,
)
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.methods.tresca_iteration import Tresca, TrescaProblem
from contactopt.problem import dimensionless
from contactopt.problem.laws.bilateral import Bilateral
from contactopt.problem.laws.coulomb import Coulomb

CYCLING = (-10.0, 1.0)
FCLIB = Path(__file__).parents[2] / "shared" / "fclib"


def test_a_known_cycle_is_recognised_with_its_two_values():
    """K = [[1, 1.5], [1.5, 4]], f = (-10, 1), mu = 1: the bounds 1 and 14.5 answer each other."""
    problem = one_contact(CYCLING, 1.0)
    solution = solve(problem, Tresca())
    more = solve(problem, Tresca(), max_iterations=solution.iterations - 1)
    assert solution.status.label == "cycling"
    assert sorted([solution.reactions[0, 0], more.reactions[0, 0]]) == pytest.approx(
        [1.0, 14.5], abs=1e-8
    )


def test_relaxation_breaks_the_cycle():
    solution = solve(one_contact(CYCLING, 1.0), Tresca(relaxation=0.5), tol=1e-10)
    assert solution.solved
    assert solution.reactions[0] == pytest.approx([6.4, -6.4], abs=1e-8)


@pytest.mark.parametrize("mu,converges", [(0.6, True), (0.67, False)])
def test_contraction_threshold(mu, converges):
    """The critical friction coefficient is K_tt / |K_tn| = 2/3."""
    assert solve(one_contact(CYCLING, mu), Tresca(), max_iterations=2000).solved is converges


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


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("bilateral", [False, True])
def test_same_answer_as_newton(dim, bilateral):
    problem = reduce(
        scenes.flat_punch(dim, elements=8 if dim == 2 else 3, mu=0.15, bilateral=bilateral)
    )
    ours, best = solve(problem, Tresca(), tol=1e-10), solve(problem, "auto", tol=1e-11)
    assert ours.solved and best.solved and ours.iterations > 1
    assert np.allclose(ours.reactions, best.reactions, atol=1e-7 * np.abs(best.reactions).max())
    assert ours.multipliers == pytest.approx(best.multipliers, rel=1e-8)


@pytest.mark.parametrize("dim", [2, 3])
def test_without_friction_one_problem_is_enough(dim):
    solution = solve(reduce(scenes.flat_punch(dim, elements=3, mu=0.0)), Tresca(), tol=1e-12)
    assert solution.solved and solution.iterations == 1
    assert not np.any(solution.reactions[:, 1:])


@pytest.mark.parametrize("dim", [2, 3])
def test_plate_dragged_sideways(dim):
    base = reduce(scenes.flat_punch(dim, elements=3))
    along = np.zeros((base.contacts, dim))
    along[:, 1] = 1.0
    V, s = np.column_stack([base.V, along.ravel()]), np.append(base.s, 0.3 * base.s)
    problem = InterfaceProblem(base.Q, base.q, base.mu, V, s)
    ours, best = solve(problem, Tresca()), solve(problem, "auto", tol=1e-11)
    assert ours.solved
    assert ours.reactions[:, 1].sum() == pytest.approx(-s[1], rel=1e-7)
    assert ours.multipliers == pytest.approx(best.multipliers, rel=1e-6)


@pytest.mark.parametrize("dim,backend", [(2, "clarabel"), (2, "osqp"), (3, "scs")])
def test_other_backends_give_the_same(dim, backend):
    problem = reduce(scenes.flat_punch(dim, elements=3))
    ours, other = solve(problem, Tresca()), solve(problem, Tresca(backend))
    assert ours.solved and other.solved
    assert np.allclose(ours.reactions, other.reactions, atol=1e-6 * np.abs(ours.reactions).max())


@pytest.mark.parametrize("bilateral", [False, True])
def test_the_convex_problem_is_solved_to_rounding(cube, bilateral):
    """Every iterate obeys both laws for its own bounds, some of them zero, not only the last one
    for Coulomb's.
    """
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


def test_warm_start_from_the_answer_is_one_iteration(punch):
    first = solve(punch, Tresca(), tol=1e-10)
    assert solve(punch, Tresca(), tol=1e-9, start=first).iterations == 1


def test_settings_are_checked():
    with pytest.raises(InputError, match="relaxation"):
        Tresca(relaxation=0.0)
    assert Tresca().backends(2) == ("proxqp", "proxqp") and Tresca().backends(3) == (
        "clarabel",
        "clarabel",
    )
    with pytest.raises(InputError, match="unknown conic backend 'proxqp'"):
        Tresca("proxqp").backends(3)


@pytest.mark.parametrize(
    "name", ["Box_Stacks-i0035-31-0", "CubeH8", "LMGC_100_PR_PerioBox-i00361-60-03000"]
)
def test_public_problems(name):
    path = FCLIB / f"{name}.hdf5"
    if not path.exists():
        pytest.skip("the FCLib files are not here")
    assert solve(fclib.read(path), Tresca(), max_iterations=50).solved
