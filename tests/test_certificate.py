"""What "solved" promises, checked contact by contact, and the problems that fooled certificates."""

from itertools import count

import numpy as np
import pytest
from conftest import MATERIAL, block

from contactopt import (
    InterfaceProblem,
    Part,
    Rigid,
    Scene,
    Status,
    Support,
    natural_map_residual,
    reduce,
    solve,
)
from contactopt.benchmark.families.packings import packing
from contactopt.problem import infeasibility

KERNEL = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(2))  # two contacts that squeeze the same body
NOT_SOLVABLE = {
    "no compliance": InterfaceProblem(np.zeros((2, 2)), [[-1.0, 0.0]], 0.5),
    "squeezed from both sides": InterfaceProblem(KERNEL, [[-1.0, 0.0], [-1.0, 0.0]], 0.3),
    "squeezed, 3D": InterfaceProblem(
        np.kron(KERNEL[::2, ::2], np.eye(3)), [[-1.0, 0, 0], [-1.0, 0.2, 0]], 0.3
    ),
}
METHODS = ("auto", "newton", "proximal", "nsgs", "lagrangian")


def in_units(p, force, length):
    return InterfaceProblem(p.Q * (length / force), p.q * length, p.mu, p.V, p.s * force)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "force,length", [(1, 1), (1e12, 1), (1, 1e12), (1e-12, 1e-6), (1e-6, 1e12)]
)
@pytest.mark.parametrize("name", NOT_SOLVABLE)
def test_a_problem_without_a_solution_ends_infeasible_in_all_units(name, force, length, method):
    problem = in_units(NOT_SOLVABLE[name], force, length)
    solution = solve(problem, method, max_iterations=100, time_limit=1)
    assert solution.status is Status.INFEASIBLE and "no solution" in solution.message
    ray = solution.proof
    e = np.zeros(problem.q.shape)
    e[:, 0] = ray.weights
    assert np.all(ray.weights >= 0)
    assert np.all(np.abs(problem.Q.T @ e.ravel()) <= 1e-12 * np.abs(problem.Q).max())
    assert np.sum(problem.q * e) < 0


@pytest.mark.parametrize("force", [0.0, 1.0, 1e10, 1e28])
@pytest.mark.parametrize("name", NOT_SOLVABLE)
def test_no_forces_are_certified_where_there_is_no_solution(name, force):
    problem = NOT_SOLVABLE[name]
    r = np.zeros(problem.q.shape)
    r[:, 0] = force
    assert natural_map_residual(problem, r) > 0.1


def test_forces_that_move_nothing_do_not_hide_a_penetration():
    problem = InterfaceProblem(1e-9 * KERNEL, 1e-6 * np.array([[-1.0, 0], [2.0, 0]]), 0.3)
    assert natural_map_residual(problem, [[5e3, 0], [5e3, 0]]) > 0.1
    assert natural_map_residual(problem, [[1000.0, 0], [0, 0]]) < 1e-14
    assert solve(problem).reactions[:, 0] == pytest.approx([1000.0, 0.0], rel=1e-6)


def test_a_contact_much_stiffer_than_the_others_is_not_overlooked():
    problem = InterfaceProblem(np.diag([1.0, 1.0, 1e-9, 1e-9]), [[-1.0, 0], [-1e-9, 0]], 0.3)
    assert natural_map_residual(problem, [[1.0, 0], [0.5, 0]]) > 1e-6
    assert natural_map_residual(problem, [[1.0, 0], [1.0, 0]]) < 1e-15


@pytest.mark.parametrize("method", ["auto", "nsgs", "newton"])
@pytest.mark.parametrize("gap", [1e4, 1e8, 1e12])
def test_distant_open_contacts_change_nothing(gap, method):
    rng = np.random.default_rng(3)
    A = rng.normal(size=(12, 12))
    Q, q = A @ A.T / 12 + 0.2 * np.eye(12), rng.normal(size=(6, 2)) - 0.3
    near = np.arange(8)
    alone = solve(InterfaceProblem(Q[np.ix_(near, near)], q[:4], 0.2), tol=1e-12)
    q[4:, 0] = gap
    solution = solve(InterfaceProblem(Q, q, 0.2), method, max_iterations=2000)
    assert solution.solved
    assert np.allclose(
        solution.reactions[:4], alone.reactions, atol=1e-6 * np.abs(alone.reactions).max()
    )
    assert np.all(solution.reactions[4:] == 0)


