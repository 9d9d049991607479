"""Figures of a report: f(table, ...) -> matplotlib Figure, from results alone; nothing is solved
here.

`table` is what contactopt.benchmark.load returns. A figure that compares times takes the runs of
one law only. `by` is the column whose values have a line or a panel each, `labels` are short names
for long ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.benchmark.ranking import achieved, comparable, mean_times, points
from contactopt.benchmark.tables import INSTANCE, groups
from contactopt.figures.style import (
    COLOURS,
    FAINT,
    LETTERS,
    LINE,
    MARKS,
    add_colours,
    draw_lines,
    label_ends,
    paper_axes,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.colors import Normalize
    from matplotlib.image import AxesImage

ACCURACIES = 1e-2, 1e-11, 10  # certificates of `time_to_accuracy`: first, last, how many
# residuals below this fraction of the tolerance asked for are drawn there: they answer no question
FLOOR = 1e-2
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


def _look(rank: int) -> dict[str, Any]:
    """The look of a line by its rank: the first eight have colours."""
    return {"color": COLOURS[rank], "lw": LINE} if rank < len(COLOURS) else dict(FAINT)


def speed_accuracy(
    table: pd.DataFrame,
    time: str = "solve_seconds",
    by: str = "method",
    labels: Mapping[str, str] = NO_LABELS,
) -> Any:
    """Draw time against certified residual: per method a line through its settings, medians over
    problems and repeats.

    Filled: at least half of the runs reached the tolerance. The eight that reach most, and are the
    fastest among these, have colours and names. The Pareto front, where nothing is both faster and
    more accurate, is drawn in grey. A residual below FLOOR of its tolerance is drawn at FLOOR.
    """
    figure, (ax,) = paper_axes()
    # settings of the same tolerance are one point
    how = {time: "median", "residual": "median", "success": "mean"}
    found = [(name, own.groupby("tolerance").agg(how)) for name, own in groups(table, by)]
    found.sort(key=lambda pair: (-pair[1]["success"].mean(), pair[1][time].median()))
    drawn, ends = [], []
    for rank, (name, settings) in enumerate(found):
        name, settings = short_label(name, labels), settings.sort_index(ascending=False)
        shown = settings[np.isfinite(settings["residual"])]
        floor = FLOOR * shown.index.to_numpy(float)
        x, y = shown[time].to_numpy(), np.maximum(shown["residual"].to_numpy(), floor)
        ax.loglog(x, y, "-", alpha=0.7, **_look(rank))
        good = shown["success"].to_numpy() >= 0.5
        look = _look(rank) | {"ls": "none", "marker": MARKS[rank % len(MARKS)]}
        if good.any():
            ax.loglog(x[good], y[good], label=name, **look)
        ax.loglog(x[~good], y[~good], mfc="white", label="" if good.any() else name, **look)
        drawn += list(zip(x, y))
        if len(x) and rank < len(COLOURS):
            ends.append((x[-1], y[-1], name, COLOURS[rank]))
    wide = {"color": "#dddddd", "lw": 4, "zorder": 0}
    ax.step(*_pareto(np.array(drawn)).T, where="post", label="Pareto front", **wide)
    ax.set(xlabel=NAMES.get(time, time) + ", median", ylabel="natural-map residual [-], median")
    set_ticks(ax.xaxis)
    label_ends(ax, ends)
    return figure


def _pareto(points: np.ndarray) -> np.ndarray:
    """Points that no other beats in both coordinates, from left to right."""
    if len(points) == 0:
        return np.zeros((0, 2))
    points = points[np.lexsort((points[:, 1], points[:, 0]))]
    best = np.minimum.accumulate(points[:, 1])
    return np.asarray(points[np.concatenate([[True], points[1:, 1] < best[:-1]])])


def performance_profile(
    table: pd.DataFrame,
    metric: str = "solve_seconds",
    by: str = "method",
    labels: Mapping[str, str] = NO_LABELS,
    accuracy: float | None = None,
) -> Any:
    """Draw a profile: the share of the instances solved within a factor of the best method's time
    on each.

    The eight best have colours, and their names stand at their right ends, with the number of
    instances that they solved; the others are grey. An instance is a problem at a setting and
    start, or a problem and a start where `accuracy` is the certificate at which methods are
    compared. Times are medians over repeats, and a method that fails once has failed.

    Source: Dolan, More (2002), Benchmarking optimization software with performance profiles, Math.
    Program. 91, 201-213.
    """
    figure, (ax,) = paper_axes()
    if accuracy is None:
        wide = _at_settings(table, metric, by)
    else:
        time = "wall" if metric == "call_seconds" else "cpu"
        wide = achieved(comparable(points(table)), accuracy, time)
    solvable = wide[np.isfinite(wide.min(axis=1))]
    ratio = solvable.div(solvable.min(axis=1), axis=0)
    largest = 1.3 * float(np.max(ratio.to_numpy()[np.isfinite(ratio.to_numpy())], initial=2.0))
    ends = []
    order = np.log(ratio).replace(np.inf, np.log(1e3 * largest)).sum().sort_values().index
    for rank, full in enumerate(order):
        reached = np.sort(ratio[full][np.isfinite(ratio[full])].to_numpy())
        share = np.arange(len(reached) + 1) / len(wide)
        label = f"{short_label(str(full), labels)} ({len(reached)})"
        x, y = np.concatenate([[1.0], reached, [largest]]), np.append(share, share[-1])
        ax.step(x, y, where="post", label=label, **_look(rank))
        ends += [(largest, share[-1], label, COLOURS[rank])] if rank < len(COLOURS) else []
    what = NAMES.get(metric, metric).partition(" [")[0]
    ax.set(xscale="log", xlim=(1, largest), ylim=(0, 1.03))
    ax.set_xlabel(f"ratio: {what} / the best method's [-]", loc="left")
    ax.set(ylabel=f"share of the {len(wide)} instances solved")
    label_ends(ax, ends)
    return figure


def time_to_accuracy(
    table: pd.DataFrame, time: str = "cpu_seconds", labels: Mapping[str, str] = NO_LABELS
) -> Any:
    """Draw the mean time to a certificate, over the certificates of the figure.

    It is the shifted geometric mean of the leader table: over the instances that somebody brought
    so far, with a failure counted at its limit. So a method is not the faster for failing where the
    others need time. The eight best at the middle have colours and names at their right ends.
    """
    figure, (ax,) = paper_axes()
    found, which = points(table), "wall" if time == "call_seconds" else "cpu"
    across = np.geomspace(*ACCURACIES)
    curves = [mean_times(found, accuracy, which) for accuracy in across]
    lines = [
        (short_label(str(full), labels), [*across], [curve.get(full, np.nan) for curve in curves])
        for full in curves[len(curves) // 2].sort_values().index
    ]
    ax.set(xlim=ACCURACIES[:2], xlabel="certificate that is reached [-]")
    draw_lines(ax, lines, ["-"] * len(lines))
    ax.set(ylabel=NAMES.get(time, time) + ", mean")
    return figure


def _at_settings(table: pd.DataFrame, metric: str, by: str) -> pd.DataFrame:
    """The times of the instances, inf where a run did not reach its tolerance."""
    timed = table.assign(_time=table[metric].where(table["success"], np.inf))
    return (
        timed.groupby([*INSTANCE, by])["_time"]
        .agg(lambda t: t.median() if np.isfinite(t).all() else np.inf)
        .unstack(by)
    )


def time_against_size(
    table: pd.DataFrame,
    size: str = "contacts",
    metric: str = "solve_seconds",
    by: str = "method",
    labels: Mapping[str, str] = NO_LABELS,
) -> Any:
    """Draw median times of successes against size, with the exponent of the larger sizes n."""
    figure, (ax,) = paper_axes()
    found = []
    for full, rows in groups(table[table["success"]], by):
        medians = rows.groupby(size)[metric].median()
        x, y = medians.index.to_numpy(float), medians.to_numpy()
        exponent, label = fitted_exponent(x, y), short_label(full, labels)
        found.append((label + ("" if np.isnan(exponent) else f" $n^{{{exponent:.1f}}}$"), x, y))
    draw_lines(ax, sorted(found, key=lambda own: (-own[1][-1], own[2][-1])))
    ax.set(xlabel=NAMES.get(size, size), ylabel=NAMES.get(metric, metric) + ", median")
    set_ticks(ax.xaxis)
    return figure


def fitted_exponent(x: np.ndarray, y: np.ndarray) -> float:
    """The exponent p of y ~ x^p over the larger half of the sizes; nan below three."""
    if len(x) < 3:
        return np.nan
    order = np.argsort(x)[-max(3, (len(x) + 1) // 2) :]
    return float(np.polyfit(np.log(x[order]), np.log(y[order]), 1)[0])


def stability_map(
    table: pd.DataFrame,
    x: str = "problem.mu",
    y: str = "problem.stiffness_ratio",
    value: str = "success",
    by: str = "method",
) -> Any:
    """Draw one panel per method: success, iterations, error or time over two parameters; hatched
    grey where no run succeeded.

    The cells hold their numbers, unless a map has more than CELLS of them. Runs that ended by the
    method's own criterion above the tolerance ("settled") show their value too. Where one axis is
    the friction coefficient and the experiment diagnosed its problems, lines on top: below the
    dashed one the alternating iteration contracts for every load, at the full one it does not for
    some load.
    """
    from matplotlib.colors import LogNorm, Normalize

    parts = groups(table, by)
    columns = min(2, len(parts))
    figure, axes = paper_axes(columns, -(-len(parts) // columns), height=1.5 * (3 - columns))
    grids = [_grid(rows, x, y, value) for _, rows in parts]
    shown = np.concatenate([grid.to_numpy(float).ravel() for grid in grids])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    low, high = (float(shown.min()), float(shown.max())) if len(shown) else (0.1, 1.0)
    norm = Normalize(0, 1) if value == "success" else LogNorm(low, high if high > low else 2 * low)
    for number, (ax, (name, rows), grid) in enumerate(zip(axes, parts, grids)):
        mesh = _draw_map(ax, grid, norm, columns > 1)
        ax.set_title(short_label(name), fontsize=LETTERS, pad=3)
        last = number + columns >= len(parts)
        ax.set_xlabel(NAMES.get(x, x) if last else "")
        _thresholds(ax, rows, x, y, grid)
    for ax in axes[len(parts) :]:
        ax.set_axis_off()
    figure.supylabel(NAMES.get(y, y), fontsize=LETTERS)
    handles = {line.get_label(): line for ax in axes for line in ax.get_lines()}
    if handles:
        look = {"loc": "outside lower center", "ncols": 1, "frameon": False, "fontsize": LETTERS}
        figure.legend(handles=list(handles.values()), **look)
    what = NAMES.get(value, value) + ", median"
    what = "share of runs solved [-]" if value == "success" else what
    add_colours(mesh, axes, what, location="top", aspect=30)
    return figure


def _grid(rows: pd.DataFrame, x: str, y: str, value: str) -> pd.DataFrame:
    if value == "success":
        values, how = rows["success"].astype(float), "mean"
    else:
        values = rows[value].where(rows["success"] | (rows["status"] == "settled"))
        how = "median"
    return rows.assign(_value=values).pivot_table(
        index=y, columns=x, values="_value", aggfunc=how, dropna=False
    )


def _draw_map(ax: Axes, grid: pd.DataFrame, norm: Normalize, beside: bool) -> AxesImage:
    """Draw one map, with less room if another stands beside it; its picture."""
    ax.set_facecolor("#cccccc")
    ax.patch.set(hatch="xx", edgecolor="#999999")
    write_numbers(ax, grid, norm, 5 if beside else LETTERS)
    look = {"cmap": "viridis", "origin": "lower", "aspect": "auto"}
    mesh = ax.imshow(grid.to_numpy(float), norm=norm, **look)
    # the last number is the room along the axis [characters]
    for axis, index, room in (
        (ax.xaxis, grid.columns, 20 if beside else 40),
        (ax.yaxis, grid.index, 40),
    ):
        names = [short_tick(v) for v in index]
        ticks = range(0, len(index), -(-sum(len(name) + 1 for name in names) // room))
        axis.set_ticks(list(ticks), [names[i] for i in ticks])
    return mesh


def _thresholds(ax: Axes, rows: pd.DataFrame, x: str, y: str, grid: pd.DataFrame) -> None:
    """Lines at the thresholds of friction, logarithmic between the cells' values."""
    if "problem.mu" not in (x, y):
        return
    upright = x == "problem.mu"
    other, frictions, values = (
        (y, grid.columns, grid.index) if upright else (x, grid.index, grid.columns)
    )
    cells = np.log(np.asarray(frictions, dtype=float).clip(1e-300))
    places = {v: i for i, v in enumerate(values)}
    lines = (
        ("guaranteed_mu", "--", "alternating iteration contracts for every load below"),
        ("alternating_mu", "-", "right of this line some load diverges"),
    )
    for column, style, label in lines:
        known = rows.groupby(other)[column].median().dropna()
        known = known[np.isfinite(known) & (known > 0)]
        number = np.arange(len(cells))
        along = np.interp(np.log(known.to_numpy()), cells, number, left=np.nan, right=np.nan)
        line = along, np.array([places[v] for v in known.index])
        if np.isfinite(along).sum() > 1:
            look = {"color": COLOURS[1], "lw": 1.5, "label": label}
            ax.plot(*(line if upright else line[::-1]), style, **look)


FIGURES: dict[str, Callable[..., Any]] = {
    f.__name__: f
    for f in (
        speed_accuracy, time_to_accuracy, performance_profile, time_against_size, stability_map,
    )
}  # fmt: skip


def short_label(name: str, labels: Mapping[str, str] = NO_LABELS) -> str:
    """The label given for a name, else the name with the values of its settings only."""
    if name in labels:
        return str(labels[name])
    head, bracket, settings = name.partition("(")
    if len(name) <= 20 or not bracket:
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


def write_numbers(ax: Axes, grid: pd.DataFrame, norm: Normalize, size: float) -> None:
    """Write the numbers of a map in its cells, black on light colours and white on dark ones."""
    values = grid.to_numpy(float)
    if values.size > CELLS:
        return
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "black" if float(norm(max(value, norm.vmin))) > 0.6 else "white"
            text = short_tick(float(f"{value:.0f}" if 10 <= abs(value) < 1000 else f"{value:.1g}"))
            ax.text(column, row, text, ha="center", va="center", fontsize=size, color=colour)


def set_ticks(axis: Axis) -> None:
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
