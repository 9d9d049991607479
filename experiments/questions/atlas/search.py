"""The search: problems drawn at random, the worst of them made worse, the smallest made smaller."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

from contactopt.methods import METHODS
from experiments.peers.siconos_numerics import SOLVERS
from experiments.questions.atlas.problems import ENDLESS, KNOBS, PEERS, Case, blocks, draw, run
from experiments.questions.atlas.radii import newton_load, one_contact, pair

SIZES, SHARES = (1, 2, 3, 5, 8), (0.35, 0.3, 0.2, 0.1, 0.05)  # contacts, and how often
CLEAR = 1e-4  # certificate above which a failure is no matter of the measure of errors
BLOCK, SECONDS = 1000, 100.0  # problems of one seed; seconds after which a search of a method ends
ROUNDING = 1e-14  # by which shorter numbers may make Q less definite, relative to its largest value
# a failure must stay where the digits of Q end otherwise, as they do on another machine
COPIES, LAST_DIGITS = 8, 2.0**-50
WORSE, STEP = 0.15, 0.3  # share of the problems that are made worse; their change
# of our methods: until a run counts as one without an end, which is no failure; at last
PATIENCE = 20.0
PLANE = {"lemke", "siconos CPG", "siconos LEMKE"}  # methods of the plane only
# peers know no plates, get no start, and are written for a symmetric Q
NOT_OF_PEERS = {"plate", "start", "sparse", "unsymmetric"}
NAMES = [
    *(name for name in METHODS if name != "relaxation"),  # it solves another law
    *dict.fromkeys(f"siconos {name}" for names in (SOLVERS[2], SOLVERS[3]) for name in names),
    "pinocchio ADMM",
    "pinocchio PGS",
]


def search(name: str, seed: int = 0, most: int = BLOCK, seconds: float = SECONDS) -> dict[str, Any]:
    """Problems tried and failed with each mechanism alone, with none and with several, and the
    smallest failing problem.
    """
    clock = time.perf_counter if name.split()[0] in PEERS else time.process_time
    random, end = np.random.default_rng(seed), clock() + seconds
    knobs = [n for n in KNOBS if name.split()[0] not in PEERS or n not in NOT_OF_PEERS]
    tried, failed = Counter[str](), Counter[str]()
    found: list[tuple[tuple[float, ...], Case]] = []
    hardest: tuple[float, Case] | None = None
    for number in range(most):
        if clock() > end:
            break
        kind = ["none", "several", *knobs][number % (len(knobs) + 2)]
        k = int(random.choice(SIZES, p=SHARES))
        dim = 2 if name in PLANE else int(random.integers(2, 4))
        on = {"none": set(), "several": set(knobs)}.get(kind, {kind})
        case = draw(random, k, dim, on, always=kind not in ("none", "several"))
        if hardest and kind == "several" and random.random() < WORSE * len(knobs):
            case = mutated(random, hardest[1])
        k, got = len(case.q), run(name, case, PATIENCE)
        if got.status in ENDLESS:
            continue
        decade = f"mu {np.floor(2 * np.log10(case.mu.max())) / 2:g}"
        kinds = [kind, f"{k} contacts", decade]
        tried.update(kinds)
        if got.failed:
            failed.update(kinds)
            size = k, got.residual < CLEAR, len(on), case.start is not None, dim, case.mu.max()
            found.append((tuple(float(x) for x in size), case))
        elif hardest is None or got.effort > hardest[0]:
            hardest = got.effort, case
    out: dict[str, Any] = {"method": name, "tried": dict(tried), "failed": dict(failed)}
    for _, case in sorted(found, key=lambda pair: pair[0])[:5]:
        case = smaller(name, case)
        if surely(name, case):
            return out | {"case": case.numbers}
    return out


def continued(name: str, row: dict[str, Any], seconds: float = SECONDS) -> Iterator[dict[str, Any]]:
    """The row of a method with the problems of further seeds, block by block. It goes on after the
    last seed of the row, so that a search may be ended and continued.
    """
    start, begun = time.perf_counter(), row.get("seeds", 0)
    row = row if begun else {"method": name}
    for seed in count(begun):
        left = seconds - (time.perf_counter() - start)
        if left <= 0:
            return
        found = search(name, seed, seconds=left)
        for key in ("tried", "failed"):
            row[key] = dict(Counter(row.get(key, {})) + Counter(found[key]))
        old, new = row.get("case"), found.get("case")
        if new and (not old or len(new["q"]) < len(old["q"])):
            row["case"] = new
        row["seeds"] = seed + 1
        yield row


def mutated(random: np.random.Generator, case: Case) -> Case:
    """With other forces, displacements, friction and entries of Q near these."""
    m, new = case.Q.shape[0], {}
    A = np.eye(m) + STEP * random.normal(size=(m, m)) / np.sqrt(m)
    new["Q"] = A @ case.Q @ A.T
    new["r"], new["u"] = (x * np.exp(STEP * random.normal(size=x.shape)) for x in (case.r, case.u))
    new["mu"] = case.mu * np.exp(STEP * random.normal())
    return case.loaded(**new)


def surely(name: str, case: Case) -> bool:
    """Whether a method fails whatever the last digits of Q are."""
    copies = (replace(case, Q=case.Q * (1 + i * LAST_DIGITS)) for i in range(COPIES))
    return all(run(name, copy, PATIENCE).failed for copy in copies)


def smaller(name: str, case: Case) -> Case:
    """The same failure with fewer contacts, no start, less friction and shorter numbers, as far as
    it stays.
    """

    def fails(new: Case) -> bool:
        return surely(name, new)

    again = True
    while again and len(case.q) > 1:
        again = False
        for i in range(len(case.q)):
            cut = case.without(i)
            if fails(cut):
                case, again = cut, True
                break
    if case.start is not None and fails(new := replace(case, start=None)):
        case = new
    for factor in (0.5, 0.7, 0.85, 0.93) if run(name, case, PATIENCE).status != "solved" else ():
        for _ in range(8):
            new = case.loaded(mu=case.mu * factor)
            if not fails(new):
                break
            case = new
    for digits in (2, 3, 4, 6):
        new = rounded(case, digits)
        if definite(new) >= min(definite(case), 0.0) - ROUNDING and fails(new):
            return new
    return case


def definite(case: Case) -> float:
    """The least eigenvalue of the symmetric part of Q, over the largest one."""
    values = np.linalg.eigvalsh(case.Q + case.Q.T)
    return float(values[0] / values[-1])


def rounded(case: Case, digits: int) -> Case:
    """With so many significant digits in Q, mu, r and u, and the load that they need."""

    def short(x: np.ndarray) -> np.ndarray:
        return np.array([float(f"{v:.{digits - 1}e}") for v in x.ravel()]).reshape(x.shape)

    r = short(case.r)
    start = None if case.start is None else short(case.start)
    return case.loaded(Q=short(case.Q), mu=short(case.mu), r=r, u=short(case.u), start=start)


def stiffer(case: Case) -> np.ndarray:
    return case.Q + 0.1 * case.Q.diagonal().mean() * np.eye(len(case.Q))


def held(case: Case) -> Case:
    return replace(case, V=case.V[:, :0], s=case.s[:0])


def uncoupled(case: Case) -> np.ndarray:
    """Q without its normal-tangential entries: positive semidefinite if Q is."""
    normal = np.arange(len(case.Q)) % case.q.shape[1] == 0
    return np.where(normal[:, None] == normal, case.Q, 0.0)


def alike(case: Case) -> np.ndarray:
    size = 1 / np.sqrt(np.maximum(np.diag(case.Q), 1e-300))
    return size[:, None] * case.Q * size


# what is taken away for a proof: name -> (the changed problem, settings)
Cure = Callable[[Case], Case]
CURES: dict[str, Cure] = {
    "half the friction": lambda c: c.loaded(mu=c.mu / 2),
    "a tenth of the friction": lambda c: c.loaded(mu=c.mu / 10),
    "no coupling of normal and tangential directions": lambda c: c.loaded(Q=uncoupled(c)),
    "no coupling between contacts": lambda c: c.loaded(Q=blocks(c)),
    "the symmetric part of Q": lambda c: c.loaded(Q=(c.Q + c.Q.T) / 2),
    "a better-conditioned Q": lambda c: c.loaded(Q=stiffer(c)),
    "contacts of equal compliance": lambda c: c.loaded(Q=alike(c)),
    "the plate held": held,
    "no start": lambda c: replace(c, start=None),
    "forces and displacements near one": lambda c: c.loaded(r=np.sign(c.r), u=np.sign(c.u)),
}  # fmt: skip


def cured(name: str, case: Case) -> list[str]:
    """The cures with which the method solves the problem."""
    return [what for what, cure in CURES.items() if run(name, cure(case)).status == "solved"]


TWO = Case(
    np.array([[1.2, -0.54, -0.081, 0.32], [-0.54, 1.4, -0.31, 0.037],
              [-0.081, -0.31, 0.53, -0.4], [0.32, 0.037, -0.4, 1.2]]),
    np.zeros((2, 2)), np.ones(2), np.zeros((4, 0)), np.zeros(0),
    np.array([[0.55, 0.0], [3.0, 0.0]]), np.array([[0.0, -0.8], [0.0, -0.27]]),
).loaded()  # fmt: skip
FLAT = np.array([[0.3, -0.1], [0.16, -0.17], [0.044, 1.3]])  # a contact that cannot move across it
WEDGED = Case(
    FLAT @ FLAT.T, np.zeros((1, 3)), np.array([2.1]), np.zeros((3, 0)), np.zeros(0),
    np.array([[1.7, 0.0608, -3.57]]), np.array([[0.0, -0.0046, 0.27]]),
).loaded()  # fmt: skip
SINGULAR = one_contact(1.0, 0.5, 1.0, 0.1)  # Q = (1, 1; 1, 1): the contact cannot move across it
# problems that follow from the mathematics, or that a longer search has found
KNOWN: dict[str, Case] = {
    "newton": newton_load(0.5, 2.5),
    "tresca": one_contact(0.5, 2.2, -1.0),
    "alternating": one_contact(0.5, 2.2, -1.0),
    "lagrangian": one_contact(0.5, 2.2, -1.0),
    "acary_cadoux": one_contact(0.97, 0.7, 1.0),
    "apg": one_contact(0.97, 0.7, 1.0),
    "admm": one_contact(0.0, 10.0, 1.0),
    "penalty": one_contact(0.5, 1.0, 1.0),
    "augmented_lagrangian": pair(1e-5, 0.5),
    "proximal": WEDGED,
    "nsgs": TWO,
    "siconos NSGS": TWO,
    "siconos TFP": one_contact(0.5, 2.2, -1.0),
    "siconos PFP": one_contact(0.5, 2.2, -1.0),
    "siconos ACLMFP": one_contact(0.97, 0.7, 1.0),
    "siconos NSN_AC": SINGULAR,
    "siconos NSN_AC_TEST": SINGULAR,
    "siconos NSN_NM": SINGULAR,
}
