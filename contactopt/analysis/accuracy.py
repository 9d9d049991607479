"""Meshes no finer than needed: refined until the estimated error of one quantity J is below a target.

Two numbers describe a mesh: `elements` across the contact half-width, which the scene's mesh functions receive, and
`splits`: how often the mesh made for elements / 2^splits was then halved everywhere. Elements in the contact zone have the
same size whatever the splits; away from it every split turns a growth g of the elements into sqrt(g), and it halves
whatever size the mesh function holds fixed. The error is taken as one part that falls with each,

    J(elements, splits) - J = A elements^-p + B 2^(-p' splits),

both read from differences of nested solutions (Richardson): the first of the meshes for n, 2 n, 4 n elements, the
second of the last of them and its split, measured anew on the mesh that it asks to split. Their sizes are added, the
larger part is refined next. A value read between nodes is as uncertain as its readings from two sides differ, whatever
the sum says. Orders are observed where there are three solutions, and held between 3/4 and 2 per degree of the
displacement, the order of functionals of smooth solutions, or 2 where an edge is read, since the solution is not smooth
there. Not estimated, because no refinement shows it: what finite bodies differ from half-spaces, and the steps of a
load path.

Source: Roache (1998), Verification and Validation in Computational Science and Engineering, chapter 5.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactopt.analysis.constants import BELOW, FIRST, MOST_UNKNOWNS, SLOWEST, STUCK
from contactopt.analysis.limits import Limits
from contactopt.analysis.paths import solve_states
from contactopt.analysis.places import PLACED, place_of, read_place
from contactopt.analysis.progress import resident_memory
from contactopt.analysis.quantities import OF_ONE_PAIR, QUANTITIES, at_rim, uncertainty
from contactopt.analysis.resultants import views
from contactopt.analysis.solve_scene import Options, Solved
from contactopt.bodies.refinement import split_scene
from contactopt.cards import count, line
from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.interface.reduction import Reduction
from contactopt.problem import Solution
from contactopt.scenes.scene import Scene

EDGES = ("width", "stick")


@dataclass(frozen=True)
class Level:
    """What one solve of the search gave.

    elements     across the contact half-width;   splits  how often the mesh was halved everywhere
    unknowns     of the displacement;   contacts  of the interface problem
    rounds       of the zone loop
    zone         half-width that the mesh resolves [length]; None without a zone loop
    value        of the quantity [its unit];   uncertainty  of its reading [its unit]
    seconds      wall time [s]
    """

    elements: int
    splits: int
    unknowns: int
    contacts: int
    rounds: int
    zone: float | None
    value: float
    uncertainty: float
    seconds: float

    @property
    def mesh(self) -> str:
        """What the mesh is, in words."""
        return f"{self.elements} elements, {self.splits} splits"


@dataclass(frozen=True, repr=False)
class Estimate:
    """What is known of a quantity after the last solve.

    value          on the last mesh [unit of the quantity]
    extrapolated   the value less its estimated error; None where the error is unknown
    error          estimated error over the value [-], at least the uncertainty of the reading; None where it is unknown
    mesh_error     signed part of it that falls with the number of elements [-]
    grading_error  signed part of it that falls with the number of splits [-]
    order          observed order of the first part; None if the sequence is not monotone
    reached        whether the error is at most the target
    message        one sentence that says how the search ended
    levels         all solves, in their order
    """

    quantity: str
    target: float
    value: float
    extrapolated: float | None
    error: float | None
    mesh_error: float | None
    grading_error: float | None
    order: float | None
    reached: bool
    message: str
    levels: tuple[Level, ...]

    def __repr__(self) -> str:
        error = "unknown" if self.error is None else f"{self.error:.1e}"
        meshes = f"{self.levels[-1].unknowns} unknowns, {count(len(self.levels), 'mesh', 'meshes')}"
        return line("Estimate", f"{self.quantity} {self.value:.6g}", f"error {error} of {self.target:g}", meshes)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A scene solved on one mesh, or the last state of its load path."""

    level: Level
    solved: Solved

    @property
    def reduction(self) -> Reduction:
        return self.solved.reduction

    @property
    def solution(self) -> Solution:
        return self.solved.solution

    @property
    def failure(self) -> str:
        """One sentence, or nothing if it was solved."""
        if self.solution.solved:
            return ""
        return f"the mesh of {self.level.unknowns} unknowns was not solved: {self.solution.message}"


