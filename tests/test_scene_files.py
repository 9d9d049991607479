"""Scene files say what the Python API says, and mistakes in them are named with their line."""

import os

import meshio
import numpy as np
import pytest
import skfem
import skfem.io.meshio
from conftest import MATERIAL

import contactopt
from contactopt import Contact, InputError, Part, Plate, Rigid, Scene, Support, Traction
from contactopt.cli import main
from contactopt.scenes.example import EXAMPLE
from contactopt.scenes.scene_files import read_scene_file

SMALL = """\
kind = "plane-strain"
thickness = 2.0

[bodies.block]
block = { x = [0, 2], y = [0, 1], elements = [4, 2] }
material = { E = 5.0, nu = 0.3 }
contact = "y-"
plates = [
    { boundary = "y+", force = { x = 1.0, y = -10.0 } },
]

[bodies.floor]
rigid = {}

[[contacts]]
upper = "block"
lower = "floor"
mu = 0.4

[solve]
tol = 1e-10
"""


def written(folder, text=SMALL, name="small.toml"):
    (folder / name).write_text(text)
    return folder / name


def test_the_example_runs_and_a_path_ends_as_python_says(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "first.toml"]) == 0
    assert main(["new", "first.toml"]) == 2 and main(["new", "first.txt"]) == 2
    text = (tmp_path / "first.toml").read_text()
    for many, few in (("[16, 16]", "[8, 8]"), ("[64, 32]", "[32, 16]")):
        text = text.replace(many, few)
    (tmp_path / "first.toml").write_text(text)
    assert main(["run", "first.toml"]) == 0
    assert "solved" in capsys.readouterr().out
    assert {"summary.json", "path.png", "block.vtu"} <= {
        path.name for path in (tmp_path / "out" / "first").iterdir()
    }
    result = contactopt.run("first.toml")
    assert len(result.path.states) == 3
    np.testing.assert_allclose(
        result.summary["pairs"]["block-foundation"]["force"], [-40, 100], rtol=1e-9
    )


def test_a_file_says_what_python_says(tmp_path):
    result = contactopt.run(written(tmp_path))
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 2, 5), np.linspace(0, 1, 3)).with_boundaries(
        {"contact": lambda x: x[1] == 0, "top": lambda x: x[1] == 1}
    )
    block = Part("block", mesh, MATERIAL, loads=(Plate("top", {"x": 1.0, "y": -10.0}),))
    same = contactopt.run(Scene("small", block, Rigid("floor"), 0.4, thickness=2.0), tol=1e-10)
    assert result.scene.name == "small" and result.summary["dofs"] == same.summary["dofs"]
    np.testing.assert_allclose(result.solution.reactions, same.solution.reactions, atol=1e-9)
    assert contactopt.run(tmp_path / "small.toml", degree=2).summary["dofs"] > same.summary["dofs"]
    assert contactopt.run(tmp_path / "small.toml", mu=0.1).summary["mu"] == 0.1


def test_options_of_the_command_line_join_those_of_the_file(tmp_path):
    """A file may bound a search whose accuracy the command line gives; what is given there wins."""
    file = written(tmp_path, SMALL.replace("tol = 1e-10", "max_unknowns = 2000\nadaptive = true"))
    with pytest.raises(InputError, match="adaptive refinement needs an aim"):
        contactopt.run(file)
    aim = {"accuracy": 0.5, "quantity": "approach"}
    assert contactopt.run(file, adaptive=False, **aim).estimate.target == 0.5
    with pytest.raises(InputError, match=r"did you mean .max_unknowns."):
        contactopt.run(file, max_unknwns=9, **aim)


def test_a_file_may_ask_for_the_accuracy_of_a_load_path(tmp_path):
    aim = 'accuracy = 0.5\nquantity = "approach"\nmax_unknowns = 2000'
    text = SMALL.replace("tol = 1e-10", aim).replace("y = -10.0", "y = [-5.0, -10.0]")
    result = contactopt.run(written(tmp_path, text))
    given = contactopt.run(
        written(tmp_path, text.replace(aim, "")), accuracy=0.5, quantity="approach"
    )
    assert result.estimate.target == 0.5 and len(result.path.states) == 2
    assert result.summary["approach"] == pytest.approx(given.summary["approach"], rel=1e-9)


