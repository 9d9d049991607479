import time
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from conftest import one_contact

from contactopt import (
    InputError,
    InterfaceProblem,
    Status,
    natural_map_residual,
    reduce,
    scenes,
    solve,
)
from contactopt.benchmark.families.packings import rigid_bodies
from contactopt.linear.deadline import check_time
from contactopt.linear.operators import InterfaceOperator
from contactopt.methods import METHODS


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


@dataclass(frozen=True)
class Far:
    """A method whose multipliers lie beyond all digits, of a motion that moves no contact."""

    def iterate(self, problem, start=None):
        yield np.array([[1 / FORCE, 0.0]]), np.array([1e16])


def test_an_iterate_that_is_not_kept_is_not_solved():
    """Its certificate was that of the answer, which was without forces."""
    solution = solve(replace(PROBLEM, V=np.zeros((2, 1)), s=np.zeros(1)), Far())
    assert not solution.solved and solution.residual == np.inf


@pytest.mark.parametrize("s", [1e-16, -1e-17])
def test_rounding_in_the_balance_is_no_unit_of_force(s):
    """Without forces it was solved, with the certificate inf."""
    A, V = np.random.default_rng(1).normal(size=(8, 8)), np.zeros((4, 2, 1))
    V[:, 0, 0] = 1, 1, -1, -1
    q = np.array([[-1.0, 0.0], [-0.8, 0.0], [-1.1, 0.0], [-0.9, 0.0]])
    problem = InterfaceProblem(A @ A.T + 4 * np.eye(8), q, 0.3, V.reshape(-1, 1), [s])
    found, exact = solve(problem), solve(replace(problem, s=np.zeros(1)))
    assert found.solved and natural_map_residual(problem, found.reactions) < 1e-8
    assert np.allclose(found.reactions, exact.reactions, rtol=1e-8) and np.all(
        exact.reactions[:, 0]
    )


def test_solved_is_the_certificates_word():
    solution = solve(PROBLEM, Scripted(((1 / FORCE, 0.0),)))
    assert solution.status is Status.SOLVED and solution.reactions[0] == pytest.approx([1, 0])
    assert solution.residual == natural_map_residual(PROBLEM, solution.reactions) < 1e-14


def test_without_an_iterate_the_start_is_the_answer_and_the_certificate_judges_it():
    solution = solve(PROBLEM)
    kept = solve(PROBLEM, Scripted(()), start=solution)
    assert kept.solved and kept.iterations == 0
    np.testing.assert_allclose(kept.reactions, solution.reactions, rtol=1e-15)
    wrong = solve(PROBLEM, Scripted(()), start=replace(solution, reactions=2 * solution.reactions))
    assert wrong.status is Status.SETTLED
    np.testing.assert_allclose(wrong.reactions, 2 * solution.reactions, rtol=1e-15)


def test_limits_are_kept_and_the_last_iterate_survives():
    solution = solve(PROBLEM, Scripted(WRONG), max_iterations=7)
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == len(solution.history) == 7
    assert solution.reactions[0, 0] == pytest.approx(WRONG[6][0] * FORCE)
    slow = solve(PROBLEM, Scripted(WRONG, pause=0.02), time_limit=0.05)
    assert slow.status is Status.TIME_LIMIT and slow.iterations < 10


@dataclass(frozen=True)
class Endless:
    """A method whose first outer iteration never ends by itself."""

    def iterate(self, problem, start=None):
        while problem.contacts:
            check_time()
        yield


def test_the_time_limit_ends_inner_iterations():
    solution = solve(PROBLEM, Endless(), time_limit=0.1)
    assert solution.status is Status.TIME_LIMIT and solution.iterations == 0
    assert solution.seconds["solve"] > 0.05


@pytest.mark.parametrize("method", ["apg", "lagrangian"])
def test_a_load_that_nothing_balances_does_not_outlast_the_time_limit(method):
    """Contact pushes upwards only, and the second plate is drawn along the contacts, which carry no
    friction.
    """
    rng = np.random.default_rng(3)
    problem = InterfaceProblem(
        np.eye(6), rng.normal(size=(2, 3)), 1e-3, rng.normal(size=(6, 3)), [1.0, -1.0, 1.0]
    )
    begin = time.process_time()  # the clock depends on what else runs on the machine
    assert not solve(problem, method, time_limit=0.5, max_iterations=10**9).solved
    assert time.process_time() - begin < 5.0


