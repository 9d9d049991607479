"""How good are the paper's H^1/2 preconditioners in 2D, and what beats them?"""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from matplotlib.figure import Figure
from scipy.sparse.linalg import LinearOperator, aslinearoperator, cg

from contactopt import InterfaceProblem, Material, Part, Scene, Support, reduce
from contactopt.mesh import graded, rename, tensor_mesh
from contactopt.plots import BLUE, GREEN, GREY, ORANGE
from contactopt.preconditioners import PRECONDITIONERS, deflated, preconditioner, smooth_motions
from experiments.report import write

SIZES = (17, 33, 65, 129, 257)
SIDES = (5, 7, 9, 13, 17)
STIFFNESS = ((5.0, 5.0, 0.3), (5e4, 5.0, 0.3), (5.0, 5e4, 0.3), (5.0, 5.0, 0.0), (5.0, 5.0, 0.4), (5.0, 5.0, 0.49))
BODIES = "E1 = {:g}, E2 = {:g}, nu = {:g}"


def blocks(k: int, upper: float, lower: float, nu: float) -> InterfaceProblem:
    """A punch 4 wide and high, held on top, on a foundation 16 x 8, clamped below; k nodes on the contact line."""
    h, zone = 4 / (k - 1), np.linspace(-2, 2, k)
    punch = rename(tensor_mesh(zone, graded(4, h, 1.15)), contact="y-", top="y+")
    punch = punch.with_boundaries({"pin": lambda x: (x[1] > 4 - 1e-9) & (np.abs(x[0] - h / 2) < h / 10)})
    out = 2 + graded(6, h * 1.15, 1.15)[1:]
    ground = tensor_mesh(np.concatenate([-out[::-1], zone, out]), -graded(8, h, 1.15)[::-1])
    ground = rename(ground, bottom="y-").with_boundaries({"contact": lambda x: (x[1] > -1e-9) & (np.abs(x[0]) < 2)})
    first = Part("punch", punch, Material(upper, nu), (Support("top", {"y": 0.0}), Support("pin", {"x": 0.0})))
    second = Part("ground", ground, Material(lower, nu), (Support("bottom"),))
    return reduce(Scene("blocks", first, second, 0.5))


def solids(n: int, upper: float, lower: float) -> InterfaceProblem:
    """The same bodies in 3D (16 x 16 x 8 foundation, growth 1.3), the punch held on top; n x n contact nodes."""
    h, zone = 4 / (n - 1), np.linspace(-2, 2, n)
    out = 2 + graded(6, 1.3 * h, 1.3)[1:]
    across = np.concatenate([-out[::-1], zone, out])
    punch = rename(tensor_mesh(zone, zone, graded(4, h, 1.3)), contact="z-", top="z+")
    ground = rename(tensor_mesh(across, across, -graded(8, h, 1.3)[::-1]), bottom="z-").with_boundaries(
        {"contact": lambda x: (x[2] > -1e-9) & (np.abs(x[0]) < 2) & (np.abs(x[1]) < 2)}
    )
    first = Part("punch", punch, Material(upper, 0.3), (Support("top"),))
    second = Part("ground", ground, Material(lower, 0.3), (Support("bottom"),))
    return reduce(Scene("solids", first, second, 0.5, kind="solid"))


def condition(P: np.ndarray | LinearOperator, Q: np.ndarray) -> float:
    L = la.cholesky((Q + Q.T) / 2, lower=True)
    values = la.eigvalsh(L.T @ (P @ L))
    return float(values[-1] / values[0]) if values[0] > 0 else np.inf


def iterations(P: np.ndarray | LinearOperator | None, Q: np.ndarray) -> int:
    steps: list[object] = []
    cg(Q, np.random.default_rng(0).normal(size=len(Q)), rtol=1e-8, M=P, callback=steps.append, maxiter=5000)
    return len(steps)


def choices(problem: InterfaceProblem) -> dict[str, LinearOperator | None]:
    """No preconditioner, each by itself, each with the four smooth motions deflated."""
    plain: dict[str, LinearOperator | None] = {"none": None}
    known = [name for name in PRECONDITIONERS if problem.dim == 2 or name != "p22"]
    plain |= {name: preconditioner(problem, name) for name in known}
    Z = smooth_motions(problem)
    return plain | {f"{name}, deflated": deflated(P, problem.Q, Z) for name, P in plain.items() if P is not None}


