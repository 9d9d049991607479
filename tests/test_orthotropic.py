"""Orthotropic friction against its conditions, cvxpy, Coulomb's law, and a node solved by hand."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
import scipy.sparse as sp

import contactopt
from contactopt import InputError, InterfaceProblem, fclib, models, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.linear.operators import InterfaceOperator
from contactopt.material import Material
from contactopt.problem import isotropic, natural_map_residual
from contactopt.problem.contact_status import contact_status
from contactopt.problem.laws import Coulomb, Orthotropic, Tresca, join
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import HalfSpace, Rigid, Scene
from contactopt.scenes.scene_files import read_scene_file

# beyond what Clarabel promises: it stops where it gets no further, and warns
TIGHT = {"tol_gap_abs": 1e-13, "tol_gap_rel": 1e-13, "tol_feas": 1e-13}


def random_problem(law, k=6, dim=3, seed=0, plate=False):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(k * dim, k * dim))
    q = rng.normal(size=(k, dim))
    q[:, 0] -= 0.5
    V, s = np.zeros((k * dim, int(plate))), -float(k) * np.ones(int(plate))
    V[::dim] = 1.0
    return InterfaceProblem(A @ A.T / (k * dim) + 0.5 * np.eye(k * dim), q, law, V, s)


def random_law(k=6, seed=0):
    rng = np.random.default_rng(seed)
    return Orthotropic(rng.uniform(0.1, 0.5, k), rng.uniform(0.3, 1.0, k), rng.uniform(-2, 4, k))


def matrices(law):
    """M (k, 2, 2) from its definition."""
    for mu_1, mu_2, angle in zip(law.mu_1, law.mu_2, law.angle):
        e = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        yield e @ np.diag([mu_1, mu_2]) @ e.T


@pytest.mark.parametrize("seed", range(4))
def test_forces_dissipate_the_most_of_all_within_the_ellipse(seed):
    problem = random_problem(random_law(seed=seed), seed=seed, plate=seed % 2 == 0)
    solution = solve(problem, tol=1e-12)
    assert solution.solved
    r, u = solution.reactions, problem.displacements(solution.reactions, solution.multipliers)
    slips = 0
    for M, (r_n, *r_t), (u_n, *u_t) in zip(matrices(problem.law), r, u):
        assert min(r_n, u_n) > -1e-10 and abs(r_n * u_n) < 1e-10
        assert np.linalg.norm(np.linalg.solve(M, r_t)) <= r_n + 1e-10
        around = [M @ [np.cos(t), np.sin(t)] * r_n for t in np.linspace(0, 2 * np.pi, 1000)]
        most = max(-np.dot(u_t, t) for t in around)
        assert -np.dot(r_t, u_t) == pytest.approx(most, abs=1e-4 * (1 + most))
        if np.linalg.norm(u_t) > 1e-6 and r_n > 1e-6:
            assert np.allclose(r_t, -r_n * M @ M @ u_t / np.linalg.norm(M @ u_t), atol=1e-9)
            slips += 1
    assert slips > 0 and contact_status(problem, r).slip.sum() == slips


def test_a_node_that_slips_is_solved_by_hand():
    """One node, compliance 1, pressed by r_n = 1; M = diag(0.1, 0.3)."""
    r_t = np.array([0.1, 0.3]) / np.sqrt(2)
    law = Orthotropic(0.1, 0.3)
    problem = InterfaceProblem(np.eye(3), [[-1.0, *(-np.array([6.0, 2.0]) - r_t)]], law)
    solution = solve(problem, tol=1e-13)
    assert np.allclose(solution.reactions, [[1.0, *r_t]], atol=1e-12)
    slip = problem.displacements(solution.reactions, solution.multipliers)[0, 1:]
    assert np.allclose(slip, [-6.0, -2.0], atol=1e-12)
    assert abs(np.cross([*slip, 0], [*r_t, 0])[2]) > 1  # the slip is not along the force


@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")
@pytest.mark.parametrize("method", ["auto", "proximal", "nsgs", "acary_cadoux", "admm", "tresca"])
def test_given_bounds_make_it_a_convex_program(method):
    """r minimises r' Q r / 2 + q' r over ellipses whose size the solution's r_n gives."""
    problem = random_problem(random_law(), plate=True)
    solution = solve(problem, method, tol=2e-12, max_iterations=5000)
    assert solution.solved
    bounds, r = solve(problem, tol=1e-13).reactions[:, 0], cp.Variable((6, 3))
    cone = [r[:, 0] >= 0, problem.V.T @ cp.vec(r, order="C") + problem.s == 0]
    for i, M in enumerate(matrices(problem.law)):
        cone.append(cp.norm(np.linalg.inv(M) @ r[i, 1:]) <= bounds[i])
    flat = cp.vec(r, order="C")
    cost = cp.quad_form(flat, cp.psd_wrap(problem.Q)) / 2 + problem.q.ravel() @ flat
    cp.Problem(cp.Minimize(cost), cone).solve(solver="CLARABEL", **TIGHT)
    assert np.allclose(r.value, solution.reactions, atol=1e-8)


