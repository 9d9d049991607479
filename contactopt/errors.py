"""The exceptions of contactopt, all with a message meant for the person at the keyboard."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from contactopt.solving.paths import PathResult


class InputError(ValueError):
    """An input cannot be used; the message says what is wrong, and what to do."""


class Unbalanced(InputError):
    """A load that no contact forces can balance.

    path  the states of the load path before it, a contactopt.solving.paths.PathResult, if any
    """

    path: PathResult | None = None


class Damaged(ValueError):
    """A file is not what its format says; the message says where."""


class BackendError(RuntimeError):
    """A QP or conic backend failed; the message names it."""
