"""Parts from CAD files: named, meshed, shown, and solved as the same bodies made by ourselves."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import skfem
from test_page import data_of

import contactopt
from contactopt import InputError, load_mesh
from contactopt.cli import main
from contactopt.figures.check_page import write_mesh_page
from contactopt.meshes.cad import mesh_part
from contactopt.meshes.mesh_files import load_bodies

pytest.importorskip("gmsh", exc_type=ImportError)

SHELF = """
[bodies.{block}]
mesh = "parts.msh"
group = "{block}"
material = "steel"
supports = [{{ boundary = "x-", x = 0 }}, {{ boundary = "{back}", y = 0 }}]
plates = [{{ boundary = "z+", force = {{ z = -100 }} }}]
[bodies.{floor}]
mesh = "parts.msh"
group = "{floor}"
material = "steel"
supports = [{{ boundary = "z-" }}]
"""


def draw(bored=True):
    """A cube of side 2, with a bore of radius 0.5 along y, on a plate; as a STEP file."""
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    cube = occ.addBox(0, 0, 0, 2, 2, 2)
    if bored:
        occ.cut([(3, cube)], [(3, occ.addCylinder(1, -1, 1, 0, 4, 0, 0.5))])
    occ.addBox(-1, -1, -1, 4, 4, 1)
    occ.synchronize()
    gmsh.write("parts.step")
    gmsh.finalize()


@pytest.fixture
def parts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    draw()
    return tmp_path / "parts.step"


def area(mesh, name):
    facets = skfem.FacetBasis(mesh, mesh.elem(), facets=mesh.boundaries[name], intorder=4)
    return facets.dx.sum()


def test_faces_are_named_by_their_outward_normals_and_measure_what_they_should(parts):
    mesh_part(parts, Path("parts.msh"), 0.7, {"body1:cylinder1": 0.25})
    bodies, refused = load_bodies(Path("parts.msh"))
    assert set(bodies) == {"body1", "body2"} and not refused
    cube, plate = bodies["body1"], bodies["body2"]
    assert set(plate.boundaries) == {"x-", "x+", "y-", "y+", "z-", "z+"}
    assert set(cube.boundaries) == {*plate.boundaries, "cylinder1"}
    for mesh, low, high in ((cube, (0, 0, 0), (2, 2, 2)), (plate, (-1, -1, -1), (3, 3, 0))):
        for axis, letter in enumerate("xyz"):
            for sign, value in (("-", low[axis]), ("+", high[axis])):
                corners = mesh.p[axis, mesh.facets[:, mesh.boundaries[letter + sign]]]
                np.testing.assert_allclose(corners, value, atol=1e-9)
    assert area(cube, "cylinder1") == pytest.approx(2 * np.pi, rel=2e-4)
    assert area(cube, "y+") == pytest.approx(4 - np.pi / 4, rel=1e-4)
    assert skfem.Basis(cube, cube.elem(), intorder=6).dx.sum() == pytest.approx(
        8 - np.pi / 2, rel=1e-4
    )
    assert area(plate, "z+") == pytest.approx(16.0)
    edges = cube.p[:, cube.facets[:2, cube.boundaries["cylinder1"]]]
    assert 0.1 < np.linalg.norm(edges[:, 0] - edges[:, 1], axis=0).mean() < 0.35


def test_what_is_nothing_beside_the_size_is_printed_as_0(tmp_path, monkeypatch, capsys):
    import gmsh

    monkeypatch.chdir(tmp_path)
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addSphere(0, 0, 0, 5)
    gmsh.model.occ.synchronize()
    gmsh.write("ball.step")
    gmsh.finalize()
    assert main(["mesh", "ball.step", "--size", "2", "--no-page", "-q"]) == 0
    told = capsys.readouterr().out
    assert "middle (0, 0, 0), radius 5" in told, told


def test_the_printed_beginning_of_a_scene_is_solved_as_our_own_mesh_is(parts, capsys):
    """Tetrahedra of Gmsh and our bricks give the same force, and nearly the same approach."""
    draw(bored=False)
    asked = ["mesh", str(parts), "--size", "0.8", "--name", "back=body1:y-", "--no-open", "-q"]
    assert main(asked) == 0
    told = capsys.readouterr().out
    read = tomllib.loads(told)
    assert read["contacts"] == [{"upper": "body1:z-", "lower": "body2:z+", "mu": 0.3}]
    assert "area 16, middle (1, 1, 0)" in told and Path("out/parts-mesh.html").exists()
    names = {"block": "body1", "floor": "body2", "back": "back"}
    units = 'units = { length = "mm", stress = "MPa" }\n'
    scene = 'kind = "solid"\n' + units + 'mu = 0.3\ncontacts = "auto"\n' + SHELF.format(**names)
    Path("scene.toml").write_text(scene)
    found = contactopt.run("scene.toml")
    assert found.solution.solved and found.summary["normal_force"] == pytest.approx(100.0)
    block = "block = {{ x = [{}, {}], y = [{}, {}], z = [{}, {}], elements = {} }}"
    own = scene.replace('mesh = "parts.msh"\ngroup = "body1"', block.format(*[0, 2] * 3, [3] * 3))
    plate = block.format(-1, 3, -1, 3, -1, 0, [4, 4, 2])
    own = own.replace('mesh = "parts.msh"\ngroup = "body2"', plate).replace("back", "y-")
    Path("own.toml").write_text("degree = 2\n" + own)
    whole = contactopt.run("own.toml")
    assert whole.summary["normal_force"] == pytest.approx(found.summary["normal_force"], rel=1e-6)
    assert found.summary["approach"] == pytest.approx(whole.summary["approach"], rel=0.01)
    sides = [next(iter(own.summary["pairs"].values()))["force"] for own in (found, whole)]
    np.testing.assert_allclose(sides[0][2], sides[1][2], rtol=1e-6)


def test_the_page_has_a_colour_for_each_boundary(parts):
    mesh_part(parts, Path("parts.msh"), 0.8, order=1)
    cube = {"cube": load_mesh("parts.msh", "body1")}
    data = data_of(write_mesh_page("parts.msh", cube, "", (), Path("page.html")))
    assert [item["name"] for item in data["contacts"]] == [
        f"cube: {name}" for name in cube["cube"].boundaries
    ]
    assert data["roles"] == ["none", *cube["cube"].boundaries]
    assert not any(item["hidden"] for item in data["contacts"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fine", "flank:0.1"], "has no boundary 'flank'; it has body1:"),
        (["--name", "flank=body3:x-"], "has no boundary 'body3:x-'"),
        (["--size", "-1"], "the size of elements must be"),
        (["--fine", "z-:0"], "z- must be"),
    ],
)
def test_what_is_not_there_is_told(parts, options, words, capsys):
    assert main(["mesh", str(parts), "--no-page", *options]) == 2
    assert words in capsys.readouterr().err


def test_new_names_take_a_size_and_shapes_are_told(parts, capsys):
    """Edges on the bore are as fine as asked for by its new name; boundaries tell their shapes."""
    asked = ["--name", "bore=cylinder1", "--fine", "bore:0.25", "--size", "0.8", "--no-page", "-q"]
    assert main(["mesh", str(parts), *asked]) == 0
    told = capsys.readouterr().out
    assert re.search(r"'bore': .*, radius 0\.5, hollow\n", told)
    assert re.search(r"'z\+': .*, normal \(0, 0, 1\)\n", told)
    cube = load_mesh("parts.msh", "body1")
    edges = cube.p[:, cube.facets[:2, cube.boundaries["bore"]]]
    assert np.linalg.norm(edges[:, 0] - edges[:, 1], axis=0).mean() < 0.35


def test_the_face_on_which_no_element_fits_is_told(tmp_path, monkeypatch):
    """The fillet at the foot of a pin touches the edges of the top of its block."""
    import gmsh

    monkeypatch.chdir(tmp_path)
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    block, pin = occ.addBox(-6, -9, -6, 23, 9, 12), occ.addCylinder(0, 0, 0, 0, 9, 0, 4)
    ((_, body),), _ = occ.fuse([(3, block)], [(3, pin)])
    occ.synchronize()
    foot = [tag for _, tag in gmsh.model.getEntities(1) if gmsh.model.getType(1, tag) == "Circle"]
    occ.fillet([body], [tag for tag in foot if abs(occ.getCenterOfMass(1, tag)[1]) < 1e-6], [2.0])
    occ.synchronize()
    gmsh.write("foot.brep")
    gmsh.finalize()
    with pytest.raises(InputError, match=r"No element fits on body1:\S+: mend it, or try smaller"):
        mesh_part(Path("foot.brep"), Path("foot.msh"))


def test_faces_of_iges_files_become_a_solid_and_plane_parts_stay_plane(tmp_path, monkeypatch):
    import gmsh

    monkeypatch.chdir(tmp_path)
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    occ.addBox(0, 0, 0, 1, 2, 3)
    occ.synchronize()
    gmsh.write("box.iges")
    gmsh.clear()
    occ.addRectangle(0, 0, 0, 4, 2)
    occ.addDisk(2, 3, 0, 1, 1)
    occ.synchronize()
    gmsh.write("plane.step")
    gmsh.finalize()
    mesh_part(Path("box.iges"), Path("box.msh"))
    (box,) = load_bodies(Path("box.msh"))[0].values()
    assert area(box, "z+") == pytest.approx(2.0) and area(box, "x-") == pytest.approx(6.0)
    mesh_part(Path("plane.step"), Path("plane.msh"))
    plate, disc = load_bodies(Path("plane.msh"))[0].values()
    assert set(plate.boundaries) == {"x-", "x+", "y-", "y+"}
    corners = plate.p[:, plate.facets[:, plate.boundaries["y+"]]]
    np.testing.assert_allclose(corners[1], 2.0)
    assert area(disc, "ellipse1") == pytest.approx(2 * np.pi, rel=1e-4)


def test_damaged_files_are_told(tmp_path, capfd):
    (tmp_path / "bad.step").write_text("ISO-10303-21;")
    for name, words in (("bad.step", "cannot be read"), ("none.step", "does not exist")):
        with pytest.raises(InputError, match=words):
            mesh_part(tmp_path / name, tmp_path / "out.msh")
    assert capfd.readouterr() == ("", "")  # OpenCASCADE prints, too


@pytest.mark.parametrize(
    ("place", "near"),
    [
        ("2,2,2", lambda x: np.linalg.norm(x - 2.0, axis=0)),
        ("cylinder1/y-", lambda x: np.hypot(np.hypot(x[0] - 1, x[2] - 1) - 0.5, x[1])),
        ("radius=0.5", lambda x: np.abs(np.hypot(x[0] - 1, x[2] - 1) - 0.5)),
    ],
)
def test_elements_are_fine_at_a_point_an_edge_or_a_radius(parts, place, near):
    """The edges there are as long as asked for, and those far from it are not."""
    out = Path("parts.msh")
    mesh_part(parts, out, 0.8, {place: 0.1}, order=1)
    mesh = load_bodies(out)[0]["body1"]
    ends = mesh.p[:, mesh.edges]
    long, away = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=0), near(ends.mean(axis=1))
    assert long[away < 0.1].mean() < 0.17
    assert long[away > 0.9].mean() > 0.3


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("9,0,0", "lies outside"),
        ("radius=3", "its radii are 0.5"),
        ("radius=x", "a radius is a number"),
        ("x-/x+", "do not meet"),
        ("1,2,e", "a point is given as X,Y,Z"),
    ],
)
def test_places_that_are_not_there_are_refused(parts, place, said):
    with pytest.raises(InputError, match=said):
        mesh_part(parts, Path("parts.msh"), 0.8, {place: 0.1})
