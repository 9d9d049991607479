"""From reactions back to the bodies: displacements and stresses (paper, eq (13))."""

from __future__ import annotations

from contactopt.bodies.fields import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.linear.concurrency import each
from contactopt.problem import Solution

__all__ = ["Fields", "recover"]


def recover(reduction: Reduction, solution: Solution) -> tuple[Fields, ...]:
    """Compute the displacement and stress of the elastic bodies of a solved scene.

    Parameters
    ----------
    reduction, solution : The reduction of the scene, and a solution of its problem.

    Returns
    -------
    The Fields of each body that has any, upper body first.
    """
    displaced = zip(reduction.bodies, reduction.displaced(solution))
    fields = each(lambda pair: pair[0].fields(pair[1]), displaced)
    return tuple(found for found in fields if found is not None)
