"""One Q, five frictions: how far do the laws that simulators use lie from Coulomb's?

Every law is a convex program for the contact forces r over the same Q, q, V and s, or a fixed point
of such programs. The displacements are u = Q r + V lambda + q, and the forces balance the loads, V'
r + s = 0. Problems are dimensionless. The reference is Coulomb's solution with a certificate.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cvxpy as cp
import numpy as np

from contactopt import InterfaceProblem, reduce_bodies, scenes, solve
from contactopt.benchmark.families.packings import packing
from contactopt.figures.style import draw_lines, paper_axes
from contactopt.problem import dimensionless
from contactopt.problem.laws.coulomb import Coulomb
from experiments.report import Tables, measure, stored, template

TIGHT, LOOSE = 1e-10, 1e-4  # tolerances of the cone solver
ROUNDS, STILL = 100, 1e-8  # of a fixed point; its last change
SMALL = 1e-6  # of the largest displacement or force, below which one is zero
SWEEP = tuple(10.0**power for power in (-1, -2, -3, -4))
SIDES = (4, 8, 16, 32)
Answer = tuple[np.ndarray, np.ndarray]  # forces and displacements (k, dim)


def minimum(
    problem: InterfaceProblem,
    law: Callable[[Any, Any], tuple[Any, list[Any]]],
    softness: float = 0.0,
    tol: float = TIGHT,
) -> Answer:
    """min r' (Q + softness) r / 2 + q' r + f(r) subject to V' r + s = 0 and constraints; `law`
    gives f and the constraints from the normal forces (k,) and the friction (k, dim - 1).
    """
    k, dim = problem.q.shape
    Q = np.asarray(problem.explicit().Q, dtype=float)
    r = cp.Variable((k, dim))
    cost, constraints = law(r[:, 0], r[:, 1:])
    flat = cp.reshape(r, (k * dim,), order="C")
    cost += cp.quad_form(flat, cp.psd_wrap(Q + softness * np.diag(np.diag(Q)))) / 2
    balance = [problem.V.T @ flat + problem.s == 0] if problem.V.size else []
    program = cp.Problem(cp.Minimize(cost + problem.q.ravel() @ flat), [*balance, *constraints])
    tolerances = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tol)
    program.solve(solver=cp.CLARABEL, **tolerances)
    u = Q @ r.value.ravel() + problem.q.ravel()
    if balance:
        u = u + problem.V @ balance[0].dual_value
    return np.asarray(r.value), u.reshape(k, dim)


def fixed_point(step: Callable[[np.ndarray], Answer], start: np.ndarray, read: Any) -> Answer:
    """Repeat answer = step(x), x = read(answer), until x stands still."""
    x = start
    for _ in range(ROUNDS):
        answer = step(x)
        before, x = x, read(answer)
        if np.abs(x - before).max() <= STILL * max(1.0, np.abs(x).max()):
            break
    return answer


def associated(problem: InterfaceProblem, softness: float = 0.0, tol: float = TIGHT) -> Answer:
    """Forces in Coulomb's cones minimise r' Q r / 2 + q' r: contacts that slip open by mu |u_t|.

    Springs in the contacts, of `softness` times the diagonal of Q, make it the compliant law.
    """
    cones = lambda n, t: (0.0, [cp.SOC(cp.multiply(problem.mu, n), t, axis=1)])  # noqa: E731
    return minimum(problem, cones, softness, tol)


def polygon(problem: InterfaceProblem, sides: int, tol: float = TIGHT) -> Answer:
    """Coulomb's law whose disc is an inscribed polygon, or the square around it (`sides` 0).

    The friction r_t in mu r_n P opposes the slip most. Where s = max of -p' u_t over the corners p,
    that is the program over the cones of P with mu s added to q_n.
    """
    angle = 2 * np.pi * (np.arange(sides or 4) + (0 if sides else 0.5)) / (sides or 4)
    corners = np.column_stack([np.cos(angle), np.sin(angle)]) * (1 if sides else np.sqrt(2))
    edges = (corners + np.roll(corners, -1, axis=0)) / 2
    reach = np.sum(edges * corners, axis=1)
    mu = problem.mu

    def step(s: np.ndarray) -> Answer:
        def law(n: Any, t: Any) -> tuple[Any, list[Any]]:
            bound = cp.reshape(cp.multiply(mu, n), (len(mu), 1), order="C") @ reach[None, :]
            return (mu * s) @ n, [n >= 0, t @ edges.T <= bound]

        return minimum(problem, law, tol=tol)

    return fixed_point(step, np.zeros(len(mu)), lambda a: np.max(-a[1][:, 1:] @ corners.T, axis=1))


def smoothed(n: Any, t: Any, bound: np.ndarray, speed: float) -> tuple[Any, list[Any]]:
    """-speed sum of sqrt(g^2 - |t|^2), which makes t = -g u_t / sqrt(|u_t|^2 + speed^2)."""
    y = cp.Variable((len(bound), 1))
    return -speed * cp.sum(y), [cp.SOC(bound, cp.hstack([t, y]), axis=1)]


def regularised(problem: InterfaceProblem, speed: float, tol: float = TIGHT) -> Answer:
    """Friction -mu r_n u_t / sqrt(|u_t|^2 + speed^2): contacts never stick, they creep."""

    def step(bound: np.ndarray) -> Answer:
        def law(n: Any, t: Any) -> tuple[Any, list[Any]]:
            cost, cones = smoothed(n, t, bound, speed)
            return cost, [n >= 0, *cones]

        return minimum(problem, law, tol=tol)

    read = lambda answer: problem.mu * np.maximum(answer[0][:, 0], 0.0)  # noqa: E731
    return fixed_point(step, problem.mu, read)


def barrier(problem: InterfaceProblem, width: float, tol: float = TIGHT) -> Answer:
    """-width log r_n holds contacts apart by u_n = width / r_n; friction is regularised at the
    speed `width`, and its bound is mu r_n of the answer without friction (a lag of one).
    """

    def law(n: Any, t: Any) -> tuple[Any, list[Any]]:
        return -width * cp.sum(cp.log(n)), [t == 0]

    bound = problem.mu * minimum(problem, law, tol=tol)[0][:, 0]

    def with_friction(n: Any, t: Any) -> tuple[Any, list[Any]]:
        cost, cones = smoothed(n, t, bound, width)
        return cost - width * cp.sum(cp.log(n)), cones

    return minimum(problem, with_friction, tol=tol)


def blocks(mu: tuple[float, ...], slope: float) -> InterfaceProblem:
    """One implicit step of a stack of cubes on an incline, four contacts a face: W = H M^-1 H', q =
    H v of the free fall. `mu` are the friction coefficients of the faces from below; the fall
    line lies 22.5 degrees from the first tangent.
    """
    n, corners = len(mu), [(a, b) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]
    H = np.zeros((12 * n, 6 * n))
    for face in range(n):
        for c, (x, y) in enumerate(corners):
            rows = slice(12 * face + 3 * c, 12 * face + 3 * c + 3)
            for body, sign, z in ((face, 1.0, -0.5), (face - 1, -1.0, 0.5)):
                if body >= 0:
                    turn = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
                    motion = np.hstack([np.eye(3), turn])[[2, 0, 1]]
                    H[rows, 6 * body : 6 * body + 6] = sign * motion
    inverse = np.tile([1.0, 1.0, 1.0, 6.0, 6.0, 6.0], n)  # unit mass, inertia 1 / 6
    fall = [slope * np.cos(np.pi / 8), slope * np.sin(np.pi / 8), -1.0, 0, 0, 0]
    q = (H @ np.tile(fall, n)).reshape(-1, 3)
    return InterfaceProblem(H * inverse @ H.T, q, Coulomb(np.repeat(mu, 4)))


PROBLEMS: dict[str, Callable[[], InterfaceProblem]] = {
    "block that holds": lambda: blocks((0.5,), 0.4),
    "block that slides": lambda: blocks((0.5,), 1.0),
    "stack that slides": lambda: blocks((0.4, 0.8, 0.8), 0.6),
    "pile": lambda: packing(3, 12, 0, 0.5),
    "elastic punch": lambda: reduce_bodies(scenes.flat_punch(dim=3, elements=3)).problem,
}
LAWS: dict[str, tuple[Callable[..., Answer], tuple[float, ...]]] = {
    "associated": (associated, (0.0,)),
    "square around the disc": (lambda p, _, tol=TIGHT: polygon(p, 0, tol), (0.0,)),
    "polygon": (polygon, SIDES),
    "regularised": (regularised, SWEEP),
    "compliant": (associated, SWEEP),
    "barrier": (barrier, SWEEP),
}


def distance(Q: np.ndarray, r: np.ndarray, s: np.ndarray) -> float:
    """sqrt of (r - s)' Q (r - s) over s' Q s, blind to forces that move nothing."""
    d = (r - s).ravel()
    return float(np.sqrt(max(d @ Q @ d, 0.0) / (s.ravel() @ Q @ s.ravel())))


def errors(problem: InterfaceProblem, answer: Answer, truth: Answer) -> dict[str, float]:
    """What a user of a simulator sees: creep, lift-off and overlap over the largest displacement
    that the forces make, forces outside the cone over the largest force.
    """
    (r, u), (exact, moved), Q = answer, truth, np.asarray(problem.explicit().Q)
    length = np.linalg.norm((Q @ exact.ravel()).reshape(r.shape), axis=1).max()
    force = np.linalg.norm(exact, axis=1).max()
    carries = exact[:, 0] > SMALL * force
    sticks = carries & (np.linalg.norm(moved[:, 1:], axis=1) <= SMALL * length)
    outside = np.linalg.norm(r[:, 1:], axis=1) - problem.mu * r[:, 0]
    return {
        "distance": distance(Q, r, exact),
        "creep": float(np.linalg.norm(u[sticks, 1:], axis=1).max(initial=0.0) / length),
        "lift-off": float(u[carries, 0].max(initial=0.0) / length),
        "overlap": float((-u[:, 0]).max(initial=0.0) / length),
        "outside the cone": float(outside.max(initial=0.0) / force),
    }


def rows() -> list[dict[str, Any]]:
    """Every law on every problem, at every value of its parameter."""
    table = []
    for name, make in PROBLEMS.items():
        problem = dimensionless(make())[0].explicit()
        solution = solve(problem, tol=1e-11)
        assert solution.residual <= 1e-9, f"{name} has no certificate"
        truth = solution.reactions, problem.displacements(solution.reactions, solution.multipliers)
        for law, (program, values) in LAWS.items():
            for value in values:
                answer = program(problem, value)
                loose = program(problem, value, tol=LOOSE)
                row = {"problem": name, "contacts": problem.contacts, "law": law}
                row |= {"parameter": value} | errors(problem, answer, truth)
                row["solver error"] = distance(np.asarray(problem.Q), loose[0], answer[0])
                table.append(row)
                print(row, flush=True)
    return table


def worst(table: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """For each law at each parameter the largest of each error over the problems."""
    out = []
    for law, (_, values) in LAWS.items():
        for value in values:
            own = [r for r in table if (r["law"], r["parameter"]) == (law, value)]
            keys = list(own[0])[4:]
            out.append({"law": law, "parameter": value} | {k: max(r[k] for r in own) for k in keys})
    return out


def draw(tables: Tables) -> dict[str, Any]:
    """Distance to Coulomb's solution against the parameter, creep beside it; the distance against
    the number of sides, a line for each problem.
    """
    table = tables["rows"]
    parameters, axes = paper_axes(columns=2, wide=True)
    for ax, key, label in (
        (axes[0], "distance", "distance to Coulomb's solution [-]"),
        (axes[1], "creep", "creep of sticking contacts [-]"),
    ):
        lines = []
        for law in ("regularised", "compliant", "barrier"):
            own = [r for r in tables["worst"] if r["law"] == law]
            lines.append((law, [r["parameter"] for r in own], [r[key] for r in own]))
        draw_lines(ax, lines)
        ax.set(xlabel="parameter [-]", ylabel=label)
    sides, (ax,) = paper_axes()
    lines = []
    for name in PROBLEMS:
        own = [r for r in table if (r["problem"], r["law"]) == (name, "polygon")]
        shown = [max(r["distance"], SMALL) for r in own]
        lines.append((name, [r["parameter"] for r in own], shown))
    draw_lines(ax, lines)
    ax.set(xlabel="sides of the polygon [-]", ylabel="distance to Coulomb's solution [-]")
    ax.set_xscale("log", base=2)
    ax.set_xticks(SIDES, [str(number) for number in SIDES])
    return {"parameters": parameters, "sides": sides}


if __name__ == "__main__":
    measure(
        "five_frictions",
        "One Q, five frictions",
        template(__file__).format(tight=TIGHT, loose=LOOSE, small=SMALL),
        {"rows": rows, "worst": lambda: worst(stored("five_frictions", "rows"))},
        draw,
    )
