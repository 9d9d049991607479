"""Input files of CalculiX and Abaqus, as Gmsh, FreeCAD and PrePoMax write them."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from deck_shapes import block, element_rows, node_rows

from contactopt.checks import remembered
from contactopt.cli import main
from contactopt.errors import InputError
from contactopt.meshes.mesh_files import load_mesh


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
    "a beam with its direction": (
        BRICK + "\n*ELEMENT, TYPE=B31\n5,1,2,7\n*ELEMENT, TYPE=B32\n6,1,4,3,7\n" + RIGHT,
        1, {"S": 1}, 8,
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
    "range whose step misses the end": (
        GROWN + "*NSET, NSET=S, GENERATE\n1,3,4\n2,2\n", 3, {"S": 1}, 8,
    ),
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
    "elements that are none": (
        ONE + RIGHT + "*ELEMENT, TYPE=CPE4R\n*ELEMENT, TYPE=B32\n", 1, {"S": 1}, 4,
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
        "NSET=N,TYPE=C\n0,0,0,0,0,1\n*ORIENTATION,NAME=O\n1,0,0,0,1,0\n*AMPLITUDE,NAME=A\n0,0,1,1\n"
        "*SURFACE SMOOTHING,NAME=T\n*ADAPTIVE MESH CONTROLS, NAME=C\n1., 0., 0.\n",
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
    "a word with a slip": (ONE + "*Nset T, NSET=A\n1\n", 8, "the keyword *NSET T is not known"),
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


def test_an_included_file_names_others_beside_the_first_file(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.inp").write_text("*INCLUDE, INPUT=sub/b.inp\n")
    (tmp_path / "sub" / "b.inp").write_text(ONE)
    (tmp_path / "deck.inp").write_text("*INCLUDE, INPUT=sub/a.inp\n" + RIGHT)
    check(tmp_path / "deck.inp", "B", 1, {"S": 1}, 4)


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
