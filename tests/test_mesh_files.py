"""Meshes from files: geometry and groups as they were written."""

import logging
import os

import meshio
import numpy as np
import pytest
import skfem
import skfem.io.meshio

from contactopt import InputError, load_mesh
from contactopt.meshes import mesh_formats
from contactopt.meshes.mesh_files import name_boundaries
from tests.mesh_samples import SQUARE, TWO, flux, volume, write


def curved_bricks():
    """Bricks of second order under a quadratic map, which serendipity elements hold exactly."""
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex().refined(1))
    x, y, z = mesh.p
    return skfem.MeshHex2(
        np.stack([x + 0.2 * y * z, y + 0.3 * x**2, z + 0.1 * x * y - 0.2 * y**2]), mesh.t
    )


@pytest.mark.parametrize(
    "kind,nodes", [("hexahedron20", 20), ("hexahedron27", 27), ("hexahedron", 8)]
)
def test_bricks_of_every_order_keep_their_shape(tmp_path, kind, nodes):
    exact = curved_bricks()
    cells = skfem.io.meshio.to_meshio(exact, encode_cell_data=False).cells[0].data[:, :nodes]
    path = write(tmp_path / "a.vtu", exact.p.T, [(kind, cells)])
    mesh = load_mesh(path)
    assert flux(mesh) == pytest.approx(3 * volume(mesh))
    if nodes > 8:
        assert type(mesh) is skfem.MeshHex2 and mesh.p.shape == exact.p.shape
        found = mesh.p[:, np.lexsort(np.round(mesh.p, 9))]
        np.testing.assert_allclose(found, exact.p[:, np.lexsort(np.round(exact.p, 9))], atol=1e-12)
        assert volume(mesh) == pytest.approx(volume(exact), rel=1e-12)


@pytest.mark.parametrize(
    "name,how",
    [
        *((f"a.{ending}", {}) for ending in ("vtu", "vtk", "inp", "mesh", "nas")),
        *(("a.msh", {"file_format": name}) for name in ("gmsh22", "gmsh")),
        *(("a.xdmf", {"data_format": "XML"}), ("a.dat", {"file_format": "tecplot"})),
    ],
)
def test_formats_of_meshio(tmp_path, name, how):
    mesh = skfem.MeshTet().refined(1)
    meshio.write(tmp_path / name, meshio.Mesh(mesh.p.T, [("tetra", mesh.t.T)]), **how)
    found = load_mesh(tmp_path / name)
    assert found.nelements == mesh.nelements and volume(found) == pytest.approx(1.0)
    np.testing.assert_allclose(
        found.p[:, np.lexsort(found.p)], mesh.p[:, np.lexsort(mesh.p)], atol=1e-12
    )


def test_a_plane_mesh_may_lie_across_any_axis(tmp_path):
    for across in range(3):
        points = np.insert(SQUARE[:, :2], across, 5.0, axis=1)
        mesh = load_mesh(write(tmp_path / "a.vtu", points, [("quad", TWO)]))
        np.testing.assert_array_equal(np.ptp(mesh.p, axis=1), [2, 1])
    bent = SQUARE.copy()
    bent[:, 2] = [0, 1, 3, 0, 1, 3]
    with pytest.raises(InputError, match="a surface in space only"):
        load_mesh(write(tmp_path / "a.vtu", bent, [("quad", TWO)]))


def test_repairs_are_logged(tmp_path, caplog):
    # a double seam and a lonely node
    points = np.concatenate([SQUARE, SQUARE[[1, 4]] + 1e-9, [[7, 7, 0]]])
    cells = np.array(
        [[0, 1, 4, 3], [6, 7, 5, 2], [4, 3, 0, 1]]
    )  # the second the wrong way round, the third the first again
    with caplog.at_level(logging.INFO):
        mesh = load_mesh(write(tmp_path / "a.vtu", points, [("quad", cells)]))
    assert mesh.nelements == 2 and mesh.p.shape[1] == 6
    assert volume(mesh) == pytest.approx(2, rel=1e-8)
    assert flux(mesh) == pytest.approx(4)
    said = ("nodes that lie on others", "1 element is there twice", "quad number 2 of the file")
    for what in (*said, "3 nodes of the file"):
        assert what in caplog.text


