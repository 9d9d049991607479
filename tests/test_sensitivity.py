"""Derivatives of solutions by the data of the interface problem."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

import contactopt
from contactopt import (
    InputError,
    InterfaceProblem,
    Solution,
    Status,
    natural_map_residual,
    scenes,
    solve,
)
from contactopt.coupling.reduction import reduce_bodies
from contactopt.derivatives import factors
from contactopt.problem.laws.associated import Associated
from contactopt.problem.laws.bilateral import Bilateral
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.laws.frictionless import Frictionless
from contactopt.problem.laws.mixed import Mixed
from contactopt.problem.laws.orthotropic import Orthotropic
from contactopt.problem.laws.tresca import Tresca

LAWS = {
    "coulomb": Coulomb,
    "tresca": Tresca,
    "associated": Associated,
    "bilateral": Bilateral,
    "frictionless": None,
    "orthotropic": lambda mu: Orthotropic(mu, 0.5 * mu, np.linspace(0, 3, len(mu))),
}
STEP = 1e-6


def law_of(kind, numbers):
    return Frictionless(0 * numbers) if kind == "frictionless" else LAWS[kind](numbers)


def random_problem(seed, dim, plate=True, unsymmetric=False, kind="coulomb", contacts=8):
    """Q is positive definite, with an unsymmetric part if wanted; a plate presses all contacts."""
    rng = np.random.default_rng(seed)
    n = contacts * dim
    A, B = rng.normal(size=(2, n, n))
    Q = A @ A.T / n + 0.3 * np.eye(n) + unsymmetric * 0.15 * (B - B.T) / np.sqrt(n)
    V, s = np.zeros((n, int(plate))), -0.8 * contacts * np.ones(int(plate))
    V[::dim] = 1.0
    law = law_of(kind, rng.uniform(0.1, 0.5, contacts))
    return InterfaceProblem(Q, 0.5 * rng.normal(size=(contacts, dim)), law, V, s)


def random_change(problem, seed):
    rng = np.random.default_rng(seed)
    rough = float(problem.law.rough.any())
    return {
        "q": rng.normal(size=problem.q.shape),
        "mu": 0.2 * rough * rng.normal(size=problem.contacts),
        "s": rng.normal(size=problem.s.shape),
        "V": 0.3 * rng.normal(size=problem.V.shape),
        "Q": 0.1 * rng.normal(size=(problem.q.size, problem.q.size)),
    }


def moved(problem, change, t):
    return replace(
        problem,
        q=problem.q + t * change["q"],
        law=problem.law.shifted(t * change["mu"]),
        s=problem.s + t * change["s"],
        V=problem.V + t * change["V"],
        Q=problem.Q + t * change["Q"],
    )


def difference(problem, change, start):
    """Central differences of reactions and multipliers."""
    ends = [
        solve(moved(problem, change, t), "newton", tol=1e-14, start=start, max_iterations=20)
        for t in (STEP, -STEP)
    ]
    assert all(end.residual < 1e-12 for end in ends)
    return [
        (getattr(ends[0], name) - getattr(ends[1], name)) / (2 * STEP)
        for name in ("reactions", "multipliers")
    ]


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("unsymmetric", [False, True])
def test_forward_is_what_central_differences_say(kind, dim, unsymmetric):
    for seed in range(3):
        problem = random_problem(seed, dim, seed % 2 == 0, unsymmetric, kind)
        solution = solve(problem, tol=1e-12)
        sensitivity = contactopt.sensitivity(problem, solution)
        assert sensitivity.differentiable
        change = random_change(problem, seed + 100)
        found = sensitivity.forward(**change)
        by_r, by_multipliers = difference(problem, change, solution)
        size = np.abs(by_r).max()
        assert np.abs(found.reactions - by_r).max() < 1e-6 * size
        assert np.abs(found.multipliers - by_multipliers).max(initial=0.0) < 1e-6 * max(
            size, np.abs(by_multipliers).max(initial=0.0)
        )


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
def test_adjoint_is_the_transpose_of_forward(kind, dim):
    problem = random_problem(1, dim, unsymmetric=True, kind=kind)
    sensitivity = contactopt.sensitivity(problem, solve(problem, tol=1e-12))
    change, rng = random_change(problem, 7), np.random.default_rng(8)
    out = sensitivity.forward(**change)
    for name, part in (
        ("reactions", out.reactions),
        ("multipliers", out.multipliers),
        ("displacements", out.displacements),
    ):
        weight = rng.normal(size=part.shape)
        dual = sensitivity.adjoint(**{name: weight})
        one = float(np.sum(weight * part))
        parts = [np.sum(getattr(dual, key) * change[key]) for key in ("q", "mu", "s", "V")]
        two = float(sum(parts)) + dual.along_Q(change["Q"])
        assert abs(one - two) < 1e-10 * (abs(one) + sum(abs(p) for p in parts))
        assert np.allclose(dual.along_Q(change["Q"]), np.sum(dual.Q * change["Q"]))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("unsymmetric", [False, True])
def test_factors_of_sticking_components_give_what_lu_of_all_gives(dim, unsymmetric, monkeypatch):
    made, states = [], set()
    for most in (0, 10**9):  # unknowns up to which the system is factorised whole
        monkeypatch.setattr(factors, "WHOLE", most)
        for seed in range(6):
            problem = random_problem(seed, dim, unsymmetric=unsymmetric, contacts=12)
            ours = contactopt.sensitivity(problem, solve(problem, tol=1e-12))
            change, weight = random_change(problem, seed), np.ones(problem.q.shape)
            dual = ours.adjoint(reactions=weight, displacements=weight)
            made.append([ours.forward(**change).reactions, dual.q, dual.mu, dual.s])
            states.update(np.any(np.eye(dim) != ours.tangent.D, axis=(1, 2)).tolist())
    assert states == {False, True}
    for one, other in zip(made[:6], made[6:]):
        for a, b in zip(one, other):
            assert np.abs(a - b).max(initial=0.0) < 1e-10 * max(1.0, np.abs(a).max(initial=0.0))


@pytest.mark.parametrize("dim", [2, 3])
def test_factors_that_newton_has_made_give_what_other_factors_give(dim):
    problem = reduce_bodies(scenes.flat_punch(dim, elements=20 // dim), Q="explicit").problem
    solution = solve(problem, "newton", tol=1e-12)
    ours = contactopt.sensitivity(problem, solution)
    theirs = contactopt.sensitivity(replace(problem), solution)
    assert ours.tangent.other is not None
    assert theirs.tangent.other is None  # it is another problem, for which nothing is known
    change, weight = random_change(problem, 1), random_change(problem, 2)["q"]
    found = []
    for one in (ours, theirs):
        moved, dual = one.forward(**change), one.adjoint(reactions=weight)
        found.append([moved.reactions, moved.multipliers, moved.displacements])
        found[-1] += [dual.q, dual.mu, dual.s]
    for a, b in zip(*found):
        assert np.abs(a - b).max() <= 1e-10 * np.abs(b).max()


def test_several_laws_in_one_problem():
    problem = random_problem(3, 2)
    members = (np.array([0, 2, 5]), np.array([1, 3, 4, 6, 7]))
    problem = replace(
        problem, law=Mixed((Coulomb(np.full(3, 0.3)), Tresca(np.full(5, 0.1))), members)
    )
    solution = solve(problem, tol=1e-12)
    change = random_change(problem, 5)
    found = contactopt.sensitivity(problem, solution).forward(**change)
    by_r, _ = difference(problem, change, solution)
    assert np.abs(found.reactions - by_r).max() < 1e-6 * np.abs(by_r).max()


@pytest.mark.parametrize(
    ("scene", "settings"),
    [
        (lambda: scenes.flat_punch(2, elements=8), {"Q": "implicit"}),
        (lambda: scenes.flat_punch(2, elements=16), {"Q": "implicit", "solver": "multigrid"}),
        (lambda: scenes.make_scene("stack"), {}),
    ],
    ids=["krylov", "coupled", "sparse"],
)
def test_every_form_of_the_operator_gives_the_derivatives_of_the_dense_one(scene, settings):
    problem = reduce_bodies(scene(), **settings).problem
    if not settings:
        problem = replace(problem, Q=sp.csr_array(problem.explicit().Q))
    full = problem.explicit()
    solution = solve(full, tol=1e-12)
    ours, dense = contactopt.sensitivity(problem, solution), contactopt.sensitivity(full, solution)
    rng = np.random.default_rng(0)
    change = {
        "q": rng.normal(size=problem.q.shape),
        "s": rng.normal(size=problem.s.shape),
        "mu": 0.5,
    }
    weight = rng.normal(size=problem.q.shape)
    for one, two in (
        (ours.forward(**change).reactions, dense.forward(**change).reactions),
        (ours.forward(**change).multipliers, dense.forward(**change).multipliers),
        (ours.adjoint(displacements=weight).q, dense.adjoint(displacements=weight).q),
        (ours.adjoint(reactions=weight).s, dense.adjoint(reactions=weight).s),
    ):
        assert np.abs(one - two).max() < 1e-7 * np.abs(two).max()


def at_kinks(kind, dim, seed):
    """A problem and its solution: contacts 0 to 2 lie on kinks, 3 sticks, 4 slips, 5 is open."""
    rng = np.random.default_rng(seed)
    k = 6
    A = rng.normal(size=(k * dim, k * dim))
    Q = A @ A.T / (k * dim) + 0.5 * np.eye(k * dim)
    b = rng.uniform(0.2, 0.4, k)
    e = rng.normal(size=(k, dim - 1))
    e /= np.linalg.norm(e, axis=1)[:, None]
    r, u = np.zeros((2, k, dim))
    u[0, 1:], u[5, 1:], u[5, 0] = 0.7 * e[0], 0.3 * e[5], 1.0
    r[[1, 3, 4], 0] = 1.0, 1.5, 1.2
    r[1, 1:], r[3, 1:], r[4, 1:] = b[1] * e[1], 0.4 * b[3] * e[3], -1.2 * b[4] * e[4]
    u[4, 1:] = 0.8 * e[4]
    if kind == "associated":
        u[0, 0], u[4, 0] = 0.7 * b[0], 0.8 * b[4]
    if kind == "tresca":
        r[0, 1:], r[4, 1:], r[5, 1:], r[2, 1:] = (
            -b[0] * e[0],
            -b[4] * e[4],
            -b[5] * e[5],
            0.3 * b[2] * e[2],
        )
    if kind == "bilateral":
        u[5, 0], r[5, 0], r[5, 1:] = 0.0, 0.8, -0.8 * b[5] * e[5]
    if kind == "frictionless":
        r[:, 1:], u[1:4, 1:] = 0.0, e[1:4]
    if kind == "orthotropic":  # of larger coefficient b: from the variables of Coulomb's law
        S = law_of(kind, b).stretch(dim)
        r[:, 1:] = np.einsum("kab,kb->ka", S, r[:, 1:])
        u[:, 1:] = np.linalg.solve(S, u[:, 1:, None])[:, :, 0]
    problem = InterfaceProblem(Q, u - (Q @ r.ravel()).reshape(r.shape), law_of(kind, b))
    residual = natural_map_residual(problem, r, np.zeros(0))
    assert residual < 1e-12
    return problem, Solution(r, np.zeros(0), Status.SOLVED, residual, 0, "exact")


@pytest.mark.parametrize("kind", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
def test_one_sided_derivatives_at_kinks_are_what_one_sided_differences_say(kind, dim):
    for seed in range(3):
        problem, solution = at_kinks(kind, dim, seed)
        sensitivity = contactopt.sensitivity(problem, solution)
        assert [weak.contact for weak in sensitivity.weak] == (
            [0, 2] if kind == "frictionless" else [0, 1, 2]
        )
        assert not sensitivity.differentiable and "no gradient" in sensitivity.sentence
        rng, h = np.random.default_rng(seed + 50), 1e-7
        change = {
            "q": rng.normal(size=problem.q.shape),
            "mu": 0.3 * (kind != "frictionless") * rng.normal(size=6),
        }
        there = replace(
            problem, q=problem.q + h * change["q"], law=problem.law.shifted(h * change["mu"])
        )
        end = solve(there, tol=1e-13, start=solution)
        assert end.residual < 1e-12
        wanted = (end.reactions - solution.reactions) / h
        assert (
            np.abs(sensitivity.forward(**change).reactions - wanted).max()
            < 1e-5 * np.abs(wanted).max()
        )


def test_at_a_kink_the_two_sides_differ():
    """One node that just touches: pressed by q_n < 0 it carries force, lifted it does not."""
    problem = InterfaceProblem(np.eye(2), [[0.0, 0.5]], 0.3)
    solution = Solution(np.zeros((1, 2)), np.zeros(0), Status.SOLVED, 0.0, 0, "exact")
    sensitivity = contactopt.sensitivity(problem, solution)
    assert [weak.edge for weak in sensitivity.weak] == ["open / closed"]
    assert np.allclose(sensitivity.forward(q=np.array([[-1.0, 0.0]])).reactions, [[1.0, -0.3]])
    assert np.allclose(sensitivity.forward(q=np.array([[1.0, 0.0]])).reactions, 0.0)


def test_at_the_apex_the_derivative_is_a_contact_problem_of_its_own():
    """Without force all scales look the same: the derivative along d is the solution for q = d."""
    Q = np.array([[1.0, 0.4], [0.4, 1.2]])
    nothing = InterfaceProblem(Q, [[0.0, 0.0]], 0.5)
    apex = contactopt.sensitivity(
        nothing, Solution(np.zeros((1, 2)), np.zeros(0), Status.SOLVED, 0.0, 0, "exact")
    )
    for d in ([[-1.0, 0.9]], [[-1.0, -2.0]], [[-2.0, -1.1]], [[1.0, 0.3]]):
        found = apex.forward(q=np.array(d)).reactions
        assert np.allclose(found, solve(InterfaceProblem(Q, d, 0.5), tol=1e-12).reactions)


def test_units_do_not_matter():
    problem = random_problem(4, 3)
    solution = solve(problem, tol=1e-12)
    force, length = 1e5, 1e-3
    other = InterfaceProblem(
        problem.Q * length / force, problem.q * length, problem.law, problem.V, problem.s * force
    )
    scaled = replace(
        solution, reactions=solution.reactions * force, multipliers=solution.multipliers * length
    )
    weight = np.random.default_rng(1).normal(size=problem.q.shape)
    one = contactopt.sensitivity(problem, solution).adjoint(reactions=weight)
    two = contactopt.sensitivity(other, scaled).adjoint(reactions=weight)
    assert np.allclose(two.q * length / force, one.q) and np.allclose(two.mu / force, one.mu)
    assert np.allclose(two.s, one.s)


def test_bad_input_is_refused_in_one_sentence():
    problem = random_problem(0, 2)
    solution = solve(problem, tol=1e-12)
    with pytest.raises(InputError, match="only a certified solution has a derivative"):
        contactopt.sensitivity(problem, solve(problem, "newton", max_iterations=1, tol=1e-14))
    with pytest.raises(InputError, match="only a certified solution"):
        contactopt.sensitivity(replace(problem, q=problem.q + 1.0), solution)
    with pytest.raises(InputError, match="q must have the shape"):
        contactopt.sensitivity(problem, solution).forward(q=np.zeros(3))
    with pytest.raises(InputError, match="needs an InterfaceProblem"):
        contactopt.sensitivity(solution, problem)
    twice = np.kron(np.ones((2, 2)), np.eye(2))  # two contacts that share one force
    rigid = InterfaceProblem(twice, [[-1.0, 0.0]] * 2, 0.3)
    shared = Solution(np.array([[0.5, 0.0]] * 2), np.zeros(0), Status.SOLVED, 0.0, 0, "exact")
    with pytest.raises(InputError, match="not unique"):
        contactopt.sensitivity(rigid, shared).forward(q=1e-3)
