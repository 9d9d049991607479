from itertools import pairwise

import numpy as np
import pytest
from conftest import one_contact

from contactopt import InputError, InterfaceProblem, natural_map_residual, reduce, scenes, solve
from contactopt.methods.alternating import Alternating
from contactopt.methods.diagnosis import diagnose
from contactopt.methods.enumeration import all_solutions
from contactopt.methods.tresca_iteration import Tresca
from contactopt.problem import Solution, Status
from contactopt.problem.laws.bilateral import Bilateral

BOTH = (("alternating", Alternating()), ("tresca", Tresca()))


def random_problem(
    seed: int, dim: int = 2, plate: bool = False, mu: float = 0.5
) -> InterfaceProblem:
    rng = np.random.default_rng(seed)
    k = int(rng.integers(2, 5))
    A = rng.normal(size=(k * dim, 2 * k * dim))
    V = np.zeros((k * dim, int(plate)))
    V[::dim] = 1.0
    return InterfaceProblem(
        A @ A.T / len(A), rng.normal(size=(k, dim)), mu, V, np.full(int(plate), -float(k))
    )


def changed(problem: InterfaceProblem, mu, q: np.ndarray | None = None) -> InterfaceProblem:
    return InterfaceProblem(problem.Q, problem.q if q is None else q, mu, problem.V, problem.s)


def slipping(
    problem: InterfaceProblem, mu: float, way: float = 1.0
) -> tuple[InterfaceProblem, Solution]:
    """The 2D problem with the load under which all contacts slip the same way."""
    k = problem.contacts
    r = np.stack([np.ones(k), np.full(k, -mu * way)], axis=1)
    u = np.stack([np.zeros(k), np.full(k, way)], axis=1)
    q = u - (problem.Q @ r.ravel()).reshape(k, 2)
    loaded = InterfaceProblem(problem.Q, q, mu, problem.V, -problem.V.T @ r.ravel())
    residual = natural_map_residual(loaded, r, np.zeros(len(problem.s)))
    assert residual < 1e-12
    return loaded, Solution(r, np.zeros(len(problem.s)), Status.SOLVED, residual, 0, "")


def rate(problem: InterfaceProblem, solution: Solution, method, steps: int = 150) -> float:
    """Mean factor per step by which the distance to the solution changes, started beside it."""
    noise = np.random.default_rng(0).normal(size=solution.reactions.shape) * 1e-5
    start = Solution(solution.reactions + noise, solution.multipliers, Status.SETTLED, 1.0, 0, "")
    ends = [
        solve(problem, method, start=start, max_iterations=n, tol=1e-14).reactions
        - solution.reactions
        for n in (steps - 50, steps)
    ]
    return float((np.linalg.norm(ends[1]) / np.linalg.norm(ends[0])) ** (1 / 50))


def test_one_contact_is_exact():
    """K = [[1, 1.5], [1.5, 4]]: mu* = K_tt / |K_tn| = 2/3, for iterations and uniqueness."""
    report = diagnose(one_contact((-10.0, 1.0), 1.0))
    assert report.exact and report.guaranteed == report.uniform_slip
    assert [
        report.guaranteed.unique,
        report.guaranteed.tresca,
        report.guaranteed.alternating,
    ] == pytest.approx([2 / 3] * 3, abs=1e-12)
    assert "if and only if mu < 0.6667" in str(report)


@pytest.mark.parametrize("shear", [0.5, 0.9])  # just held, and slides
def test_a_plate_that_determines_all_forces(shear):
    problem = InterfaceProblem(np.eye(2), [[0.0, 0.0]], 0.5, np.eye(2), [-1.0, shear])
    assert diagnose(problem).relaxation in ("tight", "not tight", "undecided")


def test_a_plate_that_determines_the_normal_force_leaves_no_threshold():
    Q = one_contact((0.0, 0.0), 1.0).Q
    report = diagnose(
        InterfaceProblem(Q, np.zeros((1, 2)), 5.0, np.array([[1.0], [0.0]]), np.array([-1.0]))
    )
    assert report.exact and report.guaranteed.unique == report.guaranteed.alternating == np.inf


