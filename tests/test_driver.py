import time
from dataclasses import dataclass

import numpy as np
import pytest
from conftest import one_contact

from contactopt import InputError, InterfaceProblem, Status, natural_map_residual, solve


@dataclass(frozen=True)
class Scripted:
    """A method that yields what it is told."""

    iterates: tuple
    pause: float = 0.0

    def iterate(self, problem, start=None):
        for r in self.iterates:
            time.sleep(self.pause)
            yield np.array([r]), np.zeros(0)


PROBLEM = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.5)  # solved by r = (1, 0)
WRONG = [(0.5 + 0.01 * i, 0.0) for i in range(50)]
FORCE = 1.0  # the unit of force of the dimensionless problem


def test_solved_is_the_certificates_word():
    solution = solve(PROBLEM, Scripted(((1 / FORCE, 0.0),)))
    assert solution.status is Status.SOLVED and solution.reactions[0] == pytest.approx([1, 0])
    assert solution.residual == natural_map_residual(PROBLEM, solution.reactions) < 1e-14


def test_limits_are_kept_and_the_last_iterate_survives():
    solution = solve(PROBLEM, Scripted(WRONG), max_iterations=7)
    assert solution.status is Status.ITERATION_LIMIT and solution.iterations == len(solution.history) == 7
    assert solution.reactions[0, 0] == pytest.approx(WRONG[6][0] * FORCE)
    slow = solve(PROBLEM, Scripted(WRONG, pause=0.02), time_limit=0.05)
    assert slow.status is Status.TIME_LIMIT and slow.iterations < 10


def test_a_method_that_repeats_itself_is_stopped():
    assert solve(PROBLEM, Scripted(((0.5, 0.0),) * 9)).status is Status.STALLED
    assert solve(PROBLEM, Scripted(((0.5, 0.0), (0.6, 0.0), (0.7, 0.0)) * 9)).status is Status.CYCLING
    assert solve(PROBLEM, Scripted(WRONG[:3])).status is Status.SETTLED  # ended by itself


def test_the_papers_criterion_is_recorded_and_can_stop_but_not_certify():
    exact = solve(one_contact((-10.0, 1.0), 0.6), "alternating", max_iterations=2000)
    loose = solve(one_contact((-10.0, 1.0), 0.6), "alternating", change_tol=1e-5, max_iterations=2000)
    assert exact.solved and loose.status is Status.SETTLED
    assert loose.iterations < exact.iterations
    assert loose.history[-1]["change"] <= 1e-5 < loose.history[-2]["change"]
    assert all({"residual", "change", "seconds"} <= set(h) for h in loose.history)


def test_pulling_bodies_apart_is_refused(punch):
    pulled = InterfaceProblem(punch.Q, punch.q, punch.mu, punch.V, -punch.s)
    with pytest.raises(InputError, match="pulls the bodies apart"):
        solve(pulled)


def test_unloaded_and_open_contacts():
    at_rest = solve(InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.3))
    apart = solve(InterfaceProblem(np.eye(2), [[1.0, 0.4]], 0.3))
    assert at_rest.solved and apart.solved
    assert not np.any(at_rest.reactions) and not np.any(apart.reactions)


@pytest.mark.parametrize("bad", [dict(tol=0), dict(tol=np.nan), dict(max_iterations=0), dict(change_tol=-1.0)])
def test_bad_arguments(bad):
    with pytest.raises(InputError, match="must be a finite number"):
        solve(PROBLEM, **bad)


def test_unknown_methods_and_settings():
    with pytest.raises(InputError, match="unknown method 'magic'; choose from auto"):
        solve(PROBLEM, "magic")
    with pytest.raises(InputError, match="penalty"):
        solve(PROBLEM, "alternating", penalty=1e6)
    with pytest.raises(InputError, match="given by name"):
        solve(PROBLEM, Scripted(()), penalty=1e6)


def test_progress_is_reported():
    seen = []
    solve(PROBLEM, Scripted(WRONG), max_iterations=3, progress=lambda i, residual: seen.append((i, residual)))
    assert [i for i, _ in seen] == [1, 2, 3] and all(residual > 0 for _, residual in seen)