@pytest.mark.parametrize("kind", ["triangle6", "quad9", "tetra10", "hexahedron27"])
def test_elements_the_wrong_way_round_are_turned_with_all_their_nodes(tmp_path, kind):
    """A mirror image has every element the wrong way round."""
    mesh = {
        "triangle6": skfem.MeshTri2.init_circle(2),
        "quad9": skfem.MeshQuad2.from_mesh(skfem.MeshQuad().refined(1)),
        "tetra10": skfem.MeshTet2.init_ball(1),
        "hexahedron27": curved_bricks(),
    }[kind]
    original = skfem.io.meshio.to_meshio(mesh, encode_cell_data=False)
    points = mesh.p.T * np.array([-1, 1, 1])[: len(mesh.p)]
    found = load_mesh(
        write(tmp_path / "a.vtu", np.pad(points, [(0, 0), (0, 3 - len(mesh.p))]), original.cells)
    )
    assert volume(found) == pytest.approx(volume(mesh), rel=1e-12)
    assert flux(found) == pytest.approx(len(mesh.p) * volume(mesh), rel=1e-9)
    np.testing.assert_allclose(np.sort(found.p[0]), np.sort(-mesh.p[0]), atol=1e-14)


def test_faults_are_refused_with_the_element(tmp_path):
    def refused(message, points, cells, **more):
        with pytest.raises(InputError, match=message) as caught:
            load_mesh(write(tmp_path / "a.vtu", np.asarray(points, dtype=float), cells, **more))
        assert "\n" not in str(caught.value)

    flat = SQUARE.copy()
    flat[[2, 5]] = [[1, 0.3, 0], [1, 0.6, 0]]
    refused(r"quad number 2 of the file, at \(1, 0.475\) has no volume", flat, [("quad", TWO)])
    folded = SQUARE.copy()
    folded[5] = [1.2, 0.2, 0]
    refused("quad number 2 of the file.* folds over", folded, [("quad", TWO)])
    refused(
        "two corners coincide in quad number 2", SQUARE, [("quad", [[0, 1, 4, 3], [1, 2, 2, 4]])]
    )
    mixed = [("quad", TWO[:1]), ("triangle", [[1, 2, 5]])]
    refused("mixes elements of type quad and triangle", SQUARE, mixed)
    lost = SQUARE.copy()
    lost[5, 1] = np.nan
    refused("coordinates of node 6", lost, [("quad", TWO)])
    refused("a quad names a node that is not there", SQUARE, [("quad", [[0, 1, 4, 33]])])
    refused("no elements of a body", SQUARE, [("line", [[0, 1]])])
    refused("type 'wedge' cannot be used", np.eye(6, 3), [("wedge", [[0, 1, 2, 3, 4, 5]])])
    apart = np.concatenate([SQUARE[[0, 1, 4, 3]], SQUARE[[1, 2, 5, 4]] + [1, 0, 0]])
    two = [("quad", np.arange(8).reshape(2, 4))]
    refused("falls into 2 pieces that share no node; mesh it in one piece", apart, two)
    parts = {"part": [np.array([1, 2])]}
    refused("choose the body by its group, one of part=1, part=2", apart, two, cell_data=parts)
    fan = [[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [2, 0.5, 0]]
    over = [("triangle", [[0, 2, 1], [0, 1, 3], [0, 4, 1]])]
    refused("more than two elements share a facet", fan, over)
    curved = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.1, 0.1, 0], [0, 0.5, 0]])
    refused("triangle6 number 1 of the file.* folds over", curved, [("triangle6", [range(6)])])


def test_coincident_nodes_of_two_bodies_stay_apart(tmp_path):
    points = np.concatenate([SQUARE[[0, 1, 4, 3]], SQUARE[[1, 2, 5, 4]]])
    cells = [("quad", np.arange(8).reshape(2, 4))]
    path = write(tmp_path / "a.vtu", points, cells, cell_data={"part": [np.array([1, 2])]})
    assert load_mesh(path, "part=1").nelements == 1
    with pytest.raises(InputError, match=r"2 pieces.* one of part=1, part=2"):
        load_mesh(path)


