"""No answer of random problems is called solved and is wrong."""

import pytest

from experiments.questions.search_for_lies import FAMILIES, judge, make


@pytest.mark.parametrize("family", range(len(FAMILIES)), ids=lambda i: FAMILIES[i].__name__)
def test_no_lie_among_random_problems(family):
    for seed in range(99_000 + family, 99_000 + family + 12 * len(FAMILIES), len(FAMILIES)):
        assert make(seed)[0] == FAMILIES[family].__name__
        assert judge(seed)[2] == "", seed
