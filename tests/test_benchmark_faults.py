"""What can go wrong around a campaign: killed processes, full disks, bad plug-ins."""

import json
import os
import resource
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from contactopt import InputError, benchmark
from contactopt.benchmark import pool, problems, process, store
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.measure import Task
from contactopt.benchmark.runs import MethodSpec, Run
from contactopt.benchmark.store import lines
from contactopt.cli import main
from tests.test_benchmark import SMALL, bench, run, written

SCENE = '[[problems]]\nscene = "punch-2d"\nelements = 4\n'


def one_line(text: str, words: str = "") -> None:
    """A sentence of the program, not a traceback."""
    rows = text.strip().splitlines()
    assert "Traceback" not in text and rows[-1].startswith("contactopt: "), text
    assert words in rows[-1], text


# Plug-ins of every bad kind

BAD = """
import ctypes, os, subprocess, sys, time
import numpy as np
from contactopt import Solution, Status
from contactopt.benchmark import method

def right(problem):
    from contactopt.methods.driver import solve
    return solve(problem, tol=1e-10).reactions

@method
def forks(problem):
    os.fork()
    return right(problem)

@method
def lets_the_child_answer(problem):
    if os.fork():
        os._exit(0)
    return right(problem)

@method
def leaves(problem):
    os._exit(0)

@method
def interrupts(problem):
    raise KeyboardInterrupt

@method
def complex_numbers(problem):
    return right(problem) * (1 + 1j)

@method
def text(problem):
    return "solved"

@method
def too_many(problem):
    return np.zeros(10**6)

@method
def no_status(problem):
    return Solution(right(problem), np.zeros(len(problem.s)), "solved", 0.0, 1, "x")

@method
def shares_memory(problem):
    import mmap
    kept = [mmap.mmap(-1, 10**8) for _ in range(50)]
    return right(problem)

@method
def chatters(problem):
    while True:
        os.write(1, b"x" * 10**6)

@method
def segfaults(problem):
    ctypes.string_at(0)

@method
def aborts(problem):
    print("last words")
    os.abort()

@method
def hangs(problem):
    while True:
        time.sleep(1)

@method
def nan(problem):
    return np.full(problem.q.shape, np.nan)

@method
def lies(problem, tol=1e-8):
    return Solution(1.01 * right(problem), np.zeros(len(problem.s)), Status.SOLVED, 0.0, 1, "lies")

@method
def hoards(problem):
    return np.ones(10**9)

@method
def raises(problem):
    raise KeyError("an argument")

@method
def honest(problem, number=0):
    return right(problem)
"""

ENDS = {
    "forks": "solved", "lets_the_child_answer": "crashed", "leaves": "crashed",
    "interrupts": "error", "complex_numbers": "error", "text": "error", "too_many": "error",
    "no_status": "error", "shares_memory": "out_of_memory", "chatters": "killed",
    "segfaults": "crashed", "aborts": "crashed", "hangs": "killed", "nan": "not_finite",
    "lies": "false_claim", "hoards": "out_of_memory", "raises": "error", "honest": "solved",
}  # fmt: skip


@pytest.mark.slow
def test_plugins_of_every_bad_kind_get_the_rows_that_they_deserve(tmp_path, monkeypatch):
    """Between them stand honest runs, which must be certified whatever the plug-in before did to
    their process.
    """
    largest = []
    whole = process.Process._wait
    monkeypatch.setattr(process, "MOST_WORDS", 1e6)
    monkeypatch.setattr(process, "BEAT", 0.02)

    def cut(self, *given):
        largest.append(os.fstat(self.noise.fileno()).st_size)
        return whole(self, *given)

    monkeypatch.setattr(process.Process, "_wait", cut)
    written(tmp_path, BAD, "bad.py")
    text = """
        name = "bad"
        plugins = ["bad.py"]
        time_limit = 5.0
        memory_limit = 1.0
        settings = ["mid"]
    """
    text += SCENE
    for number, name in enumerate(name for name in ENDS if name != "honest"):
        text += f'[[methods]]\nmethod = "{name}"\n'
        text += f'[[methods]]\nmethod = "honest"\nnumber = {number}\n' if number % 2 else ""
    table = run(tmp_path, text)
    assert len(table) == len(read_experiment(tmp_path / "experiment.toml").methods)
    assert table["key"].is_unique
    ends = {name: set(rows["status"]) for name, rows in table.groupby("name")}
    assert ends == {name: {status} for name, status in ENDS.items()}
    # of those that never returned, too
    assert table["fingerprint"].nunique() == 1 and set(table["contacts"]) == {5}
    assert (table["success"] == (table["residual"] <= 1e-6)).all()
    row = {name: rows.iloc[0] for name, rows in table.groupby("name")}
    assert row["segfaults"]["message"].startswith("SIGSEGV")
    assert "SIGABRT" in row["aborts"]["message"] and "last words" in row["aborts"]["message"]
    assert "KeyError" in row["raises"]["message"] and np.isinf(row["nan"]["residual"])
    assert row["lies"]["claimed"] and not row["lies"]["success"] and row["lies"]["residual"] > 1e-4
    assert set(table["status"]) <= set(store.STATUSES)
    assert max(largest) < 1e9, "what a solver prints is thrown away beyond a bound"


