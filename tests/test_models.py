import cvxpy as cp
import numpy as np
import pytest
from conftest import one_contact
from matplotlib.figure import Figure

from contactopt import InputError, InterfaceProblem, models
from contactopt.methods.backends import CONIC
from contactopt.methods.backends.conic import Conic
from contactopt.problem.laws import Bilateral, Coulomb, Orthotropic

PROGRAMS = (
    "normal", "penalised", "bilateral", "tangential", "tresca", "associated", "acary_cadoux",
)  # fmt: skip


@pytest.fixture(params=["plane", "solid", "no plate"])
def problem(request) -> InterfaceProblem:
    """Elastic contacts with every state: a random well-conditioned compliance, gaps, some contacts
    without friction.
    """
    dim, k = (3 if request.param == "solid" else 2), 6
    rng = np.random.default_rng(3)
    A = rng.normal(size=(k * dim, k * dim))
    Q = A @ A.T / (k * dim) + 0.3 * np.eye(k * dim)
    q = rng.normal(size=(k, dim)) * ([2.5] + [0.7] * (dim - 1))
    mu = np.array([0.0, 0.2, 0.3, 0.5, 0.8, 1.2])
    if request.param == "no plate":
        return InterfaceProblem(Q, q, mu)
    V = np.zeros((k, dim, 1))
    V[:, 0] = 1.0
    return InterfaceProblem(Q, q, mu, V.reshape(-1, 1), [-6.0])


def build(name: str, problem: InterfaceProblem):
    program = getattr(models, name)(problem)
    given = {"g": 0.2, "r_n": 1.0, "approach": -0.4, "s": 0.3}
    for key, parameter in program.parameters.items():
        if key in given:
            parameter.value = np.full(parameter.shape, given[key])
    return program


def solved(program):
    program.problem.solve(solver="CLARABEL", **CONIC["clarabel"].settings)
    assert program.problem.status == cp.OPTIMAL
    return program


def state(problem, r, lam):
    u = problem.displacements(r, lam)
    return u[:, 0], u[:, 1:], np.linalg.norm(r[:, 1:], axis=1)


def friction_opposes(slip, r_t, bound, tol=1e-4):
    """r_t = -bound slip / |slip| wherever there is slip, and within the bound everywhere."""
    size = np.linalg.norm(slip, axis=1)
    assert np.all(np.linalg.norm(r_t, axis=1) <= bound + tol)
    assert np.allclose(r_t * size[:, None], -bound[:, None] * slip, atol=tol)


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_program_is_convex_by_the_rules_and_compiles_once(name, problem):
    program = build(name, problem)
    assert program.problem.is_dcp() and program.problem.is_dcp(dpp=True)


@pytest.mark.parametrize("name", [name for name in PROGRAMS if name != "bilateral"])
def test_multipliers_before_a_solve_are_refused(name, problem):
    with pytest.raises(InputError, match="solve it before"):
        assert build(name, problem).multipliers


def test_normal_program_gives_signorini(problem):
    program = solved(models.normal(problem))
    m, r = program.multipliers, np.zeros(problem.q.shape)
    r[:, 0] = program.variables["r_n"].value
    u_n, _, _ = state(problem, r, m["approach"])
    assert np.allclose(m["gap"], u_n, atol=1e-6)
    assert r.min() > -1e-7 and u_n.min() > -1e-6 and np.abs(r[:, 0] * u_n).max() < 1e-6
    assert (u_n > 1e-3).any() and (r[:, 0] > 1e-3).any()
    assert np.allclose(problem.V.T @ r.ravel() + problem.s, 0, atol=1e-7)


def test_given_tangential_forces_enter_the_normal_program(problem):
    program = models.normal(problem)
    r = 0.3 * np.random.default_rng(0).normal(size=problem.q.shape)
    program.parameters["r_t"].value = r[:, 1:].ravel()
    m = solved(program).multipliers
    r[:, 0] = program.variables["r_n"].value
    assert np.allclose(m["gap"], state(problem, r, m["approach"])[0], atol=1e-6)


