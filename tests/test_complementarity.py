import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

from contactopt import InputError, InterfaceProblem, natural_map_residual, reduce, scenes, solve
from contactopt.methods.complementarity import Lemke, complementarity_problem, lemke
from contactopt.methods.enumeration import all_solutions
from contactopt.methods.kernels.states import StateTree
from contactopt.problem import Status, dimensionless
from contactopt.problem.laws.bilateral import Bilateral


def random_problem(
    seed: int, mu: float, plate: bool = False, contacts: int = 3
) -> InterfaceProblem:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(2 * contacts, 4 * contacts))
    V = np.zeros((2 * contacts, int(plate)))
    V[::2] = 1.0
    return InterfaceProblem(
        A @ A.T, rng.normal(size=(contacts, 2)) * 9, mu, V, -np.ones(int(plate))
    )


def by_brute_force(problem: InterfaceProblem) -> list[np.ndarray]:
    """Reactions of all solutions: the linear system of each of the 4^k combinations of open, stick,
    slip.
    """
    k, p = problem.contacts, len(problem.s)
    found: list[np.ndarray] = []
    for states in itertools.product(("open", "stick", 1, -1), repeat=k):
        A, b = np.hstack([problem.Q, problem.V]), -problem.q.ravel()
        for i, state in enumerate(states):
            if state == "open":
                A[2 * i : 2 * i + 2] = np.eye(2 * k + p)[2 * i : 2 * i + 2]
                b[2 * i : 2 * i + 2] = 0.0
            elif state != "stick":
                A[2 * i + 1] = np.eye(2 * k + p)[2 * i + 1]
                A[2 * i + 1, 2 * i], b[2 * i + 1] = state * problem.mu[i], 0.0
        A, b = np.vstack([A, np.hstack([problem.V.T, np.zeros((p, p))])]), np.append(b, -problem.s)
        x = np.linalg.lstsq(A, b, rcond=None)[0]
        r = x[: 2 * k].reshape(k, 2)
        if natural_map_residual(problem, r, x[2 * k :]) < 1e-9 and not any(
            np.allclose(r, y, atol=1e-7) for y in found
        ):
            found.append(r)
    return found


def test_lemke_on_a_known_lcp():
    z = lemke(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -6.0]))
    assert z == pytest.approx([4 / 3, 7 / 3], abs=1e-14)
    assert not np.any(lemke(np.eye(2), np.ones(2)))


def test_lemke_says_when_there_is_no_solution():
    """w1 = -z1 - 1 can never be nonnegative."""
    assert lemke(np.array([[-1.0, 0.0], [0.0, 1.0]]), np.array([-1.0, 1.0])) is None


def test_lemke_ends_on_degenerate_ties():
    """Every ratio ties: blocks of ones, equal right sides, and a zero one."""
    M = np.kron(np.eye(3), np.ones((4, 4))) + np.kron(np.ones((3, 3)), np.eye(4))
    for q in (-np.ones(12), np.repeat([-1.0, 0.0, -1.0], 4), np.tile([0.0, -1.0], 6)):
        z = lemke(M, q)
        w = M @ z + q
        assert z.min() >= 0 and w.min() > -1e-12 and np.abs(z * w).max() < 1e-12


@pytest.mark.parametrize("copositive", [False, True])
@pytest.mark.parametrize("plate", [False, True])
def test_both_forms_are_coulombs_problem(copositive, plate):
    for seed in range(20):
        problem = random_problem(seed, 0.7, plate)
        M, q, C = complementarity_problem(problem, copositive)
        z = lemke(M, q)
        lam = z[-2:-1] - z[-1:] if plate else np.zeros(0)
        assert natural_map_residual(problem, (C @ z[: C.shape[1]]).reshape(3, 2), lam) < 1e-12


def test_copositive_form_is_copositive_at_any_friction():
    M = complementarity_problem(random_problem(0, 50.0, True), copositive=True)[0]
    z = np.random.default_rng(0).exponential(size=(2000, len(M)))
    assert np.einsum("ij,jk,ik->i", z, M, z).min() >= -1e-10 * np.abs(M).max()
    classic = complementarity_problem(random_problem(0, 50.0, True))[0]
    z = np.random.default_rng(0).exponential(size=(2000, len(classic)))
    assert np.einsum("ij,jk,ik->i", z, classic, z).min() < 0  # why there are two


def test_strong_friction_where_the_classic_form_ends_on_a_ray():
    """Some of these defeat the classic form; none defeats the method."""
    rays = 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        k = int(rng.integers(1, 7))
        A = rng.normal(size=(2 * k, 2 * k))
        problem = InterfaceProblem(A @ A.T, rng.normal(size=(k, 2)), 20.0)
        M, q, _ = complementarity_problem(dimensionless(problem)[0])
        rays += lemke(M, q) is None
        assert solve(problem, Lemke()).solved, seed
    assert rays > 0


