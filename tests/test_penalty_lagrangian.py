import numpy as np
import pytest

from contactopt import InputError, InterfaceProblem, solve
from contactopt.methods.augmented_lagrangian import AugmentedLagrangian
from contactopt.methods.lagrangian import Lagrangian
from contactopt.methods.penalty import Penalty
from contactopt.problem import dimensionless, natural_map_residual

EXACT = {
    "lagrangian": Lagrangian(),
    "augmented": AugmentedLagrangian(),
    "uzawa": AugmentedLagrangian(explicit=True),
}


def test_penetration_is_force_over_stiffness():
    """(1 + 1 / factor) r = 1, penetration r / factor."""
    problem = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.3)
    for factor in (10.0, 1e3):
        r = solve(problem, Penalty(factor)).reactions
        assert r[0, 0] == pytest.approx(1 / (1 + 1 / factor), rel=1e-9)
        assert problem.displacements(r, np.zeros(0))[0, 0] == pytest.approx(
            -r[0, 0] / factor, rel=1e-8
        )


@pytest.mark.parametrize("scene", ["punch", "cube"])
def test_ten_times_the_factor_is_a_tenth_of_the_error(scene, request):
    problem = request.getfixturevalue(scene)
    exact = solve(problem, tol=1e-12).reactions
    answers = [solve(problem, Penalty(factor), tol=1e-13) for factor in (1e3, 1e4, 1e5, 1e6)]
    residuals = [a.residual for a in answers]
    errors = [np.linalg.norm(a.reactions - exact) for a in answers]
    for values in (residuals, errors):
        slopes = np.diff(np.log10(values))
        assert np.allclose(slopes, -1, atol=0.05)
    assert all(a.status.label == "settled" for a in answers)
    assert solve(problem, Penalty(), tol=1e-5).solved  # the default factor


def test_regularised_friction_slips_in_proportion_before_the_bound(punch):
    factor = 50.0
    solution = solve(punch, Penalty(1e7, tangential_factor=factor))
    scaled, scales = dimensionless(punch)
    r, lam = scales.to_dimensionless(solution.reactions, solution.multipliers)
    u = scaled.displacements(r, lam)
    inside = np.abs(r[:, 1]) < 0.99 * punch.mu * r[:, 0]
    assert inside.any() and np.abs(u[inside, 1]).max() > 1e-4
    assert np.allclose(u[inside, 1], -r[inside, 1] / factor, atol=1e-7)


def test_penalty_helps_where_forces_are_not_unique():
    """Two nodes at one place share the load equally; without penalty any share is a solution."""
    Q = np.kron(np.ones((2, 2)), np.eye(2))
    r = solve(InterfaceProblem(Q, [[-1.0, 0.0]] * 2, 0.2), Penalty(1e4)).reactions
    assert np.allclose(r[:, 0], 0.5, atol=1e-4)


@pytest.mark.parametrize("scene", ["punch", "cube"])
def test_uzawa_finds_the_solution_of_the_default_method(scene, request):
    problem = request.getfixturevalue(scene)
    exact = solve(problem, tol=1e-12)
    solution = solve(problem, EXACT["uzawa"], tol=1e-9, max_iterations=3000)
    assert solution.solved
    assert np.allclose(solution.reactions, exact.reactions, atol=1e-6 * exact.reactions.max())
    assert np.allclose(solution.multipliers, exact.multipliers, rtol=1e-6)


@pytest.mark.parametrize("name", EXACT)
def test_without_a_plate_and_with_some_nodes_without_friction(name, cube):
    scaled = dimensionless(cube)[0]
    lam = solve(scaled, tol=1e-12).multipliers
    q = scaled.q + (scaled.V @ lam).reshape(scaled.q.shape)
    pressed = InterfaceProblem(scaled.Q, q, np.where(np.arange(scaled.contacts) % 3, 0.4, 0.0))
    solution = solve(pressed, EXACT[name], max_iterations=3000)
    assert solution.solved and not solution.reactions[::3, 1:].any()


def test_the_error_of_multipliers_falls_by_one_plus_rho_times_the_eigenvalue():
    """Q = I: the error of the sticking force falls by 1 + rho in every step."""
    problem = InterfaceProblem(np.eye(2), [[-1.0, 0.2]], 0.5)
    for rho in (1.0, 4.0):
        residuals = [h["residual"] for h in solve(problem, AugmentedLagrangian(rho)).history]
        ratios = np.array(residuals[3:6]) / residuals[2:5]
        assert np.allclose(ratios, 1 / (1 + rho), rtol=0.1)


@pytest.mark.parametrize(
    "wrong", [lambda: Penalty(0.0), lambda: Penalty(1e6, -1.0), lambda: AugmentedLagrangian(np.nan)]
)
def test_settings_without_sense(wrong):
    with pytest.raises(InputError):
        wrong()


def test_answers_do_not_depend_on_units(punch):
    units = InterfaceProblem(punch.Q * 1e-6, punch.q * 1e-3, punch.mu, punch.V, punch.s * 1e3)
    for method in (*EXACT.values(), Penalty(1e5)):
        a, b = (solve(p, method, max_iterations=3000) for p in (punch, units))
        assert np.allclose(b.reactions / 1e3, a.reactions, atol=1e-8 * np.abs(a.reactions).max())
        assert natural_map_residual(units, b.reactions, b.multipliers) == pytest.approx(
            a.residual, rel=1e-2
        )
