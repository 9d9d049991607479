"""Supports at edges and points, against uniaxial stress and CalculiX."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTet, MeshTri

import contactopt
from contactopt import InputError, Material, Part, Plate, Rigid, Scene, Support, Traction
from contactopt.bodies.body import build_body
from contactopt.figures.check_page import _boundaries
from contactopt.figures.scene_check import check_scene
from contactopt.scenes.scene_files import read_scene_file
from contactopt.simplification.search import simplify
from tests.test_calculix_deck import differences, needs_ccx

STEEL, PULL = Material(210e3, 0.3), 100.0
AXES = "xyz"


def block(mesh, low=0.0):
    """A block of 3 x 2 (x 1) with a boundary on each side."""
    sizes = [3.0, 2.0, 1.0][: 2 if mesh in (MeshQuad, MeshTri) else 3]
    ticks = [np.linspace(0, size, n) for size, n in zip(sizes, (5, 4, 3))]
    ticks[-1] = ticks[-1] + low
    made = mesh.init_tensor(*ticks)
    ends = {f"{c}{sign}": (i, at) for i, c in enumerate(AXES[: len(sizes)])
            for sign, at in (("-", ticks[i][0]), ("+", ticks[i][-1]))}  # fmt: skip
    facets = made.boundary_facets()
    x = made.p[:, made.facets[:, facets]]
    sides = {
        name: facets[np.all(np.abs(x[i] - at) < 1e-9, axis=0)] for name, (i, at) in ends.items()
    }
    return made.with_boundaries(sides)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("mesh", [MeshTri, MeshQuad, MeshTet, MeshHex])
def test_a_pulled_block_on_a_point_and_edges_has_uniaxial_stress(mesh, degree):
    """These supports take no force: u = (x, -nu y, -nu z) PULL / E in space."""
    made = block(mesh)
    dim, kind = made.dim(), "solid" if made.dim() == 3 else "plane-stress"
    point = "/".join(f"{c}-" for c in AXES[:dim])
    supports = [Support(point)]
    if dim == 3:
        supports += [Support("y-/z-", {"y": 0.0, "z": 0.0}), Support("x-/z-", {"x": 0.0, "z": 0.0})]
    else:
        supports += [Support("x+/y-", {"y": 0.0})]
    ends = (("x+", PULL), ("x-", -PULL))
    pull = tuple(Traction(name, (own, 0.0, 0.0)[:dim]) for name, own in ends)
    part = Part("b", made, STEEL, tuple(supports), pull, contact="x+")
    scene = Scene("s", part, Rigid("r"), 0.0, kind=kind, degree=degree)
    own = build_body(scene, part, 1, None)
    U = np.zeros(len(own.load))
    U[own.free] = np.linalg.solve(own.A[own.free][:, own.free].toarray(), own.load[own.free])
    x = own.locations
    exact = np.array([1.0, -0.3, -0.3])[:dim, None] * x * PULL / STEEL.E
    assert np.abs(U[own.unknowns] - exact).max() < 1e-12
    held = np.setdiff1d(own.unknowns, own.free)
    for support in supports:
        there = np.all([x[AXES.index(f[0])] == (3.0 if f == "x+" else 0.0)
                        for f in support.boundary.split("/")], axis=0)  # fmt: skip
        for c in support.displacement or AXES[:dim]:
            assert np.isin(own.unknowns[AXES.index(c)][there], held).all()
    assert 1 + dim <= len(held) < x.shape[1]


def standing(kind, supports):
    """A block under a plate, on another one that stands on these supports."""
    mesh = MeshHex if kind == "solid" else MeshQuad
    z = AXES[2 if kind == "solid" else 1]
    load = (Plate(f"{z}+", {z: -PULL}),)
    upper = Part("up", block(mesh, 1.0 if kind == "solid" else 2.0), STEEL, (), load, f"{z}-")
    lower = Part("down", block(mesh), STEEL, supports, (), f"{z}+")
    return Scene("s", upper, lower, 0.3, kind=kind)


@needs_ccx
@pytest.mark.parametrize("kind, names", [
    ("solid", ("x-/z-", "x+/z-")), ("plane-strain", ("x-/y-", "x+/y-")),
])  # fmt: skip
def test_a_bridge_on_two_edges_bends_as_in_calculix(kind, names, tmp_path):
    scene = standing(kind, tuple(map(Support, names)))
    moved, reactions = differences(scene, tmp_path, 1e4)
    assert moved < 0.01 and reactions < 0.01


def test_a_support_at_an_edge_is_said_drawn_and_refused_where_it_is_unknown():
    scene = standing("solid", (Support("x-/z-"), Support("x+/y-/z-"), Support("x+/y+/z-")))
    check = check_scene((scene,))
    for what in ("an edge", "a point"):
        assert f"holds {what}: the stress of a force there is infinite" in " ".join(check.notes)
    drawn = list(_boundaries(scene, scene.lower, scene.lower.mesh, set()))
    places = {item["name"]: item["places"] for item in drawn if "held" in item}
    assert set(places) == {f"down: {s.boundary} (support)" for s in scene.lower.supports}
    assert np.array_equal(places["down: x+/y-/z- (support)"], [[3.0, 0.0, 0.0]])
    remarks = contactopt.run(scene).summary["remarks"]
    assert any("holds an edge" in remark for remark in remarks)
    assert "Symmetries are not looked for" in " ".join(simplify(scene, solve=False).notes)
    for names, words in (("x-/x+", "share no node"), ("x-/w-", "no boundary named 'w-'")):
        with pytest.raises(InputError, match=words):
            contactopt.reduce(standing("solid", (Support(names), Support("z-"))))


def test_a_file_names_edges_and_points(tmp_path):
    file = tmp_path / "scene.toml"
    text = """
    kind = "plane-strain"
    [bodies.block]
    block = { x = [0, 1], y = [0, 1], elements = [4, 4] }
    material = { E = 5, nu = 0.3 }
    contact = "y-"
    supports = [{ boundary = "x-/y+", x = 0 }]
    [bodies.floor.rigid]
    [[contacts]]
    upper = "block"
    lower = "floor"
    mu = 0.3
    """
    file.write_text(text)
    (state,) = read_scene_file(file).states
    assert state.bodies[0].supports == (Support("x-/y+", {"x": 0.0}),)
    named = replace(state.bodies[0].mesh.with_boundaries({"x-/y+": lambda x: x[0] == 0}))
    assert state.bodies[0].supports[0].faces(named.boundaries) == ("x-/y+",)
    file.write_text(text.replace("x-/y+", "x-/top"))
    with pytest.raises(InputError, match="line 7: the body has no boundary 'top'"):
        read_scene_file(file)
