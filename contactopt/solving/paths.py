"""Load paths: a sequence of load states, slip measured from the last converged state (the paper's
'quasistatic').

Coulomb's law in its rate form, friction against the slip velocity, is integrated by implicit Euler
steps: step n is the static problem of contactopt.problem with u_t replaced by the slip of the step,
u_t - u_t(n-1), that is with q_t shifted by -u_t(n-1). Normal displacements (gaps) and plate
displacements stay total; Q and V do not change.

Energy of a step, exact for the discrete bodies because they are linear. With F the nodal forces on
a body (of loads, supports and plates), r the contact forces, E the elastic energy and a bar for the
mean of the states n-1 and n,

    W = sum F-bar' dU  =  dE + D,   D = -r-bar' du
                       (midpoint work)

whatever law gave r. Of D, friction dissipates what Coulomb's law says, D_f = -r_t(n)' du_t = sum mu
r_n |du_t| >= 0; the rest, D - D_f = r_n(n)' u_n(n-1) + (r(n) - r(n-1))' du / 2, is the error of the
step in energy: second order in its size, zero where neither contact nor the direction and bound of
slip change.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Iterable, Sequence, Sized
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.cards import card, count, line
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.files.writing import whole_folder
from contactopt.methods.driver import TOL
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import contact_edge, stick_edge
from contactopt.scenes.scene import Scene
from contactopt.solving.solve_scene import Options, Solved, solve_loaded, solve_scene
from contactopt.solving.zone import solve_zone

KEPT = 500_000  # displacement unknowns of all bodies, up to which every state of a path keeps them


@dataclass(frozen=True, eq=False)
class State:
    """One converged state of a path.

    q, s           of the step's problem: q_t is measured from the state before [length], [force]
    displacements  u (k, dim), total: gap, tangential displacement [length];  slip (k, dim - 1) of
                   this step [length]
    apart          (dim,) relative displacement of the bodies, had they no contact: minus approach,
                   shift [length]
    elastic        elastic energy of both bodies; external: midpoint work of this step; contact: D
                   [force length]
    bodies         displacements (n,) of every body [length]; empty for bodies of more than KEPT
                   unknowns, and for those on other ranks
    """

    scene: Scene
    solution: Solution
    q: np.ndarray
    s: np.ndarray
    displacements: np.ndarray
    slip: np.ndarray
    apart: np.ndarray
    elastic: float
    external: float
    contact: float
    bodies: tuple[np.ndarray, ...] = ()

    @property
    def friction(self) -> float:
        """Friction work of this step, sum mu r_n |du_t| [force length]."""
        return -float(np.sum(self.solution.reactions[:, 1:] * self.slip))


@dataclass(frozen=True, eq=False)
class PathResult:
    """A solved path; `reduction` belongs to its last state, with the problem of the last step.

    If a step is not solved the path ends with it: what would follow has no state to start from.
    """

    states: tuple[State, ...]
    reduction: Reduction

    def __repr__(self) -> str:
        scene, solved = self.states[-1].scene, sum(state.solution.solved for state in self.states)
        return line("PathResult", scene.name, count(len(self.states), "state"), f"{solved} solved")

    def _repr_html_(self) -> str:
        rows = {
            "states": len(self.states),
            "solved": sum(state.solution.solved for state in self.states),
        }
        worst = max(float(state.solution.residual) for state in self.states)
        return card(
            f"Load path of {self.states[-1].scene.name}",
            rows | {"largest residual": f"{worst:.2e}"},
        )

    @property
    def solved(self) -> bool:
        return all(state.solution.solved for state in self.states)

    @property
    def solution(self) -> Solution:
        """The last state's, with the seconds of the whole path."""
        seconds: Counter[str] = Counter()
        for state in self.states:
            seconds.update(state.solution.seconds)
        return replace(self.states[-1].solution, seconds=dict(seconds))

    def problem(self, step: int) -> InterfaceProblem:
        """Make the static problem of one step, which its solution is certified against.

        Parameters
        ----------
        step : The number of the state, from 0 on.

        Returns
        -------
        The problem with the gaps and resultants of that state.
        """
        return replace(self.reduction.problem, q=self.states[step].q, s=self.states[step].s)

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """One value per state (n,), energies summed from the unloaded bodies on.

        normal_force, shear_force    that press and push the upper body on the lower, the latter
                                     along t1 [force]
        approach, shift              of the bodies, in the same directions [length]
        contact_half_width, stick_half_width [length];  contact_nodes, stick_nodes, slip_nodes
        elastic_energy, external_work, friction_work, step_work [force length]: external_work is the
        sum of the others
        energy_error                 of that sum in this step, relative to the largest work or
                                     energy so far
        residual, iterations, seconds   of the solve
        """
        rows = [_row(self.reduction.problem, state) for state in self.states]
        history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        elastic = history["elastic_energy"]
        error = np.abs(
            history["external_work"] - np.diff(elastic, prepend=0.0) - history["step_work"]
        )
        history["step_work"] = history["step_work"] - history["friction_work"]
        for name in ("external_work", "friction_work", "step_work"):
            history[name] = np.cumsum(history[name])
        largest = np.maximum.accumulate(np.maximum(np.abs(history["external_work"]), elastic))
        history["energy_error"] = np.divide(
            error, largest, out=np.zeros_like(error), where=largest > 0
        )
        return history

    def fields(self, step: int) -> tuple[Fields, ...]:
        """Displacement and stress of the elastic bodies at a state; empty where the state keeps no
        displacements.
        """
        pairs = zip(self.reduction.bodies, self.states[step].bodies)
        return tuple(found for body, U in pairs if (found := body.fields(U)) is not None)

    def write(self, out: str | Path) -> None:
        """Write history.csv, and path.npz with coordinates (d, k), areas (k,), reactions and
        displacements (n, k, dim).

        It also has the bounds of the friction forces (n, k), the status (n, k): 0 open, 1 stick, 2
        slip, and the contact frames (k, dim, dim), one direction per row, normal first.

        Parameters
        ----------
        out : The folder, which is made if it does not exist.

        Raises
        ------
        InputError : Where the files cannot be written.
        """
        problem = self.reduction.problem
        forces = [state.solution.reactions for state in self.states]
        masks = [contact_status(problem, r) for r in forces]
        with whole_folder(out) as staging:
            with open(staging / "history.csv", "w", newline="") as file:
                rows = csv.writer(file)
                rows.writerow(self.history)
                rows.writerows(zip(*self.history.values()))
            np.savez(
                staging / "path.npz",
                coordinates=problem.coordinates,
                areas=problem.areas,
                frames=self.reduction.frames,
                reactions=forces,
                bounds=[problem.law.bound_along(r) for r in forces],
                status=[mask.stick + 2 * mask.slip for mask in masks],
                displacements=[state.displacements for state in self.states],
            )


