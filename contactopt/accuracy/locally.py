"""Meshes that are given, or made once, and then divided, everywhere or where it is needed."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from contactopt.accuracy.estimate import Judged, read
from contactopt.accuracy.everywhere import SAFETY, best_order, mesh_error, safety, stuck
from contactopt.accuracy.first_mesh import seeing, unseen
from contactopt.accuracy.indicators import ElementErrors, along_path, misfit
from contactopt.accuracy.marking import (
    at_contacts,
    check_refinable,
    divisible,
    finer,
    left_out,
    otherwise,
    plateau,
    unknowns,
    with_bent_edges,
)
from contactopt.readings.peaks import Peak, Reading, nodal_pressure
from contactopt.readings.quantities import Quantity
from contactopt.scenes.scene import Scene
from contactopt.solving import solve_states
from contactopt.solving.solve_scene import Options, Solved, solve_scene

# of the estimated error that the marked elements make; Doerfler's marking allows anything between 0
# and 1
SHARE = 0.6
LESS = 0.25  # by how much the change of a path falls at most from one mesh to the next
SLOWEST = 0.9  # ratio of the errors of two meshes; above, a refinement tells nothing of the next
USUAL = 2_000_000  # unknowns of the largest mesh, unless another bound is given


def remaining(changes: np.ndarray, ratio: float) -> float:
    """The error of a load path after the last one or two `changes` of its value, in their order.

    The error of a quantity falls as the square of that in the energy norm, whose `ratio` of the
    last two meshes this is, held below SLOWEST: what remains is a geometric series. The change
    itself falls at most by LESS. Changes of both signs scatter: then the larger one counts.
    """
    last, before = abs(changes[-1]), abs(changes[-2]) if len(changes) > 1 else 0.0
    scatters = len(changes) > 1 and changes[0] * changes[1] < 0
    least = SAFETY[3] * max(last, before * (1.0 if scatters else LESS))
    held = min(ratio, SLOWEST)
    return float(max(least, last * held / (1 - held)))


class Locally:
    """Divided meshes of a scene, or of the states of its load path.

    whole    whether all elements are divided; the error is then read from differences of nested
             solutions, as in contactopt.accuracy.everywhere, and otherwise element by element
             (contactopt.accuracy.indicators)
    """

    usual = USUAL

    def __init__(
        self, states: tuple[Scene, ...], quantity: Quantity, options: Options, whole: bool
    ):
        check_refinable(states[-1])
        made = [divisible(scene, not whole) for scene in states]
        self.states, self.shapes = [scene for scene, _ in made], made[-1][1]
        self.across, self.unseen = 1.0, {} if whole else unseen(states[-1])
        self._see()
        self.quantity, self.options, self.whole, self.watches = quantity, options, whole, not whole
        self.best = best_order(quantity.name, states[-1].degree)
        self.values: list[float] = []
        self.errors: list[ElementErrors] = []
        self.last: Solved | None = None

    def _see(self, peaks: Sequence[Peak] = ()) -> None:
        """Divide elements at contacts too small for the first mesh; with peaks, only at theirs."""
        found = self.unseen
        if peaks:
            places = np.transpose([peak.place for peak in peaks])
            found = {
                body: [own for own in made if own.away(places).min() <= own.size]
                for body, made in found.items()
            }
        if found:
            see = partial(seeing, contacts=found, across=self.across, shapes=self.shapes)
            self.states = [see(scene) for scene in self.states]

    def solve(self) -> Solved:
        return self._solved([with_bent_edges(scene, self.shapes) for scene in self.states])

    def _solved(self, states: list[Scene]) -> Solved:
        if len(states) > 1:
            return solve_states(states, None, self.options)
        return solve_scene(states[0], options=self.options, start=self.last)

    def judge(self, solved: Solved, reading: Reading) -> Judged:
        self.last = solved
        self.values.append(reading.value)
        if self.whole:
            mesh, order = mesh_error(self.values, self.best)
            size = safety(len(self.values)) * abs(mesh) + reading.uncertainty
            return Judged(size, mesh, order=order)
        between = [left_out(part, self.shapes) for part in solved.reduction.scene.parts]
        last = along_path(solved, self.quantity, reading.value, between)
        self.errors = [*self.errors[-2:], last]
        if not last.unsigned:
            size = SAFETY[3] * abs(last.total) + max(misfit(self.errors), reading.uncertainty)
            return Judged(size, -last.total, energy=last.energy)
        # of two refinements, since what one changes may be small by chance
        changes = np.abs(np.diff(self.values[-3:]))[::-1]
        if not len(changes):
            size = np.inf
        elif solved.path is not None:  # nothing but the changes tells the error of a whole path
            before = self.errors[-2].energy
            ratio = (last.energy / before) ** 2 if before > 0 else SLOWEST
            size = remaining(np.diff(self.values[-3:]), ratio)
        else:  # no adjoint: what a refinement changed, twice
            size = 2 * float(np.max(changes))
        mesh = np.nan if solved.path is not None else -last.total
        return Judged(size + reading.uncertainty, mesh, energy=last.energy)

    def vain(self) -> str:
        return stuck(self.quantity.name, self.values) if self.whole else ""

    @property
    def ready(self) -> bool:
        """Three meshes tell whether values converge, two where the first was made for contact."""
        return len(self.values) > (1 if self.unseen else 2)

    def facts(self, solved: Solved) -> dict[str, Any]:
        made = {"elements": self.states[-1].elements, "splits": len(self.values)}
        return made if self.whole else {}

    def advance(
        self, judged: Judged, reading: Reading, contacts: np.ndarray, rivals: Sequence[Peak]
    ) -> float:
        """Divide elements, also at unresolved contacts and rival maxima; returns the unknowns."""
        marked = None
        if not self.whole:
            assert self.last is not None
            reduction = self.last.reduction
            chosen = list(rivals)
            if reading.uncertainty > judged.size / 3:  # of which it is a part
                chosen += reading.peaks[:1]
            near = [contacts, *(peak.contacts for peak in chosen)]
            if rivals:
                pressure = nodal_pressure(reduction.problem, self.last.solution)
                near.append(plateau(reduction, pressure, rivals))
            marks = zip(
                self.errors[-1].marked(SHARE),
                at_contacts(reduction, np.concatenate(near).astype(int)),
            )
            inside = [(peak.body, peak.elements) for peak in chosen]
            marked = tuple(
                np.unique(np.concatenate([*own, *(found for body, found in inside if body == i)]))
                for i, own in enumerate(marks)
            )
        self.states = [finer(scene, marked, self.shapes) for scene in self.states]
        if reading.uncertainty > judged.size / 3:
            self.across *= 2
            self._see(reading.peaks)
        return float(unknowns(self.states[-1]))

    def geometry(self, value: float, before: list[Scene]) -> tuple[float, str]:
        """How much the `value` changes in the other shape of guessed boundaries; one sentence."""
        if not self.shapes.names:
            return 0.0, ""
        sentence = (
            f"the mesh gives boundary {self.shapes.names} by straight edges only, which are taken"
            " for chords of a smooth line: give its `curve`, or a mesh of second order"
        )
        if not self.shapes.doubtful:
            return 0.0, sentence
        other = self._solved([otherwise(scene, self.shapes) for scene in before])
        if not other.solution.solved:
            return np.inf, sentence
        return abs(read(self.quantity, other).value - value), sentence
