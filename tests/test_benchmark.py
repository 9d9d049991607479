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
from contactopt.benchmark import pool, problems, store
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.measure import Task
from contactopt.benchmark.pool import Shares, Worker
from contactopt.benchmark.runs import MethodSpec, Run
from contactopt.benchmark.sequences import certificate
from contactopt.benchmark.store import COLUMNS, STATUSES, Store, lines
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

FAKES = """
import ctypes, time
import numpy as np
from contactopt import Solution, Status, solve
from contactopt.benchmark import method

@method
def segfaults(problem):
    ctypes.string_at(0)

@method
def hangs(problem):
    while True:
        time.sleep(1)

@method
def nan(problem):
    return np.full(problem.q.shape, np.nan)

@method
def lies(problem, tol=1e-8):
    r = 1.01 * solve(problem).reactions
    return Solution(r, np.zeros(len(problem.s)), Status.SOLVED, 0.0, 1, "lies")

@method
def hoards(problem):
    return np.ones(10**9)

@method
def raises(problem):
    raise KeyError("an argument")

@method
def aborts(problem):
    import os
    print("last words")
    os.abort()

@method
def honest(problem):
    return solve(problem, tol=1e-12).reactions
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
    assert (
        table.groupby("problem")["fingerprint"].nunique().eq(1).all()
        and table["fingerprint"].nunique() == 3
    )
    assert set(table["problem.mu"].dropna()) == {0.2, 0.5}
    assert (table["build_seconds"] > 0).all() and (
        table["solve_seconds"] <= table["call_seconds"]
    ).all()
    assert (table["peak_mb"] >= table["base_mb"]).all() and (table["base_mb"] > 10).all()
    residuals, seconds, iterations = json.loads(table["history"].iloc[0])
    assert (
        len(residuals) == len(seconds) == len(iterations)
        and iterations[-1] == table["iterations"].iloc[0]
    )


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
def test_fakes_become_honest_rows(tmp_path):
    written(tmp_path, FAKES, "fakes.py")
    names = ["segfaults", "hangs", "nan", "lies", "hoards", "raises", "aborts", "honest"]
    text = f"""
        name = "fakes"
        plugins = ["fakes.py"]
        time_limit = 4.0
        memory_limit = 2.0
        settings = ["mid"]
        [[problems]]
        scene = "punch-2d"
        elements = 4
        [[methods]]
        method = {json.dumps(names)}
    """
    table = run(tmp_path, text)
    statuses = {name: set(rows["status"]) for name, rows in table.groupby("name")}
    assert statuses == {
        "segfaults": {"crashed"},
        "hangs": {"killed"},
        "nan": {"not_finite"},
        "lies": {"false_claim"},
        "hoards": {"out_of_memory"},
        "raises": {"error"},
        "aborts": {"crashed"},
        "honest": {"solved"},
    }
    assert set(table["status"]) <= set(STATUSES) and len(table) == len(names)
    # of those that never returned, too
    assert table["fingerprint"].nunique() == 1 and set(table["contacts"]) == {5}
    row = {name: rows.iloc[0] for name, rows in table.groupby("name")}
    assert row["segfaults"]["message"].startswith("SIGSEGV")
    assert "SIGABRT" in row["aborts"]["message"] and "last words" in row["aborts"]["message"]
    assert "KeyError" in row["raises"]["message"]
    assert row["lies"]["claimed"] and not row["lies"]["success"] and row["lies"]["residual"] > 1e-4
    assert np.isinf(row["nan"]["residual"]) and 4.0 < row["hangs"]["call_seconds"] < PATIENCE


@pytest.mark.slow
def test_killed_campaigns_lose_and_repeat_nothing(tmp_path):
    """Five SIGKILLs of the whole process group at random moments, then an uninterrupted end."""
    text = SMALL.replace("repeats = 2", "repeats = 30")
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
    assert (
        "--resume" in process.communicate(timeout=PATIENCE)[1].splitlines()[-1]
        and process.returncode == 130
    )
    with Store(out, resume=True) as store:
        assert len(store.finished()) >= 5


def count(out: Path) -> int:
    path = out / "rows.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


@pytest.mark.slow
def test_workers_die_with_their_campaign(tmp_path):
    written(tmp_path, FAKES, "fakes.py")
    path = written(
        tmp_path,
        'name = "x"\nplugins = ["fakes.py"]\n[[problems]]\nscene'
        ' = "punch-2d"\n[[methods]]\nmethod = "hangs"\n',
    )
    command = bench(path, tmp_path / "out", jobs=1)
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    children = Path(f"/proc/{process.pid}/task")
    worker = None
    for _ in range(20 * PATIENCE):
        time.sleep(0.05)
        found = [w for task in children.iterdir() for w in (task / "children").read_text().split()]
        if found:
            worker = Path(f"/proc/{found[0]}")
            break
    assert worker is not None
    time.sleep(0.5)
    process.kill()
    process.wait()
    for _ in range(20 * PATIENCE):
        time.sleep(0.05)
        if not worker.exists() or (worker / "stat").read_text().split()[2] == "Z":
            return
    raise AssertionError("the worker outlived its campaign")


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


def test_a_method_of_ones_own_takes_less_than_twenty_lines(tmp_path):
    mine = """