def follow(
    scenes: Iterable[Scene],
    elements: int | None = None,
    zone: float | None = None,
    note: Callable[[str], None] = lambda text: None,
    Q: str = "auto",
    solver: str = "auto",
    **settings: Any,
) -> PathResult:
    """Solve a load path: the states of one scene in their order, from the unloaded bodies on.

    Parameters
    ----------
    scenes : states that differ in their loads only: forces, tractions, prescribed displacements
    elements : across the contact half-width; the scene's own number by default. One mesh serves the
        whole path.
    zone : half-width that the mesh resolves [length]; by default the scene's
    note : receives one short sentence after every state, "state 17 of 41: ..." where the number of
        states is known
    Q, solver : form of Q and solver of the bodies, as for reduce()
    settings : arguments of solve(). Each step starts from the solution of the one before.

    Returns
    -------
    PathResult : the states with their solutions, in their order

    Raises
    ------
    InputError : for an empty path, or for states that are not those of one scene
    """
    if not isinstance(scenes, Iterable) or isinstance(scenes, np.ndarray) or sp.issparse(scenes):
        raise InputError(f"a path is a list of scenes; got {type(scenes).__name__}.")
    method, tol = settings.pop("method", None), settings.pop("tol", TOL)
    return _follow_states(scenes, elements, zone, Options(Q, solver, method, tol, settings, note))


def _follow_states(
    scenes: Iterable[Scene],
    elements: int | None = None,
    zone: float | None = None,
    options: Options | None = None,
) -> PathResult:
    """As follow(), with the options of contactopt.solving.solve_scene."""
    options = options or Options()
    total = f" of {len(scenes)}" if isinstance(scenes, Sized) else ""
    states: list[State] = []
    solved: Solved | None = None
    mechanics: _Mechanics | None = None
    for scene in scenes:
        if solved is None:
            solved = solve_scene(scene, elements, zone, options)
        else:
            solved = solve_loaded(scene, solved, states[-1].displacements[:, 1:], options)
        state, mechanics = _state(solved, states[-1] if states else None, mechanics)
        states.append(state)
        steps = count(state.solution.iterations, "iteration")
        options.note(f"state {len(states)}{total}: {state.solution.status}, {steps}")
        if not state.solution.solved:
            break
    if solved is None:
        raise InputError("the path has no states; give at least one scene.")
    return PathResult(tuple(states), solved.reduction)


