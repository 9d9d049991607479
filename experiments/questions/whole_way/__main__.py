"""How much accuracy does a second buy on the whole way, from the mesh to the answer?

Scenes with exact answers are solved on finer and finer meshes in every way that fits them. A second
table sets the tolerance of the solver against the mesh. The environment variables TAMAAS, GETFEM
and KRATOS name Pythons that have these peers.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np

from contactopt import scenes, solve
from contactopt.figures.style import LETTERS, draw_lines, paper_axes
from contactopt.readings.quantities import value_of
from contactopt.solving.solve_scene import Options
from contactopt.solving.zone import solve_zone
from experiments.questions.accuracy.half_space import flat, indenter
from experiments.questions.whole_way.ours import (
    FINEST,
    QUANTITIES,
    SHORT,
    Row,
    adaptive,
    cattaneo,
    half_space,
    meshed,
    quarter,
    rough,
    tamaas,
)
from experiments.questions.whole_way.peers import CODES, hertz_line
from experiments.report import measure, stored, template

LARGE, SMALL = 1e4, 20.0  # bodies of graded and of uniform meshes over the half-width
TOLERANCES = tuple(10.0**-power for power in range(1, 9))
MESHES = (4, 8, 16, 32, 64)
FORMS = ("explicit", "implicit")  # of Q, on graded linear meshes
MARGIN = 0.1  # of the mesh's own error, within which a tolerance no longer matters


def runs() -> Iterator[tuple[str, str, float, Callable[[], Row]]]:
    """Scene, way, size and what makes the row."""
    both = ("peak", "width")
    kinds = {"Hertz, point": "axisymmetric", "Hertz, line": "plane-strain"}
    for name, kind in kinds.items():
        for n in (2, 4, 8):
            uniform = indenter(kind, SMALL, n, uniform=True)
            yield name, "uniform, linear", n, lambda s=uniform: meshed(s, both)
        for n in (4, 8, 16, 32, 64):
            graded = indenter(kind, LARGE, n)
            yield name, "graded, linear", n, lambda s=graded: meshed(s, both)
        for n in (2, 4, 8, 16, 32):
            curved = replace(indenter(kind, LARGE, n), degree=2)
            yield name, "graded, quadratic", n, lambda s=curved: meshed(s, both)
        for target in (3e-2, 1e-2, 3e-3):
            coarse = indenter(kind, LARGE, 4, loop=False)
            yield name, "adaptive", target, lambda s=coarse, t=target: adaptive(s, t)
    for form in FORMS:
        for n in (16, 32):
            graded = indenter("axisymmetric", LARGE, n)
            yield "Hertz, point", form, n, lambda s=graded, f=form: meshed(s, both, f)
    for n in (2, 3, 4):
        solid = quarter(n)
        yield "Hertz, point", "space, linear", n, lambda s=solid: meshed(s, ("peak",))
    for n in (16, 32, 64, 128):
        yield "Hertz, point", "half-space", n, lambda p=n: half_space(p)
    python = os.environ.get("TAMAAS") or (sys.executable if find_spec("tamaas") else "")
    for n in (16, 32, 64, 128) if python else ():
        yield "Hertz, point", "Tamaas", n, lambda p=n: tamaas(p, python)
    for n in (160, 256, 512):
        yield "rough surface", "half-space", n, lambda p=n: rough(p)
        if python:
            yield "rough surface", "Tamaas", n, lambda p=n: rough(p, python)
    for code in CODES:
        for n in (4, 8, 16, 32):
            yield "Hertz, line", code, n, lambda c=code, p=n: hertz_line(c, p, LARGE)
    for n in (8, 16, 32, 64):
        yield "Cattaneo, point", "half-space", n, lambda p=n: cattaneo(p)
        sheared = scenes.cattaneo(dim=2, elements=n)
        yield "Cattaneo, line", "graded, linear", n, lambda s=sheared: meshed(s, ("stick",))
        for degree, word in ((1, "linear"), (2, "quadratic")):
            strip = replace(flat("plane-strain", 0.3, elements=n // degree), degree=degree)
            yield "Spence, strip", f"graded, {word}", n, lambda s=strip: meshed(s, ("stick",))
            disc = replace(flat("axisymmetric", 0.0, elements=n // degree), degree=degree)
            yield "flat punch, disc", f"graded, {word}", n, lambda s=disc: meshed(s, ("approach",))


def rows() -> list[Row]:
    """All runs; one that cannot be made says why."""
    solve_zone(indenter("axisymmetric", LARGE, 4))  # imports and caches are nobody's time
    table = []
    for scene, way, size, act in runs():
        row: Row = {"scene": scene, "way": way, "size": size}
        row |= dict.fromkeys(("unknowns", "seconds", *QUANTITIES), np.nan)
        try:
            row |= act() | {"end": "solved"}
        except Exception as error:
            row |= {"end": str(error).partition(".")[0]}
        print(row, flush=True)
        table.append(row)
    return table


def tolerances() -> list[Row]:
    """The error of the peak pressure of Hertz's point contact over tolerance and mesh."""
    table = []
    for n in MESHES:
        scene = indenter("axisymmetric", LARGE, n)
        solved = solve_zone(scene, options=Options(tol=1e-11))
        problem, exact = solved.reduction.problem, scene.reference
        settled = value_of("pressure", solved.reduction, solved.solution) / exact.peak - 1
        for tol in TOLERANCES:
            solution = solve(problem, "nsgs", tol=tol, max_iterations=20000)
            value = value_of("pressure", solved.reduction, solution) / exact.peak - 1
            own = abs(value - settled)
            table.append(
                {"elements": n, "tolerance": tol, "residual": solution.residual, "error": value}
                | {"mesh alone": settled, "solver alone": own}
                | {"matters": bool(own > MARGIN * abs(settled))}
            )
            print(table[-1], flush=True)
    return table


