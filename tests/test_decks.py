"""Input files of CalculiX and Abaqus, as Gmsh, FreeCAD, PrePoMax, HyperMesh and Abaqus write them:
the volume, the area of each surface and the number of nodes are those that the file means, or
the file is refused with its line.
"""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from deck_shapes import block, bulk_data, element_rows, node_rows

from contactopt import Material, Part, Rigid, Scene, Support, Traction, run
from contactopt.checks import remembered
from contactopt.cli import main
from contactopt.errors import InputError
from contactopt.meshes.mesh_files import load_bodies, load_mesh
from contactopt.scenes.scene_files import read_scene_file

TYPES = {
    **{"CPS3": ("tri", 1), "CPE6": ("tri", 2), "CAX4": ("quad", 1), "CPE4R": ("quad", 1)},
    **{"CPS8R": ("quad", 2), "CAX8": ("quad", 2), "C3D4": ("tet", 1), "C3D10": ("tet", 2)},
    **{"C3D10MH": ("tet", 2), "C3D8I": ("hex", 1), "C3D20R": ("hex", 2), "SC8R": ("hex", 1)},
}


def measure(mesh, boundary=None):
    """Volume of a mesh, or area of a boundary of it."""
    if boundary is None:
        basis = skfem.Basis(mesh, mesh.elem(), intorder=6)
    else:
        basis = skfem.FacetBasis(mesh, mesh.elem(), facets=mesh.boundaries[boundary], intorder=6)
    return float(skfem.Functional(lambda w: 1.0 + 0 * w.x[0]).assemble(basis))


def check(path, group, volume, areas, corners):
    mesh = load_mesh(path, group)
    assert measure(mesh) == pytest.approx(volume, rel=1e-9)
    assert mesh.nvertices == corners
    for name, area in areas.items():
        assert measure(mesh, name) == pytest.approx(area, rel=1e-9), name
    return mesh


def numbers(values, width=16):
    values = [str(value) for value in values]
    return ",\n".join(", ".join(values[i : i + width]) for i in range(0, len(values), width))


def gmsh(shape, kind):
    """Lines and surfaces are elements in sets of their own; groups are sets of their numbers."""
    dim, last = len(shape.size), max(shape.elements)
    skin = {
        ("tri", 1): "T3D2", ("tri", 2): "T3D3", ("quad", 1): "T3D2", ("quad", 2): "T3D3",
        ("tet", 1): "CPS3", ("tet", 2): "CPS3", ("hex", 1): "CPS4", ("hex", 2): "CPS4",
    }[TYPES[kind]]  # fmt: skip
    low, up = shape.facets(dim - 1, 0), shape.facets(0, shape.size[0])
    ids = range(last + 1, last + 1 + len(low)), range(last + 101, last + 101 + len(up))
    form = "{:d}, {:.16g}, {:.16g}, {:.16g}"
    return (
        f"*Heading\n model.inp\n*NODE\n{node_rows(shape, form)}\n"
        "******* E L E M E N T S *************\n"
        f"*ELEMENT, type={skin}, ELSET=Line1\n{element_rows(low, ids[0][0])}\n"
        f"*ELEMENT, type={skin}, ELSET=Line2\n{element_rows(up, ids[1][0])}\n"
        f"*ELEMENT, type={kind}, ELSET=Surface1\n{element_rows(shape.elements, width=11)}\n"
        f"*ELSET,ELSET=body\n{numbers(shape.elements, 10)}, \n"
        f"*ELSET,ELSET=low\n{numbers(ids[0], 10)}, \n*ELSET,ELSET=end\n{numbers(ids[1], 10)}, \n"
        f"*NSET,NSET=low\n{numbers(shape.on(dim - 1, 0), 10)}, \n"
    )


def freecad(shape, kind):
    """Sets of nodes for supports, surfaces by elements and sides, `E` in exponents."""
    dim = len(shape.size)
    rows = "\n".join(f"{number},S{side}" for number, side in shape.side(dim - 1, 0))
    return (
        "** written by FreeCAD inp file writer\n\n*Node, NSET=Nall\n"
        f"{node_rows(shape, '{:d},{:.6E},{:.6E},{:.6E}')}\n\n"
        f"** Volume elements\n*Element, TYPE={kind}, ELSET=Evolumes\n"
        f"{element_rows(shape.elements)}\n\n** Define element set Eall\n*ELSET, ELSET=Eall\n"
        "Evolumes\n\n** constraints fixed node sets\n** ConstraintFixed\n*NSET,NSET=end\n"
        + ",\n".join(map(str, shape.on(0, shape.size[0])))
        + f",\n\n*SURFACE, NAME=low\n{rows}\n*ELSET,ELSET=body\nEvolumes\n"
        "*MATERIAL, NAME=Steel\n*ELASTIC\n210000,0.3\n*SOLID SECTION, ELSET=body, MATERIAL=Steel\n"
        "*STEP\n*STATIC\n*BOUNDARY\nend,1\n*NODE FILE\nU\n*EL FILE\nS, E\n*END STEP\n"
    )


