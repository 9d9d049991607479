"""Meshes from files: geometry and groups as they were written, faults repaired or refused in a
sentence.
"""

import logging
import os

import meshio
import numpy as np
import pytest
import skfem
import skfem.io.meshio

from contactopt import InputError, load_mesh
from contactopt.meshes import mesh_formats
from contactopt.meshes.mesh_files import load_bodies, name_boundaries

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
TWO = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])


def volume(mesh):
    return skfem.Basis(mesh, mesh.elem(), intorder=6).dx.sum()


def flux(mesh, boundary=None):
    """Integral of x .

    n, the normal as contact uses it; dim times the volume on the whole surface.
    """
    facets = mesh.boundary_facets() if boundary is None else mesh.boundaries[boundary]
    at = skfem.FacetBasis(mesh, mesh.elem(), facets=facets, intorder=8)
    return np.sum(np.asarray(at.normals) * np.asarray(at.global_coordinates()) * at.dx)


def write(path, points, cells, **more):
    meshio.write(path, meshio.Mesh(points, cells, **more))
    return path


@pytest.fixture
def gmsh():
    import gmsh as module

    module.initialize(interruptible=False)
    module.option.setNumber("General.Terminal", 0)
    yield module
    module.finalize()


def disc_in_plate(gmsh, path, dim, order, recombine=False, incomplete=False, version=4.1):
    """A disc (cylinder) of radius 1 in a square plate of side 4, conforming, with a group 'rim'
    between them.
    """
    for option, value in {
        "Mesh.SecondOrderIncomplete": incomplete, "Mesh.RecombineAll": recombine,
        "Mesh.MeshSizeMax": 0.3 if dim == 2 else 0.7, "Mesh.MshFileVersion": version,
    }.items():  # fmt: skip
        gmsh.option.setNumber(option, float(value))
    if dim == 2:
        tools = (
            [(2, gmsh.model.occ.addRectangle(-2, -2, 0, 4, 4))],
            [(2, gmsh.model.occ.addDisk(0, 0, 0, 1, 1))],
        )
    else:
        box, cylinder = (
            gmsh.model.occ.addBox(-2, -2, 0, 4, 4, 1),
            gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1),
        )
        tools = [(3, box)], [(3, cylinder)]
    gmsh.model.occ.fragment(*tools)
    gmsh.model.occ.synchronize()
    disc, plate = sorted(
        (tag for _, tag in gmsh.model.getEntities(dim)),
        key=lambda tag: gmsh.model.occ.getMass(dim, tag),
    )
    rim = [tag for _, tag in gmsh.model.getBoundary([(dim, disc)], oriented=False)]
    rim = [tag for tag in rim if dim == 2 or gmsh.model.getType(2, tag) == "Cylinder"]
    gmsh.model.addPhysicalGroup(dim, [disc], name="disc")
    gmsh.model.addPhysicalGroup(dim, [plate], name="plate")
    gmsh.model.addPhysicalGroup(dim - 1, rim, name="rim")
    gmsh.model.mesh.generate(dim)
    gmsh.model.mesh.setOrder(order)
    gmsh.write(str(path))
    return path


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize(
    "dim,order,recombine,incomplete,kind",
    [
        (2, 1, False, False, "MeshTri1"),
        (2, 1, True, False, "MeshQuad1"),
        (2, 2, False, False, "MeshTri2"),
        (2, 2, True, False, "MeshQuad2"),
        (2, 2, True, True, "MeshQuad2"),
        (3, 1, False, False, "MeshTet1"),
        (3, 2, False, False, "MeshTet2"),
    ],
)
def test_gmsh_parts_share_a_rim_with_opposite_normals(
    gmsh, tmp_path, version, dim, order, recombine, incomplete, kind
):
    path = disc_in_plate(gmsh, tmp_path / "a.msh", dim, order, recombine, incomplete, version)
    disc, plate = load_mesh(path, "disc"), load_mesh(path, "plate", scale=10)
    assert type(disc).__name__ == type(plate).__name__ == kind
    assert volume(disc) + volume(plate) / 10**dim == pytest.approx(16, rel=1e-12)  # 4 x 4 (x 1)
    assert volume(disc) == pytest.approx(np.pi, rel={1: 0.15, 2: 3e-3}[order])
    for mesh in (disc, plate):
        # every normal points outward
        assert flux(mesh) == pytest.approx(dim * volume(mesh), rel=1e-9)
    assert flux(disc, "rim") == pytest.approx(-flux(plate, "rim") / 10**dim, rel=1e-12)
    assert flux(disc, "rim") > 0
    with pytest.raises(InputError, match=r"no group 'ring'.*groups of elements are disc, plate"):
        load_mesh(path, "ring")
    with pytest.raises(InputError, match="'rim' is a group of facets, a boundary"):
        load_mesh(path, "rim")


