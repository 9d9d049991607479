"""Derivatives through the reduction and along load paths.

At fixed contact forces r and multipliers lambda a parameter of the scene moves each body by dU_b,
the relative displacement by du = sum B_b dU_b + dgap n, the balance by ds, and the law's parameter
by dmu. A change dA of a stiffness acts like the load -dA U: dU = -C dA U, so that neither dC nor dQ
is ever formed. What follows is contactopt.derivatives.interface.

The adjoint takes the gradient (q*, s*, mu*) by these data back to the bodies. With G_b = B_b' q*
and W_b = C_b G_b + motions_b s* the derivative with respect to a constant of a material is
-W_b' dA_b U_b, and that by a load f is W_b' df: one solve per body serves all parameters.

On a load path the slip of a state is measured from the state before, q_t = q_t(theta) - u_t before.
Forward, du_t before is handed on from state to state; backward, the gradient by u_t before is added
to that of the earlier state.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.bodies.views import load_work, material_work
from contactopt.checks import real_array
from contactopt.coupling.reduction import Reduction
from contactopt.derivatives.interface import Change, Dual, Sensitivity, sensitivity
from contactopt.derivatives.kinks import Weak
from contactopt.errors import InputError
from contactopt.problem import Solution
from contactopt.readings.state import Seeds, State
from contactopt.scenes.parameters import MATERIAL, Parameter
from contactopt.solving.paths import PathResult

Direction = Mapping[Parameter, Any]  # a number, or for a field one per contact


@dataclass(frozen=True, eq=False)
class Explicit:
    """Changes at fixed forces: u (k, dim), balance (p,), law (k,), U of each body."""

    u: np.ndarray
    s: np.ndarray
    mu: np.ndarray
    bodies: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class Moved:
    """How one state changes: in all, since the state before (k, dim), and explicitly."""

    change: Change
    slip: np.ndarray
    explicit: Explicit


@dataclass(frozen=True, eq=False)
class Step(State):
    """One solved state whose derivatives are asked for; `distance` to a kink as for sensitivity().

    In what follows `base` is the reduction that has the materials, whose matrices are kept there.
    """

    distance: float | None = None

    @cached_property
    def sensitivity(self) -> Sensitivity:
        return sensitivity(self.problem, self.solution, self.distance)

    def _changed(self, which: Parameter, number: int) -> tuple[Any, Any, float]:
        """The scene with a load changed by a step, its part of a body, and the step."""
        scene = self.reduction.scene
        value = which.read(scene)
        step = abs(value) or 1.0
        changed = which.put(scene, value + step)
        return changed, changed.parts[number], step

    def _on_contacts(self, which: Parameter) -> tuple[Any, Any]:
        """What a parameter changes at each contact: the gap, and the law's parameter."""
        if which.kind == "mu":
            return 0.0, self.law_change(which)
        return float(which.kind == "gap"), float(which.kind == "friction")

    def _concerned(self, which: Parameter) -> list[int]:
        """The numbers of the bodies that a parameter changes."""
        return [i for i, part in enumerate(self.reduction.scene.parts) if which.concerns(part)]

    def explicit(self, direction: Direction, base: Reduction) -> Explicit:
        """What a direction changes at fixed forces and multipliers."""
        bodies = self.reduction.bodies
        du, dmu = np.zeros(self.problem.q.shape), np.zeros(self.problem.contacts)
        dU = [0.0 * U for U in self.displaced]
        ds = [np.zeros(len(body.motions.resultants)) for body in bodies]
        for which, amount in direction.items():
            if which.is_field:
                amount = _one_per_contact(which, amount, len(du))
            by_gap, by_law = self._on_contacts(which)
            du[:, 0] += amount * by_gap
            dmu += amount * by_law
            for number in self._concerned(which):
                old = bodies[number]
                if which.kind in MATERIAL:
                    moved, balance = base.bodies[number].material_change(
                        which.kind, self.displaced[number], self.forces[number]
                    )
                else:
                    scene, part, step = self._changed(which, number)
                    new = old.loaded(scene, part)
                    moved = (new.at_rest - old.at_rest) / step
                    balance = (new.motions.resultants - old.motions.resultants) / step
                dU[number] = dU[number] + amount * moved
                ds[number] += amount * balance
        for B, own in zip(self.reduction.maps, dU):
            du += (B @ own).reshape(du.shape)
        return Explicit(du, np.concatenate(ds), dmu, tuple(dU))

    def work(self, which: Parameter, back: Duals, base: Reduction) -> Any:
        """The derivative by one parameter, or by one per contact (k,), from the duals."""
        by_gap, by_law = self._on_contacts(which)
        each = by_gap * back.dual.q[:, 0] + (by_law * back.dual.mu if np.any(by_law) else 0.0)
        if which.is_field:
            return each
        total = float(np.sum(each))
        for number in self._concerned(which):
            G, W = back.forces[number], back.fields[number]
            if which.kind in MATERIAL:
                own = base.bodies[number]
                total += material_work(
                    base.bodies[number],
                    which.kind,
                    self.displaced[number],
                    self.forces[number],
                    G,
                    W,
                )
            else:
                scene, part, step = self._changed(which, number)
                own = self.reduction.bodies[number]
                total += load_work(own, scene, part, G, back.weights[number], W) / step
        return total


