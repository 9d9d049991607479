"""A way to a solution that costs more than expected is left, and what it reached is not lost."""

import numpy as np
import pytest

from contactopt import scenes
from contactopt.coupling import reduction
from contactopt.linear.budget import Budget, NextBest
from contactopt.methods import driver
from contactopt.solving.solve_scene import solve_scene

COUPLED, DENSE = ("coupled", "multigrid"), ("dense", "superlu")


@pytest.fixture
def limited(monkeypatch):
    """Solves a scene by multigrid, with another way after so much work; the work of each check."""
    work, check = [], Budget.check
    monkeypatch.setattr(Budget, "check", lambda own, now: (work.append(now), check(own, now))[1])

    def solved(most):
        costs = {COUPLED: 1.0, DENSE: 2.0}
        ways = lambda works, unknowns, dim, solvers, Q, once: (  # noqa: E731
            costs if Q == "auto" else {DENSE: 2.0}
        )
        monkeypatch.setattr(reduction, "estimates", ways)
        other = NextBest("coupled", "explicit", "superlu", 0.0, most, None)
        monkeypatch.setattr(
            reduction, "next_best", lambda own, *_: other if COUPLED in own else None
        )
        work.clear()
        return solve_scene(scenes.flat_punch(3, elements=6))

    return solved, work


def test_the_next_way_starts_from_what_was_reached(limited, monkeypatch):
    """A run of minutes was left at a certificate of 1.8e-7, and began anew without it."""
    solved, work = limited
    whole = solved(np.inf)
    assert whole.turned is None
    monkeypatch.setattr(driver, "NEAR", 0.0)
    left = solved(work[-1] * (1 - 1e-9))
    assert left.turned.left == "coupled" and left.solution.solved
    assert left.solution.history[0]["residual"] < 1e-4
    apart = np.abs(left.solution.reactions - whole.solution.reactions).max()
    assert apart < 1e-6 * np.abs(whole.solution.reactions).max()


def test_a_way_that_is_close_to_its_end_comes_there(limited):
    solved, work = limited
    whole = solved(np.inf)
    again = solved(work[-1] * (1 - 1e-9))
    assert again.turned is None
    assert again.solution.reactions == pytest.approx(whole.solution.reactions)
