"""What boundaries stand for: flats, arcs and surfaces between; curves that users give."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from conftest import MATERIAL

from contactopt import InputError, Part, Rigid, Scene, Support, reduce
from contactopt.meshes.cells import straight, volumes
from contactopt.meshes.given_curves import check_curve
from contactopt.meshes.mesh_refinement import (
    TooSmall,
    bent,
    boundary_curves,
    divide,
    named_like,
    split,
)
from contactopt.meshes.polar import ring
from contactopt.meshes.structured import simplices
from contactopt.scenes.refined_scenes import part_curves, split_scene

ANGLES = np.linspace(0, np.pi / 2, 9)  # eight elements a quarter


def volume(mesh):
    return skfem.Basis(mesh, mesh.elem(), intorder=6).dx.sum()


def filleted(outline):
    """Triangles between a line of nodes (2, n) and the same line moved, as a mesh of one layer."""
    n = outline.shape[1]
    inside = outline * 0.8 + 0.2 * np.array([[-1.0], [3.0]])
    quads = np.stack([np.arange(n - 1), np.arange(1, n), n + np.arange(1, n), n + np.arange(n - 1)])
    mesh = skfem.MeshQuad(np.concatenate([outline, inside], axis=1), quads).to_meshtri()
    top = [i for i in mesh.boundary_facets() if np.all(mesh.facets[:, i] < n)]
    return mesh.with_boundaries({"flank": np.array(top)})


def flank(chords, graded):
    """Flat, a quarter circle of radius 1 around (0, 1), flat; the places of the nodes along it."""
    angle = np.linspace(0, 1, chords + 1) ** (1.4 if graded else 1.0) * np.pi / 2
    arc = np.stack([np.sin(angle), 1 - np.cos(angle)])
    first = np.stack([np.linspace(-3, 0, 6)[:-1], np.zeros(5)])
    last = np.stack([np.ones(5), np.linspace(1, 3, 6)[1:]])
    return np.concatenate([first, arc, last], axis=1)


@pytest.mark.parametrize("scale, shift", [(1.0, 0.0), (1e-3, 0.0), (2e4, 3e4)])
@pytest.mark.parametrize("graded", [False, True])
@pytest.mark.parametrize("digits", [6, 17])
@pytest.mark.parametrize("chords", [2, 3, 8])
def test_a_flank_stays_flat_beside_a_fillet_that_is_round(chords, graded, digits, scale, shift):
    random = np.random.default_rng(chords)
    for _ in range(3):
        c, s = np.cos(w := random.uniform(0, 2 * np.pi)), np.sin(w)
        turn = np.array([[c, -s], [s, c]])
        mesh = filleted(flank(chords, graded))
        places = scale * (turn @ mesh.p) + shift
        rounded = np.array([[float(f"{x:.{digits - 1}e}") for x in row] for row in places])
        rounding = 1e-15 * np.abs(places).max() + np.abs(rounded - places).max()
        moved = skfem.MeshTri(rounded, mesh.t).with_boundaries(mesh.boundaries)
        curve = boundary_curves(moved)["flank"]
        fine = split(split(moved, {"flank": curve}), {"flank": curve})
        nodes = np.unique(fine.facets[:, fine.boundaries["flank"]])
        x, y = turn.T @ (fine.p[:, nodes] - shift) / scale
        off = np.where(
            x < 0, np.abs(y), np.where(y > 1, np.abs(x - 1), np.abs(np.hypot(x, y - 1) - 1))
        )
        assert not curve.known and off.max() < 10 * rounding / scale
        again = curve(curve(fine.p[:, nodes]))
        assert np.abs(again - curve(fine.p[:, nodes])).max() < 1e-14 * np.abs(places).max()


def test_an_ellipse_is_met_to_fourth_order_and_not_overshot():
    errors = []
    for n in (40, 80):
        angle = 2 * np.pi * np.arange(n) / n
        mesh = filleted_ring(np.stack([2 * np.cos(angle), np.sin(angle)]))
        curve = boundary_curves(mesh)["outer"]
        ends = mesh.p[:, mesh.facets[:, mesh.boundaries["outer"]]]
        middle = ends.mean(axis=1)
        x, y = curve(middle)
        errors.append(np.abs(np.hypot(x / 2, y) - 1).max())
        assert np.all(np.hypot(x / 2, y) > np.hypot(*(middle / [[2], [1]])))
    assert errors[0] < 2e-4 and errors[0] / errors[1] > 12


def filleted_ring(outline):
    n = outline.shape[1]
    after = np.roll(np.arange(n), -1)
    quads = np.stack([np.arange(n), after, n + after, n + np.arange(n)])
    mesh = skfem.MeshQuad(np.concatenate([outline, outline / 2], axis=1), quads)
    facets = mesh.boundary_facets()
    outer = facets[np.all(mesh.facets[:, facets] < n, axis=0)]
    return mesh.with_boundaries({"outer": outer})


@pytest.mark.parametrize("sides", [3, 4, 6, 8])
def test_a_polygon_with_large_turns_is_a_polygon(sides):
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = filleted_ring(np.stack([np.cos(angle), np.sin(angle)]))
    assert boundary_curves(circle)["outer"] is None


@pytest.mark.parametrize("kind", ["quadrilaterals", "triangles", "second order"])
def test_halved_meshes_converge_to_the_ring(kind):
    """The boundaries have no names but one: those without a name are curved as well."""
    mesh = ring(np.array([1.0, 1.5, 2.0]), ANGLES)
    mesh = {"quadrilaterals": straight, "triangles": simplices}.get(kind, lambda mesh: mesh)(mesh)
    mesh = (
        mesh.with_boundaries({"inner": mesh.boundaries["inner"]})
        if kind != "second order"
        else mesh
    )
    curves, exact, errors = boundary_curves(mesh), np.pi / 4 * 3, []
    for _ in range(3):
        errors.append(abs(volume(mesh) / exact - 1))
        mesh = split(mesh, curves)
    order = 4 if kind == "second order" else 2
    assert np.log2(errors[0] / errors[1]) > order - 0.1
    assert np.log2(errors[1] / errors[2]) > order - 0.1
    assert curves["inner"].known == (kind == "second order")
    nodes = np.unique(mesh.facets[:, mesh.boundaries["inner"]])
    assert np.abs(np.hypot(*mesh.p[:, nodes]) - 1).max() < 1e-13


def cylinder_sector(n=4):
    flat = skfem.MeshHex.init_tensor(
        np.linspace(0, np.pi / 2, n + 1), np.linspace(1, 2, 3), np.linspace(0, 1, 3)
    )
    a, r, z = flat.p
    names = {"inner": flat.p[1] == 1, "end": flat.p[2] == 0}
    mesh = skfem.MeshHex(np.stack([r * np.cos(a), r * np.sin(a), z]), flat.t)
    facets = mesh.boundary_facets()
    return mesh.with_boundaries(
        {
            name: facets[np.all(there[mesh.facets[:, facets]], axis=0)]
            for name, there in names.items()
        }
    )


@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
def test_solids_converge_to_the_cylinder_with_flat_ends(kind):
    w = 0.7
    turn = np.array([[1, 0, 0], [0, np.cos(w), -np.sin(w)], [0, np.sin(w), np.cos(w)]])
    mesh = cylinder_sector()
    mesh = mesh if kind == "hexahedra" else simplices(mesh)
    mesh = type(mesh)(turn @ mesh.p + 3, mesh.t).with_boundaries(mesh.boundaries)
    curves, exact = boundary_curves(mesh), np.pi / 4 * 3
    assert curves["end"] is None and not curves["inner"].known
    fine = split(mesh, curves)
    assert abs(volume(fine) / exact - 1) < 0.3 * abs(volume(mesh) / exact - 1)
    x, y, z = turn.T @ (fine.p - 3)
    inner, end = (np.unique(fine.facets[:, fine.boundaries[name]]) for name in ("inner", "end"))
    assert np.abs(np.hypot(x, y)[inner] - 1).max() < 1e-12 and np.abs(z[end]).max() < 1e-13
    curved = bent(mesh, curves)
    assert abs(volume(curved) / exact - 1) < 2e-3
    assert np.all(np.ptp(np.sign(volumes(curved)), axis=1) == 0)
    assert boundary_curves(curved)["inner"].known and boundary_curves(curved)["end"] is None


def test_balls_of_either_order_and_patches_that_are_none():
    for ball, error in ((skfem.MeshTet.init_ball(2), 0.05), (skfem.MeshTet2.init_ball(1), 0.01)):
        curves = boundary_curves(ball)
        fine = split(ball, curves)
        nodes = np.unique(fine.facets[:, fine.boundary_facets()])
        assert np.abs(np.linalg.norm(fine.p[:, nodes], axis=0) - 1).max() < 1e-12
        assert abs(volume(fine) / (4 / 3 * np.pi) - 1) < error
        egg = np.array([[1.0], [1.3], [1.7]])
        stretched = type(ball)(ball.doflocs * egg, ball.t)
        places = split(stretched, boundary_curves(stretched))
        nodes = np.unique(places.facets[:, places.boundary_facets()])
        off = np.abs(np.linalg.norm(places.p[:, nodes] / egg, axis=0) - 1).max()
        chords = split(straight(stretched), {})
        assert off < 0.2 * np.abs(np.linalg.norm(chords.p[:, nodes] / egg, axis=0) - 1).max()


def test_refinement_towards_a_point_ends_with_a_sentence():
    mesh = skfem.MeshTri().with_boundaries({"low": lambda x: x[1] == 0})
    with pytest.raises(
        TooSmall, match="cannot be divided further: they are as small as rounding allows"
    ):
        for _ in range(80):
            mesh = divide(
                mesh, np.flatnonzero(np.any(np.all(mesh.p[:, mesh.t] == 0, axis=0), axis=0)), {}
            )
    assert np.abs(volumes(mesh)).min() > 0


def roller(curve):
    mesh = ring(np.array([10.0, 15.0, 20.0]), np.linspace(-np.pi, 0, 33))
    part = Part("roller", mesh, MATERIAL, (Support("inner"),), contact="outer", curve=curve)
    return Scene("roller", part, Rigid("floor", (0.0, -1.0), lambda x: x[1] + 20), mu=0.0)


@pytest.mark.parametrize("curve, words", [
    (lambda x: 22 * x / np.hypot(*x), "is not that of the mesh: near .* it is 2 away"),
    (lambda x: 20.1 * x / np.hypot(*x), "is not that of the mesh: near .* it is 0.1 away"),
    (lambda x: x * np.nan, "gives no numbers for the point"),
    (lambda x: x[0], r"must return an array of the shape"),
    (lambda x: x / {}[0], "failed: KeyError"),
])  # fmt: skip
def test_wrong_curves_are_refused_in_a_sentence(curve, words):
    with pytest.raises(InputError, match=f"curve of boundary 'outer' of body 'roller' {words}"):
        reduce(roller(curve))


def test_scenes_are_halved_with_the_curves_that_they_give():
    given = roller(lambda x: 20 * x / np.hypot(*x))
    fine = split_scene(given, 8, 2)
    mesh = fine.upper.build_mesh(8, None)
    assert mesh.nelements == 16 * given.upper.mesh.nelements
    assert type(mesh) is type(given.upper.mesh)
    assert part_curves(given.upper, given.upper.mesh)["outer"].known
    nodes = mesh.dofs.get_facet_dofs(mesh.boundaries["outer"]).flatten()
    assert np.abs(np.hypot(*mesh.doflocs[:, nodes]) - 20).max() < 1e-12


@pytest.mark.parametrize("dim", [2, 3])
def test_facets_of_strongly_graded_meshes_keep_their_names(dim):
    """Near the long facets of the floor lie small ones of the walls, with nearer centres."""
    heights = np.array([0.0, *np.geomspace(1e-6, 1, 25)])
    kind = skfem.MeshTri if dim == 2 else skfem.MeshTet
    mesh = kind.init_tensor(*[np.array([0.0, 1.0])] * (dim - 1), heights)
    sides = {"floor": (dim - 1, 0.0), "wall": (0, 0.0)}
    mesh = mesh.with_boundaries(
        {name: lambda x, i=i, at=at: np.abs(x[i] - at) < 1e-12 for name, (i, at) in sides.items()}
    )
    fine = named_like(mesh, replace(mesh, _boundaries=None).refined(2))
    outer = fine.boundary_facets()
    for name, (i, at) in sides.items():
        flat = (np.abs(fine.p[i, fine.facets[:, outer]] - at) < 1e-12).all(axis=0)
        assert np.array_equal(fine.boundaries[name], outer[flat])


def round_body(shape, second, n=5):
    """A quarter of a body of revolution about z between two planes through the axis."""
    radius = {
        "cone": lambda z: 2 - 0.4 * z,
        "torus": lambda z: 1 + np.sqrt(1 - (z - 0.5) ** 2),
        "groove": lambda z: 3 - np.sqrt(1 - (z - 0.5) ** 2),
        "spline": lambda z: 2 + 0.2 * np.sin(2 * z),
    }[shape]
    mesh = skfem.MeshTet.init_tensor(
        np.linspace(0, np.pi / 2, n + 1), np.linspace(0, 1, 3), np.linspace(0, 1, 4)
    ).with_boundaries({"outer": lambda x: x[1] == 1, "foot": lambda x: x[2] == 0})
    if second:
        mesh = replace(skfem.MeshTet2.from_mesh(mesh), _boundaries=mesh.boundaries)
    a, depth, z = mesh.doflocs
    r = radius(z) - 0.8 * (1 - depth)
    made = replace(mesh, doflocs=np.stack([r * np.cos(a), r * np.sin(a), z]))
    return made, lambda x: np.hypot(x[0], x[1]) - radius(x[2])


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("shape", ["cone", "torus", "groove", "spline"])
def test_surfaces_that_are_no_spheres_are_met_up_to_their_rims(shape, second):
    """New nodes are far nearer to the surface than the chords are, those on the rims too."""
    mesh, off = round_body(shape, second)
    curves = boundary_curves(mesh)
    fine = straight(mesh)
    chords = split(fine, {})
    for _ in range(2):
        fine = split(fine, curves)
        check_curve(curves["outer"], fine, "outer")
    assert curves["foot"] is None
    outer, flat = (np.unique(fine.facets[:, fine.boundaries[name]]) for name in ("outer", "foot"))
    height = np.abs(off(chords.p[:, np.unique(chords.facets[:, chords.boundaries["outer"]])])).max()
    assert np.abs(off(fine.p[:, outer])).max() < 0.2 * height
    assert np.abs(fine.p[2, flat]).max() < 1e-12


@pytest.mark.parametrize("shape", ["cone", "groove", "spline"])
def test_what_is_guessed_of_a_surface_has_another_shape(shape):
    """It lies between the guess and the chords, about as far from the guess as that is wrong."""
    mesh, off = round_body(shape, False, n=4)
    curves = boundary_curves(mesh)
    guess, known = curves["outer"], boundary_curves(round_body(shape, True)[0])["outer"]
    facets = mesh.facets[:, mesh.boundaries["outer"]]
    middles = (mesh.p[:, facets] + mesh.p[:, np.roll(facets, 1, axis=0)]).reshape(3, -1) / 2
    error, doubt = np.abs(off(guess(middles))), guess(middles) - guess.other(middles)
    assert known.other is None and curves["foot"] is None
    assert np.abs(doubt).max() > 0.5 * error.max()
    assert np.abs(doubt).max() < 0.8 * np.abs(guess(middles) - middles).max()


def test_a_sphere_and_a_cylinder_have_one_shape():
    assert boundary_curves(simplices(cylinder_sector()))["inner"].other is None
    assert boundary_curves(skfem.MeshTet.init_ball(2))[""].other is None
