"""Solve, estimate, refine: the one loop that bounds the error of a quantity."""

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from contactopt.accuracy.corners import unbounded
from contactopt.accuracy.estimate import Estimate, Judged, Level, read
from contactopt.accuracy.everywhere import SWING, Everywhere
from contactopt.accuracy.locally import Locally
from contactopt.accuracy.marking import overlooked
from contactopt.bounds import bounded
from contactopt.checks import check_number
from contactopt.defaults import CLOSE, TOL
from contactopt.derivatives.interface import CERTIFIED
from contactopt.errors import InputError
from contactopt.readings.peaks import Peak, Reading
from contactopt.readings.quantities import Quantity, quantity_of_states
from contactopt.readings.resolution import coarse
from contactopt.readings.validity import overlap_share
from contactopt.scenes.scene import Scene
from contactopt.solving.limits import Limits
from contactopt.solving.progress import resident_memory
from contactopt.solving.solve_scene import Options, Solved

log = logging.getLogger(__name__)
MOST_LEVELS = 60
# by how much larger the elements at a peak must have been for its change to tell its error
WATCHED = 1.5
SAME_PEAK = 8.0  # elements by which a peak moves at most from one mesh to the next
# Of the drop of a peak to the contacts around it, by which it may be larger where no smaller
# elements have shown it: where a smooth top falls by d within one element, a hat function sees it
# too low by d / 6, and a top of one contact alone falls by all of its value. What is narrower than
# an element is claimed too small, as by any share: a clamp of 0.4 on elements of 1.5 was off by 64
# % where 48 % were claimed.
UNWATCHED = 0.5


def refine(
    states: Sequence[Scene],
    quantity: str,
    accuracy: float,
    options: Options | None = None,
    limits: Limits | None = None,
    adaptive: bool = False,
    bound: bool = False,
) -> tuple[Solved, Estimate]:
    """Solve a scene, or the states of a load path, on meshes just fine enough for the relative
    `accuracy` of a quantity, and estimate its error. InputError, before anything is solved, for a
    quantity that the scene does not have.

    Meshes are refined everywhere, or with `adaptive` where the quantity needs it: simplices then,
    and mortar joins what no longer matches. Each solve begins with the last answer. The search ends
    short of the target, with a sentence and the best answer, where the quantity does not converge
    or exist, at a limit, and where a solve or refinement fails. With `bound` it ends with a
    guaranteed bound.
    """
    check_number("the accuracy", accuracy, low=0.0, high=1.0)
    scene = states[-1]
    asked = quantity_of_states(quantity, states)
    if asked.nodal:
        raise InputError(
            f"{quantity!r} is the value at a node of one mesh; ask for the pressure at a place, as"
            " in 'pressure@X,Y'."
        )
    options = _in_time(options or Options(), accuracy)
    search: Everywhere | Locally
    if adaptive or scene.given:
        search = Locally(tuple(states), asked, options, not adaptive)
    else:
        search = Everywhere(tuple(states), quantity, options)
    return _Loop(asked, accuracy, options, limits or Limits(), search, bound).run()


def _in_time(options: Options, accuracy: float) -> Options:
    """Options with which solvers stop at a tenth of the accuracy, unless a tolerance is given."""
    if options.tol != TOL:
        return options
    return replace(options, tol=max(TOL, min(CERTIFIED, 0.1 * accuracy)))  # a tenth is the solver's


