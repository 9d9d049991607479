"""Small problems by compiled sweeps, against the same formulas in Python."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from contactopt import InputError, InterfaceProblem, natural_map_residual, solve
from contactopt.methods.kernels import gauss_seidel
from contactopt.methods.small import arrays_of, certified, solve_small
from contactopt.problem.laws.bilateral import Bilateral

pytestmark = pytest.mark.skipif(
    gauss_seidel.compiled("solved") is None, reason="installed without a compiler"
)


def any_problem(seed: int) -> InterfaceProblem:
    """1 to 11 contacts in any units; some Q are singular, some components cannot move."""
    rng = np.random.default_rng(seed)
    dim, k = int(rng.integers(2, 4)), int(rng.integers(1, 12))
    n = k * dim
    A = rng.normal(size=(n, n))
    A = A[:, : max(1, n // 2)] if seed % 5 == 0 else A
    Q = A @ A.T * 10.0 ** rng.uniform(-9, 9)
    q = rng.normal(size=(k, dim)) * 10.0 ** rng.uniform(-9, 9)
    if seed % 3 == 0:
        q[:, 0] -= 3 * np.abs(q).max()
    if seed % 7 == 0:
        held = int(rng.integers(0, n))
        Q[held] = Q[:, held] = q.ravel()[held] = 0.0
    Q = sp.csr_array(Q) if seed % 2 else Q
    return InterfaceProblem(Q, q, mu=rng.choice([0.0, 0.2, 0.8, 2.0], size=k))


def test_nearly_all_are_solved_at_once():
    """The certificate is that of the given data, in their units, as Python computes it."""
    solved = 0
    for seed in range(400):
        problem = any_problem(seed)
        solution, _ = solve_small(problem, 1e-8)
        if solution is not None:
            expected = natural_map_residual(problem, solution.reactions, np.zeros(0))
            assert np.isclose(solution.residual, expected, rtol=1e-9, atol=1e-12), seed
            assert expected <= 1.1e-8, seed
            solved += 1
    assert solved > 300


@pytest.mark.parametrize("kind", ["near", "none", "any", "huge", "one not finite"])
def test_compiled_certificates_are_those_of_python(kind):
    """The same number for any forces, where Q has full rank, so that Q r does not cancel."""
    for seed in (s for s in range(300) if s % 5):
        problem, rng = any_problem(seed), np.random.default_rng(seed)
        given = arrays_of(problem)
        *_, solved = certified(given, 500, 0.0)
        noise = rng.normal(size=solved.shape)
        r = {
            "near": solved * (1 + 10.0 ** rng.uniform(-12, 0) * noise),
            "none": 0 * noise,
            "any": np.abs(solved).max() * 10.0 ** rng.uniform(-6, 6) * noise,
            "huge": 1e200 * noise,
            "one not finite": np.where(np.arange(noise.size) == seed % noise.size, np.inf,
                                       noise.ravel()).reshape(noise.shape),
        }[kind]  # fmt: skip
        compiled = certified(given, 0, 0.0, r)[0]
        python = natural_map_residual(problem, r, np.zeros(0))
        assert compiled == python or abs(compiled - python) <= 1e-12 * max(python, 1), seed


def test_in_the_plane_few_sweeps_find_the_states_and_elimination_the_last_digits():
    """The forces of Lemke's method, which is another one. Sweeps alone need 12 to 17 for them."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        A, q = rng.normal(size=(40, 40)), rng.normal(size=(20, 2)) - [0.5, 0.0]
        problem = InterfaceProblem(A @ A.T / 40 + np.eye(40), q, 0.2 + 0.6 * rng.random(20))
        expected = solve(problem, "lemke").reactions
        for Q in (problem.Q, sp.csr_array(problem.Q)):
            sweeps, r = gauss_seidel.Sweeps(problem.altered(Q=Q), 16), np.zeros((20, 2))
            change, count = sweeps(r, 500, enough=1e-13)
            assert change <= 1e-13 and count <= 8, seed
            assert np.allclose(r, expected, rtol=0, atol=1e-12 * np.abs(expected).max()), seed


