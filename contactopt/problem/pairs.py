"""The pairs of surfaces of an interface problem, and one pair taken alone.

Places on a contact surface mean something within one pair only. Whoever reads them (figures,
half-widths, preconditioners) does so pair by pair.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from contactopt.linear.operators import block
from contactopt.problem.chart import Chart

if TYPE_CHECKING:
    from contactopt.problem.interface_problem import InterfaceProblem
    from contactopt.problem.solution import Solution


@dataclass(frozen=True, eq=False)
class Pair:
    """Consecutive contacts of an interface problem that belong to one pair of surfaces.

    name          of the pair, for messages, tables and files
    start, stop   numbers of its first contact and of the first one after it
    chart         places of its contacts on their surface
    """

    name: str
    start: int
    stop: int
    chart: Chart

    @property
    def contacts(self) -> slice:
        """Of arrays with one row per contact."""
        return slice(self.start, self.stop)

    def unknowns(self, dim: int) -> np.ndarray:
        """Number the pair's rows in Q.

        Parameters
        ----------
        dim : Number of components of a contact.

        Returns
        -------
        (k_i dim,) numbers of the rows.
        """
        return np.arange(self.start * dim, self.stop * dim)


def part_of(problem: InterfaceProblem, pair: Pair) -> InterfaceProblem:
    """Take the contacts of one pair of surfaces as a problem, without forces at all others.

    Parameters
    ----------
    problem : The interface problem.
    pair : One of its pairs, with k_i contacts.

    Returns
    -------
    The problem of the k_i contacts. Where there is one pair only, it is the problem itself.
    """
    if len(problem.pairs) == 1:
        return problem
    rows, own = pair.unknowns(problem.dim), pair.contacts
    return replace(
        problem,
        Q=block(problem.Q, rows),
        q=problem.q[own],
        law=problem.law.select(np.arange(pair.start, pair.stop)),
        V=problem.V[rows],
        areas=problem.areas[own],
        coordinates=problem.coordinates[:, own],
        chart=pair.chart,
        pairs=(Pair(pair.name, 0, pair.stop - pair.start, pair.chart),),
    )


def alone(
    problem: InterfaceProblem, solution: Solution, pair: Pair
) -> tuple[InterfaceProblem, Solution]:
    """Take one pair of surfaces alone, with the forces of all other pairs as they are in the
    solution.

    The displacements of the pair are the same functions of its own forces, and the loads are those
    that the solution's forces on the pair balance. A solution of the whole problem therefore gives
    one of this problem. Where there is one pair only, both are returned as they are.

    Parameters
    ----------
    problem : The interface problem.
    solution : A solution of it.
    pair : One of its pairs, with k_i contacts.

    Returns
    -------
    The problem of the k_i contacts, and the solution with their reactions (k_i, dim).
    """
    if len(problem.pairs) == 1:
        return problem, solution
    part, r, lam = part_of(problem, pair), solution.reactions[pair.contacts], solution.multipliers
    apart = problem.displacements(solution.reactions, lam)[pair.contacts] - part.displacements(
        r, lam
    )
    own = replace(part, q=part.q + apart, s=-(part.V.T @ r.ravel()))
    return own, replace(solution, reactions=r, displacements=None)