def test_a_method_that_repeats_itself_is_stopped():
    assert solve(PROBLEM, Scripted(((0.5, 0.0),) * 9)).status is Status.STALLED
    assert (
        solve(PROBLEM, Scripted(((0.5, 0.0), (0.6, 0.0), (0.7, 0.0)) * 9)).status is Status.CYCLING
    )
    assert solve(PROBLEM, Scripted(WRONG[:3])).status is Status.SETTLED  # ended by itself


def test_the_papers_criterion_is_recorded_and_can_stop_but_not_certify():
    exact = solve(one_contact((-10.0, 1.0), 0.6), "alternating", max_iterations=2000)
    loose = solve(
        one_contact((-10.0, 1.0), 0.6), "alternating", change_tol=1e-5, max_iterations=2000
    )
    assert exact.solved and loose.status is Status.SETTLED
    assert loose.iterations < exact.iterations
    assert loose.history[-1]["change"] <= 1e-5 < loose.history[-2]["change"]
    assert all({"residual", "change", "seconds"} <= set(h) for h in loose.history)


@pytest.mark.parametrize(
    "bad", [dict(tol=0), dict(tol=np.nan), dict(max_iterations=0), dict(change_tol=-1.0)]
)
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
    solve(
        PROBLEM,
        Scripted(WRONG),
        max_iterations=3,
        progress=lambda i, residual: seen.append((i, residual)),
    )
    assert [i for i, _ in seen] == [1, 2, 3] and all(residual > 0 for _, residual in seen)


@pytest.mark.parametrize("method", sorted(METHODS))
@pytest.mark.parametrize("dim", [2, 3])
def test_no_contacts_need_no_forces(dim, method):
    solution = solve(InterfaceProblem(np.zeros((0, 0)), np.zeros((0, dim)), 0.3), method)
    assert solution.solved and solution.reactions.shape == (0, dim)


def test_no_contacts_cannot_balance_a_load():
    pressed = InterfaceProblem(np.zeros((0, 0)), np.zeros((0, 2)), 0.3, np.zeros((0, 1)), [-1.0])
    solution = solve(pressed)
    assert solution.status is Status.SETTLED and "no contact" in solution.message


SOLVED = solve(PROBLEM)


@pytest.mark.parametrize(
    "bad,message",
    [
        (dict(method=3), "method must be a name or an object"),
        (dict(time_limit=np.nan), "time_limit must be"),
        (dict(time_limit=-1.0), "time_limit must be"),
        (dict(time_limit="long"), "time_limit must be"),
        (dict(start=np.zeros((1, 2))), "start must be a Solution"),
        (dict(start=replace(SOLVED, reactions=np.array([[np.nan, 0.0]]))), "not finite"),
        (dict(start=replace(SOLVED, reactions=np.array([[np.inf, 0.0]]))), "not finite"),
        (dict(start=replace(SOLVED, reactions="all")), "array of numbers"),
    ],
)
def test_arguments_of_the_wrong_kind(bad, message):
    with pytest.raises(InputError, match=message):
        solve(PROBLEM, **bad)


def test_a_tolerance_below_rounding_ends_without_an_exception():
    rng = np.random.default_rng(0)
    for _ in range(100):
        k, dim = rng.integers(1, 8), rng.integers(2, 4)
        A = rng.normal(size=(k * dim, k * dim))
        problem = InterfaceProblem(A @ A.T, rng.normal(size=(k, dim)), rng.uniform(0, 1))
        assert isinstance(solve(problem, tol=1e-16, max_iterations=40).status, Status)


