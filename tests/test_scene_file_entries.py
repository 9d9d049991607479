"""Half-spaces, materials, load steps and changed entries of scene files."""

import json
import re
import tomllib

import numpy as np
import pytest
from test_scene_files import SMALL, written

import contactopt
from contactopt import HalfSpace, InputError, Material, Rigid, Scene
from contactopt.cli import main
from contactopt.scenes.example import EXAMPLE
from contactopt.scenes.material_library import STRESSES, library
from contactopt.scenes.rough_surfaces import self_affine
from contactopt.scenes.scene_files import read_scene_file

ROUGH = """
kind = "solid"
units = { length = "mm", stress = "MPa" }
[bodies.tool]
rigid = { force = { z = -2.0 } }
[bodies.ground]
material = { E = 5.0, nu = 0.3 }
half_space = { x = [-5, 5], y = [-4, 4], points = [20, 16], periodic = true, height = HEIGHT }
[[contacts]]
upper = "tool"
lower = "ground"
mu = 0.2
"""
X, Y = (np.arange(20) + 0.5) / 2 - 5, (np.arange(16) + 0.5) / 2 - 4


def in_python(height):
    ground = HalfSpace("ground", Material(5.0, 0.3), (X, Y), height, periodic=True)
    tool = Rigid("tool", force={"z": -2.0})
    return Scene("rough", tool, ground, 0.2, kind="solid", units=("mm", "MPa"))


@pytest.fixture(scope="module")
def waves():
    return self_affine((20, 16), (10.0, 8.0), slope=0.2, shortest=2.0, seed=3)


def test_a_half_space_with_a_generated_or_measured_surface_is_that_of_python(tmp_path, waves):
    expected = contactopt.run(in_python(waves)).solution.reactions
    np.save(tmp_path / "map.npy", waves)
    np.savetxt(tmp_path / "map.csv", 1e3 * waves.T, delimiter=";", header="one line per y [um]")
    places = np.stack([*np.meshgrid(X, Y, indexing="ij"), waves], axis=-1).reshape(-1, 3)
    shuffled = np.random.default_rng(0).permutation(places)
    np.savetxt(tmp_path / "places.txt", shuffled)
    for height, tol in (
        ("{ seed = 3, slope = 0.2, shortest = 2.0 }", 1e-9),
        ('{ file = "map.npy" }', 1e-9),
        ('{ file = "map.csv", unit = "um" }', 1e-9),
        ('{ file = "places.txt" }', 1e-7),
    ):
        file = written(tmp_path, ROUGH.replace("HEIGHT", height), "rough.toml")
        found = contactopt.run(file).solution.reactions
        np.testing.assert_allclose(
            found, expected, atol=tol * np.abs(expected).max(), err_msg=height
        )
    # the numbers of points are those of a map, and a plane is taken out of it
    text = ROUGH.replace("points = [20, 16], ", "").replace(
        "HEIGHT", '{ file = "slope.npy", level = true }'
    )
    np.save(tmp_path / "slope.npy", waves + 0.3 * X[:, None] + 2.0)
    np.save(tmp_path / "map.npy", waves)
    level = read_scene_file(written(tmp_path, text, "rough.toml")).states[0].bodies[1].height
    same = read_scene_file(written(tmp_path, text.replace("slope.npy", "map.npy"), "rough.toml"))
    np.testing.assert_allclose(level, same.states[0].bodies[1].height, atol=1e-12)


def test_an_expression_and_a_half_plane(tmp_path):
    text = ROUGH.replace('kind = "solid"', "").replace("z = -2.0", "y = -2.0")
    text = text.replace("y = [-4, 4], points = [20, 16], periodic = true", "points = [20]")
    file = written(tmp_path, text.replace("HEIGHT", '"-x**2 / 50"'), "line.toml")
    ground = HalfSpace("ground", Material(5.0, 0.3), X, lambda x: -(x[0] ** 2) / 50)
    same = Scene("line", Rigid("tool", force={"y": -2.0}), ground, 0.2)
    np.testing.assert_allclose(
        contactopt.run(file).solution.reactions, contactopt.run(same).solution.reactions, atol=1e-9
    )


