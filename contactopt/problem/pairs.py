"""The pairs of surfaces of an interface problem, and one pair taken alone.

Places on a contact surface mean something within one pair only. Whoever reads them (figures, half-widths, preconditioners)
does so pair by pair.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from contactopt.problem.chart import Chart
from contactopt.problem.operators import InterfaceOperator, block

if TYPE_CHECKING:
    from contactopt.problem.interface_problem import InterfaceProblem
    from contactopt.problem.solution import Solution


@dataclass(frozen=True, eq=False)
class Pair:
    """Consecutive contacts of an interface problem that belong to one pair of surfaces.

    name          of the pair, for messages, tables and files
    first, last   numbers of its first contact and of the first one after it
    chart         places of its contacts on their surface
    """

    name: str
    first: int
    last: int
    chart: Chart

    @property
    def contacts(self) -> slice:
        """Of arrays with one row per contact."""
        return slice(self.first, self.last)

    def unknowns(self, dim: int) -> np.ndarray:
        """Numbers of the pair's rows in Q."""
        return np.arange(self.first * dim, self.last * dim)


def alone(problem: InterfaceProblem, solution: Solution, pair: Pair) -> tuple[InterfaceProblem, Solution]:
    """The problem of one pair with the forces of all other pairs held at those of the solution, and its part of the solution.

    The displacements of the pair are the same functions of its own forces, and the loads are those that the solution's
    forces on the pair balance, so that a solution of the whole problem gives one of this problem. Where there is one pair
    only, both are returned as they are.
    """
    if len(problem.pairs) == 1:
        return problem, solution
    rows, own = pair.unknowns(problem.dim), pair.contacts
    r, lam, V = solution.reactions[own], solution.multipliers, problem.V[rows]
    u = problem.displacements(solution.reactions, lam)[own]
    Q = block(problem.Q, rows)
    q = u - (Q @ r.ravel() + V @ lam).reshape(r.shape)
    whole = replace(
        problem,
        Q=Q,
        q=q,
        law=problem.law.select(np.arange(pair.first, pair.last)),
        V=V,
        s=-(V.T @ r.ravel()),
        areas=problem.areas[own],
        coordinates=problem.coordinates[:, own],
        chart=pair.chart,
        pairs=(Pair(pair.name, 0, pair.last - pair.first, pair.chart),),
    )
    return whole, replace(solution, reactions=r)