@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")
@pytest.mark.parametrize("name", ["tresca", "acary_cadoux"])
def test_the_blackboard_has_it(name):
    problem = random_problem(random_law(), plate=True)
    solution = solve(problem, tol=1e-12)
    r = solution.reactions
    u = problem.displacements(r, solution.multipliers)
    program, plain = getattr(models, name)(problem), problem.law.plain
    if name == "tresca":
        program.parameters["g"].value = plain.bound(r[:, 0])
    else:
        v = np.stack([M @ u_t for M, u_t in zip(matrices(problem.law), u[:, 1:])])
        program.parameters["s"].value = np.linalg.norm(v, axis=1) / plain.coefficient
    program.problem.solve(solver="CLARABEL", **TIGHT)
    found = program.variables["r"].value.reshape(r.shape)
    assert np.allclose(found, r, atol=1e-8)
    assert natural_map_residual(problem, found, program.multipliers["approach"]) < 1e-6
    for key, part in (("gap", u[:, 0]), ("slip", u[:, 1:])):
        assert np.allclose(program.multipliers[key], part, atol=1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_equal_coefficients_are_coulombs_law(dim):
    law = Orthotropic(0.4, 0.4, np.linspace(0, 3, 6))
    problem = random_problem(law, dim=dim)
    coulomb = replace(problem, law=Coulomb(0.4))
    a, b = solve(problem, tol=1e-12), solve(coulomb, tol=1e-12)
    assert np.allclose(a.reactions, b.reactions, atol=1e-12) and a.iterations == b.iterations
    y = np.random.default_rng(1).normal(size=(6, dim))
    for one, other in zip(problem.law.project(y), coulomb.law.project(y)):
        assert np.allclose(one, other, atol=1e-14)
    r = b.reactions + 0.1
    assert natural_map_residual(problem, r) == pytest.approx(natural_map_residual(coulomb, r))


def test_in_the_plane_it_is_coulombs_law_of_the_first_axis():
    problem = random_problem(Orthotropic(0.2, 0.9), dim=2)
    other = solve(replace(problem, law=0.2), tol=1e-12)
    assert np.allclose(solve(problem, tol=1e-12).reactions, other.reactions, atol=1e-11)


def test_a_turned_frame_turns_the_answer():
    problem, turn = random_problem(random_law()), 0.7
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])  # components in axes turned by `turn`
    T = np.kron(np.eye(6), R)
    law = replace(problem.law, angle=problem.law.angle - turn)
    other = InterfaceProblem(T @ problem.Q @ T.T, problem.q @ R.T, law)
    a, b = solve(problem, tol=1e-13).reactions, solve(other, tol=1e-13).reactions
    assert np.allclose(a @ R.T, b, atol=1e-10)
    # the axes change places
    law = Orthotropic(problem.law.mu_2, problem.law.mu_1, problem.law.angle + np.pi / 2)
    assert np.allclose(solve(replace(problem, law=law), tol=1e-13).reactions, a, atol=1e-10)


@pytest.mark.parametrize("form", ["sparse", "operator"])
def test_all_forms_of_Q_give_the_same_answer(form):
    problem = random_problem(random_law(), plate=True)
    Q = problem.Q
    if form == "sparse":
        other = replace(problem, Q=sp.csr_array(Q))
    else:
        other = replace(problem, Q=InterfaceOperator(lambda X, accuracy: Q @ X, np.diag(Q)))
        X = np.eye(18)
        assert np.allclose(isotropic(other).Q @ X, isotropic(problem).Q)
    a, b = solve(problem, tol=1e-12), solve(other, tol=1e-12)
    assert b.solved and np.allclose(a.reactions, b.reactions, atol=1e-9)


def test_a_start_and_other_laws_beside_it():
    grooves = Orthotropic([0.2, 0.3], [0.6, 0.4], 0.4).spread(2)
    parts = (grooves, [0, 3]), (Coulomb([0.3, 0.5]), [1, 2]), (Tresca([0.2, 0.1]), [4, 5])
    law = join(parts)
    problem = random_problem(law)
    solution = solve(problem, tol=1e-12)
    again = solve(problem, tol=1e-11, start=solution)
    assert solution.solved and again.iterations <= 1
    assert np.allclose(again.reactions, solution.reactions, atol=1e-11)
    S = law.stretch(3)
    assert np.allclose(S[[1, 2, 4, 5]], np.eye(2)) and not np.allclose(S[0], np.eye(2))


def test_a_load_that_only_strong_friction_holds():
    """A body on two nodes, drawn along the axis of mu_1 = 0.1 or of mu_2 = 0.8."""
    V = np.kron(np.ones((2, 1)), np.eye(3))

    def pull(s):
        names, law = [f"body 'a': displacement {c}" for c in "nxy"], Orthotropic(0.1, 0.8)
        return InterfaceProblem(np.eye(6), np.zeros((2, 3)), law, V, s, motions=tuple(names))

    assert solve(pull([-2.0, 0.0, 1.0])).solved
    with pytest.raises(InputError, match="slides off"):
        solve(pull([-2.0, 1.0, 0.0]))


