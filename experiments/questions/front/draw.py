"""The figures of the report, one finding each, from its tables."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from contactopt.figures.style import (
    COLOURS,
    GREY,
    LETTERS,
    MARKS,
    label_ends,
    paper_axes,
)
from experiments.questions.front.measured import TIGHT, Row

ACCURACIES = (0.1, 0.03, 0.01, 0.003, 0.001)
ASKED = {  # scene -> the quantity that is asked of it
    "Hertz, line": "peak",
    "Hertz, point": "peak",
    "Hertz, ellipse": "peak",
    "Cattaneo": "stick",
    "Spence, disc": "stick",
    "flat punch, disc": "approach",
    "press fit": "peak",
    "rough surface": "area",
}
SHORT = {"half-space": "½", "small body": "B", "associated": "A", "mu = .3": "F"}
SHORT |= {"solid": "S", "linear": "L", "quadratic": "Q", "uniform": "U", "Gauss": "G"}
KEY = (
    "½ half-space   L, Q linear, quadratic   S solid\n"
    "B small body   A associated   F friction added\n"
    "G Gauss-Seidel   number: elements or points"
)
KINDS = ("model", "mesh", "reading", "tolerance")
TOLD = ("half-space", "linear", "quadratic", "small body", "mu = .3", "uniform")


def cheapest(rows: list[Row], scene: str, accuracy: float, meshed: bool = False) -> Row | None:
    """The run with the fewest seconds that has an accuracy, and whose finer meshes have it too:
    where an error changes its sign one mesh has any accuracy, by luck. With a mesh only if
    `meshed`.
    """
    quantity, ways = ASKED[scene], defaultdict(list)
    for row in rows:
        if row["scene"] == scene and not (meshed and "half-space" in row["model"]):
            ways[row["model"], row["tolerance"], row["reading"]].append(row)
    good = []
    for own in ways.values():
        for row in sorted(own, key=lambda row: -row["mesh"]):
            if not abs(row[quantity]) <= accuracy:
                break
            good.append(row)
    return min(good, key=lambda row: row["cpu"], default=None)


def front(rows: list[Row]) -> list[Row]:
    """The cheapest way to each accuracy, with half-spaces and with meshes alone."""
    made = []
    for scene, quantity in ASKED.items():
        for meshed in (False, True):
            for accuracy in ACCURACIES:
                row = cheapest(rows, scene, accuracy, meshed)
                if row is None:
                    continue
                made.append(
                    {"scene": scene, "quantity": quantity, "accuracy": accuracy}
                    | {"with": "meshes" if meshed else "all models"}
                    | {key: row[key] for key in ("model", "mesh", "tolerance", "reading", "cpu")}
                    | {"error": row[quantity]}
                )
    return made


def letter(model: str) -> str:
    """The short name of a model, in brackets where it is wrong."""
    return next((sign for word, sign in SHORT.items() if word in model), model[:1])


def draw_front(made: list[Row]) -> Any:
    """Seconds of the cheapest way to each accuracy, as a table of colours."""
    figure, (top, bottom) = paper_axes(rows=2, height=1.75)
    scenes = [scene for scene in ASKED if any(row["scene"] == scene for row in made)]
    for ax, name in ((top, "all models"), (bottom, "meshes alone")):
        grid = np.full((len(scenes), len(ACCURACIES)), np.nan)
        for row in made:
            if row["with"] not in name:
                continue
            at = scenes.index(row["scene"]), ACCURACIES.index(row["accuracy"])
            grid[at] = np.log10(row["cpu"])
            text = f"{letter(row['model'])}{row['mesh']}"
            dark = "w" if grid[at] > -0.9 else "k"
            ax.text(*at[::-1], text, ha="center", va="center", fontsize=LETTERS, color=dark)
        drawn = ax.imshow(grid, cmap="viridis_r", vmin=-2, vmax=0.5, aspect="auto")
        ax.set_xticks(range(len(ACCURACIES)), ["10", "3", "1", ".3", ".1"])
        ax.set_yticks(range(len(scenes)), scenes)
        ax.set_title(name, fontsize=LETTERS)
        ax.spines[:].set_visible(False)
    bottom.set_xlabel("accuracy [%]")
    bar = figure.colorbar(drawn, ax=[top, bottom], location="bottom", shrink=0.7, pad=0.02)
    bar.set_ticks([-2, -1, 0], labels=["0.01", "0.1", "1"])
    bar.ax.tick_params(labelsize=LETTERS)
    bar.set_label("CPU time [s]", fontsize=LETTERS)
    figure.suptitle(KEY, fontsize=LETTERS)
    return figure


def draw_line(rows: list[Row], peers: list[Row]) -> Any:
    """Error of the peak over the time: Hertz's contact along a line, in all models and codes."""
    figure, (ax,) = paper_axes()
    own = [r for r in rows if r["scene"] == "Hertz, line" and r["tolerance"] == TIGHT]
    own = [r for r in own if r["reading"] == "fitted"]
    ends = []
    for number, word in enumerate(TOLD):
        x, y = np.array([(r["cpu"], abs(r["peak"])) for r in own if word in r["model"]]).T
        wrong = word in ("small body", "mu = .3")
        name = {"small body": "body too small", "mu = .3": "friction added"}.get(word, word)
        colour = GREY if wrong else COLOURS[number]
        ax.loglog(
            x,
            y,
            MARKS[number] + ("--" if wrong else "-"),
            color=colour,
            mfc="white" if wrong else colour,
        )
        ends.append((x[-1], y[-1], name, colour))
    for code, mark in (("CalculiX", "P"), ("GetFEM", "X")):
        x, y = np.array([(r["cpu"], abs(r["peak"])) for r in peers if r["model"] == code]).T
        ax.loglog(x, y, mark + ":", color="k", mfc="w", lw=0.6)
        ends.append((x[-1], y[-1], code, "k"))
    ax.axhline(0.01, color=GREY, lw=0.6, ls=":")
    ax.text(10, 0.011, "1 %", color=GREY, fontsize=LETTERS, ha="right", va="bottom")
    ax.set(xlabel="CPU time [s]", ylabel="error of the peak pressure [-]")
    label_ends(ax, ends)
    return figure


