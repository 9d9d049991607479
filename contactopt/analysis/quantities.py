"""Numbers that people ask of a contact, by name, each read so that its error falls smoothly with the mesh.

A single node, or a count of nodes, jumps from mesh to mesh, and the estimate of an error lives on differences between meshes:
values at an edge or a peak come from fits through many nodes, weighted by the nodal areas.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution
from contactopt.scenes.scene import Scene

if TYPE_CHECKING:
    from contactopt.interface.reduction import Reduction

WINDOW = 0.5  # of the distance from the largest pressure to the edge: where p^2 is fitted


def approach(problem: InterfaceProblem, solution: Solution) -> float | None:
    """By how much the plates bring the bodies together along the mean normal [length]; None without a plate."""
    if len(solution.multipliers) == 0:
        return None
    normal = (problem.V @ solution.multipliers).reshape(problem.q.shape)[:, 0]
    return -float(np.average(normal, weights=problem.areas))


def elastic_energy(reduction: Reduction, solution: Solution) -> float:
    """Of all bodies, the sum of U' A U / 2 [force length]."""
    displaced = reduction.displaced(solution.reactions, solution.multipliers)
    return sum(body.energy(U) for body, U in zip(reduction.bodies, displaced))


def peak_pressure(reduction: Reduction, solution: Solution) -> float:
    """Largest value of a smooth pressure [stress].

    p^2, which is quadratic under Hertz's ellipse, is fitted by a polynomial about the node of the largest pressure, up to half-way
    to the edge, weighted by the nodal areas. That removes the error of the single node: on the axis of an
    axisymmetric mesh the nodal value is some 1 % low, since the strain u_r / r is poorly resolved there, on a ring
    whose area counts for nothing. At the rim of the contact surface, and where the window has no room, the nodal value.
    """
    from contactopt.analysis.zone import pressed

    problem = reduction.problem
    x, node = _surface(reduction.scene, problem)
    pressure = solution.reactions[:, 0] / problem.areas
    top = int(np.argmax(pressure))
    middle = x[:, np.flatnonzero(node == top)[0]]
    distance = np.linalg.norm(x - middle[:, None], axis=0)
    outside = ~pressed(solution.reactions)[node]
    edge = distance[outside].min() if outside.any() else distance.max()
    near = distance < WINDOW * edge
    if at_rim(reduction, solution) or len(np.unique(distance[near])) < 3:
        return float(pressure[top])
    degree = 4 if near.sum() >= 5 ** len(x) + 2 else 2
    powers = np.stack(np.meshgrid(*[np.arange(degree + 1)] * len(x), indexing="ij")).reshape(len(x), -1)
    powers = powers[:, powers.sum(axis=0) <= degree]
    local = (x[:, near] - middle[:, None]) / (WINDOW * edge)
    terms = np.prod(local[:, :, None] ** powers[:, None], axis=0)
    weights = np.sqrt(problem.areas[node[near]])[:, None]
    fit = np.linalg.lstsq(terms * weights, pressure[node[near], None] ** 2 * weights, rcond=None)[0]
    inner = distance[near] <= WINDOW / 2 * edge
    return float(np.sqrt((terms[inner] @ fit).max()))


def at_rim(reduction: Reduction, solution: Solution) -> bool:
    """Whether the largest pressure is at the rim of the candidate surface: a corner, where it is infinite.

    A node inside has neighbours in all directions.
    """
    problem = reduction.problem
    x, node = _surface(reduction.scene, problem)
    top = int(np.argmax(solution.reactions[:, 0] / problem.areas))
    offsets = x - x[:, [np.flatnonzero(node == top)[0]]]
    distance = np.linalg.norm(offsets, axis=0)
    if len(x) == 1:
        return bool((offsets > 0).any() != (offsets < 0).any())
    near = offsets[:, np.argsort(distance)[1:9]]
    angles = np.sort(np.arctan2(near[1], near[0]))
    return bool(np.max(np.diff(np.append(angles, angles[0] + 2 * np.pi))) > 0.8 * np.pi)


def _surface(scene: Scene, problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    """Positions (dim - 1, m) on the contact surface with mirror images, and the contact node of each (m,)."""
    x, node = problem.coordinates[: problem.dim - 1], np.arange(problem.contacts)
    if scene.copies == 1 and scene.kind != "axisymmetric":
        return x, node
    near = 1e-9 * np.abs(x).max()
    for axis in range(len(x)):
        if np.abs(x[axis]).min() <= near and (np.all(x[axis] >= -near) or np.all(x[axis] <= near)):
            other = np.abs(x[axis]) > near
            image = x[:, other] * np.where(np.arange(len(x)) == axis, -1.0, 1.0)[:, None]
            x, node = np.hstack([x, image]), np.append(node, node[other])
    return x, node


def width(reduction: Reduction, solution: Solution) -> float:
    """Half-width of the contact zone [length].

    In the plane, where contact ends by itself: the zero of a line through p^2 against x^2, from half of the half-width on, without
    the last two nodes, whose values carry the error of the edge. Otherwise contact_edge().
    """
    from contactopt.analysis.edges import contact_edge
    from contactopt.analysis.zone import pressed

    problem, r = reduction.problem, solution.reactions
    inside, distance = pressed(r), np.abs(problem.coordinates[0])
    if problem.dim == 2 and inside.any() and not inside.all() and distance[~inside].min() > distance[inside].max():
        last = distance[inside].max()
        rough = np.sort(distance[inside])[-2:].min()
        fitted = inside & (distance >= WINDOW * last) & (distance < rough)
        if len(np.unique(distance[fitted])) > 2:
            square = (r[fitted, 0] / problem.areas[fitted]) ** 2
            slope, height = np.polyfit(distance[fitted] ** 2, square, 1, w=np.sqrt(problem.areas[fitted]))
            if slope < 0 < height:
                return float(np.sqrt(-height / slope))
    return contact_edge(reduction.scene, problem, r)


def stick_ratio(reduction: Reduction, solution: Solution) -> tuple[float, float]:
    """Half-width of the stick zone over that of contact [-], and its uncertainty: read between nodes."""
    from contactopt.analysis.edges import contact_edge, stick_edge

    problem = reduction.problem
    given = reduction.scene, problem, solution.reactions
    edge = contact_edge(*given)
    slip = problem.displacements(solution.reactions, solution.multipliers)[:, 1:]
    stick, uncertainty = stick_edge(*given, slip)
    return (stick / edge, uncertainty / edge) if edge > 0 else (0.0, 0.0)


def _approach(reduction: Reduction, solution: Solution) -> float:
    value = approach(reduction.problem, solution)
    if value is None:
        raise InputError(f"scene '{reduction.scene.name}' has no plate, hence no approach; ask for another quantity.")
    return value


def uncertainty(name: str, reduction: Reduction, solution: Solution) -> float:
    """Of the value itself, in its unit: nonzero where it is read between nodes, in two ways that may differ."""
    return stick_ratio(reduction, solution)[1] if name == "stick" else 0.0


# name -> function of a reduction and its solution
QUANTITIES: dict[str, Callable[[Reduction, Solution], float]] = {
    "pressure": peak_pressure,
    "width": width,
    "approach": _approach,
    "stick": lambda *solved: stick_ratio(*solved)[0],
    "energy": elastic_energy,
}
