"""The exceptions of contactopt, all with a message meant for the person at the keyboard."""

from typing import Any


class InputError(ValueError):
    """Something the user gave cannot be used; the message says what and what to do."""


class Unbalanced(InputError):
    """A load that no contact forces can balance.

    path  the states of the load path before it, a contactopt.solving.paths.PathResult, if any
    """

    path: Any = None


class BackendError(RuntimeError):
    """A QP or conic backend failed; the message names it."""
