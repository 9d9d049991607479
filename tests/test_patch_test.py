"""Every coupling is asked whether a constant pressure gives both sides their consistent forces."""

from dataclasses import replace

import numpy as np
import pytest
import turned
from mortar_scenes import press_fit

from contactopt import (
    Contact,
    Material,
    Part,
    Pressure,
    Scene,
    Support,
    Traction,
    reduce_bodies,
    run,
)
from contactopt.coupling.patch_test import misfit
from contactopt.figures.scene_check import check_scene
from contactopt.meshes.structured import rename, simplices, tensor_mesh

MATERIAL = Material(1e4, 0.3)


def cube(low: float, shape: str, cells: int = 3):
    """A unit cube of hexahedra, of tetrahedra, or of tetrahedra mirrored in the plane x = 1/2."""
    grid = np.linspace(0.0, 1.0, cells + 1)
    mesh = tensor_mesh(grid, grid, low + grid)
    names = {"left": "x-", "front": "y-", "bottom": "z-", "top": "z+"}
    if shape == "hexahedra":
        return rename(mesh, **names)
    mesh = simplices(rename(mesh, **names))
    if shape == "mirrored":
        p = mesh.p.copy()
        p[0] = 1 - p[0]
        middle = {name: p[:, mesh.facets[:, f]].mean(axis=1) for name, f in mesh.boundaries.items()}
        del middle["left"]
        mesh = type(mesh)(p, mesh.t)
        ends = {"left": (0, 0.0), "front": (1, 0.0), "bottom": (2, low), "top": (2, low + 1)}
        mesh = mesh.with_boundaries(
            {name: (lambda x, a=a, v=v: np.abs(x[a] - v) < 1e-9) for name, (a, v) in ends.items()}
        )
    return mesh


def cubes(shapes: tuple[str, str], degree: int = 1, **contact) -> Scene:
    """A cube pressed on another one by a pressure of one; the exact stress is uniaxial."""
    sides = Support("left", {"x": 0.0}), Support("front", {"y": 0.0})
    upper = Part(
        "upper", cube(1.0, shapes[0]), MATERIAL, sides, (Traction("top", (0, 0, -1.0)),), "bottom"
    )
    floor = (*sides, Support("bottom", {"z": 0.0}))
    lower = Part("lower", cube(0.0, shapes[1]), MATERIAL, floor, contact="top")
    mu = 0.3 if contact.get("law", "coulomb") == "coulomb" else 0.0
    pair = Contact("upper", "lower", **{"mu": mu} | contact)
    return Scene("cubes", bodies=(upper, lower), contacts=(pair,), kind="solid", degree=degree)


@pytest.mark.parametrize("law", ["coulomb", "tied", "frictionless"])
@pytest.mark.parametrize(
    "shapes", [("mirrored", "tetrahedra"), ("tetrahedra", "hexahedra"), ("hexahedra", "tetrahedra")]
)
def test_nodes_that_match_without_their_facets_pass_a_constant_pressure_on(shapes, law):
    result = run(cubes(shapes, law=law), figures=())
    assert np.abs(result.pressure - 1).max() < 1e-9
    assert max(np.abs(fields.von_mises - 1).max() for fields in result.fields) < 1e-8
    made = result.reduction.coupling
    assert made.kind == "mortar" and "the nodes match, but a constant pressure" in made.why
    assert not result.summary["remarks"]
    assert result.summary["pairs"]["upper-lower"]["coupled_because"] == made.why


def trapezium(low: float, high: float, rise: float, cells: int, shape: str):
    """A block 1 wide whose face at the height 1 rises by `rise`."""
    grid = np.linspace(0.0, 1.0, cells + 1)
    mesh = tensor_mesh(grid, low + (high - low) * grid)
    mesh = rename(mesh, left="x-", right="x+", bottom="y-", top="y+")
    mesh = simplices(mesh) if shape == "triangles" else mesh
    x, y = mesh.p
    p = np.stack([x, y + rise * x * (1 - abs(y - 1))])
    return replace(mesh, doflocs=p)


