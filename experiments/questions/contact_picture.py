"""What does a contact look like? The picture of the README: a cylinder, pressed on a flat body and
pushed sideways.

Computed tractions are drawn on the exact ones of Hertz and of Cattaneo and Mindlin, with the zones
of stick and slip named.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from contactopt import scenes
from contactopt.coupling.back_to_bodies import recover
from contactopt.figures.pieces import outline, pieces, triangles
from contactopt.figures.plots import BLUE, GREEN, GREY, ORANGE
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
        ax.plot(x[rim], y[rim], color="black", lw=1)
    arrow = {"arrowstyle": "-|>", "lw": 2, "color": ORANGE, "mutation_scale": 18}
    middle = float(np.mean([MAGNIFIED * body.displacement[1, 0] for body in bodies]))
    ax.annotate("", (0, 1.3 * a + middle), (0, 2.3 * a + middle), arrowprops=arrow)
    ax.annotate("", (1.2 * a, 1.9 * a + middle), (0.2 * a, 1.9 * a + middle), arrowprops=arrow)
    ax.text(-0.1 * a, 1.9 * a + middle, "pressed", color="white", ha="right", va="center")
    ax.text(1.25 * a, 1.9 * a + middle, "pushed", color="white", va="center")
    ax.set(xlim=(-2.6 * a, 2.6 * a), ylim=(-2.6 * a + middle, 2.6 * a + middle), aspect="equal")
    ax.set(
        xlabel="x [mm]",
        ylabel="y [mm]",
        title="a rubber cylinder on a flat block, near the contact",
    )
    ax.figure.colorbar(colours, ax=ax, label="von Mises stress [MPa]", shrink=0.85)


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
        ax.text((low + high) / 2, 1.08 * peak, name, ha="center", color=colour, weight="bold")
    ax.plot(fine, reference.pressure(fine), color="black", lw=1.2, label="exact")
    ax.plot(fine, reference.shear(fine), color="black", lw=1.2)
    r = path.solution.reactions / problem.areas[:, None]
    ax.plot(x, r[:, 0], "o", ms=4.5, color=BLUE, label="pressure, computed")
    ax.plot(x, -r[:, 1], "s", ms=4.5, color=GREY, label="friction, computed")
    ax.set(
        xlim=(-1.15 * a, 1.15 * a), ylim=(0, 1.22 * peak), xlabel="x [mm]", ylabel="traction [MPa]"
    )
    ax.set_title("what the contact carries")
    ax.legend(frameon=False, loc="center", bbox_to_anchor=(0.5, 0.55))


def picture() -> Figure:
    """Two states are enough: while the push grows, no point turns its slip round."""
    path = follow(scenes.shear_cycle(2, steps=1, shear=SHEAR)[:2])
    assert path.solved
    x = path.reduction.problem.coordinates[0]
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.15))
    draw_bodies(left, path, path.reduction.scene.reference.half_width)
    draw_tractions(right, path, x)
    return figure


if __name__ == "__main__":
    folder = REPORTS / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    picture().savefig(folder / "contact.png", dpi=110)
