"""Laws of contact and friction: each against its conditions and a program in cvxpy."""

import sys
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import pytest

from contactopt import (
    InputError,
    InterfaceProblem,
    Status,
    diagnose,
    models,
    natural_map_residual,
    reduce,
    scenes,
    solve,
)
from contactopt.methods import METHODS, find_method, solvers_of, solves
from contactopt.problem import dimensionless
from contactopt.problem.cones import cylinder_derivative
from contactopt.problem.laws import (
    LAWS,
    Associated,
    Bilateral,
    Coulomb,
    Frictionless,
    Law,
    Mixed,
    Orthotropic,
    Tied,
    Tresca,
    find_law,
    join,
)
from tests.test_orthotropic import random_problem

ALL = {
    "coulomb": Coulomb(0.4),
    "bilateral": Bilateral(0.4),
    "tresca": Tresca(0.3),
    "associated": Associated(0.4),
    "frictionless": Frictionless(),
    "tied": Tied(),
    "orthotropic": Orthotropic(0.3, 0.6, 0.5),
}


# the largest tangential force under a normal force, by laws with one bound in all directions
BOUND = {
    "coulomb": lambda r_n: 0.4 * abs(r_n),
    "bilateral": lambda r_n: 0.4 * abs(r_n),
    "tresca": lambda r_n: 0.3,
    "frictionless": lambda r_n: 0.0,
}


def violation(name: str, r: np.ndarray, u: np.ndarray, bounds: dict = BOUND) -> float:
    """The largest violation of a law at one contact, from its conditions and not from the library's
    projections.
    """
    r_n, r_t, u_n, u_t = r[0], r[1:], u[0], u[1:]
    slip, force = np.linalg.norm(u_t), np.linalg.norm(r_t)
    if name == "tied":
        return float(np.linalg.norm(u))
    if name == "associated":
        return max(force - 0.4 * r_n, 0.4 * slip - u_n, abs(r @ u))
    normal = abs(u_n) if name == "bilateral" else max(-u_n, -r_n, min(abs(u_n), abs(r_n)))
    if name == "orthotropic":  # M of ALL; the ellipse, in the plane its width, and -r_n |M u_t|
        turn = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]])[:, : len(u_t)]
        radii = np.array([0.3, 0.6])
        if len(u_t) == 1:
            size = force / np.linalg.norm(radii * turn[:, 0])
        else:
            size = np.linalg.norm(turn @ r_t / radii)
        power = -r_n * np.linalg.norm(radii * (turn @ u_t))
        return max(normal, size - r_n, abs(r_t @ u_t - power))
    bound = bounds[name](r_n)
    # |r_t| <= bound, and dissipation r_t' u_t = -bound |u_t|: the force opposes the slip and is at
    # its bound
    return max(normal, force - bound, abs(r_t @ u_t + bound * slip))


def worst(problem: InterfaceProblem, solution, names: list[str], bounds: dict = BOUND) -> float:
    u = problem.displacements(solution.reactions, solution.multipliers)
    return max(violation(*contact, bounds) for contact in zip(names, solution.reactions, u))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", LAWS)
def test_solutions_obey_the_law(name, dim):
    for seed in range(4):
        problem = random_problem(ALL[name], dim=dim, seed=seed)
        for method in ("auto", "newton", "proximal"):
            solution = solve(problem, method, tol=1e-11, max_iterations=200)
            assert solution.solved, (method, seed, solution.message)
            assert worst(problem, solution, [name] * 6) < 1e-8


@pytest.mark.parametrize("name", LAWS)
def test_another_laws_solution_is_no_solution(name):
    """The certificate tells the laws apart."""
    problem = random_problem(ALL[name])
    for other, law in ALL.items():
        residual = natural_map_residual(
            problem, solve(replace(problem, law=law), tol=1e-11).reactions
        )
        assert (residual < 1e-9) == (other == name)


@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("name", LAWS)
def test_every_method_that_says_so_solves_the_law(name, method):
    problem = random_problem(ALL[name], dim=2)
    if not solves(find_method(method), problem.law):
        with pytest.raises(
            InputError, match=f"does not solve the law {type(problem.law).__name__}; these do: auto"
        ):
            solve(problem, method)
        return
    tol = 1e-4 if method == "penalty" else 1e-8
    solution = solve(problem, method, tol=tol, max_iterations=5000)
    if method == "relaxation" and name in ("coulomb", "orthotropic"):
        # it solves associated friction, which slips otherwise
        assert solution.status is Status.SETTLED
        return
    assert solution.solved and worst(problem, solution, [name] * 6) < 100 * tol


