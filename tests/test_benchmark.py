"""Experiment files, runs, results, plug-ins."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contactopt import InputError, benchmark, solve
from contactopt.benchmark import families, problems, store
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.families import FAMILIES, of_scenes
from contactopt.benchmark.measure import Task
from contactopt.benchmark.pool import Shares, Worker
from contactopt.benchmark.runs import MethodSpec, Run
from contactopt.benchmark.store import COLUMNS, Store, lines
from contactopt.cli import main

PATIENCE = 120  # seconds; a test that needs them hangs

SMALL = """
name = "small"
repeats = 2
time_limit = 10.0
[[problems]]
scene = "punch-2d"
mu = [0.2, 0.5]
elements = 4
[[problems]]
family = "rigid_bodies"
bodies = 4
contacts = 6
[[methods]]
method = ["auto", "nsgs"]
"""


def written(folder: Path, text: str, name: str = "experiment.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def run(folder: Path, text: str, **options):
    path, options = written(folder, text), {"jobs": 1, "quiet": True} | options
    return benchmark.load(benchmark.run_campaign(path, folder / "out", **options))


def bench(path: Path, out: Path, *more: str, jobs: int = 2) -> list[str]:
    """The command that runs a campaign in a process of its own."""
    command = [sys.executable, "-m", "contactopt", "bench", str(path), "--out", str(out)]
    return [*command, "--jobs", str(jobs), *more]


def test_every_run_is_a_row_with_every_column(campaign):
    table = benchmark.load(campaign)
    assert len(table) == 3 * 2 * 2 and table["key"].is_unique
    assert list(table.columns[: len(COLUMNS)]) == list(COLUMNS)
    assert set(table["status"]) == {"solved"} and table["success"].all()
    assert (table["residual"] <= 1e-8).all() and (table["error"] <= 1e-6).all()
    assert table.groupby("problem")["fingerprint"].nunique().eq(1).all()
    assert table["fingerprint"].nunique() == 3
    assert set(table["problem.mu"].dropna()) == {0.2, 0.5}
    assert (table["build_seconds"] > 0).all()
    assert (table["solve_seconds"] <= table["call_seconds"]).all()
    assert (table["peak_mb"] >= table["base_mb"]).all() and (table["base_mb"] > 10).all()
    residuals, seconds, iterations = json.loads(table["history"].iloc[0])
    assert len(residuals) == len(seconds) == len(iterations)
    assert iterations[-1] == table["iterations"].iloc[0]


def test_tables_survive_parquet_and_csv(campaign, tmp_path):
    folder = shutil.copytree(campaign, tmp_path / "out")
    table = benchmark.load(folder)
    for name in ("rows.parquet", "rows.csv"):
        if name == "rows.csv":
            benchmark.save(table, folder / name)
        again = benchmark.load(folder / name)
        assert list(again.columns) == list(table.columns)
        assert again["key"].tolist() == table["key"].tolist()
        for column in ("residual", "error", "iterations", "build_seconds"):
            np.testing.assert_allclose(again[column], table[column], rtol=1e-5)
        assert again["success"].tolist() == table["success"].tolist()


@pytest.mark.slow
def test_killed_campaigns_lose_and_repeat_nothing(tmp_path):
    """Five SIGKILLs of the whole process group at random moments, then an uninterrupted end."""
    text = SMALL.replace("repeats = 2", "repeats = 15")
    path, out = written(tmp_path, text), tmp_path / "out"
    expected = {r.key for r in read_experiment(path).runs()}
    command = bench(path, out, "--resume")
    rng, counts = np.random.default_rng(3), []
    for _ in range(5):
        process = subprocess.Popen(
            command, start_new_session=True, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        before = time.monotonic()
        while process.poll() is None and time.monotonic() - before < PATIENCE:
            time.sleep(0.02)
            if count(out) > (counts[-1] if counts else 0):  # it works: kill it soon
                time.sleep(rng.uniform(0, 0.1))
                break
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        counts.append(count(out))
        with open(out / "rows.jsonl", "ab") as file:  # the worst a kill can leave behind
            file.write(b'{"schema": 1, "key": "to')
    assert counts[-1] < len(expected), (
        "the campaign ended before it was killed five times; give it more runs"
    )
    assert subprocess.run(command, capture_output=True).returncode == 0
    keys = [row["key"] for row in lines(out / "rows.jsonl")]
    assert len(keys) == len(set(keys)) and set(keys) == expected
    assert len(benchmark.load(out)) == len(expected)


@pytest.mark.slow
def test_an_interrupted_campaign_keeps_its_rows(tmp_path):
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 500")), tmp_path / "out"
    command = bench(path, out, jobs=1)
    heed = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731 (a job in the background ignores it)
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, preexec_fn=heed
    )
    while process.poll() is None and count(out) < 5:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    assert "--resume" in process.communicate(timeout=PATIENCE)[1].splitlines()[-1]
    assert process.returncode == 130
    with Store(out, resume=True) as store:
        assert len(store.finished()) >= 5


def count(out: Path) -> int:
    path = out / "rows.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def test_a_campaign_needs_resume_to_go_on_and_one_writer(campaign, tmp_path):
    out = shutil.copytree(campaign, tmp_path / "out")
    (out / "rows.parquet").unlink()
    rows = (out / "rows.jsonl").read_text().splitlines(keepends=True)
    (out / "rows.jsonl").write_text("".join(rows[:-1]))
    with pytest.raises(InputError, match="--resume"):
        run(tmp_path, SMALL)
    with Store(tmp_path / "out", resume=True), pytest.raises(InputError, match="another campaign"):
        run(tmp_path, SMALL, resume=True)
    assert len(run(tmp_path, SMALL, resume=True)) == 12


def test_missing_packages_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "find_spec", lambda name: None if name == "psutil" else name)
    with pytest.raises(InputError, match=r"need psutil; .*\[benchmark\]"):
        benchmark.run_campaign(written(tmp_path, SMALL), tmp_path / "out")


def test_filters(tmp_path):
    experiment = read_experiment(written(tmp_path, SMALL))
    assert len(experiment.runs(["problem=punch*", "method=nsgs"])) == 4
    assert len(experiment.runs(["problem=*mu=0.2*"])) == 4
    for wrong in ("nothing", "colour=red"):
        with pytest.raises(InputError, match="COLUMN=PATTERN"):
            experiment.runs([wrong])


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("repeats = 2", "repeats = 0", 3, "whole number"),
        ("repeats = 2", "repeat = 2", 3, "unknown key 'repeat'"),
        ("repeats = 2", 'settings = ["fast"]', 3, "unknown setting"),
        ("time_limit = 10.0", "time_limit = -1.0", 4, "time_limit"),
        ("time_limit = 10.0", 'plugins = ["none.py"]', 4, "none.py"),
        ('scene = "punch-2d"', 'scene = "punch"', 6, "unknown scene"),
        ("elements = 4", "elements = 4\nheigth = 3.0", 9, "heigth"),
        ("mu = [0.2, 0.5]", "mu = {from = 0.1, to = 1.0}", 7, "steps"),
        ("mu = [0.2, 0.5]", "mu = []", 7, "empty"),
        ("bodies = 4", "body = 4", 11, "body"),
        ("mu = [0.2, 0.5]", "mu = [0.2, 0.2]", 5, "two problems"),
        ('["auto", "nsgs"]', '["auto", "sngs"]', 14, "sngs"),
        ('["auto", "nsgs"]', '"auto"\ncolour = 1', 15, "colour"),
        ('["auto", "nsgs"]', '"alternating"\nnormal = "gurobi"', 15, "gurobi"),
        ("repeats = 2", "repeats = ", 3, "invalid value"),
    ],
)
def test_errors_name_the_line(tmp_path, old, new, line, words):
    assert old in SMALL
    path = written(tmp_path, SMALL.replace(old, new))
    with pytest.raises(InputError) as caught:
        read_experiment(path)
    message = str(caught.value)
    assert f"line {line}" in message and words in message and path.name in message


def test_the_command_line(tmp_path, capsys):
    pytest.importorskip("pandas")
    path = written(tmp_path, SMALL)
    arguments = f"bench {path} --out {tmp_path / 'out'} --jobs 1 --filter problem=rigid*".split()
    assert main(arguments) == 0
    assert "4 runs: 4 solved" in capsys.readouterr().out
    assert main(arguments) == 2 and "--resume" in capsys.readouterr().err


@pytest.mark.slow
def test_optional_problems_and_methods_are_left_out_where_they_are_missing(tmp_path, monkeypatch):
    from contactopt import fclib

    text = (
        SMALL
        + 'optional = true\n[[methods]]\nmethod = "alternating"\nnormal = "gurobi"\noptional ='
        " true\n"
    )
    text = text.replace(
        "[[methods]]", '[[problems]]\nfclib = "${SOME_FOLDER}"\noptional = true\n[[methods]]', 1
    )
    monkeypatch.delenv("SOME_FOLDER", raising=False)
    assert len(read_experiment(written(tmp_path, text)).problems) == 3
    with pytest.raises(InputError, match="environment variable"):
        read_experiment(
            written(tmp_path, text.replace('"${SOME_FOLDER}"\noptional = true', '"${SOME_FOLDER}"'))
        )
    fclib.write(FAMILIES["rigid_bodies"](3, 4), tmp_path / "a.hdf5")
    monkeypatch.setenv("SOME_FOLDER", str(tmp_path))
    table = run(tmp_path, text, filters=["problem=a"])
    assert set(table["problem"]) == {"a"} and set(table["status"]) == {"solved"}
    # no path of this machine
    assert str(tmp_path) not in (tmp_path / "out" / "rows.jsonl").read_text()


@pytest.mark.slow
def test_a_worker_stays_with_its_problem():
    experiment = [
        Task(
            Run(problems.ProblemSpec("family", name), MethodSpec("auto"), "mid", 1e-6, i),
            "",
            (),
            1,
            1,
            1,
            0,
        )
        for name in ("a", "b")
        for i in range(3)
    ]
    shares = Shares(experiment)
    order = [shares.take(worker).run.problem.name for worker in (1, 2, 1, 1, 2, 2)]
    assert order == ["a", "b", "a", "a", "b", "b"] and shares.take(1) is None


def test_families_are_what_they_say():
    rank_deficient = FAMILIES["rigid_bodies"](4, 20, seed=1)
    assert np.linalg.matrix_rank(rank_deficient.Q) <= 24
    line = families.half_plane(400)
    solution = solve(line)
    r, x = solution.reactions[:, 0], line.coordinates[0]
    assert solution.solved and abs(r.sum() - 0.25) < 1e-9
    # Hertz: a = 1/2, P = 1/4
    exact = np.sqrt(np.maximum(0.25 - x**2, 0)) * 2 * 0.25 / (np.pi * 0.25)
    assert np.abs(r / line.areas - exact).max() < 0.02 * exact.max()
    assert np.linalg.eigvalsh(families.half_plane(50, coupling=0.4).Q).min() > 0
    held = families.tangential("punch-2d", elements=4)
    r = solve(held, tol=1e-12).reactions
    np.testing.assert_allclose(r[:, 0], -held.q[:, 0] / np.diag(held.Q)[::2], rtol=1e-9)
    assert (np.abs(r[:, 1]) <= 0.5 * r[:, 0] * (1 + 1e-9)).all() and np.abs(r[:, 1]).max() > 0
    plain, twice = (
        of_scenes.reduced("punch-2d", elements=4),
        families.redundant("punch-2d", elements=4, copies=2),
    )
    shared = solve(twice, tol=1e-10).reactions.reshape(plain.contacts, 2, 2).sum(axis=1)
    np.testing.assert_allclose(shared, solve(plain, tol=1e-10).reactions, atol=1e-5)
    units = families.in_units("punch-2d", force=1e-3, length=1e-3, elements=4)
    np.testing.assert_allclose(
        solve(units).reactions, 1e-3 * solve(plain).reactions, rtol=1e-6, atol=1e-9
    )


def test_labels_tell_numbers_apart():
    labels = {
        problems.ProblemSpec("scene", "x", {"mu": mu}).label
        for mu in (0.1, 0.1 + 1e-12, 1e8, 1e-5, 1)
    }
    assert labels == {"x(mu=0.1)", f"x(mu={0.1 + 1e-12})", "x(mu=1e+08)", "x(mu=1e-05)", "x(mu=1)"}
    assert MethodSpec("penalty", {"factor": 1e8, "tangential_factor": 1234567.5}).label.endswith(
        "tangential_factor=1234567.5)"
    )


def test_materials_of_scenes_by_name():
    made = of_scenes.scene("punch-2d", upper_nu=0.49, stiffness_ratio=10.0)
    assert made.upper.material.nu == 0.49 and made.lower.material.E == 10 * made.upper.material.E
    with pytest.raises(InputError, match="not both"):
        of_scenes.scene("punch-2d", lower_E=2.0, stiffness_ratio=10.0)


@pytest.mark.slow
def test_a_worker_process_outlives_failures_that_leave_it_intact(tmp_path):
    with Worker() as worker:
        spec = problems.ProblemSpec("family", "rigid_bodies", {"bodies": 3, "contacts": 4})
        task = Task(Run(spec, MethodSpec("lemke"), "mid", 1e-6, 0), "x", (), 5.0, 4.0, 100, 0)
        first = worker.run(task)
        pid = worker.solver.process.pid
        assert first["status"] == "refused" and first["fingerprint"]
        assert worker.run(task)["status"] == "refused" and worker.solver.process.pid == pid
