"""The commands that the reports name can at least start."""

from importlib import import_module
from pathlib import Path

import pytest

EXPERIMENTS = sorted(path.stem for path in (Path(__file__).parents[1] / "experiments").glob("*.py"))


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if name != "__init__"])
def test_every_experiment_imports_what_exists(name):
    assert import_module(f"experiments.{name}").__doc__