@dataclass(frozen=True, eq=False)
class Duals:
    """The gradient with respect to a state's data on the bodies: G, s* and W as defined above."""

    state: State
    dual: Dual
    bodies: tuple[Any, ...]

    @cached_property
    def weights(self) -> tuple[np.ndarray, ...]:
        return self.state.reduction.own_multipliers(self.dual.s)

    @cached_property
    def forces(self) -> tuple[np.ndarray, ...]:
        maps = self.state.reduction.maps
        made = (np.asarray(B.T @ self.dual.q.ravel()) for B in maps)
        given = self.bodies or (None,) * len(maps)
        return tuple(G if own is None else G + own for G, own in zip(made, given))

    @cached_property
    def fields(self) -> tuple[np.ndarray, ...]:
        parts = zip(self.state.reduction.bodies, self.forces, self.weights)
        return tuple(body.displacement(G, own) - body.at_rest for body, G, own in parts)


def duals_of(state: State, seeds: Seeds) -> Duals:
    """The adjoint of a function of one state whose slip does not change; InputError without one."""
    by = {"reactions": seeds.reactions, "multipliers": seeds.multipliers}
    at = sensitivity(state.problem, state.solution)
    return Duals(state, at.adjoint(**by, displacements=seeds.slip), seeds.bodies)


@dataclass(frozen=True, eq=False)
class Chain:
    """The states of a load path in their order; a scene without a path is a chain of one."""

    steps: tuple[Step, ...]

    @property
    def weak(self) -> tuple[tuple[int, Weak], ...]:
        """The weakly active contacts of every state: (number of the state, contact)."""
        return tuple(
            (n, weak) for n, step in enumerate(self.steps) for weak in step.sensitivity.weak
        )

    def forward(self, direction: Direction) -> Iterator[Moved]:
        """State by state, how the solution changes in all along a direction."""
        base = self.steps[0].reduction
        before = np.zeros(self.steps[0].problem.q.shape)
        for step in self.steps:
            explicit = step.explicit(direction, base)
            mu = explicit.mu if np.any(explicit.mu) else None
            change = step.sensitivity.forward(q=explicit.u - before, mu=mu, s=explicit.s)
            slip = change.displacements
            change = replace(change, displacements=slip + before)
            yield Moved(change, slip, explicit)
            before = change.displacements.copy()
            before[:, 0] = 0.0

    def adjoint(self, seeds: Sequence[Seeds | None], which: Sequence[Parameter]) -> dict[str, Any]:
        """The gradient of the sum of functions of the states, by name of the parameter."""
        base = self.steps[0].reduction
        carried = np.zeros(self.steps[0].problem.q.shape)
        total: dict[str, Any] = {one.name: 0.0 for one in which}
        for step, own in zip(reversed(self.steps), reversed(seeds)):
            if own is None and not np.any(carried):
                continue
            given = Seeds(0.0) if own is None else own
            by_u = carried if given.displacements is None else carried + given.displacements
            weights = by_u if given.slip is None else by_u + given.slip
            dual = step.sensitivity.adjoint(
                reactions=given.reactions, multipliers=given.multipliers, displacements=weights
            )
            back = Duals(step, dual, given.bodies)
            for one in which:
                direct = 0.0 if one.is_field else given.explicit(one)
                total[one.name] = total[one.name] + step.work(one, back, base) + direct
            carried = by_u - dual.q
            carried[:, 0] = 0.0
        return total


def along(seeds: Seeds, moved: Moved, direction: Direction) -> float:
    """The derivative of a function of a state along the direction of `moved`."""
    total = sum(
        amount * seeds.explicit(which) for which, amount in direction.items() if not which.is_field
    )
    for weight, part in (
        (seeds.reactions, moved.change.reactions),
        (seeds.multipliers, moved.change.multipliers),
        (seeds.displacements, moved.change.displacements),
        (seeds.slip, moved.slip),
        *zip(seeds.bodies, moved.explicit.bodies),
    ):
        if weight is not None:
            total += float(np.sum(weight * part))
    return float(total)


def chain_of(result: object, distance: float | None = None) -> Chain:
    """The solved states of a result, to differentiate through; InputError if not certified."""
    path = result if isinstance(result, PathResult) else getattr(result, "path", None)
    if path is None:
        reduction, solution = getattr(result, "reduction", None), getattr(result, "solution", None)
        if not isinstance(reduction, Reduction) or not isinstance(solution, Solution):
            raise InputError(
                "a derivative needs a solved scene: what contactopt.run or contactopt.follow"
                f" returns; got {type(result).__name__}."
            )
        return Chain((Step(reduction, solution, distance),))
    steps = []
    for number, state in enumerate(path.states):
        reduction = path.reduction.loaded(state.scene)
        problem = replace(reduction.problem, q=state.q, s=state.s)
        steps.append(Step(replace(reduction, problem=problem), state.solution, distance))
        if not state.solution.solved:
            raise InputError(
                f"state {number} of the path is not certified; a derivative needs all states"
                " solved."
            )
    return Chain(tuple(steps))


def _one_per_contact(which: Parameter, amount: object, contacts: int) -> np.ndarray:
    array = real_array(f"the change of '{which.name}'", amount)
    if array.shape not in ((), (contacts,)):
        raise InputError(
            f"the change of '{which.name}' must have the shape ({contacts},); got {array.shape}."
        )
    return np.broadcast_to(array, (contacts,))
