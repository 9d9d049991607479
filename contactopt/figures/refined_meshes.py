"""The search for an accuracy as a figure: estimated error and value of the quantity against the
unknowns of the meshes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.figures.style import BLUE, GREY, ORANGE

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate


def refinement_figure(estimate: Estimate) -> Any:
    """Two axes over the unknowns of each mesh: estimated errors, on logarithmic axes with the
    target, and the value.

    The dotted line is the last value with its estimated error added.

    Parameters
    ----------
    estimate : what contactopt.accuracy.refine found
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    unknowns = np.array([level.unknowns for level in estimate.levels])
    errors = np.array([np.nan if level.error is None else level.error for level in estimate.levels])
    energy = np.array([level.energy_error for level in estimate.levels])
    known = np.isfinite(errors)
    if known.any():
        left.plot(unknowns[known], errors[known], "o-", color=BLUE, label=f"of {estimate.quantity}")
    if np.any(energy > 0):
        left.plot(unknowns, energy, "s--", color=GREY, mfc="none", label="in the energy norm")
    left.axhline(estimate.target, color=ORANGE, lw=1, label="asked for")
    left.set(
        xscale="log",
        yscale="log",
        xlabel="unknowns [-]",
        ylabel="estimated relative error [-]",
        title=f"{len(unknowns)} meshes",
    )
    left.legend(frameon=False)
    values = np.array([level.value for level in estimate.levels])
    bar = np.nan_to_num(errors) * np.abs(values)
    right.errorbar(unknowns, values, bar, fmt="o-", color=BLUE, capsize=3)
    if estimate.extrapolated is not None:
        right.axhline(estimate.extrapolated, color=GREY, lw=1, ls=":")
    right.set(
        xscale="log",
        xlabel="unknowns [-]",
        ylabel=estimate.quantity,
        title="value, with the estimated error",
    )
    right.set_ylim(*_shown(values, bar))
    for axes in (left, right):
        axes.xaxis.set_minor_formatter(NullFormatter())
    return figure


def _shown(values: np.ndarray, bar: np.ndarray) -> tuple[float, float]:
    """Limits that show all values, and of the error bars those from the second half of the meshes."""
    late = slice(len(values) // 2, None)
    low = min(values.min(), (values - bar)[late].min())
    high = max(values.max(), (values + bar)[late].max())
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin
