"""What does accuracy cost, and do the error estimates hold? Everything against exact solutions."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt.benchmark.figure_style import set_ticks
from contactopt.figures.style import GREY, MARKS, add_legend, draw_lines, paper_axes, symbols
from experiments.questions.accuracy.corner_orders import CASES, GRADED, UNIFORM, orders
from experiments.questions.accuracy.measured import (
    FRICTION,
    KINDS,
    LOCKING,
    MODEST,
    SMALL,
    all_effectivities,
    finite_sizes,
    hertz,
    locking,
    stick,
)
from experiments.questions.accuracy.sheared import SHEARS, sheared
from experiments.report import figures_alone, save_figures, stored, write


def draw_orders(errors: dict[str, dict[str, np.ndarray]]) -> Any:
    figure, (ax,) = paper_axes()
    lines = []
    for mesh, n in (("uniform", UNIFORM), ("graded", GRADED[:-1])):
        lines += [(symbols(f"{name}, {mesh}"), n, found[mesh]) for name, found in errors.items()]
    draw_lines(ax, lines, ["o-"] * len(errors) + ["s--"] * len(errors))
    set_ticks(ax.xaxis)
    ax.set(
        xlabel="elements across the half-width $n$ [-]",
        ylabel="error of the approach [length], unit force",
    )
    return figure


def draw_effectivity(rows: list[dict[str, Any]]) -> Any:
    figure, (ax,) = paper_axes(height=3.0)
    for quantity, mark in zip(("pressure", "width", "approach", "energy", "stick"), MARKS):
        chosen = [row for row in rows if row["quantity"] == quantity]
        true = [abs(float(row["true error"])) for row in chosen]
        ax.loglog(true, [row["estimate"] for row in chosen], mark, mfc="white", label=quantity)
    ends = np.array([5e-5, 2e-2])
    look = {"color": GREY, "alpha": 0.15, "lw": 0, "label": "effectivity .5 to 4"}
    ax.fill_between(ends, ends / 2, 4 * ends, **look)
    ax.loglog(ends, ends, color=GREY, lw=0.8)
    ax.set(xlabel="true relative error [-]", ylabel="estimated relative error [-]")
    add_legend(ax)
    return figure


def judged(rows: list[dict[str, object]]) -> str:
    values = [float(row["effectivity"]) for row in rows]  # type: ignore[arg-type]
    inside = sum(0.5 <= value <= 4 for value in values)
    return (
        f"{inside} of {len(values)} lie between .5 and 4, the least is {min(values):.2f}, the"
        f" largest {max(values):.2f}"
    )


TEXT = """How accurate are the answers, and are the estimated errors honest? Errors are relative to
exact solutions (`contactopt.analytic`), unless a unit is given. `a` is the half-width or radius of
the contact, `c` is that of the stick zone, and `p` is the pressure.

## Accuracy asked for: `run(scene, accuracy=..., quantity=...)`

contactopt solves on finer and finer meshes, and starts each solve from the last answer. It ends
when the estimated error is below the target. The *effectivity* is the estimated error over the true
error: {judged}. `extrapolated` is the error that is left if the estimated error is taken off.

The rigid indenters (`hertz-*`) and punches (`flat-*`) press on blocks that are 10,000 half-widths
large, so that only errors of the mesh remain. `rigid-punch-*` are the named scenes. A row is the
run to which a target led. If a stricter target was met by the same run, it is named instead. If a
target was not reached, the next mesh would have had more than 400,000 unknowns.

The edge of the stick zone lies between nodes. If it is read from the nodes next to it, it jumps by
a fraction of an element from mesh to mesh, and the estimates were up to twenty times the error.
Therefore it is read from the slack and the slip one element further away, on both sides of it. Then
its error falls smoothly enough. The estimate is at least the difference of the two readings. If the
stick zone is only a few nodes wide (mu = .1 in the plane), the estimate is this difference alone.

{{effectivity}}

The pressure of a flat punch is infinite at its edge. If it is asked for, contactopt refuses it
after one solve, in these words: "the largest pressure is at the edge of the contact surface, a
corner, where no mesh bounds it". Every other quantity of a corner converges. A quantity that does
not converge is given up when two refinements in a row change it by as much as the one before.

