"""How the figures of a report look: colours, markers, lines, labels, axes.

Colours are those of Okabe and Ito.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
FAINT: Mapping[str, Any] = MappingProxyType({"color": "#cccccc", "lw": 0.8, "zorder": 0})
# one for each of 16 methods; colours come back after eight, with other lines
MARKERS = "osD^vP*X<>hpd8H1"
# residuals below this fraction of the tolerance asked for are drawn there: they answer no question
FLOOR = 1e-2
LEAST_RESIDUAL = 1e-17  # drawn in place of 0
WIDE, TALL = 5.4, 11.0  # pixels of a character of a label, and between labels one above the other
POINTS = 0.72  # of a pixel at the usual resolution of a figure
SHORT = 20  # characters of a label, up to which three of them fit side by side below a figure
LONGEST = 26  # characters of a label
WIDTH = 5.6  # of a figure [inch], so that its letters can be read where it is 400 pixels wide
ROW = 0.19  # of a legend [inch]
ROOM = 11.0  # of a label in the height [pt]
CELLS = 240  # of a map, above which no numbers are written into them
NO_LABELS: Mapping[str, str] = MappingProxyType({})
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
STYLES = [
    {"color": colour, "marker": marker, "ls": line}
    for colour, marker, line in zip(cycle(COLOURS), MARKERS, ["-"] * 8 + ["--"] * 8)
]


def short_label(name: str, labels: Mapping[str, str] = NO_LABELS) -> str:
    """The label given for a name, else the name with the values of its settings only."""
    if name in labels:
        return str(labels[name])
    head, bracket, settings = name.partition("(")
    if len(name) <= LONGEST or not bracket:
        return name
    words = [head]
    for setting in settings.rstrip(")").split(", "):
        key, _, value = setting.partition("=")
        if value == "True":
            words.append(key)
        elif value.startswith("'"):
            words.append(value.strip("'"))
        elif value != "False":
            words.append(setting)
    return " ".join(words)


def label_ends(ax: Any, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Write coloured names of lines beside their last points (x, y, name, colour), one above the
    other where they meet, to the left in the right half of the figure.
    """
    ax.autoscale_view()
    middle = float(ax.transAxes.transform((0.5, 0.5))[0])
    # left and right end and height of labels in pixels
    taken: list[tuple[float, float, float]] = []
    for x, y, name, colour in sorted(ends, key=lambda end: end[1]):
        across, up = (float(place) for place in ax.transData.transform((x, y)))
        left = across - WIDE * len(name) if across > middle else across
        right, height = left + WIDE * len(name), up + 3.0
        while any(
            left < end and start < right and abs(height - other) < TALL
            for start, end, other in taken
        ):
            height += TALL
        taken.append((left, right, height))
        side, place = ("right", -5) if across > middle else ("left", 5)
        above = (place, (height - up) * POINTS)
        options = {"textcoords": "offset points", "color": colour, "fontsize": 7, "ha": side}
        ax.annotate(name, (x, y), above, **options)


def label_right(ax: Any, ends: Sequence[tuple[float, str, str]]) -> None:
    """Write coloured names beside the axes at (height, name, colour), in order if crowded."""
    shares = ax.transScale + ax.transLimits  # to the height of the axes
    right = ax.get_xlim()[1]
    step = ROOM / (ax.figure.get_figheight() * 72 * 0.8)
    # equal heights: the first, which is the better, stands above
    ordered = sorted(reversed(ends), key=lambda end: end[0])
    places = list[float]()
    for at, _, _ in ordered:
        height = float(shares.transform((right, at))[1])
        places.append(max(height, places[-1] + step) if places else height)
    top = 1.0
    for i in reversed(range(len(places))):
        places[i] = top = min(places[i], top)
        top -= step
    for place, (_, name, colour) in zip(places, ordered):
        where = {"xycoords": "axes fraction", "textcoords": "offset points"}
        ax.annotate(name, (1.0, place), (4, 0), color=colour, va="center", fontsize=8, **where)


def write_numbers(ax: Any, grid: pd.DataFrame, norm: Any, size: float) -> None:
    """Write the numbers of a map in its cells, black on light colours and white on dark ones."""
    values = grid.to_numpy(float)
    if values.size > CELLS:
        return
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "black" if float(norm(max(value, norm.vmin))) > 0.6 else "white"
            text = short_tick(float(f"{value:.0f}" if 10 <= abs(value) < 1000 else f"{value:.1g}"))
            ax.text(column, row, text, ha="center", va="center", fontsize=size, color=colour)


def make_figure(
    columns: int = 1, rows: int = 1, size: tuple[float, float] = (WIDTH, 4.0)
) -> tuple[Any, Any]:
    """A figure with axes of a size [inch] each: one, or an array of them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    return figure, figure.subplots(rows, columns)


def set_ticks(axis: Any) -> None:
    """Put ticks at 1, 2, 5 on a logarithmic axis of less than two decades."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def add_legend(figure: Any, ax: Any, title: str | None = None) -> Any:
    """The figure with a grid, and with a legend below it, for which it grows."""
    ax.grid(alpha=0.3)
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        columns = 2 if max(len(label) for label in labels) > SHORT else 3
        rows = -(-len(labels) // columns) + (title is not None)
        figure.set_figheight(figure.get_figheight() + ROW * rows)
        look = {"ncols": columns, "frameon": False, "fontsize": 8, "title_fontsize": 8}
        figure.legend(handles, labels, loc="outside lower center", title=title, **look)
    return figure


def short_tick(value: float) -> str:
    """A number as short as it can be: 100000.0 becomes 1e5."""
    plain = f"{value:g}"
    power = f"{value:.1e}".replace(".0e", "e").replace("e+0", "e").replace("e-0", "e-")
    return power if len(power) < len(plain) and float(power) == value else plain