@pytest.mark.parametrize(
    "height,content,said",
    [
        ('{ file = "h.txt" }', None, "No such file"),
        ('{ file = "h.txt" }', "1 2\n3\n", "cannot be read as a table"),
        ('{ file = "h.txt" }', "1 nan 2 3\n1 2 3 4\n", "lacks heights"),
        ('{ file = "h.txt" }', "1 1 2 3\n1 2 3 4\n", "map of 4 x 2 heights, not 20 x 16"),
        ('{ file = "h.txt" }', "0 0 1\n1 0 1\n0 1 1\n1 1 1\n2 2 1\n", "outside of the measured"),
        ('{ file = "h.txt", unit = "inch" }', "1", "unit of length"),
        ("{ hurst = 2.0 }", None, "Hurst's exponent"),
        ("{ sed = 2 }", None, "did you mean 'seed'"),
        ("3.0", None, "'height' must be"),
        ('"x + z"', None, "cannot be computed"),
    ],
)
def test_a_bad_surface_is_told_in_one_sentence(tmp_path, height, content, said):
    if content is not None:
        (tmp_path / "h.txt").write_text(content)
    file = written(tmp_path, ROUGH.replace("HEIGHT", height), "rough.toml")
    with pytest.raises(InputError, match=f"^rough.toml, line 8: .*{said}"):
        contactopt.run(file)


def test_materials_have_names_and_units(tmp_path):
    def modulus(text):
        return read_scene_file(written(tmp_path, text)).states[0].bodies[0].material

    own = SMALL.replace("{ E = 5.0, nu = 0.3 }", '"steel"')
    for stress, pascals in STRESSES.items():
        units = f'units = {{ length = "mm", stress = "{stress}" }}\n'
        assert modulus(units + own).E * pascals == pytest.approx(210e9, rel=1e-9)
    with pytest.raises(InputError, match="unit of stress is 'stress'"):
        modulus(own)
    (tmp_path / "own.toml").write_text('stress = "MPa"\n[oak]\nE = 11e3\nnu = 0.4\n')
    files = 'units = { length = "m", stress = "GPa" }\nmaterials = "own.toml"\n'
    assert modulus(files + own.replace("steel", "oak")) == Material(11.0, 0.4)
    inline = own.replace("steel", "oak") + "[materials.oak]\nE = 7.0\nnu = 0.1\n"
    assert modulus(inline) == Material(7.0, 0.1)
    with pytest.raises(InputError, match=r"line 6: .*did you mean 'steel'"):
        modulus(own.replace("steel", "stel"))
    with pytest.raises(InputError, match=r"own.toml, line 2: Poisson's ratio"):
        (tmp_path / "own.toml").write_text("\n[oak]\nE = 11e3\nnu = 0.7\n")
        modulus(files + own)


def test_every_material_of_the_library_has_a_source():
    for name, one in library().items():
        assert one.source and one.stress == "GPa" and Material(one.E, one.nu), name


def test_steps_have_names_and_grow_from_the_step_before(tmp_path):
    steps = SMALL.replace("x = 1.0, y = -10.0", "x = [0.0, 3.0], y = [-10, -10]")
    head = 'steps = [{ name = "press", states = 2 }, { name = "push", states = 3 }]\n'
    file = written(tmp_path, head + steps)
    forces = [state.bodies[0].loads[0].force for state in read_scene_file(file).states]
    assert [f["y"] for f in forces] == pytest.approx([-5, -10, -10, -10, -10])
    assert [f["x"] for f in forces] == pytest.approx([0, 0, 1, 2, 3])
    contactopt.run(file, tmp_path / "out", figures=())
    head, *rows = (tmp_path / "out" / "history.csv").read_text().splitlines()
    assert head.endswith(",step")
    assert [row.split(",")[-1] for row in rows] == ["press"] * 2 + ["push"] * 3
    named = read_scene_file(written(tmp_path, 'steps = ["press", "push"]\n' + steps)).states
    assert [state.bodies[0].loads[0].force["x"] for state in named] == [0.0, 3.0]
    for wrong, said in (
        ('steps = ["press"]\n', "values for 2 steps, the file has 1"),
        ('steps = [{ name = "press", states = 0 }]\n', "states of step 'press' must be"),
        ("steps = [1]\n", "every entry of 'steps'"),
        ("steps = 1\n", "'steps' must be an array; got 1"),
    ):
        with pytest.raises(InputError, match=said):
            read_scene_file(written(tmp_path, wrong + steps))


