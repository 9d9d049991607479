"""A solved state, and a function of it with its derivatives."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.coupling.reduction import Reduction
from contactopt.defaults import ROUNDED
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.cones import lengths
from contactopt.problem.laws import Place, find_law
from contactopt.scenes.parameters import Parameter


@dataclass(frozen=True, eq=False)
class Seeds:
    """A function of one solved state: its value, and its derivatives by what the state holds.

    reactions (k, dim), multipliers (p,), displacements (k, dim) of u, slip (k, dim) of u measured
    from the state before, bodies: (n,) by U of each body at fixed forces and
    multipliers;  lifts: (n,) displacement of the held unknowns of each body that the adjoint lacks;
    explicit: by a scalar parameter at fixed forces, multipliers and displacements
    """

    value: float
    reactions: np.ndarray | None = None
    multipliers: np.ndarray | None = None
    displacements: np.ndarray | None = None
    slip: np.ndarray | None = None
    bodies: tuple[Any, ...] = ()
    lifts: tuple[Any, ...] = ()
    explicit: Callable[[Parameter], float] = field(default=lambda which: 0.0)


@dataclass(frozen=True, eq=False)
class State:
    """A scene reduced to the problem that its solution was certified against."""

    reduction: Reduction
    solution: Solution

    @property
    def problem(self) -> InterfaceProblem:
        return self.reduction.problem

    @cached_property
    def displaced(self) -> tuple[np.ndarray, ...]:
        """U (n,) of every body."""
        return self.reduction.displaced(self.solution)

    @cached_property
    def forces(self) -> tuple[np.ndarray, ...]:
        """Contact forces (n,) on every body."""
        return tuple(B.T @ self.solution.reactions.ravel() for B in self.reduction.maps)

    def following(self, number: int, load: np.ndarray) -> np.ndarray:
        """(k, dim) what a load (n,) on a body moves the contacts by, without its motions."""
        body, B = self.reduction.bodies[number], self.reduction.maps[number]
        moved = body.displacement(load, np.zeros(len(body.motions.resultants))) - body.at_rest
        return np.asarray(B @ moved).reshape(self.problem.q.shape)

    def law_change(self, which: Parameter) -> np.ndarray:
        """(k,) derivatives of the law's parameter by the friction of pairs of surfaces."""
        out, areas = np.zeros(self.problem.contacts), self.problem.areas
        chosen = [pair.name for pair in which.pairs(self.reduction.scene)]
        for pair, made in zip(self.reduction.scene.pairs, self.problem.pairs):
            if pair.name in chosen:
                count = made.stop - made.start
                place = Place(areas[made.contacts], np.zeros((1, 2, 2)))
                law = find_law(pair.law).of_place(np.ones(count), place)
                out[made.contacts] = getattr(law, law.parameters[0])
        return out


@dataclass(frozen=True, eq=False)
class Functional:
    """A linear function of the contact forces of one state, for quantities that have no name.

    weights  (k, dim), one per component of the reactions
    """

    weights: np.ndarray

    def __call__(self, state: State) -> Seeds:
        weights, shape = np.asarray(self.weights, dtype=float), state.problem.q.shape
        if weights.shape != shape:
            raise InputError(
                f"the weights of a functional must have the shape {shape}; got {weights.shape}."
            )
        return Seeds(total(weights, state.solution.reactions), reactions=weights)


def total(weights: np.ndarray, r: np.ndarray) -> float:
    """The sum of weights times forces, both (k, dim), zero where it is rounding beside them."""
    found = float(np.sum(weights * r))
    return found if abs(found) > ROUNDED * float(lengths(weights) @ lengths(r)) else 0.0
