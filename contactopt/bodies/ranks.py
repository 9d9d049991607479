"""Processes that MPI started: rank 0 runs the program, the others keep objects for it and act on
them.

Rank 0 sends an order, a function with its arguments, and receives what it returned or raised; or
the result stays, and rank 0 holds a Kept for later orders, without a message back. Every rank
follows its orders one after the other; all messages are counted. Whoever waits sleeps between two
looks, so that ranks that share a core do not take it from each other.
"""

from __future__ import annotations

import os
import pickle
import threading
import time
import traceback
import weakref
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

from contactopt.errors import InputError
from contactopt.scenes.scene import Part, Scene

# tag of orders, and tags of replies: one per order, used again in turn
ORDERS, FIRST, TICKETS = 1, 2, 30000
PROTOCOL = pickle.HIGHEST_PROTOCOL
SHORTEST, LONGEST = 1e-5, 1e-3  # sleep between two looks for a message [s]
GROWTH = (
    1.15  # of that sleep from look to look: nobody waits longer by more than this share less one
)
# set by mpiexec of Open MPI, and of MPICH and its kin
STARTED = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")


@dataclass(eq=False)
class Kept:
    """An object that stays on its rank. It is freed there when nobody refers to this any more."""

    rank: int
    number: int

    def __reduce__(self) -> tuple[Any, ...]:
        return _Reference, (self.number,)


@dataclass(frozen=True)
class _Reference:
    """What a Kept is on its way to its rank."""

    number: int


@dataclass(frozen=True)
class Shipped:
    """Anything on its way to another rank, where it arrives as itself: functions without a name
    travel by their code.
    """

    item: Any

    def __reduce__(self) -> tuple[Any, ...]:
        import cloudpickle

        return pickle.loads, (cloudpickle.dumps(self.item),)


@dataclass(frozen=True)
class Raised:
    """An exception on its way to rank 0, with the place where it was raised."""

    error: BaseException
    place: str


@dataclass
class Traffic:
    """What was sent and received by rank 0: messages, and their length together in bytes."""

    messages: int = 0
    length: int = 0

    def add(self, message: bytes | bytearray) -> None:
        self.messages += 1
        self.length += len(message)