def prepomax(shape, kind):
    """Internal sets of elements for every side of a surface, names with underscores."""
    dim = len(shape.size)
    text = (
        f"**\n** Heading\n**\n*Heading\nHash: Ab3\n*Node\n{node_rows(shape)}\n"
        f"*Element, Type={kind}, Elset=body\n{element_rows(shape.elements)}\n"
        f"*Nset, Nset=end, Internal\n{numbers(shape.on(0, shape.size[0]))}\n"
    )
    sides = shape.side(dim - 1, 0)
    surface = "*Surface, Name=low, Type=Element\n"
    for label in sorted({label for _, label in sides}):
        name = f"Internal_Selection-1_low_S{label}"
        own = [number for number, other in sides if other == label]
        text += f"*Elset, Elset={name}\n{numbers(own)}\n"
        surface += f"{name}, S{label}\n"
    return text + surface + "*Physical constants, Absolute zero=-273.15\n"


def hypermesh(shape, kind):
    """Blanks around signs, keyword lines that go on, comments between data, tabs, CRLF."""
    dim = len(shape.size)
    rows = "\n".join(f"  {number:8d}, S{side}" for number, side in shape.side(dim - 1, 0))
    nodes = node_rows(shape, "{:8d},\t{:.10g}  , {:.10g},{:.10g}")
    text = (
        f"**\n** ABAQUS Input Deck Generated by HyperMesh\n**\n*NODE\n"
        f"{nodes}\n**HWCOLOR COMP 1 3\n"
        f"*ELEMENT,TYPE={kind},\nELSET=body\n{element_rows(shape.elements)}\n"
        f"*NSET, NSET= end ,\n UNSORTED\n** comment\n{numbers(shape.on(0, shape.size[0]), 8)},\n"
        f"*SURFACE, NAME = low, TYPE = ELEMENT\n{rows}\n*PRE-TENSION SECTION, NODE=1\n1,0,0\n"
    )
    return text.replace("\n", "\r\n")


def abaqus(shape, kind):
    """A part, an instance that is moved, sets of the assembly."""
    dim = len(shape.size)
    sides = shape.side(dim - 1, 0)
    rows, sets = "", ""
    for label in sorted({label for _, label in sides}):
        own = [number for number, other in sides if other == label]
        sets += f"*Elset, elset=_low_S{label}, internal, instance=Part-1-1\n{numbers(own)}\n"
        rows += f"_low_S{label}, S{label}\n"
    return (
        "*Heading\n** Job name: Job-1 Model name: Model-1\n*Preprint, echo=NO, model=NO\n"
        f"*Part, name=Part-1\n*Node\n{node_rows(shape, '{:7d}, {:12.6f}, {:12.6f}, {:12.6f}')}\n"
        f"*Element, type={kind}\n{element_rows(shape.elements)}\n*Nset, nset=Set-1, generate\n"
        f"  {min(shape.nodes)}, {max(shape.nodes)}, 1\n"
        f"*Elset, elset=Set-1, generate\n {min(shape.elements)}, {max(shape.elements)}, 1\n"
        "** Section: Section-1\n*Solid Section, elset=Set-1, material=Material-1\n,\n*End Part\n"
        "*Assembly, name=Assembly\n*Instance, name=Part-1-1, part=Part-1\n 0., 5., 0.\n"
        " 0., 5., 0., 0., 6., 0., 0.\n*End Instance\n*Node\n 1, 9., 9., 9.\n*Nset, nset=RP\n 1,\n"
        f"*Nset, nset=end, instance=Part-1-1\n{numbers(shape.on(0, shape.size[0]))}\n{sets}"
        f"*Surface, type=ELEMENT, name=low\n{rows}*End Assembly\n"
        "*Elset, elset=body\nPart-1-1.Set-1\n"
    )


@pytest.mark.parametrize("kind", TYPES)
@pytest.mark.parametrize("style", [gmsh, freecad, prepomax, hypermesh, abaqus])
def test_decks_of_five_programs_mean_what_they_say(tmp_path, style, kind):
    shape = block(*TYPES[kind], first=7, step=3 if style is not gmsh else 1)
    path = tmp_path / "deck.inp"
    path.write_bytes(style(shape, kind).encode())
    size = np.array(shape.size, dtype=float)
    areas = {"low": np.prod(size[:-1]), "end": np.prod(size[1:])}
    check(path, "body", np.prod(size), areas, shape.corners)
    group = "Part-1-1" if style is abaqus else "body"
    check(path, group, np.prod(size), areas, shape.corners)
    (mesh,) = load_bodies(path)[0].values()
    assert mesh.nvertices == shape.corners


