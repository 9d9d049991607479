"""The one place where open, sticking and slipping contacts are told apart, with the one pair of tolerances for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.problem import InterfaceProblem

PRESSED = 1e-8  # normal reactions below this fraction of the largest one are rounding: the contact is open
SLACK = 1e-6  # friction within this fraction of its bound has reached it: the contact slips


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
    """Which contacts are open, which stick and which slip under given reactions (k, dim) [force].

    A contact touches if its normal reaction is beyond rounding, in bilateral contact always. It sticks if its friction is
    below the bound of the law, and slips otherwise; a contact without friction slips.
    """
    normal, friction = np.abs(reactions[:, 0]), np.linalg.norm(reactions[:, 1:], axis=1)
    touching = normal > PRESSED * normal.max(initial=0.0)
    if problem.bilateral:
        touching = np.ones_like(touching)
    stick = touching & (friction < (1 - SLACK) * problem.mu * normal)
    return ContactStatus(~touching, stick, touching & ~stick)