@pytest.mark.parametrize("dim", [2, 3])
def test_derivatives_by_both_coefficients_together(dim):
    problem = random_problem(random_law(), dim=dim, plate=True)
    change = np.random.default_rng(5).normal(size=6)
    found = contactopt.sensitivity(problem, solve(problem, tol=1e-13)).forward(mu=change)
    ends = [
        solve(replace(problem, law=problem.law.shifted(t * change)), tol=1e-14).reactions
        for t in (1e-6, -1e-6)
    ]
    assert np.allclose(found.reactions, (ends[0] - ends[1]) / 2e-6, atol=1e-6)


def punch(law="orthotropic", mu=(0.05, 0.5), direction=(1.0, 0.0, 0.0), turned=False):
    """A rigid ball on an elastic half-space, dragged along x."""
    x = np.stack(2 * [np.linspace(-3, 3, 17)])
    pull = {"x": 0.2} if not turned else {"y": 0.2}
    ball = Rigid("ball", gap=lambda p: (p[0] ** 2 + p[1] ** 2) / 20, force={"z": -3.0} | pull)
    base = HalfSpace("base", Material(5.0, 0.3), x)
    contact = Contact("ball", "base", mu, law, direction=direction)
    return Scene("drag", kind="solid", bodies=(ball, base), contacts=(contact,))


def test_scenes_name_the_direction_in_space():
    reductions = [reduce_bodies(punch(turned=turned)) for turned in (False, True)]
    along, across = (reduction.problem for reduction in reductions)
    angle, frames = along.law.angle[:, None], reductions[0].frames
    e = np.cos(angle) * frames[:, 1] + np.sin(angle) * frames[:, 2]
    assert np.allclose(np.abs(e), [1.0, 0.0, 0.0])
    with pytest.raises(InputError, match="slides off"):  # 0.2 > 0.05 * 3
        solve(along)
    assert solve(across).solved  # 0.2 < 0.5 * 3
    same = solve(contactopt.reduce(punch("coulomb", 0.5, None))).reactions
    mine = solve(contactopt.reduce(punch(mu=0.5, direction=None))).reactions
    assert np.allclose(same, mine, atol=1e-9 * np.abs(same).max())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"direction": None}, "needs the direction"),
        ({"direction": (0.0, 0.0, 1.0)}, "normal to the surface"),
        ({"direction": (0.0, 0.0, 0.0)}, "is zero"),
        ({"direction": (1.0, 0.0)}, "has 2 components"),
        ({"law": "coulomb", "mu": 0.3}, "the same in all directions"),
        ({"mu": (0.1, 0.2, 0.3)}, "two coefficients"),
        ({"mu": (0.1, -0.2)}, "must not be negative"),
        ({"mu": (0.1, 0.0)}, "or both zero"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        contactopt.reduce(punch(**changes))


FILE = """
kind = "solid"
[bodies.block]
block = { x = [0, 2], y = [0, 1], z = [0, 1], elements = [4, 2, 2] }
material = { E = 5.0, nu = 0.3 }
contact = "z-"
plates = [{ boundary = "z+", force = { z = -1, x = 0.1 } }]
supports = [{ boundary = "y-", y = 0 }]
[bodies.floor]
rigid = { normal = { z = 1 } }
[[contacts]]
upper = "block"
lower = "floor"
law = "orthotropic"
mu = [0.2, 0.6]
direction = { x = 1, y = 1 }
"""


def test_scene_files_have_it(tmp_path):
    path = tmp_path / "grooves.toml"
    path.write_text(FILE)
    scene = read_scene_file(path).states[0]
    result = contactopt.run(scene)
    law = result.problem.law
    assert result.solution.solved and np.allclose((law.mu_1, law.mu_2), [[0.2], [0.6]])
    assert scene.contacts[0].friction == "orthotropic, mu = 0.2 and 0.6"
    grooves = result.reduction.frames @ [0.5**0.5, 0.5**0.5, 0]
    along = np.cos(law.angle) * grooves[:, 1] + np.sin(law.angle) * grooves[:, 2]
    assert np.allclose(np.abs(along), 1)
    path.write_text(FILE.replace("[0.2, 0.6]", "[0.2, 0.6, 0.7]"))
    with pytest.raises(InputError, match=r"line 15.*along and across"):
        read_scene_file(path)


def test_what_knows_no_direction_refuses_it(tmp_path):
    problem = random_problem(random_law())
    with pytest.raises(InputError, match="Coulomb"):
        fclib.write(problem, tmp_path / "a.hdf5")
    with pytest.raises(InputError, match="Coulomb"):
        contactopt.diagnose(problem)
