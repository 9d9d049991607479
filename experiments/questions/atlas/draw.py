"""Figures of the atlas, each from its tables: one finding, as wide as a column of a journal."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import LogLocator, NullLocator

from contactopt.figures.style import BLUE, LETTERS, ORANGE, paper_axes
from experiments.questions.atlas.frontiers import MULTIPLIERS
from experiments.questions.atlas.problems import FAILED, KNOBS
from experiments.questions.atlas.radii import ITERATIONS_OF

Row = dict[str, Any]
AXES = {
    "coupling": ("coupling of normal and tangential direction $b$", "friction coefficient"),
    "between": ("coupling between two contacts (1: that of the problem)", "friction coefficient"),
    "factor": ("penalty factor", "certificate"),
    "ratio": ("coupling of normal and tangential direction $b$", "ratio of the compliances"),
}  # fmt: skip
KINDS = {
    "none": "friction alone", "several": "several of these", "condition": "ill-conditioned",
    "dissimilar": "dissimilar contacts", "redundant": "rank-deficient",
    "unsymmetric": "unsymmetric", "weak": "weakly coupled contacts", "scale": "extreme units",
    "plate": "a plate", "start": "a bad start", "sparse": "sparse",
}  # fmt: skip


def frontier(rows: list[Row], word: str) -> Any:
    """Where a method begins to fail: predicted as a line, observed as points."""
    figure, (ax,) = paper_axes()
    columns = ("x", "predicted", "observed")
    x, predicted, seen = (np.array([row[key] for row in rows], float) for key in columns)
    axis = "ratio" if rows[0]["method"] == MULTIPLIERS else rows[0]["axis"]
    penalty = axis == "factor"
    ax.plot(x, predicted, color=BLUE, label="predicted")
    ax.plot(x, seen, "o", color=ORANGE, label="observed", ms=4, clip_on=False, zorder=5)
    ax.set(yscale="log", xlabel=AXES[axis][0], ylabel=AXES[axis][1])
    if penalty:
        ax.set(xscale="log")
        ax.axhline(FAILED, color="#666666", lw=0.8, ls="--")
        ax.fill_between(x, FAILED, 10 * predicted.max(), color=ORANGE, alpha=0.12, lw=0)
        ax.set_ylim(predicted.min() / 3, 10 * predicted.max())
        places = (0.7, 0.85, "fails"), (0.2, 0.12, "solves")
    else:
        low, high = predicted.min() / 2.5, predicted.max() * 2.5
        ax.fill_between(x, predicted, high, color=ORANGE, alpha=0.12, lw=0)
        ax.set_ylim(low, high)
        places = (0.55, 0.86, word), (0.5, 0.1, "solves")
        ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.yaxis.set_major_formatter("{x:,g}")
        ax.yaxis.set_minor_locator(NullLocator())
    ax.set_xlim(x.min(), x.max() * (1 if penalty else 1.01))
    for right, up, text in places:
        ax.text(right, up, text, transform=ax.transAxes, fontsize=LETTERS, ha="center")
    ax.legend(fontsize=LETTERS, frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(0, 1.0))
    return figure


def shares(tried: dict[str, int], failed: dict[str, int]) -> Any:
    """How many problems of each kind there are, and on which share of them a method failed."""
    figure, (ax,) = paper_axes()
    kinds = [kind for kind in KINDS if tried.get(kind)]
    share = np.array([100 * failed.get(kind, 0) / tried[kind] for kind in kinds])
    places = np.arange(len(kinds))[::-1]
    ax.barh(places, share, color=ORANGE, height=0.6)
    ax.set_yticks(places, [KINDS[kind] for kind in kinds])
    possible = np.array([300 / tried[kind] for kind in kinds])  # the rule of three, 95 %
    ax.barh(places, np.where(share > 0, 0.0, possible), color="#dddddd", height=0.6)
    ax.set_xlim(0, max(1.3 * share.max(), 1.6 * possible.max()))
    ax.set_xlabel("share of the problems on which it fails [%]")
    for place, value, kind in zip(places, np.where(share > 0, share, possible), kinds):
        text = f" {failed.get(kind, 0)} of {tried[kind]}"
        ax.text(value, place, text, va="center", fontsize=LETTERS)
    return figure


def agreement(rows: list[Row]) -> Any:
    """Observed over predicted thresholds on fresh seeds."""
    names = [name for name in ITERATIONS_OF if any(row["method"] == name for row in rows)]
    figure, (ax,) = paper_axes()
    for place, name in enumerate(reversed(names)):
        own = [row for row in rows if row["method"] == name]
        ratio = np.array([row["observed"] / row["predicted"] for row in own], float)
        colour = ORANGE if " " in name else BLUE
        ax.plot(ratio, np.full(len(ratio), place), "o", color=colour, ms=3, alpha=0.6, mew=0)
        hit = int(np.isfinite(ratio).sum())
        text = f"{hit} of {len(ratio)}"
        ax.text(1.053, place, text, color=colour, va="center", fontsize=LETTERS, clip_on=False)
    ax.axvspan(0.95, 1.05, color="#999999", alpha=0.12, lw=0)
    ax.text(1.053, len(names) - 0.35, "within 5 %", va="bottom", fontsize=LETTERS, clip_on=False)
    ax.axvline(1.0, color="#666666", lw=0.8)
    ax.set_yticks(range(len(names)), names[::-1])
    ax.set(xlim=(0.945, 1.05), xlabel="observed over predicted friction of failure")
    return figure


def overview(rows: list[Row]) -> Any:
    """Which kind of problem breaks which method."""
    names = list(dict.fromkeys(row["method"] for row in rows))
    kinds = [kind for kind in KINDS if kind == "none" or kind in KNOBS]
    share = np.full((len(names), len(kinds)), np.nan)
    for i, row in enumerate(rows):
        for j, kind in enumerate(kinds):
            if tried := row["tried"].get(kind):
                share[i, j] = row["failed"].get(kind, 0) / tried
    figure, (ax,) = paper_axes(height=0.14 * len(names) + 0.9)
    ax.imshow(100 * share, cmap="OrRd", vmin=0, vmax=50, aspect="auto")
    ax.set_xticks(range(len(kinds)), [KINDS[kind] for kind in kinds], rotation=60, ha="right")
    ax.set_yticks(range(len(names)), names)
    for i, j in zip(*np.nonzero(np.isfinite(share))):
        look = {"ha": "center", "va": "center", "fontsize": LETTERS}
        colour = "white" if share[i, j] > 0.35 else "black" if share[i, j] > 0 else "#999999"
        ax.text(j, i, f"{100 * share[i, j]:.0f}", color=colour, **look)
    ax.set_title("share of problems that fail [%]", fontsize=LETTERS)
    return figure
