"""What a solve did otherwise than asked or expected: a method calls `note`, which logs the
sentence. The driver opens `collected` around each solve, whose Solution keeps them, also among
threads.
"""

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
LOOSE = 1e12  # condition above which rounding decides
EXACT = 1e-11  # certificate that leaves no doubt unless Q is nearly singular
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


def dubious(problem: InterfaceProblem, solution: Solution) -> bool:
    """Whether the certificate of few contacts leaves a doubt that is worth its cost."""
    if not solution.solved or problem.contacts > FEW or form(problem.Q) != "array":
        return False
    if solution.residual > EXACT:
        return True
    # where contacts share a place, forces that are hardly felt have been exchanged
    return problem.nearly_singular and not problem.shared_places


def remark(problem: InterfaceProblem, solution: Solution) -> None:
    """Say where the forces of a small problem may be far off although they are certified."""
    if not dubious(problem, at := solution):
        return
    condition = amplification(problem, at.reactions, at.multipliers)
    error = condition * max(at.residual, np.finfo(float).eps)
    if condition <= WEDGED or error <= MUCH:
        return
    why = f"by {min(error, 1.0):.0%} of the typical force, because the solution is"
    why += " nearly not unique"
    if not condition < LOOSE:
        if problem.shared_places:
            return
        why = "by any amount, because they are not unique, or nearly not"
    if problem.law.proportional and not problem.law.dilatant:
        why += ": see contactopt.diagnose"
    note(logging.getLogger(__name__), f"The forces are certified, but they may be off {why}.")
