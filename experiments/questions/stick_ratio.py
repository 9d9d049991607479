"""How large must the foundation be for the rigid punch's stick zone to be that of a half-plane?"""

from __future__ import annotations

import time

from matplotlib.figure import Figure

from contactopt import Material, reduce, scenes, solve
from contactopt.analytic import dundurs, stick_ratio
from contactopt.figures.plots import BLUE, GREEN, GREY, ORANGE
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import equivalent_half_width
from experiments.report import write

EXACT = stick_ratio(0.3, dundurs(None, Material(1.0, 0.3))[1])  # plane strain, mu = nu = .3
WIDTHS = (160.0, 640.0, 1600.0, 6400.0, 25600.0, 102400.0)
ELEMENTS = (64, 128, 256)


def measure(width: float, elements: int) -> dict[str, object]:
    scene = scenes.flat_punch(
        2,
        rigid="punch",
        mu=0.3,
        foundation_width=width,
        foundation_height=width / 2,
        elements=elements,
    )
    start = time.perf_counter()
    problem = reduce(scene)
    solution = solve(problem)
    sticking = contact_status(problem, solution.reactions).stick
    ratio = equivalent_half_width(scene, float(problem.areas[sticking].sum())) / 20
    return {
        "foundation width / a": width / 20,
        "elements per a": elements,
        "c / a": ratio,
        "error": ratio - EXACT,
        "residual": solution.residual,
        "iterations": solution.iterations,
        "seconds": time.perf_counter() - start,
    }


def draw(rows: list[dict]) -> Figure:
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    ax = figure.subplots()
    for elements, colour, style in zip(ELEMENTS, (BLUE, ORANGE, GREEN), ("o-", "s--", "^:")):
        chosen = [row for row in rows if row["elements per a"] == elements]
        x = [row["foundation width / a"] for row in chosen]
        ax.semilogx(
            x,
            [row["c / a"] for row in chosen],
            style,
            color=colour,
            mfc="white",
            label=f"{elements} elements per a",
        )
    ax.axhline(EXACT, color=GREY, lw=1, label="half-plane (exact)")
    ax.set(xlabel="foundation width / punch half-width [-]", ylabel="stick ratio c / a [-]")
    ax.legend(frameon=False)
    return figure


TEXT = """How large is the stick zone under a rigid flat punch? The punch presses on an elastic foundation that is clamped below, in plane strain,
with nu = mu = .3. The *stick ratio* is the half-width of the stick zone over that of the contact.
On a half-plane it is exactly {exact:.6f} (Spence's problem, fully coupled).

A finite foundation is squeezed and held sideways. This lowers the tangential load, so that the
stick zone becomes too wide. Its error vanishes only when the foundation is about a thousand
half-widths wide. On a mesh that is graded away from the contact, so large a foundation costs
little.

{{rows}}
"""

if __name__ == "__main__":
    rows = [measure(width, elements) for elements in ELEMENTS for width in WIDTHS]
    write(
        "stick_ratio",
        "Stick zone under a rigid flat punch",
        TEXT.format(exact=EXACT),
        {"rows": rows},
        {"stick_ratio": draw(rows)},
    )
