"""Everything that solves from products with Q alone."""

from dataclasses import replace

import numpy as np
import pytest

from contactopt import (
    InputError,
    InterfaceProblem,
    natural_map_residual,
    reduce,
    reduce_bodies,
    run,
    scenes,
    solve,
)
from contactopt.bodies.assembled import Work
from contactopt.coupling.costs import AGAIN, estimates
from contactopt.linear.operators import InterfaceOperator, block
from contactopt.methods.kernels.alart_curnier import coulomb_equations
from contactopt.methods.kernels.krylov import Krylov, model_of
from contactopt.methods.kernels.linearised import Linearised
from contactopt.methods.kernels.semismooth import Evaluated, Factored
from contactopt.methods.kernels.sparse_blocks import block_matrix
from contactopt.methods.kernels.subproblems import KrylovSubproblem
from contactopt.methods.newton import Newton
from contactopt.methods.preconditioners import degrees
from contactopt.problem import dimensionless
from contactopt.scenes import make_scene
from contactopt.solving.solve_scene import Options
from contactopt.solving.zone import solve_zone
from tests.stacks import layered

SMALL = {"punch-2d": 16, "sphere": 12, "punch-3d": 4}


def forms(name, **changes):
    scene = make_scene(name, **{"elements": SMALL[name]} | changes)
    return reduce(scene, Q="explicit"), reduce(scene, Q="implicit")


@pytest.mark.parametrize("name", SMALL)
def test_both_forms_are_the_same_operator_with_the_same_blocks(name):
    explicit, implicit = forms(name)
    Q, operator = explicit.Q, implicit.Q
    assert isinstance(Q, np.ndarray) and isinstance(operator, InterfaceOperator)
    tolerance = 1e-11 * np.abs(Q).max()
    n, dim = len(Q), explicit.dim
    assert np.abs(operator @ np.eye(n) - Q).max() < tolerance
    assert np.abs(operator.to_dense() - Q).max() < tolerance
    active = np.flatnonzero(np.random.default_rng(0).random(n) < 0.4)
    for unknowns in (
        np.arange(0, n, dim),
        np.setdiff1d(np.arange(n), np.arange(0, n, dim)),
        active,
    ):
        part = block(operator, unknowns)
        assert (
            np.abs(part @ np.eye(len(unknowns)) - Q[np.ix_(unknowns, unknowns)]).max() < tolerance
        )
        assert np.abs(part.to_dense() - Q[np.ix_(unknowns, unknowns)]).max() < tolerance
    normal, tangential = np.arange(0, n, dim), np.arange(1, n, dim)
    coupling = (operator @ np.eye(n)[:, tangential])[normal]
    assert np.abs(coupling - Q[np.ix_(normal, tangential)]).max() < tolerance
    for mine, other in (
        (explicit.q, implicit.q),
        (explicit.V, implicit.V),
        (explicit.s, implicit.s),
    ):
        assert np.allclose(mine, other, rtol=1e-11, atol=1e-12 * np.abs(other).max())


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("method", ["auto", "newton"])
def test_answers_do_not_depend_on_the_form(name, method):
    explicit, implicit = forms(name, mu=0.3)
    a, b = solve(explicit, method, tol=1e-11), solve(implicit, method, tol=1e-11)
    assert a.solved and b.solved
    assert natural_map_residual(explicit, b.reactions, b.multipliers) < 1e-10
    assert np.allclose(a.reactions, b.reactions, atol=1e-8 * np.abs(a.reactions).max())
    assert a.products == 0 < b.products <= 90
    counts = [entry["products"] for entry in b.history]
    assert counts == sorted(counts) and counts[-1] == b.products


