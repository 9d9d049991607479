"""The convex programs of friction in cvxpy, written as on a blackboard.

Signs and letters are those of contactopt.problem: u = Q r + V lambda + q, V' r + s = 0. Every
function takes an InterfaceProblem, dimensionless or not (backends want it dimensionless), and
returns a Program. It has two forms: the dual one minimises over forces, the primal one over
displacements (contactopt.models.primal derives it). The value of the one is minus that of
the other, and the multipliers of the one are the variables of the other.

    normal           forces r_n of contact without friction, or with r_t given (paper, eq (21))
    penalised        `normal` with a spring in every contact: penetration instead of a constraint
    bilateral        `normal` without separation: r_n of any sign
    tangential       friction forces under given bounds, r_n given (eq (22)): intervals, discs or
                     polygons
    tresca           normal and tangential forces together, friction bounds given
    associated       convex relaxation of Coulomb's law: slip opens the gap by mu |u_t|
    acary_cadoux     the same with the gap shifted by mu s; Coulomb's law where s = |u_t|

Discs and cones become polygons and pyramids with `facets`, which makes the last four QPs also in
3D. Under orthotropic friction g and mu bound the stretched force, whose set is a disc.

All are convex because Q is positive semidefinite; that is the caller's promise
(contactopt.methods.backends.conic checks it by Cholesky), since cvxpy's own test of it fails at
random on large matrices. `program.problem.get_problem_data` of cvxpy gives the arrays to others.
"""

from contactopt.models.forces import (
    acary_cadoux,
    associated,
    bilateral,
    normal,
    penalised,
    tangential,
    tresca,
)
from contactopt.models.program import Program

__all__ = [
    "Program",
    "acary_cadoux",
    "associated",
    "bilateral",
    "normal",
    "penalised",
    "tangential",
    "tresca",
]
