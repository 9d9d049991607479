"""A time limit is kept by every method, inside its backend too, on problems that no method finds easy."""

import time
from contextlib import suppress

import numpy as np
import pytest

from contactopt import InputError, InterfaceProblem, solve
from contactopt.solving.backends import CONIC, QP
from contactopt.solving.methods import METHODS
from experiments.questions.granular import packing

LIMIT, SLACK = 0.5, 1.0


def no_solution(dim):
    e = np.zeros(dim)
    e[0] = 1.0
    return InterfaceProblem(np.kron([[1.0, -1], [-1, 1]], np.eye(dim)), [-e, -e], 0.3)


def held(dim):
    return InterfaceProblem(np.zeros((dim * 2, dim * 2)), [[-1.0] + [0.5] * (dim - 1)] * 2, 0.5)


def plate(dim):
    V = np.zeros((3, dim, 2))
    V[:, 0, 0] = V[:, 1, 1] = 1.0
    Q = np.ones((3 * dim, 3 * dim)) + 1e-9 * np.eye(3 * dim)
    return InterfaceProblem(Q, np.tile([1e-3] + [0.0] * (dim - 1), (3, 1)), 3.0, V.reshape(3 * dim, 2), [-1.0, 2.9])


def stack(dim):
    problem = packing(dim, 49 if dim == 2 else 27, mu=0.9, points=2)
    return InterfaceProblem(problem.Q.toarray(), problem.q, problem.mu)


CASES = {f"{make.__name__} {dim}D": (make, dim) for make in (no_solution, held, plate, stack) for dim in (2, 3)}


@pytest.fixture(scope="module", autouse=True)
def imported():
    """The first use of a modelling language costs seconds that no limit can cut."""
    pytest.importorskip("cvxpy")
    solve(no_solution(3), "tresca", max_iterations=1)


def seconds_of(problem, method, **settings):
    """Seconds of the processor: those of the clock depend on what else runs on the machine."""
    begin = time.process_time()
    with suppress(InputError):
        solve(problem, method, tol=1e-13, max_iterations=10**6, time_limit=LIMIT, **settings)
    return time.process_time() - begin


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", CASES)
def test_no_method_outlasts_its_limit(case, method):
    make, dim = CASES[case]
    assert seconds_of(make(dim), method) < LIMIT + SLACK


@pytest.mark.parametrize("backend", [b for b in QP if QP[b].installed])
@pytest.mark.parametrize("case", [case for case in CASES if case.endswith("2D")])
def test_no_quadratic_program_outlasts_it(case, backend):
    make, dim = CASES[case]
    problem = make(dim)
    assert seconds_of(problem, "tresca", backend=backend) < LIMIT + SLACK
    assert seconds_of(problem, "alternating", normal=backend, tangential=backend) < LIMIT + SLACK


@pytest.mark.parametrize("backend", [b for b in CONIC if CONIC[b].installed])
@pytest.mark.parametrize("case", [case for case in CASES if case.endswith("3D")])
def test_no_cone_program_outlasts_it(case, backend):
    make, dim = CASES[case]
    assert seconds_of(make(dim), "tresca", backend=backend) < LIMIT + SLACK