def test_displacements_need_a_compliance_that_can_be_inverted():
    with pytest.raises(InputError, match="singular"):
        models.normal(InterfaceProblem(np.diag([0.0, 1.0]), np.ones((1, 2)), 0.1), form="primal")


def test_penalised_contact_is_a_spring_and_becomes_contact(problem):
    exact = solved(models.normal(problem)).variables["r_n"].value
    errors = []
    for stiffness in (1e2, 1e3):
        program = solved(models.penalised(problem, stiffness))
        r = program.variables["r_n"].value
        gap = program.multipliers["gap"]
        assert np.allclose(r, stiffness * np.maximum(-gap, 0), atol=1e-3)
        errors.append(np.abs(r - exact).max())
    assert errors[1] < 0.2 * errors[0] < 0.1


def test_bilateral_program_closes_every_gap(problem):
    program = solved(models.bilateral(problem))
    r = np.zeros(problem.q.shape)
    r[:, 0] = program.variables["r_n"].value
    assert r[:, 0].min() < -1e-3
    assert np.allclose(state(problem, r, program.multipliers["approach"])[0], 0, atol=1e-6)


def tangential_at(problem, facets=None):
    program = models.tangential(problem, facets)
    r_n = np.linspace(0.0, 1.0, problem.contacts)
    lam = np.full(min(1, len(problem.s)), -0.4)
    program.parameters["r_n"].value, program.parameters["g"].value = r_n, problem.mu * r_n
    if len(problem.s):
        program.parameters["approach"].value = lam
    solved(program)
    r_t = program.variables["r_t"].value.reshape(problem.contacts, -1)
    return program, np.concatenate([r_n[:, None], r_t], axis=1), lam


def test_tangential_program_gives_friction_under_given_bounds(problem):
    program, r, lam = tangential_at(problem)
    _, u_t, _ = state(problem, r, lam)
    assert np.allclose(program.multipliers["slip"], u_t, atol=1e-5)
    friction_opposes(u_t, r[:, 1:], problem.mu * r[:, 0])


@pytest.mark.parametrize("problem", ["solid"], indirect=True)
def test_polygons_converge_to_discs_from_inside(problem):
    disc, exact, _ = tangential_at(problem)
    errors, costs = [], []
    for facets in (4, 8, 16, 32):
        program, r, lam = tangential_at(problem, facets)
        assert np.allclose(program.multipliers["slip"], state(problem, r, lam)[1], atol=1e-5)
        errors.append(np.abs(r - exact).max())
        costs.append(program.problem.value - disc.problem.value)
    assert np.all(np.array(costs) > 0)  # inscribed: never a better value than the disc
    # of second order
    assert costs[3] < 1.2 * costs[2] / 4 and errors[3] < errors[1] / 2 < errors[0] / 3
    with pytest.raises(InputError, match="at least 3 facets"):
        models.tangential(problem, 2)


def test_plate_that_is_dragged_belongs_to_the_tangential_program():
    V = np.kron(np.ones((4, 1)), np.eye(2))
    problem = InterfaceProblem(np.diag(np.arange(1.0, 9.0)), np.zeros((4, 2)), 0.5, V, [-4.0, 0.9])
    program, r, lam = tangential_at(problem)
    lam = np.append(lam, program.multipliers["shift"])
    u_t = state(problem, r, lam)[1]
    assert r[:, 1].sum() == pytest.approx(-0.9, abs=1e-7)
    assert np.allclose(program.multipliers["slip"], u_t, atol=1e-5) and np.abs(u_t).max() > 0.1
    friction_opposes(u_t, r[:, 1:], 0.5 * r[:, 0])


