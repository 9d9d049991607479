"""Triangles or quadrilaterals, tetrahedra or hexahedra, linear or quadratic displacement: which is
cheapest?

A rigid sphere is pressed on a half-space without friction; the exact answer is that of Hertz. All
meshes of a series are refinements of each other in every place, also far away.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from contactopt import Material, Part, Rigid, Scene, Support, reduce_bodies, solve
from contactopt.analytic import contact_modulus, hertz_point
from contactopt.bodies import elements
from contactopt.figures.style import BLUE, GREY, ORANGE, label_ends, paper_axes
from contactopt.meshes.structured import patch, rename, simplices, tensor_mesh
from contactopt.readings.edges import contact_edge
from experiments.report import figures_alone, save_figures, stored, write

RUBBER, RADIUS = Material(5.0, 0.3), 50.0  # MPa; of the sphere, in contact half-widths
SIZE = {2: 30_000.0, 3: 20.0}  # of the body, in contact half-widths
# elements grow by 1 + FAR / n away from the contact, n of them across the half-width
FAR = {2: 3.0, 3: 4.0}
# (dim, degree) -> n
ACROSS = {(2, 1): (4, 8, 16, 32), (2, 2): (2, 4, 8, 16), (3, 1): (2, 4, 6, 8), (3, 2): (1, 2, 3)}
QUICK = {(2, 1): (4, 8), (2, 2): (2, 4), (3, 1): (2, 3), (3, 2): (1, 2)}
KINDS = {
    ("Q", 1): (BLUE, "s--"),
    ("Q", 2): (BLUE, "s-"),
    ("P", 1): (ORANGE, "^--"),
    ("P", 2): (ORANGE, "^-"),
}
CASES = {"sphere": 2, "sphere 3D": 3}
TARGETS = (1e-2, 1e-3)
INNER = 0.6  # the ripple is looked for within this share of the contact radius


def grids(n: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Grid across, with node n at 1, and grid of depths."""

    def beyond(start: np.ndarray) -> np.ndarray:
        steps = [start[-1] - start[-2]]
        while sum(steps) < SIZE[dim] - start[-1]:
            steps.append(steps[-1] * (1 + FAR[dim] / n))
        far = np.cumsum(steps)
        return np.concatenate([start, start[-1] + far * (SIZE[dim] - start[-1]) / far[-1]])

    near = np.arange((n + max(2, n // 4) if dim == 3 else 2 * n) + 1) / n
    return beyond(near), -beyond(near[: n + 1])[::-1]


def scene(dim: int, n: int, degree: int, shape: str) -> Scene:
    """A sphere on a half-space, half-width 1: axisymmetric, or a quarter model in 3D."""
    across, rise = grids(n, dim)
    modulus = contact_modulus(RUBBER)
    force = 4 * modulus / (3 * RADIUS)
    limit, up = across[n + max(2, n // 4)], "yz"[dim - 2]
    mesh = rename(tensor_mesh(*[across] * (dim - 1), rise), bottom=f"{up}-", top=f"{up}+")
    mesh = patch(mesh, "top", "contact", [limit] * (dim - 1))
    mesh = simplices(mesh) if shape == "P" else mesh
    components = "rz" if dim == 2 else "xyz"
    sides = tuple(Support(f"{'xy'[i]}-", {components[i]: 0.0}) for i in range(dim - 1))
    rigid = Rigid(
        "indenter",
        normal=(*[0.0] * (dim - 1), 1.0),
        gap=lambda x: np.sum(x[:-1] ** 2, axis=0) / (2 * RADIUS),
        force={components[-1]: -force},
    )
    body = Part("half-space", mesh, RUBBER, (*sides, Support("bottom")))
    kind, exact = "axisymmetric" if dim == 2 else "solid", hertz_point(force, RADIUS, modulus)
    settings = {"copies": 4 ** (dim - 2), "degree": degree, "zone": 1.0, "reference": exact}
    return Scene("elements", rigid, body, 0.0, kind, **settings)


def measure(case: str, n: int, degree: int, shape: str) -> dict[str, object]:
    """One solve, repeated where it is short: relative errors, unknowns, median processor time."""
    dim = 3 if case.endswith("3D") else 2
    made = scene(dim, n, degree, shape)
    times: list[float] = []
    while not times or (len(times) < 3 and sum(times) < 1.0):
        start = time.process_time()
        reduction = reduce_bodies(made)
        solution = solve(reduction.problem, tol=1e-9)
        times.append(time.process_time() - start)
    problem, exact = reduction.problem, made.reference
    assert solution.solved
    pressure = solution.reactions[:, 0] / problem.areas
    x = np.linalg.norm(problem.coordinates[: dim - 1], axis=0)
    row: dict[str, object] = {
        "case": case,
        "shape": shape,
        "degree": degree,
        "n": n,
        "unknowns": reduction.dofs,
    }
    row |= {"contacts": problem.contacts, "seconds": float(np.median(times))}
    approach = float(-solution.multipliers[0] / exact.approach - 1)
    row["approach"] = approach if dim == 2 else np.nan  # the body in 3D is too small for it
    error = pressure / exact.peak - exact.pressure(x) / exact.peak
    inner = x < INNER
    size = np.sum(problem.areas * (exact.pressure(x) / exact.peak) ** 2)
    return row | {
        "peak": float(pressure.max() / exact.peak - 1),
        "radius": (
            float(contact_edge(made, problem, solution.reactions) - 1) if dim == 2 else np.nan
        ),
        "traction": float(np.sqrt(np.sum(problem.areas * error**2) / size)),
        "ripple": float(np.std(error[inner])),
    }


def runs(across: dict[tuple[int, int], tuple[int, ...]]) -> Iterator[dict[str, object]]:
    for shape, degree in KINDS:
        for case, dim in CASES.items():
            for n in across[dim, degree]:
                yield measure(case, n, degree, shape)


@contextmanager
def contacts_at_all_nodes() -> Iterator[None]:
    """Quadratic simplices with contacts at the middles of edges too, as bricks have them."""
    kept = dict(elements.FACES)
    quarters = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    elements.FACES["RefTri"] = (*kept["RefTri"][:3], kept["RefQuad"][3])
    elements.FACES["RefTet"] = (*kept["RefTet"][:3], quarters)
    try:
        yield
    finally:
        elements.FACES.update(kept)


def ripples(
    rows: list[dict], across: dict[tuple[int, int], tuple[int, ...]]
) -> list[dict[str, object]]:
    """Scatter of the pressure on the finest meshes, also with contacts at all nodes."""
    out = []
    for case, dim in CASES.items():
        finest = {kind: series(rows, case, *kind)[-1] for kind in KINDS}
        with contacts_at_all_nodes():
            other = measure(case, across[dim, 2][-1], 2, "P")
        chosen = [(f"{s}{d}", row) for (s, d), row in finest.items()] + [
            ("P2, contacts at all nodes", other)
        ]
        for name, row in chosen:
            out.append(
                {"case": case, "element": name}
                | {k: row[k] for k in ("n", "contacts", "ripple", "traction")}
            )
    return out


def series(rows: list[dict], case: str, shape: str, degree: int) -> list[dict]:
    return [r for r in rows if (r["case"], r["shape"], r["degree"]) == (case, shape, degree)]


QUANTITIES = (
    ("sphere", "peak"),
    ("sphere", "radius"),
    ("sphere", "approach"),
    ("sphere 3D", "peak"),
)


def reach(rows: list[dict], quantity: str, cost: str, target: float) -> float | None:
    """Cost from which on the error stays below the target, by a power law; None: never."""
    error = np.abs([r[quantity] for r in rows])
    # a finer mesh may be worse: a lucky zero does not count
    error = np.maximum.accumulate(error[::-1])[::-1]
    below = np.flatnonzero(error <= target)
    if len(below) == 0:
        return None
    j, price = below[0], [float(r[cost]) for r in rows]
    if j == 0:
        return price[0]
    share = np.log(error[j - 1] / target) / np.log(error[j - 1] / error[j])
    return float(price[j - 1] * (price[j] / price[j - 1]) ** share)


def cheapest(rows: list[dict]) -> list[dict[str, object]]:
    out = []
    for case, quantity in QUANTITIES:
        for target in TARGETS:
            row: dict[str, object] = {
                "case": case,
                "quantity": quantity,
                "error": f"{100 * target:g} %",
            }
            costs = {}
            for kind in KINDS:
                own = series(rows, case, *kind)
                pair = [reach(own, quantity, cost, target) for cost in ("unknowns", "seconds")]
                costs["".join(map(str, kind))] = pair
                row["".join(map(str, kind))] = (
                    "-" if pair[0] is None else f"{pair[0]:.0f} ({pair[1]:.2g} s)"
                )
            reached = {k: p for k, p in costs.items() if p[0] is not None}
            for i, name in enumerate(("fewest unknowns", "least time")):
                row[name] = min(reached, key=lambda k: reached[k][i]) if reached else "none"
            out.append(row)
    return out


def draw(rows: list[dict]) -> Any:
    titles = {"peak": "peak pressure", "radius": "contact radius", "approach": "approach"}
    figure, axes = paper_axes(2, rows=2, wide=True)
    for ax, (case, quantity) in zip(axes, QUANTITIES):
        solid = ("hexahedra", "tetrahedra") if CASES[case] == 3 else ("quads", "triangles")
        ends = []
        for (shape, degree), (colour, style) in KINDS.items():
            own = series(rows, case, shape, degree)
            x, y = [r["unknowns"] for r in own], np.abs([r[quantity] for r in own])
            ax.loglog(x, y, style, color=colour, mfc="white" if degree == 1 else colour)
            ends.append((x[-1], y[-1], f"{solid[shape == 'P']}, degree {degree}", colour))
        for target in TARGETS:
            ax.axhline(target, color=GREY, lw=0.6, ls=":")
        ax.set(xlabel="displacement unknowns [-]", xlim=(7e2, 7e4))
        ax.set_ylabel(f"error of the {titles[quantity]} [-],\n{case}")
        label_ends(ax, ends)
    return figure


def findings(rows: list[dict], ripple: list[dict]) -> str:
    """What the tables say, in words."""
    table = cheapest(rows)
    said = []
    for target in (f"{100 * t:g} %" for t in TARGETS):
        for what, word in (
            ("fewest unknowns", "fewest unknowns are needed"),
            ("least time", "least time is needed"),
        ):
            won = [
                f"{r['case']}, {r['quantity']}: {r[what]}"
                for r in table
                if r["error"] == target and r[what] != "none"
            ]
            said.append(
                f"- For an error of {target} the {word} by these elements: {'; '.join(won)}."
            )
    for case in CASES:
        own = {r["element"]: float(r["ripple"]) for r in ripple if r["case"] == case}
        other = own.pop("P2, contacts at all nodes")
        worst = max(own, key=lambda k: own[k])
        said.append(
            f"- {case}: on the finest meshes the pressure within {INNER:g} a scatters by"
            f" {100 * own['P2']:.2g} % of the peak on quadratic simplices, and by"
            f" {100 * own['Q2']:.2g} % on quadratic bricks. It scatters most on {worst}, by"
            f" {100 * own[worst]:.2g} %. If all nodes of quadratic simplices were contacts, it"
            f" would be {100 * other:.2g} %."
        )
    return "\n".join(said)


TEXT = """Which elements should you take? A rigid sphere presses on a half-space without friction,
with E = 5 MPa and nu = .3. The scenes are axisymmetric or in 3D. The axisymmetric body is 30,000
contact radii large. The body in 3D is a quarter model of 20 contact radii, and its approach is not
compared.

Q stands for quadrilaterals or hexahedra. P stands for the same elements cut into triangles or
tetrahedra. The number behind the letter is the degree of the displacement. n is the number of
elements across the contact half-width, and all other elements are in proportion. Errors are
relative to the exact values. The time is that of the processor with one core, from finished meshes
to the certified solution.

{findings}

**Cost of an accuracy.** The table has the number of unknowns (and the seconds) from which on the
error stays below the target. Between two runs a power law is assumed. The sign - means that these
meshes do not reach the target.

{cheapest}

**Ripple.** The ripple is the standard deviation of the error of the nodal pressures within .6 of
the contact radius, over the peak pressure.

{ripple}

**The figure** shows the error against the displacement unknowns. The dotted lines are 1 % and .1 %.
Blue squares are quadrilaterals and hexahedra, and red triangles are triangles and tetrahedra.
Dashed lines and hollow marks are degree 1, and solid ones are degree 2.

**All runs.**

{runs}
"""


def main(across: dict[tuple[int, int], tuple[int, ...]] = ACROSS) -> None:
    rows = list(runs(across))
    ripple = ripples(rows, across)
    tables = {"runs": rows, "cheapest": cheapest(rows), "ripple": ripple}
    text = TEXT.replace("{findings}", findings(rows, ripple))
    write("elements", "Shape and degree of the elements", text, tables, {"errors": draw(rows)})


if __name__ == "__main__":
    if figures_alone():
        save_figures("elements", {"errors": draw(stored("elements", "runs"))})
    else:
        main(QUICK if "--quick" in sys.argv else ACROSS)
