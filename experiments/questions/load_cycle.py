"""What does a load path cost in accuracy and time: how many states, how much energy?"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg

from contactopt import scenes
from contactopt.cards import force_unit
from contactopt.figures.plots import contact_line, contact_place, energies, loop
from contactopt.figures.style import (
    BLUE,
    COLOURS,
    GREY,
    LETTERS,
    ORANGE,
    add_legend,
    label_ends,
    paper_axes,
    symbols,
)
from contactopt.solving.follow import follow
from contactopt.solving.paths import PathResult
from experiments.questions.accuracy.sheared import exact_loss, loop_area
from experiments.report import REPORTS, figures_alone, save_figures, stored, template, write

SHEAR = 45.0  # .9 mu force
STEPS = (1, 2, 4, 8, 16, 32)
INCREMENTS = (1, 5, 10, 20, 40, 80, 160)
FRICTION = (0.1, 0.3, 0.5)
FRAMES, FILM = 10, 110  # of a film: pictures per second, pixels per inch


def cycle(steps: int) -> dict[str, object]:
    start = time.perf_counter()
    states = scenes.shear_cycle(2, steps=steps, shear=SHEAR)
    history = follow(states).history
    exact = exact_loss(2, states[-1], SHEAR)
    lost = float(history["friction_work"][-1] - history["friction_work"][steps])
    area = loop_area(history, steps)
    step = float(history["step_work"][-1] - history["step_work"][steps])
    return {
        "steps to the largest shear": steps,
        "states": len(states),
        "friction work, rel. error": lost / exact - 1,
        "loop's area, rel. error": area / exact - 1,
        "error of the steps / loss": step / exact,
        "energy balance": float(history["energy_error"].max()),
        "Newton steps per state": float(np.mean(history["iterations"])),
        "seconds": time.perf_counter() - start,
    }


def growing(mu: float, steps: int) -> dict[str, object]:
    states = scenes.growing_indentation(mu=mu, steps=steps, elements=160)
    path = follow(states)
    history, exact = path.history, states[-1].reference
    ratio = exact.stick_half_width / exact.half_width
    last = slice(-max(1, steps // 8), None)
    return {
        "mu": mu,
        "increments": steps,
        "c / a": float(
            np.mean(history["stick_half_width"][last] / history["contact_half_width"][last])
        ),
        "exact": ratio,
        "error": (
            float(np.mean(history["stick_half_width"][last] / history["contact_half_width"][last]))
            - ratio
        ),
        "a, rel. error": history["contact_half_width"][-1] / exact.half_width - 1,
        "approach, rel. error": history["approach"][-1] / exact.approach - 1,
        "friction work / external work": (
            history["friction_work"][-1] / history["external_work"][-1]
        ),
        "energy balance": float(history["energy_error"].max()),
    }


def draw_cycle(path: PathResult) -> Any:
    figure, (left, right) = paper_axes(2, wide=True)
    loop(path, left)
    energies(path, right)
    return figure


def draw_growing(rows: list[dict]) -> Any:
    figure, (ax,) = paper_axes()
    ends = []
    for mu, colour in zip(FRICTION, COLOURS):
        chosen = [row for row in rows if row["mu"] == mu]
        x, y = ([row[key] for row in chosen] for key in ("increments", "c / a"))
        ax.semilogx(x, y, "o-", color=colour)
        ax.axhline(chosen[0]["exact"], color=colour, ls="--", lw=0.8)
        ends.append((x[-1], y[-1], rf"$\mu$ = {mu:g}", colour))
    ax.set(xlabel="load increments [-]", ylabel="stick ratio $c / a$ [-] (dashed: exact)")
    label_ends(ax, ends)
    return figure


def animate(path: PathResult, file: Path) -> None:
    """The path as a GIF: tangential traction within its bounds, and the point on the loop."""
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
    across, force = path.history["shift"], path.history["shear_force"]
    right.plot(across, force, color=GREY, lw=0.8)
    (past,) = right.plot([], [], color=BLUE)
    (point,) = right.plot([], [], "o", color=ORANGE)
    right.set(xlabel=f"shift [{scene.units[0]}]", ylabel=f"shear force [{force_unit(scene.units)}]")
    figure.suptitle(f"{scene.name}, {symbols(scene.friction)}", fontsize=LETTERS)

    def draw(state: int) -> tuple[Any, ...]:
        upper.set_ydata(bound[state])
        lower.set_ydata(-bound[state])
        traction.set_ydata(shear[state])
        past.set_data(across[: state + 1], force[: state + 1])
        point.set_data(across[state : state + 1], force[state : state + 1])
        return upper, lower, traction, past, point

    film = FuncAnimation(figure, draw, frames=len(path.states))
    film.save(file, writer=PillowWriter(fps=FRAMES), dpi=FILM)


TEXT = template(__file__)

if __name__ == "__main__":
    (REPORTS / "load_cycle").mkdir(parents=True, exist_ok=True)
    film = follow(scenes.shear_cycle(3, steps=8, shear=SHEAR))
    animate(film, REPORTS / "load_cycle" / "film.gif")
    if figures_alone():
        increments = stored("load_cycle", "increments")
        figures = {"cycle": draw_cycle(film), "growing": draw_growing(increments)}
        raise SystemExit(save_figures("load_cycle", figures))
    cycles = [cycle(steps) for steps in STEPS]
    increments = [growing(mu, steps) for mu in FRICTION for steps in INCREMENTS]
    write(
        "load_cycle",
        "Load paths",
        TEXT,
        {"cycles": cycles, "increments": increments},
        {"cycle": draw_cycle(film), "growing": draw_growing(increments)},
    )