@pytest.mark.parametrize("law", ["coulomb", "frictionless"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("rise", [0.01, -0.5])
@pytest.mark.parametrize("shapes", ["triangles", "quadrilaterals"])
@pytest.mark.parametrize("cells", [(3, 3), (4, 3)])
def test_a_slanted_surface_that_ends_on_rollers(law, degree, rise, shapes, cells):
    """Pressed from all sides, the stress is uniform. An edge is no plane of symmetry."""
    left, parts = Support("left", {"x": 0.0}), []
    for name, low, number in (("upper", 1.0, cells[0]), ("lower", 0.0, cells[1])):
        mesh = trapezium(low, low + 1, rise, number, shapes)
        loads = [Pressure(side, 1.0) for side in ("right", "top")[: 1 + (low > 0)]]
        hold = (left,) if low else (left, Support("bottom", {"y": 0.0}))
        end = "bottom" if low else "top"
        parts.append(Part(name, mesh, MATERIAL, hold, tuple(loads), contact=end))
    pair = Contact("upper", "lower", mu=0.0 if law == "frictionless" else 0.3, law=law)
    scene = Scene("slanted", bodies=tuple(parts), contacts=(pair,), degree=degree)
    result = run(scene, figures=(), tol=1e-11)
    assert result.solution.solved
    if law == "frictionless" or cells[0] != cells[1]:  # friction shares the force of the corner
        assert np.abs(result.pressure - 1).max() < 1e-6
    for fields in result.fields:
        assert np.abs(fields.stress - [-1, -1, -0.6, 0]).max() < 1e-6


@pytest.mark.parametrize("law", ["tied", "coulomb"])
def test_a_node_on_a_support_sees_the_face_that_it_lies_on(law):
    """Hexahedra of uneven sizes carry the contacts, on tetrahedra; the stress is uniform."""
    x, y, z = [0, 0.7023, 1.3808, 2], [0, 0.5752, 1.3402, 2], [1, 1.356, 1.6583, 2]
    upper = tensor_mesh(*map(np.array, (x, y, z)))
    grid = np.linspace(0.0, 2.0, 4)
    lower = tensor_mesh(grid, grid, grid / 2).to_meshtet()
    ends = (
        (f"{axis}{side}", i, v) for i, axis in enumerate("xyz") for side, v in (("-", 0), ("+", 2))
    )
    lower = lower.with_boundaries(
        {name: lambda x, i=i, v=v: np.abs(x[i] - v / (1 + (i == 2))) < 1e-9 for name, i, v in ends}
    )
    sides = Support("x-", {"x": 0.0}), Support("y-", {"y": 0.0})
    push = Pressure("x+", 1.0), Pressure("y+", 1.0)
    bodies = (
        Part("upper", upper, MATERIAL, sides, (*push, Pressure("z+", 1.0)), "z-"),
        Part("lower", lower, MATERIAL, (*sides, Support("z-", {"z": 0.0})), push, "z+"),
    )
    pair = Contact("upper", "lower", mu=0.5 * (law == "coulomb"), law=law)
    result = run(
        Scene("boxes", bodies=bodies, contacts=(pair,), kind="solid", degree=2), figures=()
    )
    assert np.abs(result.pressure - 1).max() < 1e-8
    assert max(np.abs(own.stress - [-1, -1, -1, 0, 0, 0]).max() for own in result.fields) < 1e-7


def test_matching_that_was_asked_for_fails_with_the_place_and_the_number():
    scene = cubes(("mirrored", "tetrahedra"), coupling="matching")
    said = "coupled by matching: a constant pressure gives body 'upper' wrong forces near"
    assert any(said in text for text in run(scene, figures=()).summary["remarks"])
    checked = check_scene([scene])
    assert any(said in note for note in checked.notes)
    assert "by matching because the scene asks for it" in checked.text
    same = reduce_bodies(cubes(("tetrahedra",) * 2, coupling="matching")).coupling
    assert same.conforming and not same.remarks


def test_a_search_goes_through_the_same_check():
    result = run(
        cubes(("tetrahedra", "hexahedra"), mu=0.0),
        figures=(),
        accuracy=1e-3,
        quantity="pressure",
        adaptive=True,
    )
    assert result.estimate.reached and result.estimate.value == pytest.approx(1, abs=1e-8)
    assert len(result.estimate.levels) > 1 and not result.summary["remarks"]


def asked(scene, **options):
    """What the check says of a scene of one pair, and the coupling with its surfaces."""
    reduction = reduce_bodies(scene, **options)
    made, bodies = reduction.coupling, []
    for body, part in zip(reduction.bodies, scene.parts):
        from contactopt.bodies.assembled_elastic import AssembledElastic

        bodies.append(AssembledElastic(body.body, part))
    names = scene.pairs[0].surfaces
    return made, tuple(body.surface(name) for body, name in zip(bodies, names))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("side", ["upper", "lower"])
@pytest.mark.parametrize("wrong", ["lost", "twice", "moved"])
def test_a_wrong_mortar_is_found(monkeypatch, degree, side, wrong):
    """Force of one contact is lost, counted twice, or acts on nodes next to those it should."""
    made, surfaces = asked(cubes(("tetrahedra", "hexahedra"), degree, coupling="mortar"))
    assert misfit(made, surfaces) is None
    inner = int(np.argmin(np.linalg.norm(made.positions[:2] - 0.5, axis=0)))
    far = int(np.argmax(np.linalg.norm(made.positions[:2] - 0.5, axis=0)))
    T = getattr(made, side).tolil()
    row = 3 * inner
    if wrong == "moved":
        T[row] = 0.9 * T[row] + 0.1 * T[3 * far]
    else:
        T[row] = (0.9 if wrong == "lost" else 1.1) * T[row]
    found = misfit(replace(made, **{side: T.tocsr()}), surfaces)
    assert found is not None and found.side == ("upper", "lower").index(side)
    assert 0.01 < found.error < 1


@pytest.mark.parametrize("coupling", [None, "mortar"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("sectors", [8, 24])
def test_curved_pairs_that_are_right_are_not_complained_about(sectors, degree, coupling):
    for clearance in (0.0, 0.5, 2.0):
        scene = turned.pin_in_bush(clearance=clearance, sectors=sectors)
        assert not reduce_bodies(replace(scene, degree=degree), coupling=coupling).coupling.remarks
    for ratio in ((sectors, sectors + 3), (sectors, 2 * sectors)):
        scene = press_fit(ratio, degree, 0.001, degree == 1, degree == 2)[0]
        assert not reduce_bodies(scene).coupling.remarks


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("overlap", [-1e-3, 1e-5, 3e-3])
def test_a_press_fit_of_straight_meridians_is_not_complained_about(degree, overlap):
    """A gap changes the circles around the axis, and with them the areas, on straight lines too."""
    shaft = tensor_mesh(np.linspace(0.5, 1 + overlap, 5), np.linspace(0, 1, 5))
    hub = simplices(tensor_mesh(np.linspace(1, 2, 6), np.linspace(0, 1, 6)))
    bodies = (
        Part("shaft", rename(shaft, skin="x+"), MATERIAL, (Support("y-", {"z": 0}),), (), "skin"),
        Part("hub", rename(hub, bore="x-"), MATERIAL, (Support("y-", {"z": 0}),), (), "bore"),
    )
    pair = Contact("hub", "shaft", 0.2)
    scene = Scene("fit", bodies=bodies, contacts=(pair,), kind="axisymmetric", degree=degree)
    assert not [note for note in check_scene([scene]).notes if "constant pressure" in note]


@pytest.mark.parametrize("edge", [0.05, 0.1, 0.15])
def test_a_ring_that_begins_within_the_face_at_the_axis_is_not_complained_about(edge):
    """At 0.1 the part that is covered has the integral of the whole, because of its weight r."""
    ring = tensor_mesh(np.array([edge, 1.6]), np.array([1.0, 2.0]))
    disc = tensor_mesh(np.array([0, 0.2, 1, 2]), np.array([0.0, 1.0]))
    bodies = (
        Part("ring", ring, MATERIAL, (), (Traction("y+", (0, -1.0)),), "y-"),
        Part("disc", disc, MATERIAL, (Support("y-", {"z": 0}),), (), "y+"),
    )
    pair = Contact("ring", "disc", 0.2)
    scene = Scene("ring", bodies=bodies, contacts=(pair,), kind="axisymmetric")
    assert not reduce_bodies(scene).coupling.remarks
