"""All solutions of a small 2D problem, by a tree over the states of its contacts
(contactopt.methods.kernels.states).

Each contact is open, sticks, or slips forwards or backwards. The tree finds every combination of
states that has a point, whatever Q is. The natural map certifies each point. A point where several
combinations meet is listed once.

A combination whose linear system is singular may have a continuum of solutions, all of the same
states; it is represented by one of its points. Time grows exponentially with the number of contacts
in the worst case.
"""

import numpy as np

from contactopt.checks import check_number
from contactopt.defaults import TOL
from contactopt.errors import InputError
from contactopt.methods.kernels.states import StateTree, can, sides_of
from contactopt.problem import (
    InterfaceProblem,
    Solution,
    Status,
    check_problem,
    dimensionless,
    natural_map_residual,
)

MOST_CONTACTS = 24  # contacts


def all_solutions(problem: InterfaceProblem, limit: int = 100) -> list[Solution]:
    """Find every solution of a small 2D problem with Coulomb's law.

    Parameters
    ----------
    problem : with at most 24 contacts; Q may be unsymmetric, singular or indefinite
    limit : number of solutions after which the search ends

    Returns
    -------
    The solutions, each certified; an empty list if there is none. If a
    continuum of solutions has the same states, one of them is listed.

    Raises
    ------
    InputError : in 3D, for other laws, and for more than 24 contacts
    """
    check_problem(problem)
    check_number("limit", limit, low=0.0)
    if not can(problem) or problem.dim != 2 or problem.contacts > MOST_CONTACTS:
        raise InputError(
            f"all_solutions needs a 2D problem of Coulomb's law with at most {MOST_CONTACTS}"
            " contacts; use solve."
        )
    scaled, scales = dimensionless(problem.explicit())
    tree, found, known = StateTree(scaled), list[Solution](), list[np.ndarray]()
    for r, lam, sides in filter(None, tree.points()):
        # states in which a point lies that is listed already
        if any(np.all(other | ~sides) for other in known):
            continue
        reactions, multipliers = scales.to_physical(r, lam)
        residual = natural_map_residual(problem, reactions, multipliers)
        if residual <= TOL:
            known.append(sides_of(scaled, r, lam))
            answer = reactions, multipliers, Status.SOLVED, residual
            found.append(Solution(*answer, tree.branches, "all_solutions"))
            if len(found) >= limit:
                break
    return found
