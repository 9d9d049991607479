import json
import os

import numpy as np
import pytest
from conftest import two_blocks
from skfem import MeshTri

from contactopt import InputError, Material, Part, Plate, Rigid, Scene, cli, run
from contactopt.readings.quantities import value_of

KEYS = [
    "scene", "kind", "units", "thickness", "mirrors", "dofs", "contact_nodes", "mu", "method",
    "normal_backend", "tangential_backend", "status", "message", "residual", "outer_iterations",
    "normal_force", "approach", "contact_half_width", "stick_half_width", "max_pressure",
    "pressure", "q", "products", "remarks", "pairs", "holders", "limits", "seconds",
]  # fmt: skip


def check_tables(result, out):
    """The forces of the tables balance the loads, and the units stand in the head."""
    import pandas as pd

    history = pd.read_csv(out / "history.csv")
    for pair in result.problem.pairs:
        table = pd.read_csv(out / f"contact-{pair.name}.csv")
        last = table[table.state == table.state.max()]
        length, stress = result.scene.units
        area, axis = last[f"area [{length}^2]"], result.scene.components[-1]
        force = (area * last[f"traction_{axis} [{stress}]"]).sum()
        columns = f"force:{pair.name}:{axis}"
        assert force == pytest.approx(history[columns].iloc[-1], rel=1e-9)
        assert set(last.status) <= {"open", "stick", "slip"}
        assert np.all(last[f"pressure [{stress}]"][last.status == "open"] == 0)
        assert list(last[f"{result.scene.components[0]} [{length}]"]) == pytest.approx(
            list(result.problem.coordinates[0][pair.contacts])
        )
        meshes = {own.name: own.mesh for own in result.fields}
        there = [name for name in meshes if f"node of {name}" in last]
        assert there and any(last[f"node of {name}"].notna().all() for name in there)
        for name in there:
            rows = last[last[f"node of {name}"].notna()]
            places = rows[[f"{axis} [{length}]" for axis in result.scene.components]].to_numpy().T
            nodes = rows[f"node of {name}"].astype(int)
            np.testing.assert_allclose(meshes[name].p[:, nodes], places, atol=1e-9)
    total = sum(history[name].iloc[-1] for name in history if name.startswith("force:body"))
    assert np.isfinite(total)


SMALL = {"punch-2d": 6, "punch-3d": 3, "sphere": 8}


@pytest.mark.parametrize("name", SMALL)
def test_run_writes_everything(name, tmp_path):
    result = run(name, tmp_path / "new" / "folder", elements=SMALL[name])
    out = tmp_path / "new" / "folder"
    names = {f.name for f in result.fields}
    assert {p.name for p in out.iterdir()} == {
        "summary.json",
        "deformed.png",
        "pressure.png",
        "interface.npz",
        "restart.npz",
        "history.csv",
        *(f"{n}.vtu" for n in names),
        *(f"contact-{pair.name}.{e}" for pair in result.problem.pairs for e in ("vtu", "csv")),
    }
    check_tables(result, out)
    summary = json.loads((out / "summary.json").read_text())
    assert list(summary) == KEYS and summary == result.summary
    assert summary["status"] == "solved" and summary["residual"] <= 1e-8
    assert summary["normal_force"] == pytest.approx(100, rel=1e-8)
    assert 0 < summary["stick_half_width"] <= summary["contact_half_width"]
    seconds = summary["seconds"]
    assert {"solve", "recover", "figures", "files", "total"} <= set(seconds)
    assert seconds["total"] == max(seconds.values())
    data = np.load(out / "interface.npz")
    k = summary["contact_nodes"]
    shape = (k, 2) if name == "punch-3d" else (k,)
    assert data["x"].shape == data["r_t"].shape == data["traction"].shape == shape
    assert data["r_n"].sum() == pytest.approx(100, rel=1e-8)
    assert data["pressure"].max() == pytest.approx(summary["max_pressure"])
    assert result.solution.reactions.shape == (k, result.problem.dim)


def test_run_from_python_without_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run("punch-2d", mu=0.3, elements=4, tol=1e-6, normal="osqp", tangential="daqp")
    assert not list(tmp_path.iterdir())
    assert result.summary["mu"] == 0.3 and result.summary["normal_backend"] == "osqp"
    assert result.pressure.shape == result.traction.shape == (5,)


