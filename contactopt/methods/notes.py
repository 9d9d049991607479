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

from contactopt.linear.operators import form
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.certificate import amplification

# a remark is due if a small problem has so large a condition, and its forces so large an error
FEW, WEDGED, MUCH = 50, 1e4, 1e-3
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
    """Say where the forces of a small problem may be far off although they are certified."""
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
