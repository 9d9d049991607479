"""What is drawn of finite elements covers the body once, with all of its nodes."""

import numpy as np
import pytest
import skfem

from contactopt.figures.pieces import (
    mesh_lines,
    outline,
    pieces,
    segments,
    sharp_edges,
    solids,
    surface,
)
from contactopt.meshes.cells import elements_of

TICKS = np.linspace(0, 1, 4)
FLAT = (skfem.MeshTri, skfem.MeshTri2), (skfem.MeshQuad, skfem.MeshQuad2)
SOLID = (skfem.MeshTet, skfem.MeshTet2), (skfem.MeshHex, skfem.MeshHex2)


def unit(pair, degree):
    """The unit square or cube."""
    plain = pair[0].init_tensor(*[TICKS] * (2 if pair in FLAT else 3))
    return plain if degree == 1 else pair[1].from_mesh(plain)


def length(points, lines):
    return np.linalg.norm(
        points[segments(lines)[:, 1]] - points[segments(lines)[:, 0]], axis=1
    ).sum()


def area(points, flat):
    corners = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))[flat]
    first, second = corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]
    cross = np.cross(first, second if flat.shape[1] == 4 else corners[:, 1] - corners[:, 0])
    return np.linalg.norm(cross, axis=1).sum() / 2


def volume(points, parts):
    corners = points[parts]
    if parts.shape[1] == 8:  # bricks along the axes
        return np.prod(np.ptp(corners, axis=1), axis=1).sum()
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("pair", FLAT)
def test_plane_elements_are_covered_once(pair, degree):
    mesh = unit(pair, degree)
    points, (kind, elements) = mesh.p.T, elements_of(mesh)
    flat = pieces(kind, elements)
    assert area(points, flat) == pytest.approx(1)
    assert set(flat.ravel()) == set(range(len(points)))  # every node is drawn
    assert length(points, outline(kind, elements)) == pytest.approx(4)
    assert len(mesh_lines(kind, elements)) == mesh.nfacets
    assert solids(kind, elements).shape == (0, 4)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("pair", SOLID)
def test_solid_elements_show_their_boundary_and_can_be_cut(pair, degree):
    mesh = unit(pair, degree)
    points, (kind, elements) = mesh.p.T, elements_of(mesh)
    plane, faces = surface(kind, elements, points)
    flat = pieces(plane, faces)
    assert area(points, flat) == pytest.approx(6)
    corners = points[flat]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.all(np.sum(outward * (corners.mean(axis=1) - 0.5), axis=1) > 0)
    on_boundary = np.any((points == 0) | (points == 1), axis=1)
    assert set(flat.ravel()) == set(np.flatnonzero(on_boundary))
    assert length(points, sharp_edges(plane, faces, points, 0.9)) == pytest.approx(12)
    inner = solids(kind, elements)
    assert volume(points, inner) == pytest.approx(1)
    assert set(inner.ravel()) == set(range(len(points)))