## Hertz within .1 % on less than 5,000 unknowns

The half-space is 100 half-widths large. Its mesh grows by h_next / h = exp((2.8 / n) min(1 + r/a,
100)^.3), and the zone loop, which puts a node on the edge of the contact, is on. The peak is that
of a polynomial in the coordinates, fitted to p^2 over half of the contact with the areas as
weights. The pressure at the node on the axis is too low, because the hoop strain u_r / r is poorly
resolved in the first ring. This error is that of one ring alone. Its area is next to nothing, and
so is its weight.

{{hertz}}

## Rigid punch with Coulomb friction

The named scenes at their defaults are compared with the exact values of the coupled problem. The
error of c / a is absolute.

{{stick}}

If nu comes near .5, linear elements lock. Friction then depends on what is left of the
compressibility (Dundurs' beta). The next table has the same punch with linear displacements, and
all elements halved.

{{locking}}

## Cattaneo and Mindlin

Two bodies of one material are pressed together and sheared to and fro by T (nu = .3 in the plane
and 0 in 3D). The table has the state at +T after a whole cycle, node by node, and the energy that
the cycle costs.

{{cattaneo}}

## Orders of convergence

An elastic square punch is pressed on a body of its own material. The exponents of the stress at its
corner come from `contactopt.analytic.corner`. The orders are means over the two finest halvings of
uniform meshes, or over the finest halving of graded ones (nodes at (i/n)^{grading} from the
corner).

On symmetric problems the error of the approach under a given force is the square of the error in
the energy norm. The norm on graded meshes is read in this way. With friction the problem is not
symmetric, because the dual problem slips the other way. Once the meshes are fine enough, the force
should converge with the sum of the exponents of mu and of -mu. The column of the theory has twice
the exponent of mu.

{{orders}}

## A block for a half-space

How large must a block be to stand for a half-space? The table has the deviation from a block of
10,000 half-widths with a similar mesh ({size_elements} elements across the half-width). For a flat
strip it has the absolute deviation of c / a, with mu = .3.

The pressure and the width of round contacts need 100 half-widths for 1e-4. The ratio c / a of a
strip needs 10,000, because a clamped block holds back the sideways displacement by a strain of
order a / size. If the elements grow outwards, ten times the size costs a few more rows of elements.

The approach of a point contact is too small by C force / (E* size). For a clamped square block with
nu = .3 this constant is C = {factor:.3f}, whatever presses on it. (It was found from the size of
100 and applied to the other sizes. The last column but one has the error against Hertz that
remains.) In plane strain the approach has no limit. The rule is to take 10,000 half-widths, or 100
if only pressure and width are asked for.

{{finite}}
"""


def main() -> None:
    if figures_alone():
        errors = {name: orders(name)[1] for name in CASES}
        drawn = {"effectivity": draw_effectivity(stored("accuracy", "effectivity"))}
        return save_figures("accuracy", drawn | {"orders": draw_orders(errors)})
    table = [hertz(name, elements) for name in KINDS for elements in (SMALL, MODEST)]
    effective = all_effectivities()
    found = {name: orders(name) for name in CASES}
    sizes, factor = finite_sizes()
    columns = ("contact", "mesh", "error", "order", "theory", "difference")
    text = TEXT.format(
        judged=judged(effective),
        grading=2.5,
        size_elements=32,
        factor=factor,
    )
    tables = {
        "effectivity": effective,
        "hertz": table,
        "stick": [stick(kind, mu) for kind in KINDS.values() for mu in FRICTION],
        "locking": [locking(nu, mu) for nu, mu in LOCKING],
        "cattaneo": [sheared(dim, shear) for dim, shears in SHEARS.items() for shear in shears],
        "orders": [
            {key: row[key] for key in columns} for rows, _ in found.values() for row in rows
        ],
        "finite": sizes,
    }
    figures = {
        "effectivity": draw_effectivity(effective),
        "orders": draw_orders({name: errors for name, (_, errors) in found.items()}),
    }
    write("accuracy", "Accuracy and what it costs", text, tables, figures)


if __name__ == "__main__":
    main()
