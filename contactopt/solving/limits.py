"""Bounds on a search for an accuracy, and the sentences that say which of them ended it."""

from dataclasses import dataclass

import numpy as np

from contactopt.cards import count
from contactopt.checks import check_number
from contactopt.readings.constants import MOST_MEMORY
from contactopt.scenes.scene import Scene
from contactopt.solving.progress import resident_memory

GIGABYTE = 1e9


@dataclass(frozen=True)
class Limits:
    """Bounds on the meshes of a search; the first mesh is always solved.

    unknowns  of the displacement on one mesh; None: those of the search
    seconds   wall time of the whole search [s]
    memory    that the meshes take [GB]
    """

    unknowns: int | None = None
    seconds: float = np.inf
    memory: float = MOST_MEMORY / GIGABYTE

    def __post_init__(self) -> None:
        if self.unknowns is not None:
            check_number("max_unknowns", self.unknowns, low=1.0)
        if self.seconds != np.inf:
            check_number("time_limit", self.seconds, low=0.0, closed=True)
        check_number("max_memory", self.memory, low=0.0)

    def refusal(self, unknowns: float, usual: int, seconds: float, memory: float) -> str:
        """Which bound the next mesh would pass, in a sentence, at a time [s] and memory [bytes] of
        the whole search; nothing if none. `usual` bounds the unknowns where nothing else does.
        """
        most = usual if self.unknowns is None else self.unknowns
        takes = ""
        if unknowns > most:
            takes = f"up to {unknowns:,.0f} unknowns, more than {most:,}"
        elif seconds > self.seconds:
            takes = f"about {seconds:.2g} s in all, more than the time limit of {self.seconds:g} s"
        elif memory > self.memory * GIGABYTE:
            takes = f"about {memory / GIGABYTE:.2g} GB of memory, more than {self.memory:g} GB"
        return takes and f"to go on would take {takes}"


def too_large(scene: Scene, why: str) -> str:
    """The sentence for a run that took all the memory there was."""
    bodies = count(len(scene.parts), "body", "bodies")
    held = f"{resident_memory() / 1e9:.2g} GB were taken when more was asked for"
    return (
        f"scene '{scene.name}' of {bodies} with elements = {scene.elements} needs more memory than"
        f" there is: {held}{f' ({why})' if why else ''}; take fewer elements."
    )