SQUARE = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n"
ONE = SQUARE + "*ELEMENT, TYPE=CPE4, ELSET=B\n1,1,2,3,4\n"
ROW = "*NODE, NSET=ENDS\n1,0,0\n4,3,0\n11,0,1\n14,3,1\n"
STRIP = ROW + "*NGEN, NSET=LOW\n1,4\n*NGEN, NSET=UP\n11,14,1\n"
GROWN = STRIP + "*ELEMENT, TYPE=CPE4\n1,1,2,12,11\n*ELGEN, ELSET=B\n1,3,1,1\n"
CUBE = node_rows(block("hex", 1, (1, 1, 1)))
BRICK = f"*NODE, NSET=N\n{CUBE}\n*ELEMENT, TYPE=C3D8, ELSET=B\n" + element_rows(
    block("hex", 1, (1, 1, 1)).elements
)
RIGHT = "*SURFACE, NAME=S\nB, S3\n"
LINES = "*NODE\n9,0.5,0\n10,0.5,2.\n*ELEMENT, TYPE=T3D2, ELSET=S\n5,1,4\n"
FACE = "*ELEMENT, TYPE=S4, ELSET=SKIN\n9,1,4,3,2\n"

# what is written, volume, surfaces, corners
MEANT = {
    "elgen": (GROWN + "*SURFACE, NAME=S\nB, S1\n", 3, {"LOW": 3, "UP": 3, "S": 3}, 8),
    "elgen in layers": (
        "*NODE\n1,0,0,0\n3,2,0,0\n*NGEN, NSET=A\n1,3\n*NCOPY, CHANGE NUMBER=10, OLD SET=A, SHIFT,"
        "\nNEW SET=C\n0,3,0\n*NFILL, NSET=F\nA, C, 2, 5\n"
        "*NCOPY, CHANGE NUMBER=100, OLD SET=F, SHIFT, NEW SET=G\n0,0,4\n\n"
        "*NFILL, NSET=H\nF,G,4,25\n*ELEMENT, TYPE=C3D8\n1,1,2,7,6,26,27,32,31\n"
        "*ELGEN, ELSET=B\n1,2,1,1,2,5,10,4,25,100\n*NSET, NSET=S\nF\n",
        24, {"S": 6}, 45,
    ),
    "ncopy turned": (
        SQUARE + "*NSET, NSET=Q\n1,2,3,4\n*NCOPY, OLD SET=Q, CHANGE NUMBER=4, SHIFT\n0,0,2\n"
        "0,0,0,0,0,1,0.\n*ELEMENT, TYPE=C3D8, ELSET=B\n1,1,2,3,4,5,6,7,8\n" + RIGHT,
        2, {"S": 2}, 8,
    ),
    "elcopy": (
        BRICK + "\n*NCOPY, CHANGE NUMBER=50, OLD SET=N, SHIFT, NEW SET=M\n1.,0.,0.\n"
        "*NCOPY, CHANGE NUMBER=100, OLD SET=N, REFLECT=MIRROR\n0,0,0,0,1,0\n0,0,1\n"
        "*ELCOPY, ELEMENT SHIFT=10, OLD SET=B, SHIFT NODES=50, NEW SET=B2\n"
        "*ELSET, ELSET=ALL\nB, B2\n*SURFACE, NAME=S\nALL, S3\n",
        2, {"S": 2}, 12,
    ),
    "cylinder": (
        "*NODE, SYSTEM=C\n1,1,0\n2,2,0\n3,2,90\n4,1,90\n"
        "*ELEMENT, TYPE=CPE4, ELSET=B\n1,1,2,3,4\n*SURFACE, NAME=S\n1,S1\n1,S3\n",
        1.5, {"S": 2}, 4,
    ),
    "arc": (
        "*NODE\n1,1,0\n5,0,1\n11,2,0\n15,0,2\n99,0,0\n*NGEN, LINE=C, NSET=IN\n1,5,1,99\n"
        "*NGEN, LINE=C, NSET=OUT\n11,15,1,,0.,0.,0.\n*ELEMENT, TYPE=CAX4\n1,1,11,12,2\n"
        "*ELGEN, ELSET=B\n1,4\n",
        6 * np.sin(np.pi / 8), {"IN": 8 * np.sin(np.pi / 16), "OUT": 16 * np.sin(np.pi / 16)}, 10,
    ),
    "system": (
        "*SYSTEM\n5,0,0,5,1,0\n*NODE\n1,0,0\n2,1,0\n*SYSTEM\n*NODE\n3,4,1\n4,4,0\n"
        "*ELEMENT, TYPE=CPE4, ELSET=B\n1,1,2,3,4\n*NSET, NSET=S\n1,2\n",
        1, {"S": 1}, 4,
    ),
    "system in space": (
        "*SYSTEM\n0,0,0,0,0,1\n1,0,0\n" + BRICK + "\n*SURFACE, NAME=S\nB, S1\n", 1, {"S": 1}, 8,
    ),
    "quoted names": (
        ONE.replace("ELSET=B", 'ELSET="the body, old"')
        + '*ELSET, ELSET=B\n"The body, old"\n*SURFACE, NAME="S"\n"the body, old", S3\n',
        1, {"S": 1}, 4,
    ),
    "exponents of Fortran": (
        ONE.replace("2,1,0", "2,1.D0,0.0D+00").replace("3,1,1", "3,10.d-1,1e0") + RIGHT,
        1, {"S": 1}, 4,
    ),
    "keyword goes on": (
        ONE.replace("TYPE=CPE4, ELSET", "TYPE=CPE4,\nELSET") + RIGHT.replace("NAME", "\n name"),
        1, {"S": 1}, 4,
    ),
    "comma before data": (ONE + "*SURFACE, NAME=S,\nB, S3\n", 1, {"S": 1}, 4),
    "case and blanks": (
        ONE.replace("*ELEMENT, TYPE=CPE4, ELSET=B", "  *Element , Type = cpe4 , elset = B ")
        + "*surface, name=S\n b , s3\n*ELSET,ELSET=b\n1\n",
        1, {"S": 1}, 4,
    ),
    "end of a file in DOS": (ONE + RIGHT + "\x1a", 1, {"S": 1}, 4),
    "tabs": (ONE.replace(",", "\t,\t").replace("\n", "\n\n") + RIGHT, 1, {"S": 1}, 4),
    "last place counts": (SQUARE + ONE.replace("1,0,0", "1,-1,0") + RIGHT, 1.5, {"S": 1}, 4),
    "lines of second order": (
        "*NODE\n1,0,0\n2,1,0\n3,0,1\n4,.5,0\n5,.5,.5\n6,0,.5\n*ELEMENT, TYPE=CPS6, ELSET=B\n"
        "1,1,2,3,4,5,6\n*ELEMENT, TYPE=B32, ELSET=S\n8,1,4,2\n",
        0.5, {"S": 1}, 3,
    ),
    "skin of shells": (BRICK + "\n" + FACE + "*SURFACE, NAME=S\nSKIN, SPOS\n", 1, {"S": 1}, 8),
    "skin without a side": (BRICK + "\n" + FACE + "*SURFACE, NAME=S\nSKIN,\n", 1, {"S": 1}, 8),
    "all sides": (BRICK + "\n*SURFACE, NAME=S\nB\n", 1, {"S": 6}, 8),
    "free sides": (
        GROWN + "*SURFACE, NAME=S\nB,\n", 3, {"S": 8}, 8,
    ),
    "surface in two blocks": (
        BRICK + "\n*SURFACE, NAME=S\nB, S1\n*SURFACE, NAME=s\nB, S2\n", 1, {"S": 2}, 8,
    ),
    "edges of shells": (
        ONE.replace("CPE4", "S4R") + "*SURFACE, NAME=S\n1, E1\n1, E2\n", 1, {"S": 2}, 4,
    ),
    "nodes of a surface": (ONE + "*SURFACE, TYPE=NODE, NAME=S\n1, 1.\n2, 1.\n", 1, {"S": 1}, 4),
    "nodes of elements": (
        GROWN + "*ELSET, ELSET=FIRST\n1\n*NSET, NSET=S, ELSET=FIRST\n", 3, {"S": 3}, 8,
    ),
    "sets of sets": (
        GROWN + "*NSET, NSET=A\n1,2\n*NSET, NSET=S\nA, 3\n*NSET, NSET=A\n11\n", 3, {"S": 2}, 8,
    ),
    "range with a gap": (GROWN + "*NSET, NSET=S, GENERATE\n1,11,1\n", 3, {"S": 4}, 8),
    "points": (
        ONE + RIGHT + "*ELEMENT, TYPE=SPRINGA, ELSET=K\n7,1,3\n*ELEMENT, TYPE=MASS, ELSET=M\n8,1\n"
        "*NSET, NSET=AT, ELSET=K\n*ELEMENT,TYPE=D\n11,0,1,2\n",
        1, {"S": 1}, 4,
    ),
    "turned elements": (
        SQUARE + "*ELEMENT, TYPE=CPE4, ELSET=B\n1,1,4,3,2\n" + RIGHT, 1, {"S": 1}, 4,
    ),
    "turned bricks": (
        f"*NODE\n{CUBE}\n*ELEMENT, TYPE=C3D8, ELSET=B\n1, 5,6,7,8,1,2,3,4\n" + RIGHT,
        1, {"S": 1}, 8,
    ),
    "a wedge beside": (
        BRICK + "\n*NODE\n21,2,0,0\n22,2,0,1\n*ELEMENT, TYPE=C3D6, ELSET=W\n"
        "9,2,21,3,6,22,7\n*SURFACE, NAME=T\nW, S3\n" + RIGHT,
        1, {"S": 1}, 8,
    ),
    "elements before nodes": (
        "*ELEMENT, TYPE=CPE4, ELSET=B\n1,1,2,3,4\n*NSET,NSET=S\n1,2\n" + SQUARE, 1, {"S": 1}, 4,
    ),
    "sets and surfaces above what they name": (
        "*SURFACE, NAME=P, TYPE=NODE\nS, 1.\n*NSET, NSET=T, ELSET=FIRST\n*NSET, NSET=Q\nP\n"
        "*SURFACE, NAME=R\nFIRST, S4\n*NSET, NSET=S\n1,2,3\n*ELSET, ELSET=FIRST\n1\n" + GROWN,
        3, {"S": 2, "P": 2, "Q": 2, "T": 3, "R": 1}, 8,
    ),
    "what is made above what it is made from": (
        "*ELCOPY, ELEMENT SHIFT=10, OLD SET=B, SHIFT NODES=50, NEW SET=B2\n"
        "*NCOPY, CHANGE NUMBER=50, OLD SET=N, SHIFT, NEW SET=M\n1.,0.,0.\n"
        "*ELSET, ELSET=ALL\nB, B2\n*SURFACE, NAME=S\nALL, S3\n" + BRICK + "\n",
        2, {"S": 2}, 12,
    ),
    "grown above": (
        "*ELGEN, ELSET=B\n1,3,1,1\n*NGEN, NSET=LOW\n1,4\n*NGEN, NSET=UP\n11,14,1\n" + ROW
        + "*ELEMENT, TYPE=CPE4\n1,1,2,12,11\n",
        3, {"LOW": 3, "UP": 3}, 8,
    ),
    "quotation marks in a heading": ('*HEADING\n5" pipe, old\n' + ONE + RIGHT, 1, {"S": 1}, 4),
    "unknown words in a step": (
        ONE + RIGHT + "*STEP\n*SOLVE IT\n1\n*MODEL CHANGE, TYPE=CONTACT PAIR, ADD\n*END STEP\n",
        1, {"S": 1}, 4,
    ),
    "words after another": (
        ONE + RIGHT + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nN,20.\n*TIE, NAME=T\nS,S\n*TRANSFORM,"
        "NSET=N,TYPE=C\n0,0,0,0,0,1\n*ORIENTATION,NAME=O\n1,0,0,0,1,0\n*AMPLITUDE,NAME=A\n0,0,1,1\n",
        1, {"S": 1}, 4,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MEANT)
def test_a_keyword_means_what_the_manual_says(tmp_path, name):
    text, volume, areas, corners = MEANT[name]
    (tmp_path / "deck.inp").write_text(text)
    group = "ALL" if "*ELCOPY" in text else "B"
    check(tmp_path / "deck.inp", group, volume, areas, corners)


# what is written, the line of the fault, and words of the message
REFUSED = {
    "unknown keyword": (ONE + "*NMAP, NSET=A\n1\n", 8, "NMAP"),
    "a word with a slip": (ONE + "*NSETT, NSET=A\n1\n", 8, "NSETT"),
    "parameters": ("*PARAMETER\na=1\n" + ONE, 1, "PARAMETER"),
    "unknown option": (ONE.replace("ELSET=B", "ELSET=B, OFFSET=10"), 6, "OFFSET"),
    "sphere": (ONE.replace("*NODE", "*NODE, SYSTEM=S"), 1, "SYSTEM=S"),
    "parabola": (STRIP.replace("*NGEN,", "*NGEN, LINE=P,"), 6, "LINE=P"),
    "biased fill": (STRIP + "*NFILL, BIAS=2.\nLOW,UP,2\n", 10, "BIAS"),
    "reflected elements": (
        BRICK + "\n*ELCOPY, OLD SET=B, ELEMENT SHIFT=1, SHIFT NODES=1, REFLECT\n", 12, "REFLECT",
    ),
    "unknown elements": (ONE.replace("CPE4", "COH2D4"), 6, "COH2D4"),
    "no type": (ONE.replace("TYPE=CPE4, ", ""), 6, "TYPE"),
    "a node that is not there": (ONE.replace("1,1,2,3,4", "1,1,2,3,5"), 7, "5"),
    "an element twice": (ONE + "*ELEMENT, TYPE=CPE4\n1,1,2,3,4\n", 9, "element 1 is there twice"),
    "too many nodes": (ONE.replace("1,1,2,3,4", "1,1,2,3,4,5"), 7, "4 nodes"),
    "too few nodes": (ONE.replace("1,1,2,3,4", "1,1,2,3"), 7, "lacks"),
    "surface without element": (ONE + RIGHT + "2, S3\n", 10, "element 2, which is not there"),
    "surface without side": (ONE + RIGHT + "1, S5\n", 10, "S5"),
    "surface with a word": (ONE + RIGHT + "1, TOP\n", 10, "TOP"),
    "surface without set": (ONE + RIGHT + "C, S1\n", 10, "no set C"),
    "the plate itself": (ONE.replace("CPE4", "S4") + "*SURFACE, NAME=S\nB, SPOS\n", 9, "SPOS"),
    "set without node": (ONE + "*NSET, NSET=A\n1, 2\n3, 9\n", 10, "node 9, which is not there"),
    "set without element": (ONE + "*ELSET, ELSET=A\n1, 2\n", 9, "element 2"),
    "range without its end": (ONE + "*NSET, NSET=A, GENERATE\n1,9,1\n", 9, "node 9"),
    "range back": (ONE + "*NSET, NSET=A, GENERATE\n4,1\n", 9, "range"),
    "set without set": (ONE + "*NSET, NSET=A\nB\n", 9, "no set B of nodes"),
    "set without name": (ONE + "*NSET\n1\n", 8, "NSET="),
    "combined surfaces": (ONE + "*SURFACE, NAME=S, COMBINE=UNION\nA\n", 8, "COMBINE"),
    "no such file": ("*INCLUDE, INPUT=other.inp\n" + ONE, 1, "other.inp"),
    "no file of nodes": (ONE.replace("*NODE", "*NODE, INPUT=n.inp"), 1, "n.inp"),
    "a word for a number": (ONE.replace("3,1,1", "3,one,1"), 4, "'one' is no number"),
    "a number beyond all": (ONE.replace("3,1,1", "3,1e400,1"), 4, "'1e400' is not below 1e+70"),
    "a number beyond volumes": (ONE.replace("3,1,1", "3,-1e200,1"), 4, "is not below 1e+70"),
    "no number": (ONE.replace("3,1,1", "3,nan,1"), 4, "'nan' is no number"),
    "a set that is nowhere": ("*NSET, NSET=A\nC\n*NSET, NSET=C\nD\n" + ONE, 4, "no set D of nodes"),
    "range of one number": (ONE + "*NSET, NSET=A, GENERATE\n1\n", 9, "range"),
    "nodes of elements that are nowhere": (
        "*NSET, NSET=A, ELSET=E\n*ELSET, ELSET=E\n9\n" + ONE, 1, "element 9 is not there",
    ),
    "a long number": (ONE.replace("3,1,1", "9" * 5000 + ",1,1"), 4, "no whole number"),
    "a step that misses": (ROW + "*NGEN\n1,4,2\n", 7, "step"),
    "fill of other sets": (STRIP + "*NFILL\nLOW,ENDS,2\n*NFILL\nLOW,NO,2\n", 13, "no set NO"),
    "elements from none": (ONE + "*ELGEN\n3,2\n", 9, "no element 3"),
    "part without end": ("*PART, NAME=P\n" + ONE, 1, "END PART"),
    "end without part": (ONE + "*END PART\n", 8, "PART"),
    "two parts of one name": (f"*PART, NAME=P\n{ONE}*END PART\n*PART, NAME=p\n", 10, "two parts"),
    "two instances of one name": (
        f"*PART, NAME=P\n{ONE}*END PART\n*ASSEMBLY\n"
        + 2 * "*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n", 13, "two instances",
    ),
    "no number of a node": (ONE.replace("3,1,1", ",1,1"), 4, "a number is missing"),
    "instance of none": ("*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n", 2, "part P"),
    "elements that are removed": (
        ONE + RIGHT + "*STEP\n*MODEL CHANGE, TYPE=ELEMENT, REMOVE\nB\n*END STEP\n", 11, "CHANGE",
    ),
    "a crack through elements": (ONE + "*ENRICHMENT, NAME=C, ELSET=B\n", 8, "ENRICHMENT"),
    "an open quotation of a keyword": (ONE.replace("ELSET=B", 'ELSET="B'), 6, "quotation"),
    "an open quotation of data": (ONE + '*SURFACE, NAME=S\nB, S1\n"B, S3\n', 10, "quotation"),
    "axis of no length": (
        f"*PART, NAME=P\n{ONE}*END PART\n*ASSEMBLY\n*INSTANCE, NAME=I, PART=P\n0,0,0\n"
        "0,0,0,0,0,0,90\n*END INSTANCE\n*END ASSEMBLY\n", 13, "axis",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_read_is_refused_with_its_line(tmp_path, name):
    text, line, words = REFUSED[name]
    (tmp_path / "deck.inp").write_text(text)
    with pytest.raises(InputError) as caught:
        load_mesh(tmp_path / "deck.inp")
    assert f"line {line}:" in str(caught.value) and words in str(caught.value)
    assert len(str(caught.value)) < 400


def test_data_in_other_files(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "n.inp").write_text(SQUARE.replace("*NODE\n", ""))
    (tmp_path / "e.inp").write_text("1,1,2,3,4\n")
    (tmp_path / "s.inp").write_text(RIGHT)
    path = tmp_path / "deck.inp"
    path.write_text(
        "*NODE, INPUT=sub\\n.inp\n*ELEMENT, TYPE=CPE4, ELSET=B, INPUT=e.inp\n*INCLUDE,INPUT=s.inp\n"
    )
    check(path, "B", 1, {"S": 1}, 4)
    (tmp_path / "s.inp").write_text("** nothing\n" + RIGHT + "7, S1\n")
    with pytest.raises(InputError, match=r"s\.inp', line 4: surface 'S' names element 7"):
        load_mesh(path)
    (tmp_path / "e.inp").write_text("\n1,1,2,3,9\n")
    with pytest.raises(InputError, match=r"e\.inp', line 2: an element CPE4 names a node"):
        load_mesh(path)


def test_an_included_file_may_hold_data_alone(tmp_path):
    """It stands in the place of its line: what follows belongs to the same keyword."""
    (tmp_path / "n.txt").write_text("** nodes\n2,1,0\n*INCLUDE, INPUT=m.txt\n")
    (tmp_path / "m.txt").write_text("3,1,1\n")
    (tmp_path / "s.txt").write_text("1\n*NSET, NSET=S\n2\n")
    path, rows = tmp_path / "deck.inp", SQUARE.splitlines(keepends=True)
    text = f"{rows[0]}{rows[1]}*INCLUDE,\nINPUT=n.txt\n{rows[4]}" + ONE.removeprefix(SQUARE)
    path.write_text(text + "*NSET, NSET=T\n*INCLUDE, INPUT=s.txt\n1\n*NSET, NSET=T\n4\n")
    check(path, "B", 1, {"S": 1, "T": 1}, 4)
    (tmp_path / "m.txt").write_text("\n3,one,1\n")
    with pytest.raises(InputError, match=r"m\.txt', line 2: 'one' is no number"):
        load_mesh(path)
    (tmp_path / "m.txt").write_text("*INCLUDE, INPUT=deck.inp\n")
    with pytest.raises(InputError, match="include each other"):
        load_mesh(path)


def test_a_node_that_is_there_twice_is_told(tmp_path, capsys):
    (tmp_path / "deck.inp").write_text(ONE.replace("4,0,1\n", "4,0,1\n2,1,0\n1,-1,0\n"))
    mesh = load_mesh(tmp_path / "deck.inp")
    (said,) = remembered(mesh)
    assert said.endswith("line 1: node 1 is there twice; it moves from (0, 0, 0) to (-1, 0, 0)")
    assert main(["mesh", str(tmp_path / "deck.inp"), "--no-page"]) == 0
    assert f"# note: {said}" in capsys.readouterr().out


@pytest.mark.parametrize("coding", ["utf-8-sig", "latin-1", "utf-8"])
def test_encodings_and_line_ends(tmp_path, coding):
    text = "** Gehäuse\n" + ONE.replace("=B", "=Gehäuse") + '*SURFACE, NAME=S\n"Gehäuse", S3\n'
    for end in ("\n", "\r\n", "\r"):
        (tmp_path / "deck.inp").write_bytes(text.replace("\n", end).encode(coding))
        check(tmp_path / "deck.inp", "Gehäuse", 1, {"S": 1}, 4)


def test_what_is_no_deck_is_refused_in_a_sentence(tmp_path):
    path = tmp_path / "deck.inp"
    whole = ONE.encode()
    for content in (
        whole.decode().encode("utf-16"), b"\x89PNG\r\n\0" + whole, b"solid a\n", b"*", b"1, 2, 3\n",
        b"*HEADING\nnothing\n", b"*NODE\n", SQUARE.encode(), b"\xff" * 99,
    ):  # fmt: skip
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            load_mesh(path)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_a_deck_that_is_cut_anywhere_is_whole_or_refused(tmp_path):
    """A brick from which the end is cut has its volume, or the file is refused."""
    text = prepomax(block("hex", 2, (1, 1, 1)), "C3D20").encode()
    path = tmp_path / "deck.inp"
    for end in range(1, len(text), 7):
        path.write_bytes(text[:end])
        try:
            assert measure(load_mesh(path)) == pytest.approx(1.0)
        except InputError as error:
            assert len(str(error)) < 400


def test_numbers_of_instances_and_of_the_assembly_are_apart(tmp_path):
    """Two instances of a part and nodes and elements of the assembly have the same numbers."""
    part = f"*PART, NAME=P\n{BRICK}\n*SURFACE, NAME=S\nB, S1\n*END PART\n*ASSEMBLY, NAME=A\n"
    part += "*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n*INSTANCE, NAME=J, PART=P\n0,0,3\n"
    part += "*END INSTANCE\n*NODE\n" + "\n".join(f"{i},7,7,{i}" for i in range(1, 40))
    part += "\n*ELEMENT, TYPE=MASS, ELSET=M\n1,1\n*NSET, NSET=T, INSTANCE=J\n5,6,7,8\n"
    (tmp_path / "deck.inp").write_text(part + "*SURFACE, NAME=U\nI.1, S2\n*END ASSEMBLY\n")
    low = check(tmp_path / "deck.inp", "I", 1, {"S": 1, "U": 1}, 8)
    up = check(tmp_path / "deck.inp", "J", 1, {"S": 1, "T": 1}, 8)
    assert low.p[2].max() == 1 and up.p[2].min() == 3 and "T" not in low.boundaries


@pytest.mark.parametrize("order", [1, 2])
def test_the_degree_is_that_of_the_mesh_whichever_way_it_comes(tmp_path, order):
    """A cantilever from a file, through load_mesh and a Scene and through a scene file: the same
    degree and the same deflection, which linear triangles make too small.
    """
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
@pytest.mark.parametrize("form", ["small", "large", "commas"])
def test_bulk_data_in_every_form(tmp_path, kind, order, form):
    shape = block(kind, order, first=11, step=2)
    path = tmp_path / "mesh.bdf"
    size = np.array(shape.size, dtype=float)
    text = bulk_data(shape, order, form)
    for head in ("", "SOL 101\nCEND\nTITLE = GRID\nBEGIN BULK\n$ nodes\n"):
        path.write_text(head + "CELAS2,9000,1.,11,1\n" + text)
        check(path, "7", np.prod(size), {"8": np.prod(size[:-1])}, shape.corners)
    last = max(shape.nodes)
    for old, new, words in (
        ("ENDDATA", "", "it ends before ENDDATA"),
        ("ENDDATA", "CIHEX1,9001,7,1,2,3,4,5,6\nENDDATA", "the card CIHEX1 is not known"),
        ("ENDDATA", "GRID,9002,3,0.,0.,0.\nENDDATA", "in coordinate system 3"),
        ("ENDDATA", "INCLUDE 'more.bdf'\nENDDATA", "INCLUDE"),
        ("ENDDATA", "CTETRA,9003,7,11,13,15,9999\nENDDATA", "names node 9999"),
        ("ENDDATA", f"GRID,{last},,0.,0.,0.\nENDDATA", f"node {last} is there twice"),
        ("ENDDATA", "CTETRA,9003,7,11,13,15\nENDDATA", "CTETRA lacks some of its nodes"),
        ("ENDDATA", "GRID,9004,,0.,x,0.\nENDDATA", "'X' is no number"),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError, match="line [0-9]+: .*" + words):
            load_mesh(path)


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


BAR = "*ELEMENT, TYPE={}, ELSET=BAR\n900,1,2\n901,1,{}\n"
CARDS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n"
CARDS += "CTETRA,1,7,1,2,3,4\nCBAR,2,8,1,2\n"


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
        ("a.inp", ONE + "*REBAR, ELEMENT=CONTINUUM\nB,1", "a.inp, line 8: the stiffness of *REBAR"),
        ("a.bdf", CARDS + "PSOLID,7,1\nENDDATA", ""),
        (
            "a.bdf",
            CARDS + "PBAR,8,1,1.,1.,1.,1.\nENDDATA",
            "a.bdf, line 6: the stiffness of 1 element of",
        ),
    ],
)
def test_what_stiffens_no_body_is_told_in_every_run_with_the_mesh(tmp_path, name, text, told):
    """Bars and shells that are no elements of a body, or have a section, in a remark of a run of a
    scene that is made in Python from a mesh that was read before.
    """
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
