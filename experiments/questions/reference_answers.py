"""Which answers do two methods give to the problems of the test set that share no kernel?

`python -m experiments.questions.reference_answers --tier small` solves the problems of a tier and
writes their tags and answers, as small numbers, into the JSON file beside the test set. What is
there already is kept, unless `--again` is given. Without `--tier` only the report is made.

First: Newton's method, the proximal loop, or the fixed point on cones. Second: Lemke's method,
nonsmooth Gauss-Seidel (NSGS) or ADMM. The answers of the last two are made exact by Newton's steps
on the states (open, stick, slip) that they found, which `exact` here does with NumPy alone.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt import InterfaceProblem, all_solutions, natural_map_residual, solve
from contactopt.benchmark import testset
from contactopt.benchmark.sequences import Sequence
from contactopt.benchmark.testset.tags import invariants
from contactopt.errors import BackendError, InputError
from contactopt.problem.contact_status import contact_status
from experiments.report import template, write

TOL, USUAL = 1e-12, 1e-8
FIRST = ("newton", "proximal", "acary_cadoux")
SECOND = ("lemke", "nsgs", "admm")
STATE_LIMIT = 1.0  # of a state of a sequence
LIMIT = {"small": 8.0, "medium": 20.0, "large": 60.0}  # seconds of each method
ENUMERATED = 6  # contacts up to which all solutions are listed
MOST = 5000  # components up to which Newton's steps are taken on dense matrices
STEPS, SMALL = 6, 800  # of them; unknowns up to which a singular matrix is expected
FOLDER = Path(testset.__file__).parent

Answer = tuple[np.ndarray, np.ndarray]


def exact(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray) -> Answer:
    """The answer after Newton's steps on its states: r = 0 where open, u = 0 where it sticks, and
    u_n = 0, r_t = -mu r_n u_t / |u_t| where it slips, with V' r + s = 0.
    """
    states, d = contact_status(problem, r), problem.dim
    closed = np.flatnonzero(~states.open)
    stick, slip = states.stick[closed], np.flatnonzero(states.slip[closed])
    k, rows = len(closed), (closed[:, None] * d + np.arange(d)).ravel()
    Q, V = np.asarray(problem.explicit().Q)[np.ix_(rows, rows)], problem.V[rows]
    q, mu = problem.q[closed], problem.mu[closed][slip]
    best, least = (r, lam), natural_map_residual(problem, r, lam)
    x = r[closed]
    for _ in range(STEPS):
        u = (Q @ x.ravel() + V @ lam).reshape(k, d) + q
        F, A, B = u.copy(), np.zeros((k, d, d)), np.zeros((k, d, d))  # dF = A dx + B du
        B[stick], B[slip, 0, 0] = np.eye(d), 1.0
        size = np.maximum(np.linalg.norm(u[slip, 1:], axis=1), 1e-300)
        way = u[slip, 1:] / size[:, None]
        F[slip, 1:] = x[slip, 1:] + (mu * x[slip, 0])[:, None] * way
        A[slip, 1:, 1:], A[slip, 1:, 0] = np.eye(d - 1), mu[:, None] * way
        turn = np.eye(d - 1) - way[:, :, None] * way[:, None]
        B[slip, 1:, 1:] = (mu * x[slip, 0] / size)[:, None, None] * turn
        J = np.einsum("kab,kbn->kan", B, Q.reshape(k, d, -1)).reshape(k * d, -1)
        J += sp.block_diag(list(A)).toarray()
        W = np.einsum("kab,kbp->kap", B, V.reshape(k, d, -1)).reshape(k * d, -1)
        system = np.block([[J, W], [V.T, np.zeros((len(lam), len(lam)))]])
        right = np.concatenate([F.ravel(), V.T @ x.ravel() + problem.s])
        solver = np.linalg.solve if len(right) > SMALL else _least
        step = solver(system, right)
        x, lam = x - step[: k * d].reshape(k, d), lam - step[k * d :]
        r = np.zeros_like(r)
        r[closed] = x
        residual = natural_map_residual(problem, r, lam)
        if not residual < least:
            break
        best, least = (r, lam), residual
    return best


def _least(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(matrix, right, rcond=1e-13)[0]


def answers(
    problem: InterfaceProblem, methods: tuple[str, ...], limit: float
) -> Iterator[tuple[float, str, Answer]]:
    """Certificate, method and answer of each method until one reaches TOL."""
    for method in methods:
        try:
            found = solve(problem, method, tol=TOL, time_limit=limit, max_iterations=100_000)
        except (InputError, BackendError, ArithmeticError, np.linalg.LinAlgError):
            continue
        answer = found.reactions, found.multipliers
        near = TOL < found.residual < 1e-4 and problem.q.size <= MOST
        if near and method in ("nsgs", "admm"):
            with suppress(np.linalg.LinAlgError):
                answer = exact(problem, *answer)
        residual = natural_map_residual(problem, *answer)
        yield residual, method, answer
        if residual <= TOL:
            return


def of_sequence(sequence: Sequence) -> dict[str, Any]:
    """Small numbers of the answers to all states: the worst of each, and sums of time."""
    found = [reference(state, STATE_LIMIT) for state in sequence.states]
    known: dict[str, Any] = {"hash": sequence.fingerprint, "invariants": invariants(sequence)}
    known["auto"] = next((one["auto"] for one in found if one["auto"] != "solved"), "solved")
    known["seconds"] = short(sum(one["seconds"] for one in found))
    pairs = [[*one["certificates"].values()] for one in found]
    known["certificates"] = {
        name: max(pair[place] for pair in pairs)
        for place, name in enumerate(("first", "second"))
        if all(len(pair) > place for pair in pairs)
    }
    known["forces"] = float(f"{np.linalg.norm([one.get('forces', 0.0) for one in found]):.12g}")
    for key in ("distance of forces", "distance of displacements"):
        if all(key in one for one in found):
            known[key] = max(one[key] for one in found)
    return known


def reference(problem: InterfaceProblem | Sequence, limit: float) -> dict[str, Any]:
    """Small numbers of the answers of two methods, or of the proof that there is no solution."""
    if isinstance(problem, Sequence):
        return of_sequence(problem)
    known: dict[str, Any] = {"hash": problem.fingerprint, "invariants": invariants(problem)}
    seconds = np.inf
    for _ in range(2):  # the first call may import what it needs
        begin = time.process_time()
        usual = solve(problem, tol=USUAL, time_limit=limit)
        seconds = min(seconds, time.process_time() - begin)
        if seconds > 1:
            break
    known |= {"auto": str(usual.status), "seconds": short(seconds)}
    if usual.proof is not None:
        return known | {"proof": short(usual.proof.margin)}
    pair = []
    for methods in (FIRST, SECOND):
        found = min(answers(problem, methods, limit), key=lambda one: one[0], default=None)
        if found is not None and found[0] <= USUAL:
            pair.append(found)
    if not pair:
        return known | {"certificates": {"auto": short(usual.residual)}}
    known["certificates"] = {method: short(residual) for residual, method, _ in pair}
    r, lam = pair[0][2]
    status = contact_status(problem, r)
    known |= {
        "forces": float(f"{np.linalg.norm(r):.12g}"),
        "open, stick, slip": [int(x.sum()) for x in (status.open, status.stick, status.slip)],
    }
    if len(pair) == 2:
        other, its = pair[1][2]
        u, w = problem.displacements(r, lam), problem.displacements(other, its)
        pressed = max(float(np.linalg.norm(r)), 1e-300)  # nothing may touch
        known["distance of forces"] = short(np.linalg.norm(r - other) / pressed)
        moved = np.linalg.norm(problem.Q @ r.ravel())
        known["distance of displacements"] = short(np.linalg.norm(u - w) / max(moved, 1e-300))  # type: ignore[operator]
    return known


def short(value: Any) -> float:
    return float(f"{float(value):.3g}")


def solutions(problem: InterfaceProblem | Sequence) -> int | None:
    """How many solutions a small problem has."""
    if isinstance(problem, Sequence) or problem.contacts > ENUMERATED:
        return None
    try:
        return len(all_solutions(problem))
    except (InputError, BackendError, np.linalg.LinAlgError):
        return None


def store(path: Path, known: dict[str, Any]) -> None:
    """Write the JSON file, one line for each problem."""
    lines = [f"{json.dumps(name)}: {json.dumps(value)}" for name, value in known.items()]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", "utf-8")


def compute(name: str, tier: str, again: bool) -> None:
    """Compute what is missing of a tier, and store it after each problem."""
    path = FOLDER / f"set_{name}.toml"
    path = (path if path.exists() else Path(name)).with_suffix(".json")
    known = json.loads(path.read_text("utf-8")) if path.exists() else {}
    of_set = testset.problems("", testset=name)
    known = {one.name: known[one.name] for one in of_set if one.name in known}
    for one in of_set:
        if one.tier == tier and (again or "reference" not in known.get(one.name, {})):
            cold = known.get(one.name.replace("warm=True", "warm=False"), {})
            if "reference" in cold:  # a sequence has the same states and answers from cold
                known[one.name] = cold
                continue
            problem = one.load()
            tags = testset.tags_of(problem) | {"solutions": solutions(problem)}
            known[one.name] = {"tags": tags}
            store(path, {row.name: known[row.name] for row in of_set if row.name in known})
            known[one.name] |= {"reference": reference(problem, LIMIT[tier])}
            print(one.name, json.dumps(known[one.name]["reference"]), flush=True)
            store(path, {row.name: known[row.name] for row in of_set if row.name in known})


TEXT = template(__file__)


def report(name: str) -> None:
    """Write what is known as one row for each family, and what is missing."""
    of_set = testset.problems(testset=name)
    rows, missing = [], []
    for family in dict.fromkeys(one.spec.name for one in of_set):
        own = [one for one in of_set if one.spec.name == family]
        known = [one.reference for one in own if one.reference]
        pairs = [one for one in known if "distance of forces" in one]
        sure = [one for one in pairs if max(one["certificates"].values()) <= TOL]
        alone = [
            one.reference
            for one in own
            if one.reference in sure and (one.tags["unique_below"] or 0.0) > one.tags["mu"]
        ]
        rows.append(
            {
                "family": family,
                "problems": len(own),
                "stored": len(known),
                "confirmed": len(sure),
                "no solution": sum("proof" in one for one in known),
                "largest distance of displacements": largest(sure, "distance of displacements"),
                "proved unique": len(alone),
                "largest distance of forces there": largest(alone, "distance of forces"),
            }
        )
        for one in own:
            what = one.reference or {}
            if what not in sure and "proof" not in what:
                missing.append(
                    {
                        "problem": one.name,
                        "tier": one.tier,
                        "auto": what.get("auto", "not stored"),
                        "certificates": json.dumps(what.get("certificates", {})),
                    }
                )
    stored = [one.tier for one in of_set if one.reference]
    tiers = ", ".join(
        f"{stored.count(tier)} of {sum(one.tier == tier for one in of_set)} {tier}"
        for tier in testset.TIERS
    )
    text = TEXT.format(name=name, tol=TOL, stored=len(stored), all=len(of_set), tiers=tiers)
    tables = {"families": rows} | ({"missing": missing} if missing else {})
    write("reference_answers", "Reference answers", text, tables, {})


def largest(known: list[dict[str, Any]], key: str) -> Any:
    return max((one[key] for one in known), default="")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--tier", choices=testset.TIERS)
    parser.add_argument("--testset", default=testset.NEWEST)
    parser.add_argument("--again", action="store_true")
    given = parser.parse_args()
    if given.tier:
        compute(given.testset, given.tier, given.again)
        testset.problem_set.read_set.cache_clear()
    report(given.testset)