def test_a_file_may_name_what_is_read(tmp_path):
    text = SMALL.replace("tol", 'read = ["reaction:block:y+:y", "approach"]\ntol')
    found = contactopt.run(written(tmp_path, text)).summary["quantities"]
    assert found["reaction:block:y+:y"]["value"] == pytest.approx(-10.0) and len(found) == 2


def test_every_entry_reaches_the_scene(tmp_path):
    plane = skfem.MeshTri2.init_circle(2)
    meshio.write(
        tmp_path / "disc.vtu",
        meshio.Mesh(
            np.pad(plane.p.T, [(0, 0), (0, 1)]),
            [("triangle6", skfem.io.meshio.to_meshio(plane, encode_cell_data=False).cells[0].data)],
            cell_data={"part": [np.ones(plane.nelements, int)]},
        ),
    )
    text = """
units = { length = "mm", stress = "MPa" }
copies = 2
name = "all"
[bodies.disc]
mesh = "disc.vtu"
group = "part=1"
unit = "cm"
move = { y = 10.0 }
boundaries.low = { y = [0.0, 5.0] }
boundaries.left = { x = [-10, -8] }
material = { nu = 0.3, E = 5.0 }
supports = [ { boundary = "left", x = [0.0, 0.25] } ]
tractions = [ { boundary = "left", y = [1.0, 2.0] } ]
body_force = { y = -1e-3 }
contact = "low"
curve = { radius = 10, centre = { x = 0, y = 10 } }
[bodies.ring]
ring = { radii = [20, 40], elements = [2, 12] }
material.E = 7.0
material.nu = 0.2
supports = [ { boundary = "outer" } ]
[bodies.punch]
rigid = { normal = { y = 1 }, gap = "x**2 / 20", force = { y = [-1.0, -3.0] } }
[[contacts]]
upper = "disc"
lower = "ring:inner"
mu = "0.1 + 0.01 * x"
law = "tresca"
coupling = "mortar"
carrier = "upper"
[[contacts]]
upper = "punch"
lower = "disc:left"
law = "frictionless"
[solve]
method = "newton"
Q = "explicit"
"""
    file = read_scene_file(written(tmp_path, text))
    first, last = file.states
    assert file.solve == {"method": "newton", "Q": "explicit"}
    assert (first.name, first.copies, first.degree, first.units) == ("all", 2, 2, ("mm", "MPa"))
    disc, ring, punch = last.bodies
    assert disc.mesh is first.bodies[0].mesh and disc.material == contactopt.Material(5.0, 0.3)
    np.testing.assert_allclose(
        [disc.mesh.p.min(axis=1), disc.mesh.p.max(axis=1)], [[-10, 0], [10, 20]], atol=1e-9
    )
    assert disc.supports == (Support("left", {"x": 0.25}),) and ring.supports == (Support("outer"),)
    assert disc.loads == (Traction("left", (0.0, 2.0)), contactopt.BodyForce((0.0, -1e-3)))
    assert first.bodies[0].loads[0].value == (0.0, 1.0) and first.bodies[2].force == {"y": -1.0}
    np.testing.assert_allclose(disc.curve(np.array([[3.0], [6.0]])), [[6.0], [2.0]])
    assert set(ring.mesh.boundaries) == {"inner", "outer"} and ring.mesh.nelements == 24
    assert punch.normal == (0.0, 1.0)
    assert punch.gap(np.array([[2.0], [0.0]])) == pytest.approx([0.2])
    pair = last.contacts[0]
    assert isinstance(pair, Contact)
    assert (pair.law, pair.coupling, pair.carrier) == ("tresca", "mortar", "upper")
    np.testing.assert_allclose(pair.mu(np.array([[0.0, 5.0], [1.0, 1.0]])), [0.1, 0.15])


@pytest.mark.parametrize(
    "kind,components", [("axisymmetric", ("r", "z")), ("solid", ("x", "y", "z"))]
)
def test_blocks_in_other_kinds(tmp_path, kind, components):
    up = components[-1]
    sides = ", ".join(f"{c} = [0, 1]" for c in components)
    text = (
        SMALL.replace("plane-strain", kind)
        .replace("thickness = 2.0", "")
        .replace("[0, 2], y = [0, 1]", "")
    )
    text = text.replace(
        "{ x = , elements = [4, 2] }", f"{{ {sides}, elements = {[2] * len(components)} }}"
    )
    text = (
        text.replace('"y-"', f'"{up}-"')
        .replace('"y+"', f'"{up}+"')
        .replace("x = 1.0, y = -10.0", f"{up} = -10.0")
    )
    result = contactopt.run(written(tmp_path, text))
    assert result.summary["normal_force"] == pytest.approx(10.0)


