"""How all figures look: sizes, colours, axes, names of lines, magnification and saving.

A figure is one or two columns of a journal wide, with letters that can be read at this width.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure

# of Okabe and Ito, legible to all; in place of their yellow, too light for a line, Tol's wine
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#882255")
BLUE, ORANGE, GREEN, GREY = *COLOURS[:3], "#666666"
MARKS = "os^DvP<>"  # one for each colour
FAINT = {"color": "#cccccc", "lw": 0.8, "zorder": 0}  # lines beyond the eighth
COLUMN, HEIGHT = 85 / 25.4, 62 / 25.4  # of a journal's column and of a row of axes [inch]
LETTERS, LINE, MARK = 7.0, 1.1, 3.2  # sizes [pt]
FORMATS = ("png", "svg", "pdf")
DPI = 200
# quantile of the von Mises stress where the colours end: singular corners would take them all
TOP = 0.998


def magnification(size: float, displacement: float, gaps: Sequence[np.ndarray] = ()) -> float:
    """The round factor, at least 1, by which displacements and gaps are drawn, for bodies of a size
    [length]; 1 where a gap varies, because a shape would be magnified.
    """
    varies = max((float(np.ptp(gap)) for gap in gaps if len(gap)), default=0.0)
    if displacement == 0 or varies > 1e-3 * displacement:  # else it is one distance
        return 1.0
    largest = max([displacement, *(float(np.abs(gap).max(initial=0.0)) for gap in gaps)])
    target = 0.08 * size / largest  # of the bodies' size that the largest displacement is drawn as
    if not 1.0 < target < np.inf:  # also where displacements are beyond all numbers
        return 1.0
    power = 10.0 ** np.floor(np.log10(target))
    return float(power * max(m for m in (1, 2, 5) if m * power <= target * (1 + 1e-12)))


def highest_colour(stresses: list[np.ndarray]) -> float:
    """The von Mises stress at which the colours of the bodies end."""
    return float(np.quantile(np.concatenate(stresses), TOP)) or 1.0


def symbols(text: str) -> str:
    """A text with the letter mu set as a symbol, as a letter: formulas take long to set."""
    return re.sub(r"\bmu\b", "μ", text)


def make_axes(ax: Axes) -> Any:
    """The axes that were given, or those of a new figure."""
    return paper_axes()[1][0] if ax is None else ax


def paper_axes(
    columns: int = 1, rows: int = 1, wide: bool = False, height: float = HEIGHT, placed: bool = True
) -> tuple[Any, np.ndarray]:
    """A figure of one or two columns of a journal, and its flat axes; row `height` in inches."""
    from matplotlib.figure import Figure

    size = (COLUMN * (2 if wide else 1), height * rows)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained" if placed else None)
    axes = np.ravel(figure.subplots(rows, columns))
    for ax in axes:
        dress(ax)
    return figure, axes


def dress(ax: Axes, spines: bool = False, letters: float = LETTERS) -> None:
    """Give axes the letters, lines and colours of a paper; `spines` keeps those above and right."""
    sizes = {"color": COLOURS, "lw": [LINE] * len(COLOURS), "ms": [MARK] * len(COLOURS)}
    ax.set_prop_cycle(**sizes)
    ax.tick_params(which="both", labelsize=letters, width=0.6)
    ax.tick_params(which="major", length=2.5, pad=2)
    ax.tick_params(which="minor", length=1.5)
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set_size(letters)
        axis.labelpad = 2
        axis.offsetText.set_size(letters)
    for side, spine in ax.spines.items():
        spine.set_linewidth(0.6)
        spine.set_visible(spines or side not in ("top", "right"))


def add_legend(ax: Axes) -> None:
    """Add a legend, if there are two lines or more. Above our own axes it is off all lines, in as
    many columns as there is room for. In other people's axes, which may have a title, it is where
    matplotlib finds most room.
    """
    labels, letters = ax.get_legend_handles_labels()[1], ax.xaxis.label.get_size()
    if len(labels) < 2:
        return
    if letters != LETTERS:
        ax.legend(frameon=False)
        return
    room = ax.figure.get_figwidth() * 72 * ax.get_position().width / (0.55 * letters)
    sizes = [len(re.sub(r"\\\w+|\$", "", label)) + 5 for label in labels]  # in characters
    fitting = (
        columns
        for columns in range(len(sizes), 1, -1)
        if sum(max(part) for part in np.array_split(sizes, columns)) <= room
    )
    look = {"frameon": False, "handlelength": 1.6, "columnspacing": 1.0, "borderaxespad": 0.2}
    power = ax.yaxis.get_major_formatter()
    power.set_locs(ax.get_yticks())  # a power of ten that all have in common stands above the axis
    top = 1.07 if power.get_offset() else 1.0
    where = {"loc": "lower left", "bbox_to_anchor": (0, top), "ncols": next(fitting, 1)}
    ax.legend(fontsize=letters, labelspacing=0.2, **look, **where)


def add_colours(drawn: ScalarMappable, ax: Axes, label: str, **room: object) -> Colorbar:
    """The colour bar of what was drawn on axes, or on several."""
    first = np.ravel(ax)[0]
    bar = first.figure.colorbar(drawn, ax=ax, label=label, **({"shrink": 0.8} | room))
    dress(bar.ax, spines=True, letters=first.xaxis.label.get_size())
    return bar


def label_ends(ax: Axes, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Write coloured names beside the axes at the heights where lines end, (x, y, name, colour)
    each. Names keep the height of a letter apart, as near to their ends as that allows in the sum
    of squares (isotonic regression). A thin grey line leads from a name to an end not beside it.
    """
    from scipy.optimize import isotonic_regression

    ax.autoscale_view()
    shares = ax.transScale + ax.transLimits  # of the axes
    found = [(*shares.transform(end[:2]), *end) for end in ends if np.all(np.isfinite(end[:2]))]
    found = sorted(reversed(found), key=lambda end: end[1])
    if not found:
        return
    height = ax.figure.get_figheight() * 72 * ax.get_position().height
    steps = 1.25 * LETTERS / height * np.arange(len(found))
    places = isotonic_regression([end[1] for end in found] - steps).x
    places = np.clip(places, 0.0, max(0.0, 1.0 - steps[-1])) + steps
    for place, (right, up, x, y, name, colour) in zip(places, found):
        beside = right > 0.94 and abs(place - up) < LETTERS / height / 2
        lead = {"arrowstyle": "-", "lw": 0.4, "color": "#aaaaaa", "relpos": (0, 0.5)}
        lead |= {"shrinkA": 0, "shrinkB": 2}
        look = {"color": colour, "va": "center", "fontsize": LETTERS, "annotation_clip": False}
        where = {"xytext": (1.03, place), "textcoords": "axes fraction"}
        ax.annotate(name, (x, y), arrowprops=None if beside else lead, **where, **look)


