"""The wheel holds what it must, and works in an environment that has nothing else."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from textwrap import indent

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
    """Built from the source distribution of a copy of the sources: nothing is left behind here."""
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
    run(sys.executable, "-m", "build", "--outdir", source / "dist", source, cwd=source)
    (path,) = (source / "dist").glob("contactopt-*.whl")
    return path


def environment(folder: Path, *packages: str | Path, beneath: Path | None = None) -> Path:
    """The Python of a new environment with these packages; it sees those of the one beneath."""
    run(sys.executable, "-m", "venv", folder, cwd=folder.parent)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    if beneath is not None:
        where = "import sysconfig; print(sysconfig.get_path('purelib'))"
        own, lower = (Path(run(one, "-c", where, cwd=folder).strip()) for one in (python, beneath))
        # with the .pth files there: proxsuite is found by one
        (own / "beneath.pth").write_text(f"import site; site.addsitedir({str(lower)!r})\n")
    run(python, "-m", "pip", "install", "--quiet", *packages, cwd=folder)
    return python


@pytest.fixture(scope="module")
def plain(wheel, tmp_path_factory) -> Path:
    """The Python of an environment with the wheel and what it needs, without any extra."""
    return environment(tmp_path_factory.mktemp("plain") / "venv", wheel)


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
def test_it_installs_and_runs_in_an_empty_environment(wheel, plain, tmp_path):
    binaries = plain.parent
    assert "punch-2d" in run(binaries / "contactopt", "list", cwd=tmp_path)
    run(binaries / "contactopt", "run", "punch-2d", "--out", tmp_path / "out", cwd=tmp_path)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "solved"
    assert (tmp_path / "out" / "deformed.png").stat().st_size > 10_000
    page = "import contactopt as c; c.run('punch-2d', elements=4).view('page.html', show=False)"
    run(binaries / "python", "-c", page, cwd=tmp_path)
    assert (tmp_path / "page.html").stat().st_size > 50_000, "pages need no extra"
    code = "import contactopt; print(contactopt.__version__, contactopt.__file__)"
    version, place = run(binaries / "python", "-c", code, cwd=tmp_path).split()
    assert version in wheel.name and str(plain.parents[1]) in place
    user = tmp_path / "user.py"
    user.write_text(
        "import contactopt\nreveal_type(contactopt.run('punch-2d').solution.residual)\n"
    )
    told = run(sys.executable, "-m", "mypy", "--config-file=", "--python-executable",
               binaries / "python", user, cwd=tmp_path)  # fmt: skip
    assert re.search(r'"(builtins\.)?float"', told), "users' type checkers see the types"


# what each extra is for, tried in an environment that has no other extra
TRIED = {
    "fclib": """
from contactopt import fclib, reduce, scenes
problem = reduce(scenes.flat_punch(2, elements=4))
fclib.write(problem, "problem.hdf5")
assert fclib.read("problem.hdf5").contacts == problem.contacts
""",
    "backends": """
from contactopt import reduce, scenes, solve
from contactopt.methods.backends import CONIC, QP
problem = reduce(scenes.flat_punch(2, elements=4))
extra = {"daqp", "ecos", "highs", "piqp", "quadprog", "scs"}
assert extra <= {*QP, *CONIC}
for name in sorted(extra & set(QP)):
    assert solve(problem, normal=name, tol=1e-6).solved, name
assert solve(problem, tangential="ecos", tol=1e-6).solved
""",
    "fast": """
import contactopt
assert contactopt.run("punch-2d", solver="pardiso").solution.solved
""",
    "jax": """
import jax
jax.config.update("jax_enable_x64", True)
from contactopt import scenes
from contactopt.jax import quantity
value = quantity(scenes.flat_punch(2, elements=4), "approach", ("mu",))
assert abs(jax.grad(value)(jax.numpy.array([0.1]))[0]) > 0
""",
    "benchmark": """
from pathlib import Path
from textwrap import indent
from contactopt.cli import main
text = '[[problems]]\\nscene = "punch-2d"\\nelements = 4\\n[[methods]]\\nmethod = "auto"\\n'
Path("few.toml").write_text('name = "few"\\ntitle = "few"\\n' + text)
assert main(["bench", "few.toml", "--out", "out"]) == 0
assert main(["report", "out"]) == 0
""",
    "cluster": """
from distributed import Client
from contactopt.benchmark import cluster
with Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
    assert client.submit(abs, -1).result() == 1
""",
    "mesh": """
import gmsh
gmsh.initialize()
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
gmsh.write("box.step")
gmsh.finalize()
from contactopt.cli import main
assert main(["mesh", "box.step", "--out", "box.msh"]) == 0
""",
}
INTO_DOCS = ("experiments", "reports", "pyproject.toml", "LICENSE")
INTO_DOCS += ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
# tests/test_site.py builds all pages; here one tutorial and one room stand for the others
FEW_PAGES = """
exclude_patterns += ["generated/tutorials/[!h]*", "generated/api/[!f]*", "generated/reports/*"]
exclude_patterns += ["generated/course/*", "generated/gallery/*"]
nb_execution_mode = "off"
suppress_warnings = ["myst-nb.lexer", "myst.xref_missing", "toc.excluded", "toc.empty_glob"]
"""


@pytest.mark.slow
@pytest.mark.parametrize("extra", [*TRIED, "docs"])
def test_each_extra_alone_does_what_it_is_for(wheel, plain, tmp_path, extra):
    python = environment(tmp_path / "venv", f"{wheel}[{extra}]", beneath=plain)
    if extra != "docs":
        program = f"if __name__ == '__main__':\n{indent(TRIED[extra], '    ')}"
        run(python, "-c", program, cwd=tmp_path)
        return
    # the pages, as README says; what they execute is executed where README's commands are typed
    for name in INTO_DOCS:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tmp_path / name)
    with (tmp_path / "experiments" / "site" / "conf.py").open("a") as file:
        file.write(FEW_PAGES)
    build = ("-W", "--keep-going", "-b", "html")
    run(python, "-m", "sphinx", *build, "experiments/site", "out/site", cwd=tmp_path)
    site = tmp_path / "out" / "site"
    pages = {page.stem for page in (site / "generated" / "tutorials").glob("*.html")}
    assert (site / "index.html").exists() and pages == {"half_space_or_finite_elements"}


def test_no_extra_is_left_untried():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(extras["optional-dependencies"]) == {*TRIED, "docs", "test"}
