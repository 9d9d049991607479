"""What a run needs to go on where it was stopped, and another one to start from its answer: the
contact forces and multipliers of every state, in one small file.

They are starts and nothing more: the certificate of every state is computed again, and where it is
above the tolerance the state is solved. Therefore a scene may be changed in between, as long as
some pair of surfaces has kept its name.
"""

import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.files.writing import replace_file
from contactopt.problem import InterfaceProblem, Solution, Status, natural_map_residual
from contactopt.problem.transfer import transfer

FILE = "restart.npz"
START = "start"  # the method of a solution that another run has found
PATIENCE = 5.0  # seconds between two writings of the file, at least
Point = tuple[np.ndarray, np.ndarray]  # reactions (k, dim) [force], multipliers (p,) [length]


@dataclass(frozen=True, eq=False)
class Known:
    """The states that another run has found.

    names, ends  of its pairs of surfaces, and the number of the first contact after each
    motions      what its multipliers are
    coordinates (dim, k), areas (k,), frames (k, dim, dim) of its contacts
    reactions    (n, k, dim) of n states;   multipliers  (n, p)
    zone         half-width of the contact zone that its mesh resolved; 0 without one
    complete     whether it was solved to the end
    """

    names: Sequence[str]
    ends: np.ndarray
    motions: Sequence[str]
    coordinates: np.ndarray
    areas: np.ndarray
    frames: np.ndarray
    reactions: np.ndarray
    multipliers: np.ndarray
    zone: float
    complete: bool

    def start(self, state: int, reduction: Reduction) -> Solution | None:
        """The forces of a state at the contacts of a reduction, interpolated in space, or None."""
        if state >= len(self.reactions):
            return None
        problem, r = reduction.problem, self.reactions[state]
        if len(self.coordinates) != len(problem.coordinates):
            raise InputError(
                f"a start in {len(self.coordinates)} dimensions does not fit a scene in"
                f" {len(problem.coordinates)}."
            )
        here = np.array_equal(self.coordinates, problem.coordinates)
        made, known = np.zeros(problem.q.shape), dict(zip(self.names, self._slices()))
        if not set(known) & {pair.name for pair in problem.pairs}:
            raise InputError(
                "the start has no pair of surfaces of this scene; its pairs are"
                f" {', '.join(known)}."
            )
        for pair in problem.pairs:
            if pair.name in known and here:
                made[pair.contacts] = r[known[pair.name]]
            elif pair.name in known:
                own = known[pair.name]
                source = _surface(self.coordinates[:, own], self.areas[own])
                target = _surface(
                    problem.coordinates[:, pair.contacts], problem.areas[pair.contacts]
                )
                space = np.einsum("kad,ka->kd", self.frames[own], r[own])
                moved = transfer(source, _solution(space, np.zeros(0)), target).reactions
                made[pair.contacts] = np.einsum(
                    "kad,kd->ka", reduction.frames[pair.contacts], moved
                )
        values = dict(zip(self.motions, self.multipliers[state]))
        return _solution(made, np.array([values.get(name, 0.0) for name in problem.motions]))

    def _slices(self) -> list[slice]:
        return [slice(a, b) for a, b in zip([0, *self.ends[:-1]], self.ends)]


def _surface(coordinates: np.ndarray, areas: np.ndarray) -> InterfaceProblem:
    """Contacts at places, of which nothing else is known."""
    k, dim = len(areas), len(coordinates)
    Q = sp.identity(k * dim, format="csr")
    return InterfaceProblem(Q, np.zeros((k, dim)), mu=0.0, areas=areas, coordinates=coordinates)


def _solution(reactions: np.ndarray, multipliers: np.ndarray) -> Solution:
    return Solution(reactions, multipliers, Status.SETTLED, np.inf, 0, START)


def certified(problem: InterfaceProblem, start: Solution | None, tol: float) -> Solution | None:
    """A start from another run that solves the problem as it is; None for all others."""
    if start is None or start.method != START:
        return None
    begin = time.perf_counter()
    residual = natural_map_residual(problem, start.reactions, start.multipliers)
    if residual > tol:
        return None
    status, seconds = Status.SOLVED, {"solve": 0.0, "certificate": time.perf_counter() - begin}
    message = f"{status.sentence}, by the forces of an earlier run"
    return replace(start, status=status, residual=residual, seconds=seconds, message=message)


