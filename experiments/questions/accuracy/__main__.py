"""What does accuracy cost, and do the error estimates hold? Everything against exact solutions."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from contactopt.figures.plots import BLUE, GREEN, GREY, ORANGE
from experiments.questions.accuracy.corner_orders import CASES, GRADED, UNIFORM, orders
from experiments.questions.accuracy.measured import (
    FRICTION,
    KINDS,
    LOCKING,
    MODEST,
    SMALL,
    all_effectivities,
    cattaneo,
    finite_sizes,
    hertz,
    locking,
    parsimony,
    sphere,
    stick,
)
from experiments.report import write

STYLES = (("o-", BLUE), ("o--", GREY), ("s-", ORANGE), ("s--", GREEN))


def draw_parsimony(curves: dict[str, dict[str, list[dict[str, float]]]]) -> Figure:
    figure = Figure(figsize=(11, 7.4), layout="constrained")
    for row, quantity in zip(figure.subplots(2, 3), ("pressure", "width")):
        panels: list[tuple[str, str]] = [("point", "unknowns"), ("line", "unknowns"), ("point", "seconds")]
        for ax, (name, x) in zip(row, panels):
            for (label, rows), (style, colour) in zip(curves[name].items(), STYLES):
                ax.loglog(
                    [r[x] for r in rows], [r[quantity] for r in rows], style, color=colour, label=label, mfc="white"
                )
            ax.set(title=f"Hertz, {name}", ylabel=f"relative error of the {quantity} [-]")
            ax.set_xlabel("displacement unknowns [-]" if x == "unknowns" else "time [s]")
    figure.axes[0].legend(frameon=False, fontsize=8)
    return figure


def draw_orders(errors: dict[str, dict[str, np.ndarray]]) -> Figure:
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    ax = figure.subplots()
    for (name, found), colour in zip(errors.items(), (BLUE, ORANGE, GREEN)):
        ax.loglog(UNIFORM, found["uniform"], "o-", color=colour, mfc="white", label=f"{name}, uniform")
        ax.loglog(GRADED[:-1], found["graded"], "s--", color=colour, mfc="white", label=f"{name}, graded")
    ax.set(xlabel="elements across the half-width n [-]", ylabel="error of the approach [length, unit force]")
    ax.legend(frameon=False, fontsize=8)
    return figure


def draw_effectivity(rows: list[dict[str, object]]) -> Figure:
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    ax = figure.subplots()
    styles = dict(zip(("pressure", "width", "approach", "energy", "stick"), "os^vD"))
    for (quantity, marker), colour in zip(styles.items(), (BLUE, ORANGE, GREEN, GREY, "black")):
        chosen = [row for row in rows if row["quantity"] == quantity]
        true = [abs(float(row["true error"])) for row in chosen]  # type: ignore[arg-type]
        ax.loglog(true, [row["estimate"] for row in chosen], marker, color=colour, mfc="white", label=quantity)
    ends = np.array([5e-5, 2e-2])
    ax.fill_between(ends, ends / 2, 4 * ends, color=GREY, alpha=0.15, lw=0, label="effectivity .5 to 4")
    ax.loglog(ends, ends, color=GREY, lw=1)
    ax.set(xlabel="true relative error [-]", ylabel="estimated relative error [-]")
    ax.legend(frameon=False, fontsize=8)
    return figure


def judged(rows: list[dict[str, object]]) -> str:
    values = [float(row["effectivity"]) for row in rows]  # type: ignore[arg-type]
    inside = sum(0.5 <= value <= 4 for value in values)
    return (
        f"{inside} of {len(values)} lie between .5 and 4, the least is {min(values):.2f}, the largest {max(values):.2f}"
    )


TEXT = """Errors are relative to exact solutions (`contactopt.analytic`) unless a unit is given.

## Accuracy asked for: `run(scene, accuracy=..., quantity=...)`

Nested solves, warm-started, until the estimated error is below the target. Effectivity is the estimate over
the true error: {judged}.
`extrapolated` is the error left after the estimated one is taken off. The rigid indenters (`hertz-*`) and
punches (`flat-*`) press on blocks 10,000 half-widths large, so that only discretisation errors remain; `rigid-punch-*` are
the named scenes. Rows: the run that a target led to; a stricter target that was met at once is named instead. Where a target
was not reached, the next mesh would have had more than 400,000 unknowns. The edge of stick lies between nodes: read from the
nodes next to it, it jumps by a fraction of an element from mesh to mesh, and estimates were up to twenty times the error;
read from the slack and the slip an element further, on both sides of it, its error falls smoothly enough.
The difference of the two readings is the least estimate: where the stick zone is a few nodes wide (mu = .1 in the plane)
it is all of it.

