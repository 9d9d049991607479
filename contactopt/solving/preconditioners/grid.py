"""The grid of the contacts: a line or a rectangle of nodes that transforms work on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.problem.operators import nodal_weights

Product = Callable[[np.ndarray], np.ndarray]  # acts on arrays (*shape, dim)
EVEN = 1e-6  # relative difference of spacings that counts as none
CELL = 0.45  # power of a node's cell that weights it on a surface: 1/2 where the spacing varies slowly
EDGE = 0.2  # and of the share of the cell that an edge leaves: 0 for a half-space, 1/4 and more for a quarter-space


@dataclass(frozen=True, eq=False)
class Grid:
    """Contacts on a line or a rectangular grid, in the order of C arrays of that shape.

    ticks    places along each direction [length]
    held     (dim, directions, 2): component does not move at the first / last contact of that direction
    weights  (k,) square roots of what takes the nodes' sizes out of Q, see nodal_weights
    """

    ticks: tuple[np.ndarray, ...]
    held: np.ndarray
    weights: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(t) for t in self.ticks)


def grid_of(problem: InterfaceProblem, still: np.ndarray) -> tuple[Grid, np.ndarray]:
    """The grid of the contacts, and the order (k,) of the contacts in it; still (k, dim) masks what cannot move.

    Raises InputError where there is none.
    """
    x = problem.chart.places
    size = np.ptp(x, axis=1).max(initial=0.0)
    ticks, places = [], []
    for row in x:
        order = np.argsort(row)
        starts = np.concatenate([[True], np.diff(row[order]) > EVEN * size])
        place = np.empty(len(row), dtype=int)
        place[order] = np.cumsum(starts) - 1
        ticks.append(row[order][starts])
        places.append(place)
    shape = tuple(len(t) for t in ticks)
    order = np.lexsort(places[::-1])
    full = min(shape) > 2 and np.prod(shape) == problem.contacts
    if not full or np.any(np.diff(np.ravel_multi_index(places, shape)[order]) != 1):
        raise InputError("the preconditioners need contact nodes on a line or a rectangular grid, 3 or more a side.")
    on_grid = still[order].reshape(*shape, problem.dim)
    across = tuple(range(len(shape) - 1))
    ends = [[on_grid.take(end, axis).all(axis=across) for end in (0, -1)] for axis in range(len(shape))]
    areas = problem.areas[order]
    if len(shape) == 1:
        weights = nodal_weights(x[:, order], areas, problem.dim)
    else:
        cells = np.multiply.outer(*(cells_along(t) for t in ticks)).ravel()
        weights = cells**CELL * (areas * cells.sum() / areas.sum() / cells) ** EDGE
    return Grid(tuple(ticks), np.moveaxis(np.array(ends), 2, 0), weights / np.sqrt(np.mean(weights**2))), order


def cells_along(ticks: np.ndarray) -> np.ndarray:
    steps = np.diff(ticks)
    return np.concatenate([steps[:1], (steps[:-1] + steps[1:]) / 2, steps[-1:]])
