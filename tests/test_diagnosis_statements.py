"""What a diagnosis states is true of random problems and of the iterations on them."""

import pickle

import numpy as np
import pytest
from test_diagnosis import changed, random_problem

from contactopt import InterfaceProblem, natural_map_residual, solve
from contactopt.methods.alternating import Alternating
from contactopt.methods.diagnosis import diagnose
from contactopt.methods.enumeration import all_solutions
from contactopt.methods.tresca_iteration import Tresca
from contactopt.problem import Solution, amplification
from contactopt.problem.certificate import yardsticks
from contactopt.problem.laws import Orthotropic
from contactopt.problem.scaling import along_rest


def relative_error(problem: InterfaceProblem, answer: Solution, exact: Solution) -> float:
    """max |dr_i| / F, with the yardstick F of the certificate of the answer."""
    r, exact_r = answer.reactions, exact.reactions
    moved = (problem.Q @ r.ravel()).reshape(r.shape)
    given = problem.q + (problem.V @ answer.multipliers).reshape(r.shape)
    force = yardsticks(problem, r, moved, given).force
    return float(np.linalg.norm(r - exact_r, axis=1).max() / force)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("plate", [False, True])
@pytest.mark.parametrize("seed", [0, 2, 5])
def test_condition_times_certificate_bounds_the_error_of_forces(dim, plate, seed):
    """Solutions for a slightly different q are answers with known errors; the bound is sharp."""
    problem = random_problem(seed, dim, plate)
    pressed = problem.q - np.eye(dim)[0]
    problem = changed(problem, problem.mu, pressed)
    exact = solve(problem, tol=1e-13)
    factor = amplification(problem, exact.reactions, exact.multipliers)
    rng, ratios = np.random.default_rng(seed), []
    for _ in range(20):
        change = 1e-6 * rng.choice([-1.0, 1.0], size=problem.q.shape)
        other = solve(changed(problem, problem.mu, problem.q + change), tol=1e-13)
        residual = natural_map_residual(problem, other.reactions, other.multipliers)
        if residual > 1e-10:
            ratios.append(relative_error(problem, other, exact) / residual)
    assert ratios and 0.1 * factor < max(ratios) <= 1.01 * factor


def test_a_small_certificate_of_wrong_forces_is_remarked(without_sweeps):
    """mu = 1 - 1e-9 of a node with the threshold 1: r_n = 1 is the one solution."""
    wedge = InterfaceProblem([[1, -1], [-1, 2]], [[-1e-9, -5.0]], 1 - 1e-9)
    answer = solve(wedge)
    report = diagnose(wedge, answer)
    wrong = abs(answer.reactions[0, 0] - 1) / np.abs(answer.reactions).max()
    assert answer.solved and 0.01 < wrong < report.local.error < 10 * wrong
    assert "other forces far away fit nearly as well" in str(report)
    assert "nearly not unique" in answer.notes[-1]  # and only where the condition is large
    assert not solve(InterfaceProblem(wedge.Q, [[-3.0, 5.0]], 0.5), "tresca", tol=1e-2).notes
    turned = InterfaceProblem(wedge.Q * 1e-6, wedge.q * 1e-3, wedge.mu)
    other = diagnose(turned, solve(turned)).local
    assert other.condition == pytest.approx(report.local.condition, rel=0.1)


def test_forces_that_are_not_unique_have_no_condition():
    """Two contacts of a rigid body share its weight as they like; sliding freely does not count."""
    shared = InterfaceProblem(
        np.zeros((4, 4)), np.zeros((2, 2)), 0.0, np.eye(4)[:, ::2] @ [[1.0], [1.0]], [-2.0]
    )
    free = np.array([[1.0, 0.0], [0.0, 1.0]] * 2)
    r, lam = np.array([[1.0, 0.0], [1.0, 0.0]]), np.zeros(1)
    assert amplification(shared, r, lam) > 1e12
    loose = InterfaceProblem(np.eye(4), -r, 0.0, free, [-2.0, 0.0])
    assert amplification(loose, r, np.zeros(2)) < 10


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.7])
def test_tangents_at_rest_leave_the_other_forces_unique(angle):
    """A support holds a direction between the tangents; without one forces of two contacts remain
    that nothing tells apart.
    """
    turn = np.eye(6)
    turn[1:3, 1:3] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    Q = np.diag([1.0, 0.0, 2.0, 1.0, 2.0, 2.0])
    Q[[0, 3], [3, 0]] = 0.5
    q = np.array([[-1.0, 0.0, 0.3], [-1.0, 0.2, 0.1]]).ravel()
    problem = InterfaceProblem(turn @ Q @ turn.T, (turn @ q).reshape(2, 3), 0.5)
    answer = solve(problem, tol=1e-12)
    assert amplification(problem, answer.reactions, answer.multipliers) < 10
    assert not any("not unique" in said for said in answer.notes)
    if angle == 0.7:  # the law tells the tangents apart, which so must stay
        grooved = problem.altered(law=Orthotropic(np.full(2, 0.5), np.full(2, 0.3), np.zeros(2)))
        assert along_rest(grooved, answer.reactions)[0] is grooved
    twice = InterfaceProblem(np.kron(np.ones((2, 2)), Q[:3, :3]), np.stack([q[:3]] * 2), 0.5)
    r = np.array([[0.5, 0.0, -0.1], [0.5, 0.0, -0.1]])
    assert amplification(twice, r, np.zeros(0)) > 1e12


