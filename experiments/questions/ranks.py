"""How evenly do ranks of MPI work on bodies of their own, and what travels between them?"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from contactopt import Scene, reduce, reduce_bodies, scenes, solve
from contactopt.bodies.launch import mpiexec
from contactopt.bodies.ranks import Kept, Team, serve, spread, world
from contactopt.scenes.slices import sliced
from contactopt.solving.solve_scene import Options, Solved, solve_scene
from experiments.report import template, write

TOL = 1e-8
# case -> dimension, elements across the contact half-width, options
EQUAL = {
    "plane, factors": (2, 2048, {"Q": "implicit", "solver": "superlu"}),
    "solid, factors": (3, 24, {"Q": "explicit", "solver": "superlu"}),
    "solid, multigrid": (3, 56, {"solver": "multigrid"}),
}
RANKS = (4, 8, 16)
HEIGHTS = (80.0, 640.0)  # of the foundation that is cut into slices [mm]
# elements across the contact half-width there, by the number of ranks
SLICED = {4: 12, 8: 12, 16: 32}


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


def traffic(team: Team, height: float) -> dict[str, Any]:
    """One body on each rank: what a product with Q sends, and the answer."""
    scene = sliced(
        scenes.flat_punch(2, elements=SLICED[team.size], foundation_height=height),
        "foundation",
        team.size - 1,
    )
    one, many = (
        reduce_bodies(given, Q="implicit", solver="superlu")
        for given in (scene, spread(scene, team))
    )
    r = np.random.default_rng(0).normal(size=many.problem.q.size)
    expected = one.problem.Q @ r
    before = (team.traffic.messages, team.traffic.length)
    product = many.problem.Q @ r
    sent = (team.traffic.messages - before[0], team.traffic.length - before[1])
    answers = [
        solve(reduce(given, Q="explicit"), tol=TOL) for given in (scene, spread(scene, team))
    ]
    size = np.abs(answers[0].reactions).max()
    return {
        "ranks": team.size,
        "unknowns of the bodies": many.dofs,
        "interface unknowns": many.problem.q.size,
        "messages per product": sent[0],
        "bytes per product": sent[1],
        "products differ by": float(np.abs(product - expected).max() / np.abs(expected).max()),
        "steps": f"{answers[0].iterations}, {answers[1].iterations}",
        "residuals": f"{answers[0].residual:.1e}, {answers[1].residual:.1e}",
        "answers differ by": float(
            np.abs(answers[0].reactions - answers[1].reactions).max() / size
        ),
    }


def coupled_traffic(team: Team, height: float) -> dict[str, Any]:
    """The same bodies solved by multigrid: what the whole solution sends."""
    scene = sliced(
        scenes.flat_punch(2, elements=SLICED[team.size], foundation_height=height),
        "foundation",
        team.size - 1,
    )
    problem = reduce(spread(scene, team), solver="multigrid")
    before = (team.traffic.messages, team.traffic.length)
    solution = solve(problem, "newton", tol=TOL)
    sent = (team.traffic.messages - before[0], team.traffic.length - before[1])
    bodies, cycles = team.size - 1, problem.Q.coupled.cycles
    return {
        "ranks": team.size,
        "unknowns of the bodies": sum(term.size for term in problem.Q.coupled.terms),
        "interface unknowns": problem.q.size,
        "steps": solution.iterations,
        "residual": float(solution.residual),
        "V-cycles": cycles,
        "messages per step": sent[0] / solution.iterations,
        "bytes per step": sent[1] / solution.iterations,
        "messages per V-cycle and rank": sent[0] / cycles / bodies,
        "bytes per message": sent[1] / sent[0],
    }


TEXT = template(__file__)


def work(out: str) -> None:
    """On the ranks: the tables of as many ranks as there are."""
    comm = world()
    if comm.rank:
        serve(comm)
        return
    # orders name its functions by this name, not by __main__
    from experiments.questions import ranks

    team = ranks.TimedTeam(comm)
    try:
        tables: dict[str, list[dict[str, Any]]] = {"efficiency": [], "traffic": [], "coupled": []}
        if comm.size == 2:
            tables["efficiency"] = [ranks.efficiency(team, case) for case in EQUAL]
        else:
            tables["traffic"] = [ranks.traffic(team, height) for height in HEIGHTS]
        if comm.size == RANKS[0]:
            tables["coupled"] = [ranks.coupled_traffic(team, height) for height in HEIGHTS]
        Path(out).write_text(json.dumps(tables))
    finally:
        team.dismiss()


def measured(ranks: int) -> dict[str, list[dict[str, Any]]]:
    """The tables of one launch, kept in out/ranks/ until all are there."""
    out = Path("out", "ranks", f"{ranks}.json")
    if not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        command = [*mpiexec(ranks), sys.executable, "-m", "experiments.questions.ranks", str(out)]
        subprocess.run(command, check=True)
    tables: dict[str, list[dict[str, Any]]] = json.loads(out.read_text())
    return tables


if __name__ == "__main__":
    if len(sys.argv) > 1:
        work(sys.argv[1])
    else:
        launches = [measured(ranks) for ranks in (2, *RANKS)]
        names = ("efficiency", "traffic", "coupled")
        write(
            "ranks",
            "Bodies on ranks of their own",
            TEXT,
            {n: [row for made in launches for row in made[n]] for n in names},
            {},
        )
