"""Colours, axes, magnification and saving that all figures of results share.

Colours are those of Okabe and Ito, legible to all.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#666666"
FORMATS = ("png", "svg", "pdf")
DPI = 130
SHARE = 0.08  # of the bodies' size that the largest displacement is drawn as
# a gap above this fraction of the largest displacement: bodies that were apart would seem to
# overlap if magnified
APART = 1e-3
# quantile of the von Mises stress where the colours end: singular corners would take them all
TOP = 0.998


def magnification(size: float, displacement: float, gap: float) -> float:
    """The factor by which displacements are drawn: a round number of at least 1, and 1 where bodies
    are apart, for bodies of a size, their largest displacement and their largest gap [length].
    """
    if displacement == 0 or gap > APART * displacement:
        return 1.0
    target = SHARE * size / displacement
    if not 1.0 < target < np.inf:  # also where displacements are beyond all numbers
        return 1.0
    power = 10.0 ** np.floor(np.log10(target))
    return float(power * max(m for m in (1, 2, 5) if m * power <= target * (1 + 1e-12)))


def highest_colour(stresses: list[np.ndarray]) -> float:
    """The von Mises stress at which the colours of the bodies end."""
    return float(np.quantile(np.concatenate(stresses), TOP)) or 1.0


def make_axes(ax: Any) -> Any:
    """The axes that were given, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6.4, 4.8), layout="constrained").add_subplot()


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure to a file, whose ending says the format.

    A PNG is drawn once. Figure.savefig would draw it twice, the first time only to learn its size.
    """
    if path.suffix != ".png":
        figure.savefig(path, dpi=DPI)
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    before, figure.dpi = figure.dpi, DPI
    FigureCanvasAgg(figure).print_png(path, pil_kwargs={"compress_level": 3})
    figure.dpi = before