def any_problem(seed: int) -> InterfaceProblem:
    """1 to 3 contacts in the plane or in space; Q definite, unsymmetric or semidefinite."""
    rng = np.random.default_rng(seed)
    dim, k = int(rng.integers(2, 4)) if seed % 3 == 0 else 2, int(rng.integers(1, 4))
    n, kind = k * dim, seed % 4
    A, skew = rng.normal(size=(n, n)), rng.normal(size=(n, n))
    Q = A @ A.T / n + 0.05 * np.eye(n)
    if kind == 1:
        Q += rng.choice([1e-4, 0.1, 0.5]) * (skew - skew.T)
    if kind == 2:
        A = A[:, : max(1, n - 2)]
        Q = A @ A.T / n
    plate = int(rng.integers(0, 2)) if k > 1 else 0
    V = np.zeros((n, plate))
    V[::dim] = 1.0
    mu = rng.choice([0.0, 0.3, 0.7, 1.5], size=k)
    return InterfaceProblem(Q, rng.normal(size=(k, dim)), mu, V, np.full(plate, -1.0))


def with_friction(problem: InterfaceProblem, largest: float, q: np.ndarray | None = None):
    """The problem with all coefficients scaled together, as thresholds mean it."""
    mu, top = problem.mu, problem.mu.max()
    return changed(problem, mu / top * largest if top > 0 else np.full(len(mu), largest), q)


def kinds_of_load(problem: InterfaceProblem, rng: np.random.Generator):
    """Loads at random, and those under which all contacts slip one way with random forces."""
    for _ in range(2):
        yield rng.normal(size=problem.q.shape)
    k = problem.contacts
    for way in (1.0, -1.0):
        r_n = rng.exponential(size=k)
        # the plate's force is given
        r_n *= -problem.s[0] / r_n.sum() if len(problem.s) else 1.0
        r = np.stack([r_n, -way * problem.mu * r_n], axis=1)
        u = np.stack([np.zeros(k), way * rng.exponential(size=k)], axis=1)
        yield u - (problem.Q @ r.ravel()).reshape(k, 2)


def number_after(text: str, words: str) -> float | None:
    """The number that follows these words, if they are there."""
    _, found, rest = text.partition(words)
    return float(rest.split()[0].strip(";,)")) if found else None


def check_uniqueness(problem: InterfaceProblem, said: str, seed: int) -> None:
    """Below the guaranteed threshold every load has one solution; where it is lost some has
    another.
    """
    rng = np.random.default_rng(seed)
    exact = number_after(said, "if and only if mu < ")
    sure = exact or number_after(said, "for every load if mu < ")
    if sure and problem.dim == 2:
        below = with_friction(problem, min(0.999 * sure, 50.0))
        for q in kinds_of_load(below, rng):
            assert len(all_solutions(changed(below, below.mu, q))) == 1, (seed, said)
    lost = exact or number_after(said, "lost for some load at mu = ")
    if lost and np.isfinite(lost) and lost < 1e3 and problem.dim == 2:
        # beyond it the slipping solution's index changes sign, so there are others
        above = with_friction(problem, 1.01 * lost)
        counts = []
        for _ in range(4):
            loads = list(kinds_of_load(above, rng))[2:]
            counts += [len(all_solutions(changed(above, above.mu, q))) for q in loads]
        assert max(counts) != 1 or min(counts) != 1, (seed, said, counts)


def check_iterations(problem: InterfaceProblem, said: str, method, seed: int) -> None:
    sure = number_after(said, "for every load if mu < ")
    if sure:
        q = np.random.default_rng(seed).normal(size=problem.q.shape)
        loaded = with_friction(problem, min(0.98 * sure, 20.0), q)
        assert solve(loaded, method, max_iterations=2000, tol=1e-6).solved, (seed, said)


def check_relaxation(problem: InterfaceProblem, said: str, seed: int) -> None:
    """Tight: some solution of Coulomb's problem is one of the cone program, u_n >= mu |u_t| and
    r . u = 0; not tight: none is.
    """
    if said not in ("tight", "not tight") or problem.dim > 2:
        return
    shared = False
    for found in all_solutions(problem):
        u = problem.displacements(found.reactions, found.multipliers)
        dual = u[:, 0] - problem.mu * np.abs(u[:, 1]) >= -1e-7
        shared |= bool(dual.all() and abs(np.sum(found.reactions * u)) < 1e-7)
    assert shared == (said == "tight"), seed


