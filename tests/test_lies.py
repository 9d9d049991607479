"""No answer of random problems is called solved and is wrong, by a check that can fail."""

import numpy as np
import pytest
from coulomb_check import violations

from contactopt import InterfaceProblem, natural_map_residual, solve
from contactopt.benchmark.families.packings import packing
from contactopt.linear.operators import dense

METHODS = ("auto", "auto", "newton", "proximal", "nsgs")
TOL, SLACK = 1e-8, 20.0  # the check's own conditions are combinations of the certificate's
# of the largest, by which the only reactions may be missed (condition of Q up to 1e4)
FORCES = 1e-3
# families whose problems all have solutions
SOLVABLE = ("plain", "null_space", "distant", "uneven")
SCALES = (1e12, 1e-12), (1e-12, 1e12), (1e12, 1e12)  # of forces and lengths
UNITS_OF = 6  # coprime to the number of methods, so that each of them is tried


def worst(problem, reactions, multipliers=()):
    data = dense(problem.Q), problem.q, problem.mu, problem.V, problem.s
    return max(violations(*data, np.asarray(reactions), multipliers).values())


def spd(rng, n, rank=None):
    """Symmetric positive semidefinite, of that rank."""
    A = rng.normal(size=(n, rank or n))
    return A @ A.T / n + (np.eye(n) * 0.1 if rank is None else 0.0)


def infeasible(rng, k, d):
    """Weights y >= 0 of the contacts with Q' e = 0 and q' e < 0."""
    e = np.zeros((k, d))
    e[:, 0] = rng.integers(0, 3, k)
    e[rng.integers(k), 0] = 1.0
    e = e.ravel()
    A = rng.normal(size=(k * d, k * d))
    A -= np.outer(e, e @ A) / (e @ e)
    A[np.abs(A) < 1e-15] = 0.0
    q = rng.normal(size=(k, d))
    q.ravel()[:] -= e * (q.ravel() @ e + rng.uniform(0.1, 2)) / (e @ e)
    return dict(Q=A @ A.T / (k * d), q=q, mu=rng.uniform(0, 1, k), feasible=False)


def held(rng, k, d):
    """A contact that cannot move, pushed in."""
    case = plain(rng, k, d)
    i = int(rng.integers(k))
    case["Q"][i * d : (i + 1) * d] = 0
    case["Q"][:, i * d : (i + 1) * d] = 0
    case["q"][i, 0] = -abs(case["q"][i, 0]) - 0.1
    return case | {"feasible": False, "only": None}


def plain(rng, k, d):
    return dict(Q=spd(rng, k * d), q=rng.normal(size=(k, d)), mu=rng.uniform(0, 0.5, k))


def null_space(rng, k, d):
    rank = int(rng.integers(1, k * d))
    A = rng.normal(size=(k * d, rank))
    return dict(
        Q=A @ A.T / (k * d), q=(A @ rng.normal(size=rank)).reshape(k, d), mu=rng.uniform(0, 1, k)
    )


def distant(rng, k, d):
    """Gaps up to 1e12; without friction the other contacts alone have one answer."""
    case = plain(rng, k, d)
    far = rng.random(k) < 0.5
    far[0] = False
    case["q"][far, 0] = 10.0 ** rng.uniform(4, 12, far.sum())
    case["mu"][:] = 0.0
    return case | {"only": frictionless(case["Q"], case["q"], far)}


def frictionless(Q, q, far):
    """The normal reactions (k,) of near contacts, by trying all sets of closed ones."""
    near = np.flatnonzero(~far)
    d = q.shape[1]
    for bits in range(2 ** len(near)):
        on = near[[(bits >> j) & 1 == 1 for j in range(len(near))]]
        r = np.zeros(len(q))
        if len(on):
            r[on] = np.linalg.solve(Q[np.ix_(on * d, on * d)], -q[on, 0])
        u = Q[::d, ::d] @ r + q[:, 0]
        if np.all(r >= 0) and np.all(u[~on_mask(on, len(q))] >= 0):
            return r
    return None


def on_mask(on, k):
    mask = np.zeros(k, dtype=bool)
    mask[on] = True
    return mask


def strong_friction(rng, k, d):
    return plain(rng, k, d) | {"mu": 10.0 ** rng.uniform(-6, 6, k)}


def unsymmetric(rng, k, d):
    case = plain(rng, k, d)
    case["Q"] = case["Q"] + 0.3 * rng.normal(size=case["Q"].shape) / np.sqrt(k * d)
    np.fill_diagonal(case["Q"], np.abs(np.diag(case["Q"])))
    return case


def uneven(rng, k, d):
    """Compliances over eight decades."""
    case = plain(rng, k, d)
    size = np.repeat(10.0 ** rng.uniform(-4, 4, k), d) ** 0.5
    case["Q"] = case["Q"] * size[:, None] * size[None, :]
    return case


