"""The laws of simulators on one contact, where each answer is known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from contactopt import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb
from experiments.questions import five_frictions as laws

MU, PUSH = 0.5, 2.0


def contact(angle: float = 0.0) -> InterfaceProblem:
    """u = r + q: pressed with 1, pulled with 2 in a direction; Coulomb's answer is r_n 1, slip."""
    q = [[-1.0, -PUSH * np.cos(angle), -PUSH * np.sin(angle)]]
    return InterfaceProblem(np.eye(3), np.array(q), Coulomb(np.array([MU])))


def test_associated_projects_onto_the_cone_and_opens() -> None:
    r, u = laws.associated(contact())
    assert np.allclose(r, [[1.6, 0.8, 0]], atol=1e-6)
    assert u[0, 0] == pytest.approx(MU * np.linalg.norm(u[0, 1:]), abs=1e-6)


def test_springs_scale_the_associated_answer() -> None:
    assert np.allclose(laws.associated(contact(), 0.25)[0], [[1.28, 0.64, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ("sides", "angle", "friction"),
    [(4, 0.0, 0.5), (4, np.pi / 4, 0.5 / np.sqrt(2)), (0, np.pi / 4, 0.5 * np.sqrt(2))],
)
def test_polygons_bound_friction_by_their_corners_and_edges(
    sides: int, angle: float, friction: float
) -> None:
    r, u = laws.polygon(contact(angle), sides)
    assert r[0, 0] == pytest.approx(1, abs=1e-6)
    assert u[0, 0] == pytest.approx(0, abs=1e-6)
    assert np.linalg.norm(r[0, 1:]) == pytest.approx(friction, abs=1e-5)


def test_regularised_friction_follows_its_formula() -> None:
    r, u = laws.regularised(contact(), 0.3)
    slip = u[0, 1]
    assert r[0, 0] == pytest.approx(1, abs=1e-6)
    assert r[0, 1] == pytest.approx(-MU * slip / np.hypot(slip, 0.3), abs=1e-6)


def test_barrier_holds_apart_by_its_width_over_the_force() -> None:
    r, u = laws.barrier(contact(), 0.2)
    assert r[0, 0] == pytest.approx((1 + np.sqrt(1.8)) / 2, abs=1e-6)
    assert u[0, 0] == pytest.approx(0.2 / r[0, 0], abs=1e-6)
    assert r[0, 1] == pytest.approx(-MU * r[0, 0] * u[0, 1] / np.hypot(u[0, 1], 0.2), abs=1e-6)


def test_more_sides_come_nearer_to_coulomb() -> None:
    problem = laws.blocks((0.5,), 1.0)
    exact = np.array([1.0, -0.5 * np.cos(np.pi / 8), -0.5 * np.sin(np.pi / 8)])
    sums = [laws.polygon(problem, sides)[0].sum(axis=0) for sides in (4, 32)]
    far, near = (float(np.linalg.norm(s - exact)) for s in sums)
    assert near < 1e-2 < far