def refine(
    states: Sequence[Scene],
    quantity: str,
    accuracy: float,
    options: Options | None = None,
    limits: Limits | None = None,
) -> tuple[Mesh, Estimate]:
    """Solve a scene, or a load path of several states, on meshes just fine enough for one quantity.

    It ends short of the target, with a sentence in the estimate, where the quantity does not converge, where the next mesh
    would pass a limit, or where a solve fails.

    Parameters
    ----------
    states
        The scene, or the states of its load path.
    quantity
        A name in QUANTITIES; of one of several pairs of surfaces 'NAME:PAIR', such as 'pressure:block-floor'; or one
        of contactopt.analysis.places, such as 'von_mises:block:fillet'.
    accuracy
        Bound on the estimated relative error of the quantity, between 0 and 1.
    options
        How each mesh is solved.
    limits
        On unknowns, by default MOST_UNKNOWNS, on time and on memory.

    Returns
    -------
    tuple
        The finest Mesh with its solution, and the Estimate with the history of the search.


    Raises
    ------
    InputError
        For an unknown quantity or pair of surfaces, or an accuracy out of range.
    """
    options, limits = options or Options(), limits or Limits()
    name, _, pair = quantity.partition(":") if isinstance(quantity, str) else (quantity, "", "")
    placed = place_of(quantity, states[0]) is not None
    if name not in QUANTITIES and not placed:
        raise InputError(f"unknown quantity {quantity!r}; choose from {', '.join((*QUANTITIES, *PLACED))}.")
    if placed:
        name, pair = "", ""
    if pair and pair not in (known := [made.name for made in states[0].pairs]):
        raise InputError(
            f"quantity {quantity!r}: there is no pair of surfaces {pair!r}; the pairs are {', '.join(known)}."
        )
    if pair and name not in OF_ONE_PAIR:
        raise InputError(f"the {name} belongs to the whole scene; of one pair ask for {', '.join(OF_ONE_PAIR)}.")
    check_number("the accuracy", accuracy, low=0.0, high=1.0)
    search = _Search(tuple(states), quantity, options, limits)
    while True:
        mesh, order, grading = *search.mesh_error(), search.grading_error()
        read, scale = search.meshes[-1].uncertainty, abs(search.meshes[-1].value) or 1.0
        error = max(abs(mesh) + abs(grading), read) / scale
        message = in_vain = search.obstacle()
        if in_vain or error <= accuracy:
            break
        options.note(f"{quantity} {search.meshes[-1].value:.6g}, estimated error {error:.1e}")
        message = search.finer_grading() if abs(grading) > max(abs(mesh), read) else search.finer_mesh()
        if message:
            break
    last = search.final()
    message = message or last.failure
    seconds = Counter(last.solution.seconds)
    seconds.update({"coarse": sum(level.seconds for level in search.levels) - last.level.seconds})
    last = replace(last, solved=replace(last.solved, solution=replace(last.solution, seconds=dict(seconds))))
    value = last.level.value
    parts: dict[str, Any] = dict.fromkeys(("extrapolated", "error", "mesh_error", "grading_error", "order"))
    if not in_vain and np.isfinite(error):
        parts = dict(zip(parts, (value - mesh - grading, error, mesh / scale, grading / scale, order)))
    sentence = message or f"the estimated error of the {quantity} is below the target"
    levels = tuple(search.levels)
    return last, Estimate(quantity, accuracy, value, reached=not message, message=sentence, levels=levels, **parts)