def draw_regions(rows: list[Row]) -> Any:
    """Which of four errors is the largest over mesh and tolerance."""
    figure, axes = paper_axes(columns=2, rows=2, height=1.5)
    colours = ListedColormap([COLOURS[7], COLOURS[5], COLOURS[4], "#bbbbbb"])
    panels = [(q, r) for q in ("peak", "width") for r in ("fitted", "nodes")]
    for ax, (quantity, reading) in zip(axes, panels):
        own = [r for r in rows if r["quantity"] == quantity and r["reading"] == reading]
        meshes, tolerances = (
            list(dict.fromkeys(r[key] for r in own)) for key in ("mesh", "tolerance")
        )
        parts = np.array([[abs(r[f"{kind} error"]) for kind in KINDS] for r in own])
        shape = len(meshes), len(tolerances)
        largest = parts.argmax(axis=1).reshape(shape)
        ax.imshow(largest.T, cmap=colours, vmin=-0.5, vmax=3.5, aspect="auto")
        total = np.array([abs(sum(r[f"{kind} error"] for kind in KINDS)) for r in own])
        for (i, j), value in np.ndenumerate(total.reshape(shape)):
            if i % 2 == 0:
                text = f"{100 * value:.2g}" if value < 0.1 else f"{100 * value:.0f}"
                text = text.removeprefix("0")
                dark = "w" if largest[i, j] == KINDS.index("model") else "k"
                ax.text(i, j, text, ha="center", va="center", fontsize=LETTERS, color=dark)
        words = {"fitted": "fitted", "nodes": "at nodes"}[reading]
        ax.set_title(f"{quantity}, {words}", fontsize=LETTERS)
        ax.set_xticks(range(0, len(meshes), 2), [str(m) for m in meshes[::2]])
        ax.set_yticks(range(len(tolerances)), [f"{t:.0e}".replace("e-0", "e-") for t in tolerances])
        ax.spines[:].set_visible(False)
    figure.supxlabel("elements across the half-width of contact", fontsize=LETTERS)
    for ax in axes[::2]:
        ax.set_ylabel("tolerance")
    signs = [Patch(color=colours(number), label=kind) for number, kind in enumerate(KINDS)]
    title = "colour: the largest error; number: all together [%]"
    figure.legend(
        handles=signs,
        ncols=4,
        title=title,
        title_fontsize=LETTERS,
        loc="outside upper center",
        fontsize=LETTERS,
        frameon=False,
    )
    return figure


def draw_rule(rows: list[Row]) -> Any:
    """The rule's error over what was asked, and its time over the best in hindsight."""
    figure, (ax,) = paper_axes()
    for row in rows:
        good = abs(row["rule error"]) <= row["accuracy"] and row["ratio"] <= 2
        x, y = row["ratio"], max(abs(row["rule error"]) / row["accuracy"], 1e-3)
        ax.loglog(x, y, "o" if good else "x", color=COLOURS[0] if good else COLOURS[1], ms=4)
        if not good:
            left_of = x < 1.05
            ax.annotate(
                row["scene"].partition(",")[0],
                (x, y),
                fontsize=LETTERS,
                color=COLOURS[1],
                xytext=(-4 if left_of else 4, 0),
                textcoords="offset points",
                ha="right" if left_of else "left",
                va="center",
            )
    ratios, low = [row["ratio"] for row in rows], 5e-4
    left, right, top = 0.7 * min(ratios), max(5.0, 2 * max(ratios)), 6.0
    ax.axhspan(1, top, color=COLOURS[1], alpha=0.12, lw=0)
    ax.fill_between([2, right], low, 1, color=COLOURS[1], alpha=0.12, lw=0)
    ax.text(0.98 * right, 0.75 * top, "not accurate", ha="right", va="top", fontsize=LETTERS)
    ax.text(0.98 * right, 1.3 * low, "too slow", ha="right", fontsize=LETTERS)
    good = sum(abs(r["rule error"]) <= r["accuracy"] and r["ratio"] <= 2 for r in rows)
    ax.text(1.05 * left, 1.3 * low, f"{good} of {len(rows)} scenes", fontsize=LETTERS)
    ax.set(xlim=(left, right), ylim=(low, top), xlabel="time over the best in hindsight [-]")
    ax.set(ylabel="error over the accuracy asked for [-]")
    ax.set_xticks([0.5, 1, 2, 4], ["1/2", "1", "2", "4"])
    ax.minorticks_off()
    return figure
