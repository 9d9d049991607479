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
from experiments.report import figures_alone, save_figures, stored, template, write


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


TEXT = template(__file__)


def main() -> None:
    if figures_alone():
        drawn = {"effectivity": draw_effectivity(stored("accuracy", "effectivity"))}
        return save_figures("accuracy", drawn)
    table = [hertz(name, elements) for name in KINDS for elements in (SMALL, MODEST)]
    effective = all_effectivities()
    sizes, factor = finite_sizes()
    text = TEXT.format(
        judged=judged(effective),
        size_elements=32,
        factor=factor,
    )
    tables = {
        "effectivity": effective,
        "hertz": table,
        "stick": [stick(kind, mu) for kind in KINDS.values() for mu in FRICTION],
        "locking": [locking(nu, mu) for nu, mu in LOCKING],
        "cattaneo": [sheared(dim, shear) for dim, shears in SHEARS.items() for shear in shears],
        "finite": sizes,
    }
    figures = {"effectivity": draw_effectivity(effective)}
    write("accuracy", "Accuracy and what it costs", text, tables, figures)


if __name__ == "__main__":
    main()
