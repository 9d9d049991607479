"""A search on meshes of large bodies begins where their small contact is seen."""

from itertools import pairwise

import numpy as np
import pytest
from skfem import MeshTet, MeshTri

import contactopt
from contactopt import Contact, Material, Part, Plate, Rigid, Scene
from contactopt.accuracy.estimate import Judged
from contactopt.accuracy.locally import Locally
from contactopt.meshes.mesh_refinement import divide, graded
from contactopt.readings.quantities import find_quantity
from contactopt.solving.solve_scene import Options

RADIUS, WIDTH, STEEL = 10.0, 0.1, Material(200e3, 0.3)


def test_the_first_mesh_of_a_roller_sees_a_contact_of_a_twentieth_of_its_elements():
    """Hertz: F = pi E* b^2 / (4 R) on a length of one, p = 2 F / (pi b)."""
    force = WIDTH**2 * np.pi * STEEL.E / (1 - STEEL.nu**2) / 4 / RADIUS
    mesh = MeshTri.init_circle(3).scaled((RADIUS, RADIUS)).translated((0, RADIUS))
    facets = mesh.boundary_facets()
    height = mesh.p[1, mesh.facets[:, facets]].mean(axis=0)
    mesh = mesh.with_boundaries(
        {"skin": facets[height < RADIUS], "top": facets[height > 1.7 * RADIUS]}
    )
    roller = Part("roller", mesh, STEEL, (), (Plate("top", {"y": -force}),), contact="skin")
    floor = Rigid("floor", gap=lambda x: x[1])
    result = contactopt.run(
        Scene("roller", roller, floor, 0.0), accuracy=0.03, quantity="pressure", adaptive=True
    )
    exact, found = 2 * force / (np.pi * WIDTH), result.estimate
    assert found.reached and abs(found.value / exact - 1) < found.error < 0.03
    assert abs(found.levels[0].value / exact - 1) < 0.2 and len(found.levels) < 7


def test_of_two_small_contacts_only_the_one_that_is_read_is_divided_further():
    """A roller between a floor and a roof; elements at both are divided before the first solve."""
    force = WIDTH**2 * np.pi * STEEL.E / (1 - STEEL.nu**2) / 4 / RADIUS
    mesh = MeshTri.init_circle(3).scaled((RADIUS, RADIUS)).translated((0, RADIUS))
    facets = mesh.boundary_facets()
    height = mesh.p[1, mesh.facets[:, facets]].mean(axis=0)
    names = {"low": facets[height < RADIUS], "high": facets[height > RADIUS]}
    roof = Rigid("roof", (0.0, -1.0), lambda x: 2 * RADIUS - x[1], force={"y": -force})
    bodies = (
        Part("roller", mesh.with_boundaries(names), STEEL),
        Rigid("floor", gap=lambda x: x[1]),
        roof,
    )
    pairs = Contact("roller:low", "floor", 0.1), Contact("roller:high", "roof", 0.1)
    scene = Scene("between", bodies=bodies, contacts=pairs)
    asked = find_quantity(f"pressure:{scene.pairs[0].name}", scene)
    search = Locally((scene,), asked, Options(), False)

    def shortest(height):  # edge near a contact
        mesh = search.states[0].parts[0].mesh
        ends = mesh.p[:, mesh.facets]
        near = np.linalg.norm(ends.mean(axis=1) - [[0.0], [height]], axis=0) < WIDTH
        return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=0)[near].min()

    before = shortest(0.0), shortest(2 * RADIUS)
    assert max(before) < 2 * WIDTH
    solved = search.solve()
    reading = asked.read(solved.reduction, solved.solution)
    search.judge(solved, reading)
    search.advance(Judged(0.0), reading, np.empty(0, dtype=int), ())
    assert shortest(0.0) < 0.6 * before[0] and shortest(2 * RADIUS) == before[1]


def checked(new):
    """The new mesh is conforming, as large, and has the names of the old one where it had them."""
    edges = new.p[:, new.t][:, 1:] - new.p[:, new.t][:, :1]
    assert np.abs(np.linalg.det(np.moveaxis(edges, 2, 0))).sum() / 6 == pytest.approx(1.0)
    outer = new.boundary_facets()
    x = new.p[:, new.facets[:, outer]].mean(axis=1)
    assert np.all(np.any((x < 1e-12) | (x > 1 - 1e-12), axis=0))
    for name, inside in NAMED.items():
        assert set(new.boundaries[name]) == set(outer[inside(x)])


NAMED = {
    "left": lambda x: x[0] < 1e-12,
    "top": lambda x: x[2] > 1 - 1e-12,
    "both": lambda x: (x[0] < 1e-12) | (x[2] > 1 - 1e-12),
}


def test_tetrahedra_are_bisected_without_hanging_nodes_and_keep_their_names():
    mesh = MeshTet().refined(1).with_boundaries(NAMED)
    rng, meshes = np.random.default_rng(0), [mesh]
    for share in (0.1, 0.3, 1.0):
        marked = np.flatnonzero(rng.random(meshes[-1].nelements) < share)
        meshes.append(divide(meshes[-1], marked, {}))
    for old, new in pairwise(meshes):
        checked(new)
        assert old.nelements < new.nelements

    def large(corners):
        away = np.linalg.norm(corners, axis=0).min(axis=0)
        return np.ptp(corners, axis=1).max(axis=0) > 0.05 + 0.5 * away

    fine = graded(mesh, large, {})
    checked(fine)
    assert not large(fine.p[:, fine.t]).any() and fine.nelements < 10_000
