"""Bodies, sets and sides of files of Abaqus, CalculiX and Exodus keep their names."""

import meshio
import numpy as np
import pytest
import skfem
import skfem.io.meshio

from contactopt import InputError, load_mesh
from contactopt.meshes.mesh_files import load_bodies
from tests.mesh_samples import BRICK_EDGES, SQUARE, TWO, flux, volume, write


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
    assert set(whole.boundaries) == {"floor"} and len(whole.boundaries["floor"]) == 2
    assert len(left.boundaries["floor"]) == 1
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


def test_a_column_of_numbers_in_an_older_vtk_file_names_groups(tmp_path):
    points = " ".join(str(x) for x in SQUARE.ravel())
    (tmp_path / "a.vtk").write_text(
        "# vtk DataFile Version 3.0\ntwo\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 double\n"
        f"{points}\nCELLS 2 10\n4 0 1 4 3\n4 1 2 5 4\nCELL_TYPES 2\n9\n9\nCELL_DATA 2\n"
        "SCALARS part int 1\nLOOKUP_TABLE default\n3\n4\n"
    )
    assert load_mesh(tmp_path / "a.vtk", "part=4").p[0].min() == 1
    text = (tmp_path / "a.vtk").read_text()
    (tmp_path / "a.vtk").write_text(text.replace(f"POINTS 6 double\n{points}\n", ""))
    with pytest.raises(InputError, match=r"no nodes|cannot be read"):
        load_mesh(tmp_path / "a.vtk")


def brick_of_twenty(height, first):
    """Lines of the nodes of a brick of second order, numbered from `first`."""
    corners = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]]
    )
    places = np.concatenate([corners, [corners[list(edge)].mean(axis=0) for edge in BRICK_EDGES]])
    return "\n".join(f"{first + i}, {x}, {y}, {z + height}" for i, (x, y, z) in enumerate(places))


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
    """The upper brick is lifted by 3 and turned by a quarter about the edge y at that height."""
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
    """Abaqus writes an internal set of elements for each surface."""
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

    def change(body="low", **values):
        exodus_bricks(tmp_path / "a.exo", True)
        with h5py.File(tmp_path / "a.exo", "a") as file:
            for name, (value, kind) in values.items():
                if name in file:
                    del file[name]
                file[name] = np.array(value)
                if kind:
                    file[name].attrs["elem_type"] = np.bytes_(kind)
        return load_mesh(tmp_path / "a.exo", body)

    for values in (
        {"connect3": ([[41, 42, 43, 44]], "NSIDED")}, {"side_ss1": ([1, 7, 1], "")},
        {"elem_ss1": ([1, 2, 4], "")}, {"node_ns1": ([1, 2, 99], "")},
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"not known|not there") as caught:
            change(**values)
        assert "damaged" not in str(caught.value) or "connect3" not in values
    low = change(connect3=([[1, 2, 3, 4]], "SHELL4"), elem_ss1=([3], ""), side_ss1=([2], ""))
    assert len(low.boundaries["tip"]) == len(low.boundaries["side 1"]) == 1
    assert flux(low, "tip") == pytest.approx(0) and volume(low) == pytest.approx(1)
    # blocks and sets of one name are one; triangles in space are shells with two faces
    same = np.array([list(b"low "), list(b"low "), list(b"tip ")], dtype="u1").view("S1")
    base = {"ns_prop1": ([7, 8], ""), "ns_names": (same[:2], ""), "node_ns2": ([3, 4], "")}
    both = change(eb_names=(same, ""), node_ns1=([1, 2], ""), **base)
    assert volume(both) == pytest.approx(2) and len(both.boundaries["low"]) == 1
    names = (np.repeat(same, [1, 1, 2], axis=0), "")
    skin = {"eb_prop1": ([1, 2, 3, 4], ""), "eb_names": names, "connect4": ([[41, 42, 43]], "TRI3")}
    tip = change("tip", **skin, elem_ss1=([4], ""), side_ss1=([2], ""))
    np.testing.assert_array_equal(tip.boundaries["side 1"], tip.boundaries["tip"])
