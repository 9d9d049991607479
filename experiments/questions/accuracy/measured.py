"""Errors against exact solutions, and error estimates against true errors."""

from __future__ import annotations

import time
from dataclasses import replace
from multiprocessing import get_context

from contactopt import scenes
from contactopt.accuracy import refine
from contactopt.analytic import contact_modulus
from contactopt.material import Material
from contactopt.readings.quantities import value_of
from contactopt.scenes.refined_scenes import split_scene
from contactopt.scenes.scene import Rigid, Scene
from contactopt.solving.zone import solve_zone
from experiments.questions.accuracy.half_space import MATERIAL, flat, indenter

KINDS = {"point": "axisymmetric", "line": "plane-strain"}
FRICTION = (0.1, 0.3, 0.5, 0.7)
LOCKING = ((0.3, 0.3), (0.45, 0.1), (0.49, 0.02))
TARGETS = (1e-2, 3e-3, 1e-3)
SIZES = (10.0, 30.0, 100.0, 300.0, 1000.0, 10000.0)
SMALL, MODEST = 24, 26  # elements of the Hertz table: at most 5,000 unknowns
Exact = dict[str, float]


def exact(scene: Scene) -> Exact:
    """Quantities of the scene on a half-space.

    The strain energy of Hertz's point contact is 2/5 of force times approach.
    """
    reference = scene.reference
    values = {"width": reference.half_width}
    if reference.peak is not None:
        values["pressure"] = reference.peak
    if reference.approach is not None:
        values["approach"] = reference.approach
        if reference.peak is not None and isinstance(scene.upper, Rigid) and scene.upper.force:
            values["energy"] = 0.4 * abs(scene.upper.force["z"]) * reference.approach
    if reference.stick_half_width:
        values["stick"] = reference.stick_half_width / reference.half_width
    return values


def hertz(name: str, elements: int) -> dict[str, object]:
    scene = indenter(KINDS[name])
    solved = solve_zone(scene, elements)
    reduction, solution, zones = solved.reduction, solved.solution, solved.zones
    nodal = (solution.reactions[:, 0] / reduction.problem.areas).max()
    truth = exact(scene)
    return {
        "contact": name,
        "elements": elements,
        "unknowns": reduction.dofs,
        "zone rounds": len(zones) - 1,
        "peak, fitted": value_of("pressure", reduction, solution) / truth["pressure"] - 1,
        "peak, largest node": nodal / truth["pressure"] - 1,
        "width": value_of("width", reduction, solution) / truth["width"] - 1,
    }


def cases() -> list[tuple[Scene, str]]:
    point, line = (indenter(kind, size=1e4) for kind in KINDS.values())
    disc, strip = flat("axisymmetric", 0.3), flat("plane-strain", 0.3)
    smooth = flat("axisymmetric", 0.0)
    spence = [scenes.rigid_punch(kind, mu=mu) for kind in KINDS.values() for mu in FRICTION]
    pairs = [(point, q) for q in ("pressure", "width", "approach", "energy")]
    pairs += [
        (line, "pressure"),
        (line, "width"),
        (smooth, "approach"),
        (disc, "approach"),
        (disc, "stick"),
    ]
    return [*pairs, (strip, "stick"), *((scene, "stick") for scene in spence)]


def effectivity(scene: Scene, quantity: str, target: float) -> dict[str, object]:
    """One refinement to a target, with what the estimate was worth."""
    solved, estimate = refine([scene], quantity, target)
    true = estimate.value / exact(scene)[quantity] - 1
    assert estimate.error is not None and estimate.extrapolated is not None
    return {
        "scene": scene.name.split(",")[0],
        "mu": scene.mu,
        "quantity": quantity,
        "target": target,
        "estimate": estimate.error,
        "true error": true,
        "effectivity": estimate.error / abs(true),
        "reached": estimate.reached,
        "extrapolated": estimate.extrapolated / exact(scene)[quantity] - 1,
        "solves": len(estimate.levels),
        "unknowns": solved.reduction.dofs,
        "seconds": estimate.levels[-1].seconds,
    }


