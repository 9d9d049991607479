"""Is an answer ever called solved that is none? Random problems of the kinds that fool a
certificate.

`python -m experiments.questions.search_for_lies [CASES]`. Every answer that a method calls solved
is checked by experiments.questions.coulomb_check, contact by contact, and by what the problem's
making says: that it has no solution, or which reactions are the only ones.
"""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from contactopt import InterfaceProblem, Solution, solve
from contactopt.linear.operators import dense
from experiments.questions.coulomb_check import violations
from experiments.report import template

METHODS = ("auto", "auto", "newton", "proximal", "nsgs")
TOL, SLACK = 1e-8, 20.0  # the check's own conditions are combinations of the certificate's
# of the largest, by which the only reactions may be missed (condition of Q up to 1e4)
FORCES = 1e-3
# families whose problems all have solutions
SOLVABLE = ("plain", "null_space", "distant", "uneven")
SCALES = (1e12, 1e-12), (1e-12, 1e12), (1e12, 1e12)  # of forces and lengths
UNITS_OF = 6  # coprime to the number of methods, so that each of them is tried
CASES = 10_000
PROCESSES = 2


def spd(rng: np.random.Generator, n: int, rank: int | None = None) -> np.ndarray:
    """Symmetric positive semidefinite, of that rank."""
    A = rng.normal(size=(n, rank or n))
    return A @ A.T / n + (np.eye(n) * 0.1 if rank is None else 0.0)


def infeasible(rng, k, d):  # type: ignore[no-untyped-def]
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


def held(rng, k, d):  # type: ignore[no-untyped-def]
    """A contact that cannot move, pushed in."""
    case = plain(rng, k, d)
    i = int(rng.integers(k))
    case["Q"][i * d : (i + 1) * d] = 0
    case["Q"][:, i * d : (i + 1) * d] = 0
    case["q"][i, 0] = -abs(case["q"][i, 0]) - 0.1
    return case | {"feasible": False, "only": None}


def plain(rng, k, d):  # type: ignore[no-untyped-def]
    return dict(Q=spd(rng, k * d), q=rng.normal(size=(k, d)), mu=rng.uniform(0, 0.5, k))


def null_space(rng, k, d):  # type: ignore[no-untyped-def]
    rank = int(rng.integers(1, k * d))
    A = rng.normal(size=(k * d, rank))
    return dict(
        Q=A @ A.T / (k * d), q=(A @ rng.normal(size=rank)).reshape(k, d), mu=rng.uniform(0, 1, k)
    )


def distant(rng, k, d):  # type: ignore[no-untyped-def]
    """Gaps up to 1e12; without friction the other contacts alone have one answer."""
    case = plain(rng, k, d)
    far = rng.random(k) < 0.5
    far[0] = False
    case["q"][far, 0] = 10.0 ** rng.uniform(4, 12, far.sum())
    case["mu"][:] = 0.0
    return case | {"only": frictionless(case["Q"], case["q"], far)}


def frictionless(Q, q, far):  # type: ignore[no-untyped-def]
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


def on_mask(on, k):  # type: ignore[no-untyped-def]
    mask = np.zeros(k, dtype=bool)
    mask[on] = True
    return mask


def strong_friction(rng, k, d):  # type: ignore[no-untyped-def]
    return plain(rng, k, d) | {"mu": 10.0 ** rng.uniform(-6, 6, k)}


def unsymmetric(rng, k, d):  # type: ignore[no-untyped-def]
    case = plain(rng, k, d)
    case["Q"] = case["Q"] + 0.3 * rng.normal(size=case["Q"].shape) / np.sqrt(k * d)
    np.fill_diagonal(case["Q"], np.abs(np.diag(case["Q"])))
    return case


def uneven(rng, k, d):  # type: ignore[no-untyped-def]
    """Compliances over eight decades."""
    case = plain(rng, k, d)
    size = np.repeat(10.0 ** rng.uniform(-4, 4, k), d) ** 0.5
    case["Q"] = case["Q"] * size[:, None] * size[None, :]
    return case


def plate(rng, k, d):  # type: ignore[no-untyped-def]
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


def make(seed: int) -> tuple[str, dict]:
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