def by_size(problem: InterfaceProblem) -> list[dict[str, object]]:
    Q, rows, dim = problem.Q, [], problem.dim
    for name, P in choices(problem).items():
        dense = np.eye(len(Q)) if P is None else P @ np.eye(len(Q))
        normal = "" if "deflated" in name else condition(dense[::dim, ::dim], Q[::dim, ::dim])
        row = {"contacts": problem.contacts, "preconditioner": name, "condition, normal block": normal}
        rows.append(row | {"condition, full": condition(dense, Q), "PCG iterations, full": iterations(P, Q)})
    return rows


def by_stiffness(upper: float, lower: float, nu: float) -> dict[str, object]:
    problem = blocks(129, upper, lower, nu)
    row: dict[str, object] = {"bodies": BODIES.format(upper, lower, nu)}
    for name, P in choices(problem).items():
        if "deflated" in name:
            row[name] = f"{condition(P, problem.Q):.2f} ({iterations(P, problem.Q)})"
    return row


def in_3d(n: int, upper: float, lower: float) -> dict[str, object]:
    problem = solids(n, upper, lower)
    row: dict[str, object] = {"bodies": f"E1 = {upper:g}, E2 = {lower:g}, nu = 0.3"}
    for name, P in choices(problem).items():
        if "deflated" in name:
            row[name] = f"{condition(P, problem.Q):.2f} ({iterations(P, problem.Q)})"
    plain = preconditioner(problem, "neumann") @ np.eye(len(problem.Q))
    weight = np.diag(problem.Q) ** 0.25  # takes the scaling of the diagonal back
    P = deflated(aslinearoperator(weight[:, None] * plain * weight), problem.Q, smooth_motions(problem))
    return row | {"neumann unscaled, deflated": f"{condition(P, problem.Q):.2f} ({iterations(P, problem.Q)})"}


def draw(rows: list[dict]) -> Figure:
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    for ax, key in zip(figure.subplots(1, 2), ("condition, full", "PCG iterations, full")):
        for name, colour in zip(("none", *PRECONDITIONERS), (GREY, ORANGE, GREEN, BLUE)):
            for suffix, style in (("", "o--"), (", deflated", "s-")):
                chosen = [row for row in rows if row["preconditioner"] == name + suffix]
                if chosen:
                    k = [row["contacts"] for row in chosen]
                    ax.loglog(k, [row[key] for row in chosen], style, color=colour, mfc="white", label=name + suffix)
        if key.startswith("condition"):
            ax.loglog(SIZES, [np.log(k) ** 2 for k in SIZES], ":", color="black", label="log^2 N (the paper's growth)")
            ax.legend(frameon=False, fontsize=8, loc="upper left")
            ax.set_ylim(top=2e4)
        ax.set(xlabel="contact nodes N [-]", ylabel=key + " [-]")
        ax.set_xticks(SIZES, [str(k) for k in SIZES])
        ax.minorticks_off()
    return figure


TEXT = """A punch 4 wide and 4 high, held on top, on a foundation 16 x 8 clamped below, plane strain, E = 5, nu = .3 in both,
evenly spaced nodes on the whole contact line, meshes graded by 1.15 away from it. P21 and P22 are the paper's (25), (26);
`neumann` is the square root of the Neumann Laplacian by the cosine transform. "deflated": two translations, tilt and
stretch solved exactly. PCG from a random right-hand side to 1e-8.

{sizes}

**Other bodies**, 129 contacts, full operator: condition number (PCG iterations). nu towards .5 spoils all of them; how
much of that is the locking of bilinear elements is not separated here.

{bodies}

**In 3D** the same bodies (foundation 16 x 16 x 8, growth 1.3, the punch held on top in every direction), n x n contacts on
the whole contact surface, P21 summed along both directions (the paper's P31); nine smooth motions deflated.

{surface}

169 contacts, other stiffness ratios, full operator; in the last column without the scaling by the diagonal of Q:

{ratios}
"""

if __name__ == "__main__":
    rows = [row for k in SIZES for row in by_size(blocks(k, *STIFFNESS[0]))]
    surface = [row for n in SIDES for row in by_size(solids(n, 5.0, 5.0))]
    ratios = [in_3d(13, *pair) for pair in ((5.0, 5.0), (5e4, 5.0), (5.0, 5e4))]
    bodies = [by_stiffness(*material) for material in STIFFNESS]
    tables = {"sizes": rows, "bodies": bodies, "surface": surface, "ratios": ratios}
    write(
        "preconditioner_conditions",
        "Preconditioners of the interface operator",
        TEXT,
        tables,
        {"conditions": draw(rows)},
    )
