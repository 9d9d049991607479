"""Pictures of the contact of half-spaces: maps of pressure, gap, traction and slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt.coupling.reduction import Reduction
from contactopt.figures.style import BLUE, ORANGE
from contactopt.problem import Solution
from contactopt.readings.half_space_readings import surface_maps

COLUMNS = 2  # of panels: more could not be read where the figure is 400 pixels wide


def maps_figure(reduction: Reduction, solution: Solution) -> Any:
    """Draw pressure, gap, and where there is friction traction, slip and stick, of half-spaces."""
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

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
            ("slip", closed, slip, f"tangential displacement [{length}]", "cividis"),
            ("status", closed, maps["status"], "1 stick, 2 slip", two),
        ]
    line = maps["pressure"].ndim == 1
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(3.6 * columns, (2.8 if line else 4.0) * rows), layout="constrained")
    axes = np.ravel(figure.subplots(rows, columns))
    for (name, where, known, label, colours), ax in zip(panels, axes):
        values = np.where(where, known, np.nan)
        ax.set_title(name)
        if line:
            ax.plot(problem.chart.places[0], values)
            ax.set(xlabel=f"{scene.components[0]} [{length}]", ylabel=label)
            continue
        x, y = problem.chart.places
        extent = (x.min(), x.max(), y.min(), y.max())
        look = {"origin": "lower", "interpolation": "nearest", "cmap": colours}
        image = ax.imshow(values.T, extent=extent, **look)
        ax.set(xlabel=f"x [{length}]", ylabel=f"y [{length}]")
        bar = figure.colorbar(image, ax=ax, label=label, orientation="horizontal")
        if name == "status":
            image.set_clim(0.5, 2.5)
            bar.set_ticks([1, 2])
    for ax in axes[len(panels) :]:
        ax.set_axis_off()
    return figure