@pytest.mark.parametrize("mu", [0.0, 0.15, 0.5])
@pytest.mark.parametrize("elements", [4, 8])
def test_agrees_with_newton_on_the_punch(elements, mu):
    problem = reduce(scenes.flat_punch(2, elements=elements, mu=mu))
    solution, reference = solve(problem, Lemke(), tol=1e-12), solve(problem, tol=1e-11)
    assert solution.solved and solution.iterations == 1
    assert np.allclose(solution.reactions, reference.reactions, atol=1e-7)
    assert np.allclose(solution.multipliers, reference.multipliers, rtol=1e-8)


def test_two_plate_motions():
    """A second plate column: the plate is dragged, and one contact has no friction."""
    k = 4
    A = np.random.default_rng(3).normal(size=(2 * k, 4 * k))
    V = np.zeros((2 * k, 2))
    V[::2, 0] = V[1::2, 1] = 1.0
    problem = InterfaceProblem(
        A @ A.T, np.zeros((k, 2)), [0.5, 0.5, 0.0, 0.5], V, np.array([-3.0, 0.2])
    )
    solution = solve(problem, Lemke(), tol=1e-10)
    assert solution.solved
    assert solution.reactions.sum(axis=0) == pytest.approx([3.0, -0.2], abs=1e-10)


def test_a_system_in_rest_and_units():
    assert not np.any(solve(InterfaceProblem(np.eye(2), [[1.0, 0.3]], 0.5), Lemke()).reactions)
    punch = reduce(scenes.flat_punch(2, elements=4))
    large = InterfaceProblem(punch.Q * 1e-9, punch.q, punch.mu, punch.V, punch.s * 1e9)
    assert np.allclose(
        solve(large, Lemke()).reactions / 1e9, solve(punch, Lemke()).reactions, atol=1e-9
    )


@pytest.mark.parametrize(
    "problem",
    [
        InterfaceProblem(np.eye(3), np.zeros((1, 3)), 0.3),
        InterfaceProblem(np.eye(2), np.zeros((1, 2)), Bilateral(0.3)),
        InterfaceProblem(np.eye(602), np.zeros((301, 2)), 0.3),
    ],
)
def test_problems_it_cannot_take(problem):
    with pytest.raises(
        InputError, match=r"needs a 2D problem of at most|does not solve the law Bilateral"
    ):
        solve(problem, Lemke())
    with pytest.raises(InputError, match="2D problem of Coulomb's law with at most"):
        all_solutions(problem)


def test_lemke_is_refused_in_3d_before_any_work():
    with pytest.raises(InputError, match="2D"):
        Lemke().backends(3)


def redundant(seed: int, dim: int, most: int) -> InterfaceProblem:
    """A problem of 4 to `most` contacts whose Q has a third of the full rank."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(4, most + 1))
    B, q = rng.normal(size=(dim * k, dim * k // 3)), rng.normal(size=(k, dim))
    q[:, 0] -= 2.0
    return InterfaceProblem(B @ B.T, q, rng.uniform(0.0, 1.0, k))


@pytest.mark.parametrize(("dim", "count", "most"), [(2, 40, 12), (3, 15, 6)])
def test_redundant_contacts_are_solved_or_proved_to_have_no_solution(dim, count, most):
    """The proof is compared with Lemke's method in the plane, and with Gauss-Seidel in space."""
    ends = []
    for seed in range(count):
        problem = redundant(seed, dim, most)
        solution = solve(problem)
        assert solution.status.label in ("solved", "infeasible"), seed
        if not solution.solved:
            other = (Lemke(), {}) if dim == 2 else ("nsgs", {"max_iterations": 300})
            assert solution.proof is not None, seed
            assert not solve(problem, other[0], **other[1]).solved, seed
            assert dim == 3 or not problem.contacts < 6 or not by_brute_force(problem), seed
        ends.append(solution.proof.branches > 0 if solution.proof else solution.status.label)
    assert {"solved", True} | ({False} if dim == 2 else set()) <= set(ends)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_tree_never_contradicts_a_solution_that_exists(dim):
    """Open, sticking and slipping contacts are drawn first, and then q, so that they solve it."""
    for seed in range(30):
        rng = np.random.default_rng(seed)
        problem = redundant(seed, dim, 5)
        k = problem.contacts
        state = rng.integers(0, 3, size=k)  # open, stick, slip
        way = rng.normal(size=(k, dim - 1))
        way /= np.linalg.norm(way, axis=1)[:, None]
        r, u = np.zeros((2, k, dim))
        r[state > 0, 0] = rng.exponential(size=(state > 0).sum())
        share = np.where(state == 1, rng.uniform(size=k), 1.0)
        r[:, 1:] = -(share * problem.mu * r[:, 0])[:, None] * way
        u[state == 0] = rng.normal(size=((state == 0).sum(), dim))
        u[:, 0] = np.abs(u[:, 0])
        u[state == 2, 1:] = (rng.exponential(size=k)[:, None] * way)[state == 2]
        q = u - (problem.Q @ r.ravel()).reshape(k, dim)
        solvable = InterfaceProblem(problem.Q, q, problem.mu)
        assert natural_map_residual(solvable, r) < 1e-12
        tree = StateTree(dimensionless(solvable)[0])
        assert any(tree.points()), seed
        solution = solve(solvable)
        assert solution.status is not Status.INFEASIBLE, seed