def test_any_entry_is_changed_from_the_command_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path)
    line = ["run", "small.toml", "--no-figures", "--json"]
    sets = ["bodies.block.material.E=10.0", "bodies.block.plates.1.force.y=-20", "thickness=4"]
    assert main([*line, "--mu", "0.2", *(word for one in sets for word in ("--set", one))]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["mu"] == 0.2 and found["normal_force"] == pytest.approx(20.0)
    text = SMALL.replace("E = 5.0", "E = 10.0").replace("y = -10.0", "y = -20.0")
    text = text.replace("thickness = 2.0", "thickness = 4.0").replace("mu = 0.4", "mu = 0.2")
    same = contactopt.run(written(tmp_path, text, "same.toml"))
    assert found["approach"] == pytest.approx(same.summary["approach"], rel=1e-9)
    for change, said in (
        ("bodies.blok.material.E=1", "there is no 'blok' in bodies; .*did you mean 'block'"),
        ("bodies.block.material.E=-1", "--set bodies.block.material.E=-1: Young's|line 6: Young's"),
        ("bodies.block.material.F=1", "--set bodies.block.material.F=1: there is no 'F'"),
        ("contacts.2.mu=1", "contacts has the entries 1 to 1"),
        ("thickness.x=1", "holds 2.0, and nothing in it"),
        ("a b.c=1", "is no name of an entry"),
        ("forse=1", "there is no 'forse'"),
    ):
        assert main([*line, "--set", change]) == 2
        (told,) = capsys.readouterr().err.splitlines()
        assert re.search(said, told), told


def matches(value, rule):
    """Whether a value obeys the few keywords that the schema uses."""
    if "anyOf" in rule and not any(matches(value, way) for way in rule["anyOf"]):
        return False
    if "enum" in rule:
        return value in rule["enum"]
    kinds = {"string": str, "number": (int, float), "integer": int, "boolean": bool}
    kinds |= {"object": dict, "array": list}
    if "type" in rule and not isinstance(value, kinds[rule["type"]]):
        return False
    if isinstance(value, dict):
        known, more = rule.get("properties", {}), rule.get("additionalProperties", {})
        return set(rule.get("required", ())) <= set(value) and all(
            matches(own, known[key]) if key in known else more is not False and matches(own, more)
            for key, own in value.items()
        )
    return not isinstance(value, list) or all(matches(one, rule.get("items", {})) for one in value)


def test_the_schema_accepts_what_the_reader_accepts(tmp_path, capsys):
    assert main(["schema"]) == 0
    rule = json.loads(capsys.readouterr().out)
    smooth = SMALL.replace("mu = 0.4", 'law = "frictionless"')
    assert all(matches(tomllib.loads(text), rule) for text in (EXAMPLE, SMALL, smooth))
    commented = [
        line[2:] for line in EXAMPLE.splitlines() if line.startswith("# ") and " = " in line
    ]
    for line in commented:  # the entries that the example mentions
        key = line.partition("=")[0].strip()
        if key.isidentifier() and key not in ("copies",):
            assert f'"{key}"' in json.dumps(rule), key
    for height in ('"x"', '{ file = "a" }', "{ seed = 1 }"):
        text = ROUGH.replace("HEIGHT", height) + "[materials.a]\nE = 1\nnu = 0.1\n"
        assert matches(tomllib.loads(text), rule), height
    for wrong in (
        SMALL.replace("mu = 0.4", ""),
        SMALL.replace("thickness", "thicknes"),
        SMALL.replace("mu = 0.4", 'mu = 0.4\nlaw = "glue"'),
        SMALL.replace("tol = 1e-10", 'tol = "small"'),
        SMALL.replace('contact = "y-"', "contact = 3"),
        SMALL.replace("nu = 0.3", "mu = 0.3"),
    ):
        assert not matches(tomllib.loads(wrong), rule), wrong


def test_a_coefficient_that_no_law_reads_is_refused(tmp_path):
    one = SMALL.replace("mu = 0.4", 'law = "frictionless"')
    said = "contacts.1.mu=0.3: the law 'frictionless' reads no mu; leave it out or give 0"
    for changes in ({"mu": 0.3}, {"contacts.1.mu": 0.3}):
        with pytest.raises(InputError, match=said):
            read_scene_file(written(tmp_path, one), changes)
    with pytest.raises(InputError, match="line 19: the law 'tied' reads no mu"):
        read_scene_file(written(tmp_path, SMALL.replace("mu = 0.4", 'law = "tied"\nmu = 0.4')))
    rough = '[[contacts]]\nupper = "block:x+"\nlower = "floor"\nmu = 0.4\n[solve]'
    file = read_scene_file(written(tmp_path, one.replace("[solve]", rough)), {"mu": 0.3})
    assert [pair.mu for pair in file.states[0].contacts] == [0.0, 0.3]