def test_gmsh_files_whose_points_and_edges_belong_to_no_group(gmsh, tmp_path):
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.SaveAll", 1.0)
    square = gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [square])
    gmsh.model.addPhysicalGroup(1, [1], name="low side")
    gmsh.model.addPhysicalGroup(1, [1, 3], name="both")
    gmsh.model.mesh.generate(2)
    gmsh.write(str(tmp_path / "a.msh"))
    mesh = load_mesh(tmp_path / "a.msh", "1")
    assert volume(mesh) == pytest.approx(2.0) and set(mesh.boundaries) == {"low side", "both"}
    assert np.all(mesh.p[1, mesh.facets[:, mesh.boundaries["low side"]]] == 0)
    assert set(mesh.boundaries["low side"]) < set(mesh.boundaries["both"])


def test_other_versions_of_gmsh_files_are_named(tmp_path):
    (tmp_path / "a.msh").write_text("$MeshFormat\n3 0 8\n$EndMeshFormat\n")
    (tmp_path / "b.msh").write_text("$NOD\n0\n$ENDNOD\n")
    (tmp_path / "c.msh").write_text("$MeshFormat\n4 0 8\n$EndMeshFormat\n")
    for name, number in (("a", 3), ("b", 1), ("c", 4)):
        with pytest.raises(
            InputError, match=f"version {number} of Gmsh's format; save it in version 4.1 or 2.2"
        ):
            load_mesh(tmp_path / f"{name}.msh")


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
        ("a.msh", {"file_format": "gmsh22"}),
        ("b.msh", {"file_format": "gmsh"}),
        ("a.vtu", {}),
        ("a.vtk", {}),
        ("a.inp", {}),
        ("a.mesh", {}),
        ("a.nas", {}),
        ("a.xdmf", {"data_format": "XML"}),
        ("a.dat", {"file_format": "tecplot"}),
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


def test_sets_of_abaqus_and_numbers_without_names(tmp_path):
    path = write(
        tmp_path / "a.inp",
        SQUARE,
        [("quad", TWO)],
        point_sets={"floor": np.array([0, 1, 2]), "corner": np.array([0])},
        cell_sets={"left": [np.array([0])], "right": [np.array([1])]},
    )
    whole, left = load_mesh(path), load_mesh(path, "left")
    assert whole.nelements == 2 and left.nelements == 1
    assert (
        set(whole.boundaries) == {"floor"}
        and len(whole.boundaries["floor"]) == 2
        and len(left.boundaries["floor"]) == 1
    )
    tags = {"gmsh:physical": [np.array([3, 4])]}
    path = write(
        tmp_path / "a.vtu", SQUARE, [("quad", TWO)], cell_data={"part": [np.array([3, 4])]}
    )
    assert load_mesh(path, "part=4").p[0].min() == 1
    both = meshio.Mesh(
        SQUARE, [("quad", TWO)], cell_data=tags | {"gmsh:geometrical": tags["gmsh:physical"]}
    )
    path = tmp_path / "a.msh"
    meshio.write(path, both, file_format="gmsh22")
    assert load_mesh(path, "4").p[0].min() == 1


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
    assert (
        mesh.nelements == 2 and mesh.p.shape[1] == 6 and volume(mesh) == pytest.approx(2, rel=1e-8)
    )
    assert flux(mesh) == pytest.approx(4)
    for what in (
        "nodes that lie on others",
        "1 element is there twice",
        "quad number 2 of the file",
        "3 nodes of the file",
    ):
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
    refused(
        "mixes elements of type quad and triangle",
        SQUARE,
        [("quad", TWO[:1]), ("triangle", [[1, 2, 5]])],
    )
    lost = SQUARE.copy()
    lost[5, 1] = np.nan
    refused("coordinates of node 6", lost, [("quad", TWO)])
    refused("a quad names a node that is not there", SQUARE, [("quad", [[0, 1, 4, 33]])])
    refused("no elements of a body", SQUARE, [("line", [[0, 1]])])
    refused(
        "type 'wedge' cannot be used",
        np.random.default_rng(0).random((6, 3)),
        [("wedge", [[0, 1, 2, 3, 4, 5]])],
    )
    apart = np.concatenate([SQUARE[[0, 1, 4, 3]], SQUARE[[1, 2, 5, 4]] + [1, 0, 0]])
    two = [("quad", np.arange(8).reshape(2, 4))]
    refused("falls into 2 pieces that share no node; mesh it in one piece", apart, two)
    refused(
        "choose the body by its group, one of part=1, part=2",
        apart,
        two,
        cell_data={"part": [np.array([1, 2])]},
    )
    fan = [[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [2, 0.5, 0]]
    refused(
        "more than two elements share a facet",
        fan,
        [("triangle", [[0, 2, 1], [0, 1, 3], [0, 4, 1]])],
    )
    curved = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.1, 0.1, 0], [0, 0.5, 0]])
    refused("triangle6 number 1 of the file.* folds over", curved, [("triangle6", [range(6)])])