def effectivities(case: int) -> list[dict[str, object]]:
    """A target that the mesh for a weaker one met already gives the same run: one row."""
    scene, quantity = cases()[case]
    rows: list[dict[str, object]] = []
    for target in TARGETS if not scene.name.startswith("rigid-punch") else TARGETS[:1]:
        if rows and float(rows[-1]["estimate"]) <= target:  # type: ignore[arg-type]
            rows[-1]["target"] = target
        else:
            rows.append(effectivity(scene, quantity, target))
    return rows


def all_effectivities() -> list[dict[str, object]]:
    """All cases, each in a process of its own, which gives all of its memory back."""
    with get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        return [
            row
            for rows in pool.map(effectivities, range(len(cases())), chunksize=1)
            for row in rows
        ]


READ = {
    "point": ("pressure", "width", "approach"),
    "line": ("pressure", "width"),
    "strip": ("stick",),
}


def finite(size: float) -> dict[str, float]:
    """What is read off blocks `size` half-widths high and wide."""
    blocks = {name: indenter(kind, size=size) for name, kind in KINDS.items()}
    blocks["strip"] = flat(KINDS["line"], 0.3, size=size)
    found = {}
    for name, scene in blocks.items():
        solved = solve_zone(scene, 32)
        found |= {f"{name}, unknowns": float(solved.reduction.dofs)}
        for quantity in READ[name]:
            found[f"{name}, {quantity}"] = value_of(quantity, solved.reduction, solved.solution)
    return found


def finite_sizes() -> list[dict[str, object]]:
    """Deviations from the largest block; of the stick zone, the absolute one. C is that of the
    correction of the approach, C force / (E* size), found from the third size.
    """
    found = {size: finite(size) for size in SIZES}
    last, approach = found[SIZES[-1]], "point, approach"
    reference = indenter(KINDS["point"]).reference
    unit = 20.0 / (contact_modulus(MATERIAL) * reference.half_width)  # force / (E* a)
    C = (last[approach] - found[SIZES[2]][approach]) * SIZES[2] / unit
    rows: list[dict[str, object]] = []
    for size, own in found.items():
        row: dict[str, object] = {"size / a": size}
        for key, value in own.items():
            row[key] = int(value) if "unknowns" in key else value / last[key] - 1
        row["strip, stick"] = own["strip, stick"] - last["strip, stick"]
        corrected = (own[approach] + C * unit / size) / reference.approach - 1
        rows.append(row | {"point, approach corrected": corrected, "C": C})
    return rows


def stick(kind: str, mu: float) -> dict[str, object]:
    begin = time.perf_counter()
    scene = scenes.rigid_punch(kind, mu=mu)
    solved = solve_zone(scene)
    reduction, solution = solved.reduction, solved.solution
    ratio, truth = value_of("stick", reduction, solution), exact(scene)["stick"]
    return {
        "scene": scene.name,
        "mu": mu,
        "unknowns": reduction.dofs,
        "c / a": ratio,
        "exact": truth,
        "error": ratio - truth,
        "seconds": time.perf_counter() - begin,
    }


def locking(nu: float, mu: float) -> dict[str, object]:
    """c / a of the plane rigid punch with linear and quadratic displacements on one mesh."""
    scene = scenes.rigid_punch(lower=Material(5.0, nu), mu=mu)
    row: dict[str, object] = {"nu": nu, "mu": mu, "exact": exact(scene)["stick"]}
    for name, splits, degree in (("linear", 1, 1), ("quadratic", 0, 2)):
        solved = solve_zone(replace(split_scene(scene, scene.elements, splits), degree=degree))
        reduction, solution = solved.reduction, solved.solution
        row |= {
            f"{name}, unknowns": reduction.dofs,
            f"{name}, error": value_of("stick", reduction, solution) - exact(scene)["stick"],
        }
    return row