def test_fallbacks_are_told(caplog):
    """Contacts at random places have no grid for a preconditioner."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(36, 36))
    problem = InterfaceProblem(
        A @ A.T / 36 + np.eye(36),
        rng.normal(size=(12, 3)) - 0.5,
        0.3,
        coordinates=rng.random((3, 12)),
    )
    assert solve(problem).notes == ()
    with caplog.at_level("INFO"):
        solution = solve(problem, "newton", linear="krylov")
    assert solution.solved
    assert any("no preconditioner fits" in sentence for sentence in solution.notes)
    assert "no preconditioner fits" in caplog.text
    assert solve(problem).notes == ()  # the notes of one solve are its own


def test_the_default_says_when_it_changes_its_method(without_sweeps):
    """Rigid bodies that share forces among too many contacts: Newton's first steps get nowhere."""
    solution = solve(rigid_bodies(bodies=4, contacts=12, mu=0.8, seed=0))
    assert solution.solved
    assert any("the proximal loop take over" in sentence for sentence in solution.notes)


def test_seconds_are_those_of_the_method_and_of_the_certificate(punch):
    solution = solve(punch)
    assert set(solution.seconds) == {"solve", "certificate", "checks"}
    assert min(solution.seconds.values()) > 0
    assert solution.seconds["solve"] == solution.history[-1]["seconds"]


def test_a_q_that_does_not_fit_into_memory_is_not_formed():
    n = 40_000
    Q = InterfaceOperator(lambda X, accuracy: X, np.ones(n))
    problem = InterfaceProblem(Q, np.full((n // 2, 2), -1.0), 0.3)
    with pytest.raises(
        InputError, match="would take 12,800,000,000 bytes, more than 8,000,000,000"
    ):
        solve(problem, "nsgs")
    solution = solve(problem)
    assert solution.solved and np.allclose(solution.reactions[:, 0], 1.0)


def test_the_default_method_gives_the_best_point_that_it_met():
    """Beyond rounding no digit can be gained, and looking for one loses those that are there."""
    problem = reduce(scenes.flat_punch(2, elements=8, mu=0.3))
    found = solve(problem, tol=1e-30, time_limit=10)
    assert not found.solved
    assert found.residual == min(row["residual"] for row in found.history) < 1e-13
    assert natural_map_residual(problem, found.reactions, found.multipliers) == found.residual
    assert max(row["residual"] for row in found.history[-5:]) > found.residual


@cache
def problems_of_the_clock() -> dict[str, InterfaceProblem]:
    """A problem of each end: solved by Newton's steps, late, without a solution, not decided."""
    rng = np.random.default_rng(2)
    B, q = rng.normal(size=(30, 10)), rng.normal(size=(10, 3))
    q[:, 0] -= 2.0
    A = rng.normal(size=(16, 8))
    squeezed = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(2))
    return {
        "punch": reduce(scenes.flat_punch(2, elements=6, mu=0.3)),
        "redundant in space": InterfaceProblem(B @ B.T, q, rng.uniform(0.2, 1.0, 10)),
        "redundant in the plane": InterfaceProblem(A @ A.T, q[:8, :2], 0.5),
        "squeezed": InterfaceProblem(squeezed, [[-1.0, 0.0], [-1.0, 0.0]], 0.3),
    }


@pytest.mark.parametrize("method", ["auto", "nsgs", "proximal", "tresca"])
@pytest.mark.parametrize("name", problems_of_the_clock())
def test_steps_do_not_depend_on_the_clock(name, method, monkeypatch):
    """A clock that runs a thousand times faster or slower."""
    problem, runs, first = problems_of_the_clock()[name], [], []
    clocks = {each: getattr(time, each) for each in ("perf_counter", "monotonic", "process_time")}
    for speed in (1.0, 1e3, 1e-3):
        for each, clock in clocks.items():
            monkeypatch.setattr(time, each, lambda clock=clock, speed=speed: speed * clock())
        solution = solve(problem, method, max_iterations=60)
        steps = [row["residual"] for row in solution.history]
        runs.append((solution.status, len(steps), solution.notes))
        first = steps if len(runs) == 1 else first
        assert steps[:20] == pytest.approx(first[:20], rel=1e-4, abs=1e-11)
    assert runs[0] == runs[1] == runs[2]