def test_a_problem_without_a_solution_is_not_solved():
    squeezed = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(2))
    problem = InterfaceProblem(squeezed, [[-1.0, 0.0], [-1.0, 0.0]], 0.3)
    assert solve_small(problem, 1e-8)[0] is None
    assert solve(problem).status.label == "infeasible"
    # a loose tolerance takes a point that all sweeps would leave
    loose = solve(any_problem(4), tol=1e-2)
    assert loose.solved and loose.residual <= 1e-2


def test_answers_are_those_of_python(monkeypatch):
    """The same forces as by the scaled problem, its sweeps and the driver."""
    problems = [any_problem(seed) for seed in range(30)]
    quick = [solve(problem) for problem in problems]
    monkeypatch.setattr("contactopt.methods.driver.solve_small", lambda *given: (None, None))
    for problem, fast in zip(problems, quick):
        slow = solve(problem)
        assert fast.solved == slow.solved and fast.notes == slow.notes
        Q = problem.explicit().Q
        if slow.solved and np.linalg.cond(Q) < 1e8:
            scale = np.abs(slow.reactions).max()
            assert np.allclose(fast.reactions, slow.reactions, rtol=0, atol=1e-10 * scale)


def test_without_a_compiler_nothing_changes(without_sweeps):
    problem = any_problem(6)
    assert solve_small(problem, 1e-8) == (None, None)
    assert solve(problem).solved


def test_what_the_compiled_call_does_not_take():
    """Plates, other laws and large problems go the usual way, and bad input is refused as ever."""
    plate = InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.5, [[1.0], [0.0]], [-1.0])
    glued = InterfaceProblem(np.eye(2), [[-1.0, 0.2]], Bilateral(0.5))
    large = InterfaceProblem(sp.eye_array(2 * 60_000), -np.ones((60_000, 2)), 0.5)
    for problem in (plate, glued, large):
        assert solve_small(problem, 1e-8) == (None, None)
        assert solve(problem).solved
    with pytest.raises(InputError, match="apart"):
        solve(InterfaceProblem(np.eye(2), np.zeros((1, 2)), 0.5, [[1.0], [0.0]], [1.0]))


def test_sweeps_that_fail_are_not_made_again(monkeypatch):
    """The first sweeps of a problem that resists them are made once."""
    rng = np.random.default_rng(3)
    B, q = rng.normal(size=(40, 12)), rng.normal(size=(20, 2))
    problem = InterfaceProblem(B @ B.T, q - [2.0, 0.0], 0.5)
    solution, swept = solve_small(problem, 1e-8)
    assert solution is None and swept is not None
    counts = []
    original = gauss_seidel.Sweeps.__call__

    def counted(self, r, count, **given):
        change, done = original(self, r, count, **given)
        counts.append(done)
        return change, done

    monkeypatch.setattr(gauss_seidel.Sweeps, "__call__", counted)
    solve(problem, max_iterations=60)
    assert sum(counts) <= 1000


@pytest.mark.parametrize("cold", [1.0, 1e-3, 0.0])
def test_from_a_given_start_the_same_call_is_made_and_no_start_is_taken_that_does_not_fit(cold):
    """An answer of the problem under 5 % more load: the call ends in fewer sweeps or as many."""
    for seed in (s for s in range(40) if s % 5):
        problem = any_problem(seed)
        more = problem.altered(q=1.05 * problem.q)
        if (first := solve_small(problem, 1e-8)[0]) is None:
            continue
        start = replace(first, reactions=cold * first.reactions)
        warm, _ = solve_small(more, 1e-8, start)
        if warm is None:
            continue
        assert natural_map_residual(more, warm.reactions, np.zeros(0)) <= 1.1e-8, seed
        assert np.array_equal(start.reactions, cold * first.reactions)
        again = solve(more, start=start)
        assert np.array_equal(again.reactions, warm.reactions), seed
    with pytest.raises(InputError, match="start has reactions"):
        solve(any_problem(3), start=replace(first, reactions=np.zeros((99, 2))))
