"""A deck of CalculiX: where ccx is installed, it runs unchanged and the reactions agree."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad, MeshTet, MeshTri

import contactopt
from contactopt import InputError, Material, Part, Plate, Scene, Support, Traction, scenes, solve
from contactopt.bodies.calculix_deck import WEDGES, deck
from contactopt.cli import main
from contactopt.coupling.reduction import reduce_bodies

CCX = shutil.which("ccx")
needs_ccx = pytest.mark.skipif(CCX is None, reason="CalculiX (ccx) is not installed")


def printed(path):
    """The last table of each kind of a .dat file, by its first word."""
    tables, rows = {}, []
    for line in path.read_text().splitlines():
        words = line.split()
        if words and words[0][0].isalpha():
            rows = tables[words[0]] = []
        elif words:
            rows.append([float(word) for word in words])
    return {name: np.array(table) for name, table in tables.items()}


def differences(scene, folder, factor=100.0):
    """Largest differences of displacements and of the resultants of supports and plates between
    ccx and contactopt, over the largest of each; of rings the resultants along the axis.
    """
    (folder / "job.inp").write_text(deck(scene, factor))
    done = subprocess.run([CCX, "job"], cwd=folder, capture_output=True, text=True, timeout=200)
    assert "Job finished" in done.stdout and "*ERROR" not in done.stdout, done.stdout[-500:]
    tables, dim = printed(folder / "job.dat"), scene.dim
    reduction, parts = reduce_bodies(scene), WEDGES if scene.kind == "axisymmetric" else 1
    moved = reduction.displaced(solve(reduction.problem))
    own, other, start = [], [], 0
    ours = np.hstack([U[body.body.unknowns] for U, body in zip(moved, reduction.bodies)])
    theirs = tables["displacements"][: ours.shape[1], 1 : 1 + dim].T
    for U, body in zip(moved, reduction.bodies):
        assembly = body.body
        end = start + assembly.unknowns.shape[1]
        forces = tables["forces"][start:end, 1 : 1 + dim].T * scene.copies * parts
        # what ccx prints at a node contains the nodal forces of loads there
        inner = (assembly.A @ U)[assembly.unknowns]
        for held in assembly.holders.values():
            mask = np.isin(assembly.unknowns, held)
            own += list(np.where(mask, inner, 0).sum(axis=1))
            other += list(np.where(mask, forces, 0).sum(axis=1))
        start = end
    along = slice(None) if parts == 1 else slice(1, None, 2)
    own, other = np.array(own)[along], np.array(other)[along]
    return abs(theirs - ours).max() / abs(ours).max(), abs(other - own).max() / abs(own).max()


@needs_ccx
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("punch-2d", {"elements": 8}),
        ("punch-2d", {"elements": 8, "simplices": True}),
        ("cylinder-2d", {"elements": 6}),
        ("press-fit", {}),
        ("punch-3d", {"elements": 4}),
        ("punch-3d", {"elements": 4, "simplices": True}),
        ("punch-2d", {"elements": 6, "simplices": True, "degree": 2}),
        ("press-fit", {"kind": "axisymmetric"}),
    ],
)
def test_reactions_agree_within_one_percent(name, arguments, tmp_path):
    moved, reactions = differences(scenes.make_scene(name, **arguments), tmp_path)
    assert moved < 0.01 and reactions < 0.01


def block(mesh, kind, low):
    """A block or ring of unit height with boundaries below, above and at its side."""
    ticks = [np.linspace(1, 2, 7), np.linspace(low, low + 1, 5)]
    made = mesh.init_tensor(*(ticks[:1] * (kind == "solid") + ticks))
    z = made.dim() - 1
    places = {"low": (z, low), "top": (z, low + 1), "side": (0, 2.0)}
    return made.with_boundaries(
        {name: lambda x, i=i, at=at: abs(x[i] - at) < 1e-9 for name, (i, at) in places.items()}
    )


@needs_ccx
@pytest.mark.parametrize("mesh, kind, degree, apart", [
    (MeshTri, "plane-strain", 1, 1e-6), (MeshQuad, "plane-strain", 1, 1e-6),
    (MeshTri, "plane-strain", 2, 1e-6), (MeshTet, "solid", 1, 1e-6), (MeshHex, "solid", 1, 1e-6),
    (MeshTet, "solid", 2, 1e-6), (MeshQuad, "axisymmetric", 1, 1e-4),
    (MeshTri, "axisymmetric", 2, 2e-4), (MeshTri, "axisymmetric", 1, 1e-2),
])  # fmt: skip
def test_elements_are_those_of_calculix(mesh, kind, degree, apart, tmp_path):
    """Bodies that do not touch; wedges of two degrees are not rings, but nearly."""
    load = (Traction("side", (30.0, *([5.0] * (kind == "solid")), -20.0)),)
    up, down = (
        Part(name, block(mesh, kind, at), Material(210e3, 0.3), (Support(held),), load, to)
        for name, at, held, to in (("up", 1.1, "top", "low"), ("down", 0.0, "low", "top"))
    )
    scene = Scene("apart", up, down, 0.3, kind=kind, degree=degree)
    moved, reactions = differences(scene, tmp_path)
    assert moved < apart and reactions < 1e-6


@needs_ccx
def test_sheets_in_plane_stress_agree(tmp_path):
    scene = replace(scenes.make_scene("punch-2d", elements=8), kind="plane-stress")
    moved, reactions = differences(scene, tmp_path)
    assert moved < 0.01 and reactions < 0.01


@needs_ccx
def test_a_body_force_thickness_and_half_a_model_agree(tmp_path):
    scene = scenes.make_scene("punch-2d", elements=6, mu=0.6)
    plate = Plate("top", {"y": -100.0})
    upper = Part("punch", scene.upper.mesh, scene.upper.material, scene.upper.supports,
                 (plate, contactopt.BodyForce((0.02, -0.05))))  # fmt: skip
    scene = Scene("loaded", upper, scene.lower, 0.6, thickness=2.0, copies=2, zone=scene.zone,
                  elements=6)  # fmt: skip
    moved, reactions = differences(scene, tmp_path)
    assert moved < 0.01 and reactions < 0.01


@needs_ccx
@pytest.mark.slow
def test_forces_of_a_pin_in_a_bush_approach_ours_as_the_mesh_gets_finer(tmp_path):
    found = []
    for elements in (8, 16):
        scene = scenes.make_scene("pin-in-bush", elements=elements)
        found.append(differences(scene, tmp_path)[1])
    assert found[1] < 0.7 * found[0] < 0.7 * 0.04


def test_cells_are_turned_and_surfaces_are_on_the_boundary():
    text = deck(scenes.make_scene("punch-3d", elements=2))
    blocks = {}
    for line in text.splitlines():
        if line.startswith("*"):
            rows = blocks.setdefault(line, [])
        else:
            rows.append(line.split(", "))
    points = np.array([row[1:] for row in blocks["*NODE, NSET=NODES"]], dtype=float)
    cells = {int(r[0]): np.array(r[1:], int) - 1
             for k, rows in blocks.items() if k.startswith("*ELEMENT") for r in rows}  # fmt: skip
    for cell in cells.values():
        x = points[cell]
        assert np.linalg.det([x[1] - x[0], x[3] - x[0], x[4] - x[0]]) > 0
        # the upper face lies along the edges from the lower one
        assert np.linalg.norm(x[4:] - x[:4], axis=1).max() < np.linalg.norm(x[6] - x[0])
    sides = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    slave = blocks["*SURFACE, NAME=SLAVE1, TYPE=ELEMENT"]
    faces = [points[cells[int(e)][list(sides[int(s[1]) - 1])]] for e, s in slave]
    assert len(faces) > 0 and np.abs(np.array(faces)[:, :, 2]).max() < 1e-12
    master = blocks["*SURFACE, NAME=MASTER1, TYPE=ELEMENT"]
    assert len(master) > len(slave)


def test_a_law_without_friction_is_a_deck_without_friction():
    scene = scenes.make_scene("punch-2d", elements=4)
    smooth = replace(scene, mu=0.0, law="frictionless")
    assert deck(smooth) == deck(replace(scene, mu=0.0)) != deck(replace(scene, mu=0.3))


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("hertz-half-space", {}, "has no mesh"),
        ("rigid-punch-2d", {}, "has no mesh"),
        ("punch-2d", {"degree": 2, "elements": 4}, "no nodes in their middle"),
    ],
)
def test_what_a_deck_cannot_say_is_refused(name, arguments, words):
    with pytest.raises(InputError, match=words):
        deck(scenes.make_scene(name, **arguments))


def test_the_command_writes_a_deck_and_a_problem_that_reads_back(tmp_path, capsys):
    pytest.importorskip("h5py")
    names = [tmp_path / "punch.inp", tmp_path / "punch.hdf5"]
    for kind, name in zip(("calculix", "fclib"), names):
        asked = ["export", "punch-2d", "--set", "elements=4", "--to", kind, "--out", str(name)]
        assert main(asked) == 0
        assert str(name) in capsys.readouterr().out
    scene = scenes.make_scene("punch-2d", elements=4)
    assert names[0].read_text() == deck(scene)
    problem, own = contactopt.fclib.read(names[1]), contactopt.reduce(scene)
    np.testing.assert_array_equal(problem.Q, own.Q)
    np.testing.assert_array_equal(problem.q, own.q)
    asked = ["export", "hertz-half-space", "--to", "calculix", "--out", str(tmp_path / "no.inp")]
    assert main(asked) == 2 and not (tmp_path / "no.inp").exists()
    assert "has no mesh" in capsys.readouterr().err