def test_coincident_nodes_of_two_bodies_stay_apart(tmp_path):
    points = np.concatenate([SQUARE[[0, 1, 4, 3]], SQUARE[[1, 2, 5, 4]]])
    path = write(
        tmp_path / "a.vtu",
        points,
        [("quad", np.arange(8).reshape(2, 4))],
        cell_data={"part": [np.array([1, 2])]},
    )
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


TWO_BODIES = """*Heading
** two bricks, each with its own block of nodes, as CalculiX takes them
*NODE, NSET=NLOW
{low}
*ELEMENT, TYPE=C3D20R, ELSET=LOW
1,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,
16,17,18,19,20
*Node
{up}
*Element, type=c3d20r, elset=up
 7,101,102,103,104,105,106,107,108,109,110,111,112,113,114,115,
116,117,118,119,120
*ELEMENT, TYPE=SPRINGA, ELSET=SPRINGS
9, 1, 101
*NSET, NSET=FLOOR
1, 2, 3, 4,
*NSET, NSET=RANGE, GENERATE
5, 8, 1
*NSET, NSET=BOTH
FLOOR, range, 101
*ELSET, ELSET=ALL
LOW, up
*SURFACE, NAME=TOUCH
up, S1
LOW, S2
*STEP
*NODE PRINT, NSET=FLOOR
U
*END STEP
"""


def brick_of_twenty(height, first):
    """Lines of the nodes of a brick of second order, numbered from `first`."""
    corners = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]]
    )
    edges = [
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 0),
        (4, 5),
        (5, 6),
        (6, 7),
        (7, 4),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
    ]
    places = np.concatenate([corners, [corners[list(edge)].mean(axis=0) for edge in edges]])
    return "\n".join(f"{first + i}, {x}, {y}, {z + height}" for i, (x, y, z) in enumerate(places))


def test_two_bodies_of_calculix_with_their_own_nodes_sets_and_surfaces(tmp_path):
    (tmp_path / "nodes.inc").write_text("*NODE\n" + brick_of_twenty(1.0, 101) + "\n")
    text = TWO_BODIES.format(low=brick_of_twenty(0.0, 1), up=brick_of_twenty(1.0, 101))
    included = text.replace("*Node\n" + brick_of_twenty(1.0, 101), "*INCLUDE, INPUT=nodes.inc")
    for content in (text, included):
        (tmp_path / "two.inp").write_text(content)
        low, up = load_mesh(tmp_path / "two.inp", "LOW"), load_mesh(tmp_path / "two.inp", "up")
        for mesh, z in ((low, 0), (up, 1)):
            assert type(mesh) is skfem.MeshHex2 and volume(mesh) == pytest.approx(1.0)
            assert (mesh.p[2].min(), mesh.p[2].max()) == (z, z + 1)
            assert flux(mesh, "TOUCH") == pytest.approx(1 - 2 * z)
        assert flux(low, "FLOOR") == pytest.approx(0) and flux(low, "RANGE") == pytest.approx(1)
        assert len(low.boundaries["BOTH"]) == 6 and "FLOOR" not in up.boundaries
    for old, new, words in (
        ("101,102", "999,102", "names a node that is not there"),
        ("16,17,18,19,20\n*Node", "16,17,18,19\n*Node", "line 25: an element C3D20R lacks"),
        ("*Heading", "*INCLUDE, INPUT=two.inp", "include each other"),
        ("TYPE=C3D20", "TYPE=C3D21", "elements of type C3D21R are not known"),
        ("up, S1", "upper, S1", "there is no set upper of elements"),
        ("FLOOR, range", "FLOOR, RANGES", "there is no set RANGES of nodes"),
    ):
        (tmp_path / "two.inp").write_text(text.replace(old, new))
        with pytest.raises(InputError, match=words):
            load_mesh(tmp_path / "two.inp", "LOW")


