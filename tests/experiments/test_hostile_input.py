"""Input of every wrong kind ends in an answer or in the project's own exceptions."""

import pytest

from experiments.questions.hostile_input import DOORS, judge


@pytest.mark.parametrize("door", range(len(DOORS)))
def test_random_wrong_input(door):
    for seed in range(door, 12 * len(DOORS), len(DOORS)):
        name, ending, what = judge(seed)
        assert ending in ("answered", "refused"), f"seed {seed} ({name}): {what}"
