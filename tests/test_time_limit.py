"""A time limit is kept by every method, inside its backend too."""

import os
import signal
import time
from contextlib import suppress

import numpy as np
import pytest

from contactopt import InputError, InterfaceProblem, solve
from contactopt.benchmark.families.packings import packing
from contactopt.errors import BackendError
from contactopt.linear.deadline import TimeUp, until
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP, child
from contactopt.methods.backends.qp import BoxQP

LIMIT, SLACK = 0.1, 1.0


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
    return InterfaceProblem(
        Q, np.tile([1e-3] + [0.0] * (dim - 1), (3, 1)), 3.0, V.reshape(3 * dim, 2), [-1.0, 2.9]
    )


def stack(dim):
    problem = packing(dim, 49 if dim == 2 else 27, mu=0.9, points=2)
    return InterfaceProblem(problem.Q.toarray(), problem.q, problem.mu)


CASES = {
    f"{make.__name__} {dim}D": (make, dim)
    for make in (no_solution, held, plate, stack)
    for dim in (2, 3)
}


@pytest.fixture(scope="module", autouse=True)
def imported():
    """The first use of a modelling language costs seconds that no limit can cut."""
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


@pytest.mark.parametrize(
    "backend", [b for b in QP if QP[b].installed and not QP[b].clock and not QP[b].steps]
)
def test_programs_that_no_backend_can_interrupt_end_in_time(backend, monkeypatch):
    """The same answer of a process of its own with time enough, and no hang without."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(401, 401))
    P, c, none = A @ A.T / 401 + 1e-2 * np.eye(401), rng.normal(size=401), np.zeros(0)
    program = BoxQP.using(backend, P, np.zeros((0, 401)))
    arguments = c, none, np.zeros(401), np.full(401, np.inf)
    with until(time.perf_counter() + 60):
        x, _ = program.solve(*arguments)
    gradient = P @ x + c
    assert np.abs(np.minimum(x, gradient)).max() < 1e-5 and x.max() > 0.1
    process = program.child.process
    begin = time.perf_counter()
    os.kill(process.pid, signal.SIGSTOP)  # as if the program took for ever
    with pytest.raises(TimeUp), until(time.perf_counter() + 0.2):
        program.solve(*arguments)
    assert process.poll() is not None and time.perf_counter() - begin < 30
    # as gmsh leaves it: a broken pipe would end this process
    before = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        with pytest.raises(BackendError, match="exit code"), until(time.perf_counter() + 60):
            monkeypatch.setattr(child, "SERVE", "raise SystemExit(3)")
            program.solve(*arguments)
    finally:
        signal.signal(signal.SIGPIPE, before)
    with until(time.perf_counter() + 60):
        monkeypatch.undo()
        program.solve(*arguments)
        process = program.child.process
    del program
    assert process.wait(10) is not None  # it ends with what it was started for
