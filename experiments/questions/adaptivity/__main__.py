"""How many unknowns does an accuracy need, if meshes are refined only where the quantity asked for
needs it?

    orders         the flat punch with its singular corners: energy and approach against the number
                   of unknowns
    hertz          a cylinder on a block, meshed by Gmsh without knowledge of the contact: unknowns
                   for 1 % and .1 % of the exact peak pressure, refined locally and everywhere
    hertz3d        a ball on a block, tetrahedra by Gmsh without knowledge of the contact: the peak
                   pressure
    stress         the largest stress of parts meshed by Gmsh: unknowns and time for 1 %, refined
                   locally and everywhere

Run all, or the parts that are named: python -m experiments.questions.adaptivity [PART ...]
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from contactopt import Material, Part, Plate, Scene, Support, analytic, load_mesh
from contactopt.accuracy import refine
from contactopt.readings.quantities import value_of
from contactopt.scenes import make_scene
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import solve_scene
from experiments.questions.adaptivity.stress import hertz3d, locally, stress
from experiments.report import REPORTS, write

RUBBER, STEEL = Material(5.0, 0.3), Material(210e3, 0.3)
FOLDER = REPORTS / "adaptivity"


def slope(x: list[float], y: list[float]) -> float:
    """Exponent of a power law through points, by least squares."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def orders() -> list[dict[str, Any]]:
    """Error in the energy norm of the flat punch, as the square root of the missing energy over the
    whole energy.
    """
    rows = []
    truth = refine(
        [make_scene("punch-2d", degree=2)], "energy", 2e-7, limits=Limits(60_000), adaptive=True
    )[1].extrapolated
    for degree, goal in ((1, 4e-4), (2, 3e-6)):
        estimate = refine(
            [make_scene("punch-2d", degree=degree)],
            "energy",
            goal,
            limits=Limits(100_000),
            adaptive=True,
        )[1]
        kept = [level for level in estimate.levels if 1_000 <= level.unknowns <= 100_000]
        errors = [np.sqrt(abs(1 - level.value / truth)) for level in kept]
        rows += [
            {
                "mesh": "adaptive",
                "degree": degree,
                "unknowns": level.unknowns,
                "error in the energy norm": error,
            }
            for level, error in zip(kept, errors)
        ]
        for elements in (4, 8, 16, 32, 64)[: 5 if degree == 1 else 4]:
            scene = _even(make_scene("punch-2d", degree=degree), elements)
            solved = solve_scene(scene)
            energy = refine_value(solved)
            rows.append(
                {
                    "mesh": "uniform",
                    "degree": degree,
                    "unknowns": solved.reduction.dofs,
                    "error in the energy norm": np.sqrt(abs(1 - energy / truth)),
                }
            )
    return rows


def refine_value(solved: Any) -> float:
    """The elastic energy of a solved scene."""
    from contactopt.readings.quantities import elastic_energy

    return elastic_energy(solved.reduction, solved.solution)


def _even(scene: Scene, count: int) -> Scene:
    """The scene of the punch on even meshes, `count` squares across the half-width everywhere."""
    from contactopt.meshes.structured import rename, tensor_mesh

    def even(part: Any) -> Any:
        low, high = (
            np.array(limit)
            for limit in zip(*((row.min(), row.max()) for row in part.build_mesh(4, None).p))
        )
        ticks = [
            np.linspace(a, b, max(2, round((b - a) / 20.0 * count) + 1)) for a, b in zip(low, high)
        ]
        names = part.build_mesh(4, None)
        mesh = tensor_mesh(*ticks)
        return replace(part, mesh=_named_like(names, mesh, rename))

    return scene.with_parts(even)


def _named_like(old: Any, new: Any, rename: Callable[..., Any]) -> Any:
    """Boundaries of the new mesh where those of the old one are."""
    found = {}
    for name, facets in old.boundaries.items():
        points = old.p[:, np.unique(old.facets[:, facets])]
        low, high = points.min(axis=1) - 1e-9, points.max(axis=1) + 1e-9
        found[name] = lambda x, low=low, high=high: np.all(
            (x >= low[:, None]) & (x <= high[:, None]), axis=0
        )
    return new.with_boundaries(found)