ASSEMBLY = """*Heading
*Part, name=Brick
*Node
{brick}
*Element, type=C3D20, elset=All
1, 1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,
16,17,18,19,20
*Nset, nset=Under
1, 2, 3, 4
*Elset, elset=_Over_S2, internal
1,
*Surface, type=ELEMENT, name=Over
_Over_S2, S2
*Surface, type=ELEMENT, name=Skin
All
*End Part
*Part, name=Tool
*Surface, type=SEGMENTS, name=Rigid
START, 0., 0.
*End Part
*Assembly, name=Assembly
*Instance, name=Low, part=Brick
*End Instance
*Instance, name=Up, part=Brick
 0., 0., 3.
 0., 0., 3., 0., 1., 3., 90.
*End Instance
*Instance, name=Tool-1, part=TOOL
*End Instance
*Nset, nset=Foot, instance=Low
1, 2, 3, 4
*Nset, nset=Side, instance=Up
Under
*Nset, nset=Under, instance=Low
5, 6, 7, 8
*Elset, elset=Both
Low.All, Up.1
*Surface, type=ELEMENT, name=Front
Low._Over_S2, S3
*End Assembly
"""


def test_instances_of_a_part_have_their_places_and_their_own_sets(tmp_path):
    """The upper brick is lifted by 3 and turned by a quarter about the edge y at that height:
    (x, y, z) goes to (z, y, 3 - x).
    """
    path, text = tmp_path / "two.inp", ASSEMBLY.format(brick=brick_of_twenty(0.0, 1))
    path.write_text(text)
    low, up = load_mesh(path, "Low"), load_mesh(path, "Up")
    for mesh, z in ((low, 0), (up, 2)):
        assert volume(mesh) == pytest.approx(1.0)
        np.testing.assert_allclose(mesh.p.min(axis=1), [0, 0, z], atol=1e-12)
        assert len(mesh.boundaries["Skin"]) == 6 and flux(mesh, "Skin") == pytest.approx(3.0)
    assert set(low.boundaries) == {"Foot", "Under", "Low.Under", "Over", "Front", "Skin"}
    assert set(up.boundaries) == {"Side", "Up.Under", "Over", "Skin"}
    for mesh, name, axis, value in (
        (low, "Foot", 2, 0.0), (low, "Low.Under", 2, 0.0), (low, "Under", 2, 1.0),
        (low, "Over", 2, 1.0), (low, "Front", 1, 0.0),
        (up, "Side", 0, 0.0), (up, "Up.Under", 0, 0.0), (up, "Over", 0, 1.0),
    ):  # fmt: skip
        corners = mesh.p[axis, mesh.facets[:, mesh.boundaries[name]]]
        np.testing.assert_allclose(corners, value, atol=1e-12)
    for old, new, words in (
        ("Low.All, Up.1", "Low.All, Up.None", "there is no set None of elements"),
        ("instance=Low", "instance=Lowest", "there is no instance Lowest"),
        ("part=TOOL", "part=Toll", "is of part Toll, which is not above; parts: brick, tool"),
    ):
        path.write_text(text.replace(old, new))
        with pytest.raises(InputError, match=words):
            load_mesh(path, "Low")
    path.write_text(text)
    with pytest.raises(InputError, match="no group 'Tool-1'; its groups of elements are Low, Up"):
        load_mesh(path, "Tool-1")
    with pytest.raises(InputError, match="falls into 2 pieces"):
        load_mesh(path, "Both")
    bodies, refused = load_bodies(path)
    assert set(bodies) == {"Low", "Up"} and len(refused) == 3
    assert any("'Both' is the same as" in told or "same as 'Both'" in told for told in refused)


