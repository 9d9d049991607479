"""One pair of surfaces of an interface problem, taken alone."""

from dataclasses import replace

import numpy as np

from contactopt.linear.operators import block
from contactopt.problem.chart import Pair
from contactopt.problem.interface_problem import InterfaceProblem
from contactopt.problem.solution import Solution


def part_of(problem: InterfaceProblem, pair: Pair) -> InterfaceProblem:
    """The contacts of one pair of surfaces as a problem, without forces elsewhere."""
    if len(problem.pairs) == 1:
        return problem
    own = pair.contacts
    rows = np.arange(pair.start * problem.dim, pair.stop * problem.dim)
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
    """The problem and solution of one pair of surfaces under the forces of all others."""
    if len(problem.pairs) == 1:
        return problem, solution
    part, r, others = part_of(problem, pair), solution.reactions[pair.contacts], solution.reactions
    others = others.copy()
    others[pair.contacts] = 0.0
    apart = (problem.Q @ others.ravel()).reshape(others.shape)[pair.contacts]
    own = replace(part, q=part.q + apart, s=-(part.V.T @ r.ravel()))
    return own, replace(solution, reactions=r, displacements=None)
