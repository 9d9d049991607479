"""Local refinement for stresses: exact values are met, corners are recognised, bounds hold."""

import json
from dataclasses import replace

import numpy as np
import pytest
import skfem
from conftest import MATERIAL, block, two_blocks

from contactopt import InputError, Part, Plate, Rigid, Scene, Support, run
from contactopt.accuracy import refine
from contactopt.accuracy.corners import grows
from contactopt.accuracy.indicators import element_errors, pressure_errors, read_once
from contactopt.cli import main
from contactopt.coupling.reduction import reduce_bodies
from contactopt.readings.quantities import find_quantity
from contactopt.scenes import make_scene
from contactopt.scenes.refined_scenes import split_scene
from contactopt.solving import solve_states
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import solve_scene


def locally(scene, *arguments, **limits):
    return refine([scene], *arguments, adaptive=True, **limits)


def tube_stress(scene):
    """The von Mises stress at the bore of a tube under outer pressure in plane strain, by Lame."""
    hoop = -2 * scene.reference.peak * 20.0**2 / (20.0**2 - 10.0**2)
    return abs(hoop) * np.sqrt(1 - 0.3 + 0.3**2)


@pytest.mark.parametrize("degree", [1, 2])
def test_the_stress_at_a_bore_is_that_of_lame(degree):
    """Estimates do not see that edges are chords: the errors are twice what was asked for."""
    scene = make_scene("press-fit", degree=degree)
    _, estimate = locally(scene, "von_mises:shaft:inner", 1e-2)
    assert estimate.reached and estimate.value == pytest.approx(tube_stress(scene), rel=0.02)
    assert np.linalg.norm(estimate.levels[-1].place) == pytest.approx(10.0, rel=1e-6)
    component = locally(scene, "stress_xx:shaft@0,10", 1e-2)[1]
    assert component.value == pytest.approx(
        -tube_stress(scene) / np.sqrt(1 - 0.3 + 0.3**2), rel=0.02
    )


def test_whole_meshes_serve_stresses_as_well():
    """Half a half-width below a line contact without friction the stresses are those of Hertz."""
    scene = make_scene("cylinder-2d", mu=0.0)
    a, peak = scene.reference.half_width, scene.reference.peak
    body = scene.parts[-1].name
    mesh, estimate = refine([scene], f"stress_yy:{body}@0,{-a / 2}", 0.02)
    assert estimate.reached and estimate.value == pytest.approx(-peak / np.sqrt(1.25), rel=0.02)
    assert mesh.solution.solved


def angle_bracket():
    """An L of the skfem documentation, its re-entrant corner at the origin, clamped above and
    pressed on a floor.
    """
    mesh = skfem.MeshTri.init_lshaped().refined(1)
    names = {"floor": lambda x: x[1] == -1, "top": lambda x: (x[1] == 1) & (x[0] <= 0)}
    part = Part(
        "bracket",
        mesh.with_boundaries(names),
        MATERIAL,
        loads=(Plate("top", {"x": 0.02, "y": -0.2}),),
        contact="floor",
    )
    return Scene("bracket", part, Rigid("floor", (0.0, 1.0)), mu=0.6)


def test_a_re_entrant_corner_is_recognised_and_said():
    solved, estimate = locally(angle_bracket(), "von_mises:bracket@0,0,radius=0.5", 0.02)
    assert not estimate.reached and "re-entrant corner" in estimate.message
    assert solved.solution.solved
    assert np.linalg.norm(estimate.levels[-1].place) < 0.2 and len(estimate.levels) < 10
    assert locally(angle_bracket(), "von_mises:bracket@-0.5,0.1", 0.02)[1].reached


def test_a_quarter_model_whose_nodes_do_not_match_knows_its_planes():
    scene = two_blocks("solid")
    scene = replace(
        scene, lower=replace(scene.lower, mesh=block("solid", -2, 0, cells=5)), copies=4
    )
    reduction = reduce_bodies(scene)
    assert reduction.problem.chart.mirrored == (True, True) and len(reduction.coupling.planes) == 2