def test_sets_of_the_elements_of_a_body_are_no_bodies(tmp_path):
    """Abaqus writes an internal set of elements for each surface. A set of all elements of two
    bodies is none either, and hides none.
    """
    path = tmp_path / "strip.inp"
    nodes = "\n".join(f"{i + 3 * j + 1}, {i}, {j}" for j in range(2) for i in range(3))
    path.write_text(
        f"*Node\n{nodes}\n11, 5, 0\n12, 6, 0\n13, 6, 1\n14, 5, 1\n"
        "*Element, type=CPE4, elset=Strip\n1, 1, 2, 5, 4\n2, 2, 3, 6, 5\n"
        "*Element, type=CPE4, elset=Block\n3, 11, 12, 13, 14\n*Elset, elset=All\n1, 2, 3\n"
        "*Elset, elset=_Over_S3, internal\n2\n*Surface, type=ELEMENT, name=Over\n_Over_S3, S3\n"
    )
    bodies, refused = load_bodies(path)
    assert list(bodies) == ["Strip", "Block"] and set(bodies["Strip"].boundaries) == {"Over"}
    assert "group '_Over_S3' is a part of 'Strip'" in refused and len(refused) == 2


def exodus_bricks(path, hdf5):
    """Two bricks of twenty nodes, one on the other, and a tetrahedron beside them."""
    places = np.array([
        [float(word) for word in line.split(",")[1:]]
        for z in (0.0, 1.0) for line in brick_of_twenty(z, 1).splitlines()
    ])  # fmt: skip
    corners = np.array([[5, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1.0]])
    # edges: those below, those along the third axis, those above
    order = np.array([*range(12), 16, 17, 18, 19, 12, 13, 14, 15]) + 1
    letters = np.zeros((3, 8), dtype="S1")
    for row, name in zip(letters, ("low", "up", "tip")):
        row[: len(name)] = list(name)
    values = {
        "coordx": np.append(places[:, 0], corners[:, 0]),
        "coordy": np.append(places[:, 1], corners[:, 1]),
        "coordz": np.append(places[:, 2], corners[:, 2]),
        "eb_prop1": np.array([10, 20, 30]), "eb_names": letters,
        "connect1": order[None], "connect2": order[None] + 20,
        "connect3": np.array([[41, 42, 43, 44]]),
        "ss_prop1": np.arange(1, 7),
        **{f"elem_ss{k}": np.array([1, 2, 3][: 3 if k < 5 else 2]) for k in range(1, 7)},
        **{f"side_ss{k}": np.full(3 if k < 5 else 2, k) for k in range(1, 7)},
        "ns_prop1": np.array([7]), "node_ns1": np.array([1, 2, 3, 4]),
    }  # fmt: skip
    kinds = {"connect1": "HEX20", "connect2": "HEX20", "connect3": "TETRA4"}
    if hdf5:
        with pytest.importorskip("h5py").File(path, "w") as file:
            for name, value in values.items():
                file[name] = value
            for name, kind in kinds.items():
                file[name].attrs["elem_type"] = np.bytes_(kind)
        return
    from scipy.io import netcdf_file

    with netcdf_file(path, "w") as file:
        for name, value in values.items():
            lengths = tuple(f"{name}_{axis}" for axis in range(value.ndim))
            for length, size in zip(lengths, value.shape):
                file.createDimension(length, size)
            value = value if value.dtype.kind != "i" else value.astype("i4")
            file.createVariable(name, value.dtype, lengths)[:] = value
        for name, kind in kinds.items():
            file.variables[name].elem_type = kind


@pytest.mark.parametrize("hdf5", [False, True])
def test_exodus_files_keep_the_names_of_blocks_and_their_side_sets(tmp_path, hdf5):
    path = tmp_path / "bricks.exo"
    exodus_bricks(path, hdf5)
    low, up, tip = (load_mesh(path, name) for name in ("low", "up", "tip"))
    assert type(up) is skfem.MeshHex2 and type(tip) is skfem.MeshTet1
    for mesh, size in ((low, 1.0), (up, 1.0), (tip, 1 / 6)):
        assert volume(mesh) == pytest.approx(size) and flux(mesh) == pytest.approx(3 * size)
    # of a brick: (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (1, 5, 8, 4), (1, 4, 3, 2), (5, 6, 7, 8)
    for side, (axis, value) in enumerate(((1, 0), (0, 1), (1, 1), (0, 0), (2, 0), (2, 1)), 1):
        for mesh, z in ((low, 0), (up, 1)):
            corners = mesh.p[:, mesh.facets[:, mesh.boundaries[f"side {side}"]]]
            assert corners.shape[2] == 1
            np.testing.assert_allclose(corners[axis], value + (z if axis == 2 else 0), atol=1e-12)
    for side, axis in ((1, 1), (3, 0), (4, 2)):  # of a tetrahedron; its second side is oblique
        corners = tip.p[:, tip.facets[:, tip.boundaries[f"side {side}"]]]
        np.testing.assert_allclose(corners[axis], 5.0 if axis == 0 else 0.0, atol=1e-12)
    assert set(low.boundaries) == {"nodes 7", *(f"side {k}" for k in range(1, 7))}
    with pytest.raises(InputError, match="its groups of elements are low, up, tip"):
        load_mesh(path, "middle")
    path.write_bytes(path.read_bytes()[: 400 if not hdf5 else 1000])
    with pytest.raises(InputError, match="cannot be read as exodus"):
        load_mesh(path)


