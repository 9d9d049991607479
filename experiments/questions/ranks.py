"""Do bodies on ranks of their own give the same answers, how evenly do the ranks work, and what travels between them?"""

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
from contactopt.analysis.solve_scene import Options, Solved, solve_scene
from contactopt.bodies.ranks import Kept, Team, mpiexec, serve, spread, world
from contactopt.scenes.slices import sliced
from experiments.report import write

TOL = 1e-8
# case -> dimension, elements across the contact half-width, options
EQUAL = {
    "plane, factors": (2, 2048, {"Q": "implicit", "solver": "superlu"}),
    "solid, factors": (3, 24, {"Q": "explicit", "solver": "superlu"}),
    "solid, multigrid": (3, 56, {"solver": "multigrid"}),
}
RANKS = (4, 8, 16)
HEIGHTS = (80.0, 1280.0)  # of the foundation that is cut into slices [mm]


def equal_bodies(dim: int, elements: int) -> Scene:
    """A punch on a foundation of the same size and mesh."""
    return scenes.flat_punch(dim, foundation_width=40.0, foundation_height=40.0, elements=elements)


class Clocks:
    """The length of the critical path in CPU seconds, as the messages show it, whatever else the machine is doing.

    A clock runs with the CPU time of its process. An order carries the clock of rank 0, and its rank sets its own forward
    to it before the work; so does rank 0 with the clock that a reply carries.
    """

    def __init__(self) -> None:
        self.now, self._last = 0.0, time.process_time()
        self._lock = threading.Lock()

    def read(self, other: float = 0.0, waited: float = 0.0) -> float:
        """The clock without the CPU time that looking for messages took, set forward to another one."""
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

    def keep(self, rank: int, function: Callable[..., Any], *arguments: Any) -> Kept:
        return super().keep(rank, clocked, function, CLOCK.read(), *arguments)


def solved(scene: Scene, options: dict[str, Any]) -> Solved:
    return solve_scene(scene, options=Options(tol=TOL, **options))


def efficiency(team: Team, case: str) -> dict[str, Any]:
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


def traffic(team: Team, height: float, solver: str) -> dict[str, Any]:
    """One slice of the foundation, or the punch, on each rank: what a solve sends, after the set-up."""
    from contactopt import reduce_bodies, solve

    scene = sliced(scenes.flat_punch(2, elements=24, foundation_height=height), "foundation", team.size - 1)
    one = reduce_bodies(scene, Q="implicit", solver=solver)
    many = reduce_bodies(spread(scene, team), Q="implicit", solver=solver)
    expected = solve(one.problem, tol=TOL)
    before = (team.traffic.messages, team.traffic.length)
    found = solve(many.problem, tol=TOL)
    sent = (team.traffic.messages - before[0], team.traffic.length - before[1])
    form = many.problem.Q.coupled
    work = many.problem.Q.products + (0 if form is None else form.cycles)
    size = np.abs(expected.reactions).max()
    return {
        "ranks": team.size,
        "solver": solver,
        "unknowns of the bodies": many.dofs,
        "interface unknowns": many.problem.q.size,
        "difference": float(np.abs(found.reactions - expected.reactions).max() / size),
        "steps": found.iterations,
        "products and V-cycles": work,
        "messages": sent[0],
        "messages per step": sent[0] / max(found.iterations, 1),
        "bytes per step": sent[1] / max(found.iterations, 1),
        "messages per product and rank": sent[0] / max(work, 1) / (team.size - 1),
        "bytes per message": sent[1] / max(sent[0], 1),
    }


TEXT = """`contactopt run SCENE --ranks N` deals the bodies of a scene out to N processes. Each process assembles its bodies and
solves their linear systems. Rank 0 iterates on the contact forces, and only vectors on the interfaces travel.

## Two bodies of equal size on two ranks

Reduction and solution to a residual of 1e-8, set-up included, one BLAS thread. The critical path is the longest chain of work
that waits for other work, in CPU seconds, from clocks that the messages carry; it does not depend on what else the machine
was doing. Efficiency is the time of one process over twice that of two ranks. The wall times are those of a machine whose two cores
other programs used at the same time.

{efficiency}

## What travels

A punch on a foundation that is cut into slices tied to each other, one body on each rank; more ranks than cores. The
higher foundation has more unknowns within its slices and the same interfaces. Counted is the solution after the set-up.
With factors, a product with Q is one order to each rank and its reply. With multigrid the displacements stay on their ranks: the steps
of the Krylov method send an order for each operation on them, and receive scalar products and traces on the interface.

{traffic}
"""


def work(out: str) -> None:
    """On the ranks: the tables of as many ranks as there are."""
    comm = world()
    if comm.rank:
        from experiments.questions import ranks as module  # orders name its functions by this name, not by __main__

        serve(comm)
        del module
        return
    from experiments.questions.ranks import TimedTeam, efficiency, traffic

    team = TimedTeam(comm)
    try:
        if comm.size == 2:
            rows = [efficiency(team, case) for case in EQUAL]
        else:
            rows = [traffic(team, height, solver) for solver in ("superlu", "multigrid") for height in HEIGHTS]
        Path(out).write_text(json.dumps(rows))
    finally:
        team.dismiss()


def measured(ranks: int) -> list[dict[str, Any]]:
    with TemporaryDirectory() as folder:
        out = Path(folder) / "rows.json"
        command = [*mpiexec(ranks), sys.executable, "-m", "experiments.questions.ranks", str(out)]
        subprocess.run(command, check=True)
        rows: list[dict[str, Any]] = json.loads(out.read_text())
        return rows


if __name__ == "__main__":
    if len(sys.argv) > 1:
        work(sys.argv[1])
    else:
        tables = {"efficiency": measured(2), "traffic": [row for ranks in RANKS for row in measured(ranks)]}
        write("ranks", "Bodies on ranks of their own", TEXT, tables, {})
