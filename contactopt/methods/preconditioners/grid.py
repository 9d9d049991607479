"""The grid of the contacts: a line, a closed curve or a rectangle that transforms work on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.methods.preconditioners.constants import CELL, EDGE
from contactopt.problem import InterfaceProblem
from contactopt.problem.chart import nodal_weights

GridMap = Callable[[np.ndarray], np.ndarray]  # linear map of arrays (*shape, dim)
GridMaps = tuple[GridMap, GridMap | None]  # products with P and, where it is cheap, with P^-1
NO_GRID = (
    "the preconditioners need contact nodes on a line or a rectangular grid, 3 or more a side."
)


@dataclass(frozen=True, eq=False)
class Grid:
    """Contacts on a line, a closed curve or a rectangular grid, in the order of C arrays of that
    shape.

    ticks    places along each direction [length]
    held     (dim, directions, 2): whether a component is held at the first and at the last contact
             of a direction
    weights  (k,) weights w: the diagonal of Q is about proportional to 1 / w^2, because larger
             nodes give way less (contactopt.problem.chart.nodal_weights)
    closed   whether the line returns to its start
    turn     (dim - 1, dim - 1) rotation from tangential components in the chart to those along the
             directions
    """

    ticks: tuple[np.ndarray, ...]
    held: np.ndarray
    weights: np.ndarray
    closed: bool = False
    turn: np.ndarray | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(t) for t in self.ticks)


def _grid_of(problem: InterfaceProblem, held: np.ndarray) -> tuple[Grid, np.ndarray]:
    """The line, closed curve or rectangular grid of the contacts, and these (k,) in its order."""
    if problem.dim == 2:
        return _line(problem, held)
    turn = _turn(problem.chart.places)
    x = turn @ problem.chart.places
    size = np.ptp(x, axis=1).max(initial=0.0)
    ticks, places = [], []
    for row in x:
        order = np.argsort(row)
        starts = np.concatenate([[True], np.diff(row[order]) > CLOSE * size])
        place = np.empty(len(row), dtype=int)
        place[order] = np.cumsum(starts) - 1
        ticks.append(row[order][starts])
        places.append(place)
    shape = tuple(len(t) for t in ticks)
    order = np.lexsort(places[::-1])
    full = min(shape) > 2 and np.prod(shape) == problem.contacts
    if not full or np.any(np.diff(np.ravel_multi_index(places, shape)[order]) != 1):
        raise InputError(NO_GRID)
    oblique = not np.array_equal(turn, np.eye(2))
    if oblique and np.any(held[:, 1:].any(axis=1) & ~held[:, 1:].all(axis=1)):
        raise InputError(
            "a grid at an angle to tangential directions that are held has no preconditioner."
        )
    on_grid = held[order].reshape(*shape, problem.dim)
    ends = np.array([[on_grid.take(end, axis).all(axis=0) for end in (0, -1)] for axis in (0, 1)])
    areas = problem.areas[order]
    cells = np.multiply.outer(*(cells_along(t) for t in ticks)).ravel()
    weights = cells**CELL * (areas * cells.sum() / areas.sum() / cells) ** EDGE
    weights /= np.sqrt(np.mean(weights**2))
    ends = np.moveaxis(ends, 2, 0)
    return Grid(tuple(ticks), ends, weights, turn=turn if oblique else None), order


@dataclass(frozen=True)
class OnGrid:
    """A preconditioner from a function of the grid that gives products with P and maybe P^-1."""

    make: Callable[[Grid], GridMaps]

    def __post_init__(self) -> None:
        object.__setattr__(self, "__doc__", self.make.__doc__)

    def __call__(self, problem: InterfaceProblem, held: np.ndarray) -> GridMaps:
        """Products with P and P^-1, or None, on (k, dim); InputError without a grid."""
        grid, order = _grid_of(problem, held)

        def placed(act: GridMap) -> GridMap:
            def apply(x: np.ndarray) -> np.ndarray:
                x = x[order]
                if grid.turn is not None:
                    x[:, 1:] = x[:, 1:] @ grid.turn.T
                made = act(x.reshape(*grid.shape, problem.dim)).reshape(x.shape)
                if grid.turn is not None:
                    made[:, 1:] = made[:, 1:] @ grid.turn
                out = np.empty(x.shape)
                out[order] = made
                return out

            return apply

        product, inverse = self.make(grid)
        return placed(product), None if inverse is None else placed(inverse)


def _line(problem: InterfaceProblem, held: np.ndarray) -> tuple[Grid, np.ndarray]:
    """The contacts in their order along a contact line, or around a closed one."""
    chart, order = problem.chart, problem.chart.order()
    ticks = chart.places[0, order]
    if len(ticks) < 3 or np.any(np.diff(ticks) <= 0):
        raise InputError(NO_GRID)
    weights = nodal_weights(chart, problem.areas)[order]
    ends = held[order][[0, -1]].T[:, None, :] & (not chart.closed)
    return Grid((ticks,), ends, weights, chart.closed), order


def _turn(places: np.ndarray) -> np.ndarray:
    """Rotation (2, 2) that lays neighbours of places (2, k) along the axes by the least angle."""
    points = places.T
    if len(points) < 4:
        return np.eye(2)
    step = points[KDTree(points).query(points, k=2)[1][:, 1]] - points
    # Directions that differ by a quarter turn have the same fourth power as complex numbers.
    way = (step[:, 0] + 1j * step[:, 1]) / np.maximum(np.linalg.norm(step, axis=1), 1e-300)
    angle = np.angle(np.mean(way**4)) / 4
    if abs(angle) <= CLOSE:
        return np.eye(2)
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def cells_along(ticks: np.ndarray) -> np.ndarray:
    """Lengths of the ascending ticks' cells, half-way to either neighbour, symmetric at an end."""
    steps = np.diff(ticks)
    return np.concatenate([steps[:1], (steps[:-1] + steps[1:]) / 2, steps[-1:]])
