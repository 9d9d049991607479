"""What a solve did otherwise than asked or expected: a method calls `note`, which logs the
sentence. The driver opens `collected` around each solve, whose Solution keeps them, also among
threads. Whether the forces of few contacts are nearly not unique costs more than to find them, and
is asked when somebody reads the notes.
"""

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import cached_property

import numpy as np

from contactopt.checks import place_words
from contactopt.linear.operators import form
from contactopt.problem import InterfaceProblem, Solution, Status
from contactopt.problem.certificate import amplification
from contactopt.problem.chart import UNNAMED
from contactopt.problem.scaling import along_rest

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


class Notes(Sequence[str]):
    """The notes of a solved problem as a tuple whose last entry, the remark on the forces of few
    contacts, is looked for at the first reading.
    """

    def __init__(
        self,
        notes: Sequence[str],
        problem: InterfaceProblem,
        reactions: np.ndarray,
        multipliers: np.ndarray,
        residual: float,
    ):
        self._made, self._of = tuple(notes), (problem, reactions, multipliers, residual)

    @cached_property
    def _read(self) -> tuple[str, ...]:
        said = remark(*self._of)
        if said and said not in self._made:
            logging.getLogger(__name__).info(said)
            return *self._made, said
        return self._made

    def __getitem__(self, index):  # type: ignore[no-untyped-def]  # as that of a tuple
        return self._read[index]

    def __len__(self) -> int:
        return len(self._read)

    def __eq__(self, other: object) -> bool:
        return self._read == (other._read if isinstance(other, Notes) else other)

    def __hash__(self) -> int:
        return hash(self._read)

    def __repr__(self) -> str:
        return repr(self._read)

    def __reduce__(self) -> tuple[type, tuple[tuple[str, ...]]]:
        return tuple, (self._read,)


def with_notes(problem: InterfaceProblem, solution: Solution, notes: Sequence[str]) -> Solution:
    """The solution with its notes."""
    if solution.solved and problem.contacts <= FEW and form(problem.Q) == "array":
        certified = solution.reactions, solution.multipliers, solution.residual
        return replace(solution, notes=Notes(notes, problem, *certified))
    return replace(solution, notes=tuple(notes)) if notes else solution


def remark(
    problem: InterfaceProblem, reactions: np.ndarray, multipliers: np.ndarray, residual: float
) -> str:
    """Where certified forces may be far off; "" if they are not."""
    problem, reactions = along_rest(problem, reactions)
    # where contacts share a place, forces that are hardly felt have been exchanged
    if residual <= EXACT and (problem.shared_places or not problem.nearly_singular):
        return ""
    from contactopt.methods.exchanged import loosest  # it makes notes

    condition = amplification(problem, reactions, multipliers)
    error = condition * max(residual, np.finfo(float).eps)
    small, loose = condition <= WEDGED or error <= MUCH, None
    if small or not condition < LOOSE:
        if problem.shared_places:
            return ""
        if problem.nearly_singular:  # contacts between two states may exchange forces in one
            found = Solution(reactions, multipliers, Status.SOLVED, residual, 0, "")
            loose = loosest(problem, found)
        if small and loose is None:
            return ""
        why = "by any amount, because they are not unique, or nearly not"
        if loose is not None and problem.pairs[0].name != UNNAMED:
            why += f", most of all near ({place_words(problem.coordinates[:, loose])})"
    else:
        why = f"by {100 * min(error, 1.0):.3g} % of the typical force, because the solution is"
        why += " nearly not unique"
    if problem.law.proportional and not problem.law.dilatant:
        why += ": see contactopt.diagnose"
    return f"The forces are certified, but they may be off {why}."
