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

import csv
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.bodies.views import fields
from contactopt.cards import card, count, line
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.files.writing import whole_folder
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import contact_status
from contactopt.readings.edges import contact_edge, stick_edge
from contactopt.readings.state import total
from contactopt.scenes.scene import Scene


@dataclass(frozen=True, eq=False)
class State:
    """One converged state of a path.

    q, s           of the step's problem: q_t is measured from the state before [length], [force]
    displacements  u (k, dim), total: gap, tangential displacement [length];  slip (k, dim - 1) of
                   this step [length]
    risen, shifted   motions of the upper bodies along the mean normal and t1
                   (contactopt.readings.plate_motions) [length]; not a number where there is none
    elastic        elastic energy of both bodies; external: midpoint work of this step; contact: D
                   [force length]
    bodies         displacements (n,) of every body [length]; empty for large bodies
    columns        name -> number: loads, motions, resultants
                   (contactopt.readings.resultants.columns)
    """

    scene: Scene
    solution: Solution
    q: np.ndarray
    s: np.ndarray
    displacements: np.ndarray
    slip: np.ndarray
    risen: float
    shifted: float
    elastic: float
    external: float
    contact: float
    bodies: tuple[np.ndarray, ...] = ()
    columns: Mapping[str, float] = field(default_factory=dict)

    @property
    def friction(self) -> float:
        """The work of friction in this step, sum mu r_n |du_t| [force length]."""
        return -float(np.sum(self.solution.reactions[:, 1:] * self.slip))


@dataclass(frozen=True, eq=False)
class PathResult:
    """A solved path; `reduction` belongs to its last state, with the problem of the last step.

    If a step is not solved the path ends before it: what would follow has no state to start from.
    `failed` is then how that step ended, with its last iterate. A path whose first step is not
    solved has that one alone.
    """

    states: tuple[State, ...]
    reduction: Reduction
    failed: Solution | None = None

    def __repr__(self) -> str:
        scene, solved = self.states[-1].scene, sum(state.solution.solved for state in self.states)
        return line("PathResult", scene.name, count(len(self.states), "state"), f"{solved} solved")

    def _repr_html_(self) -> str:
        worst = max(float(state.solution.residual) for state in self.states)
        rows = {
            "states": len(self.states),
            "solved": sum(state.solution.solved for state in self.states),
            "largest residual": f"{worst:.2e}",
        }
        return card(f"Load path of {self.states[-1].scene.name}", rows)

    @property
    def solved(self) -> bool:
        return self.failed is None and all(state.solution.solved for state in self.states)

    @property
    def solution(self) -> Solution:
        """The last state's solution with the seconds of the path, or how its last step failed."""
        seconds: Counter[str] = Counter()
        for own in self.solutions:
            seconds.update(own.seconds)
        found = replace(self.states[-1].solution, seconds=dict(seconds))
        if self.failed is None:
            return found
        how = {
            key: getattr(self.failed, key)
            for key in ("status", "residual", "message", "iterations")
        }
        return replace(found, **how)

    @property
    def shown(self) -> str | None:
        """The name of the last state, whose numbers are shown, where the step after it failed."""
        said = self.states[-1].scene.state
        name = f"state {len(self.states)}{said and f' ({said})'}"
        return None if self.failed is None else name

    @property
    def solutions(self) -> list[Solution]:
        """The solutions of all states, and that of the step that failed."""
        failed = [] if self.failed is None else [self.failed]
        return [*(state.solution for state in self.states), *failed]

    def problem(self, step: int) -> InterfaceProblem:
        """The static problem of one step, counted from 0, that certifies its solution."""
        return replace(self.reduction.problem, q=self.states[step].q, s=self.states[step].s)

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """One value per state (n,). Energies are sums from the unloaded bodies on.

        normal_force, shear_force    that press and push the upper body on the lower, the latter
                                     along t1 [force]; of several pairs normal_force:PAIR
        approach, shift              of the bodies, in the same directions [length]
        contact_half_width, stick_half_width [length];  contact_nodes, stick_nodes, slip_nodes
        elastic_energy, external_work, friction_work, step_work [force length]: external_work is the
        sum of the others
        energy_error                 of that sum in this step, relative to the largest work or
                                     energy so far
        residual, iterations, seconds   of the solve
        and the columns of the states: loads, motions, resultants and moments
        """
        rows = [_row(self.reduction.problem, state) for state in self.states]
        history = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        elastic = history["elastic_energy"]
        gained = history["external_work"] - np.diff(elastic, prepend=0.0)
        error = np.abs(gained - history["step_work"])
        history["step_work"] = history["step_work"] - history["friction_work"]
        for name in ("external_work", "friction_work", "step_work"):
            history[name] = np.cumsum(history[name])
        largest = np.maximum.accumulate(np.maximum(np.abs(history["external_work"]), elastic))
        none = np.zeros_like(error)
        history["energy_error"] = np.divide(error, largest, out=none, where=largest > 0)
        return history

    def fields(self, step: int) -> tuple[Fields, ...]:
        """Displacement and stress of each elastic body at a state; none if not kept."""
        pairs = zip(self.reduction.bodies, self.states[step].bodies)
        return tuple(found for body, U in pairs if (found := fields(body, U)) is not None)

    def write_history(self, file: Path) -> None:
        """Write the history as CSV, one row per state, the path's step in the last."""
        with open(file, "w", newline="") as opened:
            rows = csv.writer(opened)
            history: dict[str, Any] = dict(self.history)
            if any(names := [state.scene.state for state in self.states]):
                history["step"] = names
            rows.writerow(history)
            rows.writerows(zip(*history.values()))

    def at(self, step: int) -> tuple[Reduction, Solution]:
        """The reduction with the loads and the problem of a step, and the solution of the step."""
        state = self.states[step]
        reduction = self.reduction
        if step not in (-1, len(self.states) - 1):
            reduction = reduction.loaded(state.scene)
        reduction = replace(reduction, problem=self.problem(step))
        if state.bodies:  # of thin bodies, too, which the ground of the last state holds
            reduction.keep(state.solution, state.bodies)
        return reduction, state.solution

    def write(self, out: str | Path) -> None:
        """Write history.csv, and path.npz with coordinates (d, k), areas (k,), reactions and
        displacements (n, k, dim). The folder is made if it does not exist.

        path.npz also has the bounds of the friction forces (n, k), the status (n, k): 0 open, 1
        stick, 2 slip, and the contact frames (k, dim, dim), one direction per row, normal first.
        """
        problem = self.reduction.problem
        forces = [state.solution.reactions for state in self.states]
        masks = [contact_status(problem, r) for r in forces]
        with whole_folder(out) as staging:
            self.write_history(staging / "history.csv")
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


def _row(problem: InterfaceProblem, state: State) -> dict[str, float]:
    r, edges = state.solution.reactions, (np.nan, np.nan)
    status = contact_status(problem, r)
    along, single = np.broadcast_to(np.eye(problem.dim)[1], r.shape), len(problem.pairs) == 1
    forces = {}
    for pair in problem.pairs:
        own, name = pair.contacts, "" if single else f":{pair.name}"
        forces[f"normal_force{name}"] = float(r[own, 0].sum())
        forces[f"shear_force{name}"] = 0.0 - total(along[own], r[own])
    if single:
        stick = stick_edge(state.scene, problem, r, state.slip)[0]
        edges = contact_edge(state.scene, problem, r), stick
    return {
        **forces,
        "approach": 0.0 - state.risen,
        "shift": state.shifted,
        "contact_half_width": edges[0],
        "stick_half_width": edges[1],
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
        **state.columns,
    }
