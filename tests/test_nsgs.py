from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from conftest import one_contact

from contactopt import InterfaceProblem, Status, solve
from contactopt.methods.kernels import gauss_seidel
from contactopt.methods.kernels.gauss_seidel import Sweeps
from contactopt.methods.nsgs import NSGS, Local
from contactopt.problem import natural_map_residual
from contactopt.problem.laws.bilateral import Bilateral
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.laws.mixed import Mixed


def law_violation(W, v, mu, r, bilateral):
    """Largest violation of Coulomb's law, written out by cases, without the natural map."""
    u = W @ r + v
    slip, force = np.linalg.norm(u[1:]), np.linalg.norm(r[1:])
    bound = mu * abs(r[0])
    normal = abs(u[0]) if bilateral else max(-u[0], -r[0], min(abs(u[0]), abs(r[0])))
    opposed = np.linalg.norm(slip * r[1:] + bound * u[1:])  # r_t = -bound u_t / |u_t|
    return max(normal, force - bound, opposed)


@pytest.mark.parametrize("dim,bilateral,turned", [*product((2, 3), (False, True), (0.0, 0.5))])
def test_local_problems_obey_the_law(dim, bilateral, turned):
    """turned  size of the unsymmetric part of W."""
    rng = np.random.default_rng(dim)
    states = set()
    for trial in range(400):
        A = rng.normal(size=(dim, dim))
        W, v = A @ A.T + 0.05 * np.eye(dim) + turned * (A - A.T), rng.normal(size=dim)
        mu = 0.0 if trial % 10 == 0 else rng.uniform(0.05, 1.5)
        r = Local(W, mu, bilateral).solve(v.tolist())
        assert law_violation(W, v, mu, r, bilateral) < 1e-9 * (1 + np.linalg.norm(r)) ** 2
        states.add(
            "open" if not r.any() else "slip" if np.linalg.norm((W @ r + v)[1:]) > 1e-9 else "stick"
        )
    assert states >= {"slip", "stick"} and ("open" in states) != bilateral


@pytest.mark.parametrize("push", [0.0, 10.0])
@pytest.mark.parametrize("mu", [5e-324, 1e-310, 1e-300])
def test_friction_too_small_for_a_quotient_is_none(mu, push):
    """Also in compiled sweeps, in which such a contact once became nan."""
    problem = InterfaceProblem(np.eye(3), [[-0.5, push, 1.0]], mu)
    assert np.abs(Local(np.eye(3), mu, False).solve([-0.5, push, 1.0]) - [0.5, 0, 0]).max() < 1e-16
    for method in (NSGS(), None):
        assert np.abs(solve(problem, method).reactions - [0.5, 0, 0]).max() < 1e-16


def test_a_contact_without_compliance_carries_nothing():
    assert not Local(np.zeros((3, 3)), 0.5, False).solve([-1.0, 0.0, 0.0]).any()


@pytest.mark.parametrize("force,expected", [((-10.0, 1.0), (6.4, -6.4)), ((0.8, 1.0), (0.0, 0.0))])
def test_one_contact_takes_one_sweep(force, expected):
    solution = solve(one_contact(force, 1.0), NSGS())
    assert solution.iterations == 1 and solution.solved
    assert solution.reactions[0] == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("relaxation", [0.7, 1.4])
def test_relaxation_changes_the_way_not_the_answer(relaxation, punch):
    plain, relaxed = (
        solve(punch, NSGS(w), tol=1e-10, max_iterations=2000) for w in (1.0, relaxation)
    )
    assert relaxed.solved and relaxed.iterations != plain.iterations
    assert np.allclose(relaxed.reactions, plain.reactions, atol=1e-7 * plain.reactions.max())


def test_every_iterate_obeys_the_bounds(cube):
    for sweeps in (1, 3, 10):
        r = solve(cube, NSGS(1.5), max_iterations=sweeps).reactions
        assert r[:, 0].min() >= 0
        assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= cube.mu * r[:, 0] * (1 + 1e-9) + 1e-12)


def test_redundant_contacts():
    """Three nodes on two modes: Q has rank 4 of 9, forces are not unique, the displacements are."""
    rng = np.random.default_rng(5)
    H = rng.normal(size=(9, 4))
    problem = InterfaceProblem(H @ H.T, -np.abs(rng.normal(size=(3, 3))), 0.4)
    reactions = [solve(problem, NSGS(w), tol=1e-9, max_iterations=5000) for w in (1.0, 0.6)]
    for a in reactions:
        assert a.solved and natural_map_residual(problem, a.reactions) < 1e-9
    u = [problem.displacements(a.reactions, a.multipliers) for a in reactions]
    assert np.allclose(u[0], u[1], atol=1e-6)


COMPILED = pytest.mark.skipif(
    gauss_seidel.sweeps is None, reason="the package was installed without a C compiler"
)


