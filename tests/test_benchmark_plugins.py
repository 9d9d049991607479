"""Methods and problems of users in a campaign: honest, wrong, deadly, slow, and installed ones."""

import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from contactopt import benchmark
from contactopt.benchmark import pool
from contactopt.benchmark.families import FAMILIES
from contactopt.benchmark.sequences import certificate
from tests.test_benchmark import PATIENCE, SMALL, bench, run, written

HANGS = """
import time
from contactopt.benchmark import method

@method
def hangs(problem):
    time.sleep(1e4)
"""


@pytest.mark.slow
def test_workers_die_with_their_campaign(tmp_path):
    written(tmp_path, HANGS, "hangs.py")
    path = written(
        tmp_path,
        'name = "x"\nplugins = ["hangs.py"]\n[[problems]]\nscene'
        ' = "punch-2d"\n[[methods]]\nmethod = "hangs"\n',
    )
    command = bench(path, tmp_path / "out", jobs=1)
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    children = Path(f"/proc/{process.pid}/task")
    worker = None
    for _ in range(20 * PATIENCE):
        time.sleep(0.05)
        found = [w for task in children.iterdir() for w in (task / "children").read_text().split()]
        if len(found) > 1:  # not the one that only reads the experiment
            worker = Path(f"/proc/{found[-1]}")
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
    assert set(table["method"]) == {"Mine(patience=1)", "Mine(patience=2)"}
    assert set(table["method.patience"]) == {1, 2}
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

@problem
def is_none():
    return None

@problem
def exits():
    raise SystemExit(0)
""",
        "bad.py",
    )
    names = ["impossible", "deadly", "is_none", "exits"]
    families = "".join(f'[[problems]]\nfamily = "{name}"\n' for name in names)
    text = SMALL.replace("[[methods]]", families + "[[methods]]")
    table = run(tmp_path, 'plugins = ["bad.py"]' + text)
    rows = table[table["family"].isin(names)]
    assert len(rows) == 16 and set(rows["status"]) == {"not_built"}
    assert rows["message"].str.len().min() > 0
    assert rows["message"].str.contains("no such thing|SIGABRT").sum() == 8
    assert set(table["status"].drop(rows.index)) == {"solved"}


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
    assert set(table["status"]) == {"time_limit"} and not table["success"].any()
    assert (table["residual"] < 1e-8).all()


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
    sequence = FAMILIES["growing_friction"](of="packing", bodies=6, steps=4)
    for key, residual in zip(table["key"], table["residual"]):
        if np.isfinite(residual):
            assert certificate(sequence, made[key], None) == pytest.approx(residual)