def draw_lines(
    ax: Axes,
    lines: Sequence[tuple[str, Sequence[float], Sequence[float]]],
    styles: Sequence[str] = (),
) -> None:
    """Draw lines (name, x, y) on logarithmic axes, their names beside their right ends, and those
    beyond the eighth grey and without a name. A style such as "o--" is that of a family of lines.
    """
    ends = []
    for number, (name, x, y) in enumerate(lines):
        style = styles[number] if styles else MARKS[number % len(MARKS)] + "-"
        across, up = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        look = {"color": COLOURS[number]} if number < len(COLOURS) else FAINT
        colour = str(look["color"])
        mark = {"mfc": "white" if "--" in style else colour, "label": name}
        ax.loglog(across, up, style, **mark, **look)
        shown = np.flatnonzero(up > 0)
        if number < len(COLOURS) and len(shown):
            last = shown[np.argmax(-across[shown] if ax.xaxis_inverted() else across[shown])]
            ends.append((float(across[last]), float(up[last]), name, colour))
    label_ends(ax, ends)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure to a file. A PNG is drawn once; Figure.savefig would draw it twice."""
    import matplotlib

    if path.suffix != ".png":
        with matplotlib.rc_context({"pdf.fonttype": 42}):  # letters as journals want them
            figure.savefig(path)
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    before, figure.dpi = figure.dpi, DPI
    FigureCanvasAgg(figure).print_png(path, pil_kwargs={"compress_level": 3})
    figure.dpi = before