@COMPILED
@pytest.mark.parametrize("dim,sparse", [*product((2, 3), (False, True))])
@pytest.mark.parametrize("relaxation", [1.0, 1.4])
def test_compiled_sweeps_are_those_in_python(dim, sparse, relaxation, request):
    """On a loose, unsymmetric problem whose contacts open, stick, slip and are bilateral."""
    rng = np.random.default_rng(dim)
    k = 12
    B = rng.normal(size=(k * dim, k * dim // 2)) * (rng.random((k * dim, k * dim // 2)) < 0.3)
    Q = B @ B.T + 0.1 * np.diag(rng.random(k * dim))
    Q += 0.02 * np.triu(Q, 1)
    mu = np.where(np.arange(k) % 4 == 0, 0.0, rng.uniform(0.1, 1.2, k))
    held = np.arange(k) % 5 == 0
    members = np.flatnonzero(held), np.flatnonzero(~held)
    law = Mixed((Bilateral(mu[held]), Coulomb(mu[~held])), members)
    q = rng.normal(size=(k, dim)) - 0.5
    q[held, 0] = 3.0  # pulled apart
    problem = InterfaceProblem(sp.csr_array(Q) if sparse else Q, q, law=law)
    assert Sweeps.can(problem)
    fast = NSGS(relaxation).iterate(problem)
    fast_points = [next(fast)[0] for _ in range(6)]
    request.getfixturevalue("without_sweeps")
    slow = NSGS(relaxation).iterate(problem)
    for reached in fast_points:
        np.testing.assert_allclose(reached, next(slow)[0], rtol=0, atol=1e-11)
    assert (fast_points[-1][:, 0] == 0).any() and (fast_points[-1][:, 0] < 0).any()


def anderson(problem, memory, count):
    """Sweeps each of which starts from the combination of the last results whose changes would
    cancel best, by plain least squares.
    """
    sweep, x, results, changes = Sweeps(problem), np.zeros(problem.q.size), [], []
    for _ in range(count):
        r = x.reshape(problem.q.shape).copy()
        sweep(r, 1)
        results, changes = [*results, r.ravel()][-memory - 1 :], [*changes, r.ravel() - x]
        changes = changes[-memory - 1 :]
        x = r.ravel()
        if len(results) > 1:
            steps = [np.diff(np.array(parts), axis=0).T for parts in (changes, results)]
            x = x - steps[1] @ np.linalg.lstsq(steps[0], changes[-1], rcond=None)[0]
    return results[-1].reshape(problem.q.shape)


@COMPILED
@pytest.mark.parametrize("dim", [2, 3])
def test_accelerated_sweeps_are_those_of_anderson(dim):
    rng = np.random.default_rng(dim)
    k = 8
    B = rng.normal(size=(k * dim, k * dim))
    problem = InterfaceProblem(B @ B.T / k + np.eye(k * dim), rng.normal(size=(k, dim)) - 1, 0.4)
    for memory, count in ((3, 2), (3, 6), (3, 9), (12, 9)):
        r = np.zeros(problem.q.shape)
        _, done = Sweeps(problem, memory)(r, count)
        assert done == count
        np.testing.assert_allclose(r, anderson(problem, memory, count), rtol=0, atol=1e-9)


@COMPILED
def test_accelerated_sweeps_go_on_where_they_ended():
    from contactopt.benchmark.families.rigid_blocks import rigid_blocks

    problem = rigid_blocks(shape="stack", size=6)
    once, parts = np.zeros(problem.q.shape), np.zeros(problem.q.shape)
    Sweeps(problem, 8)(once, 20)
    sweeps = Sweeps(problem, 8)
    for count in (1, 7, 12):
        sweeps(parts, count)
    np.testing.assert_array_equal(once, parts)


@COMPILED
def test_sweeps_over_a_sparse_array_without_entries():
    problem = InterfaceProblem(sp.csr_array((40, 40)), -np.ones((20, 2)), 0.5)
    r = np.ones(problem.q.shape)
    assert Sweeps(problem, 4)(r, 5) == (0.0, 5)
    assert not r.any()


@COMPILED
def test_long_sweeps_keep_the_time_limit():
    from contactopt.benchmark.families.packings import packing

    problem = packing(3, 400, mu=0.6, points=2)  # 500 sweeps take four seconds
    found = solve(problem, time_limit=0.1)
    assert found.status is Status.TIME_LIMIT and found.iterations == 0
    assert sum(found.seconds.values()) < 2.5


@COMPILED
@pytest.mark.parametrize("heavier", [1.0, 1000.0])
def test_acceleration_saves_most_sweeps(heavier):
    """Of stacks, through which plain sweeps hand a change on by one block each."""
    from contactopt.benchmark.families.rigid_blocks import rigid_blocks

    problem = rigid_blocks(shape="stack", size=6, points=3, heavier=heavier)
    r = np.zeros(problem.q.shape)
    change, done = Sweeps(problem, 16)(r, 400, enough=1e-11)
    assert change <= 1e-11 and done < 200
    assert natural_map_residual(problem, r, np.zeros(0)) < 1e-8
    plain = np.zeros(problem.q.shape)
    Sweeps(problem)(plain, 10 * done)
    assert natural_map_residual(problem, plain, np.zeros(0)) > 1e-6


@pytest.mark.parametrize("name", ["cube", "chain"])
def test_the_default_method_needs_no_compiler(name, cube, request):
    from contactopt.benchmark.families.rigid_blocks import rigid_blocks

    problem = cube if name == "cube" else rigid_blocks(shape="chain", size=4, mu=0.7, tilt=0.1)
    fast = solve(problem)
    request.getfixturevalue("without_sweeps")
    slow = solve(problem)
    assert fast.solved and slow.solved
    Q = problem.Q.toarray() if sp.issparse(problem.Q) else problem.Q
    gap = (Q @ (fast.reactions - slow.reactions).ravel()).ravel()  # forces may not be unique
    assert np.abs(gap).max() <= 1e-6 * np.abs(problem.q).max()
