"""From reactions back to the bodies: displacements and stresses (paper, eq (13))."""

from contactopt.bodies.fields import Fields
from contactopt.bodies.views import fields as fields_of
from contactopt.coupling.reduction import Reduction
from contactopt.linear.concurrency import each
from contactopt.problem import Solution

__all__ = ["Fields", "recover"]


def recover(reduction: Reduction, solution: Solution) -> tuple[Fields, ...]:
    """The displacement and stress of each body that has any, from a solution of a reduction."""
    displaced = zip(reduction.bodies, reduction.displaced(solution))
    found = each(lambda pair: fields_of(*pair), displaced)
    return tuple(own for own in found if own is not None)
