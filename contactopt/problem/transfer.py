"""Warm starts along sequences of meshes: reactions of one problem as a first guess for another."""

from dataclasses import replace

import numpy as np

from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.problem.chart import Chart
from contactopt.problem.interface_problem import InterfaceProblem
from contactopt.problem.pairs import part_of
from contactopt.problem.solution import Solution


def transfer(source: InterfaceProblem, solution: Solution, target: InterfaceProblem) -> Solution:
    """A start for `target`: the tractions of a solution of `source`, interpolated linearly to its
    contacts.

    Places are compared in space, so that the answer does not depend on how the bodies are turned or
    where a chart has its origin: along the polygon of the source's contacts in 2D, in the plane in
    which they extend most in 3D. Outside of the source's contacts the nearest one counts. The
    multipliers are copied.

    Parameters
    ----------
    source : a problem that was solved
    solution : its solution
    target : the problem to start, usually the same bodies on another mesh

    Returns
    -------
    Solution : reactions and multipliers for the argument `start` of solve(), not certified

    Raises
    ------
    InputError : if the problems differ in dimension, in the number of coordinates or in that of
        plates
    """
    same = (source.dim, len(source.s), len(source.coordinates))
    if same != (target.dim, len(target.s), len(target.coordinates)):
        raise InputError(
            "a start can be transferred between problems of the same dimension and number of plates"
            " only."
        )
    if len(source.pairs) > 1:
        return _by_pair(source, solution, target)
    traction = solution.reactions / source.areas[:, None]
    old, new = source.coordinates, target.coordinates
    if source.dim == 3:
        axes, centre = _plane(old)
        old, new = axes.T @ (old - centre), axes.T @ (new - centre)
    thin = source.dim == 3 and np.ptp(old[1]) <= CLOSE * np.ptp(old[0])
    if source.dim == 3 and not thin:
        values = _over_a_surface(old.T, new.T, traction)
    else:
        chart = Chart(old[:1], (False,)) if thin else source.chart
        values = _along_a_line(chart, old, new, traction)
    return replace(solution, reactions=values * target.areas[:, None], displacements=None)


def _by_pair(source: InterfaceProblem, solution: Solution, target: InterfaceProblem) -> Solution:
    """Pairs of surfaces of the same name start from each other."""
    names = [[pair.name for pair in problem.pairs] for problem in (source, target)]
    if names[0] != names[1]:
        raise InputError(
            "a start can be transferred between problems with the same pairs of surfaces only."
        )
    reactions = []
    for old, new in zip(source.pairs, target.pairs):
        own = replace(solution, reactions=solution.reactions[old.contacts])
        reactions.append(transfer(part_of(source, old), own, part_of(target, new)).reactions)
    return replace(solution, reactions=np.concatenate(reactions), displacements=None)


def _plane(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The orthonormal directions (d, 2) in which points (d, k) extend most, and their centre."""
    centre = (points.max(axis=1) + points.min(axis=1))[:, None] / 2
    axes = np.linalg.svd(points - centre, full_matrices=False)[0][:, :2]
    return np.pad(axes, ((0, 0), (0, 2 - axes.shape[1]))), centre


def _along_a_line(
    chart: Chart, points: np.ndarray, new: np.ndarray, traction: np.ndarray
) -> np.ndarray:
    """Values at `new` (d, m) of the polygon through points (d, k) in the order of their chart."""
    from scipy.spatial import KDTree  # late, since it takes long to import

    order = chart.order()
    order = np.append(order, order[:1]) if chart.closed else order
    corners, values = points[:, order].T, traction[order]
    if len(corners) == 1:
        return np.repeat(values, new.shape[1], axis=0)
    nearest = KDTree(corners).query(new.T)[1]
    # The nearest point of the polygon is on one of the two segments at the nearest corner.
    found, distance = np.empty((new.shape[1], traction.shape[1])), np.full(new.shape[1], np.inf)
    last = len(corners) - 2
    for first in (nearest - 1, nearest):
        segment = first % (last + 1) if chart.closed else np.clip(first, 0, last)
        start, side = corners[segment], corners[segment + 1] - corners[segment]
        share = np.sum((new.T - start) * side, axis=1) / np.maximum(np.sum(side**2, axis=1), 1e-300)
        share = np.clip(share, 0.0, 1.0)[:, None]
        apart = np.linalg.norm(new.T - start - share * side, axis=1)
        better = apart < distance
        distance = np.where(better, apart, distance)
        found[better] = ((1 - share) * values[segment] + share * values[segment + 1])[better]
    return found


def _over_a_surface(x: np.ndarray, new: np.ndarray, traction: np.ndarray) -> np.ndarray:
    """Values at `new` (m, 2), linear on triangles between x (k, 2), the nearest one outside."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    values = LinearNDInterpolator(x, traction)(new)
    outside = np.any(np.isnan(values), axis=1)
    if outside.any():
        values[outside] = NearestNDInterpolator(x, traction)(new[outside])
    return np.asarray(values)
