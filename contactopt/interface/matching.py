"""Where two bodies may touch: partners of contact nodes, local frames, initial gap."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.bodies.body import Body
from contactopt.errors import InputError
from contactopt.scenes.scene import Part, Rigid, Scene

MATCH = 1e-6  # nodes match within this fraction of the shortest distance between contact nodes


def match_bodies(scene: Scene, upper: Body | None, lower: Body | None) -> tuple[Any, ...]:
    """Matched contact nodes of both bodies, frames, initial gap and areas."""
    if upper is not None and lower is not None:
        own, other = _match(upper, lower)
        nodes = (upper.nodes[own], lower.nodes[other])
        normals = lower.normals[:, other]
        first, second = (
            b.weights[:, b.surface] @ _true(p, b).T for p, b in zip((scene.upper, scene.lower), (upper, lower))
        )
        apart = first[own] - second[other]
        gap = np.sum(normals * apart.T, axis=0)
        areas = lower.areas[other]
    else:
        body, rigid, sign = (upper, scene.lower, -1.0) if upper is not None else (lower, scene.upper, 1.0)
        assert body is not None and isinstance(rigid, Rigid)
        own = np.lexsort(body.points)
        nodes = (body.nodes[own], body.nodes[own])
        normals = sign * body.normals[:, own]
        if rigid.normal is not None:
            normals = np.tile(np.array(rigid.normal)[:, None] / np.linalg.norm(rigid.normal), len(own))
        areas = body.areas[own]
        gap = _rigid_gap(scene.upper if upper is not None else scene.lower, body, rigid)[own]
    return nodes, _frames(normals), gap, areas


def _rigid_gap(part: Part | Rigid, body: Body, rigid: Rigid) -> np.ndarray:
    """Initial gap (k,) between a body and a rigid one, from the gaps of the nodes with the weights of displacements."""
    if rigid.gap is None:
        return np.zeros(len(body.nodes))
    gap = np.asarray(rigid.gap(_true(part, body)), dtype=float)
    if gap.shape != body.surface.shape or not np.all(np.isfinite(gap)):
        raise InputError(f"the gap of rigid body '{rigid.name}' must give one finite number per contact node.")
    return np.asarray(body.weights[:, body.surface] @ gap)


def _true(part: Part | Rigid, body: Body) -> np.ndarray:
    """Where the nodes of the contact boundary lie on the surface that the mesh stands for, (dim, m)."""
    places = body.locations[:, body.surface]
    return places if isinstance(part, Rigid) or part.curve is None else np.asarray(part.curve(places), dtype=float)


def _match(upper: Body, lower: Body) -> tuple[np.ndarray, np.ndarray]:
    """Indices into both bodies' contact nodes such that partners lie on one normal; InputError if they do not."""
    mean = lower.normals @ lower.areas
    mean /= np.linalg.norm(mean)
    first, second = (b.points - np.outer(mean, mean @ b.points) for b in (upper, lower))
    order = np.lexsort(upper.points)
    distance, partner = KDTree(second.T).query(first.T[order])
    spacing = KDTree(second.T).query(second.T, k=2)[0][:, 1].min() if second.shape[1] > 1 else 1.0
    if len(order) != second.shape[1]:
        raise InputError(
            f"interface nodes do not match: body '{upper.name}' has {len(order)} contact nodes, "
            f"body '{lower.name}' has {second.shape[1]}; give both meshes the same nodes there."
        )
    if distance.max() > MATCH * max(spacing, 1e-300) or len(np.unique(partner)) < len(partner):
        raise InputError(
            f"interface nodes do not match: a contact node of body '{upper.name}' lies {distance.max():.3g} off "
            f"the normal through the nearest one of body '{lower.name}' (spacing {spacing:.3g}); "
            "give both meshes the same nodes there."
        )
    return order, partner


def _frames(normals: np.ndarray) -> np.ndarray:
    """Rows n, t1[, t2] per node; t1 is the first axis made orthogonal to n (in 2D: n turned clockwise)."""
    dim, k = normals.shape
    frames = np.zeros((k, dim, dim))
    frames[:, 0] = normals.T
    if dim == 2:
        frames[:, 1] = np.stack([normals[1], -normals[0]], axis=1)
        return frames
    steep = np.abs(normals[0]) > 0.9  # the first axis is nearly normal there: use the second
    axis = np.where(steep[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    t1 = axis - np.sum(axis * normals.T, axis=1)[:, None] * normals.T
    frames[:, 1] = t1 / np.linalg.norm(t1, axis=1)[:, None]
    frames[:, 2] = np.cross(frames[:, 0], frames[:, 1])
    return frames


def positions(bodies: list[Body | None], nodes: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    body, own = (bodies[1], nodes[1]) if bodies[1] is not None else (bodies[0], nodes[0])
    assert body is not None
    return body.locations[:, own]
