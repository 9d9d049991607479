"""Numbers that people ask of a contact, by name, each read so that its error falls smoothly with the mesh.

A single node, or a count of nodes, jumps from mesh to mesh, and the estimate of an error lives on differences between meshes:
values at an edge or a peak come from fits through many nodes, weighted by the nodal areas.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from contactopt.analysis.constants import WINDOW
from contactopt.analysis.edges import contact_edge, stick_edge
from contactopt.analysis.status import contact_status
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution

if TYPE_CHECKING:
    from contactopt.interface.reduction import Reduction

CLOSED = 1e-3  # a mean motion below this share of the mean size is that of a surface around a body


def approach(problem: InterfaceProblem, solution: Solution) -> float | None:
    """How far the plates bring the bodies together along the mean normal.

    Parameters
    ----------
    problem
        An interface problem.
    solution
        Of the problem.

    Returns
    -------
    float or None
        [length]; None without a plate, and where the surface surrounds a body, so that its normals have no mean.
    """
    if len(solution.multipliers) == 0:
        return None
    normal = (problem.V @ solution.multipliers).reshape(problem.q.shape)[:, 0]
    mean, size = (float(np.average(motion, weights=problem.areas)) for motion in (normal, np.abs(normal)))
    return None if size > 0 and abs(mean) < CLOSED * size else -mean


def elastic_energy(reduction: Reduction, solution: Solution) -> float:
    """Elastic energy of all bodies together, the sum of U' A U / 2.

    Parameters
    ----------
    reduction
        A reduced scene.
    solution
        Of its problem.

    Returns
    -------
    float
        [force length].
    """
    displaced = reduction.displaced(solution)
    return sum(body.energy(U) for body, U in zip(reduction.bodies, displaced))


def peak_pressure(reduction: Reduction, solution: Solution) -> float:
    """Largest value of a smooth pressure.

    The square of the pressure is quadratic under Hertz's ellipse. A polynomial is fitted to it about the node of the
    largest pressure, up to half-way to the edge, weighted by the nodal areas. That removes the error of the single
    node. This error is large on the axis of an axisymmetric mesh, because the strain u_r / r is poorly resolved
    there, on a ring without area. At the rim of the contact surface, and where the fit has too few nodes, the largest
    nodal value is returned.

    Parameters
    ----------
    reduction
        A reduced scene with one pair of surfaces.
    solution
        Of its problem.

    Returns
    -------
    float
        [stress].

    Raises
    ------
    InputError
        If the scene has several pairs of surfaces.
    """
    _one_pair(reduction)
    problem = reduction.problem
    local, node, top = _around_the_peak(problem, solution)
    pressure = solution.reactions[:, 0] / problem.areas
    distance = np.linalg.norm(local, axis=0)
    outside = contact_status(problem, solution.reactions).open[node]
    edge = distance[outside].min() if outside.any() else distance.max()
    near = distance < WINDOW * edge
    if at_rim(reduction, solution) or len(np.unique(distance[near])) < 3:
        return float(pressure[top])
    degree = 4 if near.sum() >= 5 ** len(local) + 2 else 2
    powers = np.stack(np.meshgrid(*[np.arange(degree + 1)] * len(local), indexing="ij")).reshape(len(local), -1)
    powers = powers[:, powers.sum(axis=0) <= degree]
    terms = np.prod((local[:, near] / (WINDOW * edge))[:, :, None] ** powers[:, None], axis=0)
    weights = np.sqrt(problem.areas[node[near]])[:, None]
    fit = np.linalg.lstsq(terms * weights, pressure[node[near], None] ** 2 * weights, rcond=None)[0]
    inner = distance[near] <= WINDOW / 2 * edge
    return float(np.sqrt((terms[inner] @ fit).max()))


def at_rim(reduction: Reduction, solution: Solution) -> bool:
    """Whether the largest pressure is at the rim of the candidate surface: a corner, where it is infinite.

    A node inside has neighbours in all directions.

    Parameters
    ----------
    reduction
        A reduced scene with one pair of surfaces.
    solution
        Of its problem.

    Returns
    -------
    bool
    """
    offsets = _around_the_peak(reduction.problem, solution)[0]
    distance = np.linalg.norm(offsets, axis=0)
    if len(offsets) == 1:
        return bool((offsets > 0).any() != (offsets < 0).any())
    near = offsets[:, np.argsort(distance)[1:9]]
    angles = np.sort(np.arctan2(near[1], near[0]))
    return bool(np.max(np.diff(np.append(angles, angles[0] + 2 * np.pi))) > 0.8 * np.pi)


def _around_the_peak(problem: InterfaceProblem, solution: Solution) -> tuple[np.ndarray, np.ndarray, int]:
    """Places (dim - 1, m) on the whole surface relative to the node of the largest pressure, the node of each, and that node."""
    top = int(np.argmax(solution.reactions[:, 0] / problem.areas))
    if problem.chart.closed:
        return problem.chart.offsets(top), np.arange(problem.contacts), top
    places, node = problem.chart.images()
    return places - problem.chart.places[:, [top]], node, top


def width(reduction: Reduction, solution: Solution) -> float:
    """Half-width of the contact zone, as contact_edge() reads it.

    Parameters
    ----------
    reduction
        A reduced scene with one pair of surfaces.
    solution
        Of its problem.

    Returns
    -------
    float
        [length].

    Raises
    ------
    InputError
        If the scene has several pairs of surfaces.
    """
    _one_pair(reduction)
    return contact_edge(reduction.scene, reduction.problem, solution.reactions)


def stick_width(reduction: Reduction, solution: Solution) -> tuple[float, float]:
    """Half-width of the stick zone, as stick_edge() reads it from this solution.

    Parameters
    ----------
    reduction
        A reduced scene with one pair of surfaces.
    solution
        Of its problem.

    Returns
    -------
    (float, float)
        The half-width and its uncertainty [length].

    Raises
    ------
    InputError
        If the scene has several pairs of surfaces.
    """
    _one_pair(reduction)
    problem = reduction.problem
    slip = problem.displacements(solution.reactions, solution.multipliers)[:, 1:]
    return stick_edge(reduction.scene, problem, solution.reactions, slip)


def _one_pair(reduction: Reduction) -> None:
    """InputError if a scene has several pairs of surfaces, each with numbers of its own."""
    if len(reduction.problem.pairs) > 1:
        raise InputError(
            f"scene '{reduction.scene.name}' has {len(reduction.problem.pairs)} pairs of surfaces, each with its own pressure and "
            "half-widths; name the pair, as in 'pressure:"
            + reduction.problem.pairs[0].name
            + "', or ask for the energy."
        )


def _stick_ratio(reduction: Reduction, solution: Solution) -> tuple[float, float]:
    """Half-width of the stick zone over that of contact.

    Parameters
    ----------
    reduction
        A reduced scene with one pair of surfaces.
    solution
        Of its problem.

    Returns
    -------
    (float, float)
        The ratio and its uncertainty, since it is read between nodes [-].

    Raises
    ------
    InputError
        If the scene has several pairs of surfaces.
    """
    edge = width(reduction, solution)
    stick, uncertainty = stick_width(reduction, solution)
    return (stick / edge, uncertainty / edge) if edge > 0 else (0.0, 0.0)


def _approach(reduction: Reduction, solution: Solution) -> float:
    value = approach(reduction.problem, solution)
    if value is None:
        raise InputError(f"scene '{reduction.scene.name}' has no plate, hence no approach; ask for another quantity.")
    return value


def uncertainty(name: str, reduction: Reduction, solution: Solution) -> float:
    """Half the difference between two readings of a quantity.

    Parameters
    ----------
    name
        Of the quantity.
    reduction
        A reduced scene.
    solution
        Of its problem.

    Returns
    -------
    float
        In the unit of the quantity; 0 where it has only one reading.
    """
    return _stick_ratio(reduction, solution)[1] if name == "stick" else 0.0


# name -> function of a reduction and its solution
QUANTITIES: dict[str, Callable[[Reduction, Solution], float]] = {
    "pressure": peak_pressure,
    "width": width,
    "approach": _approach,
    "stick": lambda *solved: _stick_ratio(*solved)[0],
    "energy": elastic_energy,
}
OF_ONE_PAIR = ("pressure", "width", "stick")  # these belong to a surface, not to the scene as a whole