{{effectivity}}

The pressure of a flat punch is infinite at its edge: asked for, it is refused after one solve in these words: "the largest
pressure is at the edge of the contact surface, a corner, where no mesh bounds it". Every other quantity of a corner converges; one that
does not is given up when two refinements in a row change it by as much as the one before.

## Hertz within .1 % on less than 5,000 unknowns

Half-space of 100 half-widths, graded by h_next / h = exp((2.8 / n) min(1 + r/a, 100)^.3), zone loop on. The peak is that of a
polynomial in the coordinates through p^2, weighted by areas, over half of the contact. The node on the axis reads low because the
hoop strain u_r / r is poorly resolved in the first ring, an error of that ring alone; its area is next to nothing and
so is its weight.

{{hertz}}

The named scene `sphere` (finite bodies, 400 mm, a / R = .055), peak pressure to 1 %: all solves with meshing and assembly, {sphere:.2f} s together.

{{sphere}}

Figure `parsimony`: grading and zone loop on and off; fastest of three runs. Uniform blocks are 12 half-widths large, all they can afford: their size is the
error that stays. Without the loop a zone 1.25 times too wide is meshed.

## Rigid punch with Coulomb friction

The named scenes at their defaults, against the coupled exact values; absolute error of c / a.

{{stick}}

Near nu = .5 linear elements lock, and friction depends on what is left of compressibility (Dundurs' beta): the same punch with linear
displacements, all elements halved.

{{locking}}

## Cattaneo and Mindlin

From `python -m experiments.questions.cattaneo` (nu = 0 in 3D).

{{cattaneo}}

## Orders of convergence

An elastic square punch on a body of its own material; exponents from `contactopt.analytic.corner`. Orders are means over the two finest
halvings (uniform) or the finest (graded: nodes at (i/n)^{grading} from the corner). On symmetric problems the approach
under a given force errs by the square of the energy norm, which is how the norm on graded meshes is read. With friction the
problem is not symmetric: the dual problem slips the other way, so that the force should converge with the exponent of mu plus that of
-mu once the meshes are fine enough; the theory column has twice the exponent of mu.

{{orders}}

## A block for a half-space

Deviation from a block of 10,000 half-widths on meshes alike ({size_elements} elements across the half-width); c / a of a flat strip,
mu = .3, absolute. Pressure and width of round contacts need 100 half-widths for 1e-4, c / a of a strip 10,000: a clamped block holds back the sideways
displacement by a strain of order a / size. With growth that rises outwards ten times the size costs a few rows of elements.
The approach of a point contact lacks C force / (E* size) with C = {factor:.3f} for a clamped square block, nu = .3, whatever presses on it (from
the size of 100, applied to the others: last but one column, error against Hertz). In plane strain the approach has no limit. The rule: 10,000 half-widths,
or 100 where only pressure and width are asked for.

{{finite}}
"""


def main() -> None:
    curves = {name: parsimony(kind) for name, kind in KINDS.items()}
    table = [hertz(name, elements) for name in KINDS for elements in (SMALL, MODEST)]
    spheres = sphere()
    effective = all_effectivities()
    found = {name: orders(name) for name in CASES}
    sizes, factor = finite_sizes()
    columns = ("contact", "mesh", "error", "order", "theory", "difference")
    text = TEXT.format(
        judged=judged(effective),
        sphere=sum(float(row["seconds"]) for row in spheres),  # type: ignore[arg-type]
        grading=2.5,
        size_elements=32,
        factor=factor,
    )
    tables = {
        "effectivity": effective,
        "hertz": table,
        "sphere": spheres,
        "stick": [stick(kind, mu) for kind in KINDS.values() for mu in FRICTION],
        "locking": [locking(nu, mu) for nu, mu in LOCKING],
        "cattaneo": cattaneo(),
        "orders": [{key: row[key] for key in columns} for rows, _ in found.values() for row in rows],
        "finite": sizes,
    }
    figures = {
        "effectivity": draw_effectivity(effective),
        "parsimony": draw_parsimony(curves),
        "orders": draw_orders({name: errors for name, (_, errors) in found.items()}),
    }
    write("accuracy", "Accuracy and what it costs", text, tables, figures, page="{name}.md")


if __name__ == "__main__":
    main()