def answered(case: dict, seed: int, force: float = 1.0, length: float = 1.0):  # type: ignore[no-untyped-def]
    """The answer and its problem in other units; None where the load pulls the bodies apart."""
    Q, q, s = case["Q"] * (length / force), case["q"] * length, case["s"] * force
    problem = InterfaceProblem(Q, q, case["mu"], case["V"], s)
    try:
        return solve(problem, method_of(seed), tol=TOL, max_iterations=100, time_limit=1.0), problem
    except ValueError:
        return None, problem


def method_of(seed: int) -> str:
    return METHODS[(seed // len(FAMILIES)) % len(METHODS)]


def changed(case: dict, seed: int, answer: Solution) -> str:
    """What is different in other units, of every UNITS_OF-th case: status, or certified answer."""
    if seed // len(FAMILIES) % UNITS_OF or answer.status.label == "time_limit":
        return ""
    for force, length in SCALES:
        other, _ = answered(case, seed, force, length)
        if other is None or other.status.label == "time_limit":
            continue
        if other.status != answer.status:
            return (
                f"{answer.status} becomes {other.status} with forces times {force:g} and lengths"
                f" times {length:g}"
            )
        miss = np.abs(other.reactions / force - answer.reactions).max() / max(
            np.abs(answer.reactions).max(), 1e-300
        )
        if answer.solved and case["only"] is not None and miss > FORCES:
            return (
                f"the answer changes by {miss:.1e} with forces"
                f" times {force:g} and lengths times {length:g}"
            )
    return ""


def judge(seed: int) -> tuple[str, str, str]:
    """Family, status, and what is wrong with an answer that is called solved."""
    name, case = make(seed)
    answer, problem = answered(case, seed)
    if answer is None:
        return name, "refused", ""
    if answer.status.label == "infeasible" and (case["feasible"] is True or name in SOLVABLE):
        return name, "infeasible", "called infeasible although a solution exists"
    if wrong := changed(case, seed, answer):
        return name, str(answer.status), wrong
    if not answer.solved:
        return name, str(answer.status), ""
    if case["feasible"] is False:
        return name, "solved", "there is no solution"
    found = violations(
        dense(problem.Q),
        problem.q,
        problem.mu,
        problem.V,
        problem.s,
        answer.reactions,
        answer.multipliers,
    )
    worst = max(found, key=lambda key: found[key])
    if found[worst] > SLACK * TOL:
        return name, "solved", f"{worst} {found[worst]:.1e}"
    if case["only"] is not None:
        miss = np.abs(answer.reactions[:, 0] - case["only"]).max()
        if miss > FORCES * np.abs(case["only"]).max():
            return name, "solved", f"reactions missed by {miss / np.abs(case['only']).max():.1e}"
    return name, "solved", ""


TEXT = template(__file__)


def report(results: list[tuple[str, str, str]]) -> None:
    """Write what was found for the seeds 0, 1, ..."""
    from experiments.report import write

    cases = len(results)
    statuses = sorted({status for _, status, _ in results})
    rows = []
    for family in FAMILIES:
        mine = [(status, wrong) for name, status, wrong in results if name == family.__name__]
        counts = Counter(status for status, _ in mine)
        row = {"family": family.__name__, "cases": len(mine)} | {
            status: counts[status] for status in statuses
        }
        rows.append(row | {"lies": sum(bool(wrong) for _, wrong in mine)})
    lies = [(seed, *result) for seed, result in enumerate(results) if result[2]]
    listed = (
        "; ".join(f"seed {seed} ({name}): {wrong}" for seed, name, _, wrong in lies[:20]) or "none"
    )
    text = TEXT.format(
        cases=cases,
        last=cases - 1,
        methods=", ".join(METHODS),
        tol=TOL,
        slack=SLACK,
        forces=FORCES,
        lies=listed,
        units=UNITS_OF,
        scales=", ".join(f"({f:g}, {length:g})" for f, length in SCALES),
    )
    write("search_for_lies", "A search for lies", text, {"table": rows}, {})


if __name__ == "__main__":
    cases = int(sys.argv[1]) if len(sys.argv) > 1 else CASES
    with ProcessPoolExecutor(PROCESSES) as pool:
        report(list(pool.map(judge, range(cases), chunksize=50)))
