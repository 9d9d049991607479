"""Does the axisymmetric scene reproduce Hertz, and what does the contact-zone loop buy?"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from contactopt import reduce, scenes, solve
from contactopt.figures.plots import BLUE, GREY, ORANGE
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import contact_edge, equivalent_half_width
from contactopt.scenes.scene import Scene
from contactopt.solving.zone import solve_zone
from experiments.report import write

ELEMENTS = (8, 16, 32, 64, 128)
WIDE = 1.25  # without the loop: the zone that is meshed, over Hertz's radius
FORCES = (100.0, 30.0, 10.0, 3.0, 1.0)


def default() -> list[dict[str, object]]:
    scene = scenes.sphere()
    solved = solve_zone(scene)
    reduction, solution, zones = solved.reduction, solved.solution, solved.zones
    problem, exact = reduction.problem, scene.reference
    pressure = solution.reactions[:, 0] / problem.areas
    smooth = solve(reduce(scenes.sphere(mu=0.0), zone=zones[-2]))
    change = np.abs(smooth.reactions[:, 0] / problem.areas - pressure)
    values = {
        "a / R": exact.half_width / 400,
        "peak pressure, relative error": pressure.max() / exact.peak - 1,
        "contact radius, relative error": zones[-1] / exact.half_width - 1,
        "approach, relative error (finite bodies)": -solution.multipliers[0] / exact.approach - 1,
        "force balance, relative error": solution.reactions[:, 0].sum() / 100 - 1,
        "friction against none, change of the peak pressure": (
            (smooth.reactions[:, 0] / problem.areas).max() / pressure.max() - 1
        ),
        "friction against none, largest change over the peak": change.max() / exact.peak,
        "certificate": solution.residual,
    }
    return [{"quantity": k, "value": float(v)} for k, v in values.items()]


def errors(scene: Scene, elements: int) -> dict[str, object]:
    exact = scene.reference
    solved = solve_zone(scene, elements)
    reduction, solution, zones = solved.reduction, solved.solution, solved.zones
    peak = (solution.reactions[:, 0] / reduction.problem.areas).max()
    fixed = reduce(scene, elements, zone=WIDE * exact.half_width)
    single = solve(fixed)
    area = float(fixed.areas[contact_status(fixed, single.reactions).touching].sum())
    return {
        "elements": elements,
        "nodes": fixed.contacts,
        "rounds": len(zones) - 1,
        "radius, loop": zones[-1] / exact.half_width - 1,
        "radius, no loop, extrapolated": (
            contact_edge(scene, fixed, single.reactions) / exact.half_width - 1
        ),
        "radius, no loop, nodes in contact": (
            equivalent_half_width(scene, area) / exact.half_width - 1
        ),
        "peak, loop": peak / exact.peak - 1,
        "peak, no loop": (single.reactions[:, 0] / fixed.areas).max() / exact.peak - 1,
    }


def falling(force: float) -> dict[str, object]:
    scene = scenes.sphere(
        radius=200.0, foundation_radius=400.0, foundation_height=400.0, force=force, elements=64
    )
    exact = scene.reference
    solved = solve_zone(scene)
    reduction, solution, zones = solved.reduction, solved.solution, solved.zones
    return {
        "force [N]": force,
        "a / R": exact.half_width / 200,
        "radius": zones[-1] / exact.half_width - 1,
        "peak": (solution.reactions[:, 0] / reduction.problem.areas).max() / exact.peak - 1,
        "approach": -solution.multipliers[0] / exact.approach - 1,
    }


def draw(loop: list[dict], load: list[dict]) -> Figure:
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    n = [row["nodes"] for row in loop]
    styles = (
        ("radius, loop", "o-", BLUE),
        ("radius, no loop, extrapolated", "s--", GREY),
        ("radius, no loop, nodes in contact", "^:", GREY),
        ("peak, loop", "o-", ORANGE),
        ("peak, no loop", "s--", ORANGE),
    )
    for key, style, colour in styles:
        left.loglog(n, [abs(row[key]) for row in loop], style, color=colour, label=key, mfc="white")
    left.set(xlabel="contact nodes [-]", ylabel="relative error against Hertz [-]")
    left.legend(frameon=False, fontsize=8)
    ratio = [row["a / R"] for row in load]
    for key, style, colour in (
        ("radius", "o-", BLUE),
        ("peak", "o-", ORANGE),
        ("approach", "s--", GREY),
    ):
        right.loglog(
            ratio, [abs(row[key]) for row in load], style, color=colour, label=key, mfc="white"
        )
    right.set(xlabel="a / R [-]", ylabel="relative deviation from Hertz [-]")
    right.legend(frameon=False)
    return figure


TEXT = """How accurate is Hertz contact, and what does the adaptation of the contact zone bring? The scene is the half sphere (R = 400 mm) on
a foundation (800 x 800 mm). Both have E = 5 MPa and nu = .3. The force is 100 N and mu = .5. There
are 32 elements across the contact radius, which is the default.

{default}

**The zone loop.** The *zone loop* meshes the scene again until the edge of the contact zone is a
node of the mesh. The table has the signed errors against Hertz on meshes with the same number of
contact nodes: with the loop, and on a zone that is meshed 1.25 times too wide. If the radius is
read off the nodes in contact, its error is a matter of luck, within half an element. A run reports
another half-width: it fits a parabola to the squares of the pressures, and takes the zero of this
parabola. Its error falls smoothly, with and without the loop. With the loop every element of the
zone is used.

{loop}

**Finite bodies.** The sphere is no half-space. At a fixed resolution (64 elements across the
radius, R = 200 mm) the deviations of the peak pressure and of the approach fall with a / R. The
deviation of the radius stays near the error of reading it on 64 elements, which the table above
shows.

{load}
"""

if __name__ == "__main__":
    loop = [errors(scenes.sphere(), elements) for elements in ELEMENTS]
    load = [falling(force) for force in FORCES]
    tables = {"default": default(), "loop": loop, "load": load}
    write(
        "hertz",
        "Hertz contact, with and without the contact-zone loop",
        TEXT,
        tables,
        {"errors": draw(loop, load)},
    )
