"""Places where the quantity asked for is infinite, so that no mesh bounds it: pressure at a rim, stress at a corner.

A stress is infinite at a re-entrant corner or edge of a body. There the elements at a vertex fill clearly more than half of the
angle around it, on every mesh; along a fillet they fill half of it as soon as the mesh resolves the fillet. A stress can be
infinite at other places as well: at the end of a support, under the corner of another body. There it grows like h^-alpha with
the size h of the elements, alpha up to 1/2, so that every halving of h adds between once and 1.4 times as much as the one
before. Under a concentrated load each adds twice as much or more, which is what a contact looks like that is smaller
than the elements, and is no reason to stop.

Source: Williams (1952), Stress singularities resulting from various boundary conditions in angular corners of plates in extension.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.analysis.places import StressReading
from contactopt.analysis.quantities import at_rim
from contactopt.analysis.resultants import views
from contactopt.analysis.solve_scene import Solved
from contactopt.bodies.elements import straight
from contactopt.bodies.local_refinement import CORNER, simplices

if TYPE_CHECKING:
    from contactopt.adaptivity.loop import AdaptedLevel

HALVED = 1.8  # by how much smaller elements must be for a level to count as the next one
STEADY = 0.8, 1.7  # share of the growth before that the next growth of a singular stress is
GROWTHS = 4  # of the stress, one after the other, that are steady


def unbounded(solved: Solved, quantity: str, stress: StressReading | None, levels: Sequence[AdaptedLevel]) -> str:
    """One sentence that says why no mesh bounds the quantity, or an empty text.

    Parameters
    ----------
    solved : on the last mesh
    quantity : its name
    stress : its reading, if it is a stress
    levels : all meshes so far
    """
    if stress is not None:
        if stress.vertex < 0:
            return ""
        place = ", ".join(f"{x:.4g}" for x in stress.place)
        if re_entrant(stress.map.mesh, stress.vertex):
            return f"the largest stress is at the re-entrant corner near ({place}), where it is infinite; no mesh bounds it"
        if _grows(levels):
            return (
                f"the largest stress, at ({place}), grows with every refinement like an infinite one; no mesh bounds it"
            )
        return ""
    kind, _, pair = quantity.partition(":")
    if kind != "pressure" or "@" in quantity or pair.isdigit():
        return ""
    names = [made.name for made in solved.reduction.problem.pairs]
    seen = views(solved.reduction, solved.solution)[names.index(pair) if pair else 0]
    if at_rim(*seen):
        return "the largest pressure is at the edge of the contact surface, a corner, where no mesh bounds it"
    return ""


def re_entrant(mesh: Any, vertex: int) -> bool:
    """Whether a vertex, or one within two elements of it, is at a re-entrant corner of the body or on such an edge.

    The recovered stress at the corner itself looks from all sides, and may be less than that next to it.
    """
    cells = simplices(straight(mesh))
    near = np.array([vertex])
    for _ in range(2):
        near = np.unique(cells.t[:, np.any(np.isin(cells.t, near), axis=0)])
    outer = np.intersect1d(near, cells.boundary_nodes())
    return any(filled(cells, node) > 0.5 + CORNER / (2 * np.pi) for node in outer)


def filled(cells: Any, vertex: int) -> float:
    """The share of the full angle around a vertex that the simplices at it fill [-]."""
    corner, element = np.nonzero(cells.t == vertex)
    others = np.stack([np.delete(cells.t[:, e], c) for c, e in zip(corner, element)], axis=1)
    arms = cells.p[:, others] - cells.p[:, [vertex]][:, :, None]
    arms = arms / np.linalg.norm(arms, axis=0)
    if len(arms) == 2:
        return float(np.arccos(np.clip(np.sum(arms[:, 0] * arms[:, 1], axis=0), -1, 1)).sum() / (2 * np.pi))
    a, b, c = arms[:, 0], arms[:, 1], arms[:, 2]
    volume = np.abs(np.sum(a * np.cross(b, c, axis=0), axis=0))
    angles = 2 * np.arctan2(volume, 1 + np.sum(a * b + b * c + c * a, axis=0))  # Van Oosterom, Strackee (1983)
    return float(angles.sum() / (4 * np.pi))


def _grows(levels: Sequence[AdaptedLevel]) -> bool:
    """Whether the stress at the place where it is largest grows steadily as the elements there become smaller."""
    last = levels[-1]
    kept: list[AdaptedLevel] = []
    for level in reversed(levels):
        if np.linalg.norm(np.subtract(level.place, last.place)) > 2 * level.size:
            break
        if not kept or level.size >= HALVED * kept[-1].size:
            kept.append(level)
    growths = -np.diff([level.value for level in kept[: GROWTHS + 1]])
    if len(growths) < GROWTHS or np.any(growths <= 0):
        return False
    ratios = growths[:-1] / growths[1:]
    return bool(np.all((ratios >= STEADY[0]) & (ratios <= STEADY[1])))
