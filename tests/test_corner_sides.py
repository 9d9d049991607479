"""Corners between the sides of a surface are found on coarse meshes; curves stay whole."""

import numpy as np
import pytest
import skfem
from mortar_scenes import ring
from test_corners import box, sides
from test_tips import bent, walled

from contactopt.meshes.given_curves import Curve


def circle(start: float, end: float, chords: int) -> np.ndarray:
    a = np.deg2rad(np.linspace(start, end, chords + 1))
    return np.array([np.cos(a), np.sin(a)])


ROUND = {
    "a quarter by 3 chords": circle(0, 90, 3),
    "a half by 4 chords": circle(0, 180, 4),
    "a third by chords of uneven length": np.concatenate(
        [circle(0, 60, 3), circle(80, 120, 1)], axis=1
    ),
    "an ellipse of 1 to 3": circle(-90, 90, 16) * [[3.0], [1.0]],
    "a fillet of 90 degrees by 2 chords": np.concatenate(
        [[[2.0, 2.0], [0.0, 0.5]], circle(0, 90, 2) + 1, [[0.5, 0.0], [2.0, 2.0]]], axis=1
    ),
    "a fillet of 60 degrees by 4 chords": np.concatenate(
        [[[2.0], [0.5]], circle(0, 60, 4) + 1], axis=1
    ),
}


@pytest.mark.parametrize("kind", ["quad", "tri"])
@pytest.mark.parametrize("name", ["outer", "inner"])
@pytest.mark.parametrize("case", ROUND)
@pytest.mark.parametrize("dim", [2, 3])
def test_curves_that_are_meshed_coarsely_stay_whole(dim, case, name, kind):
    for degree in (1, 2):
        assert sides(walled(ROUND[case], kind, dim), name, degree) == 0


@pytest.mark.parametrize("chords", [6, 8, 12])
def test_closed_polygons_for_circles_stay_whole(chords):
    assert sides(ring(0.5, 1.0, 1, chords, 2 * np.pi)) == 0
    assert sides(ring(0.5, 1.0, 1, chords, 2 * np.pi), "inner") == 0


@pytest.mark.parametrize("cells", [1, 2, 4])
def test_curved_elements_have_no_corners_where_they_meet(cells):
    mesh = ring(0.5, 1.0, 1, cells, np.pi / 2, curved=True)
    assert sides(mesh, "outer", 2) == sides(mesh, "outer", 1) == 0


def test_a_ball_of_few_triangles_has_no_edges():
    mesh = skfem.MeshTet.init_ball(1)
    assert sides(mesh.with_boundaries({"outer": lambda x: np.full(x.shape[1], True)})) == 0


@pytest.mark.parametrize("angle", [8.0, 30.0, 60.0, 90.0, 140.0])
@pytest.mark.parametrize("name", ["outer", "inner"])
@pytest.mark.parametrize("kind", ["quad", "tri"])
def test_corners_have_two_sides_at_any_angle(angle, name, kind):
    shift = 1.0 if angle < 100 else 2.0
    for degree in (1, 2):
        assert sides(walled(bent(angle, shift=shift), kind, 2), name, degree) == 1
        # an edge of two elements, with nodes between them at degree 2
        count = sides(walled(bent(angle, shift=shift), kind, 3), name, degree)
        assert count == (3 if degree == 1 else 5)


def test_corners_beside_curves_and_chamfers():
    arcs = np.concatenate([circle(0, 60, 4), [[-1.0, -1.75], [0.6, 0.467]]], axis=1)
    assert sides(walled(arcs, "quad", 2)) == 1
    chamfer = np.array([[2.0, 2, 2, 1.5, 1, 0], [0.0, 0.5, 1, 1.5, 1.5, 1.5]])
    assert sides(walled(chamfer, "quad", 2)) == 2
    tooth = np.array([[3.0, 2.5, 2, 1.5, 1, 0.5, 0], [1.3, 1.8, 1.3, 1.8, 1.3, 1.8, 1.3]])
    assert sides(walled(tooth, "quad", 2)) == 5


def test_cubes_have_edges_and_corners_however_coarse():
    for cells, kind in ((1, "quad"), (1, "tri"), (3, "tri")):
        mesh = box(0.0, 1.0, cells, kind, 3)
        corners = 3 - 1 + 3 * cells  # three sides at the corner, two along three edges
        assert sides(mesh, "seat") == corners
    assert sides(box(0.0, 1.0, 1, "quad", 2), "seat") == 1


def test_a_given_curve_says_where_corners_are():
    mesh = walled(circle(0, 90, 1 + 1), "quad", 2)
    coarse = walled(np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]]), "quad", 2)
    smooth = Curve(lambda x: x / np.hypot(*x), True)
    sharp = Curve(lambda x: x / np.abs(x).max(axis=0), True)
    assert sides(mesh, curve=smooth) == 0
    assert sides(coarse) == sides(coarse, curve=sharp) == 1
    assert sides(coarse, curve=smooth) == 0  # two chords of a circle, far off it