@pytest.mark.parametrize("preconditioner", ["p21", "p22", "neumann", "none"])
def test_every_preconditioner_leads_to_the_same_answer(preconditioner):
    explicit, implicit = forms("punch-2d", mu=0.3, elements=8)
    reference = solve(explicit, tol=1e-11).reactions
    for method, settings in (("newton", {}), ("alternating", {"normal": "pcg"})):
        solution = solve(implicit, method, tol=1e-8, preconditioner=preconditioner, **settings)
        assert solution.solved
        assert np.allclose(solution.reactions, reference, atol=1e-5 * np.abs(reference).max())


@pytest.mark.parametrize("symmetric", [True, False])
def test_a_krylov_step_is_the_dense_step(symmetric):
    """Random D with open, sticking, slipping contacts and everything between; two multipliers."""
    random = np.random.default_rng(3)
    k, d, p = 12, 3, 2
    B = random.normal(size=(k * d, k * d))
    Q, V = B @ B.T / (k * d) + np.eye(k * d), random.normal(size=(k * d, p))
    problem = InterfaceProblem(Q, random.normal(size=(k, d)), 0.5, V, random.normal(size=p))
    equations = coulomb_equations(problem)
    R = random.normal(size=(k, d, d))
    basis = np.linalg.qr(R)[0]
    D = basis @ (random.random((k, d, 1)) * basis.transpose(0, 2, 1))
    D = (D + D.transpose(0, 2, 1)) / 2 if symmetric else D + 0.1 * R
    D[:3], D[3:6] = 0.0, np.eye(d)
    error, balance = random.normal(size=(k, d)), random.normal(size=p)
    at = Evaluated((error, balance), 1.0, error, balance, D)
    expected = Factored(block_matrix(Q, d))(equations, at, ridge=0.0)
    for name in (None, "none"):
        got = Krylov(model_of(problem, name))(equations, at, 1e-12)
        for a, b in zip(got, expected):
            assert np.allclose(a, b, atol=1e-8)