@pytest.mark.parametrize("bilateral", [False, True])
def test_tresca_program_gives_both_laws_at_once(problem, bilateral):
    problem = InterfaceProblem(
        problem.Q,
        problem.q,
        (Bilateral if bilateral else Coulomb)(problem.mu),
        problem.V,
        problem.s,
    )
    program = models.tresca(problem)
    g = 0.2 * np.arange(problem.contacts)
    program.parameters["g"].value = g
    m = solved(program).multipliers
    r = program.variables["r"].value.reshape(problem.q.shape)
    u_n, u_t, _ = state(problem, r, m["approach"])
    assert np.allclose(m["gap"], u_n, atol=1e-5) and np.allclose(m["slip"], u_t, atol=1e-5)
    assert np.abs(r[:, 0] * u_n).max() < 1e-5
    assert bilateral == bool(r[:, 0].min() < -1e-2)
    friction_opposes(u_t, r[:, 1:], g)


def test_associated_friction_dilates(problem):
    """Its law: r in the cone, u_n = mu |u_t| where pressed, friction opposite to slip."""
    program = solved(models.associated(problem))
    m, r = program.multipliers, program.variables["r"].value.reshape(problem.q.shape)
    u_n, u_t, _ = state(problem, r, m["approach"])
    assert np.allclose(m["gap"], u_n, atol=1e-5) and np.allclose(m["slip"], u_t, atol=1e-5)
    friction_opposes(u_t, r[:, 1:], problem.mu * r[:, 0])
    opening = problem.mu * np.linalg.norm(u_t, axis=1)
    pressed = r[:, 0] > 1e-3
    assert np.all(u_n > opening - 1e-5) and np.allclose(u_n[pressed], opening[pressed], atol=1e-4)
    assert opening[pressed].max() > 1e-2


def test_acary_cadoux_shifts_the_gap(problem):
    program = models.acary_cadoux(problem)
    assert solved(program).problem.value == pytest.approx(
        solved(models.associated(problem)).problem.value, abs=1e-6
    )
    s = np.linspace(0, 1, problem.contacts)
    program.parameters["s"].value = s
    m, r = solved(program).multipliers, program.variables["r"].value.reshape(problem.q.shape)
    u_n, u_t, _ = state(problem, r, m["approach"])
    assert np.allclose(m["gap"], u_n, atol=1e-5) and np.allclose(m["slip"], u_t, atol=1e-5)
    room = u_n + problem.mu * (s - np.linalg.norm(u_t, axis=1))
    assert room.min() > -1e-5 and np.abs(room * r[:, 0]).max() < 1e-4


def test_cones_of_contact_without_separation_are_refused():
    problem = InterfaceProblem(np.eye(2), np.zeros((1, 2)), Bilateral(0.3))
    for name in ("associated", "acary_cadoux"):
        with pytest.raises(InputError, match="no cone of forces"):
            getattr(models, name)(problem)


def test_conic_bridge_solves_again_with_new_parameters():
    problem = one_contact((0.8, 1.0), 1.0)
    bridge = Conic.using("clarabel", models.tresca(problem), problem.Q)
    friction = [abs(bridge.solve(g=np.array([g]))["r"][1]) for g in (0.1, 0.2)]
    assert friction == pytest.approx([0.1, 0.2], abs=1e-6)


def refined(program, **given):
    """Solved as far as the arithmetic goes: 1e-8 is compared."""
    for name, value in given.items():
        if name in program.parameters:
            parameter = program.parameters[name]
            parameter.value = np.broadcast_to(value, parameter.shape)
    program.problem.solve(
        solver="CLARABEL", tol_gap_abs=1e-13, tol_gap_rel=1e-13, tol_feas=1e-13, max_iter=200
    )
    assert program.problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)
    return program


PAIRS = [(name, None) for name in PROGRAMS] + [
    ("tangential", 7),
    ("tresca", 7),
    ("associated", 7),
    ("acary_cadoux", 7),
]


