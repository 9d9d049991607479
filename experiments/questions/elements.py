"""Triangles or quadrilaterals, tetrahedra or hexahedra, linear or quadratic displacement: which is
cheapest?

A rigid sphere and a rigid flat disc are pressed on a half-space without friction; the exact answers
are Hertz's and Boussinesq's. All meshes of a series are refinements of each other in every place,
also far away.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from matplotlib.figure import Figure

from contactopt import Material, Part, Rigid, Scene, Support, reduce_bodies, solve
from contactopt.analytic import contact_modulus, flat_punch_axisymmetric, hertz_point
from contactopt.bodies import elements
from contactopt.figures.plots import BLUE, GREY, ORANGE
from contactopt.meshes.structured import patch, rename, simplices, tensor_mesh
from contactopt.readings.edges import contact_edge
from experiments.report import write

RUBBER, RADIUS = Material(5.0, 0.3), 50.0  # MPa; of the sphere, in contact half-widths
SIZE = {2: 3000.0, 3: 20.0}  # of the body, in contact half-widths
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
# towards the edge of the disc: full order needs at least twice the degree
GRADING = {1: 3.0, 2: 4.0}
TARGETS = (1e-2, 1e-3)
INNER = 0.6  # the ripple is looked for within this share of the contact radius


def grids(n: int, dim: int, grading: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Grid across, with node n at 1 and graded towards it as xi^grading, and grid of depths."""
    xi = np.arange(n + 1) / n

    def beyond(start: np.ndarray) -> np.ndarray:
        steps = [start[-1] - start[-2]]
        while sum(steps) < size - start[-1]:
            steps.append(steps[-1] * (1 + FAR[dim] / n))
        far = np.cumsum(steps)
        return np.concatenate([start, start[-1] + far * (size - start[-1]) / far[-1]])

    near = np.concatenate([1 - (1 - xi) ** grading, 1 + xi[1:] ** grading])
    near = near[: n + max(2, n // 4) + 1] if dim == 3 else near
    return beyond(near), -beyond(xi**grading)[::-1]


def scene(
    dim: int,
    n: int,
    degree: int,
    shape: str,
    punch: bool = False,
    grading: float = 1.0,
    size: float | None = None,
) -> Scene:
    """Sphere or disc on a half-space, half-width 1: axisymmetric, or a quarter model in 3D."""
    across, rise = grids(n, dim, grading, size or SIZE[dim])
    modulus = contact_modulus(RUBBER)
    force = 2 * modulus / RADIUS if punch else 4 * modulus / (3 * RADIUS)
    exact = (
        flat_punch_axisymmetric(force, 1.0, modulus)
        if punch
        else hertz_point(force, RADIUS, modulus)
    )
    limit = across[n if punch else n + max(2, n // 4)]
    up = "yz"[dim - 2]
    mesh = rename(tensor_mesh(*[across] * (dim - 1), rise), bottom=f"{up}-", top=f"{up}+")
    mesh = patch(mesh, "top", "contact", [limit] * (dim - 1))
    mesh = simplices(mesh) if shape == "P" else mesh
    components = "rz" if dim == 2 else "xyz"
    sides = tuple(Support(f"{'xy'[i]}-", {components[i]: 0.0}) for i in range(dim - 1))
    rigid = Rigid(
        "indenter",
        normal=(*[0.0] * (dim - 1), 1.0),
        gap=None if punch else lambda x: np.sum(x[:-1] ** 2, axis=0) / (2 * RADIUS),
        force={components[-1]: -force},
    )
    body = Part("half-space", mesh, RUBBER, (*sides, Support("bottom")))
    kind, zone = "axisymmetric" if dim == 2 else "solid", None if punch else 1.0
    copies = 4 ** (dim - 2)
    return Scene(
        "elements", rigid, body, 0.0, kind, copies=copies, degree=degree, zone=zone, reference=exact
    )


def measure(case: str, n: int, degree: int, shape: str, **options: object) -> dict[str, object]:
    """One solve, repeated where it is short: relative errors, unknowns, median processor time."""
    dim = 3 if case.endswith("3D") else 2
    made = scene(dim, n, degree, shape, **options)  # type: ignore[arg-type]
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
    row["approach"] = float(-solution.multipliers[0] / exact.approach - 1)
    if exact.peak is None:
        return row | {"peak": np.nan, "radius": np.nan, "traction": np.nan, "ripple": np.nan}
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


def size_effect() -> float:
    """By how much less the disc approaches a body of SIZE than a half-space, relative."""
    near, far = (measure("disc", 8, 2, "Q", punch=True, size=k * SIZE[2]) for k in (1, 10))
    return (float(near["approach"]) - float(far["approach"])) / 0.9


def without_size(row: dict, effect: float) -> dict[str, object]:
    """The approach of a half-space; the size's effect on a sphere's is 2/3 of that on a disc's."""
    share = {"sphere": 2 / 3, "sphere 3D": np.nan}.get(row["case"], 1.0)
    return row | {"approach": row["approach"] - share * effect}


def runs(across: dict[tuple[int, int], tuple[int, ...]]) -> Iterator[dict[str, object]]:
    for shape, degree in KINDS:
        for n in across[2, degree]:
            yield measure("sphere", n, degree, shape)
            yield measure("disc", n, degree, shape, punch=True)
            yield measure("disc, graded", n, degree, shape, punch=True, grading=GRADING[degree])
        for n in across[3, degree]:
            yield measure("sphere 3D", n, degree, shape)


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
    for case, dim in (("sphere", 2), ("sphere 3D", 3)):
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
    ("sphere 3D", "traction"),
    ("disc", "approach"),
    ("disc, graded", "approach"),
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
    # dominated by the contact's edge
    for case, quantity in (pair for pair in QUANTITIES if pair[1] != "traction"):
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


def orders(rows: list[dict]) -> list[dict[str, object]]:
    """Slope of the error against 1 / n between the two finest meshes."""
    out = []
    for case, quantity in QUANTITIES:
        row: dict[str, object] = {"case": case, "quantity": quantity}
        for kind in KINDS:
            coarse, fine = series(rows, case, *kind)[-2:]
            ratio = abs(float(coarse[quantity]) / float(fine[quantity]))
            row["".join(map(str, kind))] = float(np.log(ratio) / np.log(fine["n"] / coarse["n"]))
        out.append(row)
    return out


def draw(rows: list[dict]) -> Figure:
    shown = (("sphere", "peak"), ("sphere", "radius"), ("sphere", "approach"))
    shown += (("sphere 3D", "traction"), ("disc", "approach"), ("disc, graded", "approach"))
    names = {
        "sphere": "sphere, axisymmetric",
        "sphere 3D": "sphere, 3D",
        "disc": "flat disc, even elements",
    }
    names["disc, graded"] = "flat disc, graded elements"
    figure = Figure(figsize=(7.4, 10.2), layout="constrained")
    for ax, (case, quantity) in zip(figure.subplots(3, 2).ravel(), shown):
        for (shape, degree), (colour, style) in KINDS.items():
            own = series(rows, case, shape, degree)
            solid = (
                {"Q": "hexahedra", "P": "tetrahedra"}
                if case.endswith("3D")
                else {"Q": "quads", "P": "triangles"}
            )
            label = f"{solid[shape]}, degree {degree}"
            x, y = [r["unknowns"] for r in own], np.abs([r[quantity] for r in own])
            ax.loglog(
                x, y, style, color=colour, mfc="white" if degree == 1 else colour, ms=5, label=label
            )
        for target in TARGETS if not case.endswith("3D") else ():
            ax.axhline(target, color=GREY, lw=0.6, ls=":")
        what = {
            "traction": "traction, L2",
            "peak": "peak pressure",
            "radius": "contact radius",
        }.get(quantity, quantity)
        ax.set(
            title=names[case],
            xlabel="displacement unknowns [-]",
            ylabel=f"error of the {what}, relative [-]",
        )
        ax.set_xlim(7e2, 7e4)
        if (case, quantity) in (("sphere", "peak"), ("sphere 3D", "traction")):
            ax.legend(frameon=False, fontsize=8)
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
    for case in ("sphere", "sphere 3D"):
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


TEXT = """Which elements should you take? A rigid sphere and a rigid flat disc press on a
half-space without friction, with E = 5 MPa and nu = .3. The scenes are axisymmetric or in 3D.
The axisymmetric body is 3,000 contact radii large. Its finite size changes the approach, by
{size:.3f} % on the disc. A body ten times as large shows this, and the change is taken out. The
body in 3D is a quarter model of 20 contact radii, and its approach is not compared.

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

**Measured orders** in 1/n, between the two finest meshes. What orders can be expected? Where
contact ends by itself, the displacement has 3/2 derivatives in the energy norm. Then the approach
can gain the order 2 at degree 1, and at most 3 at degree 2. The tractions can gain 1 in L2 at both
degrees. At the edge of the disc the displacement has 1/2 of a derivative. On even elements this
gives the order 1 of the approach at any degree. On graded ones the order is 2 at degree 1. At
degree 2 the displacement allows 4, but the piecewise linear tractions of the dual basis promise 3
only. At degree 1 the peak is that of the node next to the axis, where linear elements of a ring are
poor. Where an error changes its sign, a slope means nothing.

{orders}

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
    effect = size_effect()
    rows = [without_size(row, effect) for row in runs(across)]
    ripple = ripples(rows, across)
    tables = {"runs": rows, "cheapest": cheapest(rows), "orders": orders(rows), "ripple": ripple}
    text = TEXT.replace("{findings}", findings(rows, ripple)).replace(
        "{size:.3f}", f"{-100 * effect:.3f}"
    )
    write("elements", "Shape and degree of the elements", text, tables, {"errors": draw(rows)})


if __name__ == "__main__":
    main(QUICK if "--quick" in sys.argv else ACROSS)
