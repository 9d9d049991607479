import numpy as np
import pytest
from conftest import one_contact

from contactopt import InputError, InterfaceProblem, natural_map_residual, solve
from contactopt.errors import BackendError
from contactopt.methods.backends.direct import CoulombSOCP
from contactopt.methods.cone import AcaryCadoux, Relaxation, cone_program
from contactopt.problem import dimensionless
from contactopt.problem.cones import coulomb_cone, coulomb_cone_derivative
from contactopt.problem.laws.bilateral import Bilateral


def test_derivative_on_the_axis_without_friction_does_not_divide_by_zero():
    _, D = coulomb_cone_derivative(np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]), np.zeros(2))
    assert np.array_equal(D, [np.diag([1.0, 0, 0]), np.zeros((3, 3))])


def mixed(dim: int) -> InterfaceProblem:
    """Plate, contacts without friction and with much, in one problem."""
    k, rng = 5, np.random.default_rng(2)
    A = rng.normal(size=(k * dim, k * dim))
    V = np.kron(np.ones((k, 1)), np.eye(dim)[:, :1])
    mu = np.array([0.0, 0.2, 0.4, 0.7, 0.0])
    return InterfaceProblem(
        A @ A.T / (k * dim) + np.eye(k * dim), rng.normal(size=(k, dim)), mu, V, [-8.0]
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_both_bridges_agree(dim):
    problem = dimensionless(mixed(dim))[0]
    s = np.linspace(0, 0.5, problem.contacts)
    c = problem.q + np.outer(problem.mu * s, np.eye(dim)[0])
    raw = CoulombSOCP.using(problem.Q, problem.mu, problem.V, problem.s).solve(c.ravel())
    a, b = (
        cone_program(problem, bridge, "clarabel")(problem.mu * s)
        for bridge in ("clarabel", "cvxpy")
    )
    assert np.allclose(a[0], b[0], atol=1e-10) and np.allclose(a[1], b[1], atol=1e-10)
    assert np.allclose(raw[0], a[0].ravel(), atol=1e-5) and np.allclose(raw[1], a[1], atol=1e-5)


@pytest.mark.parametrize("dim", [2, 3])
def test_direct_bridge_keeps_nothing_of_the_last_linear_term(dim):
    problem = dimensionless(mixed(dim))[0]
    socp = CoulombSOCP.using(problem.Q, problem.mu, problem.V, problem.s)
    first = socp.solve(problem.q.ravel())
    other = socp.solve(-problem.q.ravel())
    assert np.abs(other[0] - first[0]).max() > 0.1
    assert np.allclose(socp.solve(problem.q.ravel())[0], first[0], atol=1e-10)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_relaxation_solves_associated_friction(dim):
    """Pressed contacts slip open by mu |u_t|, which is not Coulomb's law."""
    problem = mixed(dim)
    solution = solve(problem, Relaxation())
    assert solution.iterations == 1 and solution.status.label == "settled"
    r, u = solution.reactions, problem.displacements(solution.reactions, solution.multipliers)
    assert np.allclose(r, coulomb_cone(r - u, problem.mu), atol=1e-9)
    slip = np.linalg.norm(u[:, 1:], axis=1)
    dilated = (r[:, 0] > 1e-3) & (problem.mu > 0) & (slip > 1e-3)
    assert dilated.any() and np.allclose(u[dilated, 0], (problem.mu * slip)[dilated], atol=1e-9)
    assert natural_map_residual(problem, r, solution.multipliers) == solution.residual > 1e-3


@pytest.mark.parametrize("dim", [2, 3])
def test_acary_cadoux_takes_the_opening_back(dim):
    problem = mixed(dim)
    solution, best = solve(problem, AcaryCadoux(), tol=1e-10), solve(problem, "auto", tol=1e-12)
    assert solution.solved and solution.iterations > 1
    assert np.allclose(solution.reactions, best.reactions, atol=1e-8)
    u = problem.displacements(solution.reactions, solution.multipliers)
    assert np.abs(u[solution.reactions[:, 0] > 1e-3, 0]).max() < 1e-8


def test_one_of_three_solutions_is_found():
    """f = (.8, 1), mu = 1 has the solutions stick, slip and open; the relaxation of it sticks."""
    solution = solve(one_contact((0.8, 1.0), 1.0), AcaryCadoux(), tol=1e-12)
    assert solution.solved and solution.reactions[0] == pytest.approx([1.0, 0.8])


def test_other_conic_backends_through_cvxpy():
    problem = mixed(3)
    a, b = solve(problem, AcaryCadoux()), solve(problem, AcaryCadoux("cvxpy", "scs"))
    assert b.solved and np.allclose(a.reactions, b.reactions, atol=1e-6)


@pytest.mark.parametrize("method", [AcaryCadoux(), Relaxation(), AcaryCadoux("cvxpy")])
def test_contact_without_separation_names_methods_that_handle_it(method):
    problem = InterfaceProblem(np.eye(2), np.ones((1, 2)), Bilateral(0.3))
    with pytest.raises(
        InputError,
        match="does not solve the law Bilateral; these do: auto, newton, proximal, tresca",
    ):
        solve(problem, method)


@pytest.mark.parametrize(
    "settings,words", [(("mosek",), "bridge"), (("clarabel", "scs"), "needs bridge='cvxpy'")]
)
def test_settings_are_checked(settings, words):
    with pytest.raises(InputError, match=words):
        AcaryCadoux(*settings)


@pytest.mark.parametrize("bridge", ["clarabel", "cvxpy"])
def test_a_program_without_an_answer_is_a_status(bridge):
    """A rigid contact pulled into the obstacle by a given displacement has no finite force."""
    problem = InterfaceProblem(np.zeros((2, 2)), [[-1.0, 0.0]], 0.3)
    solution = solve(problem, AcaryCadoux(bridge))
    assert solution.status.label == "infeasible" and solution.proof is not None


def test_indefinite_compliance_is_refused():
    with pytest.raises(BackendError, match="semidefinite"):
        CoulombSOCP.using(np.diag([1.0, -1.0]), np.ones(1), np.zeros((2, 0)), np.zeros(0))
