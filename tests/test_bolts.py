"""Bolts: equal and opposite loads on two faces, against tractions, plates, statics and CalculiX."""

from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTet

import contactopt
from contactopt import Bolt, InputError, Material, Part, Plate, Scene, Support, Traction
from contactopt.holding.grown_load import load_rows
from contactopt.readings.resultants import columns, pair_resultants
from contactopt.scenes.loads.load import Face
from contactopt.scenes.parameters import parameter
from contactopt.scenes.scene_files import read_scene_file
from contactopt.simplification.search import simplify
from tests.test_calculix_deck import differences, needs_ccx
from tests.turned import turn_about

STEEL, F, MU = Material(210e3, 0.3), 20.0, 0.9
FACES = ("up.head", "down.nut")


def block(mesh, low, high, turned=None, across=4):
    """A block 2 wide between two heights, with the face of a bolt in its middle, above or below."""
    counts = (across, 4, 2)
    sides = (np.linspace(0, 2, counts[0] + 1), np.linspace(0, 1, counts[1] + 1))
    up = np.linspace(low, high, counts[2] + 1)
    made = mesh.init_tensor(*(sides if mesh is not MeshQuad else sides[:1]), up)
    outer, inner = (high, low) if low else (low, high)
    z = made.dim() - 1
    named = {
        "head" if low else "nut": lambda x: (x[z] == outer) & (abs(x[0] - 1) < 0.51),
        "contact": lambda x: x[z] == inner,
        "side": lambda x: (x[0] == 0) & (abs(x[z] - outer) < 0.51),
    }
    made = made.with_boundaries(named)
    return made if turned is None else replace(made, doflocs=turned @ made.p)


def clamp(mesh=MeshHex, turned=None, loads=((), ()), bolts=(), kind="solid", across=8):
    """A block that only contact and a bolt hold, on a block that is clamped at its side."""
    upper, lower = block(mesh, 1, 2, turned), block(mesh, 0, 1, turned, across)
    parts = (
        Part("up", upper, STEEL, (), loads[0]),
        Part("down", lower, STEEL, (Support("side"),), loads[1]),
    )
    return Scene("clamp", *parts, MU, kind=kind).with_bolts(bolts)


def test_a_scene_lists_its_bolts():
    """As they are now: a copy of the scene keeps them, and a changed force is that of the list."""
    assert clamp().bolts == ()
    bolted = clamp(bolts=(Bolt(FACES, F, "m4", False), Bolt(FACES, 2 * F, direction=(0, 0, 1))))
    one, two = bolted.bolts
    assert one == Bolt(FACES, F, "m4", False)
    assert two == Bolt(FACES, 2 * F, "bolt2", direction=(0, 0, 1))
    assert replace(bolted, mu=0.1).bolts == bolted.bolts
    assert clamp().with_bolts(bolted.bolts).bolts == bolted.bolts
    assert bolted.with_bolts(()).bolts == ()
    changed = bolted.with_parts(
        lambda part: replace(part, loads=tuple(load.with_values({"": 3.0}) for load in part.loads))
    )
    assert [own.force for own in changed.bolts] == [3.0, 3.0]


def test_stiff_bolts_whose_faces_share_nodes_are_named():
    bolts = Bolt(FACES, F, "m4", False), Bolt(FACES, F, "m5", False)
    words = (
        "the bolt 'm4' and bolt 'm5', whose face 'head' stays parallel, moves in x, but the same"
    )
    with pytest.raises(InputError, match=words):
        contactopt.reduce(clamp(bolts=bolts))
    scene = clamp()
    mesh = scene.upper.mesh.with_boundaries({"beside": lambda x: (x[2] == 2) & (x[0] > 1.49)})
    scene = replace(scene, upper=replace(scene.upper, mesh=mesh))
    both = bolts[0], Bolt(("up.beside", "down.nut"), F, "m5", False, (0, 0, 1))
    words = (
        "the bolt 'm5', whose face 'beside' .* but the bolt 'm4', whose face 'head' .*let a bolt"
    )
    with pytest.raises(InputError, match=words):
        contactopt.reduce(scene.with_bolts(both))


