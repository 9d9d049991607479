"""How the figures of a report look: colours, markers, lines, labels, axes.

Colours are those of Okabe and Ito.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
# one for each of 16 methods; colours come back after eight, with other lines
MARKERS = "osD^vP*X<>hpd8H1"
# residuals below this fraction of the tolerance asked for are drawn there: they answer no question
FLOOR = 1e-2
LEAST_RESIDUAL = 1e-17  # drawn in place of 0
WIDE, TALL = 5.4, 11.0  # pixels of a character of a label, and between labels one above the other
POINTS = 0.72  # of a pixel at the usual resolution of a figure
SHORT = 20  # characters of a label, up to which three of them fit side by side below a figure
LONGEST = 26  # characters of a label
MOST_ROUNDS = 20  # of sixteen methods in one figure
WIDTH = 5.6  # of a figure [inch], so that its letters can be read where it is 400 pixels wide
ROW = 0.19  # of a legend [inch]
CELLS = 240  # of a map, above which no numbers are written into them
NAMES = {
    "solve_seconds": "time of the method [s]",
    "call_seconds": "time of the whole call [s]",
    "cpu_seconds": "CPU time of the whole call [s]",
    "peak_mb": "peak memory [MB]",
    "iterations": "outer iterations",
    "error": "relative error of the forces [-]",
    "residual": "natural-map residual [-]",
    "contacts": "contacts",
    "problem.contacts": "contacts",
    "problem.mu": "friction coefficient [-]",
    "problem.stiffness_ratio": "E lower / E upper [-]",
    "problem.elements": "elements across the half-width",
    "method.rho": "penalty factor rho [-]",
    "problem.coupling": "Dundurs' constant [-]",
    "method.factor": "penalty factor [-]",
    "problem.upper_nu": "Poisson's ratio, upper body [-]",
}


def styles() -> list[dict[str, Any]]:
    """Make the styles of lines.

    Returns
    -------
    Sixteen that differ in marker, and in colour or line; they come back after that.
    """
    made = [
        {
            "color": COLOURS[i % len(COLOURS)],
            "marker": MARKERS[i],
            "ls": "-" if i < len(COLOURS) else "--",
        }
        for i in range(len(MARKERS))
    ]
    return made * MOST_ROUNDS


def short_label(name: str, labels: Mapping[str, str] = MappingProxyType({})) -> str:
    """Shorten the label of a line.

    It is the label that was given for a name; else the name itself, where it is long with the
    values of its settings only. normal_qp(backend='clarabel', exact=True) becomes 'normal_qp
    clarabel exact'.

    Parameters
    ----------
    name : The name of a method with its settings.
    labels : Labels that the experiment gives.

    Returns
    -------
    The label.
    """
    if name in labels:
        return str(labels[name])
    head, bracket, settings = name.partition("(")
    if len(name) <= LONGEST or not bracket:
        return name
    words = [head]
    for setting in settings.rstrip(")").split(", "):
        key, _, value = setting.partition("=")
        if value != "False":
            words.append(
                key if value == "True" else value.strip("'") if value.startswith("'") else setting
            )
    return " ".join(words)


def label_ends(ax: Any, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Write the names of lines in their colours beside their last points, one above the other where
    they meet.

    A name stands to the left of a point in the right half of the figure, to the right of any other.

    Parameters
    ----------
    ax : The axes.
    ends : (x, y, name, colour) of each line.
    """
    ax.autoscale_view()
    middle = float(ax.transAxes.transform((0.5, 0.5))[0])
    # left and right end and height of labels in pixels
    taken: list[tuple[float, float, float]] = []
    for x, y, name, colour in sorted(ends, key=lambda end: end[1]):
        across, up = (float(place) for place in ax.transData.transform((x, y)))
        left = across - WIDE * len(name) if across > middle else across
        right, shift = left + WIDE * len(name), 3.0
        while any(
            left < end and start < right and abs(up + shift - height) < TALL
            for start, end, height in taken
        ):
            shift += TALL
        taken.append((left, right, up + shift))
        side = (
            {"ha": "right", "xytext": (-5, shift * POINTS)}
            if across > middle
            else {"xytext": (5, shift * POINTS)}
        )
        ax.annotate(name, (x, y), textcoords="offset points", color=colour, fontsize=7, **side)


def write_numbers(ax: Any, grid: pd.DataFrame, norm: Any, size: float) -> None:
    """Write the numbers of a map in its cells, black on light colours and white on dark ones.

    Parameters
    ----------
    ax : The axes.
    grid : The numbers, row by row.
    norm : What takes a number to its place between the darkest and the lightest colour.
    size : Of the letters [pt].
    """
    values = grid.to_numpy(float)
    if values.size > CELLS:
        return
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "black" if float(norm(max(value, norm.vmin))) > 0.6 else "white"
            text = short_tick(float(f"{value:.0f}" if 10 <= abs(value) < 1000 else f"{value:.1g}"))
            ax.text(column, row, text, ha="center", va="center", fontsize=size, color=colour)


def make_figure(
    columns: int = 1, rows: int = 1, size: Sequence[float] = (WIDTH, 4.0)
) -> tuple[Any, Any]:
    """Make a figure with axes.

    Parameters
    ----------
    columns, rows : Number of axes.
    size : Width and height of one of them [inch].

    Returns
    -------
    The figure, and its axes: one, or an array of them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    return figure, figure.subplots(rows, columns)


def set_ticks(axis: Any) -> None:
    """Put ticks at 1, 2, 5 on a logarithmic axis of less than two decades, where the usual labels
    run into each other.

    Parameters
    ----------
    axis : The axis.
    """
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def add_legend(figure: Any, ax: Any, title: str | None = None) -> Any:
    """Add a grid, and a legend below the figure, which grows for it.

    Parameters
    ----------
    figure, ax : The figure and its axes.
    title : Of the legend.

    Returns
    -------
    The figure.
    """
    ax.grid(alpha=0.3)
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        columns = 2 if max(len(label) for label in labels) > SHORT else 3
        figure.set_figheight(
            figure.get_figheight() + ROW * (-(-len(labels) // columns) + (title is not None))
        )
        figure.legend(
            handles,
            labels,
            loc="outside lower center",
            ncols=columns,
            frameon=False,
            fontsize=8,
            title=title,
            title_fontsize=8,
        )
    return figure


def short_tick(value: float) -> str:
    """Write a number as short as it can be: 100000.0 becomes 1e5.

    Parameters
    ----------
    value : The number.

    Returns
    -------
    The text.
    """
    plain, power = (
        f"{value:g}",
        f"{value:.1e}".replace(".0e", "e").replace("e+0", "e").replace("e-0", "e-"),
    )
    return power if len(power) < len(plain) and float(power) == value else plain
