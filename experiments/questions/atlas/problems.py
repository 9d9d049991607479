"""Small problems that are known to have a solution, drawn at random, and how a method ends on one.

A problem is drawn through its solution: the states of the contacts, forces r and displacements u
that obey Coulomb's law, and q = u - Q r - V lambda, s = -V' r. So every problem has a solution,
also where Q is singular or unsymmetric, and slip in each direction, stick and opening are as likely
as one likes, which no load drawn at random gives.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt import InputError, solve
from contactopt.problem import InterfaceProblem, Solution, Status, natural_map_residual
from experiments.peers import pinocchio_admm, siconos_numerics

FAILED = 1e-6  # certificate above which a method has failed
PEERS = {"siconos": siconos_numerics.PEER, "pinocchio": pinocchio_admm.PEER}
# of a peer on one problem; ours have 500 iterations. The iterations are the limit: Siconos' Newton
# methods take 5 to 11 s for them on one contact, and an end that depends on the clock is no failure
PEER_ITERATIONS, PEER_SECONDS = 10_000, 60.0
LIMITS: dict[str, dict[str, Any]] = {
    "siconos": {"option": f"IPARAM_MAX_ITER={PEER_ITERATIONS}", "local": ""},
    "pinocchio": {"max_iterations": PEER_ITERATIONS},
}
LONG = 600.0  # s that any run on so few contacts ends in
ENDLESS = "refused", "time_limit"  # no failures; "infeasible" is one: every problem is solvable
# every mechanism that is looked for, and how often it takes part in a problem drawn at random
KNOBS = {"condition": 0.4, "dissimilar": 0.3, "redundant": 0.15, "unsymmetric": 0.15,
         "weak": 0.3, "scale": 0.1, "plate": 0.15, "start": 0.4, "sparse": 0.15}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Case:
    """A problem as plain numbers: arrays of InterfaceProblem, forces to start from or none, and a
    solution (r, u).
    """

    Q: np.ndarray
    q: np.ndarray
    mu: np.ndarray
    V: np.ndarray
    s: np.ndarray
    r: np.ndarray
    u: np.ndarray
    start: np.ndarray | None = None
    sparse: bool = False

    @classmethod
    def of(cls, record: dict[str, Any]) -> Case:
        """From a row of the stored table."""
        arrays = {k: v if isinstance(v, bool) or v is None else np.array(v, float)
                  for k, v in record.items()}  # fmt: skip
        k = len(arrays["q"])
        arrays["V"] = arrays["V"].reshape(arrays["q"].size, -1) if k else arrays["V"]
        return cls(**arrays)

    @property
    def numbers(self) -> dict[str, Any]:
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(self).items()}

    def problem(self) -> InterfaceProblem:
        Q = sp.csr_array(self.Q) if self.sparse else self.Q
        V, s = (self.V, self.s) if self.V.size else ((), ())
        return InterfaceProblem(Q, self.q, self.mu, V, s)

    def without(self, i: int) -> Case:
        """Without a contact, the load of the others unchanged."""
        keep = np.arange(len(self.q)) != i
        rows = np.repeat(keep, self.q.shape[1])
        parts = {n: getattr(self, n)[keep] for n in ("q", "mu", "r", "u")}
        start = None if self.start is None else self.start[keep]
        Q, V = self.Q[np.ix_(rows, rows)], self.V[rows]
        return replace(self, **parts, Q=Q, V=V, start=start)

    def loaded(self, **changes: Any) -> Case:
        """With other numbers and the same states: its solution is r, u where these stay, else the
        slipping forces follow mu; q and s are what this solution needs.
        """
        new = replace(self, **changes)
        slip = (new.r[:, 0] > 0) & np.any(new.u[:, 1:] != 0, axis=1)
        r, size = new.r.copy(), np.linalg.norm(new.u[:, 1:], axis=1)
        way = new.u[:, 1:] / np.where(size > 0, size, 1)[:, None]
        r[slip, 1:] = -(new.mu * r[:, 0])[slip, None] * way[slip]
        stick = ~slip & (r[:, 0] > 0)
        r[stick, 1:] *= (new.mu / np.where(self.mu > 0, self.mu, 1))[stick, None]
        q = new.u - (new.Q @ r.ravel()).reshape(r.shape)
        return replace(new, r=r, q=q, s=-new.V.T @ r.ravel())


def blocks(case: Case) -> np.ndarray:
    """Q without the coupling between contacts."""
    block = np.arange(len(case.Q)) // case.q.shape[1]
    return np.where(block[:, None] == block, case.Q, 0.0)


def directions(random: np.random.Generator, k: int, dim: int) -> np.ndarray:
    e = random.normal(size=(k, dim - 1))
    return e / np.linalg.norm(e, axis=1)[:, None]


def states(random: np.random.Generator, k: int, dim: int, mu: np.ndarray) -> tuple[Any, Any]:
    """Forces and displacements (k, dim) that obey Coulomb's law in states drawn at random."""
    r, u = np.zeros((k, dim)), np.zeros((k, dim))
    state = random.choice(["slip", "stick", "open"], k, p=[0.6, 0.25, 0.15])
    state[random.integers(k)] = "slip"
    e, size = directions(random, k, dim), 10.0 ** random.uniform(-1, 1, (k, 2))
    for i, what in enumerate(state):
        if what == "open":
            u[i] = size[i, 0], *random.normal(size=dim - 1)
            continue
        r[i, 0] = size[i, 0]
        share = 1.0 if what == "slip" else random.uniform(0, 0.95)
        r[i, 1:] = -share * mu[i] * r[i, 0] * e[i]
        if what == "slip":
            u[i, 1:] = size[i, 1] * e[i]
    return r, u


