"""The two exceptions of contactopt, both with a message meant for the person at the keyboard."""


class InputError(ValueError):
    """Something the user gave cannot be used; the message says what and what to do."""


class BackendError(RuntimeError):
    """A QP or conic backend failed; the message names it."""