def remainder(before: float | None, last: float, best: float) -> tuple[float, float | None]:
    """Estimate how much a sequence still changes under further halving of the mesh.

    The order is log2(before / last), held between SLOWEST and `best`, and the remaining differences form a geometric series.
    A small last difference may be luck, so that the result is at least what order `best` leaves of the difference before.
    Where the two differences have opposite signs, the result is as large as the last one, or a quarter of the one before.

    Parameters
    ----------
    before, last : the last two differences of the sequence; `before` is None where there is only one
    best : the largest order that is believed

    Returns
    -------
    The sum of all further differences, with the sign of the last one, and the observed order, None if it is unknown.
    """
    order = None
    size = max(abs(last), abs(before or 0.0) / 2**best) / (2**best - 1)
    if before and last and before / last < 0:
        size = max(abs(last), abs(before) / 4)
    elif before and last:
        order = float(np.log2(before / last))
        size = max(size, abs(last) / (2 ** np.clip(order, SLOWEST, best) - 1))
    return float(np.copysign(size, last)), order


class _Search:
    """The nested solves and what they say. The last of `meshes`, with `splits`, is the mesh in question.

    meshes   levels of the main sequence: doubled elements without splits, or, where the meshes are given, splits alone
    changes  changes[i] is the change of the value by split i + 1. There is one entry for every split of the present mesh;
             without a split there is still the first one, which was measured to learn what splits would do
    share    by which the first split multiplies the unknowns
    before   memory of the process before the search [bytes];   each  that its meshes take for each unknown [bytes]
    """

    def __init__(self, states: tuple[Scene, ...], quantity: str, options: Options, limits: Limits):
        self.states, self.quantity, self.options, self.limits = states, quantity, options, limits
        self.began = time.perf_counter()
        scene = states[-1]
        self.given = scene.given
        self.first = scene.elements if self.given else max(FIRST[scene.dim], scene.elements // BELOW)
        self.place = place_of(quantity, scene)
        self.name, _, self.pair = ("", "", "") if self.place else quantity.partition(":")
        self.best = 2 if self.name in EDGES else 2 * scene.degree
        self.levels: list[Level] = []
        self.meshes: list[Level] = []
        self.changes: list[float] = []
        self.splits, self.share = 0, 1.0
        self.before, self.each = resident_memory(), 0.0
        self.last: Mesh | None = None
        self.split_last: Mesh | None = None
        self._refine_mesh()
        while len(self.meshes) < 3 and not self.obstacle() and not self.finer_mesh():
            pass
        if scene.dim == 2 and not self.given and len(self.meshes) > 1:
            self._split(1, self.meshes[-1].elements)

    def mesh_error(self) -> tuple[float, float | None]:
        """Signed error of the value on the last mesh [unit of the quantity], infinite for a single mesh; and its order."""
        steps = np.diff([level.value for level in self.meshes[-3:]])
        if not len(steps):
            return np.inf, None
        rest, order = remainder(steps[-2] if len(steps) > 1 else None, steps[-1], self.best)
        return -rest, order

    def grading_error(self) -> float:
        """Signed error that comes from the sizes of the elements away from the contact, with the present splits."""
        if not self.changes:
            return 0.0
        before = self.changes[-2] if len(self.changes) > 1 else None
        rest = remainder(before, self.changes[-1], self.best)[0]
        return -rest - sum(self.changes[self.splits :])

    def obstacle(self) -> str:
        """One sentence that says why further refinement would be in vain, or an empty text."""
        assert self.last is not None
        if self.last.failure:
            return self.last.failure
        if self.name == "pressure" and at_rim(*self._seen(self.last.reduction, self.last.solution)):
            return "the largest pressure is at the edge of the contact surface, a corner, where no mesh bounds it"
        steps = np.diff([level.value for level in self.meshes])
        if len(steps) > 2 and np.all(steps[-2:] * np.sign(steps[-1]) > 2**-STUCK * np.abs(steps[-3:-1])):
            return f"the {self.quantity} does not converge: every refinement changes it by as much as the one before"
        return ""

    def finer_mesh(self) -> str:
        """Refine the last mesh and return an empty text, or return the reason why not."""
        counts = [level.unknowns for level in self.meshes[-2:]]
        growth = counts[1] / counts[0] if len(counts) > 1 else 2.0 ** self.states[-1].dim
        if reason := self._too_large(growth, self.splits):
            return reason
        self._refine_mesh()
        return ""

    def finer_grading(self) -> str:
        """Add one split and return an empty text, or return the reason why not."""
        elements = self.meshes[-1].elements
        if 2 ** (self.splits + 1) * self.first > elements:  # would start from a mesh coarser than the first
            return self.finer_mesh()
        if reason := self._too_large(1.0, self.splits + 1):
            return reason
        self.splits += 1
        self._split(self.splits, elements)
        return ""

    def final(self) -> Mesh:
        """The last mesh with the present splits."""
        assert self.last is not None
        wanted = self.last.level.elements, self.last.level.splits if self.given else self.splits
        for solved in (self.last, self.split_last):
            if solved is not None and (solved.level.elements, solved.level.splits) == wanted:
                return solved
        return self._solve(*wanted)

    def _too_large(self, growth: float, splits: int) -> str:
        """A sentence if the next mesh passes the limit."""
        dim = self.states[-1].dim
        unknowns = growth * self.meshes[-1].unknowns * self.share**splits
        spent, last = time.perf_counter() - self.began, self.levels[-1].seconds
        return self.limits.refusal(unknowns, MOST_UNKNOWNS[dim], spent + last, self.each * (unknowns + self._held()))

    def _held(self) -> int:
        """Unknowns of the meshes that are kept while the next one is solved."""
        return sum(mesh.level.unknowns for mesh in (self.last, self.split_last) if mesh is not None)

    def _refine_mesh(self) -> None:
        i = len(self.meshes)
        self.last = self._solve(self.first if self.given else self.first * 2**i, i if self.given else 0)
        self.meshes.append(self.last.level)

    def _split(self, splits: int, elements: int) -> None:
        """Measure the change by a split."""
        self.split_last = None  # its memory is needed
        known = {(level.elements, level.splits): level.value for level in self.levels}
        if (elements, splits - 1) not in known:
            known[elements, splits - 1] = self._solve(elements, splits - 1).level.value
        self.split_last = self._solve(elements, splits)
        if not self.changes:
            self.share = self.split_last.level.unknowns / self.meshes[-1].unknowns
        self.changes[splits - 1 :] = [self.split_last.level.value - known[elements, splits - 1]]

    def _seen(self, reduction: Reduction, solution: Solution) -> tuple[Reduction, Solution]:
        """What the quantity is read from: all of the scene, or one pair by itself."""
        if not self.pair:
            return reduction, solution
        names = [pair.name for pair in reduction.problem.pairs]
        return views(reduction, solution)[names.index(self.pair)]

    def _solve(self, elements: int, splits: int) -> Mesh:
        self.options.note(f"{elements} elements across the half-width" + (f", {splits} splits" if splits else ""))
        begin = time.perf_counter()
        base = elements if self.given else elements // 2**splits
        states = [split_scene(scene, base, splits) for scene in self.states]
        solved = solve_states(states, elements, self.options, None if self.last is None else self.last.solved)
        reduction, solution, zones = solved.reduction, solved.solution, solved.zones
        seen = self._seen(reduction, solution)
        if self.place is not None:
            value = read_place(self.place, reduction, solution)
        else:
            value = QUANTITIES[self.name](*seen), uncertainty(self.name, *seen)
        size = reduction.dofs, reduction.problem.contacts, max(1, len(zones) - 1), zones[-2] if zones else None
        self.levels.append(Level(elements, splits, *size, *value, time.perf_counter() - begin))
        self.each = (resident_memory() - self.before) / (self._held() + reduction.dofs)
        return Mesh(self.levels[-1], solved)
