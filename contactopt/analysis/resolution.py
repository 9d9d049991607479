"""Whether the mesh resolves the contact at all: remarks for people, on answers whose certificate says nothing of the mesh."""

from __future__ import annotations

import numpy as np

from contactopt.analysis.resultants import views
from contactopt.analysis.status import contact_status
from contactopt.interface.reduction import Reduction
from contactopt.problem import Solution

FEWEST = (
    4  # elements across the half-width of contact; with so few the largest pressure is some percent off (reports/hertz)
)


def remarks(reduction: Reduction, solution: Solution) -> tuple[str, ...]:
    """One sentence for every pair of surfaces whose zone of contact is smaller than the mesh can show.

    A zone that ends by itself and has fewer contacts than a disc or strip of FEWEST elements across its half-width is told.
    A surface that touches as a whole has no such zone.

    Parameters
    ----------
    reduction
        A reduced scene.
    solution
        Of its problem.

    Returns
    -------
    tuple of str
        Full sentences; empty if every zone is resolved, and for solutions that are not certified.
    """
    if not solution.solved:
        return ()
    return tuple(
        f"too few contacts of '{name}' touch, {len(own)} of {count}, to show how the pressure is distributed: "
        "refine the meshes there, or ask for an accuracy."
        for (name, count), own in coarse(reduction, solution)
    )


def coarse(reduction: Reduction, solution: Solution) -> list[tuple[tuple[str, int], np.ndarray]]:
    """Find the pairs of surfaces whose zone of contact is smaller than the mesh can show.

    Parameters
    ----------
    reduction
        A reduced scene.
    solution
        Of its problem.

    Returns
    -------
    list
        Name and number of contacts of each such pair, with the numbers of those that touch.
    """
    found = []
    for (view, own), pair in zip(views(reduction, solution), reduction.problem.pairs):
        problem = view.problem
        touching = np.flatnonzero(contact_status(problem, own.reactions).touching)
        images = 2 ** int(np.sum(problem.chart.mirrored))
        strip = 2 * FEWEST if problem.dim == 2 else np.pi * FEWEST**2
        if 0 < len(touching) < problem.contacts and len(touching) * images < strip:
            found.append(((pair.name, problem.contacts), touching + pair.start))
    return found