def read_known(folder: str | Path) -> Known:
    """The states that a run has left in a folder. InputError if there are none."""
    file = Path(folder) / FILE
    try:
        with np.load(file, allow_pickle=False) as found:
            arrays = {name: found[name] for name in found}
        for name in ("names", "motions"):
            arrays[name] = arrays[name].tolist()
        return Known(**arrays | {name: arrays[name].item() for name in ("zone", "complete")})
    except FileNotFoundError as error:
        raise InputError(
            f"'{folder}' holds no {FILE}, which `contactopt run` writes: it is not the folder of a"
            " run, or the run was stopped before it had anything to keep."
        ) from error
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        why = getattr(error, "strerror", None)
        why = f"cannot be read ({why})" if why else "is damaged"
        raise InputError(f"'{file}' {why}; run the scene again, without it.") from error


@dataclass
class Restart:
    """Keeps what a run has found, and gives it what another one has found.

    file   where it is kept from time to time; None: nowhere
    known  states to start from
    path   whether the run has a load path
    done   the states that are solved on the present mesh;  now: the last iterate of the next one
    zone   half-width of the contact zone in this run; 0 without one
    """

    file: Path | None = None
    known: Known | None = None
    path: bool = False
    done: list[Point] = field(default_factory=list)
    now: Point | None = None
    zone: float = 0.0
    reduction: Reduction | None = None
    written: float = field(default_factory=time.perf_counter)
    pause: float = PATIENCE

    def begin(self, reduction: Reduction) -> None:
        """A state of this reduction will be solved, the first one on a new mesh."""
        if self.reduction is None or reduction.couplings is not self.reduction.couplings:
            self.done = []
        self.reduction, self.now = reduction, None

    def start(self, reduction: Reduction) -> Solution | None:
        """What is known of the next state."""
        state = len(self.done) if self.path else -1
        return None if self.known is None else self.known.start(state, reduction)

    def watching(self, progress: Callable[[int, float], None]) -> Callable[[int, float], None]:
        """The `progress` of contactopt.solve, which also keeps the iterates."""
        told: Any = lambda iteration, residual: progress(iteration, residual)  # noqa: E731
        told.watch = self.reached
        return told

    def reached(self, reactions: np.ndarray, multipliers: np.ndarray) -> None:
        """Keep an iterate of the present state."""
        self.now = reactions, multipliers
        begin = time.perf_counter()
        if self.file is not None and begin - self.written > self.pause:
            replace_file(self.file, self.save)
            self.written = time.perf_counter()
            self.pause = max(PATIENCE, 20.0 * (self.written - begin))  # a twentieth of the time

    def finished(self, solution: Solution) -> None:
        """The present state is solved."""
        self.done.append((solution.reactions, solution.multipliers))
        self.now = None

    def ended(self, reduction: Reduction, solutions: Sequence[Solution]) -> None:
        """The run has these answers, in the order of its states, whatever it solved after them."""
        self.reduction, self.now = reduction, None
        self.done = [(own.reactions, own.multipliers) for own in solutions]

    def stopped(self, note: Callable[[str], None]) -> None:
        """Write what a run has found before it was stopped."""
        if self.file is not None and (self.done or self.now):
            replace_file(self.file, self.save)
            note(f"{self.file} keeps what was found; go on with --resume")

    def save(self, file: Path, complete: bool = False) -> None:
        """Write what has been found so far, if there is anything."""
        if self.reduction is None or not (
            points := [*self.done, *([self.now] if self.now else [])]
        ):
            return
        problem = self.reduction.problem
        reactions, multipliers = zip(*points)
        np.savez(
            file,
            names=np.array([pair.name for pair in problem.pairs]),
            ends=np.cumsum([len(problem.areas[pair.contacts]) for pair in problem.pairs]),
            motions=np.array(problem.motions, dtype=str),
            coordinates=problem.coordinates,
            areas=problem.areas,
            frames=self.reduction.frames,
            reactions=np.array(reactions),
            multipliers=np.array(multipliers),
            zone=self.zone,
            complete=complete,
        )


def make_restart(
    out: str | Path | None,
    resume: bool,
    start: str | Path | None,
    path: bool,
    note: Callable[[str], None],
) -> Restart:
    """What keeps the states of a run in `out`, and resumes those there or of the run `start`."""
    file = None if out is None else Path(out) / FILE
    if not resume:
        return Restart(file, None if start is None else read_known(start), path)
    if file is None:
        raise InputError("to resume a run, give the folder that it was written into, out=...")
    if not file.exists():
        note(f"nothing was kept in '{out}' yet; the run starts again")
        return Restart(file, None, path)
    known = read_known(file.parent)
    if known.complete:
        raise InputError(
            f"the run in '{out}' is complete, with the scene and the numbers that it was given; for"
            f" other ones start another run from it: --start {out}, in Python start='{out}', with"
            " another folder to write into."
        )
    return Restart(file, known, path)