def cylinder_files(folder: Path, size: float) -> tuple[Path, Path]:
    """A half cylinder of radius 20 on a block 60 x 30, each in a file, with triangles of one size
    everywhere.
    """
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    files = []
    for name in ("cylinder", "block"):
        gmsh.clear()
        occ = gmsh.model.occ
        if name == "cylinder":
            whole, half = (
                [(2, occ.addDisk(0, 20, 0, 20, 20))],
                [(2, occ.addRectangle(-20, 0, 0, 40, 20))],
            )
            body, _ = occ.intersect(whole, half)
        else:
            body = [(2, occ.addRectangle(-30, -30, 0, 60, 30))]
        occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in body], name=name)
        sides: dict[str, list[int]] = {}
        for _, curve in gmsh.model.getBoundary(body, oriented=False):
            _, y, _ = occ.getCenterOfMass(1, curve)
            if name == "cylinder":
                side = "top" if y > 19.9 else "arc"
            else:
                side = "bottom" if y < -29.9 else "top" if y > -0.1 else "side"
            sides.setdefault(side, []).append(curve)
        for side, curves in sides.items():
            gmsh.model.addPhysicalGroup(1, curves, name=side)
        gmsh.model.mesh.generate(2)
        files.append(folder / f"{name}.msh")
        gmsh.write(str(files[-1]))
    gmsh.finalize()
    return files[0], files[1]


def cylinder(size: float, force: float) -> tuple[Scene, analytic.Reference]:
    """The scene of the two files, in mm and N, and Hertz's solution."""
    with TemporaryDirectory() as name:
        upper, lower = (load_mesh(file) for file in cylinder_files(Path(name), size))

    def circle(x: np.ndarray) -> np.ndarray:
        middle = np.array([[0.0], [20.0]])
        return middle + 20.0 * (x - middle) / np.linalg.norm(x - middle, axis=0)

    held, load = (Support("top", {"x": 0.0}),), (Plate("top", {"y": -force}),)
    cylinder = Part("cylinder", upper, STEEL, held, load, "arc", circle)
    block = Part("block", lower, STEEL, (Support("bottom"),), contact="top")
    exact = analytic.hertz_line(force, 20.0, analytic.contact_modulus(STEEL, STEEL))
    return Scene("cylinder on a block", cylinder, block, 0.0, law="frictionless"), exact


def hertz() -> list[dict[str, Any]]:
    """Unknowns and processor seconds until the peak pressure stays within 1 % and .1 % of Hertz's."""
    rows = []
    for degree in (1, 2):
        scene, exact = cylinder(6.0, 1000.0)
        scene = replace(scene, degree=degree)
        local, _ = locally(scene, "pressure", 3e-4, 20_000)
        found = [
            (unknowns, value / exact.peak - 1, seconds) for unknowns, value, _, seconds in local
        ]
        rows += [
            row for bound in (1e-2, 1e-3) for row in _reached("adaptive", degree, bound, found)
        ]
        everywhere = []
        for size in (6.0, 3.0, 1.5, 0.75, 0.375, 0.1875)[: 6 if degree == 1 else 5]:
            begin = time.process_time()
            solved = solve_scene(replace(cylinder(size, 1000.0)[0], degree=degree))
            value = value_of("pressure", solved.reduction, solved.solution)
            everywhere.append(
                (solved.reduction.dofs, value / exact.peak - 1, time.process_time() - begin)
            )
        rows += [
            row
            for bound in (1e-2, 1e-3)
            for row in _reached("everywhere", degree, bound, everywhere)
        ]
    return rows


def _reached(
    how: str, degree: int, bound: float, found: list[tuple[int, float, float]]
) -> Iterator[dict[str, Any]]:
    """The first mesh from which on all errors are within the bound."""
    inside = [abs(error) <= bound for _, error, _ in found]
    first = len(inside) - (inside[::-1].index(False) if False in inside else len(inside))
    row = {"refined": how, "degree": degree, "error of the peak at most": bound}
    if first < len(found):
        unknowns, error, seconds = found[first]
        yield row | {
            "unknowns": unknowns,
            "its error": error,
            "processor seconds with all levels": seconds,
        }
    else:
        yield row | {
            "unknowns": f"> {found[-1][0]}",
            "its error": found[-1][1],
            "processor seconds with all levels": found[-1][2],
        }


