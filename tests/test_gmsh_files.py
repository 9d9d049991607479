"""Files that Gmsh writes, of every version and in other formats, and damaged ones."""

import numpy as np
import pytest
import skfem

from contactopt import InputError, load_mesh
from contactopt.meshes import mesh_formats
from tests.mesh_samples import flux, volume


@pytest.fixture
def gmsh():
    import gmsh as module

    module.initialize(interruptible=False)
    module.option.setNumber("General.Terminal", 0)
    yield module
    module.finalize()


def disc_in_plate(gmsh, path, dim, order, recombine=False, incomplete=False, version=4.1):
    """A disc (cylinder) of radius 1 in a square plate of side 4, conforming."""
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
        box = gmsh.model.occ.addBox(-2, -2, 0, 4, 4, 1)
        cylinder = gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1)
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


def test_curved_lines_keep_their_ends_in_every_format(gmsh, tmp_path):
    """Formats put the node in the middle of a line at its end, or between the two others."""
    disc_in_plate(gmsh, tmp_path / "a.msh", 2, 2)
    exact = 4 * np.pi / 2
    for file, group, side in (
        ("a.msh", "plate", "rim"), ("a.inp", "plate", "rim"), ("a.med", "plate", "rim"),
        ("a.bdf", "2", "3"),
    ):  # fmt: skip
        gmsh.option.setNumber("Mesh.SaveElementTagType", 2)
        gmsh.write(str(tmp_path / file))
        mesh = load_mesh(tmp_path / file, group)
        basis = skfem.FacetBasis(mesh, mesh.elem(), facets=mesh.boundaries[side], intorder=6)
        length = skfem.Functional(lambda w: 1.0 + 0 * w.x[0]).assemble(basis)
        assert length == pytest.approx(exact, rel=1e-3)


def test_elements_that_cannot_be_used_are_named_as_the_file_names_them(gmsh, tmp_path):
    """Bricks beside wedges: the refusal says what to look for, and which groups can be used."""
    occ = gmsh.model.occ
    flat = [(2, occ.addRectangle(0, 0, 0, 1, 1)), (2, occ.addRectangle(1, 0, 0, 1, 1))]
    flat, _ = occ.fragment(flat[:1], flat[1:])
    made = occ.extrude(flat, 0, 0, 1, [1], recombine=True)
    occ.synchronize()
    for number, body in enumerate((tag for dim, tag in made if dim == 3), 7):
        gmsh.model.addPhysicalGroup(3, [body], number, name=f"body{number}")
    gmsh.model.mesh.setTransfiniteSurface(flat[0][1])
    gmsh.model.mesh.setRecombine(2, flat[0][1])
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.model.mesh.generate(3)
    gmsh.option.setNumber("Mesh.SaveElementTagType", 2)
    for file, word, group in (
        ("a.msh", r"wedge \(number 6 of Gmsh\)", "body7"), ("a.inp", r"C3D6 \(line \d+\)", "body7"),
        ("a.bdf", r"CPENTA \(line \d+\)", "7"), ("a.med", r"wedge \(PE6 of MED\)", "body7"),
        ("a.su2", r"wedge \(number 13 of SU2\)", ""),
    ):  # fmt: skip
        gmsh.write(str(tmp_path / file))
        said = f"elements of type {word} cannot be used; make"
        said += f".*, or choose one of its groups: .*{group}" if group else ""
        with pytest.raises(InputError, match=said):
            load_mesh(tmp_path / file)
        if group:
            assert volume(load_mesh(tmp_path / file, group)) == pytest.approx(1)
    medit = "MeshVersionFormatted 2 Dimension 3 Vertices 6 " + "0 0 1 0 " * 6
    (tmp_path / "b.mesh").write_text(medit + "Prisms 1 1 2 3 4 5 6 1 End")
    with pytest.raises(InputError, match=r"type wedge \(Prisms of Medit\) cannot be used"):
        load_mesh(tmp_path / "b.mesh")


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


def test_groups_of_one_name_are_one(tmp_path):
    """Two physical groups may share a name, in both formats."""
    names = '$PhysicalNames\n2\n1 1 "low"\n1 2 "low"\n$EndPhysicalNames\n'
    old = TEXT.replace("$Nodes", names + "$Nodes").replace("Elements\n3\n", "Elements\n4\n")
    old = old.replace("3 1 2 8 1 1 2", "3 1 2 1 1 1 2\n4 1 2 2 1 2 3")
    new = TEXT4.replace("$Entities\n0 0 1", names + "$Entities\n0 2 1").replace(
        "1 0 0 0 1 1 0 1 7", "1 0 0 0 1 0 0 1 1 0\n2 1 0 0 1 1 0 1 2 0\n1 0 0 0 1 1 0 1 7"
    )
    lines = "3 4 1 4\n1 1 1 1\n3 1 2\n1 2 1 1\n4 2 3\n"
    for text in (old, new.replace("$Elements\n1 2 1 2\n", "$Elements\n" + lines)):
        (tmp_path / "a.msh").write_text(text)
        assert len(load_mesh(tmp_path / "a.msh", "7").boundaries["low"]) == 2


def test_partitioned_files_of_gmsh_are_refused(gmsh, tmp_path):
    disc_in_plate(gmsh, tmp_path / "a.msh", 2, 1)
    gmsh.model.mesh.partition(2)
    gmsh.write(str(tmp_path / "a.msh"))
    with pytest.raises(InputError, match="partition"):
        load_mesh(tmp_path / "a.msh")


SQUARE = "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
TEXT = (
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
    + SQUARE
    + ("$Elements\n3\n1 2 2 7 1 1 2 3\n2 2 2 7 1 1 3 4\n3 1 2 8 1 1 2\n$EndElements\n")
)
TEXT4 = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n" + (
    "1 0 0 0 1 1 0 1 7 0\n$EndEntities\n$Nodes\n1 4 1 4\n2 1 0 4\n1\n2\n3\n4\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n$EndNodes\n$Elements\n1 2 1 2\n2 1 2 2\n1 1 2 3\n2 1 3 4\n"
    "$EndElements\n"
)


@pytest.mark.parametrize("text", [TEXT, TEXT4])
def test_files_written_by_hand_are_read_whole_or_refused(tmp_path, text):
    """What a count passes over, what is there twice, and comments above the version."""
    path = tmp_path / "a.msh"
    for head in (
        "",
        "$Comments\n$Nodes of a square\n" + 300 * "made by hand " + "\n$EndComments\n",
    ):
        path.write_text(head + text)
        mesh = load_mesh(path, "7")
        assert volume(mesh) == pytest.approx(1) and mesh.nvertices == 4
    wrong = {
        "holds more than it counts": text.replace("$EndElements", "9 2 3 4\n$EndElements"),
        "node 2 is there twice": text.replace("\n4\n1 0 0 0\n", "\n5\n2 9 0 0\n1 0 0 0\n").replace(
            "1 4 1 4\n2 1 0 4\n1\n2\n3\n4\n", "1 5 1 4\n2 1 0 5\n1\n2\n3\n4\n2\n9 9 9\n"
        ),
        "two sections [$]Elements": text + "$Elements\n1\n9 2 2 7 1 2 3 4\n$EndElements\n",
    }  # fmt: skip
    for words, other in wrong.items():
        path.write_text(other)
        with pytest.raises(InputError, match=words):
            load_mesh(path, "7")