@pytest.mark.parametrize("tilting", [True, False])
@pytest.mark.parametrize(
    "mesh, kind", [(MeshHex, "solid"), (MeshTet, "solid"), (MeshQuad, "plane-strain"),
                   (MeshQuad, "axisymmetric")],
)  # fmt: skip
def test_contact_carries_the_force_of_the_bolt(mesh, kind, tilting):
    """By hand, the faces have traction F / area, or they are plates that move freely."""
    bolted = clamp(mesh, bolts=(Bolt(FACES, F, "m4", tilting),), kind=kind)
    area = {"solid": 1.0, "plane-strain": 1.0, "axisymmetric": np.pi * (1.5**2 - 0.5**2)}[kind]
    axes = bolted.components
    free = axes[-1:] if kind == "axisymmetric" else axes
    loads = []
    for name, sign in (("head", -1.0), ("nut", 1.0)):
        force = {c: sign * F * (c == axes[-1]) for c in axes}
        loads.append((
            Traction(name, tuple(f / area for f in force.values())) if tilting
            else Plate(name, {c: force[c] for c in free}),
        ))  # fmt: skip
    one, two = (contactopt.run(s) for s in (bolted, clamp(mesh, loads=loads, kind=kind)))
    assert one.solution.solved and two.solution.solved
    (own,) = pair_resultants(one.reduction, one.solution).values()
    assert np.allclose(own.force, F * np.eye(len(axes))[-1], rtol=0, atol=1e-9 * F)
    assert np.allclose(one.solution.reactions, two.solution.reactions, rtol=0, atol=1e-8 * F)
    assert columns(one.reduction, one.solution)["bolt:m4"] == F


def test_rounding_in_the_normal_of_a_bolt_moves_no_face():
    """A stiff head stays where nothing holds it: a mean normal of (3e-17, 1) is (0, 1)."""
    low, high = (
        Face(np.array([x, 1.0]), 1.0, np.zeros(2), ("x", "y"), frozenset()) for x in (3e-17, 1e-6)
    )
    end = clamp(bolts=(Bolt(FACES, F, tilting=False),)).bolt_ends["bolt1"][0][1]
    assert end.on(low).force == {"x": 0.0, "y": -F} and end.on(high).force["x"] == -1e-6 * F


@pytest.mark.parametrize("bolt", [
    Bolt(FACES, F), Bolt(FACES, F, tilting=False),
])  # fmt: skip
def test_a_turned_clamp_has_the_turned_forces(bolt):
    R = turn_about((1.0, 2.0, 3.0), 40.0)
    one, two = (contactopt.run(clamp(turned=T, bolts=(bolt,))) for T in (None, R))
    assert np.allclose(
        one.solution.reactions[:, 0], two.solution.reactions[:, 0], rtol=0, atol=1e-8 * F
    )
    along = replace(bolt, direction=tuple(R @ [0.0, 0.0, -3.0]))
    three = contactopt.run(clamp(turned=R, bolts=(along,)))
    assert np.allclose(two.solution.reactions, three.solution.reactions, rtol=0, atol=1e-8 * F)


def halves(mesh):
    """The mesh with the two halves of its bolt's face as boundaries of their own."""
    name = "head" if "head" in mesh.boundaries else "nut"
    facets = np.asarray(mesh.boundaries[name])
    y = mesh.p[1, mesh.facets[:, facets]].mean(axis=0)
    return mesh.with_boundaries({f"{name}1": facets[y < 0.25], f"{name}2": facets[y > 0.75]})


@pytest.mark.parametrize("tilting", [True, False])
@pytest.mark.parametrize("two", [False, True])
def test_half_a_clamp_has_half_of_its_bolt_or_one_of_two(two, tilting):
    bolts = (Bolt(FACES, F, tilting=tilting),)
    if two:
        bolts = tuple(Bolt((f"up.head{i}", f"down.nut{i}"), F / 2, tilting=tilting) for i in (1, 2))
    whole = clamp(across=4)
    whole = whole.with_parts(lambda part: replace(part, mesh=halves(part.mesh)))
    whole = whole.with_bolts(bolts)
    half = simplify(whole).scene
    assert half.copies == 2 and len(half.bolt_ends) == 1
    one, other = (contactopt.run(scene) for scene in (whole, half))
    assert abs(other.summary["max_pressure"] / one.summary["max_pressure"] - 1) < 1e-7
    assert abs(other.summary["normal_force"] / F - 1) < 1e-9


@pytest.mark.parametrize("way", [None, (0.0, 1.0)])
def test_a_mirror_that_swaps_the_ends_of_a_bolt_is_refused(way):
    """A block against a wall, squeezed across: the plane in its middle would cut the bolt."""
    mesh = block(MeshQuad, 1, 2)
    nut = mesh.p[:, mesh.facets].mean(axis=1)
    nut = np.flatnonzero((nut[1] == 1) & (abs(nut[0] - 1) < 0.5))
    mesh = mesh.with_boundaries({"wall": lambda x: x[0] == 0, "push": lambda x: x[0] == 2})
    mesh = mesh.with_boundaries({"nut": nut})
    load = (Traction("push", (-1.0, 0.0)),)
    part = Part("up", mesh, STEEL, (), load, contact="wall")
    scene = Scene("s", part, contactopt.Rigid("wall"), 0.3)
    assert simplify(scene).scene.copies == 2
    found = simplify(scene.with_bolts((Bolt(("up.head", "up.nut"), F, direction=way),)))
    assert found.scene.copies == 1 and "bolt 'bolt1' has 1 end" in "".join(found.notes)