def test_hostile_files_end_in_one_sentence(tmp_path, monkeypatch):
    good = write(tmp_path / "a.msh", SQUARE, [("quad", TWO)])
    data = good.read_bytes()
    (tmp_path / "folder.msh").mkdir()
    os.mkfifo(tmp_path / "pipe.msh")
    contents = {
        "empty.msh": b"",
        "text.msh": b"hello\n",
        "zeros.vtu": bytes(1000),
        "wrong.vtu": data,
        "cut.msh": data[:-60],
        "half.msh": data[: len(data) // 2],
        "none.xyz": data,
        "noending": data,
        "picture.inp": b"\x89PNG\r\n" + bytes(range(256)),
        "many.msh": b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 999999999999 1 999999999999\n"
        b"2 1 0 999999999999\n1\n",
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    for name in [*contents, "folder.msh", "pipe.msh", "missing.msh"]:
        with pytest.raises(InputError, match=name) as caught:
            load_mesh(tmp_path / name)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 500
    monkeypatch.setattr(mesh_formats, "MOST_BYTES", 10)
    with pytest.raises(InputError, match="bytes"):
        load_mesh(good)
    monkeypatch.undo()
    meshio.write(
        tmp_path / "a.dat", meshio.Mesh(SQUARE[:, :2], [("quad", TWO)]), file_format="tecplot"
    )
    (tmp_path / "cut.dat").write_bytes((tmp_path / "a.dat").read_bytes()[:-40])
    (tmp_path / "a.off").write_text("OFF\n")
    (tmp_path / "a.h5m").write_text("x")
    # whose readers wait for the end of a file for ever, or end in words of Python
    for limit, value, name in (
        ("PATIENCE", (1.0, 0.0), "cut.dat"),
        ("WORK", (1.0, 0.0), "a.off"),
        ("WORK", (9.0, 0.0), "a.h5m"),
    ):
        monkeypatch.setattr(mesh_formats, limit, value)
        with pytest.raises(InputError, match=r"no end after 1 s|a number or a word is not"):
            load_mesh(tmp_path / name)
        monkeypatch.undo()


def test_boundaries_by_place():
    mesh = name_boundaries(
        skfem.MeshQuad().refined(2),
        {"floor": {1: (0.0, 0.0)}, "part": {1: (1.0, 1.0), 0: (0.0, 0.5)}},
    )
    assert len(mesh.boundaries["floor"]) == 4 and len(mesh.boundaries["part"]) == 2
    with pytest.raises(
        InputError, match=r"no facet.*'roof'; the body reaches from \(0, 0\) to \(1, 1\)"
    ):
        name_boundaries(mesh, {"roof": {1: (2.0, 2.0)}})
    with pytest.raises(InputError, match="scale"):
        load_mesh("a.msh", scale=-1)


@pytest.mark.parametrize(
    "apart,words", [(3e-6, None), (2e-5, "nodes .* too far for one node and too near for two")]
)
@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e6])
def test_a_seam_closes_in_whole_or_is_refused(tmp_path, caplog, unit, apart, words):
    """Nodes of a seam lie apart by lengths about those at which they are taken for one."""
    grids = [
        skfem.MeshQuad.init_tensor(np.linspace(i, i + 1, 21), np.linspace(0, 1, 21)) for i in (0, 1)
    ]
    moved = grids[1].p + apart * np.random.default_rng(0).uniform(-1, 1, grids[1].p.shape)
    points = unit * np.pad(np.concatenate([grids[0].p, moved], axis=1).T, [(0, 0), (0, 1)])
    path = write(
        tmp_path / "a.vtu",
        points,
        [("quad", np.concatenate([grids[0].t, grids[1].t + 441], axis=1).T)],
    )
    if words:
        with pytest.raises(InputError, match=words):
            load_mesh(path)
    else:
        assert load_mesh(path).p.shape[1] == 2 * 441 - 21 and "21 pairs, at most" in caplog.text


@pytest.mark.parametrize("small", [1e-4, 1e-5])
def test_fine_facets_of_second_order_far_from_the_origin(tmp_path, small):
    ticks = np.concatenate([[0], np.geomspace(small, 1, 20)])
    mesh = skfem.MeshTri2.from_mesh(skfem.MeshTri.init_tensor(ticks, ticks))
    x, y = mesh.doflocs
    bent = skfem.MeshTri2(np.stack([x + 0.1 * y**2, y + 0.2 * x * y]) + 3, mesh.t)
    written = skfem.io.meshio.to_meshio(bent, encode_cell_data=False)
    found = load_mesh(
        write(tmp_path / "a.vtu", np.pad(written.points, [(0, 0), (0, 1)]), written.cells)
    )
    assert found.nelements == 800 and volume(found) == pytest.approx(volume(bent), rel=1e-12)


def test_neighbours_that_do_not_share_a_node_within_their_edge_are_refused(tmp_path):
    middles = [[0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5], [0.5, 0.5], [0.6, 0.5]]
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], *middles])
    points = np.pad(points, [(0, 0), (0, 1)])
    for other, words in (
        (9, "not share the nodes"),
        (4, "not share the nodes"),
        (2, "a corner of one element"),
    ):
        cells = [("triangle6", [[0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 6, other]])]
        with pytest.raises(InputError, match=words):
            load_mesh(write(tmp_path / "a.vtu", points[:10] if other == 9 else points[:9], cells))


