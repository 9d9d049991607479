"""Resultant forces and moments of every pair, support and plate, in coordinates of space."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactopt.bodies.views import acting, held_by, plates
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL, ROUNDED
from contactopt.problem import Solution, alone
from contactopt.problem.cones import lengths
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import contact_area, contact_zone, is_level, stick_width
from contactopt.readings.peaks import nodal_pressure
from contactopt.scenes.kinds import KINDS


@dataclass(frozen=True, eq=False)
class Resultant:
    """A force (dim,) and its moment about the origin, (1,) about the third axis in 2D or (3,)."""

    force: np.ndarray
    moment: np.ndarray

    @property
    def table(self) -> dict[str, list[float]]:
        """As lists, for files."""
        return {"force": (self.force + 0.0).tolist(), "moment": (self.moment + 0.0).tolist()}


def _resultant(reduction: Reduction, points: np.ndarray, forces: np.ndarray) -> Resultant:
    """The resultant of nodal forces (dim, m) at points, with mirror images, or of rings."""
    if reduction.scene.analysis.revolved:
        return Resultant(np.array([0.0, forces[1].sum()]), np.zeros(1))
    for plane in reduction.planes:
        n, apart = plane.inward[:, None], plane.inward @ points - plane.offset
        points = np.hstack([points, points - 2 * n * apart])
        forces = np.hstack([forces, forces - 2 * n * (plane.inward @ forces)]) / 2
    some = np.any(forces, axis=0)
    points, forces = (np.compress(some, each, axis=1) for each in (points, forces))
    x, f = (np.pad(each, ((0, 3 - len(each)), (0, 0))) for each in (points, forces))
    moment = np.cross(x, f, axis=0).sum(axis=1)
    return Resultant(forces.sum(axis=1), moment if len(points) == 3 else moment[2:])


def mirrors(reduction: Reduction) -> list[dict[str, Any]]:
    """The planes beyond which mirror images make the bodies whole, an axis of revolution among
    them, as {"axis": coordinate, "place": [length]}; none where one does not lie across an axis.
    """
    scene = reduction.scene
    if scene.analysis.revolved:
        return [{"axis": scene.components[0], "place": 0.0}]
    made = []
    for plane in reduction.planes:
        axis = int(np.argmax(np.abs(plane.inward)))
        if abs(plane.inward[axis]) < 1 - EQUAL:
            return []
        place = float(plane.offset / plane.inward[axis]) + 0.0
        made.append({"axis": scene.components[axis], "place": place})
    return made if 2 ** len(made) == scene.copies else []


def space_forces(reduction: Reduction, solution: Solution) -> np.ndarray:
    """(dim, k) contact forces on the upper bodies in the coordinates of space [force]."""
    return np.asarray(np.einsum("kad,ka->dk", reduction.frames, solution.reactions))


def pair_resultants(reduction: Reduction, solution: Solution) -> dict[str, Resultant]:
    """By pair the resultant of contact forces on its upper body, else on the lower one."""
    named = {body.name: body for body in reduction.bodies}
    space, found = space_forces(reduction, solution), {}
    for pair, own, made in zip(reduction.scene.pairs, reduction.problem.pairs, reduction.couplings):
        forces, there = solution.reactions[own.contacts].ravel(), None
        for name, trace in zip(pair.bodies, (made.upper, made.lower)):
            view = named[name].view
            if there is None and view is not None:
                there = acting(view, trace.T @ forces)
        points = reduction.problem.coordinates[:, own.contacts]
        found[own.name] = _resultant(reduction, *(there or (points, space[:, own.contacts])))
    return found


def holder_resultants(reduction: Reduction, solution: Solution) -> dict[str, Resultant]:
    """The resultant of every support and plate, as "body 'block', support 'bottom'"."""
    found, displaced = {}, reduction.displaced(solution)
    for body, B, U in zip(reduction.bodies, reduction.maps, displaced):
        for name, held in held_by(body, U, B.T @ solution.reactions.ravel()).items():
            found[f"body '{body.name}', {name}"] = _resultant(reduction, *held)
    return found


def pair_view(reduction: Reduction, solution: Solution, pair: int) -> tuple[Reduction, Solution]:
    """The reduction and solution of a pair by itself, without displacements of the bodies."""
    if len(reduction.problem.pairs) == 1:
        return reduction, solution
    problem, own = alone(reduction.problem, solution, reduction.problem.pairs[pair])
    return replace(reduction, problem=problem, couplings=(reduction.couplings[pair],)), own


def resultant_words(summary: dict[str, Any]) -> dict[str, str]:
    """For each pair, by its name, the components of the force on its upper body as words without a
    unit, from the summary of a result. The normal forces of a curved surface add up to more than
    this force.
    """
    axes = KINDS[summary["kind"]].components
    words = {}
    for name, pair in summary["pairs"].items():
        known = [f or 0.0 for f in (*pair["force"], pair["normal_force"])]  # None: not finite
        least = EQUAL * max(map(abs, known))
        words[name] = ", ".join(
            f"{axis} {f if abs(f) > least else 0.0:.6g}" for axis, f in zip(axes, known)
        )
    return words


def columns(reduction: Reduction, solution: Solution) -> dict[str, float]:
    """One number for each load, motion, resultant and moment of a state, by names such as

    force:punch:top:y, displacement:block:bottom:x  what a scene prescribes [force], [length],
                                                     also traction, pressure, bolt and weight
    motion:punch, plate 'top', y                     of plates and bodies that move freely, in
                                                     the words of the problem's `motions`
    force:PAIR:x, moment:PAIR:z                      on the upper body of a pair
    force:body 'block', support 'bottom':x           of a support or plate on its body
    """
    scene, axes = reduction.scene, reduction.scene.components
    found: dict[str, float] = {}
    for part in scene.parts:
        for kind in ("force", "displacement"):  # of a body without a mesh
            for axis, value in (getattr(part, kind, None) or {}).items():
                found[f"{kind}:{part.name}:{axis}"] = float(value)
        for item in (*getattr(part, "supports", ()), *getattr(part, "loads", ())):
            place = item.form.partition(":")[0], *item.address(part.name)
            for axis, value in item.values(axes).items():
                found[":".join(filter(None, (*place, axis)))] = float(value)
    names = reduction.problem.motions or range(len(solution.multipliers))
    found |= {f"motion:{name}": float(x) for name, x in zip(names, solution.multipliers)}
    for body, U in zip(reduction.bodies, reduction.displaced(solution)):
        moved = plates(body, U).items()
        found |= {f"motion:body '{body.name}': {name}": value for name, value in moved}
    every = pair_resultants(reduction, solution) | holder_resultants(reduction, solution)
    turns = axes if reduction.problem.dim == 3 else ("z",)
    for name, own in every.items():
        found |= {f"force:{name}:{c}": float(f) for c, f in zip(axes, own.force)}
        found |= {f"moment:{name}:{c}": float(m) for c, m in zip(turns, own.moment)}
    return found


def tables(reduction: Reduction, solution: Solution) -> dict[str, Any]:
    """The tables of a summary. 'pairs': for each pair of surfaces its resultant, normal force
    [force], the sums of the sizes of its friction forces and of their bounds
    [force], largest pressure [stress], area [length^2], half-widths [length], coupling with its
    reason, and counts of contacts. 'holders': the resultant of each support and plate.
    """
    pairs, bodies = {}, {pair.name: list(pair.bodies) for pair in reduction.scene.pairs}
    for number, (name, found) in enumerate(pair_resultants(reduction, solution).items()):
        seen, own = pair_view(reduction, solution, number)
        problem, r = seen.problem, own.reactions
        status, zone = contact_status(problem, r), contact_zone(seen.scene, problem, r)
        level = is_level(problem, seen.coupling.frames, r)
        friction = float(lengths(r[:, 1:]).sum())
        pairs[name] = found.table | {
            "bodies": bodies[name],
            "normal_force": float(r[:, 0].sum()),
            "friction_force": friction if friction > ROUNDED * lengths(r).sum() else 0.0,
            "friction_bound": float(problem.law.bound_along(r).sum()),
            "max_pressure": float(nodal_pressure(problem, own).max(initial=0.0)),
            "contact_area": contact_area(seen.scene, problem, r, zone[0]),
            "contact_half_width": zone[0] if level else None,
            "stick_half_width": stick_width(seen, own, zone)[0] if level else None,
            "coupling": seen.coupling.kind,
            "coupled_because": seen.coupling.why,
            "carrier": seen.coupling.carrier,
            "contacts": problem.contacts,
            "open": int(status.open.sum()),
            "stick": int(status.stick.sum()),
            "slip": int(status.slip.sum()),
        }
    holders = {name: found.table for name, found in holder_resultants(reduction, solution).items()}
    return {"pairs": pairs, "holders": holders}