def front(table: list[Row], name: str, quantity: str) -> set[tuple[str, float]]:
    """The runs that no other beats in both seconds and error, and how they are called."""
    own = [r for r in table if r["scene"] == name and np.isfinite(r[quantity])]
    out, best = set(), np.inf
    for row in sorted(own, key=lambda r: r["seconds"]):
        if abs(row[quantity]) < 0.99 * best:
            best = abs(row[quantity])
            out.add((row["way"], row["size"]))
    return out


def fronts(table: list[Row]) -> list[Row]:
    """For every scene and quantity the runs on the front, from the fastest to the most accurate."""
    out = []
    for name in dict.fromkeys(row["scene"] for row in table):
        for quantity in QUANTITIES:
            chosen = front(table, name, quantity)
            own = [r for r in table if r["scene"] == name and (r["way"], r["size"]) in chosen]
            for row in sorted(own, key=lambda r: r["seconds"]):
                out.append({"scene": name, "quantity": quantity, "way": row["way"]}
                           | {"size": row["size"], "seconds": row["seconds"]}
                           | {"error": row[quantity]})  # fmt: skip
    return out


def speed_figure(table: list[Row], scene: str) -> Any:
    """Error against CPU seconds: peak pressure and half-width of one of Hertz's contacts."""
    picture, axes = paper_axes(columns=2, wide=True)
    point = [r for r in table if r["scene"] == scene and r["way"] not in FORMS]
    ways = list(dict.fromkeys(r["way"] for r in point))
    for ax, quantity, label in zip(axes, ("peak", "width"), ("peak pressure", "half-width")):
        own = [r for r in point if np.isfinite(r[quantity])]
        lines = [
            (w, [r["seconds"] for r in own if r["way"] == w],
             [abs(r[quantity]) for r in own if r["way"] == w])
            for w in ways
        ]  # fmt: skip
        families = ["o-" if "linear" in w or "quadratic" in w else "s--" for w in ways]
        draw_lines(ax, lines, families)
        ax.set(xlabel="CPU time [s]", ylabel=f"relative error of the {label} [-]")
    return picture


def map_figure(table: list[Row]) -> Any:
    """The error of the peak over tolerance and mesh; hatched where the solver still matters."""
    picture, (ax,) = paper_axes()
    grid = np.array([abs(r["mesh alone"]) + r["solver alone"] for r in table]).reshape(
        len(MESHES), len(TOLERANCES)
    )
    matters = np.array([r["matters"] in (True, "True") for r in table]).reshape(grid.shape)
    drawn = ax.imshow(np.log10(np.maximum(grid, 1e-6)), cmap="cividis", aspect="auto",
                      origin="lower")  # fmt: skip
    for (row, column), value in np.ndenumerate(grid):
        dark = np.log10(max(value, 1e-6)) < np.mean(drawn.get_clim())
        text = f"{100 * value:.2g}" + ("*" if matters[row, column] else "")
        look = {"color": "w" if dark else "k", "fontsize": LETTERS}
        ax.text(column, row, text, ha="center", va="center", **look)
    ax.set_xticks(range(len(TOLERANCES)), [f"$10^{{{np.log10(t):.0f}}}$" for t in TOLERANCES])
    ax.set_yticks(range(len(MESHES)), [str(n) for n in MESHES])
    ax.set(xlabel="tolerance of the certificate [-]", ylabel="elements across the half-width [-]")
    ax.spines[:].set_visible(False)
    return picture


TEXT = template(__file__)

if __name__ == "__main__":
    measure(
        "whole_way",
        "Speed against accuracy of the whole way",
        TEXT.format(short=SHORT, small=SMALL, large=LARGE, finest=FINEST),
        {
            "rows": rows,
            "tolerances": tolerances,
            "fronts": lambda: fronts(stored("whole_way", "rows")),
        },
        lambda tables: {
            "speed": speed_figure(tables["rows"], "Hertz, point"),
            "speed_line": speed_figure(tables["rows"], "Hertz, line"),
            "tolerance": map_figure(tables["tolerances"]),
        },
    )
