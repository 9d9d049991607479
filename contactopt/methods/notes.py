"""What a solve did otherwise than asked or expected: a method calls `note`, which logs the
sentence. The driver opens `collected` around each solve, whose Solution keeps them, also among
threads.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

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
