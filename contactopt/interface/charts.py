"""The chart of a contact surface, from where its nodes lie and which of them a plane of symmetry holds."""

from __future__ import annotations

import numpy as np

from contactopt.bodies.body import Body
from contactopt.problem.chart import Chart
from contactopt.scenes.scene import Scene

ALONG = 1e-6  # a component of a unit tangent below this does not count


def surface_chart(
    scene: Scene, points: np.ndarray, frames: np.ndarray, sides: list[tuple[Body | None, np.ndarray]]
) -> Chart:
    """The chart of contacts at points (dim, k) with frames (k, dim, dim), on the sides (body, its contact nodes).

    A direction is mirrored where the whole body has images and the contacts at one end are held along that direction.
    """
    held = _held(scene, frames, sides)
    normal = frames[:, 0].mean(axis=0)
    t1 = frames[:, 1].mean(axis=0)
    normal /= np.linalg.norm(normal)
    t1 = t1 - (t1 @ normal) * normal
    axes = [t1 / np.linalg.norm(t1)]
    if scene.dim == 3:
        axes.append(np.cross(normal, axes[0]))
    places = np.array(axes) @ points
    if scene.dim == 2:
        order = np.argsort(places[0])
        steps = np.linalg.norm(np.diff(points[:, order], axis=1), axis=0)
        arc = np.empty(points.shape[1])
        arc[order] = np.append(0.0, np.cumsum(steps))
        places = arc[None]
    mirrored = []
    for x, still in zip(places, held):
        ends = [end for end in (x.min(), x.max()) if np.all(still[np.isclose(x, end, rtol=0, atol=1e-9 * np.ptp(x))])]
        images = (scene.copies > 1 or scene.kind == "axisymmetric") and len(ends) == 1
        mirrored.append(images)
        x -= ends[0] if images else (x.min() + x.max()) / 2
    return Chart(places, tuple(mirrored))


def _held(scene: Scene, frames: np.ndarray, sides: list[tuple[Body | None, np.ndarray]]) -> np.ndarray:
    """Mask (dim - 1, k) of the tangential directions in which supports hold every elastic body."""
    held = np.ones((scene.dim - 1, len(frames)), dtype=bool)
    for body, nodes in sides:
        if body is None:
            continue
        still = np.ones(len(body.load), dtype=bool)
        still[body.free] = False
        component = np.array([still[unknowns[nodes]] for unknowns in body.unknowns])  # (dim, k)
        for i in range(scene.dim - 1):
            counts = np.abs(frames[:, 1 + i].T) > ALONG
            held[i] &= np.all(component | ~counts, axis=0)
    return held
