"""Warm starts along sequences of meshes: reactions of one problem as a first guess for another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution


def transfer(source: InterfaceProblem, solution: Solution, target: InterfaceProblem) -> Solution:
    """A start for `target`: the tractions of a solution of `source`, interpolated linearly to its nodes.

    The problems share dimension, coordinates and plates (multipliers are taken over); outside the nodes of `source` the
    nearest one counts. Raises InputError if the problems do not fit together.
    """
    same = (source.dim, len(source.s), len(source.coordinates))
    if same != (target.dim, len(target.s), len(target.coordinates)):
        raise InputError("a start can be transferred between problems of the same dimension and number of plates only.")
    traction = solution.reactions / source.areas[:, None]
    spread = np.ptp(source.coordinates, axis=1)
    axes = np.flatnonzero(spread > 1e-6 * spread.max(initial=0.0))[: source.dim - 1]
    if len(axes) < 2:
        values = _along_a_line(source.coordinates, target.coordinates, traction, axes)
    else:
        values = _over_a_surface(source.coordinates[axes].T, target.coordinates[axes].T, traction)
    return replace(solution, reactions=values * target.areas[:, None])


def _along_a_line(x: np.ndarray, new: np.ndarray, traction: np.ndarray, axes: np.ndarray) -> np.ndarray:
    axis = axes[0] if len(axes) else 0
    order = np.argsort(x[axis])
    return np.stack([np.interp(new[axis], x[axis, order], column[order]) for column in traction.T], axis=1)


def _over_a_surface(x: np.ndarray, new: np.ndarray, traction: np.ndarray) -> np.ndarray:
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

    values = LinearNDInterpolator(x, traction)(new)
    outside = np.any(np.isnan(values), axis=1)
    if outside.any():
        values[outside] = NearestNDInterpolator(x, traction)(new[outside])
    return np.asarray(values)