def test_run_takes_a_users_scene(tmp_path):
    result = run(two_blocks("solid", mu=0.2), tmp_path, mu=0.1)
    assert result.summary["mu"] == 0.1 and result.summary["status"] == "solved"
    assert result.summary["approach"] > 0


def test_list(capsys):
    assert cli.main(["list"]) == 0
    text = capsys.readouterr().out
    for word in (
        "punch-2d",
        "punch-3d",
        "sphere",
        "alternating",
        "proxqp",
        "clarabel",
        "installed",
    ):
        assert word in text


@pytest.mark.parametrize("arguments,words", [
    (["nowhere"], "unknown scene 'nowhere'; choose from punch-2d, punch-3d, sphere"),
    (["punch-2d", "--normal", "simplex"], "unknown qp backend 'simplex'; choose from clarabel"),
    (["punch-3d", "--tangential", "proxqp"],
     "unknown conic backend 'proxqp'; choose from clarabel"),
    (["punch-2d", "--method", "magic"], "unknown method 'magic'; choose from auto"),
    (["punch-2d", "--mu", "-1"], "mu must be a finite number at least 0"),
    (["punch-2d", "--mu", "nan"], "mu must be a finite number"),
    (["punch-2d", "--elements", "0"], "elements must be a whole number"),
    (["punch-2d", "--tol", "0"], "tol must be a finite number"),
    (["sphere", "--force", "1e9"], "too much for a sphere"),
])  # fmt: skip
def test_bad_input_is_one_sentence_and_writes_nothing(arguments, words, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["run", *arguments, "--out", str(out)]) == 2
    text = capsys.readouterr().err
    lines = [line for line in text.splitlines() if not line.startswith("  ")]
    assert len(lines) == 1 and words in lines[0]
    assert not out.exists()


def test_an_output_that_is_a_file_is_refused_before_any_work(tmp_path, capsys):
    (tmp_path / "taken").write_text("mine")
    for path in ("taken", "taken/deeper"):
        assert cli.main(["run", "punch-2d", "--out", str(tmp_path / path)]) == 2
        text = capsys.readouterr().err
        assert "cannot write into" in text and "reducing" not in text
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_output_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(InputError, match="cannot write"):
        run("punch-2d", tmp_path / "out", elements=4)


def test_a_failure_while_writing_leaves_old_results_alone(tmp_path, monkeypatch):
    run("punch-2d", tmp_path, elements=4)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def broken(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numpy.savez", broken)
    with pytest.raises(InputError, match="No space left"):
        run("punch-2d", tmp_path, elements=4, mu=0.1)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    "quantity,key",
    [("width", "contact_half_width"), ("pressure", "pressure"), ("approach", "approach")],
)
def test_the_summary_reports_what_accuracy_bounds(quantity, key):
    result = run("cylinder-2d", accuracy=0.05, quantity=quantity)
    assert result.summary[key] == result.estimate.value


def test_the_summary_reports_the_stick_zone_that_accuracy_bounds():
    result = run("punch-2d", mu=0.2, accuracy=0.2, quantity="stick")
    ratio = result.summary["stick_half_width"] / result.summary["contact_half_width"]
    assert ratio == pytest.approx(result.estimate.value, rel=1e-12)


def test_the_history_of_a_path_holds_the_quantities_that_accuracy_bounds():
    path = run("cattaneo-2d", steps=1, elements=16).path
    a, c = path.history["contact_half_width"][-1], path.history["stick_half_width"][-1]
    assert value_of("width", path.reduction, path.solution) == pytest.approx(a, rel=1e-10)
    assert value_of("stick", path.reduction, path.solution) == pytest.approx(c / a, rel=1e-10)


def test_a_contact_that_the_mesh_cannot_show_is_remarked_on():
    assert run("cylinder-2d", elements=8).summary["remarks"] == []
    mesh = (
        MeshTri()
        .refined(3)
        .with_boundaries({"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 1})
    )
    block = Part(
        "block", mesh, Material(E=5.0, nu=0.3), loads=(Plate("top", {"y": -0.1}),), contact="bottom"
    )
    floor = Rigid("floor", normal=(0.0, 1.0), gap=lambda x: 40.0 * (x[0] - 0.5) ** 2)
    told = run(Scene("block on a ridge", block, floor, mu=0.4)).summary["remarks"]
    assert len(told) == 2 and "strain of up to" in told[1] and "1 of 9" in told[0]
    assert "block-floor" in told[0]
