"""Colours, axes and saving that all figures of results share.

Colours are those of Okabe and Ito, legible to all.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from contactopt.scenes.scene import Scene

BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#666666"
FORMATS = ("png", "svg", "pdf")
DPI = 130
ARROWS = 1000  # about as many arrows as a map of tractions can show


def make_axes(ax: Any, **options: Any) -> Any:
    """Give the axes that were given, or those of a new figure.

    Parameters
    ----------
    ax : Axes, or None.
    options : Of the new axes, as for `add_subplot`.

    Returns
    -------
    The axes.
    """
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(6.4, 4.8), layout="constrained").add_subplot(**options)


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure to a file, whose ending says the format.

    A PNG is drawn once. Figure.savefig would draw it twice, the first time only to learn its size.

    Parameters
    ----------
    figure : The figure.
    path : The file.
    """
    if path.suffix != ".png":
        figure.savefig(path, dpi=DPI)
        return
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    before, figure.dpi = figure.dpi, DPI
    FigureCanvasAgg(figure).print_png(path, pil_kwargs={"compress_level": 3})
    figure.dpi = before


def singular(scene: Scene) -> bool:
    """Say whether tractions are known to be infinite somewhere, so that the largest nodal value
    means nothing.

    Parameters
    ----------
    scene : The scene, with its exact solution if one is known.

    Returns
    -------
    True where the exact solution has no largest value.
    """
    return scene.reference is not None and scene.reference.peak is None