PARTS: dict[str, Callable[[], list[dict[str, Any]]]] = {
    "orders": orders,
    "hertz": hertz,
    "hertz3d": hertz3d,
    "stress": stress,
}


def report(tables: dict[str, list[dict[str, Any]]]) -> None:
    """The report from the tables of all parts."""
    fits = []
    for degree in (1, 2):
        for mesh in ("adaptive", "uniform"):
            rows = [
                row for row in tables["orders"] if row["degree"] == degree and row["mesh"] == mesh
            ]
            fits.append(
                {
                    "mesh": mesh,
                    "degree": degree,
                    "unknowns": f"{rows[0]['unknowns']} to {rows[-1]['unknowns']}",
                    "order in the number of unknowns": slope(
                        [row["unknowns"] for row in rows],
                        [row["error in the energy norm"] for row in rows],
                    ),
                }
            )
    text = f"""{__doc__.split(chr(10))[0]}

## The flat punch and its corners

The stress is infinite at the edge of the punch. On even meshes that spoils the order of
convergence; local refinement restores it: -1/2 in the number of unknowns for linear elements, and
-1 for quadratic ones. The error is measured in the energy norm.

{{fits}}

## Hertz from meshes that know nothing of the contact

A steel cylinder of radius 20 mm on a block, both meshed by Gmsh with triangles of 6 mm; the contact
is 1 mm wide or less. The table names the first mesh from which on the error of the peak pressure
stays within the bound.

{{hertz}}

## A ball on a block

A steel ball of radius 20 mm on a steel block, a quarter of both, meshed by Gmsh with tetrahedra of
7 mm; the contact has a radius of 1 mm, so that on the first mesh one node carries all of the force.

{{hertz3d}}

## Stress at a fillet and under a pin

A bracket with a fillet of 4 mm held on a block by a bolt, a pin in a bush, and a bearing on the
ground with its pin from a scene file with three mesh files; all meshes are made by Gmsh with
elements of one size. The table names the first mesh from which on the error stays within 1 %.
Refined everywhere, Gmsh halves the size of all elements; its own time is not counted. The reference
is the extrapolated value of local refinement with quadratic elements to an estimated error of 1e-4.
Times are processor seconds.

{{stress}}

Whether the estimates are true is measured by `python -m experiments.questions.first_meshes`.

Error against time, of adaptive meshes and of other models of one scene, is measured by
`python -m experiments.questions.simplest`.
"""
    write(
        "adaptivity",
        "Fewest unknowns for an accuracy",
        text,
        tables | {"fits": fits},
        {"error": picture(tables)},
    )


def picture(tables: dict[str, list[dict[str, Any]]]) -> Any:
    """Error against unknowns for the punch."""
    figure, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    for degree, color in ((1, "C0"), (2, "C1")):
        for mesh, style in (("adaptive", "o-"), ("uniform", "s--")):
            rows = [
                row for row in tables["orders"] if row["degree"] == degree and row["mesh"] == mesh
            ]
            x, y = (
                [row["unknowns"] for row in rows],
                [row["error in the energy norm"] for row in rows],
            )
            ax.loglog(x, y, style, color=color, mfc="none", label=f"{mesh}, degree {degree}")
    ax.set(xlabel="unknowns [-]", ylabel="error in the energy norm [-]", title="flat punch")
    ax.legend(frameon=False)
    return figure


def main(chosen: list[str]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    kept = FOLDER / "parts.json"
    tables = json.loads(kept.read_text()) if kept.exists() else {}
    for name in chosen or PARTS:
        tables[name] = PARTS[name]()
        print(name, *tables[name], sep="\n")
        kept.write_text(json.dumps(tables, indent=1, default=float) + "\n")
    if set(PARTS) <= set(tables):
        report(tables)


if __name__ == "__main__":
    main(sys.argv[1:])
