"""Planes of symmetry, recognised by what holds a surface."""

import numpy as np
import pytest

from contactopt.coupling.planes_of_symmetry import ContactPoints, symmetry_planes


@pytest.mark.parametrize("clamp", [[], [1, 2], [0, 1, 2]], ids=["free", "plate", "clamp"])
def test_a_plate_or_clamp_elsewhere_hides_no_plane_of_symmetry(clamp):
    x, y = (own.ravel() for own in np.meshgrid(np.arange(6.0), np.arange(3.0), indexing="ij"))
    number = np.arange(18).reshape(6, 3)
    cells = np.array([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]])
    normals = np.tile([[0.0], [0.0], [1.0]], 18)
    held = np.zeros((3, 18), dtype=bool)
    held[1] = y == 0
    for c in clamp:
        held[c] |= x == 5
    points = np.array([x, y, 0 * x])
    surface = ContactPoints(points, normals, np.ones(18), cells.reshape(4, -1), held, np.zeros(18))
    (plane,) = symmetry_planes(surface)
    assert plane.inward.tolist() == [0, 1, 0] and plane.offset == 0