MISTAKES = [
    ('kind = "plane-strain"', 'kind = "plane-shear"', 1,
     "there is no kind 'plane-shear'; choose from plane-strain"),
    ("thickness = 2.0", "thicknes = 2.0", 2, "there is no 'thicknes'; valid names are .*thickness"),
    ("thickness = 2.0", 'thickness = "2"', 2, "'thickness' must be a number"),
    ("thickness = 2.0", "thickness = -2.0", 2, "thickness must be a finite number greater than 0"),
    ("thickness = 2.0", "thickness = 2.0\nthickness = 3.0", 3, "'thickness' is there twice"),
    ('kind = "plane-strain"', "bodies.block = 3", 4, r"\[bodies.block\] is there twice"),
    ("thickness = 2.0", "x = {a = 1, a = 2}", 2, "'a' is there twice"),
    ("thickness = 2.0", "thickness = ", 2, "invalid value"),
    ("thickness = 2.0", "units = { length = 3 }", 2, "'length' must be a text"),
    ("block = { x = [0, 2], y", "block = { x = [2, 0], y", 5, "'x' must ascend"),
    ("block = { x = [0, 2], y", "block = { x = [2], y", 5, "two coordinates, .*got \\[2"),
    ("block = { x = [0, 2], y", "block = { z = [0, 2], y", 5,
     "'x' is missing in bodies.block.block"),
    ("elements = [4, 2]", "elements = [4, 0]", 5, "'elements' must be whole numbers"),
    ("elements = [4, 2]", "elements = [4000000, 4000000]", 5, "elements in all"),
    ("block = { x", 'mesh = "a.msh"\nblock = { x', 4, "exactly one of .* has mesh and block"),
    ("block = { x = [0, 2], y = [0, 1], elements = [4, 2] }", 'mesh = "a.msh"', 5,
     "mesh file .*a.msh' does not exist"),
    ("block = { x = [0, 2], y = [0, 1], elements = [4, 2] }", "", 4, "exactly one of .* has none"),
    ("E = 5.0, nu", "E = -5.0, nu", 6, "Young's modulus"),
    ("nu = 0.3", "nu = 0.5", 6, "Poisson's ratio"),
    ("nu = 0.3", "mu = 0.3", 6, "'nu' is missing in bodies.block.material"),
    ("nu = 0.3", "nu = 0.3, G = 2.0", 6, "no 'G' in bodies.block.material; valid names are E, nu"),
    ("material = { E = 5.0, nu = 0.3 }", "", 4, "body 'block' has no material"),
    ('contact = "y-"', 'contact = "bottom"', 7, r"no boundary 'bottom'; it has x\+, x-, y\+, y-"),
    ('boundary = "y+"', 'boundary = "top"', 9, "no boundary 'top'"),
    ('boundary = "y+",', "", 9, r"'boundary' is missing in bodies.block.plates\[1\]"),
    ("x = 1.0, y", "z = 1.0, y", 9, "no 'z' in .*force; valid names are x, y"),
    ("x = 1.0, y", "x = nan, y", 9, "x must be a finite number"),
    ("x = 1.0, y = -10.0", "x = [1, 2], y = [3, 4, 5]", 9,
     "'x' has values for 2 states, other.* 3"),
    ("x = 1.0, y", "x = [], y", 9, "empty array"),
    ("force = { x = 1.0, y = -10.0 }", "glued = 1", 9, "a plate needs force"),
    ("rigid = {}", "rigid = { normal = { x = 0 } }", 13, "the normal is zero"),
    ("rigid = {}", "rigid = { normal = { y = 1, z = 1 } }", 13,
     "no 'z' in .*normal; valid names are x, y"),
    ("tol = 1e-10", "tolerance = 1e-10", 21, "no 'tolerance' in solve; valid names are method"),
    ("[solve]", "[slove]", 20, "there is no 'slove'; .*did you mean 'solve'"),
    ("rigid = {}", 'rigid = { gap = "x +" }', 13, "cannot be computed"),
    ("[[contacts]]", "[contacts]", 15, "'contacts' must be an array of tables"),
    ('upper = "block"', 'upper = "blok"', 16,
     "there is no body 'blok'; the bodies are block, floor"),
    ('upper = "block"', 'upper = "block:top"', 16,
     "no boundary 'top'; name its surface as 'block:NAME'"),
    ('lower = "floor"', 'lower = "block"', 15, "'block' cannot touch itself"),
    ("mu = 0.4", "mu = -0.4", 15, "friction coefficient mu"),
    ("mu = 0.4", "", 15, "'mu' is missing in contacts"),
    ("mu = 0.4", 'law = "tresca"', 15, "'mu' is missing in contacts"),
    ("mu = 0.4", 'mu = 0.4\nlaw = "glue"', 19, "glue"),
    ("tol = 1e-10", "tol = 0", 21, "tol must be a finite number greater than 0"),
    ("tol = 1e-10", "accuracy = 0.1", 20, "belong together"),
    ("tol = 1e-10", "read = [1]", 21, "'read' must be an array of names"),
    ("tol = 1e-10", 'read = ["displacement:block:z+"]', 21, "no boundary 'z\\+'; it has x"),
    ("thickness = 2.0", "degree = 3", 2, "degree must be 1 or 2"),
    ('contact = "y-"', 'contact = "y-"\nsupports = [{ boundary = "x-" }]', 4,
     "body 'block': the plate 'y\\+' moves"),
    ("block = { x = [0, 2], y", "move = { x = 1e16 }\nblock = { x = [0, 2], y", 5, "moved so far"),
    ("[solve]", "[solv]", 20, "there is no 'solv'"),
    ("mu = 0.4", "mu = [0.3, 0.2]", 15, "'block-floor': .* one number or one per contact"),
    ("mu = 0.4", 'mu = 0.4\ncoupling = "rope"', 15, "'block-floor': unknown coupling 'rope'"),
    ("tol = 1e-10", 'method = "newtn"', 21, "unknown method 'newtn'"),
    ("thickness = 2.0", 'units = { length = "mm", stress = "mpa" }', 2, "did you mean 'MPa'"),
    ("thickness = 2.0", 'steps = ["press", "press"]', 2, "a name of its own; got 'press'"),
]  # fmt: skip


