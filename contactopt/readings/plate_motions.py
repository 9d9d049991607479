"""How far plates bring the bodies of a scene together, and how far they shift them: read from the
displacements of the nodes under the plates.

The motion of a body is that of its plates, component by component, or of the supports that move it
where no plate does. A rigid body and a half-space move as a whole. What nothing moves and nothing
holds moves by its mean displacement. A translation of the whole scene changes neither reading: it
is the same whether the lower body is held or pressed by a plate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contactopt.bodies.protocol import Body
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import ROUNDED
from contactopt.problem import Solution

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart


class Motion(NamedTuple):
    """How far the upper bodies move beyond the lower ones along a mean direction [length], and by
    how much a unit of each component of the motion of each body changes this (bodies, dim).
    """

    value: float
    weights: np.ndarray


def approach(reduction: Reduction, solution: Solution) -> float | None:
    """How far plates bring bodies together along the mean normal [length]; None without either."""
    if not any(_has_plate(part) for part in reduction.scene.parts):
        return None
    found = motion(reduction, reduction.displaced(solution), 0)
    return None if found is None else 0.0 - found.value


def motion(reduction: Reduction, displaced: Sequence[Any], component: int) -> Motion | None:
    """The motion along the mean normal (component 0) or the mean t1 (1), from displacements U (n,):
    upper less lower mean. Around a body there is none along the normal (None), and that along t1 is
    zero in the mean.
    """
    weights = _weights(reduction, component)
    if weights is None:
        return None
    moved = np.zeros(weights.shape)
    for body, U, own, out in zip(reduction.bodies, displaced, weights, moved):
        for c in np.flatnonzero(own):
            out[c] = float(body.carried(int(c))[0] @ U)
    value, size = float(np.sum(weights * moved)), float(np.abs(weights * moved).sum())
    extent = float(np.ptp(reduction.problem.coordinates, axis=1).max(initial=0.0))
    rounding = max(ROUNDED * size, 1e-15 * extent)
    return Motion(value if abs(value) > rounding else 0.0, weights)


def _weights(reduction: Reduction, component: int) -> np.ndarray | None:
    """On each side only the bodies count that plates or supports hold or move, component by
    component; without any, all count. Both sides have one direction, so that no translation of
    the whole scene counts.
    """
    scene, problem = reduction.scene, reduction.problem
    names = [part.name for part in scene.parts]
    counts = np.array([_driven(body, problem.dim) for body in reduction.bodies])
    made, frames = np.zeros(counts.shape), reduction.frames[:, component]
    owners = [
        np.concatenate(
            [
                np.full(own.stop - own.start, names.index(pair.bodies[side]))
                for pair, own in zip(scene.pairs, problem.pairs)
            ]
        )
        for side in range(2)
    ]
    counted = np.any(counts[owners[0]], axis=1)
    areas = _of_those(np.asarray(counted), problem.areas)
    mean = _along_symmetry(reduction, areas @ frames / areas.sum(), component)
    length = float(np.linalg.norm(mean))
    if length < 1e-3:  # a mean direction shorter than this is that of a surface around a body
        return None if component == 0 else made
    if component == 0:
        whole = np.array([areas[own.contacts] @ frames[own.contacts] for own in problem.pairs])
        if np.any(whole @ mean < 0):  # bodies on both sides of one, as raceways of a ball
            return None
    for owner, sign in zip(owners, (1.0, -1.0)):
        for c in np.flatnonzero(mean):
            areas = _of_those(counts[owner, c], problem.areas)
            shares = np.bincount(owner, areas, len(names)) / areas.sum()
            made[:, c] += sign * shares * mean[c] / length
    return made


def _of_those(counts: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """The areas (k,) of the contacts that count, or all if none does."""
    return areas * counts if np.any(areas * counts > 0) else areas


def _driven(body: Body, dim: int) -> np.ndarray:
    """Whether plates or supports hold or move a body along each component (dim,)."""
    view = body.view
    if view is None:  # as a whole
        return np.ones(dim, dtype=bool)
    return np.any(np.isin(view.unknowns, view.free, invert=True), axis=1)


def _along_symmetry(reduction: Reduction, mean: np.ndarray, component: int) -> np.ndarray:
    """The mean direction of the whole surface from that of the part of it that is modelled."""
    if reduction.scene.kind == "axisymmetric":
        return mean * [0.0, 1.0]
    for plane in reduction.planes:
        across = plane.inward * (plane.inward @ mean)
        if component == 0:
            mean = mean - across
        elif len(mean) == 2:  # the image of the tangent goes on along the surface
            mean = across
    return mean


def _has_plate(part: AnyPart) -> bool:
    """Whether a total force moves a part."""
    loads = getattr(part, "loads", ())
    return any(load.level for load in loads) or bool(getattr(part, "force", None))
