"""Whether an answer lies within what is assumed: small displacements, and bodies in equilibrium.

The certificate says that the forces solve the interface problem. What is compared here with the
bounds of the table below is computed from the displacements of the bodies alone, without the
factors that made the interface problem.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from contactopt.bodies.views import limits
from contactopt.coupling.coupling import Coupling
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import TOL
from contactopt.errors import InputError
from contactopt.meshes.cells import measures
from contactopt.problem import Solution
from contactopt.problem.contact_status import contact_status
from contactopt.readings.plausibility import SHARE

# The largest values that draw no remark.
BOUNDS = {
    "strain": 0.05,  # of an element, beyond which a stiffness of small strains is some percent off
    # of an element [rad]: its square, half a percent, is the strain that it seems to make
    "rotation": 0.1,
    "slip": 1.0,  # over the size of the facets there: contacts have moved past their partners
    "closure": 1.0,  # of the gap, over the size of the facets there
    "imbalance": 1e-6,  # of a body, relative to the forces on it
    # of the surfaces of the displaced bodies where they touch, relative to their displacement
    "misfit": 1e-3,
}
# strains that no body has: of surfaces that overlap, which squeeze an element to nothing, and of
# loads, which may be as small or large as their unit
SQUEEZED, IMPOSSIBLE = 0.9, 3.0
UNITS = {"strain": "", "rotation": " rad", "slip": " facets", "closure": " facets"}


def overlap_share(reduction: Reduction, solution: Solution) -> float:
    """By which share the areas of surfaces differ that overlap as drawn, weighted by forces."""
    shares = np.zeros(len(solution.reactions))
    ring = reduction.scene.kind == "axisymmetric"
    for pair, made in zip(reduction.problem.pairs, reduction.couplings):
        if made.cells.shape[0] < reduction.scene.dim:
            continue
        cells, away = made.cells[: reduction.scene.dim], np.minimum(made.gap, 0.0)
        here = _measures(made.positions, cells, ring)
        own = np.zeros(len(away))
        for side in (1, -1):
            there = _measures(made.positions + side * away * made.frames[:, 0].T, cells, ring)
            change = np.divide(there, here, out=np.ones_like(here), where=here > 0) - 1
            for corner in cells:
                np.maximum.at(own, corner, np.abs(change))
        shares[pair.contacts] = own
    forces = np.abs(solution.reactions[:, 0])
    return float(shares @ forces / max(forces.sum(), 1e-300))


def _measures(places: np.ndarray, cells: np.ndarray, ring: bool) -> np.ndarray:
    """Lengths or areas (c,) of cells between places (dim, k), of rings those around the axis."""
    corners = places[:, cells]
    size = measures(corners)
    return np.asarray(size * np.abs(corners[0]).mean(axis=0) if ring else size)


def _sizes(cells: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) longest edge of the cells around each contact [length]; infinite without any."""
    size, others = np.zeros(points.shape[1]), np.roll(cells, 1, axis=0)
    length = np.linalg.norm(points[:, cells] - points[:, others], axis=0)
    for ends in (cells, others):
        np.maximum.at(size, ends, length)
    return np.where(size > 0, size, np.inf)


def validity(reduction: Reduction, solution: Solution) -> tuple[dict[str, Any], list[str]]:
    """Measure how far an answer exceeds the assumptions: tables of a summary, and sentences."""
    displaced, reactions = reduction.displaced(solution), solution.reactions.ravel()
    bodies: dict[str, dict[str, float]] = {}
    remarks: list[str] = []
    moved = reduction.seen(displaced)
    scale, none = np.zeros(len(moved)), TOL * float(np.abs(reactions).sum())
    for body, B, U in zip(reduction.bodies, reduction.maps, displaced):
        force = reactions[:0] if body.view is None else B.T @ reactions
        known = bodies[body.name] = limits(body, U, force, none)._asdict()
        for key in ("strain", "rotation"):
            remarks += _beyond(key, f"body '{body.name}'", known[key])
        if known["imbalance"] > BOUNDS["imbalance"]:
            remarks.append(
                f"body '{body.name}' is not in equilibrium: {known['imbalance']:.1e} of the forces"
                " on it are left over; it is so thin or so weakly held that rounding moves it."
            )
        # the contacts that the body takes part in
        near = np.diff(B.indptr).reshape(moved.shape).any(axis=1)
        size = np.linalg.norm((B @ U).reshape(moved.shape), axis=1)
        scale = np.maximum(scale, np.where(near, np.maximum(size, known["moved"]), 0.0))
    status, pairs = contact_status(reduction.problem, solution.reactions), {}
    for pair, made in zip(reduction.problem.pairs, reduction.couplings):
        own, touching = pair.contacts, status.touching[pair.contacts]
        size = _sizes(made.cells[:, touching[made.cells].any(axis=0)], made.positions)[touching]
        extent = float(np.ptp(made.positions, axis=1).max(initial=0.0))
        slip, gap = np.linalg.norm(moved[own, 1:][touching], axis=1) / size, made.gap[touching]
        closure = np.where(gap > SHARE * extent, gap / size, 0.0)
        # the others open as they slip
        close = status.stick[own] if reduction.problem.law.dilatant else touching
        missed = np.abs(moved[own, 0])[close].max(initial=0.0)
        misfit = float(missed / max(scale[own].max(initial=0.0), 1e-300))
        moves = {"slip": slip, "closure": closure}
        largest = {key: float(of.max(initial=0.0)) for key, of in moves.items()}
        pairs[pair.name] = largest | {"misfit": misfit}
        for key in ("slip", "closure"):
            remarks += _beyond(key, f"pair '{pair.name}'", largest[key])
        if misfit > BOUNDS["misfit"]:
            remarks.append(
                f"where the surfaces of '{pair.name}' touch, the displaced bodies miss each other"
                f" by {misfit:.1e} of their displacement: a body is so thin or so weakly held that"
                " rounding moves it."
            )
    # the last iterate of what was not solved says nothing of the bodies
    return {"bodies": bodies, "pairs": pairs}, remarks if solution.solved else []


def impossible(limits: dict[str, Any], couplings: Sequence[Coupling], refuse: bool) -> list[str]:
    """The sentence for a body that is squeezed to nothing, and not at the tip of a corner alone, by
    the tables of validity(). InputError with it, to `refuse`, if surfaces overlap or it is more.
    """
    overlaps = any(-c.gap.min() > SHARE * np.ptp(c.positions, axis=1).max() for c in couplings)
    most = SQUEEZED if overlaps else IMPOSSIBLE
    for name, known in limits["bodies"].items():
        if known["mean_strain"] > BOUNDS["strain"] and known["strain"] > SQUEEZED:
            told = (
                f"no body can deform like this: the answer has a strain of {known['strain']:.3g} in"
                f" body '{name}'; see whether E and the loads are in the same unit, whether the"
                " surfaces that may touch are the right ones, and how far they overlap."
            )
            if refuse and known["strain"] > most:
                raise InputError(told)
            return [told]
    return []


def _beyond(key: str, where: str, value: float) -> list[str]:
    """The sentence for a value beyond its bound, if it is."""
    if value <= BOUNDS[key]:
        return []
    known = {"slip": "slips by up to", "closure": "closes a gap of up to"}
    what = known.get(key, f"has a {key} of up to")
    return [
        f"displacements are assumed to be small, but {where} {what} {value:.3g}{UNITS[key]}, more"
        f" than {BOUNDS[key]:g}: read the answer as a first step at most."
    ]
