"""Pictures of the contact of half-spaces: maps of pressure, gap, traction and slip."""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt.analysis.half_spaces import surface_maps
from contactopt.interface.reduction import Reduction
from contactopt.problem import Solution


def maps_figure(reduction: Reduction, solution: Solution) -> Any:
    """Draw maps of pressure and gap, and where there is friction of traction, slip and stick.

    Parameters
    ----------
    reduction
        The reduction of a scene with a half-space.
    solution
        A solution of its problem.

    Returns
    -------
    Figure
        The figure of matplotlib.
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    scene, problem, maps = reduction.scene, reduction.problem, surface_maps(reduction, solution)
    length, stress = scene.units
    closed = maps["status"] > 0
    panels: list[tuple[str, np.ndarray, str, Any]] = [
        ("pressure", np.where(closed, maps["pressure"], np.nan), f"pressure [{stress}]", "viridis"),
        ("gap", np.where(closed, np.nan, maps["gap"]), f"gap [{length}]", "cividis"),
    ]
    if problem.law.rough.any():
        traction, slip = (np.linalg.norm(maps[name], axis=-1) for name in ("traction", "slip"))
        panels.append(("traction", np.where(closed, traction, np.nan), f"tangential traction [{stress}]", "viridis"))
        panels.append(("slip", np.where(closed, slip, np.nan), f"tangential displacement [{length}]", "magma"))
        panels.append(
            (
                "status",
                np.where(closed, maps["status"], np.nan),
                "1 stick, 2 slip",
                ListedColormap(["#1f77b4", "#ff7f0e"]),
            )
        )
    if maps["pressure"].ndim == 1:
        figure = Figure(figsize=(4.2 * len(panels), 3.4), layout="constrained")
        for (name, values, label, _), ax in zip(panels, figure.subplots(1, len(panels))):
            ax.plot(problem.chart.places[0], values)
            ax.set(xlabel=f"{scene.components[0]} [{length}]", ylabel=label, title=name)
        return figure
    x, y = problem.chart.places
    extent = (x.min(), x.max(), y.min(), y.max())
    figure = Figure(figsize=(4.4 * len(panels), 3.8), layout="constrained")
    for (name, values, label, colours), ax in zip(panels, figure.subplots(1, len(panels))):
        image = ax.imshow(values.T, origin="lower", extent=extent, cmap=colours, interpolation="nearest")
        ax.set(xlabel=f"x [{length}]", ylabel=f"y [{length}]", title=name)
        figure.colorbar(image, ax=ax, label=label, shrink=0.85)
    return figure