@pytest.mark.slow
def test_a_hanging_plugin_costs_about_its_time_limit(tmp_path):
    """The first run also costs its warm-up; those that follow cost their limit and a start."""
    name = f"hangs_{os.getpid()}"
    source = "import time\nfrom contactopt.benchmark import method\n@method\n"
    source += f"def {name}(problem, n=0):\n    time.sleep(1e4)\n"
    written(tmp_path, source, "mine.py")
    spec = problems.ProblemSpec("family", "rigid_bodies", {"bodies": 3, "contacts": 4})
    plugins = (str(tmp_path / "mine.py"),)
    seconds = []
    with pool.Worker() as worker:
        for number in range(3):
            method = MethodSpec(name, {"n": number})
            task = Task(Run(spec, method, "mid", 1e-6, 0), "x", plugins, 0.5, 4.0, 100, 0)
            row = worker.run(task)
            seconds.append(row["call_seconds"])
            assert row["status"] == "killed" and "still running after 1.05 s" in row["message"]
        hard, start = 1.05, time.monotonic()
        worker.solver.start()
        worker.solver.ask(100.0, "look", os.getpid)
        start = time.monotonic() - start
    assert seconds[0] < pool.PLUGIN_WARM_UP + hard + 4 * start + 10.0
    assert max(seconds[1:]) < hard + 2 * start + 10.0


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("raise SystemExit(3)\n", "SystemExit"),
        ("from contactopt.benchmark import method\nmethod(3)\n", "must be a function"),
        ("from contactopt.benchmark import method\nmethod(len, name=3)\n", "name"),
        (
            "from contactopt.benchmark import problem as p\n@p(name='springs')\ndef f(): pass\n",
            "springs",
        ),
        ("def (", "SyntaxError"),
    ],
)
def test_plugin_files_that_cannot_be_loaded_are_one_sentence(tmp_path, source, words):
    written(tmp_path, source, "mine.py")
    with pytest.raises(InputError, match=words):
        read_experiment(written(tmp_path, 'plugins = ["mine.py"]' + SMALL))


# Numbers


@pytest.mark.parametrize(("old", "new", "words"), [
    ("repeats = 2", "repeats = 1000000000", "whole number"),
    ("repeats = 2", "repeats = 100000", "runs"),
    ("repeats = 2", "repeats = 2\nseed = 4294967296", "seed"),
    ("repeats = 2", f"repeats = 2\nseed = -{10**30}", "seed"),
    ("repeats = 2", "repeats = 2\nmax_iterations = 1e9", "max_iterations"),
    ("repeats = 2", 'repeats = 2\nsettings = ["mid", "mid"]', "twice"),
    ("repeats = 2", "repeats = 2\nplugins = [3]", "plugins"),
    ("repeats = 2", "repeats = 2\nplugins = {a = 1}", "plugins"),
    ("limit = 10.0", "limit = 1e300", "time_limit"),
    ("limit = 10.0", "limit = inf", "time_limit"),
    ("limit = 10.0", 'limit = "long"', "time_limit"),
    ("limit = 10.0", "limit = 10.0\nmemory_limit = 1e-9", "memory_limit"),
    ("limit = 10.0", "limit = 10.0\nmemory_limit = 1e30", "memory_limit"),
    ("mu = [0.2, 0.5]", "mu = {from = 0.1, to = 1.0, steps = 1000000000}", "runs"),
    ("mu = [0.2, 0.5]", "mu = {from = 0.1, to = nan, steps = 3}", "'to'"),
    ("mu = [0.2, 0.5]", 'mu = {from = "a", to = 1.0, steps = 3}', "'from'"),
    ("mu = [0.2, 0.5]", "mu = [[0.2], 0.5]", "'mu'"),
    ("mu = [0.2, 0.5]", "mu = 2020-01-01", "'mu'"),
    ("elements = 4", f"elements = {10**30}", "elements"),
    ("bodies = 4",
     "bodies = {from = 2, to = 900, steps = 800}\nseed = {from = 1, to = 999, steps = 900}",
     "runs"),
    ('["auto", "nsgs"]', "[3]", "name"),
])  # fmt: skip
def test_absurd_numbers_are_refused_in_one_sentence_before_any_work(
    tmp_path, capsys, old, new, words
):
    assert old in SMALL
    path = written(tmp_path, SMALL.replace(old, new))
    begin = time.process_time()
    assert main(["bench", str(path), "--out", str(tmp_path / "out")]) == 2
    one_line(capsys.readouterr().err, words)
    assert time.process_time() - begin < 5 and not (tmp_path / "out").exists()


