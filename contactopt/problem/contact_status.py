"""Open, sticking and slipping contacts, as the law of the problem tells them apart."""

from dataclasses import dataclass

import numpy as np

from contactopt.problem import InterfaceProblem


@dataclass(frozen=True, eq=False)
class ContactStatus:
    """Three masks (k,), of which exactly one holds at every contact."""

    open: np.ndarray
    stick: np.ndarray
    slip: np.ndarray

    @property
    def touching(self) -> np.ndarray:
        """Mask (k,) of the contacts that stick or slip."""
        return ~self.open


def contact_status(problem: InterfaceProblem, reactions: np.ndarray) -> ContactStatus:
    """Which contacts are open, stick or slip: three masks (k,), of which one is True each."""
    touching, stick = problem.law.pressed(reactions), problem.law.sticking(reactions)
    return ContactStatus(~touching, stick, touching & ~stick)
