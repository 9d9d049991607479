"""How figures of a report name what they show: labels of methods and axes, numbers in maps."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

# residuals below this fraction of the tolerance asked for are drawn there: they answer no question
FLOOR = 1e-2
LEAST_RESIDUAL = 1e-17  # drawn in place of 0
LONGEST = 20  # characters of a label
CELLS = 240  # of a map, above which no numbers are written into them
NO_LABELS: Mapping[str, str] = MappingProxyType({})
NAMES = {
    "solve_seconds": "time of the method [s]",
    "call_seconds": "time of the call [s]",
    "cpu_seconds": "CPU time of the call [s]",
    "peak_mb": "peak memory [MB]",
    "iterations": "outer iterations [-]",
    "error": "relative error of the forces [-]",
    "residual": "natural-map residual [-]",
    "contacts": "contacts [-]",
    "problem.contacts": "contacts [-]",
    "problem.mu": r"friction coefficient $\mu$ [-]",
    "problem.stiffness_ratio": r"$E_\mathrm{lower}\,/\,E_\mathrm{upper}$ [-]",
    "problem.elements": "elements across the half-width [-]",
    "method.rho": r"penalty factor $\rho$ [-]",
    "problem.coupling": r"Dundurs' constant $\beta$ [-]",
    "method.factor": "penalty factor [-]",
    "problem.upper_nu": r"Poisson's ratio $\nu$ [-]",
}


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
            try:
                words.append(short_tick(float(value)))
            except ValueError:
                words.append(setting)
    return " ".join(words)


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


def set_ticks(axis: Any) -> None:
    """Put ticks at 1, 2, 5 on a logarithmic axis of less than two decades."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def short_tick(value: float) -> str:
    """A number as short as it can be: 100000.0 becomes 1e5."""
    plain = f"{value:g}"
    power = f"{value:.1e}".replace(".0e", "e").replace("e+0", "e").replace("e-0", "e-")
    return power if len(power) < len(plain) and float(power) == value else plain
