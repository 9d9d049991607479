"""Every bridge whose package is there gives our own answer from the stiffness of another code."""

import pytest

from experiments.bridges.__main__ import BRIDGES, compared, python_of


@pytest.mark.slow
@pytest.mark.parametrize("name", BRIDGES)
def test_a_bridge_gives_our_answer(name):
    python = python_of(name)
    if python is None:
        pytest.skip(f"{BRIDGES[name][0]} is not there")
    row = compared(name, python, 6)
    assert row["forces differ by"] < 1e-10 and row["displacements differ by"] < 1e-10
    assert row["lines"] <= 30
