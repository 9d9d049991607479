"""Figures of load paths: the loop of force and displacement, energies, and both in motion with the
tractions.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from contactopt.cards import force_unit
from contactopt.figures.plots import contact_line, contact_place
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
from contactopt.files.writing import whole_file
from contactopt.solving.paths import PathResult

FRAMES, FILM = 10, 110  # of a film: pictures per second, pixels per inch


def loop(path: PathResult, ax: Any = None) -> Any:
    """Shear force against shift where the path has a shear, else normal force against approach."""
    ax = make_axes(ax)
    x, y, labels = _loop(path)
    ax.plot(x, y, "o-", color=BLUE)
    ax.plot(x[:1], y[:1], "o", color=GREEN, label="first state")
    ax.plot(x[-1:], y[-1:], "s", color=ORANGE, label="last state")
    ax.set(xlabel=labels[0], ylabel=labels[1])
    add_legend(ax)
    return ax


def energies(path: PathResult, ax: Any = None) -> Any:
    """Work since the first state: lost, done by friction, and the error of the steps."""
    ax = make_axes(ax)
    since = {key: value - value[0] for key, value in path.history.items()}
    state = np.arange(1, len(path.states) + 1)
    lost = since["external_work"] - since["elastic_energy"]
    ax.plot(state, lost, "o", color=GREY, mfc="white", label="external work $-$ elastic energy")
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
    title = f"{scene.name}, {symbols(scene.friction)}, {len(path.states)} states"
    figure.suptitle(title, fontsize=LETTERS)
    return figure


def animate(path: PathResult, file: str | Path) -> None:
    """The path as a GIF: tangential traction within its bounds, and the point on the loop."""
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure, (left, right) = paper_axes(2, wide=True)
    FigureCanvasAgg(figure)
    problem, scene = path.reduction.problem, path.states[-1].scene
    line = contact_line(problem)
    x, area = contact_place(problem)[line], problem.areas[line]
    bound = [problem.law.bound_along(s.solution.reactions)[line] / area for s in path.states]
    for own in bound:
        own[np.isinf(own)] = 0.0  # glued contacts have none
    shear = [-s.solution.reactions[line, 1] / area for s in path.states]
    peak = float(np.max(bound))
    (upper,) = left.plot(x, bound[0], "--", color=GREY, label=r"bound $\pm\mu p$")
    (lower,) = left.plot(x, -bound[0], "--", color=GREY)
    look = {"color": BLUE, "label": "traction on the lower body"}
    (traction,) = left.plot(x, shear[0], "o-", **look)
    where = ", $y$ = 0" if problem.dim == 3 else ""
    left.set(xlabel=f"${scene.components[0]}$ [{scene.units[0]}]{where}")
    left.set(ylabel=f"tangential traction [{scene.units[1]}]", ylim=(-1.15 * peak, 1.15 * peak))
    add_legend(left)
    across, force, labels = _loop(path)
    right.plot(across, force, color=GREY, lw=0.8)
    (past,) = right.plot([], [], color=BLUE)
    (point,) = right.plot([], [], "o", color=ORANGE)
    right.set(xlabel=labels[0], ylabel=labels[1])
    figure.suptitle(f"{scene.name}, {symbols(scene.friction)}", fontsize=LETTERS)

    def draw(state: int) -> tuple[Any, ...]:
        upper.set_ydata(bound[state])
        lower.set_ydata(-bound[state])
        traction.set_ydata(shear[state])
        past.set_data(across[: state + 1], force[: state + 1])
        point.set_data(across[state : state + 1], force[state : state + 1])
        return upper, lower, traction, past, point

    film = FuncAnimation(figure, draw, frames=len(path.states))
    with whole_file(file) as beside:
        film.save(beside, writer=PillowWriter(fps=FRAMES), dpi=FILM)


def _loop(path: PathResult) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    history, (force, length) = path.history, _units(path)
    sheared = np.ptp(history["shift"]) > 1e-6 * np.ptp(history["approach"])
    keys = ("shift", "shear_force") if sheared else ("approach", "normal_force")
    labels = f"{keys[0]} [{length}]", f"{keys[1].replace('_', ' ')} [{force}]"
    return history[keys[0]], history[keys[1]], labels


def _units(path: PathResult) -> tuple[str, str]:
    """Names of the units of force and length."""
    length, stress = path.states[0].scene.units
    return force_unit((length, stress)), length
