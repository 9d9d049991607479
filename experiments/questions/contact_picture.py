"""What does a contact look like? The picture of the README: a cylinder, pressed on a flat body and
pushed sideways.

Computed tractions are drawn on the exact ones of Hertz and of Cattaneo and Mindlin, with the zones
of stick and slip named.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from contactopt import scenes
from contactopt.coupling.back_to_bodies import recover
from contactopt.figures.pieces import outline, pieces, triangles
from contactopt.figures.style import (
    BLUE,
    GREEN,
    GREY,
    LETTERS,
    ORANGE,
    add_colours,
    add_legend,
    paper_axes,
    save_figure,
)
from contactopt.meshes.cells import elements_of
from contactopt.solving.follow import follow
from contactopt.solving.paths import PathResult
from experiments.report import REPORTS

SHEAR = 40.0  # N of the 50 N at which the cylinder would slide
MAGNIFIED = 5.0  # displacements as drawn


def draw_bodies(ax, path: PathResult, a: float) -> None:  # type: ignore[no-untyped-def]
    """The deformed bodies about the contact, coloured by von Mises stress, with their forces."""
    bodies = recover(path.reduction, path.solution)
    top = max(float(np.quantile(body.von_mises, 0.999)) for body in bodies)
    for body in bodies:
        x, y = body.mesh.p + MAGNIFIED * body.displacement
        kind, elements = elements_of(body.mesh)
        cells = triangles(pieces(kind, elements))
        colours = ax.tripcolor(
            x, y, cells, body.von_mises, shading="gouraud", cmap="cividis", vmin=0, vmax=top
        )
        rim = outline(kind, elements).T
        ax.plot(x[rim], y[rim], color="black", lw=0.6)
    arrow = {"arrowstyle": "-|>", "lw": 1.5, "color": ORANGE, "mutation_scale": 12}
    middle = float(np.mean([MAGNIFIED * body.displacement[1, 0] for body in bodies]))
    ax.annotate("", (0, 1.3 * a + middle), (0, 2.3 * a + middle), arrowprops=arrow)
    ax.annotate("", (1.2 * a, 1.9 * a + middle), (0.2 * a, 1.9 * a + middle), arrowprops=arrow)
    ax.text(
        -0.1 * a,
        1.9 * a + middle,
        "pressed",
        color="white",
        ha="right",
        va="center",
        fontsize=LETTERS,
    )
    ax.text(1.25 * a, 1.9 * a + middle, "pushed", color="white", va="center", fontsize=LETTERS)
    ax.set(xlim=(-2.6 * a, 2.6 * a), ylim=(-2.6 * a + middle, 2.6 * a + middle), aspect="equal")
    ax.set(xlabel="$x$ [mm]", ylabel="$y$ [mm]")
    add_colours(colours, ax, "von Mises stress [MPa]", shrink=0.85)


def draw_tractions(ax, path: PathResult, x: np.ndarray) -> None:  # type: ignore[no-untyped-def]
    """Pressure and friction along the contact, computed and exact."""
    problem, reference = path.reduction.problem, path.reduction.scene.reference
    a, c, peak = reference.half_width, reference.stick_half_width, reference.peak
    fine = np.linspace(-a, a, 801)
    for low, high, name, colour in (
        (-a, -c, "slip", ORANGE),
        (-c, c, "stick", GREEN),
        (c, a, "slip", ORANGE),
    ):
        ax.axvspan(low, high, color=colour, alpha=0.12, lw=0)
        place = (low + high) / 2, 1.08 * peak
        ax.text(*place, name, ha="center", color=colour, weight="bold", fontsize=LETTERS)
    ax.plot(fine, reference.pressure(fine), color="black", label="exact")
    ax.plot(fine, reference.shear(fine), color="black")
    r = path.solution.reactions / problem.areas[:, None]
    ax.plot(x, r[:, 0], "o", color=BLUE, label="pressure, computed")
    ax.plot(x, -r[:, 1], "s", color=GREY, label="friction, computed")
    ax.set(xlim=(-1.15 * a, 1.15 * a), ylim=(0, 1.22 * peak))
    ax.set(xlabel="$x$ [mm]", ylabel="traction [MPa]")
    add_legend(ax)


def picture() -> Any:
    """Two states are enough: while the push grows, no point turns its slip round."""
    path = follow(scenes.shear_cycle(2, steps=1, shear=SHEAR)[:2])
    assert path.solved
    x = path.reduction.problem.coordinates[0]
    figure, (left, right) = paper_axes(2, wide=True, height=2.7)
    draw_bodies(left, path, path.reduction.scene.reference.half_width)
    draw_tractions(right, path, x)
    return figure


if __name__ == "__main__":
    folder = REPORTS / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    save_figure(picture(), folder / "contact.png")