import numpy as np
from contactopt.benchmark import method

@method
def fixed_point(problem, tol=1e-8, steps=20000):
    r, rho = np.zeros(problem.q.shape), 1 / np.linalg.norm(problem.Q, 2)
    for _ in range(steps):
        u = (problem.Q @ r.ravel()).reshape(r.shape) + problem.q
        new = problem.law.natural_map(r, u, rho)
        if np.linalg.norm(new - r) <= tol * np.linalg.norm(new) / 100:
            break
        r = new
    return r
"""
    assert len(mine.strip().splitlines()) < 20
    written(tmp_path, mine, "mine.py")
    text = SMALL.replace('scene = "punch-2d"', 'family = "tangential"\nof = "punch-2d"')
    text = 'plugins = ["mine.py"]' + text.replace('"nsgs"', '"fixed_point"')
    table = run(tmp_path, text, filters=["problem=tangential*"])
    ours, theirs = (
        table[(table["name"] == name) & (table["dim"] == 2)] for name in ("auto", "fixed_point")
    )
    assert len(theirs) == len(ours) == 4 and (theirs["status"] == "solved").all()
    assert (theirs["solve_seconds"] == theirs["call_seconds"]).all()


@pytest.mark.slow
def test_classes_problems_and_their_settings(tmp_path):
    written(
        tmp_path,
        """
from dataclasses import dataclass
import numpy as np
from contactopt import InterfaceProblem
from contactopt.benchmark import method, problem
from contactopt.methods.newton import Newton

@method
@dataclass(frozen=True)
class Mine:
    patience: int = 3
    def iterate(self, problem, start=None):
        return Newton().iterate(problem, start)

@problem
def identity(contacts=2):
    return InterfaceProblem(np.eye(2 * contacts), -np.ones((contacts, 2)), np.full(contacts, 0.3))
""",
        "mine.py",
    )
    text = """
        name = "x"
        plugins = ["mine.py"]
        [[problems]]
        family = "identity"
        contacts = {from = 1, to = 100, steps = 3, scale = "log"}
        [[methods]]
        method = "Mine"
        patience = [1, 2]
    """
    table = run(tmp_path, text)
    assert sorted(set(table["contacts"])) == [1, 10, 100] and set(table["status"]) == {"solved"}
    assert set(table["method"]) == {"Mine(patience=1)", "Mine(patience=2)"} and set(
        table["method.patience"]
    ) == {1, 2}
    assert (table["iterations"] >= 1).all() and table["label"].str.startswith("Mine(").all()


def test_entry_points(tmp_path, monkeypatch):
    (tmp_path / "theirs.py").write_text(
        "def theirs(problem):\n    import contactopt\n    return contactopt.solve(problem)\n"
    )
    info = tmp_path / "theirs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[contactopt.methods]\ntheirs = theirs:theirs\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    text = SMALL.replace('["auto", "nsgs"]', '"theirs"')
    table = run(tmp_path, text, filters=["problem=rigid*"])
    assert len(table) == 2 and set(table["status"]) == {"solved"}


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
    fclib.write(problems.FAMILIES["rigid_bodies"](3, 4), tmp_path / "a.hdf5")
    monkeypatch.setenv("SOME_FOLDER", str(tmp_path))
    table = run(tmp_path, text, filters=["problem=a"])
    assert set(table["problem"]) == {"a"} and set(table["status"]) == {"solved"}
    # no path of this machine
    assert str(tmp_path) not in (tmp_path / "out" / "rows.jsonl").read_text()


@pytest.mark.slow
def test_problems_that_cannot_be_built_are_rows(tmp_path):
    written(
        tmp_path,
        """
import os
from contactopt import InputError
from contactopt.benchmark import problem

@problem
def impossible():
    raise InputError("there is no such thing")

@problem
def deadly():
    os.abort()
