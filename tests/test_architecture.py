"""Data flows one way, and what is heavy waits until it is used."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_rooms_import_only_what_stands_below_them():
    tool = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([tool, "--no-cache"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout


def test_heavy_imports_wait_until_they_are_used():
    code = (
        "import sys, contactopt, contactopt.cli, contactopt.methods.driver;print([m for m in"
        " ('skfem', 'cvxpy', 'matplotlib', 'qpsolvers', 'meshio') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