def test_a_support_that_pushes_a_contact_into_a_rigid_floor_is_infeasible():
    body = block("plane-strain", 0, 1)
    supports = (Support("bottom", {"x": 0.0, "y": -0.1}),)
    part = Part("block", body, MATERIAL, supports, contact="bottom")
    problem = reduce(Scene("held and pushed", part, Rigid("floor"), 0.3))
    solution = solve(problem)
    assert solution.status is Status.INFEASIBLE, solution.message


def test_a_plate_pushed_sideways_beyond_friction_is_infeasible_and_below_it_is_not():
    V = np.tile(np.eye(2), (2, 1))
    for push, feasible in ((0.5, False), (0.2, True)):
        problem = InterfaceProblem(np.eye(4), np.zeros((2, 2)), 0.3, V, [-1.0, -push])
        assert (infeasibility(problem) is None) == feasible
        solution = solve(problem)
        assert solution.solved if feasible else "balance" in solution.message


def test_hard_problems_with_a_solution_are_never_called_infeasible():
    for seed in range(5):
        assert infeasibility(packing(2, 30, seed, points=2)) is None
        assert infeasibility(packing(3, 27, seed, mu=1.0)) is None


def rigid_table(gaps, mu=0.3, push=(-100.0, 20.0)):
    """A rigid table on three legs in the plane, with gaps below them; no compliance anywhere."""
    places = np.array([-1.0, 0.2, 1.0])
    V = np.zeros((3, 2, 3))
    V[:, 0, 0], V[:, 1, 1], V[:, 0, 2] = 1.0, 1.0, places
    q = np.column_stack([gaps, np.zeros(3)])
    return InterfaceProblem(
        np.zeros((6, 6)), q, mu, V.reshape(6, 3), np.array([*push, 0.1 * push[0]])
    )


@pytest.mark.parametrize("gaps", [(0.0, 0.0, 0.0), (0.5, 0.7, 0.4), (1e-3, 2e-3, 5e-3)])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_rigid_bodies_without_any_compliance(gaps, unit):
    """Statics alone: the forces balance the load, and legs that bear force stand on the floor."""
    problem = rigid_table(unit * np.array(gaps))
    solution = solve(problem)
    assert solution.solved
    u = problem.displacements(solution.reactions, solution.multipliers) / unit
    assert np.allclose(problem.V.T @ solution.reactions.ravel(), -problem.s)
    assert np.all(u[:, 0] > -1e-9) and np.all(np.abs(u[solution.reactions[:, 0] > 1e-6, 0]) < 1e-9)
    assert (
        str(solve(rigid_table(unit * np.array(gaps), push=(-100.0, 40.0))).status) == "infeasible"
    )


class _Endless:
    """A method that works for ever and never comes closer."""

    def iterate(self, problem, start=None):
        for step in count(1):
            yield np.full(problem.q.shape, float(step)), np.zeros(len(problem.s))


def test_a_proof_that_there_is_no_solution_ends_a_method_that_would_go_on():
    solution = solve(NOT_SOLVABLE["squeezed from both sides"], _Endless())
    assert solution.status is Status.INFEASIBLE and solution.proof is not None
    assert solution.iterations == 5  # the first after DOUBT, of four components


@pytest.mark.parametrize("far", [1.0, 1e6, 1e12, 1e17])
def test_a_body_that_flies_away_balances_nothing(far):
    """The friction of three contacts cannot hold the plate; far from them it has no forces."""
    V = np.tile(np.eye(2), (3, 1))
    problem = InterfaceProblem(np.eye(6), np.zeros((3, 2)), mu=0.2, V=V, s=[-5.0, 1.2])
    for force in (0.0, 1e-9):
        reactions = np.tile([force, 0.0], (3, 1))
        assert natural_map_residual(problem, reactions, [far, 0.0]) > 0.9
