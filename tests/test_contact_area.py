"""The area of every pair in scenes of every kind, and half-widths where these have a meaning."""

import numpy as np
import pytest
import skfem
from test_chords import press_fit

from contactopt import Contact, Material, Part, Rigid, Scene, Support, run
from contactopt.outcome import pair_rows, summary_rows

STEEL = Material(2e5, 0.3)


def blocks(widths, thickness=1.0, kind="plane-strain", inner=0.0):
    """Blocks pressed on a floor, each a pair of its own."""
    parts, left = [], inner
    for i, width in enumerate(widths):
        mesh = skfem.MeshQuad.init_tensor(np.linspace(left, left + width, 9), np.linspace(0, 1, 4))
        mesh = mesh.with_boundaries({"low": lambda x: x[1] == 0, "top": lambda x: x[1] == 1})
        axis = "z" if kind == "axisymmetric" else "y"
        held = (Support("top", {"x" if axis == "y" else "r": 0.0, axis: -1e-3}),)
        parts.append(Part(f"block{i}", mesh, STEEL, held, contact="low"))
        left += width + 1
    floor = Rigid("floor", (0.0, 1.0), lambda x: x[1])
    pairs = tuple(Contact(part.name, "floor", 0.0) for part in parts)
    return Scene(
        "blocks", bodies=(*parts, floor), contacts=pairs, kind=kind, thickness=thickness, degree=1
    )


def test_every_pair_of_a_plane_scene_has_the_area_of_its_thickness():
    summary = run(blocks((2.0, 3.0), thickness=5.0), figures=()).summary
    for i, width in enumerate((2.0, 3.0)):
        pair = summary["pairs"][f"block{i}-floor"]
        assert pair["contact_area"] == pytest.approx(5 * width)
        assert pair["contact_half_width"] == pytest.approx(width / 2)
        head, *rows = pair_rows(summary)
        assert rows[i][0] == f"block{i}-floor" and len(rows[i]) == len(head)
        assert dict(zip(head, rows[i]))["area\nlength^2"] == f"{5 * width:g}"
    assert "thickness 5 length" in summary_rows(summary)["model"]


def test_a_disc_has_a_radius_and_a_ring_half_a_width():
    """A ring that lies between the radii 3 and 5 is 2 wide."""
    for inner, width, half in ((0.0, 2.0, 2.0), (3.0, 2.0, 1.0)):
        summary = run(blocks((width,), kind="axisymmetric", inner=inner), figures=()).summary
        pair = summary["pairs"]["block0-floor"]
        assert pair["contact_half_width"] == pytest.approx(half, rel=1e-3)
        assert pair["contact_area"] == pytest.approx(np.pi * ((inner + width) ** 2 - inner**2))
        assert "thickness" not in summary_rows(summary)["model"]


@pytest.mark.parametrize("mirror", [None, "z"])
def test_a_fit_is_as_wide_as_it_is_long(mirror):
    """A shaft of radius 1 in a hub of length 2; across a plane of symmetry it is the same."""

    def tube(low, high, length, steps):
        z = np.linspace(0 if mirror else -length / 2, length / 2, steps + 1)
        mesh = skfem.MeshQuad.init_tensor(np.linspace(low, high, 4), z)
        names = {"in": lambda x: x[0] == low, "out": lambda x: x[0] == high}
        return mesh.with_boundaries(names | {"z-": lambda x: x[1] == z[0]})

    held = (Support("z-", {"z": 0.0}),)
    shaft = Part("shaft", tube(0.5, 1.001, 4, 16), STEEL, held, contact="out")
    hub = Part("hub", tube(1.0, 2.0, 2, 10), STEEL, held, contact="in")
    scene = Scene("fit", hub, shaft, 0.0, kind="axisymmetric", mirror=mirror)
    summary = run(scene, figures=()).summary
    assert summary["contact_half_width"] == pytest.approx(1.0, rel=0.01)
    pair = summary["pairs"]["hub-shaft"]
    assert pair["contact_area"] == pytest.approx(2 * np.pi * 2, rel=0.01)


def test_a_fit_in_space_has_an_area_and_no_half_width():
    summary = run(press_fit((6, 6), dim=3, overlap=1e-3), figures=()).summary
    assert summary["contact_half_width"] is summary["stick_half_width"] is None
    area = summary["pairs"]["inner-outer"]["contact_area"]
    assert area == pytest.approx(np.pi / 2 * 0.6, rel=0.02)
    assert not any("half-width" in row for row in summary_rows(summary))


@pytest.mark.parametrize("name", ["cylinder-2d", "sphere"])
def test_areas_of_exact_zones(name):
    found = run(name, figures=())
    half = found.scene.reference.half_width
    exact = 2 * half * found.scene.thickness if name == "cylinder-2d" else np.pi * half**2
    (pair,) = found.summary["pairs"].values()
    assert pair["contact_area"] == pytest.approx(exact, rel=0.02)