""",
        "bad.py",
    )
    text = 'plugins = ["bad.py"]' + SMALL.replace(
        'scene = "punch-2d"\nmu = [0.2, 0.5]\nelements = 4', 'family = "impossible"'
    )
    text = text.replace("[[methods]]", '[[problems]]\nfamily = "deadly"\n[[methods]]')
    table = run(tmp_path, text)
    rows = table[table["family"].isin(["impossible", "deadly"])]
    assert len(rows) == 8 and set(rows["status"]) == {"not_built"}
    assert rows["message"].str.contains("no such thing|SIGABRT").all()


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
    rank_deficient = problems.FAMILIES["rigid_bodies"](4, 20, seed=1)
    assert np.linalg.matrix_rank(rank_deficient.Q) <= 24
    line = problems.half_plane(400)
    solution = solve(line)
    r, x = solution.reactions[:, 0], line.coordinates[0]
    assert solution.solved and abs(r.sum() - 0.25) < 1e-9
    # Hertz: a = 1/2, P = 1/4
    exact = np.sqrt(np.maximum(0.25 - x**2, 0)) * 2 * 0.25 / (np.pi * 0.25)
    assert np.abs(r / line.areas - exact).max() < 0.02 * exact.max()
    assert np.linalg.eigvalsh(problems.half_plane(50, coupling=0.4).Q).min() > 0
    held = problems.tangential("punch-2d", elements=4)
    r = solve(held, tol=1e-12).reactions
    np.testing.assert_allclose(r[:, 0], -held.q[:, 0] / np.diag(held.Q)[::2], rtol=1e-9)
    assert (np.abs(r[:, 1]) <= 0.5 * r[:, 0] * (1 + 1e-9)).all() and np.abs(r[:, 1]).max() > 0
    plain, twice = (
        problems.reduced("punch-2d", elements=4),
        problems.redundant("punch-2d", elements=4, copies=2),
    )
    shared = solve(twice, tol=1e-10).reactions.reshape(plain.contacts, 2, 2).sum(axis=1)
    np.testing.assert_allclose(shared, solve(plain, tol=1e-10).reactions, atol=1e-5)
    units = problems.in_units("punch-2d", force=1e-3, length=1e-3, elements=4)
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
    made = problems.scene("punch-2d", upper_nu=0.49, stiffness_ratio=10.0)
    assert made.upper.material.nu == 0.49 and made.lower.material.E == 10 * made.upper.material.E
    with pytest.raises(InputError, match="not both"):
        problems.scene("punch-2d", lower_E=2.0, stiffness_ratio=10.0)


@pytest.mark.slow
def test_a_run_past_its_time_limit_is_no_success(tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "GRACE", float(PATIENCE))
    written(
        tmp_path,
        "import time\nfrom contactopt import solve\nfrom contactopt.benchmark import"
        " method\n@method\ndef slow(problem):\n    time.sleep(0.5)\n    return"
        " solve(problem).reactions\n",
        "slow.py",
    )
    text = 'plugins = ["slow.py"]' + SMALL.replace('["auto", "nsgs"]', '"slow"').replace(
        "limit = 10.0", "limit = 0.4"
    )
    table = run(tmp_path, text, filters=["problem=rigid*"])
    assert (
        set(table["status"]) == {"time_limit"}
        and not table["success"].any()
        and (table["residual"] < 1e-8).all()
    )


@pytest.mark.slow
def test_threads_are_pinned(tmp_path):
    written(
        tmp_path,
        "import os\nfrom contactopt.benchmark import method\n@method\ndef look(problem):\n    raise"
        " RuntimeError(os.environ['OPENBLAS_NUM_THREADS'] + os.environ['RAYON_NUM_THREADS'])\n",
        "look.py",
    )
    table = run(
        tmp_path,
        'plugins = ["look.py"]' + SMALL.replace('["auto", "nsgs"]', '"look"'),
        filters=["problem=rigid*"],
    )
    assert table["message"].str.endswith("11").all()


@pytest.mark.slow
def test_a_worker_process_outlives_failures_that_leave_it_intact(tmp_path):
    with Worker() as worker:
        spec = problems.ProblemSpec("family", "rigid_bodies", {"bodies": 3, "contacts": 4})
        task = Task(Run(spec, MethodSpec("lemke"), "mid", 1e-6, 0), "x", (), 5.0, 4.0, 100, 0)
        first = worker.run(task)
        pid = worker.solver.process.pid
        assert first["status"] == "refused" and first["fingerprint"]
        assert worker.run(task)["status"] == "refused" and worker.solver.process.pid == pid


WARM = """
from contactopt import natural_map_residual, solve
from contactopt.benchmark import method

@method
def begins(problem, tol=1e-8, start=None):
    if start is not None and natural_map_residual(problem, start) < 1e-8:
        raise ValueError("the start is the answer already")
    return solve(problem, "nsgs", tol=tol).reactions

@method
def cold_only(problem, tol=1e-8):
    return solve(problem, "nsgs", tol=tol).reactions
"""


def test_a_sequence_is_one_row_from_cold_and_one_from_the_last_answers(tmp_path):
    written(tmp_path, WARM, "warm.py")
    table = run(
        tmp_path,
        """
        name = "sequences"
        plugins = ["warm.py"]
        settings = [1e-6]
        [[problems]]
        family = "growing_friction"
        of = "packing"
        bodies = 6
        steps = 4
        warm = [false, true]
        [[methods]]
        method = ["proximal", "begins", "cold_only"]
        """,
    )
    assert (table["states"] == 4).all()
    rows = table.set_index(["method", "problem.warm"])
    assert rows["success"].drop(("cold_only", True)).all()
    assert rows.loc[("cold_only", True), "status"] == "refused"  # not applicable, no failure
    assert "start" in rows.loc[("cold_only", True), "message"]
    warm, cold = (rows.loc[("proximal", warm), "iterations"] for warm in (True, False))
    assert warm <= cold
    made = benchmark.store.answers(tmp_path / "out")
    sequence = problems.FAMILIES["growing_friction"](of="packing", bodies=6, steps=4)
    for key, residual in zip(table["key"], table["residual"]):
        if np.isfinite(residual):
            assert certificate(sequence, made[key], None) == pytest.approx(residual)
