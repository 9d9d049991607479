import numpy as np
import pytest
from conftest import one_contact

from contactopt import InputError, InterfaceProblem, natural_map_residual, reduce, scenes, solve
from contactopt.methods.alternating import Alternating
from contactopt.problem.laws.bilateral import Bilateral

CYCLING = (-10.0, 1.0)


def test_a_known_cycle_is_recognised_with_its_two_values():
    """K = [[1, 1.5], [1.5, 4]], f = (-10, 1), mu = 1: the iteration alternates between two normal
    forces.
    """
    problem = one_contact(CYCLING, 1.0)
    solution = solve(problem, method="alternating")
    assert solution.status.label == "cycling" and not solution.solved
    more = solve(problem, max_iterations=solution.iterations - 1, method="alternating")
    assert sorted([solution.reactions[0, 0], more.reactions[0, 0]]) == pytest.approx(
        [5.11864, 8.32203], abs=1e-5
    )


def test_relaxation_breaks_the_cycle():
    solution = solve(one_contact(CYCLING, 1.0), relaxation=0.5, method="alternating")
    assert solution.solved
    assert solution.reactions[0] == pytest.approx([6.4, -6.4], abs=1e-6)


@pytest.mark.parametrize("mu,converges", [(0.6, True), (0.67, False)])
def test_contraction_threshold(mu, converges):
    """The critical friction coefficient is K_tt / |K_tn| = 2/3."""
    assert (
        solve(one_contact(CYCLING, mu), max_iterations=2000, method="alternating").solved
        is converges
    )


def test_answers_satisfy_the_laws_they_claim():
    punch = reduce(scenes.flat_punch(2, elements=12, mu=0.15))
    solution = solve(punch, tol=1e-10, method="alternating")
    u = punch.displacements(solution.reactions, solution.multipliers)
    r = solution.reactions
    scale_r, scale_u = np.abs(r).max(), np.abs(solution.multipliers).max()
    assert solution.solved
    assert r[:, 0].min() >= 0 and u[:, 0].min() > -1e-8 * scale_u
    assert np.abs(r[:, 0] * u[:, 0]).max() < 1e-8 * scale_r * scale_u
    bound = punch.mu * r[:, 0]
    assert np.all(np.abs(r[:, 1]) <= bound + 1e-8 * scale_r)
    slipping = np.abs(u[:, 1]) > 1e-6 * scale_u
    assert slipping.any()
    assert np.allclose(
        r[slipping, 1], -bound[slipping] * np.sign(u[slipping, 1]), atol=1e-8 * scale_r
    )


def test_in_3d_friction_opposes_slip(cube):
    solution = solve(cube, tol=1e-10, method="alternating")
    u = cube.displacements(solution.reactions, solution.multipliers)[:, 1:]
    r_n, r_t = solution.reactions[:, 0], solution.reactions[:, 1:]
    slip = np.linalg.norm(u, axis=1)
    slipping = slip > 1e-6 * slip.max()
    assert slipping.any()
    expected = -(0.5 * r_n / np.where(slip > 0, slip, 1))[:, None] * u
    assert np.allclose(r_t[slipping], expected[slipping], atol=1e-7 * r_n.max())


def test_one_tangential_direction_solved_as_discs_gives_the_same():
    """A 2D problem embedded in 3D with a second direction in which nothing happens: QP against
    SOCP.
    """
    flat = reduce(scenes.flat_punch(2, elements=5))
    k = flat.contacts
    place = np.arange(3 * k).reshape(k, 3)
    Q, q = np.eye(3 * k) * np.mean(np.diag(flat.Q)), np.zeros((k, 3))
    rows = place[:, :2].ravel()
    Q[np.ix_(rows, rows)] = flat.Q
    q[:, :2] = flat.q
    V = np.zeros((3 * k, 1))
    V[rows] = flat.V
    solid = InterfaceProblem(Q, q, flat.mu, V, flat.s)
    a, b = (
        solve(flat, tol=1e-10, method="alternating"),
        solve(solid, tol=1e-10, method="alternating"),
    )
    assert a.solved and b.solved
    assert np.allclose(b.reactions[:, :2], a.reactions, atol=1e-8) and np.allclose(
        b.reactions[:, 2], 0, atol=1e-9
    )


