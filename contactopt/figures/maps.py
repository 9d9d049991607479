"""Pictures of the contact of half-spaces: maps of pressure, gap, traction and slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt.coupling.reduction import Reduction
from contactopt.figures.style import BLUE, ORANGE, add_colours, paper_axes
from contactopt.problem import Solution
from contactopt.readings.half_space_readings import surface_maps

COLUMNS = 2  # of panels: more could not be read where the figure is 400 pixels wide


def maps_figure(reduction: Reduction, solution: Solution) -> Any:
    """Draw pressure, gap, and where there is friction traction, slip and stick, of half-spaces."""
    from matplotlib.colors import ListedColormap

    scene, problem, maps = reduction.scene, reduction.problem, surface_maps(reduction, solution)
    length, stress = scene.units
    closed = maps["status"] > 0
    panels = [
        ("pressure", closed, maps["pressure"], f"pressure [{stress}]", "viridis"),
        ("gap", ~closed, maps["gap"], f"gap [{length}]", "cividis"),
    ]
    if problem.law.rough.any():
        traction, slip = (np.linalg.norm(maps[name], axis=-1) for name in ("traction", "slip"))
        two: Any = ListedColormap([BLUE, ORANGE])
        panels += [
            ("traction", closed, traction, f"tangential traction [{stress}]", "viridis"),
            ("slip", closed, slip, f"slip [{length}]", "cividis"),
            ("status", closed, maps["status"], "", two),
        ]
    line = maps["pressure"].ndim == 1
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure, axes = paper_axes(columns, rows, height=1.7 if line else 2.3)
    for (name, where, known, label, colours), ax in zip(panels, axes):
        values = np.where(where, known, np.nan)
        if line:
            ax.plot(problem.chart.places[0], values)
            ax.set(xlabel=f"${scene.components[0]}$ [{length}]", ylabel=label)
            continue
        x, y = problem.chart.places
        extent = (x.min(), x.max(), y.min(), y.max())
        look = {"origin": "lower", "interpolation": "nearest", "cmap": colours}
        image = ax.imshow(values.T, extent=extent, **look)
        ax.set(xlabel=f"$x$ [{length}]", ylabel=f"$y$ [{length}]")
        bar = add_colours(image, ax, label, orientation="horizontal", shrink=1.0)
        if name == "status":
            image.set_clim(0.5, 2.5)
            bar.set_ticks([1, 2], labels=["stick", "slip"])
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    return figure