def test_a_step_is_as_accurate_as_asked_beside_open_contacts():
    """What open contacts do to the others is no measure: Newton's steps went in circles by it."""
    random = np.random.default_rng(1)
    k, d = 40, 3
    B = random.normal(size=(k * d, k * d))
    Q = B @ B.T / (k * d) + np.eye(k * d) + 100 / k  # as of a soft body: all move together
    V = np.zeros((k * d, 1))
    V[1::d] = 1.0
    problem = InterfaceProblem(Q, random.normal(size=(k, d)), 0.3, V, np.ones(1))
    equations = coulomb_equations(problem)
    D = np.tile(np.diag([1.0, 0.6, 0.3]) + 0.3 * np.eye(d, k=-1), (k, 1, 1))
    D[: k // 2] = 0.0
    error = np.where(np.arange(k)[:, None] < k // 2, 1.0, 1e-2) * random.random((k, d))
    at = Evaluated((error, np.zeros(1)), 1.0, error, np.zeros(1), D)
    for rtol in (1e-1, 1e-2, 1e-4):
        dr, multipliers = Krylov(model_of(problem, "none"))(equations, at, rtol)
        rows = Linearised(equations, D).rows(dr.ravel(), Q @ dr.ravel() + V @ multipliers)
        left = np.hypot(np.linalg.norm(rows - error.ravel()), np.linalg.norm(V.T @ dr.ravel()))
        assert left <= 1.01 * rtol * np.linalg.norm(error)


@pytest.mark.parametrize("bilateral", [False, True])
def test_subproblems_meet_their_conditions(bilateral):
    problem, _ = dimensionless(forms("punch-3d", mu=0.2, bilateral=bilateral)[1])
    P, all_ = model_of(problem), np.ones(1, dtype=bool)
    r, lam = KrylovSubproblem(problem, P, all_, True).solve(np.zeros(problem.q.shape), np.zeros(1))
    u = problem.displacements(r, lam)
    assert np.abs(problem.V.T @ r.ravel() + problem.s).max() < 1e-8
    assert np.abs(u[:, 0] if bilateral else np.minimum(u[:, 0], r[:, 0])).max() < 1e-7
    r, _ = KrylovSubproblem(problem, P, ~all_, False).solve(r, lam)
    bound, size = problem.mu * np.abs(r[:, 0]), np.linalg.norm(r[:, 1:], axis=1)
    u = problem.displacements(r, lam)[:, 1:]
    assert np.all(size <= bound * (1 + 1e-9) + 1e-9)
    sticks = size < 0.999 * bound
    assert sticks.any() and not sticks.all() and np.abs(u[sticks]).max() < 1e-7
    slips = ~sticks & (np.linalg.norm(u, axis=1) > 1e-6)
    turned = u[slips] / np.linalg.norm(u[slips], axis=1)[:, None] + r[slips, 1:] / size[slips, None]
    assert slips.any() and np.abs(turned).max() < 1e-5


def test_penalty_takes_products_too():
    explicit, implicit = forms("punch-2d")
    a, b = (solve(problem, "penalty", factor=1e7) for problem in (explicit, implicit))
    assert b.products > 0
    assert np.allclose(a.reactions, b.reactions, atol=1e-5 * np.abs(a.reactions).max())


def test_auto_falls_back_on_the_entries_of_Q():
    """Strong friction, where Newton's method needs the rest of the chain."""
    explicit, _ = forms("punch-2d", mu=5.0)
    wrapped = InterfaceOperator(lambda X, accuracy: explicit.Q @ X, np.diag(explicit.Q).copy())
    problem = InterfaceProblem(
        wrapped,
        explicit.q,
        explicit.mu,
        explicit.V,
        explicit.s,
        explicit.areas,
        explicit.coordinates,
    )
    assert solve(problem).solved
    # methods without products get the entries
    assert solve(problem, "nsgs", max_iterations=3).iterations == 3


def test_auto_gives_up_a_start_that_leads_nowhere(monkeypatch):
    problem = reduce(scenes.flat_punch(2, elements=16, mu=0.3), Q="implicit")
    cold, steps = solve(problem), Newton.with_residuals
    bad = replace(cold, reactions=np.ones_like(cold.reactions))

    def lost(self, problem, start):
        if start is None:
            return steps(self, problem, start)
        return ((start, 1.0) for _ in range(100))

    monkeypatch.setattr(Newton, "with_residuals", lost)
    solution = solve(problem, start=bad)
    assert solution.solved and solution.iterations == cold.iterations + 2


def cheapest(works, unknowns, dim, **changed):
    asked = {"solvers": ("superlu", "multigrid"), "Q": "auto", "once": True} | changed
    costs = estimates(works, unknowns, dim, **asked)
    return min(costs, key=costs.get)


def test_the_way_is_chosen_by_cost():
    small = Work(40_000, 200, (1e5, 5e6), (2e5, 1e7))
    large = Work(4_000_000, 900, (3e7, 3e10), (6e7, 9e10))
    assert cheapest([small] * 2, 200, 2) == ("dense", "superlu")
    assert cheapest([large] * 2, 900, 3) == ("coupled", "multigrid")
    assert cheapest([small] * 2, 9000, 2)[0] != "dense"
    assert cheapest([small] * 2, 200, 2, Q="implicit")[0] != "dense"
    assert cheapest([large] * 2, 900, 3, Q="explicit") == ("dense", "superlu")
    assert cheapest([small] * 2, 200, 2, solvers=("multigrid",)) == ("coupled", "multigrid")
    assert not estimates([small] * 2, 200, 2, ("another",), "auto", True)
    once, again = (estimates([large], 900, 3, ("superlu", "multigrid"), "auto", x) for x in (1, 0))
    rises = {way: again[way] / once[way] for way in once}  # factors serve again, V-cycles do not
    assert rises.pop(("coupled", "multigrid")) == AGAIN and set(rises.values()) == {1.0}


def test_a_bad_form_of_q_is_refused():
    with pytest.raises(InputError, match="choose from auto, explicit, implicit"):
        reduce(scenes.flat_punch(2, elements=4), Q="dense")


def test_products_start_from_a_coarse_mesh_if_there_is_one():
    scene = scenes.flat_punch(2, elements=64)
    explicit, nested = (
        solve_zone(scene, options=Options(Q=form)).solution for form in ("explicit", "implicit")
    )
    assert nested.solved and "coarse" in nested.seconds and "coarse" not in explicit.seconds
    np.testing.assert_allclose(
        nested.reactions, explicit.reactions, atol=1e-6 * np.abs(explicit.reactions).max()
    )

    def fixed(part):
        return replace(part, mesh=part.build_mesh(64, None))

    given = replace(scene, upper=fixed(scene.upper), lower=fixed(scene.lower))
    alone = solve_zone(given, options=Options(Q="implicit")).solution
    assert given.given and not scene.given
    assert alone.solved and "coarse" not in alone.seconds  # a coarser mesh would be the same


def test_iterative_bodies_are_solved_with_their_contacts_from_cold(tmp_path):
    direct, iterative = (
        run("punch-3d", elements=8, solver=solver) for solver in ("superlu", "multigrid")
    )
    assert iterative.solution.solved and "coarse" not in iterative.solution.seconds
    assert iterative.solution.products == 0 and iterative.solution.history[-1]["cycles"] > 0
    assert iterative.summary["q"] == "implicit" and direct.summary["q"] == "explicit"
    assert np.allclose(iterative.solution.reactions, direct.solution.reactions, atol=1e-6 * 100)


@pytest.mark.parametrize("dim", [2, 3])
def test_loaded_reduction_equals_a_new_one(dim):
    first = reduce_bodies(scenes.flat_punch(dim, elements=4))
    other = scenes.flat_punch(dim, elements=4, force=250.0, mu=0.2)
    again, anew = first.loaded(other).problem, reduce(other)
    for a, b in ((again.q, anew.q), (again.s, anew.s), (again.V, anew.V), (again.mu, anew.mu)):
        assert np.allclose(a, b, atol=1e-11 * max(1.0, np.abs(b).max()))
    with pytest.raises(InputError, match="hold other unknowns than before"):
        first.loaded(replace(other, upper=replace(other.upper, supports=())))


def test_preconditioner_and_explicit_Q_exclude_each_other():
    with pytest.raises(InputError, match="drop one of them"):
        run("punch-2d", Q="explicit", preconditioner="p21")


@pytest.mark.parametrize(
    ("dim", "elements", "count", "options"),
    [
        (2, 16, 8, {"Q": "implicit", "solver": "superlu"}),
        (3, 4, 4, {"Q": "implicit", "solver": "superlu"}),
        (2, 16, 4, {"solver": "multigrid"}),
    ],
)
def test_thin_tied_layers_are_solved_from_products_with_q(dim, elements, count, options):
    """Layers tied to each other are the whole body."""
    scene = scenes.flat_punch(dim, elements=elements)
    problem = reduce(layered(scene, count), **options)
    assert problem.Q.diagonal.min() >= 0.0  # signs of one pair say nothing of another
    pieces = solve(problem, "newton", tol=1e-8, max_iterations=12)
    whole = solve(reduce(scene, Q="explicit"), "newton", tol=1e-11)
    assert pieces.solved
    error = np.abs(pieces.reactions[problem.pairs[0].contacts] - whole.reactions).max()
    assert error < 1e-6 * np.abs(whole.reactions).max()


def test_smooth_motions_grow_with_the_length_of_a_pair_over_its_distance_to_the_next():
    thick, thin = (
        reduce(layered(scenes.flat_punch(2, elements=8, foundation_height=height), 2), Q="explicit")
        for height in (160.0, 10.0)
    )
    assert degrees(reduce(scenes.flat_punch(2, elements=8))) == [1] == degrees(thick)[:1]
    assert degrees(thin)[1] > degrees(thick)[1]
