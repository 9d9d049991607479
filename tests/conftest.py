"""Small problems that several test files share."""

import os
import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from contactopt import InterfaceProblem, Material, Part, Plate, Scene, Support, reduce, scenes
from contactopt.meshes.structured import rename, tensor_mesh
from tests.without import optional_packages

MATERIAL = Material(5.0, 0.3)
EXTRAS = optional_packages()
OPTIONAL = {name for group in EXTRAS.values() for name in group}


def pytest_configure():
    """Workers share the processors: each, and what it starts, has one thread for linear algebra,
    unless the user says otherwise.
    """
    if "PYTEST_XDIST_WORKER" in os.environ and "OMP_NUM_THREADS" not in os.environ:
        os.environ["OMP_NUM_THREADS"] = "1"
        threadpool_limits(1)


def _missing(error: BaseException) -> str | None:
    """The optional package whose absence an error tells, in Python's words or by our advice."""
    said = str(error)
    names = set(re.findall(r"No module named '(\w+)", said))
    if "pip install" in said:
        names |= set(re.findall(r"\w+", said))
        names |= {name for extra in names & set(EXTRAS) for name in EXTRAS[extra]}
    absent = sorted(name for name in names & OPTIONAL if find_spec(name) is None)
    return absent[0] if absent else _missing(error.__cause__) if error.__cause__ else None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    return (yield from _skipping())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    return (yield from _skipping())


def _skipping():
    """Skip a test that needs an optional package which is not there. Packages that the project
    requires are not among these: without them tests fail. `python -m tests.without` shows it.
    """
    try:
        return (yield)
    except Exception as error:
        if missing := _missing(error):
            pytest.skip(f"needs {missing}")
        raise


def one_contact(force: tuple[float, float], mu: float) -> InterfaceProblem:
    """K u = f - (t, n) with K = [[1, 1.5], [1.5, 4]] (order tangential, normal), as Q r + q = u
    with normal first.
    """
    W = np.linalg.inv(np.array([[1.0, 1.5], [1.5, 4.0]]))
    swap = [1, 0]
    return InterfaceProblem(W[np.ix_(swap, swap)], [-(W @ force)[swap]], mu)


def block(kind: str, low: float, high: float, cells=4, width=1.0, layers=None, power=1.3):
    """Unit-wide block between two heights: square, cylinder's section or cube."""
    across = np.linspace(0.0, width, cells + 1) ** power  # uneven on purpose
    grids = [across] * (2 if kind == "solid" else 1)
    up = "z" if kind == "solid" else "y"
    names = {f"side{i}": f"{'xy'[i]}-" for i in range(len(grids))} | {
        "top": f"{up}+",
        "bottom": f"{up}-",
    }
    return rename(tensor_mesh(*grids, np.linspace(low, high, layers or cells)), **names)


def two_blocks(kind: str, force: float = 3.0, mu: float = 0.0, material=MATERIAL) -> Scene:
    """Two blocks pressed together by a frictionless plate: the stress is uniform and uniaxial."""
    components = {"plane-strain": "xy", "axisymmetric": "rz", "solid": "xyz"}[kind]
    sides = tuple(Support(f"side{i}", {c: 0.0}) for i, c in enumerate(components[:-1]))
    up = components[-1]
    upper = Part(
        "upper",
        block(kind, 0, 1),
        material,
        sides,
        (Plate("top", {up: -force}, glued=False),),
        contact="bottom",
    )
    lower = Part(
        "lower", block(kind, -2, 0), material, (*sides, Support("bottom", {up: 0.0})), contact="top"
    )
    return Scene(f"two blocks, {kind}", upper, lower, mu, kind=kind)


@pytest.fixture(scope="session")
def punch() -> InterfaceProblem:
    return reduce(scenes.flat_punch(2, elements=8))


@pytest.fixture(scope="session")
def cube() -> InterfaceProblem:
    return reduce(scenes.flat_punch(3, elements=4))


@pytest.fixture(scope="session")
def campaign(tmp_path_factory) -> Path:
    """The folder of a small campaign, with its report."""
    import fcntl

    from contactopt.cli import main
    from tests.test_benchmark import SMALL, written

    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent  # that of all workers, of which the first one runs the campaign
    folder, done = shared / "campaign", shared / "campaign" / "done"
    folder.mkdir(exist_ok=True)
    with (shared / "campaign.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            command = ["bench", str(written(folder, SMALL)), "--out", str(folder / "out")]
            assert main([*command, "--jobs", "2", "-q"]) == 0
            done.touch()
    return folder / "out"


@pytest.fixture
def without_sweeps(monkeypatch):
    """The package as it is installed without a C compiler: no Gauss-Seidel sweeps come first."""
    monkeypatch.setattr("contactopt.methods.kernels.gauss_seidel.sweeps", None)
