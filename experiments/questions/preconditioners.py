"""How good are the paper's H^1/2 preconditioners, and what beats them?"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg

from contactopt import InterfaceProblem, Material, Part, Scene, Support, reduce
from contactopt.benchmark.report_figures import set_ticks
from contactopt.figures.style import BLUE, COLOURS, GREEN, GREY, ORANGE, label_ends, paper_axes
from contactopt.linear.operators import Interface
from contactopt.meshes.structured import graded, rename, tensor_mesh
from contactopt.methods.preconditioners import (
    PRECONDITIONERS,
    Preconditioner,
    deflated,
    preconditioner,
    restricted,
    smooth_motions,
)
from experiments.report import Tables, measure, template

SIZES = (17, 33, 65, 129, 257, 513, 1025)
DENSE = 260  # contacts up to which condition numbers are computed
SIDES = (7, 9, 13, 17, 33, 65)
STIFFNESS = (
    (5.0, 5.0, 0.3),
    (5e4, 5.0, 0.3),
    (5.0, 5e4, 0.3),
    (5.0, 5.0, 0.0),
    (5.0, 5.0, 0.4),
    (5.0, 5e4, 0.4),
    (5e4, 5.0, 0.4),
    (5.0, 5.0, 0.45),
    (5.0, 5.0, 0.49),
    (5.0, 5.0, 0.499),
)
BODIES = "E1 = {:g}, E2 = {:g}, nu = {:g}"
LOOKS = {"none": GREY, "p21": ORANGE, "p22": GREEN, "neumann": BLUE}


def blocks(
    k: int,
    upper: float,
    lower: float,
    nu: float,
    zone: np.ndarray | None = None,
    Q: str = "explicit",
) -> InterfaceProblem:
    """A punch 4 wide and high, held on top, on a foundation 16 x 8, clamped below; k nodes on the
    contact line.

    zone  their places in [-2, 2], evenly spaced by default
    """
    zone = np.linspace(-2, 2, k) if zone is None else zone
    h = zone[-1] - zone[-2]
    punch = rename(tensor_mesh(zone, graded(4, h, 1.15)), contact="y-", top="y+")
    pin = zone[k // 2 + 1] if k % 2 else zone[k // 2]
    punch = punch.with_boundaries(
        {"pin": lambda x: (x[1] > 4 - 1e-9) & (np.abs(x[0] - pin / 2) < pin / 2)}
    )
    out = 2 + graded(6, h * 1.15, 1.15)[1:]
    ground = tensor_mesh(np.concatenate([-out[::-1], zone, out]), -graded(8, h, 1.15)[::-1])
    ground = rename(ground, bottom="y-").with_boundaries(
        {"contact": lambda x: (x[1] > -1e-9) & (np.abs(x[0]) < 2)}
    )
    first = Part(
        "punch",
        punch,
        Material(upper, nu),
        (Support("top", {"y": 0.0}), Support("pin", {"x": 0.0})),
    )
    second = Part("ground", ground, Material(lower, nu), (Support("bottom"),))
    return reduce(Scene("blocks", first, second, 0.5), Q=Q)


def solids(
    n: int,
    upper: float,
    lower: float,
    zone: np.ndarray | None = None,
    Q: str = "explicit",
    nu: float = 0.3,
) -> InterfaceProblem:
    """The same bodies in 3D, the punch held on top; growth 1.3, n x n contact nodes."""
    zone = np.linspace(-2, 2, n) if zone is None else zone
    h = zone[-1] - zone[-2]
    out = 2 + graded(6, 1.3 * h, 1.3)[1:]
    across = np.concatenate([-out[::-1], zone, out])
    punch = rename(tensor_mesh(zone, zone, graded(4, h, 1.3)), contact="z-", top="z+")
    ground = rename(
        tensor_mesh(across, across, -graded(8, h, 1.3)[::-1]), bottom="z-"
    ).with_boundaries(
        {"contact": lambda x: (x[2] > -1e-9) & (np.abs(x[0]) < 2) & (np.abs(x[1]) < 2)}
    )
    first = Part("punch", punch, Material(upper, nu), (Support("top"),))
    second = Part("ground", ground, Material(lower, nu), (Support("bottom"),))
    return reduce(Scene("solids", first, second, 0.5, kind="solid"), Q=Q)


def refined(k: int, growth: float) -> np.ndarray:
    """k places in [-2, 2], spacing smallest at the ends and growing towards the middle."""
    steps = growth ** np.arange(k // 2)
    half = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum() * 2 - 2
    return np.concatenate([half, -half[-2::-1]])


def condition(P: np.ndarray | LinearOperator, Q: np.ndarray) -> float:
    L = la.cholesky((Q + Q.T) / 2, lower=True)
    values = la.eigvalsh(L.T @ (P @ L))
    return float(values[-1] / values[0]) if values[0] > 0 else np.inf


def iterations(P: np.ndarray | LinearOperator | None, Q: Interface) -> int:
    steps: list[object] = []
    load = np.random.default_rng(0).normal(size=Q.shape[0])
    cg(Q, load, rtol=1e-8, M=P, callback=steps.append, maxiter=5000)
    return len(steps)


def choices(problem: InterfaceProblem) -> dict[str, Preconditioner | None]:
    """None, each by itself, each with smooth motions deflated; without entries the best alone."""
    plain: dict[str, Preconditioner | None] = {"none": None}
    known = [name for name in PRECONDITIONERS if problem.dim == 2 or name != "p22"]
    plain |= {name: preconditioner(problem, name) for name in known}
    Z = smooth_motions(problem)
    if isinstance(problem.Q, np.ndarray):
        return plain | {
            f"{name}, deflated": deflated(P, problem.Q, Z)
            for name, P in plain.items()
            if P is not None
        }
    return {"neumann, deflated": deflated(plain["neumann"], problem.Q, Z)}


def by_size(problem: InterfaceProblem) -> list[dict[str, object]]:
    Q, rows, dim = problem.Q, [], problem.dim
    for name, P in choices(problem).items():
        row = {"contacts": problem.contacts, "preconditioner": name}
        numbers: dict[str, object] = {"condition, normal block": "", "condition, full": ""}
        if problem.contacts <= DENSE:
            dense = np.eye(len(Q)) if P is None else P @ np.eye(len(Q))
            numbers["condition, full"] = condition(dense, Q)
            if "deflated" not in name:
                numbers["condition, normal block"] = condition(dense[::dim, ::dim], Q[::dim, ::dim])
        rows.append(row | numbers | {"PCG iterations, full": iterations(P, Q)})
    return rows


def of_bodies(problem: InterfaceProblem, name: str) -> dict[str, object]:
    """Condition (iterations) of every deflated preconditioner on the full operator."""
    return {"bodies": name} | {
        key: f"{condition(P, problem.Q):.2f} ({iterations(P, problem.Q)})"
        for key, P in choices(problem).items()
        if "deflated" in key
    }


def in_zone(problem: InterfaceProblem, share: float) -> dict[str, object]:
    """Only contacts in the middle are active: half-width `share` of that of the surface."""
    x = problem.coordinates[: problem.dim - 1]
    inside = np.sqrt(np.sum(x**2, axis=0)) <= 2 * share + 1e-9
    active = np.flatnonzero(np.repeat(inside, problem.dim))
    U, zero = sp.identity(problem.q.size, format="csr")[:, active], np.zeros(len(active))
    Q = problem.Q[np.ix_(active, active)]
    row: dict[str, object] = {
        "dim": problem.dim,
        "zone / surface": share,
        "active contacts": int(inside.sum()),
    }
    for name, P in choices(problem).items():
        if P is not None and "deflated" in name:
            rows = U.T @ (P @ U.toarray())
            row[f"{name}: rows of P"] = condition(rows, Q)
            if P.model is not None:
                row[f"{name}: inverse of G_AA"] = condition(
                    restricted(P, U, zero) @ np.eye(len(active)), Q
                )
    return row


def draw(rows: list[dict], sizes: tuple[int, ...]) -> Any:
    figure, axes = paper_axes(2, wide=True)
    for ax, key in zip(axes, ("condition, full", "PCG iterations, full")):
        ends = []
        for name, colour in LOOKS.items():
            for suffix, style in (("", "o--"), (", deflated", "s-")):
                own = [r for r in rows if r["preconditioner"] == name + suffix and r[key] != ""]
                if own:
                    k, y = ([row[column] for row in own] for column in ("contacts", key))
                    ax.loglog(k, y, style, color=colour, mfc="white" if "--" in style else colour)
                    ends.append((k[-1], y[-1], name + suffix, colour))
        if key.startswith("condition"):
            shown = [k for k in sizes if k <= max(end[0] for end in ends)]
            growth = [np.log(k) ** 2 for k in shown]
            ax.loglog(shown, growth, ":", color=COLOURS[6])
            ends.append((shown[-1], growth[-1], r"$\log^2 N$ (paper)", COLOURS[6]))
        else:
            shown = list(sizes)
        ax.set(xlabel="contacts $N$ [-]", ylabel=key.replace(", full", "") + " [-]")
        ax.set_xticks(shown, [str(k) for k in shown], rotation=45)
        ax.set_xticks([], minor=True)
        set_ticks(ax.yaxis)
        label_ends(ax, ends)
    return figure


def drawn(tables: Tables) -> dict[str, Any]:
    surface = draw(tables["surface"], tuple(n * n for n in SIDES))
    return {"line": draw(tables["sizes"], SIZES), "surface": surface}


def sizes() -> list[dict[str, object]]:
    return [row for k in SIZES for row in by_size(blocks(k, *STIFFNESS[0]))]


def surface() -> list[dict[str, object]]:
    forms = {n: "explicit" if n < 30 else "implicit" for n in SIDES}
    return [row for n, Q in forms.items() for row in by_size(solids(n, 5.0, 5.0, Q=Q))]


def bodies() -> list[dict[str, object]]:
    rows = [of_bodies(blocks(129, *material), BODIES.format(*material)) for material in STIFFNESS]
    uneven = blocks(129, *STIFFNESS[0], refined(129, 5 ** (1 / 64)))
    return [*rows, of_bodies(uneven, "E1 = E2 = 5, nu = 0.3, graded")]


def ratios() -> list[dict[str, object]]:
    pairs = ((5.0, 5.0), (5e4, 5.0), (5.0, 5e4))
    rows = [of_bodies(solids(13, *pair), BODIES.format(*pair, 0.3)) for pair in pairs]
    uneven = solids(13, 5.0, 5.0, refined(13, 5 ** (1 / 6)))
    return [*rows, of_bodies(uneven, "E1 = E2 = 5, nu = 0.3, graded")]


def zones() -> list[dict[str, object]]:
    problems = blocks(129, *STIFFNESS[0]), solids(13, 5.0, 5.0)
    rows = [in_zone(problem, share) for problem in problems for share in (0.8, 0.4, 0.2)]
    return [{key: row.get(key, "") for key in rows[0]} for row in rows]


def text(tables: Tables) -> str:
    def most(table: str, name: str) -> int:
        own = [row for row in tables[table] if row["preconditioner"] == name]
        return max(row["PCG iterations, full"] for row in own)

    return template(__file__).format(
        worst_2d=most("sizes", "neumann, deflated"),
        worst_3d=most("surface", "neumann, deflated"),
        none_2d=most("sizes", "none"),
        last=SIZES[-1],
    )


if __name__ == "__main__":
    tables = {"sizes": sizes, "bodies": bodies, "surface": surface, "ratios": ratios}
    title = "Preconditioners of the interface operator"
    measure("preconditioners", title, text, tables | {"zones": zones}, drawn)