class Team:
    """All ranks, seen from rank 0. Orders may be given by several threads at the same time."""

    def __init__(self, comm: Any):
        self.comm = comm
        self.traffic = Traffic()
        self._lock = threading.Lock()  # MPI need not allow threads at the same time
        self._number = 0
        self._sent: list[tuple[Any, bytes]] = []
        self._freed: list[deque[int]] = [deque() for _ in range(comm.size)]
        self._dismissed = False

    def __reduce__(self) -> tuple[type[None], tuple[()]]:
        """Travel as None: functions that make meshes may hold parts of a team."""
        return type(None), ()

    @property
    def size(self) -> int:
        """Number of ranks."""
        return int(self.comm.size)

    def ask(self, rank: int, function: Callable[..., Any], *arguments: Any) -> Any:
        """Let a rank call a function, and wait for what it returns.

        Parameters
        ----------
        rank : The number of the rank.
        function, arguments : What it calls, and with which arguments. Both travel as bytes.

        Returns
        -------
        What the function returned. An exception that it raised is raised here.
        """
        return self.start(rank, function, *arguments)()

    def start(self, rank: int, function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
        """Let a rank begin to call a function, as for `ask`.

        Returns a function without arguments that waits for the end and returns what the function
        returned.
        """
        tag = FIRST + self._next_number() % TICKETS
        self._order(rank, (tag, function, arguments))

        def end() -> Any:
            reply = _receive(self.comm, self._lock, rank, tag)
            with self._lock:
                self.traffic.add(reply)
            answer = pickle.loads(reply)
            if isinstance(answer, Raised):
                answer.error.add_note(f"on rank {rank}:\n{answer.place}")
                raise answer.error
            return answer

        return end

    def keep(self, rank: int, function: Callable[..., Any], *arguments: Any) -> Kept:
        """What stands for a function's result, or its exception, on its rank."""
        kept = Kept(rank, self._next_number())
        self._order(rank, (None, function, arguments), kept.number)
        weakref.finalize(kept, self._freed[rank].append, kept.number).atexit = False
        return kept

    def dismiss(self) -> None:
        """End the loops of all other ranks."""
        for rank in range(1, self.size):
            self._order(rank, None)
        self._dismissed = True
        while self._sent:
            self._forget_what_arrived()
            time.sleep(SHORTEST)

    def _next_number(self) -> int:
        with self._lock:
            self._number += 1
            return self._number

    def _order(self, rank: int, order: Any, number: int | None = None) -> None:
        """Send without waiting, bytes kept until arrival; InputError after dismissal."""
        if self._dismissed:
            raise InputError(
                "the ranks that hold the bodies of this result were dismissed; ask before, or run"
                " it again."
            )
        freed, waiting = [], self._freed[rank]
        while waiting:
            freed.append(waiting.popleft())
        data = pickle.dumps((order, number, freed), PROTOCOL)
        with self._lock:
            self._sent.append((self.comm.Isend(data, rank, ORDERS), data))
            self.traffic.add(data)
        self._forget_what_arrived()

    def _forget_what_arrived(self) -> None:
        with self._lock:
            self._sent = [item for item in self._sent if not item[0].Test()]


@dataclass(frozen=True)
class RemotePart(Part):
    """An elastic body that lives on a rank of a team."""

    rank: int = 0
    team: Team | None = None


def spread(scene: Scene, team: Team) -> Scene:
    """Deal out the elastic bodies of a scene to the ranks in turn, from rank 0 on, as RemotePart.
    All other bodies stay on rank 0.
    """
    elastic = list(scene.meshed)

    def placed(part: Any) -> Any:
        rank = elastic.index(part.name) % team.size if part.name in elastic else 0
        return part if rank == 0 else RemotePart(**values_of(part), rank=rank, team=team)

    return scene.with_parts(placed)


def values_of(part: Part) -> dict[str, Any]:
    """The arguments that make a part: the values of its fields by their names."""
    return {item.name: getattr(part, item.name) for item in fields(Part)}


def serve(comm: Any) -> None:
    """Do what rank 0 orders until it dismisses this rank.

    Parameters
    ----------
    comm : The communicator of mpi4py.
    """
    kept: dict[int, Any] = {}
    lock = threading.Lock()
    while True:
        order, number, freed = pickle.loads(_receive(comm, lock, 0, ORDERS))
        if order is None:
            return
        for old in freed:
            del kept[old]
        result = _result(kept, *order[1:])
        if number is not None:
            kept[number] = result
        else:
            # the bytes live as long as the request
            request = comm.Isend(pickle.dumps(result, PROTOCOL), 0, order[0])
            _wait(lock, request.Test)
        del order, result


def _result(kept: dict[int, Any], function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """What the function makes of its arguments, or its exception or that of an argument."""
    found = [kept[item.number] if isinstance(item, _Reference) else item for item in arguments]
    for item in found:
        if isinstance(item, Raised):
            return item
    try:
        return function(*found)
    except Exception as error:
        return Raised(_portable(error), traceback.format_exc())


def _portable(error: Exception) -> Exception:
    """The exception itself, or where it cannot travel one that says the same."""
    try:
        same = type(pickle.loads(pickle.dumps(error))) is type(error)
        return error if same else RuntimeError(str(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")


def _receive(comm: Any, lock: threading.Lock, rank: int, tag: int) -> bytearray:
    from mpi4py import MPI

    status = MPI.Status()
    _wait(lock, lambda: comm.Iprobe(rank, tag, status))
    data = bytearray(status.Get_count(MPI.BYTE))
    with lock:
        comm.Recv(data, rank, tag)
    return data


def _wait(lock: threading.Lock, done: Callable[[], bool]) -> None:
    pause = SHORTEST
    while True:
        with lock:
            if done():
                return
        time.sleep(pause)
        pause = min(GROWTH * pause, LONGEST)


def world() -> Any:
    """Find the communicator of all processes that mpiexec started with this one.

    Returns
    -------
    The communicator of mpi4py; None if no others were started.

    Raises
    ------
    InputError : If the packages of the extra `mpi` are missing.
    """
    if not any(os.environ.get(name, "1") != "1" for name in STARTED):
        return None
    try:
        import cloudpickle  # noqa: F401
        from mpi4py import MPI
    except ImportError as error:
        raise InputError(
            "ranks need the packages mpi4py and cloudpickle: pip install 'contactopt[mpi]'."
        ) from error
    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None