def test_absurd_numbers_of_workers(tmp_path, capsys):
    path = written(tmp_path, SMALL)
    for jobs in ("0", "-1"):
        assert main(f"bench {path} --jobs {jobs} --out {tmp_path / 'out'}".split()) == 2
        one_line(capsys.readouterr().err, "jobs")


# Disks


def ended(path: Path, out: Path, *more: str, **settings) -> subprocess.CompletedProcess:
    return subprocess.run(bench(path, out, *more), capture_output=True, text=True, **settings)


@pytest.mark.slow
def test_malformed_rows_are_made_again(campaign, tmp_path):
    path, out = written(tmp_path, SMALL), shutil.copytree(campaign, tmp_path / "out")
    good = benchmark.load(out)
    rows = (out / "rows.jsonl").read_text().splitlines()
    first = json.loads(rows[0])
    bad = ["3", "[]", "null", "{}", '"x"', "[" * 100_000, '{"key": "', "\x00"]
    (out / "rows.jsonl").write_text("\n".join([*bad, *rows[2:], '{"torn']))
    assert ended(path, out, "--resume").returncode == 0
    table = benchmark.load(out)
    assert len(table) == len(good) and set(table["key"]) == set(good["key"])
    (out / "rows.jsonl").write_text(json.dumps(first | {"schema": 99}) + "\n")
    result = ended(path, out, "--resume")
    assert result.returncode == 2
    one_line(result.stderr, "newer version")


@pytest.mark.slow
def test_answers_of_another_size_are_not_compared(tmp_path):
    run(tmp_path, SMALL, filters=["problem=rigid*"])
    path = tmp_path / "out" / "rows.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows[0]["answer"], rows[0]["residual"] = store.pack(np.zeros(3)), 1e-9
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert benchmark.load(path)["error"].isna().sum() in (1, len(rows), len(rows) - 1)
    rows[0]["answer"] = "not base64"  # told with its line, and left out
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert len(benchmark.load(path)) == len(rows) - 1


@pytest.mark.slow
def test_a_full_disk_is_one_sentence_and_loses_nothing(tmp_path):
    """Files may not grow beyond the middle of the rows; with room again the campaign goes on."""
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 4")), tmp_path / "out"
    expected = {r.key for r in read_experiment(path).runs()}
    for size in (10, 20_000):
        limit = lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
        result = ended(path, out, "--resume", preexec_fn=limit)
        assert result.returncode == 2
        one_line(result.stderr, "cannot write")
        assert not list(out.glob(".contactopt-*")) and not (out / "rows.parquet").exists()
    text = (out / "rows.jsonl").read_bytes()
    assert 0 < len(text) <= 20_000 and text.endswith(b"\n")
    assert ended(path, out, "--resume").returncode == 0
    keys = [row["key"] for row in lines(out / "rows.jsonl")]
    assert len(keys) == len(set(keys)) and set(keys) == expected


def test_folders_that_cannot_be_written(tmp_path, capsys):
    path = written(tmp_path, SMALL)
    (tmp_path / "file").write_text("")
    file = str(tmp_path / "file")
    for out in ("/proc/nothing", file, f"{file}/below", "/dev/full"):
        assert main(["bench", str(path), "--out", out, "--jobs", "1"]) == 2
        one_line(capsys.readouterr().err, "write")