SU2 = (
    "% a square of two kinds of triangles\nNDIME= 2\nNELEM= 2\n5 0 1 2 0\n5 0 2 3 1\nNPOIN= 4\n"
    "0. 0. 0\n1. 0. 1\n1. 1. 2\n0. 1. 3\nNMARK= 3\nMARKER_TAG= 1\nMARKER_ELEMS= 1\n3 0 1\n"
    "MARKER_TAG= w\u00e4nd\nMARKER_ELEMS= 2\n3 1 2\n3 2 3\nMARKER_TAG= 2\nMARKER_ELEMS= 1\n3 3 0\n"
)


# a square of two triangles with a line below it
MSH2 = (
    '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n1 3 "low"\n$EndPhysicalNames\n'
    "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n$Elements\n3\n1 1 2 3 3 1 2\n"
    "2 2 2 7 7 1 2 3\n3 2 2 7 7 1 3 4\n$EndElements\n"
)

VIEW = '$NodeData\n1\n"T"\n1\n0.0\n3\n0\n1\n1\n2 20.5\n$EndNodeData\n'

MEDIT = (
    "MeshVersionFormatted 2\nDimension 2\nVertices\n4\n0 0 0\n1 0 0 # corner\n1. 1e0 0\n0 1 0\n"
    "Edges\n1\n1 2 3\nTriangles\n2\n1 2 3 7\n1 3 4 7\nCorners\n2\n1\n2\nEnd\n"
)


@pytest.mark.parametrize(
    "name, text, low",
    [
        ("a.msh", MSH2 + VIEW, "low"),
        ("a.msh", MSH2 + VIEW + VIEW.replace("Node", "Element").replace("T", "s"), "low"),
        ("a.msh", MSH2.replace("2 2 2 7 7 1", "2 2 0 1"), "low"),  # elements without tags
        ("a.msh", MSH2.replace("3 2 2 7 7 1", "3 2 4 7 7 1 1 1"), "low"),  # of a partition
        ("a.msh", MSH2.replace('"low"', '"my "low" side"'), 'my "low" side'),
        ("a.mesh", MEDIT, "3"),
        ("a.mesh", " ".join(MEDIT.replace(" # corner", "").split()), "3"),
        ("a.mesh", MEDIT.replace(" ", "\n").replace("#\ncorner", ""), "3"),
    ],
)
def test_results_are_passed_over_and_free_formats_are_free(tmp_path, name, text, low):
    (tmp_path / name).write_text(text, "utf-8")
    mesh = load_mesh(tmp_path / name)
    assert volume(mesh) == pytest.approx(1) and len(mesh.boundaries[low]) == 1
    for end in range(20, len(text) - 4, 9):  # a file that is cut has its volume, or is refused
        (tmp_path / name).write_text(text[:end])
        try:
            assert volume(load_mesh(tmp_path / name)) == pytest.approx(1)
        except InputError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize("name, text, words", [
    ("a.mesh", MEDIT.replace("Edges", "Polygons"), "line 9: Polygons are not read"),
    ("a.msh", MSH2.replace("7 7 1 3 4", "7 7 1 3 9"), "an element names a node that is not"),
    ("a.msh", MSH2.replace("3 1 1 0", "3 1 x 0"), "a number or a word is not where"),
    ("a.mesh", MEDIT.replace("Dimension 2\n", ""), "must stand before Vertices"),
    ("a.mesh", MEDIT.replace("1 3 4 7", "1 3 4"),
     "Triangles: 2 times 4 numbers are announced, and 7"),
    ("a.su2", SU2.replace("5 0 1 2 0", "22 0 1 2 4 5 6 0"), r"line 4: elements of type 22"),
    ("a.su2", SU2 + "NDIME= 2\n", r"line 22: it has several zones"),
    ("a.su2", SU2[:-6], "ends before row 1 of MARKER_ELEMS"),
    ("a.mesh", "MeshVersionFormatted 2\nDimension 3\nTetrahedraP2\n",
     r"line 3: TetrahedraP2 are not read"),
    ("a.unv", "    -1\n  2411\n", "its ending names no format"),
    ("a.STEP", "ISO-10303-21;\n", "CAD program, of which `contactopt mesh` makes a mesh"),
])  # fmt: skip
def test_markers_of_su2_keep_their_names_and_second_orders_are_refused(tmp_path, name, text, words):
    """A number and a name that meshio counts to the same number are two boundaries."""
    (tmp_path / "whole.su2").write_text(SU2, "utf-8")
    sides = load_mesh(tmp_path / "whole.su2").boundaries
    assert {side: len(facets) for side, facets in sides.items()} == {"1": 1, "w\u00e4nd": 2, "2": 1}
    (tmp_path / name).write_text(text, "utf-8")
    with pytest.raises(InputError, match=words):
        load_mesh(tmp_path / name)
