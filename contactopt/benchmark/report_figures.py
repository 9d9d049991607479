"""Figures of a report: f(table, ...) -> matplotlib Figure, from results alone; nothing is solved
here.

`table` is what contactopt.benchmark.load returns. A figure that compares times takes the runs of
one law only. Every figure takes `labels`, short names for long ones.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.benchmark.figure_style import (
    FLOOR,
    LEAST_RESIDUAL,
    NAMES,
    WIDTH,
    add_legend,
    label_ends,
    make_figure,
    set_ticks,
    short_label,
    short_tick,
    styles,
    write_numbers,
)
from contactopt.benchmark.tables import INSTANCE, groups
from contactopt.errors import InputError

if TYPE_CHECKING:
    import pandas as pd


def speed_accuracy(
    table: pd.DataFrame,
    time: str = "solve_seconds",
    by: str = "method",
    labels: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """Draw time against certified residual: per method a line through its settings, medians over
    problems and repeats.

    Filled: at least half of the runs kept the tolerance. The Pareto front, where nothing is both
    faster and more accurate, is drawn in grey. A residual below FLOOR of its tolerance is drawn at
    FLOOR. Labels stand where the lines end, too.

    Parameters
    ----------
    table : The rows.
    time : The column with the times [s].
    by : The column whose values have a line each.
    labels : Short labels by the names of methods.

    Returns
    -------
    The figure of matplotlib.
    """
    figure, ax = make_figure()
    points, ends = [], []
    for (name, rows), style in zip(groups(table, by), styles()):
        name = short_label(name, labels)
        settings = rows.groupby("tolerance").agg(
            {time: "median", "residual": "median", "success": "mean"}
        )  # settings of the same tolerance are one point
        settings = settings.sort_index(ascending=False)
        shown = settings[np.isfinite(settings["residual"])]
        floor = FLOOR * shown.index.to_numpy(float)
        x, y = shown[time].to_numpy(), np.maximum(shown["residual"].to_numpy(), floor)
        ends += [(x[-1], y[-1], name, style["color"])] if len(x) else []
        ax.loglog(x, y, "-", color=style["color"], lw=1, alpha=0.7)
        good = shown["success"].to_numpy() >= 0.5
        options = {"ls": "none", "marker": style["marker"], "color": style["color"], "ms": 6}
        if good.any():
            ax.loglog(x[good], y[good], label=name, **options)
        ax.loglog(x[~good], y[~good], mfc="white", label="" if good.any() else name, **options)
        points += list(zip(x, y))
    label_ends(ax, ends)
    front = _pareto(np.array(points))
    ax.step(
        front[:, 0],
        front[:, 1],
        where="post",
        color="#bbbbbb",
        lw=5,
        zorder=0,
        label="Pareto front",
    )
    ax.set(xlabel=NAMES.get(time, time) + ", median", ylabel="natural-map residual [-], median")
    set_ticks(ax.xaxis)
    return add_legend(figure, ax)


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
    labels: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """Draw a profile: the share of the instances solved within a factor of the best method's time
    on each.

    An instance is a problem at a setting and start. Times are medians over repeats, and a method
    that fails once has failed.

    Source: Dolan, More (2002), Benchmarking optimization software with performance profiles, Math.
    Program. 91, 201-213.

    Parameters
    ----------
    table : The rows.
    metric : The column with the times [s].
    by, labels : As for `speed_accuracy`.

    Returns
    -------
    The figure of matplotlib.
    """
    figure, ax = make_figure()
    times = table[metric].where(table["success"], np.inf)
    medians = (
        table.assign(_time=times)
        .groupby([*INSTANCE, by])["_time"]
        .agg(lambda t: t.median() if np.isfinite(t).all() else np.inf)
    )
    wide = medians.unstack(by)
    solvable = wide[np.isfinite(wide.min(axis=1))]
    ratio = solvable.div(solvable.min(axis=1), axis=0)
    largest = 1.3 * max(
        2.0, float(np.nanmax(ratio.to_numpy()[np.isfinite(ratio.to_numpy())], initial=2.0))
    )
    for (full, _), style in zip(groups(table, by), styles()):
        name = short_label(full, labels)
        sorted_ratios = np.sort(ratio[full].dropna().to_numpy())
        sorted_ratios = sorted_ratios[np.isfinite(sorted_ratios)]
        share = np.arange(1, len(sorted_ratios) + 1) / len(wide)
        x, y = (
            np.concatenate([[1.0], sorted_ratios, [largest]]),
            np.concatenate([[0.0], share, share[-1:] if len(share) else [0.0]]),
        )
        ax.step(
            x,
            y,
            where="post",
            color=style["color"],
            ls=style["ls"],
            lw=1.6,
            label=f"{name} ({len(share)})",
        )
    what = NAMES.get(metric, metric).partition(" [")[0]
    ax.set(
        xscale="log",
        xlim=(1, largest),
        ylim=(0, 1.03),
        xlabel=f"ratio: {what} / the best method's [-]",
    )
    ax.set_ylabel(f"share of the {len(wide)} instances solved")
    return add_legend(figure, ax, "method (solved)")


def time_against_size(
    table: pd.DataFrame,
    size: str = "contacts",
    metric: str = "solve_seconds",
    by: str = "method",
    labels: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """Draw the median time of successful runs against size, with the exponent p of time ~ size^p
    from the larger sizes.

    Parameters
    ----------
    table : The rows.
    size : The column with the sizes.
    metric : The column with the times [s].
    by, labels : As for `speed_accuracy`.

    Returns
    -------
    The figure of matplotlib.
    """
    figure, ax = make_figure()
    ends = []
    look = {name: style for (name, _), style in zip(groups(table, by), styles())}
    for full, rows in groups(table[table["success"]], by):
        name, style = short_label(full, labels), look[full]
        medians = rows.groupby(size)[metric].median()
        x, y = medians.index.to_numpy(float), medians.to_numpy()
        exponent = fitted_exponent(x, y)
        ends.append((x[-1], y[-1], name, style["color"]))
        label = name + ("" if np.isnan(exponent) else f": {exponent:.1f}")
        ax.loglog(
            x,
            y,
            marker=style["marker"],
            color=style["color"],
            ls=style["ls"],
            ms=5,
            lw=1.2,
            label=label,
        )
    label_ends(ax, ends)
    ax.set(xlabel=NAMES.get(size, size), ylabel=NAMES.get(metric, metric) + ", median")
    set_ticks(ax.xaxis)
    return add_legend(figure, ax, "method: exponent")


def fitted_exponent(x: np.ndarray, y: np.ndarray) -> float:
    """Fit the exponent p of y ~ x^p by least squares over the larger half of the sizes, three at
    least.

    Parameters
    ----------
    x, y : (n,) sizes and times.

    Returns
    -------
    The exponent; nan with fewer than three sizes.
    """
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
    grey where no run
    succeeded.

    The cells hold their numbers, unless a map has more than CELLS of them. Runs that ended by the
    method's own criterion above the tolerance ("settled") show their value too. Where one axis is
    the friction coefficient and the experiment diagnosed its problems, lines on top: below the
    dashed one the alternating iteration contracts for every load, at the full one it does not for
    some load.

    Parameters
    ----------
    table : The rows.
    x, y : The columns of the two parameters.
    value : The column that is shown.
    by : The column whose values have a panel each.

    Returns
    -------
    The figure of matplotlib.
    """
    from matplotlib.colors import LogNorm, Normalize

    parts = groups(table, by)
    columns = min(2, len(parts))
    figure, axes = make_figure(
        columns, -(-len(parts) // columns), (WIDTH / columns, 2.5 if columns > 1 else 3.8)
    )
    grids = [(name, rows, _grid(rows, x, y, value)) for name, rows in parts]
    shown = np.concatenate([grid.to_numpy(float).ravel() for _, _, grid in grids])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    low, high = (float(shown.min()), float(shown.max())) if len(shown) else (0.1, 1.0)
    norm = Normalize(0, 1) if value == "success" else LogNorm(low, high if high > low else 2 * low)
    for number, (ax, (name, rows, grid)) in enumerate(zip(np.ravel(axes), grids)):
        ax.set_facecolor("#cccccc")
        ax.patch.set(hatch="xx", edgecolor="#999999")
        write_numbers(ax, grid, norm, 7 if columns > 1 else 8)
        mesh = ax.imshow(
            grid.to_numpy(float), norm=norm, cmap="viridis", origin="lower", aspect="auto"
        )
        ax.set_title(name, fontsize=9)
        ax.set_xlabel(NAMES.get(x, x), fontsize=8 if len(parts) > 1 else None)
        ax.set_ylabel(
            NAMES.get(y, y) if number % columns == 0 else "", fontsize=8 if len(parts) > 1 else None
        )
        for axis, index in ((ax.xaxis, grid.columns), (ax.yaxis, grid.index)):
            room = 26 if axis is ax.xaxis and len(parts) > 1 else 60  # characters
            names = [short_tick(v) for v in index]
            ticks = range(0, len(index), -(-sum(len(name) + 1 for name in names) // room))
            axis.set_ticks(list(ticks), [names[i] for i in ticks], fontsize=8)
        _thresholds(ax, rows, x, y, grid)
    for ax in np.ravel(axes)[len(parts) :]:
        ax.set_axis_off()
    handles = {line.get_label(): line for ax in np.ravel(axes) for line in ax.get_lines()}
    if handles:
        figure.legend(
            handles=list(handles.values()),
            loc="outside lower center",
            ncols=1,
            frameon=False,
            fontsize=8,
        )
    label = "share of runs solved" if value == "success" else NAMES.get(value, value) + ", median"
    figure.colorbar(mesh, ax=axes, label=label, location="top", shrink=0.8, aspect=30)
    return figure


def _grid(rows: pd.DataFrame, x: str, y: str, value: str) -> pd.DataFrame:
    if value == "success":
        values = rows["success"].astype(float)
    else:
        values = rows[value].where(rows["success"] | (rows["status"] == "settled"))
    how = "mean" if value == "success" else "median"
    return rows.assign(_value=values).pivot_table(
        index=y, columns=x, values="_value", aggfunc=how, dropna=False
    )


def _thresholds(ax: Any, rows: pd.DataFrame, x: str, y: str, grid: pd.DataFrame) -> None:
    """Lines at the thresholds of friction, in the places of the cells (logarithmic between their
    values).
    """
    if "problem.mu" not in (x, y):
        return
    other, frictions = (y, grid.columns) if x == "problem.mu" else (x, grid.index)
    cells = np.log(np.asarray(frictions, dtype=float).clip(1e-300))
    places = {v: i for i, v in enumerate(grid.index if x == "problem.mu" else grid.columns)}
    lines = (
        ("guaranteed_mu", "--", "alternating iteration contracts for every load below"),
        ("alternating_mu", "-", "does not for some load from here on"),
    )
    for column, style, label in lines:
        known = rows.groupby(other)[column].median().dropna()
        known = known[np.isfinite(known) & (known > 0)]
        along = np.interp(
            np.log(known.to_numpy()), cells, np.arange(len(cells)), left=np.nan, right=np.nan
        )
        line = along, np.array([places[v] for v in known.index])
        if np.isfinite(along).sum() > 1:
            ax.plot(
                *(line if x == "problem.mu" else line[::-1]),
                style,
                color="#D55E00",
                lw=2,
                label=label,
            )


def convergence(
    table: pd.DataFrame,
    x: str = "iterations",
    by: str = "method",
    labels: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """Draw the natural-map residual after each outer iteration, or against time, of the first
    repeat of each method.

    Parameters
    ----------
    table : The rows, with their histories.
    x : "iterations" or "seconds".
    by, labels : As for `speed_accuracy`.

    Returns
    -------
    The figure of matplotlib.

    Raises
    ------
    InputError : For another `x`.
    """
    if x not in ("iterations", "seconds"):
        raise InputError("convergence histories are drawn against 'iterations' or 'seconds'.")
    figure, ax = make_figure()
    for (name, rows), style in zip(groups(table, by), styles()):
        history = json.loads(rows.sort_values("repeat")["history"].iloc[0])
        if not history:
            continue
        residual, seconds, iterations = history
        along = iterations if x == "iterations" else seconds
        residual = np.maximum(residual, max(LEAST_RESIDUAL, FLOOR * float(rows["tolerance"].min())))
        name = short_label(name, labels)
        ax.loglog(
            along,
            residual,
            marker=style["marker"],
            ms=3,
            lw=1,
            color=style["color"],
            ls=style["ls"],
            label=name,
        )
    ax.set(
        xlabel="outer iteration" if x == "iterations" else "seconds",
        ylabel="natural-map residual [-]",
    )
    return add_legend(figure, ax)


FIGURES: dict[str, Callable[..., Any]] = {
    f.__name__: f
    for f in (speed_accuracy, performance_profile, time_against_size, stability_map, convergence)
}