def test_no_friction():
    problem = reduce(scenes.flat_punch(2, elements=5, mu=0.0))
    solution = solve(problem, tol=1e-12, method="alternating")
    assert solution.solved and solution.iterations == 1
    assert not np.any(solution.reactions[:, 1])


def test_bilateral_contact():
    problem = reduce(scenes.flat_punch(2, elements=5, bilateral=True))
    solution = solve(problem, tol=1e-10, method="alternating")
    assert solution.solved
    assert np.allclose(
        problem.displacements(solution.reactions, solution.multipliers)[:, 0], 0, atol=1e-8
    )


def test_bilateral_contact_holds_against_pulling():
    base = reduce(scenes.flat_punch(2, elements=5, bilateral=True, mu=0.2))
    pulled = InterfaceProblem(base.Q, base.q, Bilateral(base.mu), base.V, -base.s)
    solution = solve(pulled, tol=1e-10, method="alternating")
    assert solution.solved and solution.reactions[:, 0].sum() == pytest.approx(-100)


def test_dragged_plate_without_friction_is_refused():
    problem = InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.0, np.eye(2), np.array([-1.0, 0.5]))
    with pytest.raises(InputError, match="needs friction"):
        solve(problem, method="alternating")


@pytest.mark.parametrize("relaxation", [0.0, 1.5, np.nan])
def test_bad_relaxation(relaxation):
    with pytest.raises(InputError, match="relaxation"):
        Alternating(relaxation=relaxation)


def test_order_of_the_nodes_does_not_matter(cube):
    order = np.random.default_rng(0).permutation(cube.contacts)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    mixed = InterfaceProblem(
        cube.Q[np.ix_(rows, rows)], cube.q[order], cube.mu[order], cube.V[rows], cube.s
    )
    a, b = (
        solve(cube, tol=1e-10, method="alternating"),
        solve(mixed, tol=1e-10, method="alternating"),
    )
    assert np.allclose(a.reactions[order], b.reactions, atol=1e-7)


def test_direction_of_the_tangents_does_not_matter(cube):
    """Rotate the tangential basis at every node by its own angle."""
    angle = np.random.default_rng(1).uniform(0, 2 * np.pi, cube.contacts)
    c, s = np.cos(angle), np.sin(angle)
    R = np.zeros((cube.contacts, 3, 3))
    R[:, 0, 0], R[:, 1, 1], R[:, 1, 2], R[:, 2, 1], R[:, 2, 2] = 1, c, s, -s, c
    T = np.zeros((3 * cube.contacts, 3 * cube.contacts))
    for i, block in enumerate(R):
        T[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    turned = InterfaceProblem(
        T @ cube.Q @ T.T, np.einsum("kab,kb->ka", R, cube.q), cube.mu, T @ cube.V, cube.s
    )
    a, b = (
        solve(cube, tol=1e-11, method="alternating"),
        solve(turned, tol=1e-11, method="alternating"),
    )
    assert a.solved and b.solved
    # Where a symmetry plane holds a component, its force moves nothing and is undetermined: compare
    # displacements.
    moved = turned.Q @ (np.einsum("kab,kb->ka", R, a.reactions) - b.reactions).ravel()
    assert np.abs(moved).max() < 1e-8 * np.abs(turned.Q @ b.reactions.ravel()).max()
    assert np.allclose(a.reactions[:, 0], b.reactions[:, 0], atol=1e-8)
    assert natural_map_residual(turned, np.einsum("kab,kb->ka", R, a.reactions)) < 1e-8
