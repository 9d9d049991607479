"""Planes of symmetry, recognised by what holds a surface."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from contactopt import Contact, Material, Part, Scene, Support, solve
from contactopt.coupling.planes_of_symmetry import ContactPoints, symmetry_planes
from contactopt.coupling.reduction import reduce_bodies


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


def tube(low, high, chords):
    """A quarter of a tube of length 0.6 between two radii, of tetrahedra of second order that no
    plane across the axis mirrors.
    """
    axes = np.linspace(low, high, 3), np.linspace(0, np.pi / 2, chords + 1), np.linspace(0, 0.6, 3)
    mesh = skfem.MeshHex.init_tensor(*axes).to_meshtet()
    names = {"in": lambda x: x[0] == low, "out": lambda x: x[0] == high}
    names |= {"y-": lambda x: x[1] == 0, "x-": lambda x: x[1] == np.pi / 2}
    names |= {"z-": lambda x: x[2] == 0, "z+": lambda x: x[2] == 0.6}
    named = mesh.with_boundaries(names)
    r, a, z = (mesh := skfem.MeshTet2.from_mesh(mesh)).doflocs
    a = a + 0.1 * z * a * (np.pi / 2 - a) * (0.6 - z)
    places = np.stack([r * np.cos(a), r * np.sin(a), z])
    return replace(mesh, doflocs=places, _boundaries=named.boundaries)


def test_a_tie_between_two_planes_that_hold_both_bodies_asks_nothing_of_what_they_hold():
    """The mesh leans normals at the ends; along them the tie would ask what nothing can move."""
    held = tuple(Support(f"{name}", {name[0]: 0.0}) for name in ("x-", "y-", "z-", "z+"))
    parts = [
        Part("inner", tube(0.5, 1.001, 9), Material(100.0, 0.3), held, contact="out"),
        Part("outer", tube(1.0, 2.0, 5), Material(50.0, 0.3), held, contact="in"),
    ]
    tie = (Contact("inner", "outer", law="tied"),)
    found = reduce_bodies(Scene("tube", bodies=tuple(parts), contacts=tie, degree=2, kind="solid"))
    (coupling,) = found.couplings
    ends = np.isin(coupling.positions[2].round(9), (0.0, 0.6))
    assert ends.sum() == 20 and not coupling.frames[ends, 0, 2].any()
    assert solve(found.problem).solved