def ball(size):
    """A rigid ball of radius 20 on a quarter of a block of even tetrahedra: the contact has a
    radius of about one.
    """
    ticks = np.linspace(0, 12, round(12 / size) + 1)
    names = {
        "top": lambda x: x[2] == 0,
        "bottom": lambda x: x[2] == -12,
        "x": lambda x: x[0] == 0,
        "y": lambda x: x[1] == 0,
    }
    mesh = skfem.MeshTet.init_tensor(ticks, ticks, ticks - 12).with_boundaries(names)
    held = (Support("bottom"), Support("x", {"x": 0.0}), Support("y", {"y": 0.0}))
    block = Part("block", mesh, MATERIAL, held, contact="top")
    force = 4 * MATERIAL.E / (1 - MATERIAL.nu**2) / 60
    rigid = Rigid(
        "ball", (0.0, 0.0, 1.0), lambda x: (x[0] ** 2 + x[1] ** 2) / 40, force={"z": -force}
    )
    return Scene(
        "ball", rigid, block, 0.0, kind="solid", copies=4, law="frictionless"
    ), 1.5 * force / np.pi


def test_a_contact_smaller_than_the_elements_is_not_taken_for_resolved():
    """One closed contact carries all of the force on any mesh: its pressure betrays the error."""
    scene, peak = ball(4.0)
    first = solve_scene(scene)
    asked = find_quantity("pressure", scene)
    read = asked.read(first.reduction, first.solution)
    assert read.uncertainty >= read.value and abs(read.value / peak - 1) > 0.5
    assert abs(element_errors(first, asked, read.value).total) > 0.1 * read.value
    _, estimate = locally(scene, "pressure", 0.03, limits=Limits(6_000))
    assert estimate.value == pytest.approx(peak, rel=0.1) and estimate.levels[-1].contacts > 30


def test_the_pressure_at_contacts_exceeds_its_means_as_a_parabola_does():
    """The mean of 1 - x^2 with a hat of width h is less than its value by h^2 / 6."""
    scene = make_scene("cylinder-2d", mu=0.0, elements=8)
    reduction = solve_scene(scene).reduction
    x = reduction.problem.coordinates[0]
    inner = np.flatnonzero(np.isclose(np.diff(x)[1:], np.diff(x)[:-1])) + 1
    inner = inner[x[inner] < 0.8 * reduction.scene.zone]
    h = np.diff(x)[inner]
    errors = pressure_errors(reduction, reduction.problem.areas * (1 - x**2))
    assert len(inner) > 5 and np.allclose(errors[inner], h**2 / 6)


def test_limits_and_history_from_the_command_line_and_scene_files(tmp_path, capsys):
    line = [
        "run",
        "press-fit",
        "--adaptive",
        "--accuracy",
        "1e-4",
        "--quantity",
        "von_mises:shaft:inner",
    ]
    out = tmp_path / "out"
    assert main([*line, "--max-unknowns", "400", "--out", str(out)]) == 1
    assert "more than 400" in capsys.readouterr().out and (out / "refinement.png").exists()
    found = json.loads((out / "summary.json").read_text())["accuracy"]
    assert all(
        level["unknowns"] <= 400 and level["seconds"] > 0 and level["error"] > 0
        for level in found["levels"]
    )
    assert main([*line, "--max-memory", "1e-6", "--no-figures", "--out", str(out)]) == 1
    assert "GB of memory" in capsys.readouterr().out
    file = tmp_path / "block.toml"
    file.write_text(SCENE_FILE)
    result = run(file, figures=())
    assert "time limit of 1e-06 s" in result.estimate.message and "Estimate(energy" in repr(result)
    assert "meshes" in result._repr_html_()
    with pytest.raises(InputError, match="bounds on unknowns and memory"):
        run("press-fit", max_unknowns=100)


