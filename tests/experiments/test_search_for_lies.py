"""No answer of random problems is called solved and is wrong, by a check that can fail."""

import numpy as np
import pytest

from contactopt import InterfaceProblem, natural_map_residual, solve
from contactopt.benchmark.families.packings import packing
from contactopt.linear.operators import dense
from experiments.questions.coulomb_check import violations
from experiments.questions.search_for_lies import FAMILIES, judge, make


def worst(problem, reactions, multipliers=()):
    data = dense(problem.Q), problem.q, problem.mu, problem.V, problem.s
    return max(violations(*data, np.asarray(reactions), multipliers).values())


@pytest.mark.parametrize("family", range(len(FAMILIES)), ids=lambda i: FAMILIES[i].__name__)
def test_no_lie_among_random_problems(family):
    for seed in range(99_000 + family, 99_000 + family + 12 * len(FAMILIES), len(FAMILIES)):
        assert make(seed)[0] == FAMILIES[family].__name__
        assert judge(seed)[2] == "", seed


def test_the_independent_check_can_fail():
    problem = InterfaceProblem(np.eye(2), [[-1.0, 0.4]], 0.3)
    good = solve(problem, tol=1e-12)
    assert worst(problem, good.reactions, good.multipliers) < 1e-10
    for r in ([[0.9, -0.27]], [[1.0, -0.2]], [[1.0, 0.3]], [[1.0, -0.4]]):
        assert worst(problem, r) > 1e-2 and natural_map_residual(problem, r) > 1e-2


@pytest.mark.parametrize("method", ["auto", "newton", "proximal", "nsgs", "admm", "apg"])
def test_methods_solve_a_packing_and_keep_it_sparse(method, monkeypatch):
    problem = packing(2, 16, mu=0.3)
    monkeypatch.setattr(
        InterfaceProblem, "explicit", lambda self: pytest.fail("Q was formed as an array")
    )
    solution = solve(problem, method, tol=1e-6, max_iterations=20_000, time_limit=20)
    assert solution.solved and worst(problem, solution.reactions, solution.multipliers) < 2e-5
