"""The wheel holds what it must, and works in an environment that has nothing else."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def run(*command: str | Path, cwd: Path) -> str:
    """Output of a command that must succeed, with nothing of this environment on its path."""
    clean = {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("PYTHON", "VIRTUAL_ENV"))
    }
    done = subprocess.run(
        [str(c) for c in command], cwd=cwd, env=clean, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from a copy of the sources, so that nothing is left behind in the repository."""
    source = tmp_path_factory.mktemp("source")
    names = [
        *ROOT.joinpath("contactopt").rglob("*"),
        *(ROOT / name for name in ("pyproject.toml", "README.md", "LICENSE")),
    ]
    for path in names:
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".so":
            target = source / path.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(path.read_bytes())
    run(sys.executable, "-m", "build", "--wheel", "--outdir", source / "dist", source, cwd=source)
    (path,) = (source / "dist").glob("contactopt-*.whl")
    return path


@pytest.mark.slow
def test_it_holds_the_package_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    modules = {str(p.relative_to(ROOT)) for p in ROOT.joinpath("contactopt").rglob("*.py")}
    assert modules <= set(names)
    sweeps = {name for name in names if name.startswith("contactopt/methods/kernels/sweeps.")}
    compiled = len(sweeps - {"contactopt/methods/kernels/sweeps.c"})
    assert compiled == (shutil.which("cc") is not None), "the sweeps in C"
    assert "contactopt/py.typed" in names, "users' type checkers look for it"
    assert {name.split("/")[0].split("-")[0] for name in names} == {"contactopt"}


@pytest.mark.slow
def test_it_installs_and_runs_in_an_empty_environment(wheel, tmp_path):
    run(sys.executable, "-m", "venv", tmp_path / "venv", cwd=tmp_path)
    binaries = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin")
    run(binaries / "python", "-m", "pip", "install", "--quiet", wheel, cwd=tmp_path)
    assert "punch-2d" in run(binaries / "contactopt", "list", cwd=tmp_path)
    run(binaries / "contactopt", "run", "punch-2d", "--out", tmp_path / "out", cwd=tmp_path)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (
        summary["status"] == "solved"
        and (tmp_path / "out" / "deformed.png").stat().st_size > 10_000
    )
    code = "import contactopt; print(contactopt.__version__, contactopt.__file__)"
    version, place = run(binaries / "python", "-c", code, cwd=tmp_path).split()
    assert version in wheel.name and str(tmp_path) in place
