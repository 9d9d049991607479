"""Half-widths that `check` predicts, against Hertz's solutions for pressures of ellipses."""

import numpy as np
import pytest
from scipy.integrate import quad

from contactopt import scenes
from contactopt.figures.scene_check import check_scene
from contactopt.readings.hertz_size import ellipse, hertz


@pytest.mark.parametrize("name, arguments", [
    ("cylinder-2d", {}), ("hertz-dissimilar", {"elements": 12}), ("sphere", {}),
    ("cattaneo-3d", {"elements": 6}),
])  # fmt: skip
def test_the_widths_of_named_scenes_are_those_of_their_references(name, arguments):
    scene = scenes.make_scene(name, **arguments)
    check = check_scene((scene,))
    (own,) = hertz(scene, check.posed, check.free).values()
    assert own.widths[0] == pytest.approx(scene.reference.half_width, rel=0.03)


def test_the_half_widths_of_an_ellipse_make_its_gap_zero():
    """Inside, the displacement of Hertz's pressure is the approach less the gap."""
    F, modulus, small, large = 200.0, 115e3, 0.008, 0.27
    a, b = ellipse(F, modulus, small, large)
    for width, curvature in ((a, small), (b, large)):

        def part(w, width=width):
            return 1 / ((width**2 + w) * np.sqrt((a**2 + w) * (b**2 + w) * w))

        area = sum(
            quad(part, *ends, limit=400)[0] for ends in ((0, b**2), (b**2, a**2), (a**2, np.inf))
        )
        # of F = 2 pi a b p0 / 3
        assert 3 * F / (4 * np.pi * modulus) * area == pytest.approx(curvature / 2, rel=1e-6)
    assert ellipse(F, modulus, large, large)[0] == pytest.approx(
        ellipse(F, modulus, large, 1.01 * large)[0], rel=0.01
    )
    assert 1.5 * F / (np.pi * a * b) > 0


def test_scenes_without_curves_or_with_unknown_forces_are_left_alone():
    for name in ("punch-2d", "stack"):
        scene = scenes.make_scene(name)
        check = check_scene((scene,))
        assert not hertz(scene, check.posed, check.free)