@pytest.mark.parametrize("name,method", BOTH)
def test_uniform_slip_stops_the_iterations_at_its_threshold(name, method):
    """Beside a uniformly slipping solution they approach it below the threshold only."""
    problem = reduce(scenes.flat_punch(2, elements=5))
    threshold = getattr(diagnose(problem).uniform_slip, name)
    for factor in (0.999, 1.001):
        assert rate(*slipping(problem, factor * threshold), method) == pytest.approx(
            factor, abs=2e-4
        )


def test_contraction_and_uniqueness_are_two_conditions():
    """A rotation as slip map: spectral radius 1 at mu = 1, never an eigenvalue +1."""
    coupling = np.array([[0.0, -0.5], [0.5, 0.0]])  # Q_nt, with Q_nn = I / 2
    Q = np.zeros((4, 4))
    Q[::2, ::2] = np.eye(2) / 2
    Q[1::2, 1::2] = 4 * np.eye(2)
    Q[::2, 1::2], Q[1::2, ::2] = coupling, coupling.T
    report = diagnose(InterfaceProblem(Q, np.zeros((2, 2)), 0.5))
    assert report.uniform_slip.alternating == pytest.approx(1.0)
    assert report.uniform_slip.unique == np.inf
    loaded, solution = slipping(InterfaceProblem(Q, np.zeros((2, 2)), 0.5), 1.1)
    assert len(all_solutions(loaded)) == 1
    assert rate(loaded, solution, Alternating(), 60) == pytest.approx(1.1, rel=1e-3)


def test_coefficients_are_scaled_together():
    """Thresholds are values of the largest mu; frictionless contacts do not count."""
    base = random_problem(3)
    shape = np.linspace(0.2, 1.0, base.contacts)
    a, b = diagnose(changed(base, 0.1 * shape)), diagnose(changed(base, 0.7 * shape))
    assert a.guaranteed.unique == pytest.approx(b.guaranteed.unique)
    assert a.guaranteed.unique >= diagnose(base).guaranteed.unique
    smooth = np.zeros(base.contacts)
    assert diagnose(changed(base, smooth)).guaranteed.unique == pytest.approx(
        diagnose(base).guaranteed.unique
    )