def check_states(problem: InterfaceProblem, solution: Solution, said: str, seed: int) -> None:
    """Counts of states, against forces and displacements; the bound of the error, against a
    solution of all digits.
    """
    r, u = solution.reactions, problem.displacements(solution.reactions, solution.multipliers)
    touching = r[:, 0] > 1e-6
    slipping = touching & (np.linalg.norm(u[:, 1:], axis=1) > 1e-6)
    smooth = touching & (problem.mu == 0)
    slipping &= ~smooth
    sticking = touching & ~slipping & ~smooth
    counts = [sticking.sum(), slipping.sum(), (~touching).sum(), smooth.sum()]
    told = [int(part.split()[0]) for part in said.split(": ")[1].split(";")[0].split(", ")]
    assert [*told, 0][:4] == counts, (seed, said)


def test_three_hundred_statements_are_true():
    """Each line that `diagnose` prints, by enumeration, by the iterations, and by NumPy."""
    tried = 0
    for seed in [*range(50), 410]:
        problem = any_problem(seed)
        lines = str(diagnose(problem)).splitlines()
        singular = np.linalg.svd(problem.Q)[1]
        rank = int(lines[1].split()[2])
        assert rank == np.linalg.matrix_rank(problem.Q), seed
        assert number_after(lines[1], "condition ") == pytest.approx(
            singular[0] / singular[rank - 1], rel=0.06
        ), seed
        least = np.linalg.eigvalsh((problem.Q + problem.Q.T) / 2)[0]
        assert ("not positive semidefinite" in lines[1]) == (least < -1e-12), seed
        check_uniqueness(problem, lines[2], seed)
        check_iterations(problem, lines[3], Tresca(), seed)
        check_iterations(problem, lines[4], Alternating(), seed)
        check_relaxation(problem, lines[5].split(": ")[1], seed)
        tried += 6
        answer = solve(problem, tol=1e-11)
        if answer.solved:
            said = str(diagnose(problem, answer)).splitlines()[6:]
            check_states(problem, answer, said[0], seed)
            tried += 2
    assert tried > 300


def test_no_statement_has_a_threshold_at_infinity():
    """Without a coupling of normal and tangential motion friction loses nothing."""
    text = str(diagnose(InterfaceProblem(np.eye(2), np.array([[-1.0, 0.3]]), mu=0.5)))
    assert "uniqueness for every load and every mu" in text and "mu < inf" not in text


@pytest.mark.parametrize("q_n", [0.0, 0.5, -1.0])
def test_what_holds_for_every_load_does_not_know_the_load(q_n):
    """A normal force that moves nothing holds any friction; a tangential one changes nothing."""
    normal, tangential = (
        str(diagnose(InterfaceProblem(np.diag(Q), [[q_n, -1.0]], 0.5)))
        for Q in ([0, 4.0], [1.0, 0])
    )
    assert "uniqueness (but for the forces of held components) is not guaranteed" in normal
    assert "(but for the forces of held components) for every load and every mu" in tangential


@pytest.mark.parametrize("apart", [1e-5, 1e-10, 1e-12, 1e-14])
def test_forces_that_hardly_move_anything_are_remarked_on_however_small_the_residual(apart):
    """Two contacts at one point, of which one has a soft spring of its own."""
    one, right = np.array([[1, 0.2], [0.2, 1]]), np.array([[1, 0], [0.7, 0]])
    Q = np.block([[one, one], [one, one + apart * np.eye(2)]])
    q = -(Q @ right.ravel()).reshape(2, 2)
    answer = solve(InterfaceProblem(Q, q, mu=0.3), tol=1e-11)
    assert answer.solved and answer.residual <= 1e-11
    off = np.abs(answer.reactions - right).max()
    assert ("nearly" in "".join(answer.notes)) == (off > 1e-3)


def test_whether_forces_are_nearly_not_unique_is_asked_by_who_reads_the_notes(monkeypatch):
    """Reading costs a hundred times what the solve of so few contacts does, and is paid once."""
    asked = []

    def counted(*given):
        asked.append(given)
        return amplification(*given)

    monkeypatch.setattr("contactopt.methods.notes.amplification", counted)
    one = np.array([[1, 0.2], [0.2, 1]])
    Q = np.block([[one, one], [one, one + 1e-12 * np.eye(2)]])  # as in the test above
    answer = solve(InterfaceProblem(Q, -(Q @ [1, 0, 0.7, 0]).reshape(2, 2), 0.3), tol=1e-11)
    assert answer.solved and not asked
    assert "nearly" in answer.notes[0] and list(answer.notes) == [answer.notes[-1]]
    assert len(asked) == 1 and pickle.loads(pickle.dumps(answer)).notes == answer.notes
