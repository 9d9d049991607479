"""The classics: what a sequence converges to, an exact solution, and one scene on small meshes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from contactopt.analytic import contact_modulus, hertz_line
from contactopt.material import Material
from contactopt.solving.solve_scene import Options, solve_scene
from experiments.questions.classics import sequences
from experiments.questions.classics.blocks import UNIT, receding
from experiments.questions.classics.bodies import LARGE, SHIFT, centre_of_friction, stretched
from experiments.questions.classics.layered import pressed_cylinder, sinking
from experiments.questions.classics.receding_layer import (
    kernels,
    receding_half_width,
    receding_peak,
)
from experiments.questions.classics.rounded_punch import rounded_punch
from experiments.questions.classics.sequences import Way, follow_way, limit_of
from experiments.questions.classics.table import classics, rows_of


@pytest.mark.parametrize("order", [1, 2, 3.5])
def test_the_limit_of_a_sequence_of_one_order_is_exact(order):
    found = limit_of([2 + 0.3 * 2.0 ** (-order * level) for level in range(4)])
    assert found.limit == pytest.approx(2, rel=1e-12)
    assert found.order == pytest.approx(order, rel=1e-9)
    assert abs(found.values[-1] - 2) > found.bar > 0


def test_a_small_step_is_no_small_bar():
    """Values that come near each other by luck keep the bar of an error of first order."""
    found = limit_of([1.0, 1.2, 1.1, 1.1001])
    assert np.isnan(found.order) and found.limit == 1.1001
    assert found.bar == pytest.approx(0.05)
    found = limit_of([1.0, 1.2, 1.22])  # an order of 3.3, from one limit alone
    assert found.bar == pytest.approx(0.02)


def test_a_layer_held_on_its_base_is_pulled_beyond_where_filon_found_it():
    """Under a force on a line, a layer that cannot leave a base without friction presses on it up
    to about 1.35 heights away (Filon 1903).
    """
    t, w = np.polynomial.legendre.leggauss(400)
    k, w = 20 * (t + 1), 20 * w
    squeezed, bent = kernels(k)

    def pressure(x: float) -> float:
        return float(np.cos(k * x) * (bent - squeezed) / (bent + squeezed) @ w / np.pi)

    assert brentq(pressure, 0.5, 2.0) == pytest.approx(1.35, abs=0.02)


@pytest.mark.slow
def test_the_receding_layer_under_a_wide_load_bears_that_load():
    assert receding_half_width(0.5, 12) == pytest.approx(receding_half_width(0.5), rel=1e-6)
    assert receding_peak(4.0) == pytest.approx(1 / 8, rel=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("growth, base, levels, degree", [(1.25, 6, 3, 1), (1.4, 4, 3, 2)])
def test_the_receding_layer_of_finite_elements_is_that_of_the_integral_equation(
    growth, base, levels, degree
):
    way = Way(receding(0.5, 5.0, 1.0, growth), base, levels, degree)
    found = follow_way(way, ("pressure", "width"))[0]
    peak, half_width = receding_peak(0.5), receding_half_width(0.5)
    assert abs(found["pressure"].limit - peak) < found["pressure"].bar < 6e-3 * peak
    assert found["width"].limit == pytest.approx(half_width, rel=0.01)


def test_the_compliance_of_one_layer_is_the_closed_form():
    """Vorovich's for a bonded layer, and that of a layer on a base without friction."""
    k, whole, halves = np.geomspace(1e-3, 50, 20), ((1.0, UNIT),), ((0.5, UNIT), (0.5, UNIT))
    kappa, s = 3 - 4 * UNIT.nu, 2 * k
    closed = (2 * kappa * np.sinh(s) - 2 * s) / (2 * kappa * np.cosh(s) + s**2 + 1 + kappa**2)
    assert sinking(k, whole, True) == pytest.approx(closed, rel=1e-10)
    assert sinking(k, halves, True) == pytest.approx(closed, rel=1e-10)
    assert sinking(k, whole, False) == pytest.approx(2 * np.sinh(k) ** 2 / (np.sinh(s) + s))


