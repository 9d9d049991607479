"""The commands that the reports name can at least start."""

from importlib import import_module
from pathlib import Path

import pytest

EXPERIMENTS = sorted(path.stem for path in (Path(__file__).parents[1] / "experiments").glob("*.py"))


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if name != "__init__"])
def test_every_experiment_imports_what_exists(name):
    assert import_module(f"experiments.{name}").__doc__


def test_the_comparison_without_crossover_goes_without_it():
    """It patches a name of the package, which may move."""
    from contactopt import reduce, scenes, solve
    from experiments.qp_backends import without_crossover

    problem = reduce(scenes.flat_punch(2, elements=8))
    raw = without_crossover("clarabel", problem)
    mended = solve(problem, "alternating", normal="clarabel", tangential="clarabel", tol=1e-9)
    assert mended.solved and abs(raw.reactions - mended.reactions).max() > 1e-14
