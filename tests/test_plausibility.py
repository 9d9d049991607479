"""Input that can be solved and is not what is meant: one sentence, the same in check and in run."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest
import skfem

from contactopt import (
    Contact,
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    run,
)
from contactopt.cli import main
from contactopt.figures.scene_check import check_scene
from contactopt.scenes import SCENES, make_scene
from contactopt.scenes.scene_files import read_scene_file

STEEL = Material(210e3, 0.3)


def block(x, y, n=4):
    mesh = skfem.MeshQuad.init_tensor(np.linspace(*x, n + 1), np.linspace(*y, n + 1))
    return mesh.with_boundaries(
        {"low": lambda p: np.isclose(p[1], y[0]), "up": lambda p: np.isclose(p[1], y[1])}
    )


def pressed(
    upper=((0, 10), (0, 10)),
    lower=((-5, 15), (-10, 0)),
    materials=(STEEL, STEEL),
    load=("up", -10.0),
    units=("mm", "MPa"),
    mesh=None,
):
    one = Part(
        "one",
        block(*upper) if mesh is None else mesh,
        materials[0],
        loads=(Traction(load[0], (0.0, load[1])),),
        contact="low",
    )
    two = Part("two", block(*lower), materials[1], (Support("low"),), contact="up")
    return Scene("s", bodies=(one, two), contacts=(Contact("one", "two", 0.3),), units=units)


def said(scene):
    """What check says; run says it, too."""
    notes = check_scene([scene]).notes
    remarks = run(scene, figures=()).summary["remarks"]
    assert set(notes) <= set(remarks)
    return notes


def test_a_scene_in_which_nothing_pushes():
    asked = "nothing pushes the bodies"
    assert any(asked in note for note in said(pressed(load=("up", 0.0))))
    for scene in (pressed(), pressed(upper=((0, 10), (-1e-4, 10)), load=("up", 0.0))):
        assert not any(asked in note for note in said(scene))
    moved = pressed(load=("up", 0.0))
    sinking = replace(moved.bodies[1], supports=(Support("low", {"y": 1e-3}),))
    assert not any(
        asked in note for note in said(replace(moved, bodies=(moved.bodies[0], sinking)))
    )


def test_a_load_that_is_taken_off_leaves_no_forces_and_no_remark(tmp_path):
    """After friction rounding of the last slip is no overlap."""
    (tmp_path / "s.toml").write_text(
        'units = { length = "mm", stress = "MPa" }\n[bodies.pad]\ncontact = "y-"\n'
        "block = { x = [0, 20], y = [0, 10], elements = [8, 4] }\n"
        'material = { E = 1000, nu = 0.3 }\nsupports = [{ boundary = "x-", x = 0 }]\n'
        'pressures = [{ boundary = "y+", pressure = [10, 20, 0] }]\n[bodies.floor]\nrigid = {}\n'
        '[[contacts]]\nupper = "pad"\nlower = "floor"\nmu = 0.3\n'
    )
    states = read_scene_file(tmp_path / "s.toml").states
    assert not check_scene(states).notes
    result = run(tmp_path / "s.toml", figures=())
    assert result.summary["remarks"] == [] and not np.any(result.solution.reactions)
    assert result.path.history["friction_work"][1] > 0


WRONG = {
    "load on the contact": (dict(load=("low", -10.0)), "the traction on 'low' of body 'one'"),
    "E in Pa": (dict(materials=(Material(210e9, 0.3),) * 2), "stiffer than diamond"),
    "E in Pa and no units": (
        dict(materials=(Material(210e9, 0.3),) * 2, units=("length", "stress")),
        "by about 5e-11 only",
    ),
    "one E in Pa": (
        dict(materials=(Material(210e9, 0.3), STEEL), load=("up", -1e5), units=("a", "b")),
        "1.0e+06 times as stiff",
    ),
    "metres": (dict(upper=((0, 0.01), (0, 0.01))), "body 'two' is 1581 times as large as 'one'"),
    "apart": (dict(upper=((0, 10), (100, 110))), "100 mm or more apart"),
    "overlap": (dict(upper=((0, 10), (-5, 5))), "overlap by up to 5 mm"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_probably_not_meant_is_told_by_check_and_by_run(name):
    changes, words = WRONG[name]
    assert any(words in note for note in said(pressed(**changes)))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("changes", [
    {"load": ("up", -9e69)}, {"upper": ((0, 9e69), (0, 10))}, {"lower": ((-5, 15), (-9e69, 0))},
])  # fmt: skip
def test_the_largest_numbers_make_no_warning(changes):
    with contextlib.suppress(InputError):
        run(pressed(**changes), figures=())


def test_a_plate_on_a_contact_surface_is_told():
    scene = pressed()
    one = replace(scene.bodies[0], loads=(Plate("low", {"y": -100.0}, glued=False),))
    notes = said(replace(scene, bodies=(one, scene.bodies[1])))
    assert any("the plate on 'low' of body 'one'" in note for note in notes)


@pytest.mark.parametrize("kind", ["plane-strain", "plane-stress"])
@pytest.mark.parametrize("depth", [0.01, 10.0])
def test_a_force_strains_a_thick_body_less(kind, depth):
    scene = replace(pressed(), kind=kind, thickness=depth)
    one = replace(scene.bodies[0], loads=(Plate("up", {"y": -1e-3}),))
    notes = said(replace(scene, bodies=(one, scene.bodies[1])))
    assert any("the loads strain body 'one' by about" in note for note in notes) == (depth > 1)


def test_a_supported_point_without_force_has_no_infinite_stress():
    """A block under even pressure on a floor, and one more that is pushed against its pin."""
    scene = pressed()
    sides = {"left": lambda p: np.isclose(p[0], 0), "up": lambda p: np.isclose(p[1], 10)}
    mesh = scene.bodies[0].mesh.with_boundaries(sides)
    for push in (0.0, 1.0):
        loads = (Traction("up", (0.0, -1.0)), Traction("left", (push, 0.0)))
        pin = (Support("left/up", {"x": 0.0}),)
        one = Part("one", mesh, STEEL, pin, loads, contact="low")
        scene = Scene("pinned", one, Rigid("floor"), 0.0)
        assert any("holds a point" in note for note in check_scene((scene,)).notes)
        remarks = run(scene, figures=()).summary["remarks"]
        assert any("holds a point" in text for text in remarks) == (push > 0)


@pytest.mark.parametrize("copies, told", [(1, False), (2, True), (3, True), (4, True)])
def test_copies_without_planes_of_symmetry_are_told(copies, told):
    """A half model has one plane, a quarter has two; a body that nothing halves has none."""
    scene = replace(pressed(), copies=copies)
    assert told == any(f"copies = {copies}, but 0 planes of symmetry" in n for n in said(scene))
    mesh = scene.bodies[0].mesh.with_boundaries({"left": lambda p: np.isclose(p[0], 0)})
    foundation = (
        scene.bodies[1]
        .mesh.translated((5.0, 0.0))
        .with_boundaries(
            {
                "left": lambda p: np.isclose(p[0], 0),
                "low": lambda p: np.isclose(p[1], -10),
                "up": lambda p: np.isclose(p[1], 0),
            }
        )
    )
    half = replace(
        scene,
        bodies=(
            replace(scene.bodies[0], mesh=mesh, supports=(Support("left", {"x": 0.0}),)),
            replace(
                scene.bodies[1],
                mesh=foundation,
                supports=(Support("low"), Support("left", {"x": 0.0})),
            ),
        ),
    )
    assert (copies > 2) == any("1 plane of symmetry is found" in note for note in said(half))


def test_units_in_the_other_order_are_refused():
    for units in (("MPa", "mm"), ("psi", "length"), ("a", "m")):
        with pytest.raises(InputError, match="in the other order"):
            pressed(units=units)
    with pytest.raises(InputError, match="did you mean 'mm'"):
        pressed(units=("MM", "MPa"))
    assert pressed(units=("furlong", "stone")).units == ("furlong", "stone")


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e3])
def test_a_right_scene_gets_no_sentence_in_any_units(scale):
    """Lengths in mm, m or micrometres, stresses to them."""
    ends = np.array([[0, 10], [0, 10], [-5, 15], [-10, 0]]) * scale
    steel = (Material(210e3 / scale, 0.3), Material(5.0 / scale, 0.3))
    scene = pressed(ends[:2], ends[2:], steel, ("up", -0.01 / scale), ("length", "stress"))
    assert said(scene) == ()


@pytest.mark.parametrize("name", SCENES)
def test_named_scenes_get_no_sentence(name):
    from contactopt.coupling.posed import posed
    from contactopt.readings.plausibility import doubts

    scene = make_scene(name)
    if sum(part.meshed for part in scene.parts) and scene.dim == 2:
        made = posed(scene)
        assert doubts(scene, made.couplings, made.planes) == []


def test_an_impossible_strain_is_refused_and_not_noted():
    """A strain of a tenth is noted, and one of order one by the first of all remarks."""
    block_ = block((0, 10), (0, 10))
    for overlap, load, refused in (
        (9.5, 0, True),
        (1.0, 0, False),
        (0, -4e5, False),
        (0, -2e6, True),
    ):
        held = (Support("up"),) if overlap else ()
        loads = (Traction("up", (0.0, load)),) if load else ()
        part = Part("b", block_, STEEL, held, loads, contact="low")
        floor = Rigid("floor", gap=lambda x, overlap=overlap: np.full(x.shape[1], -overlap))
        scene = Scene("s", part, floor, 0.3)
        if refused:
            with pytest.raises(InputError, match="no body can deform like this"):
                run(scene, figures=())
        else:
            remarks = run(scene, figures=()).summary["remarks"]
            assert any("a strain of up to" in remark for remark in remarks)
            assert remarks[0].startswith("no body can deform like this") == (overlap == 0)


def test_pieces_that_meet_in_a_node_are_refused():
    """Two squares at one corner, and two cubes at an edge: hinges."""
    squares = block((0, 10), (0, 10)) + block((10, 20), (10, 20))
    squares = squares.with_boundaries(
        {"low": lambda p: np.isclose(p[1], 0), "up": lambda p: np.isclose(p[1], 20)}
    )
    for look in (lambda s: check_scene([s]), run):
        with pytest.raises(InputError, match=r"2 pieces that share nodes but no side.*\(10, 10\)"):
            look(pressed(mesh=squares))
    grid = np.linspace(0, 1, 2)
    cubes = skfem.MeshHex.init_tensor(grid, grid, grid)
    cubes = (cubes + cubes.translated((1.0, 1.0, 0.0))).with_boundaries(
        {"low": lambda p: p[2] == 0, "up": lambda p: p[2] == 1}
    )
    part = Part("cubes", cubes, STEEL, loads=(Plate("up", {"z": -1.0}),), contact="low")
    with pytest.raises(InputError, match="around which they turn as around a hinge"):
        run(Scene("s", part, Rigid("floor"), 0.3, kind="solid"))


def test_a_plane_mesh_in_space_is_named_by_what_it_is():
    part = Part("b", block((0, 1), (0, 1)), STEEL, contact="low")
    with pytest.raises(InputError, match="of 16 elements in a plane") as caught:
        run(Scene("s", part, Rigid("floor"), 0.3, kind="solid"))
    assert "Mesh" not in str(caught.value)


SCENE = """thickness = 1
[bodies.b]
block = { x = [0, 1], y = [0, 1], elements = [2, 2] }
material = { E = 1000, nu = 0.3 }
contact = "y-"
plates = [{ boundary = "y+", force = { y = -1 } }]
[bodies.floor]
rigid = {}
[[contacts]]
upper = "b"
lower = "floor"
mu = 0.3
"""
LONG = ("9" * 5000, "0x" + "f" * 6000, "1e" + "9" * 5000, "9" * 400, "[" + "9" * 5000 + "]")


@pytest.mark.parametrize("number", LONG, ids=range(len(LONG)))
@pytest.mark.parametrize("line,place", [(1, " = 1"), (4, " = 1000"), (3, "[2, 2]"), (12, " = 0.3")])
def test_a_number_of_many_digits_ends_in_a_sentence(tmp_path, capsys, number, line, place):
    lines = SCENE.splitlines()
    new = f"[{number}, 2]" if place[0] == "[" else f" = {number}"
    lines[line - 1] = lines[line - 1].replace(place, new)
    path = tmp_path / "scene.toml"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError) as caught:
        run(str(path), figures=())
    assert str(caught.value).startswith(f"scene.toml, line {line}: ")
    assert len(str(caught.value)) < 300
    path.write_text(SCENE)
    for what in ("mu", "thickness", "contacts.1.mu", "contacts." + "9" * 5000):
        assert main(["check", str(path), "--set", f"{what}={number}"]) == 2
    capsys.readouterr()


def test_a_name_that_is_there_twice_is_said_in_plain_words(tmp_path):
    path = tmp_path / "scene.toml"
    for text, line in (("thickness = 2\n" + SCENE, 2), (SCENE + "[bodies.b]\n", 13)):
        path.write_text(text)
        with pytest.raises(InputError, match=f"line {line}: .* is there twice"):
            read_scene_file(path)
