"""The classics: what a sequence converges to, an exact solution, and one scene on small meshes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from experiments.questions.classics.blocks import receding
from experiments.questions.classics.receding_layer import (
    kernels,
    receding_half_width,
    receding_peak,
)
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


def test_the_receding_layer_under_a_wide_load_bears_that_load():
    assert receding_half_width(0.5, 12) == pytest.approx(receding_half_width(0.5), rel=1e-6)
    assert receding_peak(4.0) == pytest.approx(1 / 8, rel=3e-4)


@pytest.mark.parametrize("growth, base, levels, degree", [(1.25, 6, 3, 1), (1.4, 4, 3, 2)])
def test_the_receding_layer_of_finite_elements_is_that_of_the_integral_equation(
    growth, base, levels, degree
):
    way = Way(receding(0.5, 5.0, 1.0, growth), base, levels, degree)
    found = follow_way(way, ("pressure", "width"))[0]
    peak, half_width = receding_peak(0.5), receding_half_width(0.5)
    assert abs(found["pressure"].limit - peak) < found["pressure"].bar < 6e-3 * peak
    assert found["width"].limit == pytest.approx(half_width, rel=0.01)


def test_a_row_says_how_far_two_ways_are_apart():
    classic = next(one for one in classics() if one.name == "press fit")
    small = replace(classic, ways=((0, 4, 3, 1), (0, 3, 3, 2)))
    (row,) = rows_of(small)
    assert abs(row["off exact"]) < row["relative bar"] < 1e-3
    assert row["apart over bars"] < 1