def test_a_bolt_is_a_parameter_with_a_derivative():
    """Without gaps all forces grow with F, and the energy with its square."""
    bolts = (Bolt(FACES, F, "m4"),)
    scene = clamp(MeshQuad, bolts=bolts, kind="plane-strain", across=4)
    own = parameter("bolt:m4", scene)
    assert own.read(scene) == F and own.read(own.put(scene, F + 0.01)) == F + 0.01
    with pytest.raises(InputError, match="it has no such bolt"):
        parameter("bolt:m5", scene)
    result = contactopt.run(scene)
    for quantity, power in (("energy", 2), ("pressure", 1)):
        found = contactopt.gradient(result, quantity, "bolt:m4")
        assert found.by["bolt:m4"] == pytest.approx(power * found.value / F, rel=1e-6)


@pytest.mark.slow
def test_a_bolted_joint_slides_at_mu_times_the_force_of_its_bolt():
    bolts = (Bolt(FACES, F, "m4"),)
    scene = clamp(MeshQuad, bolts=bolts, kind="plane-strain", across=4)
    pushed = scene.with_parts(
        lambda part: replace(part, loads=(*part.loads, Traction("side", (0.01, 0.0))))
        if part.name == "up" else part
    )  # fmt: skip
    assert set(load_rows(pushed)) == {"up:side:x", "up:side:y", "bolt:m4"}
    assert contactopt.limit(pushed, "up:side:x").factor == pytest.approx(MU * F / 0.005, rel=1e-3)


TOML = """
kind = "plane-strain"
steps = ["tighten", "push"]
[[bolts]]
between = ["up.per.y+", "down:y-"]
force = [20.0, 20.0]
{more}
[bodies."up.per"]
block = {{ x = [0, 2], y = [1, 2], elements = [4, 2] }}
material = {{ E = 210e3, nu = 0.3 }}
contact = "y-"
tractions = [{{ boundary = "x-", x = [0.0, 1.0] }}]
[bodies.up]
rigid = {{ gap = 100.0 }}
[bodies.down]
block = {{ x = [0, 2], y = [0, 1], elements = [8, 2] }}
material = {{ E = 210e3, nu = 0.3 }}
contact = "y+"
supports = [{{ boundary = "x-" }}]
[[contacts]]
upper = "up.per"
lower = "down"
mu = 0.3
[[contacts]]
upper = "up.per:x+"
lower = "up"
mu = 0.0
"""


def test_a_file_gives_bolts_and_their_path(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(TOML.format(more="tilting = false\nname = 'm4'\ndirection = { y = 1 }"))
    states = read_scene_file(file).states
    ends = [state.bolt_ends["m4"] for state in states]
    assert [[(part.name, end.boundary, end.pull) for part, end in own] for own in ends] == [
        [("up.per", "y+", F), ("down", "y-", F)]
    ] * 2
    assert ends[0][0][1].direction == (0.0, 1.0) and not ends[0][0][1].tilting


@pytest.mark.parametrize("old, new, words", [
    ('"down:y-"', '"y-"', "line 4: bolt 'bolt1': 'y-' begins with the name of no body"),
    ('"down:y-"', '"down.low"', "line 5: body 'down' has no boundary 'low'"),
    ('"down:y-"', '"up.y-"', "line 4: bolt 'bolt1': body 'up' has no mesh"),
    (', "down:y-"', "", "a bolt is between two faces"),
    ("[20.0, 20.0]", "-1", "at least 0; got -1"),
    ("force = [20.0, 20.0]", "", "line 4: a bolt needs its force"),
    ('down:y-', "down:x-", "are not opposite; name two faces"),
    ('["up.per.y+", "down:y-"]', '["up.per.y-", "down.y+"]', "look at each other"),
    ("x = [0, 2], y = [0, 1]", "x = [0.2, 2.2], y = [0, 1]", "0.2 length beside each other"),
    ("", "direction = { x = 1 }", "lies in the face 'y.'"),
])  # fmt: skip
def test_bolts_that_cannot_be_meant_are_refused(old, new, words, tmp_path):
    file, text = tmp_path / "scene.toml", TOML.format(more="" if old else new)
    file.write_text(text.replace(old, new) if old else text)
    with pytest.raises(InputError, match=words):
        contactopt.run(file)


@needs_ccx
@pytest.mark.parametrize("tilting", [True, False])
@pytest.mark.parametrize("mesh, kind", [(MeshTet, "solid"), (MeshQuad, "plane-strain")])
def test_calculix_clamps_as_hard(mesh, kind, tilting, tmp_path):
    """With a push that friction passes on to the support."""
    push = Traction("side", (8.0, 0.0, 0.0)[: 3 if kind == "solid" else 2])
    bolts = (Bolt(FACES, F, tilting=tilting),)
    scene = clamp(mesh, loads=((push,), ()), bolts=bolts, kind=kind, across=4)
    moved, reactions = differences(scene, tmp_path, 1e4)
    assert moved < 0.01 and reactions < 0.01
