"""Newton's method on forces and displacements at once gives the same answers."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from skfem import MeshHex

from contactopt import (
    InputError,
    Material,
    Part,
    Scene,
    Support,
    Traction,
    natural_map_residual,
    reduce,
    reduce_bodies,
    scenes,
    solve,
)
from contactopt.bodies.solvers.multigrid import MultigridSolver, conjugate_gradients
from contactopt.coupling import costs
from contactopt.linear.deadline import enough
from contactopt.linear.flexible_gmres import flexible_gmres
from contactopt.linear.operators import InterfaceOperator
from contactopt.linear.stacked import Stacked, norm
from contactopt.methods.kernels.alart_curnier import coulomb_equations
from contactopt.methods.kernels.coupled_newton import Coupled, State, in_equilibrium
from contactopt.methods.kernels.krylov import model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.problem.certificate import Moved
from contactopt.problem.laws import LAWS
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.scenes import make_scene
from contactopt.solving import progress
from contactopt.solving.solve_scene import Options, solve_scene

ON_BODIES = partial(Options, "auto", "multigrid", "newton")
SMALL = {"punch-2d": 16, "punch-3d": 4, "sphere": 8, "cattaneo-3d": 3, "cylinder-2d": 8}


def both(scene, elements):
    return reduce(scene, elements, Q="explicit"), reduce(scene, elements, solver="multigrid")


@pytest.mark.parametrize("name", SMALL)
def test_the_answer_is_that_of_the_dense_method(name):
    dense, coupled = both(make_scene(name), SMALL[name])
    expected, found = solve(dense, "newton", tol=1e-10), solve(coupled, "newton", tol=1e-9)
    assert found.solved and coupled.Q.coupled.cycles > 0
    assert (
        np.abs(found.reactions - expected.reactions).max() < 1e-6 * np.abs(expected.reactions).max()
    )
    assert natural_map_residual(dense, found.reactions, found.multipliers) < 1e-8


@pytest.mark.parametrize("law", LAWS)
def test_it_solves_every_law(law):
    dense, coupled = both(
        replace(scenes.flat_punch(3), law=law, mu=0.02 if law == "tresca" else 0.3), 4
    )
    expected, found = solve(dense, "newton", tol=1e-9), solve(coupled, "newton", tol=1e-9)
    assert found.solved
    assert (
        np.abs(found.reactions - expected.reactions).max() < 1e-6 * np.abs(expected.reactions).max()
    )


@pytest.mark.parametrize("scene, elements", [(scenes.flat_punch(3), 4), (make_scene("stack"), 4)])
def test_displacements_come_with_the_forces(scene, elements, monkeypatch):
    """For plates, supports and bodies that float, as solves with the bodies give them."""
    reduction = reduce_bodies(scene, elements, solver="multigrid")
    solution = solve(reduction.problem, "newton", tol=1e-9)
    assert solution.solved
    anew = reduction.displaced(replace(solution, displacements=None))
    monkeypatch.setattr(MultigridSolver, "solve", lambda *_: pytest.fail("a body was solved again"))
    for found, expected in zip(reduction.displaced(solution), anew):
        assert np.abs(found - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("mu", [0.1, 0.3, 0.5])
def test_friction_costs_no_more_cycles_than_four_products(mu):
    reduction = reduce_bodies(scenes.flat_punch(3), 8, solver="multigrid")
    r = np.random.default_rng(0).normal(size=reduction.problem.q.size)
    product = [
        conjugate_gradients(
            body.solver.A, body.solver.cycle, (B.T @ r)[body.body.free], 1e-8
        ).cycles
        for body, B in zip(reduction.bodies, reduction.maps)
    ]
    form = reduction.problem.Q.coupled
    before = form.cycles
    assert solve(replace(reduction.problem, law=Coulomb(mu)), "newton").solved
    assert form.cycles - before <= 4 * max(product)


def test_the_form_is_the_operator_before_condensation():
    problem = reduce(scenes.flat_punch(3), 4, solver="multigrid")
    form, r = problem.Q.coupled, np.random.default_rng(0).normal(size=problem.q.size)
    X = in_equilibrium(form, r, 1e-11)
    assert norm(form.unbalanced(X, r)) < 1e-8 * np.linalg.norm(r)
    Qr = problem.Q @ r
    assert np.allclose(form.moved(X, r), Qr, atol=1e-8 * np.abs(Qr).max())
    added = np.arange(len(r)) * 1e-3
    scaled = form.scaled(3.0, added)
    X = in_equilibrium(scaled, r, 1e-11)
    assert np.allclose(scaled.moved(X, r), 3 * Qr + added * r, atol=1e-8 * np.abs(Qr).max())
    before = form.cycles
    scaled.approximate(form.pulled(r))
    assert form.cycles == scaled.cycles == before + 1  # scaled forms count together


def test_products_with_forces_whose_displacements_are_known_begin_there():
    problem = reduce(scenes.flat_punch(3), 4, solver="multigrid")
    form, r = problem.Q.coupled, np.random.default_rng(0).normal(size=problem.q.size)
    Q = problem.Q.knowing(r, in_equilibrium(form, r, 1e-6))
    full, before = problem.Q @ r, form.cycles
    size = np.linalg.norm(full)
    for own, error, cycles in ((Q, 1e-9, 9), (Q.loosened(1e-5), 1e-5, 1)):
        before = form.cycles
        assert np.linalg.norm(own @ r - full) < error * size and form.cycles - before <= cycles
    assert np.linalg.norm(Q @ (2 * r) - 2 * full) < 1e-9 * size  # other forces are unknown


@pytest.mark.parametrize("tol", [1e-8, 1e-3])
def test_a_solve_that_stops_in_time_is_what_it_says(tol):
    """By entries of Q; and what is read off it is as accurate as it is."""
    scene = make_scene("cattaneo-3d")
    dense, solved = reduce(scene, 4, Q="explicit"), solve_scene(scene, 4, None, ON_BODIES(tol))
    found, problem = solved.solution, solved.reduction.problem
    assert found.solved and found.residual <= tol
    assert natural_map_residual(dense, found.reactions, found.multipliers) <= 1.1 * tol
    before = problem.Q.coupled.cycles
    u = problem.displacements(found.reactions, found.multipliers)
    assert problem.Q.coupled.cycles - before <= 4
    exact = dense.displacements(found.reactions, found.multipliers)
    assert np.abs(u - exact).max() < tol * np.abs(exact).max()


def test_the_last_step_of_a_solve_that_stops_in_time_is_short():
    """It takes fewer V-cycles than the same step of a solve that goes on, from the same point."""
    scene = make_scene("cattaneo-3d")
    rows = [solve_scene(scene, 6, None, ON_BODIES(tol)).solution.history for tol in (1e-8, 1e-5)]
    spent = [np.diff([row["cycles"] for row in own]) for own in rows]
    last = len(rows[1]) - 1
    assert rows[0][last - 1]["residual"] == rows[1][last - 1]["residual"] > 1e-5
    assert spent[1][last - 1] < spent[0][last - 1]
    assert enough() == 0.0


def test_the_certificate_counts_what_is_missing_to_equilibrium():
    problem = reduce(scenes.flat_punch(3), 4, Q="explicit")
    solution = solve(problem, "newton", tol=1e-10)
    r = solution.reactions
    known = Moved(problem.Q @ r.ravel(), 1e-3)
    assert natural_map_residual(problem, r, solution.multipliers, moved=known) == 1e-3
    wrong = Moved(1.1 * problem.Q @ r.ravel(), 0.0)
    assert natural_map_residual(problem, r, solution.multipliers, moved=wrong) > 1e-3


def test_the_stated_accuracy_is_the_error_of_the_displacements():
    """Against displacements in equilibrium; a V-cycle is close to the inverse, not the inverse."""
    problem = reduce(scenes.flat_punch(3), 4, solver="multigrid")
    form, r = problem.Q.coupled, np.random.default_rng(0).normal(size=problem.q.shape)
    exact = in_equilibrium(form, r, 1e-12)
    for seed, size in enumerate((1e-6, 1e-3, 1e-1)):
        random = np.random.default_rng(seed)
        off = Stacked(tuple(random.normal(size=term.size) for term in form.terms))
        X = exact + size * norm(exact) / norm(off) * off
        judged = Coupled.judged(_bare(form), State(X, r, np.zeros(0)), np.zeros(r.shape))[2]
        error = X - exact
        true = np.sqrt(error.dot(form.stiffness(error)) / X.dot(form.stiffness(X)))
        assert 0.5 * true < judged.accuracy < 1.5 * true
        assert np.linalg.norm(judged.value - problem.Q @ r.ravel()) < np.linalg.norm(
            form.moved(error, 0 * r.ravel())
        )


def _bare(form):
    return Coupled(None, form, None)


def test_it_starts_where_it_is_told():
    problem = reduce(scenes.flat_punch(3), 6, solver="multigrid")
    cold = solve(problem, "newton", tol=1e-9)
    warm = solve(problem, "newton", tol=1e-8, start=cold)
    assert warm.solved and warm.iterations < cold.iterations


def test_bodies_with_factors_have_no_coupled_form():
    problem = reduce(scenes.flat_punch(2), 8, Q="implicit", solver="superlu")
    with pytest.raises(InputError, match="take the solver 'multigrid'"):
        solve(problem, "newton", linear="coupled")


def test_flexible_gmres_bears_a_preconditioner_that_changes():
    random = np.random.default_rng(0)
    A = np.eye(60) + 0.3 * random.normal(size=(60, 60)) / np.sqrt(60)
    b, weights, calls = random.normal(size=60), random.uniform(0.1, 10.0, 60), [0]

    def inverse(x):
        calls[0] += 1
        return x * (1 + 0.3 * np.sin(calls[0] + np.arange(60)))

    for rtol in (1e-1, 1e-4, 1e-9):  # the last takes several runs
        x = flexible_gmres(lambda x: A @ x, inverse, b, weights, rtol)
        assert np.linalg.norm(weights * (b - A @ x)) <= 1.01 * rtol * np.linalg.norm(weights * b)


def test_long_solves_say_what_they_reached(monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    said: list[str] = []
    solved = solve_scene(
        scenes.flat_punch(3), 4, options=Options(solver="multigrid", note=said.append)
    )
    steps = [line for line in said if line.startswith("step")]
    assert len(steps) == solved.solution.iterations
    assert "V-cycles" in steps[0] and "GiB" in steps[0] and "s left" in steps[1]
    assert "s left" not in steps[-1]


def test_time_left_goes_on_as_the_last_step():
    assert progress.remaining([(0.0, 1.0), (10.0, 1e-2), (12.0, 1e-4)], 1e-8) == ", about 4 s left"
    assert progress.remaining([(0.0, 1e-3), (1.0, 1e-2)], 1e-8) == ""


def _block(name, low, high, nu, **more):
    """Ten by ten by five bricks of 1 x 1 x `high - low`."""
    flat = np.linspace(0, 1, 11)
    mesh = MeshHex.init_tensor(flat, flat, np.linspace(low, high, 6)).with_boundaries(
        {"low": lambda x: np.isclose(x[2], low), "high": lambda x: np.isclose(x[2], high)}
    )
    return Part(name, mesh, Material(5.0, nu), **more)


def _blocks(thickness, nu):
    pushed = Traction("high", (0.02, 0.0, -0.1))
    upper = _block("upper", 0, thickness, nu, loads=(pushed,), contact="low")
    lower = _block("lower", -thickness, 0, nu, supports=(Support("low"),), contact="high")
    return Scene("two blocks", upper, lower, 0.3, kind="solid")


@pytest.fixture
def coupled_by_a_little(monkeypatch):
    """Prices that make the coupled way a little cheaper than a dense Q, and all others dear."""
    for way in costs.COSTS:
        price = {"coupled": 0.9, "dense": 1.0}.get(way[0], 9.0)
        monkeypatch.setitem(costs.COSTS, way, (price, *[0.0] * (len(costs.COSTS[way]) - 1)))


@pytest.mark.parametrize(("thickness", "nu"), [(0.05, 0.3), (0.5, 0.4999)])
def test_a_coupled_way_that_turns_out_dear_is_left(coupled_by_a_little, thickness, nu):
    """Multigrid takes many V-cycles for flat bricks and for a nearly incompressible material."""
    scene = _blocks(thickness, nu)
    solved = solve_scene(scene)
    solution, notes = solved.solution, " ".join(solved.solution.notes)
    assert solution.solved and not isinstance(solved.reduction.problem.Q, InterfaceOperator)
    assert "more V-cycles of multigrid are needed" in notes and "replaces them" in notes
    assert solution.seconds["given up"] > 0
    expected = solve_scene(scene, options=Options(solver="superlu")).solution
    assert np.array_equal(solution.reactions, expected.reactions)
    again = solve_scene(scene, start=solved)  # which does not try it once more
    assert again.solution.solved and "given up" not in again.solution.seconds


def test_one_way_after_the_other_is_left_until_one_keeps_its_promise(
    coupled_by_a_little, monkeypatch
):
    for way in costs.COSTS:
        if way[0] == "products":
            monkeypatch.setitem(costs.COSTS, way, (0.95, *[0.0] * (len(costs.COSTS[way]) - 1)))
    monkeypatch.setitem(costs.USUAL, "products", 10)
    scene = _blocks(0.05, 0.3)
    solved = solve_scene(scene)
    first, second = solved.solution.notes
    assert "more V-cycles of multigrid are needed" in first and "implicit Q" in first
    assert "more products with Q are needed" in second and "explicit Q" in second
    expected = solve_scene(scene, options=Options(Q="explicit", solver="superlu")).solution
    assert np.array_equal(solved.solution.reactions, expected.reactions)


def test_a_coupled_way_that_keeps_its_promise_is_kept(coupled_by_a_little):
    scene = _blocks(0.5, 0.3)
    solved = solve_scene(scene)
    assert solved.solution.solved and not solved.solution.notes
    assert solved.reduction.problem.Q.coupled is not None


def test_who_asked_for_multigrid_gets_it(coupled_by_a_little):
    scene = _blocks(0.5, 0.49)
    asked = solve_scene(scene, options=Options(solver="multigrid"))
    assert asked.reduction.problem.Q.coupled is not None and asked.turned is None
    problem = reduce(scene)  # nobody is there who could turn to another way
    assert problem.Q.coupled is not None and solve(problem).solved


def test_a_step_with_every_contact_open_leaves_the_motions_alone():
    """Nothing resists them then, and GMRES with an operator that is zero returns no numbers."""
    problem = reduce_bodies(make_scene("punch-2d"), 4).problem.explicit()
    equations = coulomb_equations(problem)
    linearised = Linearised(equations, np.zeros((problem.contacts, problem.dim, problem.dim)))
    error, balance = np.ones(problem.q.size), np.ones(len(problem.s))
    rough = linearised.rough(model_of(problem, None))
    dr, motions = linearised.solve(lambda x: problem.Q @ x, rough, error, balance, 1e-3)
    assert np.array_equal(dr, error) and np.array_equal(motions, 0 * problem.s)
    assert len(problem.s) > 0
