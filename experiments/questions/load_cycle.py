"""What does a load path cost in accuracy and time: how many states, how much energy?"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.figures.animation import animate, energies, loop
from contactopt.figures.style import COLOURS, label_ends, paper_axes
from contactopt.solving.follow import follow
from contactopt.solving.paths import PathResult
from experiments.questions.accuracy.sheared import exact_loss, loop_area
from experiments.report import REPORTS, figures_alone, save_figures, stored, write

SHEAR = 45.0  # .9 mu force
STEPS = (1, 2, 4, 8, 16, 32)
INCREMENTS = (1, 5, 10, 20, 40, 80, 160)
FRICTION = (0.1, 0.3, 0.5)


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


TEXT = """**A cycle of shear.** Two bodies of one material, in 3D, are pressed by 100 N and sheared
to and fro by .9 of the friction bound. At every step the energies balance to rounding: external
work = elastic energy + friction work + error of the steps.

![film](film.gif)

**How many states does a cycle need?** The scene is in plane strain with T = .9 mu P. The table
compares the loss over the closed cycle, from the first +T on, with the exact one. The friction work
is right even with few steps from turn to turn, because slip goes one way between turns. The area of
the loop becomes worse with few states, because it is drawn through them.

{cycles}

**Growing contact of dissimilar bodies.** A rigid sphere is pressed on an elastic half-space (nu =
.3). With friction the stick zone is a fixed share c/a of the contact, and one large step misses
this share by far. The load grows to 100 N in such a way that the contact radius grows evenly. There
are 160 elements across the last radius. c/a is the mean over the last eighth of the increments. The
error is about of first order in the increment, because a point that stops slipping within a step
keeps the displacement that it had at the start of the step.

{increments}
"""

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
