"""Messages between a campaign and its processes, over a socket. Code of the user runs at one end only.

Towards the processes, messages are ordinary pickles. From them come bytes that a plug-in may have written: they are
read by an unpickler that makes plain data, NumPy arrays, SciPy's sparse matrices and the data classes of
contactopt.problem, and nothing else, so that no message can run code in the campaign's process.
"""

from __future__ import annotations

import importlib
import io
import pickle
import socket
import time
from collections.abc import Callable
from typing import Any

from contactopt.files import broken_pipe_is_an_error

HEAD = 8  # bytes, in which each message tells its length
BLOCK = 1 << 20  # bytes read at a time
BEAT = 0.5  # s between two looks whether the process at the other end still lives


class ForeignMessage(Exception):
    """What arrived is no message of the protocol, or belongs to another request."""


class Channel:
    """One end of a socket pair, with whole messages."""

    def __init__(self, end: socket.socket):
        self.end = end
        self.buffer = bytearray()

    def send(self, message: object, seconds: float | None = None) -> None:
        """Raises OSError (TimeoutError) if the other end does not take it."""
        data = pickle.dumps(message, protocol=5)
        self.end.settimeout(seconds)
        head = len(data).to_bytes(HEAD, "big")
        with broken_pipe_is_an_error():
            if len(data) > BLOCK:
                self.end.sendall(head)
                self.end.sendall(data)
            else:
                self.end.sendall(head + data)

    def receive(self, deadline: float, most: float, alive: Callable[[], bool]) -> bytes:
        """The next message, not longer than `most` bytes, until `deadline` on the monotonic clock.

        Raises TimeoutError at the deadline, EOFError when the other end is closed or not `alive`, and ForeignMessage
        if the message announces more than `most` bytes.
        """
        while True:
            if len(self.buffer) >= HEAD:
                size = int.from_bytes(self.buffer[:HEAD], "big")
                if size > most:
                    raise ForeignMessage(f"a message of {size} bytes")
                if len(self.buffer) >= HEAD + size:
                    message = bytes(self.buffer[HEAD : HEAD + size])
                    del self.buffer[: HEAD + size]
                    return message
            left = deadline - time.monotonic()
            if left <= 0:
                raise TimeoutError
            lives = alive()  # before reading: what a process sent before it died is still read
            self.end.settimeout(min(left, BEAT) if lives else 1e-3)
            try:
                block = self.end.recv(BLOCK)
            except TimeoutError:
                if not lives:
                    raise EOFError from None
                continue
            if not block:
                raise EOFError
            self.buffer += block

    def wait(self) -> Any:
        """The next message of the campaign, which is trusted; EOFError when it is gone."""
        self.end.settimeout(None)
        return pickle.loads(self.receive(float("inf"), float("inf"), lambda: True))

    def close(self) -> None:
        self.end.close()


ARRAYS = {
    ("_reconstruct", "multiarray"),
    ("scalar", "multiarray"),
    ("_frombuffer", "numeric"),
}  # how arrays are pickled


class _DataOnly(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        package, _, rest = module.partition(".")
        if package == "numpy":
            parts = rest.split(".")
            known = (module == "numpy" and name in ("ndarray", "dtype")) or (
                parts[0] in ("_core", "core") and (name, parts[-1]) in ARRAYS
            )
            if known:
                return getattr(importlib.import_module(module), name)
        elif module.startswith(("contactopt.problem.", "scipy.sparse._")) and "." not in name:
            found = getattr(importlib.import_module(module), name)
            if isinstance(found, type) and found.__module__ == module and _is_data(found):
                return found
        raise ForeignMessage(f"a message that holds {module}.{name}")


def _is_data(kind: type) -> bool:
    from scipy.sparse import sparray, spmatrix

    return hasattr(kind, "__dataclass_fields__") or issubclass(kind, sparray | spmatrix)


def read(data: bytes) -> Any:
    """Read the data in a message from a process in which code of the user may run.

    Parameters
    ----------
    data
        The bytes of the message.

    Returns
    -------
    object
        Plain data, arrays, and data classes of contactopt.problem.

    Raises
    ------
    ForeignMessage
        On anything else.
    """
    try:
        return _DataOnly(io.BytesIO(data)).load()
    except ForeignMessage:
        raise
    except Exception as error:  # whatever broken bytes lead to
        raise ForeignMessage(f"a message that cannot be read ({type(error).__name__})") from error
