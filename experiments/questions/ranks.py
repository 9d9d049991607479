"""How evenly do ranks of MPI work on bodies of their own?"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contactopt import Scene, scenes
from contactopt.bodies.launch import mpiexec
from contactopt.bodies.ranks import Kept, Team, serve, spread, world
from contactopt.solving.solve_scene import Options, Solved, solve_scene
from experiments.report import template, write

TOL = 1e-8
# case -> dimension, elements across the contact half-width, options
EQUAL = {
    "plane, factors": (2, 2048, {"Q": "implicit", "solver": "superlu"}),
    "solid, factors": (3, 24, {"Q": "explicit", "solver": "superlu"}),
    "solid, multigrid": (3, 56, {"solver": "multigrid"}),
}


def equal_bodies(dim: int, elements: int) -> Scene:
    """A punch on a foundation of the same size and mesh."""
    return scenes.flat_punch(dim, foundation_width=40.0, foundation_height=40.0, elements=elements)


class Clocks:
    """The length of the critical path in CPU seconds, as the messages show it, whatever else the
    machine is doing.

    A clock runs with the CPU time of its process. An order carries the clock of rank 0, and its
    rank sets its own forward to it before the work; so does rank 0 with the clock that a reply
    carries.
    """

    def __init__(self) -> None:
        self.now, self._last = 0.0, time.process_time()
        self._lock = threading.Lock()

    def read(self, other: float = 0.0, waited: float = 0.0) -> float:
        """The clock without the CPU time of looking for messages, set forward to another one."""
        with self._lock:
            cpu = time.process_time()
            self.now, self._last = max(self.now + cpu - self._last - waited, other), cpu
            return self.now

    def skip(self) -> None:
        """Forget the CPU time since the last reading, which waiting took."""
        with self._lock:
            self._last = time.process_time()


CLOCK = Clocks()  # of this process


def clocked(function: Callable[..., Any], stamp: float, *arguments: Any) -> Any:
    CLOCK.skip()
    CLOCK.read(stamp)
    result = function(*arguments)
    CLOCK.read()
    return result


def stamped(function: Callable[..., Any], stamp: float, *arguments: Any) -> tuple[Any, float]:
    return clocked(function, stamp, *arguments), CLOCK.read()


class TimedTeam(Team):
    """A team whose orders carry clocks."""

    def start(self, rank: int, function: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
        ended = super().start(rank, stamped, function, CLOCK.read(), *arguments)

        def end() -> Any:
            begin = time.thread_time()
            answer, stamp = ended()
            CLOCK.read(stamp, time.thread_time() - begin)
            return answer

        return end

    def cpu(self) -> list[float]:
        """CPU time of every rank so far [s]."""
        others = (self.ask(rank, time.process_time) for rank in range(1, self.size))
        return [time.process_time(), *others]

    def keep(self, rank: int, function: Callable[..., Any], *arguments: Any) -> Kept:
        return super().keep(rank, clocked, function, CLOCK.read(), *arguments)


def solved(scene: Scene, options: dict[str, Any]) -> Solved:
    return solve_scene(scene, options=Options(tol=TOL, **options))


def efficiency(team: TimedTeam, case: str) -> dict[str, Any]:
    """Two equal bodies in one process, and on two ranks."""
    dim, elements, options = EQUAL[case]
    scene = equal_bodies(dim, elements)
    solved(equal_bodies(dim, 4), options)  # everything is imported
    solved(spread(equal_bodies(dim, 4), team), options)
    wall, cpu = time.perf_counter(), time.process_time()
    one = solved(scene, options)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    before, begin = team.cpu(), CLOCK.read()
    sent, wall_of_two = (team.traffic.messages, team.traffic.length), time.perf_counter()
    two = solved(spread(scene, team), options)
    wall_of_two, path = time.perf_counter() - wall_of_two, CLOCK.read() - begin
    each = [after - old for after, old in zip(team.cpu(), before)]
    a, b = one.solution, two.solution
    return {
        "case": case,
        "unknowns": one.reduction.dofs,
        "contacts": one.reduction.problem.contacts,
        "difference": float(np.abs(a.reactions - b.reactions).max() / np.abs(a.reactions).max()),
        "steps": f"{a.iterations}, {b.iterations}",
        "residuals": f"{a.residual:.2e}, {b.residual:.2e}",
        "CPU, one process [s]": cpu,
        "CPU of each rank [s]": ", ".join(f"{seconds:.2f}" for seconds in each),
        "critical path [s CPU]": path,
        "efficiency by CPU": cpu / (2 * path),
        "wall, one [s]": wall,
        "wall, two [s]": wall_of_two,
        "efficiency by wall": wall / (2 * wall_of_two),
        "messages": team.traffic.messages - sent[0],
        "bytes": team.traffic.length - sent[1],
    }


def work(out: str) -> None:
    """On the ranks: the table."""
    comm = world()
    if comm.rank:
        serve(comm)
        return
    # orders name its functions by this name, not by __main__
    from experiments.questions import ranks

    team = ranks.TimedTeam(comm)
    try:
        Path(out).write_text(json.dumps([ranks.efficiency(team, case) for case in EQUAL]))
    finally:
        team.dismiss()


def measured() -> list[dict[str, Any]]:
    """The table of two ranks, which write it to a file."""
    with TemporaryDirectory() as folder:
        out = Path(folder, "rows.json")
        command = [*mpiexec(2), sys.executable, "-m", "experiments.questions.ranks", str(out)]
        subprocess.run(command, check=True)
        rows: list[dict[str, Any]] = json.loads(out.read_text())
    return rows


if __name__ == "__main__":
    if len(sys.argv) > 1:
        work(sys.argv[1])
    else:
        title = "Bodies on ranks of their own"
        write("ranks", title, template(__file__), {"efficiency": measured()}, {})
