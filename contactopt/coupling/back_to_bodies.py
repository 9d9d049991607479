"""From reactions back to the bodies: displacements and stresses (paper, eq (13))."""

from __future__ import annotations

from contactopt.bodies.fields import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.linear.concurrency import each
from contactopt.problem import Solution

__all__ = ["Fields", "recover"]


def recover(reduction: Reduction, solution: Solution) -> tuple[Fields, ...]:
    """The displacement and stress of each body that has any, upper body first, from a reduction and
    a solution of its problem.
    """
    displaced = zip(reduction.bodies, reduction.displaced(solution))
    fields = each(lambda pair: pair[0].fields(pair[1]), displaced)
    return tuple(found for found in fields if found is not None)
