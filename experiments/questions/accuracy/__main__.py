"""What does accuracy cost, and do the error estimates hold? Everything against exact solutions."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt.figures.style import GREY, MARKS, add_legend, paper_axes
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
from experiments.report import Tables, measure, template


def draw_effectivity(tables: Tables) -> dict[str, Any]:
    figure, (ax,) = paper_axes(height=3.0)
    for quantity, mark in zip(("pressure", "width", "approach", "energy", "stick"), MARKS):
        chosen = [row for row in tables["effectivity"] if row["quantity"] == quantity]
        true = [abs(float(row["true error"])) for row in chosen]
        ax.loglog(true, [row["estimate"] for row in chosen], mark, mfc="white", label=quantity)
    ends = np.array([5e-5, 2e-2])
    look = {"color": GREY, "alpha": 0.15, "lw": 0, "label": "effectivity .5 to 4"}
    ax.fill_between(ends, ends / 2, 4 * ends, **look)
    ax.loglog(ends, ends, color=GREY, lw=0.8)
    ax.set(xlabel="true relative error [-]", ylabel="estimated relative error [-]")
    add_legend(ax)
    return {"effectivity": figure}


def text(tables: Tables) -> str:
    values = [row["effectivity"] for row in tables["effectivity"]]
    inside = sum(0.5 <= value <= 4 for value in values)
    judged = (
        f"{inside} of {len(values)} lie between .5 and 4, the least is {min(values):.2f}, the"
        f" largest {max(values):.2f}"
    )
    return template(__file__).format(judged=judged, factor=tables["finite"][0]["C"])


if __name__ == "__main__":
    tables = {
        "effectivity": all_effectivities,
        "hertz": lambda: [hertz(name, n) for name in KINDS for n in (SMALL, MODEST)],
        "stick": lambda: [stick(kind, mu) for kind in KINDS.values() for mu in FRICTION],
        "locking": lambda: [locking(nu, mu) for nu, mu in LOCKING],
        "cattaneo": lambda: [sheared(dim, shear) for dim, own in SHEARS.items() for shear in own],
        "finite": finite_sizes,
    }
    measure("accuracy", "Accuracy and what it costs", text, tables, draw_effectivity)