@pytest.mark.parametrize("dim", [2, 3])
def test_tresca_is_the_program_in_cvxpy(dim):
    problem = random_problem(Tresca(np.linspace(0.05, 0.6, 6)), dim=dim)
    program = models.tresca(problem)
    program.parameters["g"].value = problem.law.bound(np.zeros(6))
    program.problem.solve(solver="CLARABEL")
    assert np.allclose(
        solve(problem).reactions, program.variables["r"].value.reshape(6, dim), atol=1e-4
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_associated_friction_is_the_program_in_cvxpy(dim):
    problem = random_problem(Associated(np.linspace(0.1, 0.8, 6)), dim=dim)
    program = models.associated(problem)
    program.problem.solve(solver="CLARABEL")
    solution = solve(problem)
    u = problem.displacements(solution.reactions, solution.multipliers)
    assert np.allclose(solution.reactions, program.variables["r"].value.reshape(6, dim), atol=1e-4)
    assert np.allclose(u[:, 0], program.multipliers["gap"], atol=1e-4)  # slip opens the gap
    assert np.max(np.linalg.norm(u[:, 1:], axis=1) * solution.reactions[:, 0]) > 1e-2


@pytest.mark.parametrize("dim", [2, 3])
def test_frictionless_contact_is_coulomb_without_friction(dim):
    problem = reduce(scenes.flat_punch(dim, elements=6 if dim == 2 else 3, mu=0.0))
    answer = solve(replace(problem, law=Frictionless()), tol=1e-12)
    other = solve(problem, tol=1e-12)
    assert answer.solved
    assert np.allclose(answer.reactions, other.reactions, atol=1e-9 * np.abs(other.reactions).max())
    assert not answer.reactions[:, 1:].any()


@pytest.mark.parametrize("name", LAWS)
def test_derivatives_are_difference_quotients(name):
    rng = np.random.default_rng(1)
    y, law = rng.normal(size=(60, 3)), ALL[name].spread(60)
    for act in (law.project, lambda y: law.nearest_derivative(y, np.ones(60))):
        for j, step in enumerate(1e-7 * np.eye(3)):
            quotient = (act(y + step)[0] - act(y - step)[0]) / 2e-7
            assert np.allclose(act(y)[1][:, :, j], quotient, atol=1e-6)
    assert np.allclose(law.nearest(y, np.ones(60)), law.nearest_derivative(y, np.ones(60))[0])


@pytest.mark.parametrize("name", [name for name, law in ALL.items() if law.convex])
def test_convex_laws_project_on_a_fixed_convex_set(name):
    """The projection is the gradient of a convex function."""
    rng = np.random.default_rng(2)
    x, y, law = rng.normal(size=(200, 3)), rng.normal(size=(200, 3)), ALL[name].spread(200)
    (a, D), b = law.project(x), law.project(y)[0]
    assert np.all(np.sum((a - b) * (x - y - a + b), axis=1) > -1e-12)
    assert np.allclose(D, D.transpose(0, 2, 1))


@pytest.mark.parametrize("name", LAWS)
def test_units_change_nothing(name):
    """Forces in units of 1e-6 and lengths in units of 1e4 give the same forces."""
    problem = random_problem(ALL[name])
    force, length = 1e6, 1e-4
    other = InterfaceProblem(
        problem.Q * length / force, problem.q * length, problem.law.scaled(1 / force)
    )
    a, b = solve(problem, tol=1e-11), solve(other, tol=1e-11)
    assert a.iterations == b.iterations
    assert np.allclose(a.reactions * force, b.reactions, rtol=1e-9, atol=1e-9 * force)
    assert np.allclose(dimensionless(problem)[0].q, dimensionless(other)[0].q)


def test_friction_coefficient_per_contact():
    mu = [0.0, 0.1, 0.5, 0.2, 2.0, 0.3]
    bounds = {one: lambda r_n, one=one: one * abs(r_n) for one in mu}
    problem = random_problem(mu)
    solution = solve(problem, tol=1e-11)
    assert solution.solved and worst(problem, solution, mu, bounds) < 1e-8
    assert not np.allclose(
        solution.reactions, solve(replace(problem, law=0.3)).reactions, atol=1e-2
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_every_contact_may_have_its_own_law(dim):
    names = ["coulomb", "bilateral", "tresca", "associated", "frictionless", "coulomb"]
    law = join([(ALL[name].spread(1), [i]) for i, name in enumerate(names)])
    assert isinstance(law, Mixed) and len(law.parts) == 5
    for seed in range(4):
        problem = random_problem(law, dim=dim, seed=seed)
        for method in ("auto", "proximal"):
            solution = solve(problem, method, tol=1e-11)
            assert solution.solved
            assert worst(problem, solution, names) < 1e-8
    assert set(solvers_of(law)) >= {"auto", "newton", "proximal", "admm"}
    with pytest.raises(InputError, match="does not solve the law Mixed"):
        solve(problem, "nsgs")


def test_selection_and_joining_keep_every_contact_with_its_law():
    rng = np.random.default_rng(3)
    y = rng.normal(size=(5, 3))
    law = join([(Coulomb([0.1, 0.9]), [3, 1]), (Tresca([0.2, 0.4]), [0, 4]), (Coulomb([0.5]), [2])])
    assert list(law.coefficient) == [0.0, 0.9, 0.5, 0.1, 0.0]
    order = np.array([4, 0, 2, 2, 1])
    assert np.allclose(law.select(order).project(y[order])[0], law.project(y)[0][order])
    some = np.array([False, True, True, True, False])
    assert isinstance(law.select(some), Coulomb)
    assert list(law.select(some).coefficient) == [0.9, 0.5, 0.1]
    nested = join([(law, np.arange(5)), (Bilateral([0.7]), [5])])
    assert list(nested.lowest) == [0, 0, 0, 0, 0, -np.inf] and not nested.unilateral
    assert nested.coefficient[5] == 0.7
    for overlapping in ([0], [2]):
        with pytest.raises(InputError, match="every contact needs exactly one law"):
            join([(Coulomb([0.1]), [0]), (Tresca([0.1]), overlapping)])


def test_replacing_other_data_keeps_the_law():
    problem = random_problem(Tresca(0.3))
    again = replace(problem, q=2 * problem.q)
    assert again.law.bound(np.zeros(6))[0] == 0.3 and isinstance(again.law, Tresca)
    assert (
        problem.fingerprint == replace(problem).fingerprint != replace(problem, law=0.3).fingerprint
    )


@pytest.mark.parametrize(
    "change,message", [(-0.1, "must not be negative"), ("x", "array of numbers"), ([1, 2], "shape")]
)
def test_bad_parameters_are_refused(change, message):
    for kind in (Coulomb, Bilateral, Tresca, Associated):
        with pytest.raises(InputError, match=message):
            random_problem(kind(change))
    with pytest.raises(InputError, match="Frictionless reads no mu; leave it out or give 0"):
        Frictionless(0.1)
    with pytest.raises(InputError, match="unknown law 'magic'; choose from"):
        find_law("magic")


def test_scenes_say_their_law():
    scene = scenes.flat_punch(2, elements=6, mu=0.3)
    problem = reduce(replace(scene, law="tresca", mu=2e-3))
    # a traction bound
    assert np.allclose(problem.law.bound(np.zeros(problem.contacts)), 2e-3 * problem.areas)
    traction = solve(problem).reactions / problem.areas[:, None]
    assert np.abs(traction[:, 1]).max() == pytest.approx(2e-3)
    assert isinstance(reduce(scenes.flat_punch(2, elements=4, bilateral=True)).law, Bilateral)
    for bad in (dict(law="magic"), dict(mu=-0.1), dict(mu=[0.1, -0.1]), dict(mu="x")):
        with pytest.raises(InputError):
            replace(scene, **bad)


def test_diagnosis_needs_a_friction_coefficient():
    for law in (Tresca(0.3), Associated(0.3)):
        with pytest.raises(InputError, match="needs Coulomb's law"):
            diagnose(random_problem(law))


def test_a_law_is_one_file_and_one_line(monkeypatch):
    """Friction that grows with the pressure up to a limit (Orowan), added as a plug-in would be."""

    @dataclass(frozen=True, eq=False)
    class Orowan(Law):
        mu: np.ndarray
        limit: np.ndarray = 0.5

        @property
        def coefficient(self):
            return self.mu

        def bound(self, r_n):
            return np.minimum(self.mu * np.maximum(r_n, 0.0), self.limit)

        def nearest_derivative(self, y, r_n):
            return cylinder_derivative(y, self.bound(r_n))

        def scaled(self, force):
            return replace(self, limit=self.limit / force)

    module = ModuleType("orowan")
    module.Orowan = Orowan
    monkeypatch.setitem(sys.modules, "orowan", module)
    monkeypatch.setitem(LAWS, "orowan", ("orowan", "Orowan", "friction with a limit"))
    problem = random_problem(find_law("orowan")(0.8, 0.5))
    for method in ("auto", "tresca", "alternating"):
        solution = solve(problem, method, tol=1e-10)
        assert solution.solved
        u = problem.displacements(solution.reactions, solution.multipliers)
        slip = np.linalg.norm(u[:, 1:], axis=1)
        force = np.linalg.norm(solution.reactions[:, 1:], axis=1)
        bound = np.minimum(0.8 * solution.reactions[:, 0], 0.5)
        assert np.all(force <= bound + 1e-8) and np.allclose(slip * (bound - force), 0, atol=1e-8)
        assert {0.5} < set(np.round(bound, 9))  # some bounds are at the limit, some below
    scene = replace(scenes.flat_punch(2, elements=4), law="orowan")
    assert solve(reduce(scene)).solved
