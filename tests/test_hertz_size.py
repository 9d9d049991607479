"""Half-widths that `check` predicts, against Hertz's solutions for pressures of ellipses."""

import numpy as np
import pytest
import skfem
from scipy.integrate import quad

from contactopt import Contact, Material, Part, Plate, Scene, Support, scenes
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


def roller(turn: float, half: bool = False) -> Scene:
    """Part of a cylinder of radius 10 along 8 mm on a block that is longer, turned about z; or the
    half of both beyond the plane of symmetry along the cylinder.
    """
    c, s = np.cos(turn), np.sin(turn)

    def body(name, x, y, z, bent, faces, **given):
        mesh = skfem.MeshHex.init_tensor(x[x >= 0] if half else x, y, z)
        names = {
            face: mesh.facets_satisfying(lambda p, at=at: np.isclose(p[2], at))
            for face, at in faces.items()
        }
        if half:
            names["cut"] = mesh.facets_satisfying(lambda p: p[0] == 0)
            given["supports"] = (*given.get("supports", ()), Support("cut", {"x": 0.0}))
        p = mesh.p.copy()
        p[2] += bent * (1 - p[2] / 2) * p[0] ** 2 / 20
        p[:2] = np.array([[c, -s], [s, c]]) @ p[:2]
        turned = skfem.MeshHex(p, mesh.t).with_boundaries(names)
        return Part(name, turned, Material(2e5, 0.3), **given)

    x, y, z = np.linspace(-2, 2, 9), np.linspace(0, 8, 5), np.linspace(0, 2, 4)
    pushed = Plate("top", {"z": -400.0})
    upper = body("upper", x, y, z, 1.0, {"contact": 0.0, "top": 2.0}, loads=(pushed,))
    x, y, z = np.linspace(-3, 3, 7), np.linspace(-1, 9, 4), np.linspace(-2, 0, 4)
    lower = body("lower", x, y, z, 0.0, {"contact": 0.0, "base": -2.0}, supports=(Support("base"),))
    return Scene("roller", kind="solid", bodies=(upper, lower),
                 contacts=(Contact("upper:contact", "lower:contact", 0.1),),
                 copies=2 if half else 1)  # fmt: skip


@pytest.mark.parametrize("turn, half", [(0.0, False), (0.4, False), (0.0, True)])
def test_a_roller_touches_along_its_length(turn, half):
    """The ellipse of so slight a curvature was wider than the roller, or there was none."""
    scene = roller(turn, half)
    check = check_scene((scene,))
    (own,) = hertz(scene, check.posed, check.free).values()
    assert own.widths[0] == pytest.approx(4.0)
    assert own.widths[1] == pytest.approx(
        np.sqrt(4 * 50.0 * 10 * 2 * 0.91 / (np.pi * 2e5)), rel=1e-3
    )
    assert own.place == pytest.approx([-4 * np.sin(turn), 4 * np.cos(turn), 0.0], abs=1e-9)
