"""What a solve did otherwise than asked or expected: a method calls `note`, which logs the
sentence. The driver opens `collected` around each solve, whose Solution keeps them, also among
threads.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np

from contactopt.checks import place_words
from contactopt.linear.operators import form, has_entries
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.certificate import amplification
from contactopt.problem.scaling import immovable

# a remark is due if a small problem has so large a condition, and its forces so large an error
FEW, WEDGED, MUCH = 50, 1e4, 1e-3
TOGETHER = 1e-9  # of the extent of all contacts: those that are nearer lie at one place
INSIDE = (
    1e-6  # share of the normal force, and of its friction, that a force may lose and still hold
)
UNFELT = 1e-10  # relative size of displacements by forces that no body feels
EXACT = 1e-11  # certificate that leaves no doubt below a condition of 1e8
_notes: ContextVar[list[str] | None] = ContextVar("notes of the solve that runs", default=None)


def note(logger: logging.Logger, sentence: str) -> None:
    """Log what was done otherwise than asked or expected, and keep it once for the Solution."""
    logger.info(sentence)
    notes = _notes.get()
    if notes is not None and sentence not in notes:
        notes.append(sentence)


@contextmanager
def collected() -> Iterator[list[str]]:
    """Collect the notes that are made inside the `with` block, in a list that grows as it runs."""
    notes: list[str] = []
    token = _notes.set(notes)
    try:
        yield notes
    finally:
        _notes.reset(token)


def remark(problem: InterfaceProblem, solution: Solution) -> None:
    """Say where the forces of a small problem may be far off although they are certified, and where
    contacts at one place can exchange forces.
    """
    at, loose = solution, solution.solved and solution.residual > EXACT
    if loose and problem.contacts <= FEW and form(problem.Q) == "array":
        condition = amplification(problem, at.reactions, at.multipliers)
        if WEDGED < condition < np.inf and condition * at.residual > MUCH:
            asked = problem.law.proportional and not problem.law.dilatant
            note(
                logging.getLogger(__name__),
                "The forces are certified, but they may be off by"
                f" {min(condition * at.residual, 1.0):.0%} of the typical force, because the"
                f" solution is nearly not unique{': see contactopt.diagnose' if asked else ''}.",
            )
    if solution.solved and (where := exchanging(problem, solution.reactions)) is not None:
        place = place_words(where)
        note(
            logging.getLogger(__name__),
            f"at ({place}), where several surfaces meet, the contact forces are not unique: forces"
            " that the contacts there exchange change nothing else",
        )


def exchanging(problem: InterfaceProblem, reactions: np.ndarray) -> np.ndarray | None:
    """A place (dim,) whose contacts can change their forces r by some y with Q y = 0 and V' y = 0
    within friction, so that r + y is a solution, too; None without any.
    """
    Q, (k, dim), r = problem.Q, problem.q.shape, reactions
    places = problem.coordinates.T
    if not has_entries(Q) or places.shape[0] != k or k < 3:
        return None
    size = np.ptp(places, axis=0).max(initial=0.0)
    normal = INSIDE * np.abs(r[:, 0]).max(initial=0.0)
    fixed = np.where(problem.law.lowest < 0, np.inf, r[:, 0]) > normal
    rubs = np.linalg.norm(r[:, 1:], axis=1) < (1 - INSIDE) * problem.law.bound(r[:, 0])
    free = np.repeat((fixed & (rubs | ~problem.law.rough))[:, None], dim, axis=1)
    free[:, 1:] &= problem.law.rough[:, None]
    free &= ~immovable(problem).reshape(k, dim)
    cells, counts = np.unique(
        np.round(places / (TOGETHER * size or 1.0)), axis=0, return_inverse=True, return_counts=True
    )[1:]
    for cell in np.flatnonzero(counts > 2):
        own = np.flatnonzero(np.repeat(cells == cell, dim) & free.ravel())
        columns = Q[:, own] if form(Q) == "array" else Q[:, own].toarray()
        felt = np.vstack([columns / (np.abs(columns).max(initial=0.0) or 1.0), problem.V[own].T])
        if len(own) and np.linalg.svd(felt, compute_uv=False)[-1] <= UNFELT:
            return np.asarray(places[np.flatnonzero(cells == cell)[0]])
    return None
