"""The loop of Newton's method, the only one: a system evaluates its equations at a point and solves
the linear system of a step; whoever takes the iterates says when they are good enough.

Systems are contactopt.methods.kernels.semismooth (`Steps`, for an array, a sparse matrix and
products), .coupled_newton (contacts and bodies at once) and .level_steps (convolutions on a grid).

Source of the accuracy of steps: Eisenstat, Walker (1996), Choosing the forcing terms in an inexact
Newton method, SIAM J. Sci. Comput. 17, 16-32.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np

from contactopt.linear.deadline import check_time, enough
from contactopt.linear.stacked import Vector
from contactopt.methods.constants import LAST_LOOSEST, LAST_SHARE, MEMORY, SHORTEST

Unknowns = tuple[Vector, ...]


class Evaluation(Protocol):
    """The equations at a point, which the system may have improved."""

    @property
    def point(self) -> Unknowns: ...

    @property
    def residual(self) -> float: ...


At = TypeVar("At", bound=Evaluation)


class System(Protocol, Generic[At]):
    """Equations for Newton's method."""

    def evaluate(self, point: Unknowns) -> At:
        """The equations at a point."""
        ...

    def change(self, at: At) -> Unknowns | None:
        """The step from there; None where the linear system could not be solved."""
        ...


def newton_iterates(system: System[At], at: At, damped: bool = False) -> Iterator[At]:
    """Newton's iterates from `at` while the linear systems can be solved; steps may be `damped`."""
    recent: list[float] = []
    while True:
        check_time()
        yield at
        change, length = system.change(at), 1.0
        if change is None:
            return
        recent = [*recent[1 - MEMORY :], at.residual]
        new = system.evaluate(tuple(x + dx for x, dx in zip(at.point, change)))
        while damped and not new.residual <= max(recent):
            length /= 2
            if length < SHORTEST:
                return
            new = system.evaluate(tuple(x + length * dx for x, dx in zip(at.point, change)))
        at = new


@dataclass
class Forcing:
    """The relative accuracy of the linear system of a Newton step that is worth its price: `first`
    for the first step, then between `loosest` and `tightest`, for convergence of an `order` between
    1 and 2. The step that ends a solve need not come further than that asks.
    """

    first: float
    loosest: float
    tightest: float
    order: float = 2.0
    last: float = np.inf  # residual before the last step
    accuracy: float = field(init=False)  # of that step

    def __post_init__(self) -> None:
        self.accuracy = self.first

    def __call__(self, residual: float) -> float:
        """The accuracy of the step from a point with this residual of the equations."""
        if self.last in (0.0, np.inf):
            worth = self.first if self.last else self.tightest
        else:
            worth = min(
                self.loosest, max(self.tightest, 0.5 * (residual / self.last) ** self.order)
            )
        self.last = residual
        self.accuracy = max(worth, min(LAST_LOOSEST, LAST_SHARE * enough()))
        return self.accuracy