def feasible_states(problem: InterfaceProblem) -> int:
    """How many of the 4^k combinations of states have a solution, by linear programs."""
    Q, q, V, s, k = problem.Q, problem.q.ravel(), problem.V, problem.s, problem.contacts
    n, p = V.shape
    u, r = np.hstack([Q, V]), np.eye(n, n + p)
    balance, found = np.hstack([V.T, np.zeros((p, p))]), 0
    for states in itertools.product(("open", "stick", 1, -1), repeat=k):
        zero, positive = list(zip(balance, -s)), []  # rows, and what they are at x = 0, negated
        for i, state in enumerate(states):
            a, b = slice(2 * i, 2 * i + 1), slice(2 * i + 1, 2 * i + 2)
            bound = problem.mu[i] * r[a]
            if state == "open":
                zero += [(r[2 * i], 0.0), (r[2 * i + 1], 0.0)]
                positive.append((u[2 * i], -q[2 * i]))
                continue
            zero.append((u[2 * i], -q[2 * i]))
            positive.append((r[2 * i], 0.0))
            if state == "stick":
                zero.append((u[2 * i + 1], -q[2 * i + 1]))
                positive += [((bound - r[b])[0], 0.0), ((bound + r[b])[0], 0.0)]
            else:
                zero.append(((r[b] + state * bound)[0], 0.0))
                positive.append((state * u[2 * i + 1], -state * q[2 * i + 1]))
        (A, b), (C, d) = (map(np.array, zip(*rows)) for rows in (zero, positive))
        answer = linprog(np.zeros(n + p), -C, -d, A, b, bounds=(None, None))
        found += answer.status == 0
    return found


def partly_held(seed: int) -> InterfaceProblem:
    """A problem of 1 to 3 contacts; nothing moves some components, most of which are at rest."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 4))
    n, p = 2 * k, int(rng.integers(0, 2))
    B = rng.integers(-2, 3, size=(n, n))
    held = rng.uniform(size=n) < 0.5
    Q = B @ B.T * np.outer(~held, ~held)
    rest = held & (rng.uniform(size=n) < 0.8)
    q, V = rng.integers(-3, 4, size=n) * ~rest, rng.integers(-1, 2, size=(n, p)) * ~rest[:, None]
    mu, s = rng.choice([0.0, 0.3, 0.5, 1.0, 2.0], size=k), rng.integers(-3, 3, size=p)
    return InterfaceProblem(Q.astype(float), q.reshape(k, 2).astype(float), mu, V, s)


def test_a_normal_force_that_moves_nothing_still_bounds_friction():
    """Only what carries no force that matters is left out of proofs and of lists of solutions."""
    counts = []
    for seed in range(25):
        problem = partly_held(seed)
        counts.append(feasible_states(problem))
        assert bool(all_solutions(problem)) == (counts[-1] > 0), seed
        try:
            assert solve(problem).solved == (counts[-1] > 0), seed
        except InputError:  # nothing can balance the load
            assert counts[-1] == 0, seed
    assert min(counts) == 0 and max(counts) > 1


@pytest.mark.parametrize(
    "problem",
    [
        InterfaceProblem(
            np.zeros((4, 4)),
            [[-2.0, -1], [0, 2]],
            [1.0, 0.5],
            V=[[1.0, 1], [-1, -1], [-1, 0], [-1, -1]],
            s=[0.0, 0],
        ),
        InterfaceProblem(
            np.outer([-1.0, 1, 2, 0], [-1.0, 1, 2, 0]),
            [[-1.0, 2], [0, 1]],
            [0.5, 1],
            V=[[-1.0], [-1], [-1], [1]],
            s=[0.0],
        ),
    ],
)
def test_no_forces_are_a_solution_though_the_motion_is_rounded(problem):
    (found,) = all_solutions(problem)
    assert np.abs(found.reactions).max() < 1e-14 and solve(problem).solved
    lam = found.multipliers * (1 + 1e-15)
    assert natural_map_residual(problem, 0 * found.reactions, lam) < 1e-14