@pytest.mark.parametrize("right,wrong,line,message", MISTAKES, ids=[m[1][:30] for m in MISTAKES])
def test_a_mistake_is_named_with_its_line(tmp_path, capsys, right, wrong, line, message):
    assert SMALL.count(right) == 1
    path = written(tmp_path, SMALL.replace(right, wrong))
    with pytest.raises(InputError, match=f"(?s)^small.toml, line {line}: .*{message}") as caught:
        contactopt.run(path)
    assert "\n" not in str(caught.value)
    assert main(["run", str(path)]) == 2 and str(caught.value) in capsys.readouterr().err


def test_missing_parts_are_named(tmp_path):
    for text, message in (
        ("", "there are no bodies"),
        ("[bodies]\n", "there are no bodies"),
        ("bodies = 3", "must be a table"),
    ):
        with pytest.raises(InputError, match=message):
            read_scene_file(written(tmp_path, text))
    lonely = SMALL.replace("[[contacts]]", "[bodies.third]\nrigid = {}\n\n[[contacts]]")
    with pytest.raises(InputError, match="'third' belongs to no contact"):
        read_scene_file(written(tmp_path, lonely))
    with pytest.raises(InputError, match=r"line 4:.*cannot name a file"):
        read_scene_file(written(tmp_path, SMALL.replace("[bodies.block]", '[bodies."../block"]')))


def test_hostile_scene_files(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "binary.toml").write_bytes(bytes(range(256)))
    (tmp_path / "huge.toml").write_text("#" * 2_000_000)
    (tmp_path / "deep.toml").write_text("x = " + "[" * 100_000)
    for name in ("folder", "pipe", "binary", "huge", "deep", "missing"):
        with pytest.raises(InputError, match=name) as caught:
            contactopt.run(str(tmp_path / f"{name}.toml"))
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_the_comments_of_the_example_are_valid_too(tmp_path):
    """Entries that stand behind a comment sign are read as the others."""
    text = EXAMPLE
    for entry in ("move", "tractions", "body_force", "curve"):
        text = text.replace(f"# {entry} =", f"{entry} =")
    scene = read_scene_file(written(tmp_path, text)).states[0]
    block = scene.bodies[0]
    assert len(block.loads) == 3 and block.curve is not None and block.mesh.p[0].max() == 30