def test_exodus_blocks_and_sides_that_are_not_known_are_refused(tmp_path):
    """What a file names is read or refused; shells on a brick are a surface of it."""
    h5py = pytest.importorskip("h5py")

    def change(**values):
        exodus_bricks(tmp_path / "a.exo", True)
        with h5py.File(tmp_path / "a.exo", "a") as file:
            for name, (value, kind) in values.items():
                if name in file:
                    del file[name]
                file[name] = np.array(value)
                if kind:
                    file[name].attrs["elem_type"] = np.bytes_(kind)
        return load_mesh(tmp_path / "a.exo", "low")

    for values in (
        {"connect3": ([[41, 42, 43, 44]], "NSIDED")}, {"side_ss1": ([1, 7, 1], "")},
        {"elem_ss1": ([1, 2, 4], "")}, {"node_ns1": ([1, 2, 99], "")},
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"not known|not there"):
            change(**values)
    low = change(connect3=([[1, 2, 3, 4]], "SHELL4"), elem_ss1=([3], ""), side_ss1=([2], ""))
    assert len(low.boundaries["tip"]) == len(low.boundaries["side 1"]) == 1
    assert flux(low, "tip") == pytest.approx(0) and volume(low) == pytest.approx(1)


def test_groups_of_med_files_keep_their_names(gmsh, tmp_path):
    pytest.importorskip("h5py")
    disc_in_plate(gmsh, tmp_path / "a.msh", 3, 2)
    gmsh.write(str(tmp_path / "a.med"))
    for name in ("disc", "plate"):
        own, other = (load_mesh(tmp_path / file, name) for file in ("a.msh", "a.med"))
        assert set(own.boundaries) == set(other.boundaries) == {"rim"}
        assert other.nelements == own.nelements
        assert volume(other) == pytest.approx(volume(own), rel=1e-12)
        assert flux(other, "rim") == pytest.approx(flux(own, "rim"), rel=1e-12)


