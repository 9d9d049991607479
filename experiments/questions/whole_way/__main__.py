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
from experiments.questions import elements as bricks
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
    rough,
    tamaas,
)
from experiments.questions.whole_way.peers import CODES, hertz_line
from experiments.report import measure, stored

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
        solid = bricks.scene(3, n, 1, "Q")
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


TEXT = """How much accuracy does a second buy, from the mesh to the answer? The scenes have exact
answers: Hertz's contacts at a point and along a line, Cattaneo's sheared contacts, Spence's punch
with friction, and a smooth flat punch. Errors are relative to the exact value. Times are CPU
seconds of one thread; they include the mesh, the bodies, the solve and, where there is one, the
loop over the contact zone. A run shorter than {short:g} s is the median of three.

- Where a half-space can do the scene, nothing with a mesh comes near. Hertz's peak pressure is
  right to .009 % after .06 s on 64 x 64 points. The best mesh needs 2.2 s for about as much.
- Tamaas finds the same peak and half-width on the same points. Its solve is faster up to 32 points
  a side, and slower from 64 on.
- On the rough surface both see the same contact area, and Tamaas takes 5 to 13 times as long. The
  area depends on the grid: that of 512 points a side is 2 % larger than that of {finest}, and that
  of 256 points 7 %.
- The other finite-element codes agree with Hertz on our meshes, with an error that falls by four
  with each halving. On 16 elements GetFEM takes .11 s, our graded mesh .22 s with its loop over the
  contact zone, Kratos 1.2 s and CalculiX 1.5 s; on 32 elements GetFEM 1.2 s, ours .7 s, and the
  others 7.9 s.
- Codes that follow the displaced surfaces see more than Hertz did. At a peak pressure of .9 % of
  the modulus CalculiX's peak converges to .2 % below Hertz's (`FLATTER = 1` in `peers.py`). The
  peers are therefore compared at a hundredth of that strain.
- A uniform mesh spends 1.8 s on an error of the peak of .5 %. A graded one has .24 % after .1 s.
- Quadratic displacements are more accurate for the peak. Linear ones are more accurate for the
  half-width, and for the stick width of Spence's punch with as many unknowns.
- On graded linear meshes the peak of the point contact does not converge: its error stays between
  .05 % and .09 % from 16 to 64 elements. That of the line contact falls by four with each halving.
- The adaptive search is slower than a mesh that was graded by hand, because it pays for all of its
  meshes and estimates.
- The implicit form takes 1.5 to 1.9 times as long as the explicit one on meshes of this size.
- The mesh alone decides once the certificate is 1e-4 or better, on all meshes. At 1e-3 the solver
  still matters from eight elements on, and at 1e-1 the peak is wrong by 5 % to 86 %.

What the ways are:

- **uniform**: all elements are alike, and the body is {small:g} half-widths large.
- **graded**: elements grow away from the contact, and the body is {large:g} half-widths large.
- **adaptive**: the mesh is refined where the peak pressure needs it; `size` is the target.
- **explicit, implicit**: Q as an array, and by its products, on graded linear meshes.
- **space**: a quarter of the body in three dimensions, which the axisymmetric model simplifies.
- **half-space**: no mesh at all; `size` is the number of points along a side.
- **Tamaas**: another code on the same points. Its time is that of its solve alone.
- **CalculiX, GetFEM, Kratos**: other finite-element codes on the nodes and elements of our graded
  linear block. They are given the contact zone, which our ways find in a loop over meshes, and they
  prescribe the depth of the indenter, not its force. CalculiX takes contact by a penalty, and the
  other two by augmented Lagrangians.

The rough surface has waves down to a 64th of its side. There is no exact answer: the share of the
points that touch is compared with that of {finest} x {finest} points.

Not compared on these scenes: bodies that are solved by iteration together with the contact.

**The fronts.** These runs are beaten by no other in both time and error.

{{fronts}}

**All runs.** `size` is the number of elements across the half-width unless said otherwise.

{{rows}}

**Tolerance and mesh.** Hertz's point contact on graded linear meshes, solved by `nsgs`, which stops
where it keeps the tolerance. The error of the mesh alone is that of a solution with a certificate
of 1e-11 or better. The tolerance matters where the solver changes the peak by more than a tenth of
that error.

{{tolerances}}

**The figures** show the errors of the point contact and of the line contact against the time, and
the error of the peak in percent over tolerance and mesh. A star says that the tolerance matters
there. The way `adaptive`, half-spaces and other codes are dashed.
"""

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
