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
COVERED = 0.99  # a contact with less than this share of its faces lies where the other surface ends


def remarks(reduction: Reduction, solution: Solution) -> tuple[str, ...]:
    """Tell of zones of contact that are smaller than the mesh can show, or reach the other surface's rim.

    A zone that ends by itself and has fewer contacts than a disc or strip of FEWEST elements across its half-width is told.
    A surface that touches as a whole has no such zone. Contacts at the
    rim of the other surface are told, since only a part of their faces bears the force.

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
    found = []
    for (view, own), coupling in zip(views(reduction, solution), reduction.couplings):
        problem, name = view.problem, view.problem.pairs[0].name
        touches = contact_status(problem, own.reactions).touching
        touching = int(touches.sum())
        if coupling.share is not None and np.any(rim := touches & (coupling.share < COVERED)):
            least = np.argmin(np.where(rim, coupling.share, 1.0))
            where = ", ".join(f"{c:.4g}" for c in coupling.positions[:, least])
            found.append(
                f"{rim.sum()} contacts of '{name}' touch at the rim of the other surface, which covers "
                f"only a part of their faces, as little as {coupling.share[least]:.0%} near ({where}): "
                "their pressure is the force over that part."
            )
        images = 2 ** int(np.sum(problem.chart.mirrored))
        strip = 2 * FEWEST if problem.dim == 2 else np.pi * FEWEST**2
        if 0 < touching < problem.contacts and touching * images < strip:
            found.append(
                f"too few contacts of '{name}' touch, {touching} of {problem.contacts}, to show how the pressure is distributed: "
                "refine the meshes there, or ask for an accuracy."
            )
    return tuple(found)