@pytest.mark.parametrize("kind,count", [("CAX8R", 8), ("CPE4", 4), ("CPS6", 6), ("CAX3", 3)])
def test_plane_elements_of_calculix(tmp_path, kind, count):
    corners = [[1, 0], [2, 0], [2, 1], [1, 1]] if count in (4, 8) else [[1, 0], [2, 0], [1, 1]]
    places = np.array(corners, dtype=float)
    if count in (6, 8):
        places = np.concatenate([places, (places + np.roll(places, -1, axis=0)) / 2])
    lines = [f"{10 * i + 10}, {x}, {y}" for i, (x, y) in enumerate(places)]
    names = ", ".join(str(10 * i + 10) for i in range(count))
    text = "\n".join(
        ["*NODE", *lines, f"*ELEMENT, TYPE={kind}", f"3, {names}", "*SURFACE, NAME=LOW", "3, S1"]
    )
    (tmp_path / "a.inp").write_text(text)
    mesh = load_mesh(tmp_path / "a.inp")
    assert volume(mesh) == pytest.approx(1 if count in (4, 8) else 0.5)
    assert np.all(mesh.p[1, mesh.facets[:, mesh.boundaries["LOW"]]] == 0)


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
    points = np.array(
        [
            [0, 0],
            [1, 0],
            [1, 1],
            [0, 1],
            [0.5, 0],
            [1, 0.5],
            [0.5, 1],
            [0, 0.5],
            [0.5, 0.5],
            [0.6, 0.5],
        ]
    )
    points = np.pad(points, [(0, 0), (0, 1)])
    for other, words in (
        (9, "not share the nodes"),
        (4, "not share the nodes"),
        (2, "a corner of one element"),
    ):
        cells = [("triangle6", [[0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 6, other]])]
        with pytest.raises(InputError, match=words):
            load_mesh(write(tmp_path / "a.vtu", points[:10] if other == 9 else points[:9], cells))


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_damaged_binary_files_of_second_order_end_in_a_sentence(gmsh, tmp_path, version):
    gmsh.option.setNumber("Mesh.Binary", 1.0)
    path = disc_in_plate(gmsh, tmp_path / "a.msh", 2, 2, version=version)
    good, random = path.read_bytes(), np.random.default_rng(int(10 * version))
    assert load_mesh(path, "disc").boundaries["rim"].size
    for _ in range(4):
        data = bytearray(good)
        for place in random.integers(60, len(data), 4):
            data[place] = random.integers(256)
        path.write_bytes(data)
        try:
            load_mesh(path, "disc")
        except InputError as error:
            assert "\n" not in str(error)


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_binary_gmsh_files_are_read_as_text_ones_and_damage_ends_in_one_sentence(tmp_path, version):
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
        gmsh.model.occ.addDisk(0, 0, 0, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="body")
        gmsh.model.addPhysicalGroup(1, [1], name="edge")
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(tmp_path / f"{binary}.msh"))
    finally:
        gmsh.finalize()
    text, binary = (mesh_formats.read_groups(tmp_path / f"{i}.msh") for i in (0, 1))
    assert np.allclose(text.points, binary.points, rtol=0, atol=1e-15)
    for (kind, nodes, _), (other, own, _) in zip(text.blocks, binary.blocks, strict=True):
        assert kind == other and np.array_equal(nodes, own)
    assert binary.names(2) == ["body"] and binary.names(1) == ["edge"]
    for key, found in text.members.items():
        assert all(np.array_equal(members, binary.members[key][i]) for i, members in found.items())
    data, rng, refused = (tmp_path / "1.msh").read_bytes(), np.random.default_rng(0), 0
    for trial in range(40 if version == "4.1" else 6):  # 2.2 is read by another process
        bad = np.frombuffer(data, np.uint8).copy()
        bad[rng.integers(30, len(bad), 5)] = rng.integers(0, 256, 5)
        (tmp_path / "bad.msh").write_bytes(
            bad[: rng.integers(len(bad)) if trial % 2 else None].tobytes()
        )
        try:
            mesh_formats.read_groups(tmp_path / "bad.msh")
        except InputError as error:
            refused += "\n" not in str(error)
    assert refused > (trial + 1) / 2


@pytest.mark.parametrize("order,serendipity", [(1, 1), (2, 1), (2, 0)])
def test_formats_of_gmsh_hold_the_same_bricks(gmsh, tmp_path, caplog, order, serendipity):
    """A curved body of bricks, saved by Gmsh in every format: volume and area of the lower side."""
    occ = gmsh.model.occ
    line = occ.addLine(occ.addPoint(1, 0, 0), occ.addPoint(2, 0, 0))
    ring = occ.revolve([(1, line)], 0, 0, 0, 0, 0, 1, np.pi / 2, [3], recombine=True)
    face = next(tag for dim, tag in ring if dim == 2)
    made = occ.extrude([(2, face)], 0, 0, 1, [2], recombine=True)
    occ.synchronize()
    body = next(tag for dim, tag in made if dim == 3)
    gmsh.model.addPhysicalGroup(3, [body], 7, name="body")
    gmsh.model.addPhysicalGroup(2, [face], 8, name="low")
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", serendipity)
    gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
    gmsh.model.mesh.setTransfiniteCurve(line, 3)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    gmsh.write(str(tmp_path / "a.msh"))
    own = load_mesh(tmp_path / "a.msh", "body")
    for form, file in ((0, "a.bdf"), (1, "b.bdf"), (2, "c.bdf"), (0, "a.inp"), (0, "a.med")):
        gmsh.option.setNumber("Mesh.BdfFieldFormat", form)
        gmsh.option.setNumber("Mesh.SaveElementTagType", 2)
        gmsh.write(str(tmp_path / file))
        group, side = ("7", "8") if file.endswith("bdf") else ("body", "low")
        if file.endswith("bdf") and order == 2 and not serendipity:
            with pytest.raises(InputError, match="CHEXA has more than 20 nodes"):
                load_mesh(tmp_path / file, group)
            continue
        caplog.clear()
        other = load_mesh(tmp_path / file, group)
        assert volume(other) == pytest.approx(volume(own), rel=1e-4)
        assert flux(other, side) == pytest.approx(flux(own, "low"), rel=1e-4)
        assert not caplog.text