SCENE_FILE = """\
[bodies.block]
block = { x = [0, 1], y = [0, 1], elements = [2, 2] }
material = { E = 5.0, nu = 0.3 }
contact = "y-"
plates = [{ boundary = "y+", force = { y = -1 } }]
[bodies.floor]
rigid = { normal = { y = 1 } }
[[contacts]]
upper = "block"
lower = "floor"
mu = 0.4
[solve]
accuracy = 1e-6
quantity = "energy"
adaptive = true
max_unknowns = 10000
time_limit = 1e-6
max_memory = 3
"""


@pytest.mark.parametrize(
    ("scene", "quantity"),
    [
        ("press-fit", "von_mises:hub"),
        ("cylinder-2d", "pressure"),
        pytest.param("pin-in-bush", "von_mises:bush", marks=pytest.mark.slow),
    ],
)
def test_one_mesh_reads_a_quantity_with_its_error(scene, quantity):
    coarse = run(scene, read=(quantity, "energy"))
    found = coarse.summary["quantities"]
    elements = coarse.scene.elements
    # all of them half as large: more of them across the contact leave those far from it as they are
    halved = split_scene(make_scene(scene), elements, 1)
    fine = run(halved, read=(quantity,), elements=elements)
    exact = fine.summary["quantities"][quantity]["value"]
    error = abs(found[quantity]["value"] / exact - 1)
    assert 0 < error <= found[quantity]["error"] <= 10 * error
    assert found["energy"]["error"] < 0.01


def test_the_last_state_of_a_path_is_read_with_its_error():
    """Without friction a path forgets its states: value and error are those of its last load."""
    light, full = (make_scene("punch-2d", mu=0.0, elements=4, force=f) for f in (50.0, 100.0))
    path, alone = (
        read_once(solve_states(states), "von_mises:punch:contact")
        for states in ((light, full), (full,))
    )
    assert path["error"] == pytest.approx(alone["error"]) and 0 < path["error"] < 1
    assert path["value"] == pytest.approx(alone["value"])


def test_what_one_mesh_cannot_tell_is_not_invented(capsys, tmp_path):
    out = str(tmp_path / "out")
    line = ["run", "hertz-half-space", "--elements", "16", "--no-figures", "--out", out]
    assert main([*line, "--read", "approach", "pressure"]) == 0
    printed = capsys.readouterr().out
    assert "approach" in printed and printed.count("its relative error on this mesh: unknown") == 2
    with pytest.raises(InputError, match="no elastic body 'wheel'"):
        run("press-fit", read=("von_mises:wheel",))
    with pytest.raises(InputError, match="load path"):
        run("press-fit", read=("friction_work",))


def test_the_summary_has_one_line_for_each_pair(capsys, tmp_path):
    line = ["run", "stack", "--no-figures", "--out", str(tmp_path / "out")]
    main(line)
    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    names = json.loads((tmp_path / "out/summary.json").read_text())["pairs"]
    rows = {line[0]: line[1:] for line in printed if line and line[0] in names}
    assert len(rows) == len(names) > 1
    for name, pair in names.items():
        assert rows[name][-3:] == [str(pair[key]) for key in ("stick", "slip", "open")]
        assert float(rows[name][0]) == pytest.approx(pair["max_pressure"], rel=1e-4)


@pytest.mark.parametrize(
    ("steps", "infinite"),
    [
        ([40.0] * 4, True),  # a logarithm
        ([10 * 1.3**n for n in range(4)], True),  # a power
        ([30.0, 60.0] * 4, True),  # the elements on both sides of a place are halved in turn
        ([80.0, 40.0, 20.0, 10.0, 5.0, 2.5, 1.2, 0.6], False),  # first order
        ([80.0, 60.0, 20.0, 15.0, 5.0, 4.0, 1.2, 1.0], False),  # the same in turn
        ([30.0, 60.0, 20.0], False),  # too few to say
    ],
)
def test_what_grows_with_every_refinement_is_infinite(steps, infinite):
    values = 1000.0 + np.cumsum([0.0, *steps])
    assert grows(list(values[::-1]), 4) == infinite