def draw(
    random: np.random.Generator, k: int, dim: int, allowed: set[str], always: bool = False
) -> Case:
    """A problem of k contacts; `allowed` are the names in KNOBS that may take part."""
    on = {n for n, share in KNOBS.items() if n in allowed and (always or random.random() < share)}
    m = k * dim
    A = random.normal(size=(m, m))
    if "redundant" in on:
        A = A[:, : max(1, m - int(random.integers(1, m + 1)))]
    values = random.uniform(0.02, 0.3)
    Q = A @ A.T / m + ("redundant" not in on) * values * np.eye(m)
    if "condition" in on and "redundant" not in on:
        basis, spread = np.linalg.eigh(Q)[1], 10.0 ** random.uniform(-9, 0, m)
        Q = basis * spread @ basis.T / spread.max()
    block = np.arange(m) // dim
    if "weak" in on:  # contacts that hardly feel each other: a convex combination with the blocks
        Q = np.where(block[:, None] == block, Q, random.uniform(0, 1) * Q)
    if "dissimilar" in on:
        D = np.repeat(10.0 ** random.uniform(-2, 2, k), dim)
        Q = D[:, None] * Q * D
    if "unsymmetric" in on:
        B = random.normal(size=(m, m)) * np.sqrt(np.outer(Q.diagonal(), Q.diagonal()))
        Q = Q + 10.0 ** random.uniform(-2, 0) * (B - B.T) / 2
    mu = np.full(k, 10.0 ** random.uniform(-1.3, 1.3))
    r, u = states(random, k, dim, mu)
    V = np.zeros((m, 0))
    if "plate" in on:
        V = np.zeros((m, 1))
        V[::dim] = -1.0
    if "scale" in on:
        Q, u = Q * 10.0 ** random.uniform(-9, 9), u * 10.0 ** random.uniform(-4, 4)
    start = None
    if "start" in on:
        start = states(random, k, dim, mu)[0] * 10.0 ** random.uniform(-1, 1)
    nothing = np.zeros(0)
    case = Case(Q, u, mu, V, nothing, r, u, start, "sparse" in on)
    return case.loaded()


@dataclass(frozen=True)
class End:
    """How a method ended on a problem. `path` are its last iterates (j, k dim)."""

    residual: float
    status: str
    iterations: float
    path: np.ndarray
    history: np.ndarray

    @property
    def failed(self) -> bool:
        return self.residual > FAILED and self.status not in ENDLESS

    @property
    def effort(self) -> float:
        """By which a problem that was solved is harder than another one."""
        return float(np.log10(max(self.residual, 1e-16)) + 10 * np.log10(1 + self.iterations))

    @property
    def what(self) -> str:
        """What it does: cycle, stall, crawl, wander, break down, claim falsely."""
        if not self.failed:
            return "solves"
        if self.status in ("solved",):
            return "falsely claims success"
        if self.status in ("backend_failed", "diverged", "settled", "error", "infeasible"):
            return "breaks down"
        if self.status == "stalled":
            return "stalls"
        if not len(self.path):  # of a peer: only its last point is known
            return "does not converge"
        size = max(float(np.abs(self.path).max(initial=0.0)), 1e-300)
        moved = np.abs(self.path[-1] - self.path[-2::-1]).max(axis=1) / size
        back = int(np.argmax(moved[: len(moved) // 2] < 1e-7)) + 1
        if moved[back - 1] < 1e-7 and len(moved) > 3:
            return f"cycles ({back})" if back > 1 else "stalls"
        half = self.history[len(self.history) // 2 :]
        falls = half[-1] < 0.999 * half[0] and np.all(np.diff(half) <= 1e-9 * half[:-1])
        return "crawls" if falls else "wanders"


class Watch:
    """Keeps the last iterates of a solve."""

    def __init__(self) -> None:
        self.path: list[np.ndarray] = []

    def __call__(self, iteration: int, residual: float) -> None: ...

    def watch(self, r: np.ndarray, lam: np.ndarray) -> None:
        self.path = [*self.path[-99:], r.ravel().copy()]


def run(name: str, case: Case, seconds: float = LONG, **settings: Any) -> End:
    """A method of ours by its name, or a peer's as `siconos NSGS`."""
    peer, _, solver = name.partition(" ")
    problem, watch = case.problem(), Watch()
    try:
        if peer in PEERS:
            plane = problem.dim == 2 and solver in siconos_numerics.SOLVERS[2]
            dims = (2,) if peer == "siconos" and plane else (3,)
            given = LIMITS[peer] | {"solver": solver}
            answer = PEERS[peer].answer(problem, 1e-8, max(seconds, PEER_SECONDS), dims, **given)
            if answer.reactions is None:
                return End(np.inf, answer.status, np.nan, np.zeros((0, 1)), np.zeros(0))
            residual = natural_map_residual(problem, answer.reactions)
            residual = residual if np.isfinite(residual) else np.inf
            status = "iteration_limit" if answer.iterations >= PEER_ITERATIONS else answer.status
            return End(residual, status, answer.iterations, np.zeros((0, 1)), np.zeros(0))
        start = None
        if case.start is not None:
            start = Solution(case.start, np.zeros(len(case.s)), Status.SETTLED, 1.0, 0, "given")
        answer = solve(problem, name, time_limit=seconds, start=start, progress=watch, **settings)
    except RuntimeError:  # the peer's process died
        return End(np.inf, "error", np.nan, np.zeros((0, 1)), np.zeros(0))
    except InputError:
        return End(np.inf, "refused", 0, np.zeros((0, 1)), np.zeros(0))
    history = np.array([row["residual"] for row in answer.history])
    path = np.array(watch.path) if watch.path else np.zeros((0, 1))
    return End(answer.residual, answer.status.label, answer.iterations, path, history)  # type: ignore[attr-defined]
