"""What every body offers, whatever it is made of."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

from contactopt import reduce, scenes
from contactopt.bodies import views
from contactopt.bodies.elastic import on_soft_ground, pulled
from contactopt.bodies.fields import Fields, Region, Validity
from contactopt.bodies.protocol import Body
from contactopt.bodies.solvers import SOLVERS
from contactopt.bodies.solvers.system import BodySolver
from contactopt.coupling.reduction import reduce_bodies
from contactopt.scenes.scene import Rigid
from tests.stacks import layered


class Dense(BodySolver):
    """The least solver: a name and `solve`."""

    name = "dense"

    def __init__(self, system):
        super().__init__(system)
        self.factors = la.cho_factor(system.A.toarray())

    def solve(self, load, rtol=None):
        return la.cho_solve(self.factors, load)


def punch():
    return scenes.flat_punch(2, elements=4)


SCENES = {
    "finite elements": punch,
    "solid": lambda: scenes.flat_punch(3, elements=2),
    "rigid and half-space": lambda: scenes.hertz_half_space(elements=4),
    "tied layers": lambda: layered(punch(), 2),
    "rigid": lambda: replace(punch(), upper=Rigid("punch", force={"y": -1.0})),
}


@pytest.fixture(scope="module", params=SCENES)
def reduction(request):
    return reduce_bodies(SCENES[request.param](), Q="explicit")


@pytest.fixture
def sides(reduction):
    """Each body with its map, and random contact forces."""
    rng = np.random.default_rng(0)
    return [
        (body, B, rng.standard_normal(B.shape[0]))
        for body, B in zip(reduction.bodies, reduction.maps)
    ]


def test_the_compliance_is_one_matrix_however_it_is_asked_for(sides):
    for body, B, r in sides:
        C = body.through(B).entries()
        size = np.abs(C).max(initial=0.0)
        assert np.array_equal(C, C.T) and np.linalg.eigvalsh(C).min() >= -1e-12 * size
        assert np.allclose(
            body.through(B).product(r[:, None], None)[:, 0], C @ r, atol=1e-10 * size
        )
        assert np.array_equal(body.through(B).moved, np.abs(C).sum(axis=1) > 1e-14 * size)


def test_a_body_moves_by_rest_compliance_and_free_motions(sides):
    for body, B, r in sides:
        V, rest = B @ body.motions.fields, B @ body.at_rest
        multipliers = np.arange(1.0, 1 + V.shape[1])
        assert len(body.motions.names) == len(body.motions.resultants) == V.shape[1]
        expected = rest + body.through(B).entries() @ r + V @ multipliers
        U = body.displacement(B.T @ r, multipliers)
        assert np.allclose(B @ U, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("constant", ["E", "nu"])
def test_work_is_the_weighted_change(sides, constant):
    for body, B, r in sides:
        force, weights = B.T @ r, np.ones(len(body.motions.resultants))
        U, dual = body.displacement(force, weights), B.T @ r[::-1]
        W = body.displacement(dual, weights) - body.at_rest
        change, balance = body.material_change(constant, U, force)
        expected = dual @ change + weights @ balance
        found = views.material_work(body, constant, U, force, dual, W)
        assert found == pytest.approx(expected, rel=1e-8, abs=1e-12)


def test_readings_of_a_body_are_of_its_kind(sides, reduction):
    for (body, B, r), part in zip(sides, reduction.scene.parts):
        force, weights = B.T @ r, np.ones(len(body.motions.resultants))
        U = body.displacement(force, weights)
        inner = body.internal_forces(U, force)
        assert views.energy(body, U, force) == pytest.approx(U @ inner / 2) and U @ inner >= 0
        assert np.isfinite(views.energy_change(body, "E", U, force))
        assert all(len(pair) == 2 for pair in views.held_by(body, U, force).values())
        elements = len(views.on_elements(body, U))
        assert [len(found) for found in views.recovery_errors(body, U, U)] == [elements]
        assert (views.stress_map(body, Region()) is None) == (elements == 0)
        fields = views.fields(body, U)
        assert fields is None if elements == 0 else isinstance(fields, Fields)
        assert isinstance(views.limits(body, U, force), Validity)
        same = body.loaded(reduction.scene, part)
        assert np.allclose(B @ same.at_rest, B @ body.at_rest, atol=1e-12)
        worked = views.load_work(body, reduction.scene, part, force, weights, U)
        assert worked == pytest.approx(0, abs=1e-9)
        assert on_soft_ground(body, 1.0) is body and pulled(body, U) is body


def test_what_is_asked_of_a_body_is_little():
    asked = {name for name in [*vars(Body), *Body.__annotations__] if name[0] != "_"}
    assert len(asked | {"name", "unknowns", "at_rest", "motions"}) <= 12


def test_the_least_solver_gives_the_same_problem(monkeypatch):
    monkeypatch.setitem(SOLVERS, "dense", (__name__, "Dense", "dense factors"))
    usual, least = (reduce(punch(), **options) for options in ({}, {"solver": "dense"}))
    assert np.allclose(usual.Q, least.Q, rtol=0, atol=1e-14 * np.abs(usual.Q).max())
    assert np.allclose(usual.q, least.q, rtol=0, atol=1e-12)
