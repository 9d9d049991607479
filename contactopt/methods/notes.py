"""What a solve did otherwise than asked or expected: a method calls `note`, which logs the
sentence. The driver opens `collected` around each solve, whose Solution keeps them, also among
threads.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from contactopt.linear.operators import form
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.certificate import amplification

# a remark is due if a small problem has so large a condition, and its forces so large an error
FEW, WEDGED, MUCH = 50, 1e4, 1e-3
LOOSE = 1e12  # condition above which rounding decides
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


def dubious(problem: InterfaceProblem, solution: Solution) -> bool:
    """Whether the certificate of few contacts leaves a doubt that is worth its cost."""
    loose = solution.solved and solution.residual > EXACT
    return loose and problem.contacts <= FEW and form(problem.Q) == "array"


def remark(problem: InterfaceProblem, solution: Solution) -> None:
    """Say where the forces of a small problem may be far off although they are certified."""
    if not dubious(problem, at := solution):
        return
    condition = amplification(problem, at.reactions, at.multipliers)
    if condition <= WEDGED or condition * at.residual <= MUCH:
        return
    why = (
        f"by {min(condition * at.residual, 1.0):.0%} of the typical force, because the solution is"
    )
    why += " nearly not unique"
    if not condition < LOOSE:
        if problem.shared_places:
            return
        why = "by any amount, because they are not unique, or nearly not"
    if problem.law.proportional and not problem.law.dilatant:
        why += ": see contactopt.diagnose"
    note(logging.getLogger(__name__), f"The forces are certified, but they may be off {why}.")