@pytest.mark.parametrize("dim,elements,mu", [(2, 8, 0.2), (2, 16, 0.5), (3, 4, 0.5)])
def test_rates_at_a_solution_are_those_of_the_iterations(dim, elements, mu):
    problem = reduce(scenes.flat_punch(dim, elements=elements, mu=mu))
    local = diagnose(problem, solve(problem, tol=1e-12)).local
    assert local.stick + local.slip + local.open == problem.contacts and local.slip > 0
    for predicted, (_, method) in zip((local.alternating_rate, local.tresca_rate), BOTH):
        history = [h["residual"] for h in solve(problem, method, tol=1e-11).history]
        measured = (history[-2] / history[len(history) // 2]) ** (
            1 / (len(history) - 2 - len(history) // 2)
        )
        assert measured == pytest.approx(predicted, rel=0.03)


def test_local_thresholds_of_one_contact():
    """Slip backwards: eigenvalue -mu / mu*."""
    problem = one_contact((-10.0, 1.0), 1.0)
    local = diagnose(problem, solve(problem)).local
    assert (local.stick, local.slip, local.open) == (0, 1, 0)
    assert [local.alternating_rate, local.tresca_rate] == pytest.approx([1.5, 1.5])
    assert local.contraction == pytest.approx(2 / 3) and local.singular == np.inf
    problem = one_contact((0.8, 1.0), 1.0)
    slip = next(s for s in all_solutions(problem) if 0 < s.reactions[0, 0] < 0.9)
    assert diagnose(problem, slip).local.singular == pytest.approx(2 / 3)


def test_all_open():
    problem = InterfaceProblem(np.eye(4), np.ones((2, 2)), 0.5)
    local = diagnose(problem, solve(problem)).local
    assert local.open == 2 and local.alternating_rate == 0 and local.singular == np.inf


def test_local_turns_with_the_direction_of_slip_in_3d():
    """One contact in 3D whose tangential compliance is not isotropic."""
    Q = np.array([[1.0, 0.5, 0.3], [0.5, 2.0, 0.4], [0.3, 0.4, 1.0]])
    problem = InterfaceProblem(Q, [[-1.0, 0.9, -1.2]], 0.4)
    solution = solve(problem, tol=1e-13)
    local = diagnose(problem, solution).local
    assert local.slip == 1
    for predicted, (_, method) in zip((local.alternating_rate, local.tresca_rate), BOTH):
        history = [
            h["residual"] for h in solve(problem, method, tol=1e-12, max_iterations=60).history
        ]
        steps = [b / a for a, b in pairwise(history) if b > 1e-9]
        assert steps[-1] == pytest.approx(predicted, rel=1e-2)


def test_rank_condition_and_symmetry():
    rng = np.random.default_rng(0)
    A, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    Q = A @ np.diag([4.0, 3.0, 2.0, 1.0, 0.5, 0.0]) @ A.T
    report = diagnose(InterfaceProblem(Q, np.zeros((3, 2)), 0.5))
    assert (report.rank, report.size, report.held) == (5, 6, 0)
    assert report.condition == pytest.approx(8.0) and abs(report.least) < 1e-15
    assert report.asymmetry < 1e-15
    Q[0, 1] += 0.01
    skew = diagnose(InterfaceProblem(Q, np.zeros((3, 2)), 0.5))
    assert skew.asymmetry == pytest.approx(0.01 * np.sqrt(2) / np.linalg.norm(Q))
    indefinite = diagnose(
        InterfaceProblem(np.array([[1.0, 1.5], [1.5, 1.0]]), np.zeros((1, 2)), 0.5)
    )
    assert "not positive semidefinite" in str(indefinite)


def test_nothing_is_guaranteed_for_rigid_bodies_or_dragged_plates():
    rigid = diagnose(InterfaceProblem(np.ones((4, 4)), -np.ones((2, 2)), 0.5))
    assert rigid.guaranteed.unique < 1e-6 and np.isnan(rigid.uniform_slip.unique)
    base = random_problem(0)
    V = np.zeros((len(base.Q), 2))
    V[::2, 0] = V[1::2, 1] = 1.0
    dragged = InterfaceProblem(base.Q, base.q, base.mu, V, np.array([-4.0, 0.3]))
    report = diagnose(dragged, solve(dragged))
    assert report.guaranteed.unique == 0 and "uniqueness is not guaranteed" in str(report)
    assert report.uniform_slip.unique > 0 and np.isfinite(report.local.alternating_rate)


def test_the_punch_prints_in_a_few_lines(punch):
    report = diagnose(punch, solve(punch))
    assert report.held == 1 and report.rank == report.size - 1  # the node on the symmetry plane
    assert len(str(report).splitlines()) == 8 and max(map(len, str(report).splitlines())) < 160


@pytest.mark.parametrize(
    "problem,expected",
    [
        (one_contact((-10.0, 1.0), 0.0), "tight"),  # no friction
        (one_contact((-10.0, 1.0), 1.0), "not tight"),  # slips
        (InterfaceProblem(np.eye(2), [[-1.0, 0.2]], 0.5), "tight"),  # sticks
        # slips, without any coupling in Q
        (InterfaceProblem(np.eye(2), [[-1.0, 5.0]], 0.5), "not tight"),
        (InterfaceProblem(np.eye(2), [[1.0, 0.2]], 0.5), "tight"),  # opens wide
        # opens, by less than mu |u_t|
        (InterfaceProblem(np.eye(2), [[0.1, 5.0]], 0.5), "not tight"),
        (InterfaceProblem(np.eye(2), [[-1.0, 0.2]], Bilateral(0.5)), "none"),
    ],
)
def test_relaxation(problem, expected):
    assert diagnose(problem).relaxation == expected


def test_units_do_not_matter(punch):
    scaled = InterfaceProblem(punch.Q * 1e-9, punch.q * 1e-3, punch.mu, punch.V, punch.s * 1e6)
    a, b = diagnose(punch, solve(punch)), diagnose(scaled, solve(scaled))
    assert a.rank == b.rank and a.relaxation == b.relaxation
    assert a.guaranteed.unique == pytest.approx(b.guaranteed.unique)
    assert a.uniform_slip.unique == pytest.approx(b.uniform_slip.unique)
    assert a.local.alternating_rate == pytest.approx(b.local.alternating_rate, rel=1e-5)


def test_a_solution_of_something_else_is_refused(punch):
    with pytest.raises(InputError, match="needs a solution of this problem"):
        diagnose(changed(punch, 0.05), solve(punch))