def test_families_of_med_may_be_missing(gmsh, tmp_path):
    h5py = pytest.importorskip("h5py")
    disc_in_plate(gmsh, tmp_path / "a.msh", 3, 2)
    gmsh.write(str(tmp_path / "a.med"))
    with h5py.File(tmp_path / "a.med", "a") as file:
        (mesh,) = file["ENS_MAA"].values()
        (step,) = mesh.values()
        del step["MAI/TR6/FAM"]
    disc = load_mesh(tmp_path / "a.med", "disc")
    assert volume(disc) == pytest.approx(volume(load_mesh(tmp_path / "a.msh", "disc")), rel=1e-12)
    assert "rim" not in (disc.boundaries or {})


def test_parametric_nodes_of_the_older_format_of_gmsh(gmsh, tmp_path):
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    for dim in (2, 3):
        disc_in_plate(gmsh, tmp_path / f"{dim}.msh", dim, 2, version=2.2)
        assert "$ParametricNodes" in (tmp_path / f"{dim}.msh").read_text()
        gmsh.option.setNumber("Mesh.SaveParametric", 0)
        gmsh.write(str(tmp_path / "plain.msh"))
        gmsh.option.setNumber("Mesh.SaveParametric", 1)
        for name in ("disc", "plate"):
            own, other = (load_mesh(tmp_path / f"{n}.msh", name) for n in (dim, "plain"))
            assert volume(own) == pytest.approx(volume(other), rel=1e-12)
            assert flux(own, "rim") == pytest.approx(flux(other, "rim"), rel=1e-12)
    text = (tmp_path / "3.msh").read_text()
    for cut in range(len(text) // 4, len(text) - 20, len(text) // 23):
        (tmp_path / "cut.msh").write_text(text[:cut])
        with pytest.raises(InputError, match=r"cannot be read|holds no"):
            load_mesh(tmp_path / "cut.msh", "disc")
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(tmp_path / "binary.msh"))
    with pytest.raises(InputError, match="parametric nodes"):
        load_mesh(tmp_path / "binary.msh", "disc")


def test_partitioned_files_of_gmsh_are_refused(gmsh, tmp_path):
    disc_in_plate(gmsh, tmp_path / "a.msh", 2, 1)
    gmsh.model.mesh.partition(2)
    gmsh.write(str(tmp_path / "a.msh"))
    with pytest.raises(InputError, match="partition"):
        load_mesh(tmp_path / "a.msh")


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


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("a.mesh", MEDIT.replace("Edges", "Polygons"), "line 9: Polygons are not read"),
        ("a.msh", MSH2.replace("7 7 1 3 4", "7 7 1 3 9"), "an element names a node that is not"),
        ("a.msh", MSH2.replace("3 1 1 0", "3 1 x 0"), "a number or a word is not where"),
        ("a.mesh", MEDIT.replace("Dimension 2\n", ""), "must stand before Vertices"),
        (
            "a.mesh",
            MEDIT.replace("1 3 4 7", "1 3 4"),
            "Triangles: 2 times 4 numbers are announced, and 7",
        ),
        ("a.su2", SU2.replace("5 0 1 2 0", "22 0 1 2 4 5 6 0"), r"line 4: elements of type 22"),
        ("a.su2", SU2 + "NDIME= 2\n", r"line 22: it has several zones"),
        ("a.su2", SU2[:-6], "ends before row 1 of MARKER_ELEMS"),
        (
            "a.mesh",
            "MeshVersionFormatted 2\nDimension 3\nTetrahedraP2\n",
            r"line 3: TetrahedraP2 are not read",
        ),
        ("a.unv", "    -1\n  2411\n", "its ending names no format"),
    ],
)
def test_markers_of_su2_keep_their_names_and_second_orders_are_refused(tmp_path, name, text, words):
    """A number and a name that meshio counts to the same number are two boundaries."""
    (tmp_path / "whole.su2").write_text(SU2, "utf-8")
    sides = load_mesh(tmp_path / "whole.su2").boundaries
    assert {side: len(facets) for side, facets in sides.items()} == {"1": 1, "w\u00e4nd": 2, "2": 1}
    (tmp_path / name).write_text(text, "utf-8")
    with pytest.raises(InputError, match=words):
        load_mesh(tmp_path / name)
