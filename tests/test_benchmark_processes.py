"""Processes of a campaign that are killed, grow or hang cost no more than their own run."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from contactopt import solve
from contactopt.benchmark import pool, problems, process, worker
from contactopt.benchmark.experiment import read_experiment
from contactopt.benchmark.measure import Task
from contactopt.benchmark.runs import MethodSpec, Run
from contactopt.benchmark.store import lines
from contactopt.linear.convolution import Convolution
from contactopt.methods.backends import child
from tests.test_benchmark import SMALL, bench, count, run, written


@pytest.mark.slow
def test_nothing_that_a_solver_started_outlives_the_campaign(tmp_path):
    """A child in a session of its own, and its child, whose parent is gone."""
    source = """
import os, subprocess, sys, time
from pathlib import Path
import numpy as np
from contactopt.benchmark import method

@method
def leaves_children(problem):
    code = "import os, time; os.fork() and os._exit(0)"
    code += "; print(os.getpid(), flush=True); time.sleep(1e4)"
    options = {"start_new_session": True, "stdout": subprocess.PIPE}
    own = subprocess.Popen([sys.executable, "-c", code], **options)
    Path(__file__).with_name("numbers").open("a").write(own.stdout.readline().decode())
    return np.zeros(problem.q.shape)
"""
    written(tmp_path, source, "mine.py")
    text = 'name = "x"\nplugins = ["mine.py"]\n[[problems]]\nfamily = "rigid_bodies"\n'
    run(tmp_path, text + '[[methods]]\nmethod = "leaves_children"\n')
    numbers = tmp_path / "numbers"
    assert numbers.exists() and not [n for n in numbers.read_text().split() if lives(int(n))]


def lives(number: int) -> bool:
    """Whether a process is there and not a dead one that nobody has asked for yet."""
    import psutil

    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(number).status() != psutil.STATUS_ZOMBIE
    return False


# Kills


@pytest.mark.slow
def test_killed_processes_cost_their_own_run_only(tmp_path):
    """SIGKILL to the processes that run methods, then to the whole campaign, at random moments."""
    path, out = written(tmp_path, SMALL.replace("repeats = 2", "repeats = 15")), tmp_path / "out"
    expected = read_experiment(path).runs()
    rng = np.random.default_rng(5)
    command = bench(path, out, "--resume")
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    killed = 0
    for rounds in range(3):
        process = subprocess.Popen(command, start_new_session=True, **quiet)
        before, begin = count(out), time.monotonic()
        while process.poll() is None and count(out) == before and time.monotonic() - begin < 120:
            time.sleep(0.02)
        for _ in range(2):
            time.sleep(rng.uniform(0, 0.1))
            workers = solvers(process.pid)
            if workers:
                os.kill(int(rng.choice(workers)), signal.SIGKILL)
                killed += 1
        if rounds < 2:
            os.killpg(process.pid, signal.SIGKILL)
        assert process.wait(120) == (0 if rounds == 2 else -signal.SIGKILL)
    rows = list(lines(out / "rows.jsonl"))
    keys = [row["key"] for row in rows]
    slow = pool.History(rows)  # runs that a busy machine made so long that they are not repeated
    least = {r.key for r in expected if not slow.repeated(r)}
    assert len(keys) == len(set(keys)) and least <= set(keys) <= {r.key for r in expected}
    failed = [row for row in rows if not row["success"]]
    assert len(failed) <= killed and {row["status"] for row in failed} <= {"out_of_memory"}
    assert killed >= 2


GROWN = []


def grow(size: int) -> int:
    """Keep so many bytes for ever; the number of the process."""
    GROWN.append(np.ones(size // 8))
    time.sleep(0.4)
    return os.getpid()


@pytest.mark.slow
def test_a_process_that_grows_goes_on():
    """A library would recycle a process that grew by 300 MB, and told a call then as a crash."""
    grown = process.Process()
    try:
        numbers = {grown.ask(60, "grow", grow, 150 * 10**6) for _ in range(6)}
    finally:
        grown.kill()
    assert len(numbers) == 1


def test_a_worker_says_nothing_to_the_pythons_of_others(monkeypatch):
    """A peer in another Python would take packages of this one for its own."""
    monkeypatch.delenv("PYTHONPATH", raising=False)
    made = process.Process()
    try:
        assert made.ask(60, "look", os.getenv, "PYTHONPATH") is None
    finally:
        made.kill()


def test_a_half_space_goes_to_other_processes_by_its_kernel():
    """No array is made of its Q, so that its size is no limit."""
    (spec,) = problems.named(
        "family", "by_products", {"of": "hertz-half-space", "elements": 16}, Path(".")
    )
    builder = process.Process()
    try:
        made, facts = builder.ask(60, "build", worker.build, spec, (), False, 4.0)
    finally:
        builder.kill()
    assert facts["contacts"] == made.contacts and made.q.size > worker.MOST_ROWS
    assert isinstance(made.Q, Convolution) and solve(made).solved
    x = np.random.default_rng(0).normal(size=made.q.size)
    assert np.array_equal(made.Q @ x, spec.build({}).Q @ x)


@pytest.fixture
def deadly_pipes():
    """As gmsh leaves it: a broken pipe would end this process."""
    before = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGPIPE, before)


@pytest.mark.slow
def test_a_process_killed_while_nobody_asks_it_is_started_again(monkeypatch, deadly_pipes):
    """A builder that dies between two problems, or once while it builds, costs no run."""
    with pool.Worker() as worker:
        first = worker.builder.ask(60.0, "look", os.getpid)
        os.kill(first, signal.SIGKILL)
        os.waitid(os.P_PID, first, os.WEXITED | os.WNOWAIT)
        assert worker.builder.ask(60.0, "look", os.getpid) != first
        ask, deaths = process.Process.ask, [process.Ended("build", "out_of_memory", process.KILLED)]

        def once(self, limit, phase, *given):
            if phase == "build" and deaths:
                raise deaths.pop()
            return ask(self, limit, phase, *given)

        monkeypatch.setattr(process.Process, "ask", once)
        spec = problems.ProblemSpec("family", "rigid_bodies", {"bodies": 3, "contacts": 4})
        run = Run(spec, MethodSpec("auto"), "mid", 1e-6, 0)
        assert worker.run(Task(run, "x", (), 5.0, 4.0, 100, 0))["success"] and not deaths


@pytest.mark.slow
@pytest.mark.parametrize("kills", [2, 3])
def test_a_solver_killed_while_it_starts_is_started_again(monkeypatch, kills):
    """Twice may be chance; a process that never says a word ends the campaign with a sentence."""
    starts = []

    deadly, whole = "import os; os.kill(os.getpid(), 9)  # {} {}", process.PROGRAM

    class Killed(process.Process):
        def start(self):
            if not self.running:
                starts.append(1)
                monkeypatch.setattr(process, "PROGRAM", deadly if len(starts) <= kills else whole)
            super().start()

    made = Killed()
    try:
        if kills < 3:
            assert made.ask(60.0, "look", os.getpid) > 0
        else:
            with pytest.raises(process.Ended) as error:
                made.ask(60.0, "look", os.getpid)
            assert error.value.phase == process.START
    finally:
        made.kill()


def solvers(campaign: int) -> list[int]:
    """The worker processes of a campaign."""
    import psutil

    with contextlib.suppress(psutil.Error):
        return [
            own.pid
            for own in psutil.Process(campaign).children()
            if "benchmark.process" in " ".join(own.cmdline())
        ]
    return []


@pytest.mark.slow
def test_a_plug_in_counts_for_the_registry_that_runs_its_file(tmp_path):
    """Nothing is left in the module by a second registry, or by a plain import."""
    from contactopt.benchmark.plugins import Registry

    file = tmp_path / "mine.py"
    file.write_text(
        "from contactopt.benchmark import method, problem\n@method(name='own')\ndef mine(p):"
        " return p.q\n@problem(name='other')\ndef family(n=1): return n\n"
    )
    first, second = Registry(), Registry()
    first.load([file, file])
    mine = first.methods.get("own")
    assert mine is not None and first.problems["other"]() == 1
    assert "own" not in second.methods and not second.problems
    names = {}
    exec(compile(file.read_text(), file, "exec"), names)
    assert callable(names["mine"]) and "own" not in second.methods
    assert list(first.methods) == ["own"]


def test_writing_to_a_dead_process_is_an_error_whatever_a_library_did_to_the_signal(deadly_pipes):
    process = subprocess.Popen(
        [sys.executable, "-c", ""], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    process.stdin.write(b"word")  # stays in the buffer until the pipe is closed
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    child._stop(process)
    assert process.stdin.closed
