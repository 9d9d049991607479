"""Where the field compares solvers: benchopt runs ours, qpbenchmark reads what we write."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contactopt.cli import main

FOLDER = Path(__file__).parents[1] / "experiments" / "benchopt"


@pytest.mark.slow
def test_benchopt_runs_our_methods_on_two_problems(tmp_path):
    pytest.importorskip("benchopt")
    pd = pytest.importorskip("pandas")
    bench = shutil.copytree(FOLDER, tmp_path / "bench")
    names = ["punch-2d", "rigid_bodies"]
    chosen = [word for name in names for word in ("-d", f"contacts[problem={name}]")]
    command = [sys.executable, "-m", "benchopt", "run", str(bench), *chosen, "-r", "1"]
    options = ["--no-plot", "--no-html", "--no-cache", "--output", "found"]
    subprocess.run([*command, *options], check=True, timeout=300, stdout=subprocess.DEVNULL)
    table = pd.read_parquet(bench / "outputs" / "found.parquet")
    assert set(table["p_dataset_problem"]) == set(names)
    assert len(table) == 2 * 3 * 3
    assert (table["objective_value"] <= table["p_solver_tol"]).all(), table
    assert table["objective_value"].nunique() > 9  # the value is no constant


def test_qpbenchmark_reads_and_solves_what_is_written(tmp_path):
    qpbenchmark = pytest.importorskip("qpbenchmark")
    qpsolvers = pytest.importorskip("qpsolvers")
    if "clarabel" not in qpsolvers.available_solvers:
        pytest.skip("needs Clarabel")
    name = "punch-2d(elements=8, mu=0.5, stiffness_ratio=1)"
    assert (
        main(["problems", "write", name, "--testset", "1", "--as", "npz", "--out", str(tmp_path)])
        == 0
    )
    files = sorted(tmp_path.glob("*.npz"))
    assert {file.stem.rpartition("_")[2] for file in files} >= {"normal", "tangential", "tresca"}
    for file in files:
        problem = qpbenchmark.Problem.load(str(file)).to_sparse()
        found = qpsolvers.solve_problem(problem, "clarabel")
        size = max(1.0, np.abs(problem.q).max(), np.abs(found.x).max())
        assert found.found and found.primal_residual() < 1e-6 * size
        assert found.dual_residual() < 1e-6 * size


def test_the_page_of_the_format_writes_a_problem_that_is_read_and_solved(tmp_path, monkeypatch):
    """One contact on a plate, by hand: r_n = 3 balances the load, and r_t = -q_t / W_t sticks."""
    pytest.importorskip("h5py")
    page = (FOLDER.parent / "site" / "problem_format.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.S)
    monkeypatch.chdir(tmp_path)
    made: dict[str, object] = {}
    for block in blocks:
        exec(block, made)
    answer = made["answer"]
    np.testing.assert_allclose(answer.reactions, [[3.0, -0.5]], atol=1e-6)
    np.testing.assert_allclose(answer.multipliers, [-6.0], atol=1e-6)
