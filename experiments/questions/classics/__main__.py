"""What are the answers of the classics, and to how many digits?

`python -m experiments.questions.classics` measures all scenes, each in a process of its own;
with the names of scenes it measures those alone. The second table has named scenes of contactopt
on the meshes that they have by default.
"""

from __future__ import annotations

import sys
from multiprocessing import get_context
from typing import Any

from matplotlib.figure import Figure

from contactopt.figures.style import COLOURS, MARKS, add_legend, paper_axes
from experiments.questions.classics.defaults import NAMED, defaults_of
from experiments.questions.classics.table import classics, measured
from experiments.report import markdown, merged, save, stored, write

NAME, TABLE, NAMES, KEYS = "classics", "values", "defaults", ("scene", "quantity")
DIGITS = 1e-5  # that count as five
YES, JUDGED = ("yes",), ("yes", "no")


def shown(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The small table: values with their digits."""
    return [
        {
            "scene": row["scene"],
            "quantity": row["quantity"],
            "value": f"{row['value']:.8g}",
            "relative bar": f"{row['relative bar']:.1e}",
            "agree": "yes" if row["apart over bars"] <= 1 else "no",
            "off exact": "" if row["off exact"] == "" else f"{row['off exact']:.1e}",
        }
        for row in rows
    ]


def draw(rows: list[dict[str, Any]]) -> Figure:
    figure, (ax,) = paper_axes(wide=True, height=0.13 * len(rows) + 0.6)
    names = [f"{row['scene']}, {row['quantity']}" for row in rows]
    for number, (name, label) in enumerate((("first", "degree 1"), ("second", "degree 2"))):
        own = [row[f"{name} bar"] for row in rows]
        ax.semilogx(own, names, MARKS[number], color=COLOURS[number], label=f"bar of {label}")
    apart = [max(abs(row["first limit"] / row["second limit"] - 1), 1e-8) for row in rows]
    ax.semilogx(apart, names, "|", color="black", ms=8, label="difference of the two")
    ax.axvline(DIGITS, color="#bbbbbb", lw=0.8)
    ax.invert_yaxis()
    ax.set(xlabel="share of the value [-]")
    add_legend(ax)
    return figure


def named(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The small table of named scenes."""
    return [
        {
            "scene": row["scene"],
            "quantity": row["quantity"],
            "unknowns": row["unknowns"],
            "default": f"{row['default']:.6g}",
            "off": f"{row['off']:.1e}",
            "bar of the limit": f"{row['bar']:.1e}" if row["bar"] else "exact",
            "asked": f"{row['asked']:g}",
            "within": row["within"],
        }
        for row in rows
    ]


def report(rows: list[dict[str, Any]], defaults: list[dict[str, Any]]) -> None:
    agree = sum(row["apart over bars"] <= 1 for row in rows)
    five = sum(row["relative bar"] <= DIGITS and row["apart over bars"] <= 1 for row in rows)
    seconds = sum({row["scene"]: row["first CPU s"] + row["second CPU s"] for row in rows}.values())
    apart = [f"{row['scene']} ({row['quantity']})" for row in rows if row["apart over bars"] > 1]
    known = [row for row in rows if row["exact"] != ""]
    within = sum(abs(row["off exact"]) <= row["relative bar"] for row in known)
    good, judged = (sum(row["within"] in kinds for row in defaults) for kinds in (YES, JUDGED))
    found = (
        f"**Findings.** There are {len(rows)} values, and in {agree} of them the two ways agree"
        f" within the sum of their bars (not: {', '.join(apart) or 'none'}). {five} of these"
        f" have a bar of at most {DIGITS:g} of the"
        f" value. An exact value is known for {len(known)}, and {within} lie within their bar of"
        f" it. All took {seconds:.0f} s of CPU. On their default meshes, named scenes are within"
        f" .1 % for forces and pressures, and .2 % for widths, in {good} of {judged} quantities"
        " whose true value is known well enough to tell.\n\n"
    )
    text = found + TEXT.replace("{small}", markdown(shown(rows)))
    text = text.replace("{named}", markdown(named(defaults)))
    write(NAME, "The classics, with error bars", text, {}, {"bars": draw(rows)})


TEXT = """

**How a value is found.** Each scene is solved on two sequences of meshes that share no mesh. The
first has displacements of degree 1, the second of degree 2. The meshes of a sequence are halved
everywhere, and the limit is extrapolated from the last three values. The bar of a limit is its
difference from the previous limit, and at least half of its difference from the last value. The
reported value is the limit with the smaller bar. The reported bar is that bar, or the difference
of the two limits if this is larger. `values.csv` has the limits, orders, unknowns and seconds of
both ways.

{small}

**The scenes.** `experiments/questions/classics/table.py` says them in full. The blocks have E = 1,
nu = .3, height 1 and half-width 1 (2 and 2 for flat punches), no friction, and they rest on a
frictionless base. Forces of plane scenes are per length. Cylinder and sphere on them have radius 1,
the cone has slope 1/2. The layers have height 1 and half-width 30, and the cylinder on them has
radius 10. The bonded layer is clamped below. The coated layer is bonded to one of height 3, whose
modulus is a fifth, on a frictionless base. The ball in the rigid cup has radius 1 in one of radius
1.1.

Two scenes follow the drawings of NAFEMS (Konter 2006, Advanced Finite Element Contact Benchmarks),
here without friction. The roller is a steel cylinder of radius 50 mm on an aluminium block of 200
by 200 mm under 35 kN / mm, loaded by a plate that does not tilt. The rounded punch is of steel. It
has diameter and height 100 mm and a fillet of 10 mm at its edge. A pressure of 100 MPa on its top
presses it on an aluminium block of diameter and height 200 mm. NAFEMS clamps this block below.

**What is exact.** Exact values are known for Spence's stick share of a rigid flat punch, Lame's
press fit and Cattaneo's stick share. The contact of layers follows from integral equations, which
are solved in `zone_equation.py`. A layer without weight on a rigid base lifts off beyond a
half-width that does not depend on the load (after Keer, Dundurs, Tsai 1972). A cylinder on layers
needs their compliance over the wave number, which `layered.py` has. A bulk tension in one of
Cattaneo's cylinders, at the same time as the shear, moves the zone of stick by .3 of the
half-width and leaves its size (Hills, Nowell 1994, Mechanics of Fretting Fatigue). The resultant
of friction moves to the other side. The blocks of Spence and Cattaneo are finite, but the exact
values are those of infinite bodies.

**Where digits are missing.** Widths are read from the pressure next to the edge, and they are the
least certain quantity. The stick share next to a corner has the fewest digits. Approaches have
second order and give five digits or six, and so do peaks in the middle of a smooth contact. The
peak under the punch x^4 is off the middle, and between two nodes.

**How a width is read.** Fit a parabola to p^2 as a function of x^2: its zero is exact for the
pressure of Hertz. Under the punch x^4 this zero stays more than 1 % too far out on the meshes of
both sequences. Therefore the product of a root and a polynomial is fitted to the pressure, over the
share of the half-width with the smallest standard error. This fit has no such limit. Where linear
elements grow or shrink, the force of a node over its area is the traction at a place beside the
node, and is read there. `tests/test_edges.py` has the pressures.

**Named scenes on their default meshes.** The true value is exact, or it is the limit of three
meshes of degree 2. A quantity is judged where the bar of that limit is at most half of what is
asked. The peak of `sphere` and of `cylinder-2d` does not depend on the number of elements across
the contact: its error comes from the elements farther away, whose growth is fixed.

{named}
"""


if __name__ == "__main__":
    names = [classic.name for classic in classics()]
    asked = sys.argv[1:] or [*names, *NAMED]
    chosen = [names.index(name) for name in asked if name in names]
    with get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for rows in pool.imap(measured, chosen):
            save(NAME, TABLE, merged(NAME, TABLE, rows, KEYS))
            print(shown(rows), flush=True)
        for rows in pool.imap(defaults_of, [name for name in asked if name in NAMED]):
            save(NAME, NAMES, merged(NAME, NAMES, rows, KEYS))
            print(named(rows), flush=True)
    report(stored(NAME, TABLE), stored(NAME, NAMES))