@pytest.mark.parametrize(("name", "facets"), PAIRS)
def test_primal_and_dual_have_each_others_multipliers(name, facets, problem):
    """The value changes its sign; forces, gaps, slips and approaches are the same to 1e-8."""
    near = 3e-7 if problem.dim == 3 and facets is None else 1e-8
    rng = np.random.default_rng(5)
    k, d = problem.contacts, problem.dim - 1
    given = {
        "g": rng.uniform(0, 0.6, k),
        "s": rng.uniform(0, 0.6, k),
        "r_n": rng.uniform(0, 1, k),
        "r_t": rng.normal(size=k * d) * 0.1,
        "approach": -0.4,
    }
    options = {} if facets is None else {"facets": facets}
    build = getattr(models, name)
    dual = refined(build(problem, **options), **given)
    primal = refined(build(problem, **options, form="primal"), **given)
    assert primal.problem.value == pytest.approx(-dual.problem.value, abs=1e-9)
    force = next(v for key, v in dual.variables.items() if key in ("r", "r_n", "r_t")).value
    assert np.allclose(primal.multipliers["reaction"], force, atol=near, rtol=0)
    assert np.abs(force).max() > 1e-2
    m, gaps = dual.multipliers, primal.variables
    if "u" in gaps and gaps["u"].size == k:
        assert np.allclose(gaps["u"].value, m.get("gap", 0.0), atol=near, rtol=0)
    elif "u" in gaps:
        u = gaps["u"].value.reshape(k, d + 1)
        assert np.allclose(u[:, 0], m["gap"], atol=near, rtol=0)
        assert np.allclose(u[:, 1:], m["slip"], atol=near, rtol=0)
    else:
        assert np.allclose(gaps["u_t"].value.reshape(k, d), m["slip"], atol=near, rtol=0)
    if "lambda" in gaps:
        assert np.allclose(gaps["lambda"].value, m["approach"], atol=near, rtol=0)


def test_orthotropic_friction_has_a_primal_form_too():
    near = 1e-4  # the ellipses are thin, and forces are as good as the root of the gap
    law = Orthotropic([0.2, 0.5], [0.6, 0.5], [0.4, 0.0])
    A = np.random.default_rng(1).normal(size=(6, 6))
    problem = InterfaceProblem(A @ A.T + np.eye(6), [[-1.0, 2, -1], [-2.0, -1, 3]], law)
    for name in ("tresca", "associated"):
        dual, primal = (
            refined(getattr(models, name)(problem, form=form), g=0.2) for form in ("dual", "primal")
        )
        u = primal.variables["u"].value.reshape(2, 3)
        assert np.allclose(
            primal.multipliers["reaction"], dual.variables["r"].value, atol=near, rtol=0
        )
        assert np.allclose(u[:, 1:], dual.multipliers["slip"], atol=near, rtol=0)
        assert np.abs(u[:, 1:]).max() > 1e-2


def test_unknown_form_is_refused():
    for name in PROGRAMS:
        with pytest.raises(InputError, match=r"'dual' .* or 'primal'"):
            getattr(models, name)(one_contact((0.8, 1.0), 1.0), form="mixed")


@pytest.mark.parametrize("form", ["dual", "primal"])
@pytest.mark.parametrize("name", PROGRAMS)
def test_program_shows_its_mathematics(name, form, problem):
    program = getattr(models, name)(problem, form=form)
    assert str(program).startswith("min ") and "subject to" in str(program)
    assert "param" not in str(program.problem) and "var" not in str(program.problem)
    assert repr(program).count(".") == 1 and "not solved yet" in repr(program)
    latex = program._repr_latex_()
    figure = Figure()
    words = latex.replace(r"\displaystyle", "").replace(r"\text", r"\mathrm")
    figure.text(0, 0, words.replace(r"\top", r"\prime"))
    figure.draw_without_rendering()  # raises where the LaTeX is none