@dataclass(eq=False)
class _Loop:
    """The state of one search.

    solved, reading, judged   of the best answer so far;   states  its scenes, where these are
                              divided
    levels, peaks             of every mesh
    """

    quantity: Quantity
    accuracy: float
    options: Options
    limits: Limits
    search: Everywhere | Locally
    bound: bool
    levels: list[Level] = field(default_factory=list)
    peaks: list[tuple[Peak, ...]] = field(default_factory=list)
    solved: Solved | None = None
    reading: Reading = field(default_factory=lambda: Reading(0.0))
    judged: Judged = field(default_factory=lambda: Judged(np.inf))
    states: list[Scene] = field(default_factory=list)

    def run(self) -> tuple[Solved, Estimate]:
        """Solve mesh after mesh until there is a reason to stop."""
        self.began, self.before = time.perf_counter(), resident_memory()
        message = ""
        while not message:
            start = time.perf_counter()
            try:
                message = self._next() or self._limit(time.perf_counter() - start)
            except InputError as error:
                if not self.levels:
                    raise
                message = f"the search ended early: {error}"
        return self._end(message)

    def _next(self) -> str:
        """Solve and judge one mesh; one sentence if the search ends there."""
        states = list(self.search.states)
        solved = self.search.solve()
        reduction, solution = solved.reduction, solved.solution
        if not solution.solved:
            sentence = f"the mesh of {reduction.dofs} unknowns was not solved: {solution.message}"
            if self.levels:
                return sentence
            raise InputError(
                f"scene '{states[-1].name}': {sentence}; begin with another mesh or load."
            )
        reading = read(self.quantity, solved)
        facts = self.search.facts(solved)
        judged = self.search.judge(solved, reading)
        self.solved, self.reading, self.judged, self.states = solved, reading, judged, states
        self.peaks.append(reading.peaks)
        self.rivals, excess = self._rivals()
        self.unresolved = self._unresolved()
        size = max(judged.size, reading.uncertainty, excess)
        scale = abs(reading.value) or 1.0
        error = max(size / scale, solution.residual, 1e-15)  # the least: no reading is exact
        top = reading.peaks[0] if reading.peaks and reading.peaks[0].size else None
        self.levels.append(
            Level(
                reduction.dofs,
                reduction.problem.contacts,
                reading.value,
                reading.uncertainty,
                error if np.isfinite(error) else None,
                time.perf_counter() - self.began,
                judged.energy,
                tuple(top.place.tolist()) if top else (),
                top.size if top else 0.0,
                **facts,
            )
        )
        said = f"{self.quantity.name} {reading.value:.6g}, estimated error {error:.1e}"
        self.options.note(f"mesh {len(self.levels)}: {said}")
        return self._stop()

    def _stop(self) -> str:
        """One sentence that says that the target is reached or out of reach, or an empty text."""
        vain = unbounded(self.solved, self.reading, self.levels) if self.solved else ""
        if not vain and not len(self.unresolved):
            vain = self.search.vain()
        if self.reading.missing and len(self.levels) > 2:
            vain = self.reading.missing
        error = self.levels[-1].error
        self.vain = bool(vain)
        known = not vain and not self.reading.missing and not len(self.unresolved)
        enough = error is not None and error <= self.accuracy
        self.reached = known and self.search.ready and enough
        if self.reached:
            return f"the estimated error of the {self.quantity.name} is below the target"
        late = len(self.levels) >= MOST_LEVELS
        return vain or (f"{MOST_LEVELS} meshes did not reach the target" if late else "")

    def _rivals(self) -> tuple[list[Peak], float]:
        """The local maxima that may be the largest, and by how much they may exceed the value.

        The largest is one until smaller elements changed it little: what it changed beyond the
        value counts. Another may grow by as much again as it did, or swing back if it fell, as
        differences of nested solutions do.
        """
        last = self.peaks[-1]
        found, excess = [], 0.0
        if self.search.watches and last and last[0].size:
            then, largest = self._before(last[0])
            change = abs(last[0].value - then)
            excess = max(change - abs(last[0].value - largest), 0.0)
            found = [last[0]] if change > self.judged.size / 2 else []
        for peak in last[1:]:
            grown = peak.value - self._before(peak)[0]
            if peak.value + abs(grown) >= last[0].value - last[0].uncertainty:
                found.append(peak)
                doubt = max(grown, -SWING * grown)
                excess = max(excess, peak.value + doubt - last[0].value)
        return found, excess

    def _before(self, peak: Peak) -> tuple[float, float]:
        """The value of a peak, and the largest one, on the last mesh of larger elements there."""
        for earlier in reversed(self.peaks[:-1]):
            away = [float(np.linalg.norm(one.place - peak.place)) for one in earlier]
            larger = [
                (distance, one.value)
                for one, distance in zip(earlier, away)
                if one.size >= WATCHED * peak.size and distance <= SAME_PEAK * one.size
            ]
            if larger:
                return min(larger)[1], earlier[0].value
        return (1 - UNWATCHED * peak.drop) * peak.value, peak.value

    def _unresolved(self) -> np.ndarray:
        """Numbers of contacts around which the mesh is too coarse to know anything."""
        assert self.solved is not None
        reduction, solution = self.solved.reduction, self.solved.solution
        problem, r = reduction.problem, solution.reactions
        touching = problem.law.pressed(r)
        apart = problem.displacements(r, solution.multipliers)[:, 0]
        few = [own for _, own in coarse(reduction, solution)]
        return np.concatenate([overlooked(reduction, touching, apart), *few]).astype(int)

    def _limit(self, last: float) -> str:
        """Choose the next mesh; one sentence if it passes a limit. The last one took `last` [s]."""
        unknowns = self.search.advance(self.judged, self.reading, self.unresolved, self.rivals)
        growth = unknowns / self.levels[-1].unknowns
        held = (resident_memory() - self.before) * (1 + growth)
        spent = time.perf_counter() - self.began
        return self.limits.refusal(unknowns, self.search.usual, spent + last, held)

    def _end(self, message: str) -> tuple[Solved, Estimate]:
        """The best answer with all that is known of it."""
        assert self.solved is not None
        value, judged = self.reading.value, self.judged
        last, scale = self.levels[-1], abs(self.reading.value) or 1.0
        geometry, sentence = self._shape()
        known = last.error is not None and not self.vain and np.isfinite(geometry)
        error = last.error + geometry if known and last.error is not None else None
        reached = self.reached and error is not None and error <= self.accuracy
        if self.reached and not reached:
            message = "the geometry keeps the target out of reach"
        elif error is not None and error <= self.accuracy and not reached:
            message = (
                f"the estimate is below the target, but no further mesh confirms it: {message}"
            )
        message = f"{message}; {sentence}" if sentence else message
        seconds = dict(self.solved.solution.seconds)
        earlier = max(last.seconds - sum(seconds.values()), 0.0)
        seconds["coarse"] = seconds.get("coarse", 0.0) + earlier
        solution = replace(self.solved.solution, seconds=seconds)
        signed = known and np.isfinite(judged.mesh)
        return replace(self.solved, solution=solution), Estimate(
            self.quantity.name,
            self.accuracy,
            value,
            value - judged.mesh - judged.grading if signed else None,
            error,
            judged.mesh / scale if signed else None,
            judged.grading / scale if signed else None,
            geometry if np.isfinite(geometry) else 1.0,
            judged.order,
            bounded(self.solved, self.quantity, value) if self.bound else None,
            reached,
            message,
            tuple(self.levels),
        )

    def _shape(self) -> tuple[float, str]:
        """The relative error that no mesh removes, since the shape of guessed boundaries is not
        known, and that of surfaces that overlap is not either; and a sentence on them.
        """
        assert self.solved is not None
        value, geometry, said = self.reading.value, 0.0, []
        if self.vain or self.reading.missing:
            return 0.0, ""
        try:
            guessed, sentence = self.search.geometry(value, self.states)
        except InputError as failure:
            log.info("the other shape of guessed boundaries was not solved: %s", failure)
            guessed, sentence = 0.0, ""
        if sentence:
            geometry = guessed / (abs(value) or 1.0)
            part = f"{geometry:.1e} of the error is that of the geometry, since "
            said.append(f"{part if geometry > 0 else ''}{sentence}")
        overlap = overlap_share(self.solved.reduction, self.solved.solution)
        if overlap > CLOSE:
            said.append(
                f"{overlap:.1e} of the error is that of small displacements, since curved surfaces"
                " overlap as they are drawn, and their areas differ by as much"
            )
            geometry += overlap
        return geometry, "; ".join(said)
