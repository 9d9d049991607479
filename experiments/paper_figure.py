"""Figures of reports that are legible in one column of a journal (85 mm) or across two (170 mm)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

COLUMN, HEIGHT = 85 / 25.4, 62 / 25.4  # inch
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
LETTERS = 7.0  # pt
GREY = "#bbbbbb"
Line = tuple[str, Sequence[float], Sequence[float]]


def paper_axes(columns: int = 1, wide: bool = False, rows: int = 1) -> tuple[Any, np.ndarray]:
    """A figure of one column's width, or of two where it is `wide`, and its axes, flat."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(
        {"font.size": LETTERS, "axes.labelsize": LETTERS, "legend.fontsize": LETTERS,
         "axes.titlesize": LETTERS, "lines.linewidth": 1.1, "lines.markersize": 3.2,
         "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6}
    )  # fmt: skip
    size = (COLUMN * (2 if wide else 1), HEIGHT * rows)
    figure = Figure(figsize=size, layout="constrained")
    return figure, np.ravel(figure.subplots(rows, columns))


def label_lines(ax: Any, lines: Sequence[Line], styles: Sequence[str] = ()) -> None:
    """Draw at most eight lines on logarithmic axes, the rest grey, with the name of each beside its
    right end.

    Names that would meet are moved apart upwards. A style such as "o--" is that of a family of
    lines.
    """
    ends = []
    for number, (name, x, y) in enumerate(lines):
        colour = COLOURS[number] if number < len(COLOURS) else GREY
        style = styles[number] if styles else "o-"
        order = np.argsort(x)
        across, up = np.asarray(x, dtype=float)[order], np.asarray(y, dtype=float)[order]
        ax.loglog(across, up, style, color=colour, mfc="white" if "--" in style else colour)
        shown = np.flatnonzero(up > 0)
        if number < len(COLOURS) and len(shown):
            ends.append((float(up[shown[-1]]), name, colour))
    low, high = ax.get_ylim()
    height = float(ax.figure.get_figheight() / max(1, ax.get_gridspec().nrows)) * 72 * 0.75
    step = np.log(high / low) * 1.25 * LETTERS / height
    ends.sort()
    places = np.log([end[0] for end in ends])
    for i in range(1, len(places)):
        places[i] = max(places[i], places[i - 1] + step)
    over = max(0.0, places[-1] - np.log(high)) if len(places) else 0.0
    for i in range(len(places) - 1, -1, -1):  # push back down those that left the axes at the top
        top = np.log(high) if i == len(places) - 1 else places[i + 1] - step
        places[i] = min(places[i], top) if over else places[i]
    for place, (_, name, colour) in zip(places, ends):
        where = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        look = {"color": colour, "va": "center", "fontsize": LETTERS}
        ax.annotate(name, (1.0, float(np.exp(place))), (3, 0), **where, **look)
