"""What are the answers of the classics, and to how many digits?

`python -m experiments.questions.classics` measures all scenes, each in a process of its own;
with the names of scenes it measures those alone.
"""

from __future__ import annotations

import sys
from multiprocessing import get_context
from typing import Any

from matplotlib.figure import Figure

from contactopt.figures.style import COLOURS, MARKS, add_legend, paper_axes
from experiments.questions.classics.table import classics, measured
from experiments.report import markdown, merged, save, stored, write

NAME, TABLE, KEYS = "classics", "values", ("scene", "quantity")
DIGITS = 1e-5  # that count as five


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


def report(rows: list[dict[str, Any]]) -> None:
    agree = sum(row["apart over bars"] <= 1 for row in rows)
    five = sum(row["relative bar"] <= DIGITS and row["apart over bars"] <= 1 for row in rows)
    seconds = sum({row["scene"]: row["first CPU s"] + row["second CPU s"] for row in rows}.values())
    known = [row for row in rows if row["exact"] != ""]
    within = sum(abs(row["off exact"]) <= row["relative bar"] for row in known)
    found = (
        f"**Findings.** There are {len(rows)} values, and in {agree} of them the two ways agree"
        f" within the sum of their bars. {five} of these have a bar of at most {DIGITS:g} of the"
        f" value. An exact value is known for {len(known)}, and {within} lie within their bar of"
        f" it. All took {seconds:.0f} s of CPU.\n\n"
    )
    text = found + TEXT.replace("{small}", markdown(shown(rows)))
    write(NAME, "The classics, with error bars", text, {}, {"bars": draw(rows)})


TEXT = """

**How a value is found.** Each scene is solved on two sequences of meshes that share no mesh. The
first has displacements of degree 1, the second of degree 2. The meshes of a sequence are halved
everywhere, and the limit is extrapolated from the last three values. What that limit differs from
the one before is its bar. The value is the limit with the smaller bar. Its own bar here is that
one, or the difference of the two limits if this is larger. `values.csv` has the
limits, orders, unknowns and seconds of both ways.

{small}

**The scenes.** `experiments/questions/classics/table.py` says them in full. The blocks have E = 1,
nu = .3, height 1 and half-width 1 (2 and 2 for flat punches), no friction, and they rest on a
frictionless base; the thin layer is .1 high and 1 wide on each side. Forces of plane scenes are per
length. Cylinder and sphere on them have radius 1, the cone has slope 1/2. The ball in the rigid cup
has radius 1 in one of radius 1.1. The NAFEMS roller is a steel cylinder of radius 50 mm on an
aluminium block of 200 by 200 mm under 35 kN / mm (Konter 2006, Advanced Finite Element Contact
Benchmarks, NAFEMS), here without friction and loaded by a plate that does not tilt.

**What is exact.** Spence's stick share of a rigid flat punch, Lame's press fit, Cattaneo's stick
share, and the receding layer: a layer without weight on a rigid base lifts off beyond a half-width
that does not depend on the load (after Keer, Dundurs, Tsai 1972). Its integral equation is solved
in `receding_layer.py`. The blocks of Spence and Cattaneo are finite, which the exact values are
not.

**Where digits are missing.** Widths are read from the pressure next to the edge, and they are the
least certain quantity. The receding layer is the worst: so little pressure is left next to the edge
that the reading is of first order. The stick share next to a corner comes next. Approaches and
peaks of smooth contacts have second order, and give five digits or six.
"""


if __name__ == "__main__":
    names = [classic.name for classic in classics()]
    chosen = [names.index(name) for name in sys.argv[1:]] or list(range(len(names)))
    with get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        for rows in pool.imap(measured, chosen):
            save(NAME, TABLE, merged(NAME, TABLE, rows, KEYS))
            print(shown(rows), flush=True)
    report(stored(NAME, TABLE))
