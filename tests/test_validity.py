"""Half models stand for the whole; answers beyond what is assumed say so."""

import numpy as np
import pytest
import skfem

from contactopt import InputError, Material, Part, Plate, Rigid, Scene, Support, run
from contactopt.figures.page_data import page_data
from contactopt.figures.view_page import _body

SOFT = Material(1000.0, 0.3)


def bridge(half=True, **changes):
    """A bridge whose feet, left and right of its plane of symmetry, are pushed apart against
    friction.
    """
    x, y = np.linspace(0 if half else -2, 2, 9 if half else 17), np.linspace(0, 1, 5)
    box = skfem.MeshQuad.init_tensor(x, y)
    middle = box.p[:, box.t].mean(axis=1)
    mesh = box.restrict(
        np.flatnonzero((np.abs(middle[0]) > 1) | (middle[1] > 0.5))
    ).with_boundaries(
        {"foot": lambda x: x[1] == 0, "top": lambda x: x[1] == 1, "middle": lambda x: x[0] == 0}
    )
    supports = (Support("middle", {"x": 0.0}),) if half else ()
    part = Part(
        "bridge", mesh, SOFT, supports, (Plate("top", {"y": -40.0}, glued=False),), contact="foot"
    )
    return Scene("bridge", part, Rigid("floor", normal=(0, 1)), 0.3, **changes)


@pytest.mark.parametrize("given", [{"copies": 2}, {"mirror": "x"}, {"mirror": "x", "copies": 2}])
def test_a_half_whose_plane_the_contact_does_not_meet_has_the_forces_of_the_whole(given):
    whole, half = (
        run(scene, figures=()).summary for scene in (bridge(half=False), bridge(**given))
    )
    assert half["mirrors"] == [{"axis": "x", "place": 0.0}]
    for key in ("force", "moment"):
        assert np.allclose(
            half["pairs"]["bridge-floor"][key], whole["pairs"]["bridge-floor"][key], atol=1e-9
        )
    for key in ("max_pressure", "approach", "normal_force"):
        assert half[key] == pytest.approx(whole[key], rel=1e-9)


def test_a_mirror_must_be_an_axis_with_a_plane():
    for wrong in ("z", "xx", "", 3):
        with pytest.raises(InputError, match="mirror names each axis once"):
            bridge(mirror=wrong)
    with pytest.raises(InputError, match="makes 2 images, but copies is 3"):
        bridge(mirror="x", copies=3)
    with pytest.raises(InputError, match="no support holds y alone at zero"):
        run(bridge(mirror="y"), figures=())


def block(push, scale=1.0):
    """A block on a floor with four facets, pushed along it by `push` facets, lengths in units of
    `scale`.
    """
    mesh = skfem.MeshQuad.init_tensor(*(scale * np.linspace(0, 1, 5),) * 2).with_boundaries(
        {"contact": lambda x: x[1] == 0, "top": lambda x: x[1] == scale}
    )
    top = Support("top", {"x": push * scale / 4, "y": -1e-3 * scale})
    return Scene("block", Part("block", mesh, SOFT, (top,)), Rigid("floor", normal=(0, 1)), 0.01)


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_large_motion_is_told_with_its_number(scale, tmp_path):
    assert run(block(0.5, scale), figures=()).summary["remarks"] == []
    made = run(block(4.0, scale), tmp_path / "out", figures=())
    slip = made.summary["limits"]["pairs"]["block-floor"]["slip"]
    assert slip == pytest.approx(4.0, abs=0.1)
    told = "".join(made.summary["remarks"])
    assert f"slips by up to {slip:.3g} facets" in told
    assert told[:60] in _body(made.summary, page_data(tmp_path / "out", made.summary)).replace(
        "&#x27;", "'"
    )


def test_a_gap_that_closes_by_more_than_a_facet_is_told():
    scene = block(0.0)
    near, far = (
        run(
            Scene(
                "s",
                scene.upper,
                Rigid("floor", normal=(0, 1), gap=lambda x, g=g: 0 * x[0] - g),
                0.01,
            ),
            figures=(),
        )
        for g in (0.1, -0.3)
    )
    assert not any("closes" in text for text in near.summary["remarks"])
    assert not any("closes" in text for text in far.summary["remarks"])  # it stays open
    driven = Part("block", scene.upper.mesh, SOFT, (Support("top", {"x": 0.0, "y": -0.301}),))
    told = run(
        Scene("s", driven, Rigid("floor", normal=(0, 1), gap=lambda x: 0.3 + 0 * x[0]), 0.01),
        figures=(),
    )
    assert any("closes a gap of up to 1.2 facets" in text for text in told.summary["remarks"])


def test_strain_and_rotation_beyond_the_linear_range_are_told():
    scene = block(0.0)
    for displacement, word in (
        ({"x": 0.0, "y": -0.1}, "strain of up to 0.1"),
        ({"x": 0.3, "y": -1e-3}, "rotation"),
    ):
        part = Part("block", scene.upper.mesh, SOFT, (Support("top", displacement),))
        told = run(Scene("s", part, Rigid("floor", normal=(0, 1)), 2.0), figures=()).summary[
            "remarks"
        ]
        assert any(word in text for text in told)
