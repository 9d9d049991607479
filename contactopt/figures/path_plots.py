"""Figures of load paths: the loop of force and displacement, and energies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import count, force_unit
from contactopt.figures.style import (
    BLUE,
    GREEN,
    GREY,
    LETTERS,
    ORANGE,
    add_legend,
    make_axes,
    paper_axes,
    symbols,
)
from contactopt.solving.paths import PathResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def loop(path: PathResult, ax: Axes | None = None) -> Any:
    """Shear force against shift where the path has a shear, else normal force against approach."""
    ax = make_axes(ax)
    x, y, labels = _loop(path)
    ax.plot(x, y, "o-", color=BLUE)
    ax.plot(x[:1], y[:1], "o", color=GREEN, label="first state")
    ax.plot(x[-1:], y[-1:], "s", color=ORANGE, label="last state")
    ax.set(xlabel=labels[0], ylabel=labels[1])
    add_legend(ax)
    return ax


def energies(path: PathResult, ax: Axes | None = None) -> Any:
    """Work since the first state: lost, done by friction, and the error of the steps."""
    ax = make_axes(ax)
    since = {key: value - value[0] for key, value in path.history.items()}
    state = np.arange(1, len(path.states) + 1)
    lost = since["external_work"] - since["elastic_energy"]
    ax.plot(state, lost, "o", color=GREY, mfc="white", label="external work less elastic energy")
    ax.plot(state, since["friction_work"], color=ORANGE, label="friction work")
    ax.plot(state, since["step_work"], ":", color=GREEN, label="error of the steps")
    force, length = _units(path)
    ax.set(xlabel="state [-]", ylabel=f"work since the first state [{force} {length}]")
    add_legend(ax)
    return ax


def path_figure(path: PathResult) -> Any:
    """The loop of force and displacement of a load path, and its energies below, as a figure."""
    figure, (above, below) = paper_axes(rows=2)
    loop(path, above)
    energies(path, below)
    scene = path.states[-1].scene
    title = f"{scene.name}, {symbols(scene.friction)}, {count(len(path.states), 'state')}"
    figure.suptitle(title, fontsize=LETTERS)
    return figure


def _loop(path: PathResult) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    history, (force, length) = path.history, _units(path)
    sheared = np.ptp(history["shift"]) > 1e-6 * np.ptp(history["approach"])
    keys = ("shift", "shear_force") if sheared else ("approach", "normal_force")
    own = next(name for name in history if name.startswith(keys[1]))  # of several pairs the first
    labels = f"{keys[0]} [{length}]", f"{own.replace('_', ' ').replace(':', ' of ')} [{force}]"
    return history[keys[0]], history[own], labels


def _units(path: PathResult) -> tuple[str, str]:
    """Names of the units of force and length."""
    length, stress = path.states[0].scene.units
    return force_unit((length, stress)), length