def solve_states(
    states: Sequence[Scene],
    elements: int | None = None,
    options: Options | None = None,
    start: Solved | None = None,
) -> Solved:
    """Solve a scene on meshes fitted to its contact zone, or follow the load path of several states
    on one mesh.

    Parameters
    ----------
    states : the scene, or the states of its load path
    elements : across the contact half-width; the scene's own number by default
    options : how each state is solved
    start : the scene solved on another mesh, to start from; a path starts from the unloaded bodies

    Returns
    -------
    Solved : the scene, or the last state of the path with the whole path

    Raises
    ------
    InputError : as solve_zone() and follow()
    """
    if len(states) == 1:
        return solve_zone(states[0], elements, options, start)
    path = _follow_states(states, elements, None, options)
    return Solved(path.reduction, path.solution, path=path)


@dataclass(frozen=True, eq=False)
class _Mechanics:
    """What energies are made of: contact forces r and displacements u, both (k, dim), of each body
    the displacements U
    and the external forces F on them, and the elastic energy of all bodies.
    """

    r: np.ndarray
    u: np.ndarray
    U: list[np.ndarray]
    F: list[np.ndarray]
    elastic: float = 0.0


def _state(
    solved: Solved, before: State | None, last: _Mechanics | None
) -> tuple[State, _Mechanics]:
    """What is kept of a state, given the one before it, and the state of the bodies."""
    reduction, solution = solved.reduction, solved.solution
    problem, r = reduction.problem, solution.reactions
    gap, earlier = np.zeros(r.shape), np.zeros(r.shape)
    gap[:, 0] = reduction.gap
    if before is not None:
        earlier[:, 1:] = before.displacements[:, 1:]
    U = list(reduction.displaced(solution))
    F = [body.external_forces(own) for body, own in zip(reduction.bodies, U)]
    elastic = sum(body.energy(own) for body, own in zip(reduction.bodies, U))
    now = _Mechanics(r, problem.displacements(r, solution.multipliers) + earlier, U, F, elastic)
    if last is None:  # the unloaded bodies
        last = _Mechanics(0 * now.r, gap, [0 * U for U in now.U], [0 * F for F in now.F])
    moved = problem.displacements(0 * r, solution.multipliers) + earlier - gap
    state = State(
        reduction.scene,
        solution,
        problem.q,
        problem.s,
        now.u,
        (now.u - earlier)[:, 1:],
        np.average(moved, axis=0, weights=problem.areas),
        now.elastic,
        external=sum(
            float((F + F0) @ (U - U0)) for F, F0, U, U0 in zip(now.F, last.F, now.U, last.U)
        )
        / 2,
        contact=-float(np.sum((now.r + last.r) * (now.u - last.u))) / 2,
        bodies=_kept(U),
    )
    return state, now


def _kept(U: list[Any]) -> tuple[np.ndarray, ...]:
    here = all(isinstance(own, np.ndarray) for own in U)
    return tuple(U) if here and sum(own.size for own in U) <= KEPT else ()


def _row(problem: InterfaceProblem, state: State) -> dict[str, float]:
    r = state.solution.reactions
    status, single = contact_status(problem, r), len(problem.pairs) == 1
    return {
        "normal_force": float(r[:, 0].sum()),
        "shear_force": -float(r[:, 1].sum()),
        "approach": -float(state.apart[0]),
        "shift": float(state.apart[1]),
        "contact_half_width": contact_edge(state.scene, problem, r) if single else np.nan,
        "stick_half_width": stick_edge(state.scene, problem, r, state.slip)[0]
        if single
        else np.nan,
        "contact_nodes": int(status.touching.sum()),
        "stick_nodes": int(status.stick.sum()),
        "slip_nodes": int(status.slip.sum()),
        "elastic_energy": state.elastic,
        "external_work": state.external,
        "friction_work": state.friction,
        "step_work": state.contact,
        "residual": float(state.solution.residual),
        "iterations": state.solution.iterations,
        "seconds": float(sum(state.solution.seconds[phase] for phase in ("solve", "certificate"))),
    }
