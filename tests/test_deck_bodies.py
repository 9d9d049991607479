"""What is made of a deck: degrees, mixed elements, facets inside, bulk data, bars and shells."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from deck_shapes import block, bulk_data, element_rows, node_rows, scattered
from test_decks import BRICK, FACE, GROWN, ONE, SQUARE, check, measure

from contactopt import Material, Part, Rigid, Scene, Support, Traction, run
from contactopt.cli import main
from contactopt.errors import InputError
from contactopt.meshes.mesh_files import load_mesh
from contactopt.scenes.scene_files import read_scene_file


@pytest.mark.parametrize("order", [1, 2])
def test_the_degree_is_that_of_the_mesh_whichever_way_it_comes(tmp_path, order):
    """A cantilever from a file has the same deflection, whichever way it is read."""
    kind, shape = ("CPE3", "CPE6")[order - 1], block("tri", order, (6, 1))
    sides = "\n".join(
        f"*NSET, NSET={name}\n" + ",\n".join(map(str, shape.on(axis, at)))
        for name, axis, at in (("left", 0, 0), ("right", 0, 6), ("low", 1, 0), ("up", 1, 1))
    )
    (tmp_path / "beam.inp").write_text(
        f"*NODE\n{node_rows(shape)}\n*ELEMENT, TYPE={kind}, ELSET=BEAM\n"
        f"{element_rows(shape.elements)}\n{sides}\n"
    )
    (tmp_path / "beam.toml").write_text(
        '[bodies.beam]\nmesh = "beam.inp"\nmaterial = { E = 1000, nu = 0.3 }\ncontact = "low"\n'
        'supports = [{ boundary = "left", x = 0, y = 0 }]\n'
        'tractions = [{ boundary = "right", y = 0.01 }]\n[bodies.floor]\nrigid = {}\n'
        '[[contacts]]\nupper = "beam"\nlower = "floor"\nmu = 0.0\n'
    )
    mesh = load_mesh(tmp_path / "beam.inp")
    part = Part(
        "beam",
        mesh,
        Material(1000.0, 0.3),
        (Support("left"),),
        (Traction("right", (0.0, 0.01)),),
        contact="low",
    )
    scenes = (
        Scene("beam", part, Rigid("floor"), 0.0),
        read_scene_file(tmp_path / "beam.toml").states[0],
    )
    assert [scene.degree for scene in scenes] == [order] * 2
    tips = [run(scene, figures=()).fields[0].displacement[1].max() for scene in scenes]
    np.testing.assert_allclose(tips, tips[0], rtol=1e-9)
    # beam of Euler and Bernoulli with plane strain: F l^3 / (3 E' I)
    exact = 0.01 * 6**3 / (3 * 1000 / (1 - 0.09) / 12)
    assert 0.9 < tips[0] / exact < 1.1 if order == 2 else tips[0] / exact < 0.6


def test_a_mix_of_elements_is_told_with_groups_that_are_none(tmp_path):
    text = (
        SQUARE
        + "5,2,0\n*ELEMENT, TYPE=CPE4, ELSET=FOUR\n1,1,2,3,4\n*ELEMENT, TYPE=CPE3, ELSET=THREE"
    )
    path = tmp_path / "deck.inp"
    path.write_text(text + "\n2,2,5,3\n*ELSET, ELSET=MIX\n1,2\n")
    with pytest.raises(InputError, match=r"choose one of its groups: FOUR, THREE\.$"):
        load_mesh(path)
    with pytest.raises(InputError, match=r"make all of one type\.$"):
        load_mesh(path, "MIX")
    path.write_text(
        text.replace("ELSET=FOUR", "ELSET=A").replace("ELSET=THREE", "ELSET=A") + "\n2,2,5,3\n"
    )
    with pytest.raises(InputError, match=r"make all of one type\.$"):
        load_mesh(path)


def test_facets_inside_a_body_are_told(tmp_path, caplog):
    (tmp_path / "deck.inp").write_text(GROWN + "*SURFACE, NAME=S\n1, S1\n1, S2\n")
    assert measure(load_mesh(tmp_path / "deck.inp"), "S") == pytest.approx(1.0)
    assert "holds 1 facet of S, inside the body" in caplog.text


@pytest.mark.parametrize("kind", ["tri", "quad", "tet", "hex"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("form", ["small", "large", "commas", "large commas"])
def test_bulk_data_in_every_form(tmp_path, kind, order, form):
    shape = block(kind, order, first=11, step=2)
    path = tmp_path / "mesh.bdf"
    size = np.array(shape.size, dtype=float)
    text = bulk_data(shape, order, form)
    for head in ("", "SOL 101\nCEND\nTITLE = GRID\nBEGIN BULK\n$ nodes\n"):
        path.write_text(head + "CELAS2,9000,1.,11,1\n" + text)
        check(path, "7", np.prod(size), {"8": np.prod(size[:-1])}, shape.corners)
    path.write_text(scattered(text, form) + "\n")
    check(path, "7", np.prod(size), {"8": np.prod(size[:-1])}, shape.corners)
    last = max(shape.nodes)
    for old, new, words in (
        ("ENDDATA", "", "it ends before ENDDATA"),
        ("ENDDATA", "CIHEX1,9001,7,1,2,3,4,5,6\nENDDATA", "the card CIHEX1 is not known"),
        ("ENDDATA", "GRID,9002,3,0.,0.,0.\nENDDATA", "in coordinate system 3"),
        ("ENDDATA", "INCLUDE 'more.bdf'\nENDDATA", "INCLUDE"),
        ("ENDDATA", "=,*1,=,*1,*1,*1,*1\nENDDATA", "the card = is not known"),
        ("ENDDATA", "GRIDG,9001,,1,-9002\nENDDATA", "the card GRIDG is not known"),
        ("ENDDATA", "HEXA,9001,7,1,2,3,4,5,6\nENDDATA", "the card HEXA is not known"),
        ("ENDDATA", "what is this\nENDDATA", "the card WHAT IS is not known"),
        ("ENDDATA", "CROD,9,9,1,2,,,,,+A\n+B,1.\nENDDATA", "it goes on no card"),
        ("ENDDATA", "CTETRA,9003,7,11,13,15,9999\nENDDATA", "names node 9999"),
        ("ENDDATA", f"GRID,{last},,0.,0.,0.\nENDDATA", f"node {last} is there twice"),
        ("ENDDATA", "CTETRA,9003,7,11,13,15\nENDDATA", "CTETRA lacks some of its nodes"),
        ("ENDDATA", "GRID,9004,,0.,x,0.\nENDDATA", "'X' is no number"),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError, match="line [0-9]+: .*" + words):
            load_mesh(path)


def test_bulk_data_under_any_name_and_with_nodes_that_are_zero(tmp_path):
    """A file .dat may be of Nastran or Tecplot; a node 0 within an edge is none."""
    (tmp_path / "a.dat").write_text("SOL 101\nCEND\nBEGIN BULK\n" + PLATE + "ENDDATA\n")
    check(tmp_path / "a.dat", "7", 1, {}, 4)
    solid = CARDS.replace("CTETRA,1,7,1,2,3,4", "CTETRA,1,7,1,2,3,4,0,0\n,0,0,0,0")
    (tmp_path / "a.bdf").write_text(solid + "ENDDATA\n")
    check(tmp_path / "a.bdf", "7", 1 / 6, {}, 4)


def test_bricks_of_27_nodes_in_any_order_of_their_middles(tmp_path):
    """Gmsh and Abaqus number the middles of the sides and of the brick in orders of their own."""
    shape, rng = block("hex", 2, (2, 1, 1)), np.random.default_rng(0)
    middle, sides = {}, [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 4, 5), (1, 2, 5, 6), (2, 3, 6, 7)]
    for number, own in shape.elements.items():
        for ends in (*sides, (0, 3, 4, 7), range(8)):
            place = tuple(np.mean([shape.nodes[own[end]] for end in ends], axis=0))
            middle.setdefault(place, 1000 + len(middle))
            own.append(middle[place])
        shape.elements[number] = [*own[:20], *rng.permutation(own[20:]).tolist()]
    shape.nodes.update({number: place for place, number in middle.items()})
    path = tmp_path / "deck.inp"
    text = f"*NODE\n{node_rows(shape)}\n*ELEMENT, TYPE=C3D27, ELSET=B\n"
    text += element_rows(shape.elements) + "\n*SURFACE, NAME=S\nB, S1\n"
    path.write_text(text)
    mesh = check(path, "B", 2, {"S": 2}, 12)
    assert type(mesh) is skfem.MeshHex2
    some = next(iter(middle.values()))
    path.write_text(text.replace(f"\n{some}, ", f"\n{some}, 9"))
    with pytest.raises(InputError, match="27 nodes"):
        load_mesh(path)


def test_shells_that_are_no_side_of_a_body_are_told(tmp_path, caplog):
    """A shell beside the body, or fixed to it along one edge, was left out in silence."""
    (tmp_path / "deck.inp").write_text(BRICK + "\n" + FACE)
    assert "SKIN" in load_mesh(tmp_path / "deck.inp").boundaries
    assert not caplog.text
    fin = "*NODE\n500, 5, 0, 0\n501, 5, 1, 0\n*ELEMENT, TYPE=S4\n91, 1, 2, 501, 500\n"
    (tmp_path / "deck.inp").write_text(BRICK + "\n" + FACE + fin)
    load_mesh(tmp_path / "deck.inp")
    assert "deck.inp: 1 shell off the sides and edges" in caplog.text
    caplog.clear()
    (tmp_path / "deck.inp").write_text(BRICK + "\n" + fin + "*SURFACE, NAME=F\n91, SPOS\n")
    load_mesh(tmp_path / "deck.inp")
    assert "deck.inp: 1 shell off the sides and edges" in caplog.text


def test_cards_that_are_no_body_leave_it_as_it_is(tmp_path, caplog):
    """Quadrilaterals of any order of the card CQUAD, rods without property, cards of contact."""
    others = "CONROD,9,1,2,1,.1\nCONTACT,8,,2,3,0.2\nCONTPRM,,1.\nCREEP,1\nCORD2R,1,,0.,0.,0.\n"
    (tmp_path / "a.bdf").write_text(PLATE + others + "ENDDATA\n")
    check(tmp_path / "a.bdf", "7", 1, {}, 4)
    assert not caplog.text
    (tmp_path / "a.bdf").write_text(PLATE + "CONM2,9,1,,1.\nENDDATA\n")
    check(tmp_path / "a.bdf", "7", 1, {}, 4)
    assert "without extent are left out: CONM2" in caplog.text


BAR = "*ELEMENT, TYPE={}, ELSET=BAR\n900,1,2\n901,1,{}\n"


CARDS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n"


CARDS += "CTETRA,1,7,1,2,3,4\nCBAR,2,8,1,2\n"
PLATE = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\n"
PLATE += "CQUAD,1,7,1,2,3,4\n"


@pytest.mark.parametrize(
    "name, text, told",
    [
        ("a.inp", BRICK + "\n" + BAR.format("T3D2", 7), "a.inp: 1 line off the sides"),
        ("a.inp", ONE + BAR.format("B21", 3), "a.inp: 1 line off the sides"),
        ("a.inp", BRICK + "\n" + BAR.format("B31", 4), ""),
        (
            "a.inp",
            BRICK + "\n" + BAR.format("B31", 4) + "*BEAM SECTION, ELSET=BAR, SECTION=RECT\n1,1",
            "a.inp, line 15: the stiffness of 2 elements B31",
        ),
        (
            "a.inp",
            f"*PART, NAME=P\n{BRICK}\n{FACE}*SHELL SECTION, ELSET=SKIN\n*END PART\n*ASSEMBLY\n"
            "*INSTANCE, NAME=I, PART=P\n0,0,2\n*END INSTANCE\n*END ASSEMBLY\n",
            "a.inp, line 15: the stiffness of 1 element S4",
        ),
        (
            "a.inp",
            ONE + "*SOLID SECTION, ELSET=B, MATERIAL=M\n2.,",
            "a.inp, line 8: the thickness 2 of 1 element CPE4",
        ),
        ("a.inp", ONE + "*SOLID SECTION, ELSET=B, MATERIAL=M\n1.", ""),
        (
            "a.inp",
            ONE.replace("CPE4", "S4R") + "*SHELL SECTION, ELSET=B, MATERIAL=M\n2.5, 5",
            "a.inp, line 8: the thickness 2.5 of 1 element S4R",
        ),
        ("a.bdf", PLATE + "PSHELL,7,1\nENDDATA", ""),
        ("a.bdf", PLATE + "PSHELL,7,1,2.5\nENDDATA", "a.bdf, line 5: the thickness 2.5 of 1"),
        ("a.inp", ONE + "*REBAR, ELEMENT=CONTINUUM\nB,1", "a.inp, line 8: the stiffness of *REBAR"),
        (
            "a.inp",
            ONE + 2 * "*EQUATION\n2\n1,1,1.,2,1,-1.\n",
            "a.inp, line 8: the stiffness of *EQUATION is left out",
        ),
        (
            "a.bdf",
            PLATE + "RBE2,9,1,123,2\nMPC,1,3,1,1.,4,1,-1.\nENDDATA",
            "a.bdf: elements and links without extent are left out: MPC, RBE2",
        ),
        ("a.bdf", CARDS + "PSOLID,7,1\nENDDATA", ""),
        (
            "a.bdf",
            CARDS + "PBAR,8,1,1.,1.,1.,1.\nENDDATA",
            "a.bdf, line 6: the stiffness of 1 element of",
        ),
    ],
)
def test_what_stiffens_no_body_is_told_in_every_run_with_the_mesh(tmp_path, name, text, told):
    """Bars and shells that are no elements of a body, or have a section."""
    (tmp_path / name).write_text(text)
    mesh = load_mesh(tmp_path / name)
    sides = {"foot": lambda x: x[-1] == mesh.p[-1].min(), "wall": lambda x: x[0] == mesh.p[0].min()}
    part = Part(
        "block", mesh.with_boundaries(sides), Material(1, 0), (Support("wall"),), (), "foot"
    )
    kind = {2: "plane-strain", 3: "solid"}[len(mesh.p)]
    remarks = run(Scene("one", part, Rigid("floor"), 0.0, kind=kind)).summary["remarks"]
    of_the_file = [text for text in remarks if str(tmp_path) in text]
    assert [text.startswith(f"{tmp_path}/{told}") for text in of_the_file] == [True] * bool(told)


@pytest.mark.parametrize(("element", "kind"), [("CAX4", "axisymmetric"), ("CPS4", "plane-strain")])
def test_a_deck_of_axisymmetric_elements_makes_axisymmetric_scenes(tmp_path, capsys, element, kind):
    """The beginning of a scene has the kind of the deck, and a scene of another kind a remark."""
    path = tmp_path / "a.inp"
    path.write_text(ONE.replace("CPE4", element) + "*SURFACE, NAME=S\n1, S1\n")
    assert main(["mesh", str(path), "--no-page"]) == 0
    assert capsys.readouterr().out.startswith(f'kind = "{kind}"')
    part = Part("ring", load_mesh(path), Material(1, 0), (), (), "S")
    for other in ("axisymmetric", "plane-strain"):
        scene = Scene("one", part, Rigid("floor"), 0.0, kind=other)
        remarks = " ".join(run(scene, figures=()).summary["remarks"])
        told = other != "axisymmetric" and element == "CAX4"
        assert ("CAX4 (line 7) are axisymmetric, and the scene is not" in remarks) == told


@pytest.mark.parametrize(("at", "said"), [(0, True), (1, False)])
def test_other_nodes_with_the_name_of_a_surface_are_told(tmp_path, caplog, at, said):
    """Abaqus keeps names of surfaces and of sets of nodes apart; a boundary has one of them."""
    shape = block("quad", 1, (2, 1))
    sides = "\n".join(f"{number}, S{label}" for number, label in shape.side(1, 1))
    path = tmp_path / "two.inp"
    path.write_text(
        f"*NODE\n{node_rows(shape)}\n*ELEMENT, TYPE=CPE4\n{element_rows(shape.elements)}\n"
        f"*NSET, NSET=face\n{', '.join(map(str, shape.on(1, at)))}\n*SURFACE, NAME=face\n{sides}\n"
    )
    mesh = load_mesh(path)
    assert np.all(mesh.p[1, mesh.facets[:, mesh.boundaries["face"]]] == 1)
    assert ("facets and other nodes are both named face" in caplog.text) == said