def test_a_small_contact_on_layers_is_that_of_hertz():
    """It differs by a share that grows as the square of the half-width."""
    layers, modulus = ((1.0, UNIT), (3.0, Material(0.2, 0.4))), contact_modulus(UNIT, None)

    def off(force: float) -> float:
        hertz = hertz_line(force, 10.0, modulus)
        return pressed_cylinder(force, 10.0, layers, False).half_width / hertz.half_width - 1

    assert 0 < off(3e-4) < 3e-3
    assert off(1.2e-3) == pytest.approx(4 * off(3e-4), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cylinder on bonded layer", "cylinder on coated layer"])
@pytest.mark.parametrize("way", [(1.25, 8, 3, 1), (1.4, 6, 3, 2)])
def test_cylinders_on_layers_of_finite_elements_are_those_of_the_integral_equation(name, way):
    classic = next(one for one in classics() if one.name == name)
    growth, base, levels, degree = way
    found = follow_way(Way(classic.scene(growth, base), base, levels, degree), classic.quantities)
    for asked, limit in found[0].items():
        quantity = asked.partition(":")[0]
        exact = classic.exact[quantity]
        assert limit.limit == pytest.approx(exact, rel=5e-3 if quantity == "width" else 1e-4)


@pytest.mark.slow
def test_bulk_tension_moves_the_stick_zone_as_hills_and_nowell_found():
    scene = stretched()
    assert scene.reference.half_width < 1e-4 * LARGE
    half_width, peak = scene.reference.half_width, scene.reference.peak
    stick = scene.reference.stick_half_width
    # friction mu p0 (x - e) / a less than Cattaneo's stretches both surfaces alike
    tension = scene.lower.loads[0].value[0]
    assert tension == pytest.approx(4 * 0.5 * peak * SHIFT, rel=1e-12)
    x = np.linspace(-1, 1, 200_001)[1:-1] * half_width
    moved = np.maximum(0.0, 1 - ((x - SHIFT * half_width) / stick) ** 2) ** 0.5
    friction = 0.5 * peak * ((1 - (x / half_width) ** 2) ** 0.5 - stick / half_width * moved)
    exact = x @ friction / friction.sum() / half_width
    classic = next(one for one in classics() if "tension" in one.name)
    assert classic.exact["centre of friction"] == pytest.approx(exact, rel=1e-5)
    solved = solve_scene(scene, 6, None, Options(tol=1e-10))
    assert centre_of_friction(solved.reduction, solved.solution) == pytest.approx(exact, rel=0.03)


@pytest.mark.slow
def test_nafems_rounded_punch_rests_on_its_flat_and_a_little_of_its_fillet():
    scene = rounded_punch(40.4, 1.3)
    solved = solve_scene(scene, 4, 40.4, Options(tol=1e-10))
    forces, problem = solved.solution.reactions[:, 0], solved.reduction.problem
    assert forces.sum() == pytest.approx(100.0 * np.pi * 50.0**2, rel=1e-6)
    touching = problem.coordinates[0, forces > 0].max()
    assert 40.0 < touching < 41.0
    peak = problem.coordinates[0, np.argmax(forces / np.maximum(problem.areas, 1e-9))]
    assert 39.0 < peak < 40.2


def test_an_unsolved_mesh_is_no_value(monkeypatch):
    monkeypatch.setattr(sequences, "TIGHT", Options(tol=1e-10, settings={"max_iterations": 1}))
    with pytest.raises(RuntimeError, match="is not solved"):
        follow_way(Way(stretched(), 4, 3, 1), ("stick",))


@pytest.mark.slow
def test_a_row_says_how_far_two_ways_are_apart():
    classic = next(one for one in classics() if one.name == "press fit")
    small = replace(classic, ways=((0, 4, 3, 1), (0, 3, 3, 2)))
    (row,) = rows_of(small)
    assert abs(row["off exact"]) < row["relative bar"] < 1e-3
    assert row["apart over bars"] < 1