def plate(rng, k, d):
    case = plain(rng, k, d)
    V = np.zeros((k, d, d))
    V[:, np.arange(d), np.arange(d)] = 1.0
    case["q"] *= 0.1
    s = np.concatenate([[-rng.uniform(0.5, 5)], rng.normal(size=d - 1)])
    # All contacts move with the plate as one, so that their cones add up to the widest of them: it
    # holds the plate or none does.
    held = np.linalg.norm(s[1:]) <= case["mu"].max() * -s[0]
    return case | {"V": V.reshape(k * d, d), "s": s, "feasible": bool(held)}


FAMILIES = (
    infeasible,
    held,
    plain,
    null_space,
    distant,
    strong_friction,
    unsymmetric,
    uneven,
    plate,
)


def make(seed):
    """The case of that seed: its family's name and its data, in random units."""
    rng = np.random.default_rng(seed)
    family = FAMILIES[seed % len(FAMILIES)]
    k, d = int(rng.integers(1, 6)), int(rng.integers(2, 4))
    case = {"V": np.zeros((k * d, 0)), "s": np.zeros(0), "feasible": None, "only": None} | family(
        rng, k, d
    )
    force, length = 10.0 ** rng.choice([0, 0, -12, 12, rng.uniform(-12, 12)], size=2)
    case["Q"], case["q"], case["s"] = (
        case["Q"] * (length / force),
        case["q"] * length,
        case["s"] * force,
    )
    case["only"] = None if case["only"] is None else case["only"] * force
    return family.__name__, case


def answered(case, seed, force=1.0, length=1.0):
    """The answer and its problem in other units; None where the load pulls the bodies apart."""
    Q, q, s = case["Q"] * (length / force), case["q"] * length, case["s"] * force
    problem = InterfaceProblem(Q, q, case["mu"], case["V"], s)
    try:
        return solve(problem, method_of(seed), tol=TOL, max_iterations=100, time_limit=1.0), problem
    except ValueError:
        return None, problem


def method_of(seed):
    return METHODS[(seed // len(FAMILIES)) % len(METHODS)]


def changed(case, seed, answer):
    """What is different in other units, of every UNITS_OF-th case: status, or certified answer."""
    if seed // len(FAMILIES) % UNITS_OF or answer.status.label == "time_limit":
        return ""
    for force, length in SCALES:
        other, _ = answered(case, seed, force, length)
        if other is None or other.status.label == "time_limit":
            continue
        units = f"with forces times {force:g} and lengths times {length:g}"
        if other.status != answer.status:
            return f"{answer.status} becomes {other.status} {units}"
        largest = max(np.abs(answer.reactions).max(), 1e-300)
        miss = np.abs(other.reactions / force - answer.reactions).max() / largest
        if answer.solved and case["only"] is not None and miss > FORCES:
            return f"the answer changes by {miss:.1e} {units}"
    return ""


def lie(seed):
    """What is wrong with what is said of a problem."""
    name, case = make(seed)
    answer, problem = answered(case, seed)
    if answer is None:
        return ""
    if answer.status.label == "infeasible" and (case["feasible"] is True or name in SOLVABLE):
        return "called infeasible although a solution exists"
    if wrong := changed(case, seed, answer):
        return wrong
    if not answer.solved:
        return ""
    if case["feasible"] is False:
        return "there is no solution"
    if worst(problem, answer.reactions, answer.multipliers) > SLACK * TOL:
        return "a contact violates Coulomb's conditions"
    if case["only"] is not None:
        miss = np.abs(answer.reactions[:, 0] - case["only"]).max()
        if miss > FORCES * np.abs(case["only"]).max():
            return f"reactions missed by {miss / np.abs(case['only']).max():.1e}"
    return ""


@pytest.mark.parametrize("family", range(len(FAMILIES)), ids=lambda i: FAMILIES[i].__name__)
def test_no_lie_among_random_problems(family):
    for seed in range(99_000 + family, 99_000 + family + 12 * len(FAMILIES), len(FAMILIES)):
        assert make(seed)[0] == FAMILIES[family].__name__
        assert lie(seed) == "", seed


def test_the_independent_check_can_fail():
    problem = InterfaceProblem(np.eye(2), [[-1.0, 0.4]], 0.3)
    good = solve(problem, tol=1e-12)
    assert worst(problem, good.reactions, good.multipliers) < 1e-10
    for r in ([[0.9, -0.27]], [[1.0, -0.2]], [[1.0, 0.3]], [[1.0, -0.4]]):
        assert worst(problem, r) > 1e-2 and natural_map_residual(problem, r) > 1e-2


@pytest.mark.parametrize(
    "method", ["auto", "auto without sweeps", "newton", "proximal", "nsgs", "admm", "apg"]
)
def test_methods_solve_a_packing_and_keep_it_sparse(method, monkeypatch, request):
    problem = packing(2, 16, mu=0.3)
    if method == "auto without sweeps":
        method = request.getfixturevalue("without_sweeps") or "auto"
    monkeypatch.setattr(
        InterfaceProblem, "explicit", lambda self: pytest.fail("Q was formed as an array")
    )
    solution = solve(problem, method, tol=1e-6, max_iterations=20_000, time_limit=20)
    assert solution.solved and worst(problem, solution.reactions, solution.multipliers) < 2e-5
