"""Meshes refined everywhere, made again with more elements: the error is read from differences of
nested solutions.

Two numbers describe a mesh: `elements` across the contact half-width, which the scene's mesh
functions receive, and `splits`: how often the mesh made for elements / 2^splits was then halved
everywhere. Elements in the contact zone have the same size whatever the splits; away from it every
split turns a growth g of the elements into sqrt(g), and it halves whatever size the mesh function
holds fixed. The error is taken as one part that falls with each,

    J(elements, splits) - J = A elements^-p + B 2^(-p' splits),

both read from differences of nested solutions (Richardson): the first of the meshes for n, 2 n, 4 n
elements, the second of the last of them and its split, measured again on the mesh that it asks to
split. Their sizes are added, and the larger part is refined next. The claim is their sum times a
factor of safety, 1.25 from three meshes on and 3 of two. Orders are observed where there are three
solutions, and held between 3/4 and the order of functionals of smooth solutions, 2 per degree of
the displacement. But a solution whose contact ends by itself is not smooth. It has less than 5/2
derivatives, and no functional converges faster than with order 3 on meshes that are halved; where
an edge is read, with order 2. Where the edge of contact moves through the elements, the error
changes its sign from mesh to mesh, and three meshes may fall with any order by chance: more than
order 2 is believed of four meshes and more.

Sources: Moussaoui, Khodja (1992), Regularite des solutions d'un probleme mele Dirichlet-Signorini
dans un domaine polygonal plan, for the derivatives; Roache (1994), Perspective: a method for
uniform reporting of grid refinement studies, for the factors of safety; Roache (1998), Verification
and Validation in Computational Science and Engineering, chapter 5; Eca, Hoekstra (2014), A
procedure for the estimation of the numerical uncertainty of CFD calculations based on grid
refinement studies, for the four meshes.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from contactopt.accuracy.estimate import Judged
from contactopt.accuracy.indicators import EDGES
from contactopt.cards import count
from contactopt.meshes.cells import is_curved
from contactopt.readings.constants import BELOW, FIRST, MOST_UNKNOWNS, SLOWEST, STUCK
from contactopt.readings.peaks import Peak, Reading
from contactopt.scenes.refined_scenes import split_scene
from contactopt.scenes.scene import Scene
from contactopt.solving import solve_states
from contactopt.solving.solve_scene import Options, Solved

# of an error that is read from the difference of two nested solutions, and from differences of more
SAFETY = {2: 3.0, 3: 1.25}
FEW = 4  # meshes, below which no order above CERTAIN is believed
CERTAIN = 2.0
SWING = 0.25  # of a difference that remains if the next one has the opposite sign


def best_order(quantity: str, degree: int) -> int:
    """The highest order of convergence that an estimate assumes for a quantity."""
    return 2 if quantity.startswith(EDGES) else min(2 * degree, 3)


def safety(meshes: int) -> float:
    """The factor of safety of an error that is read from so many nested meshes, at least one."""
    return SAFETY[min(max(meshes, 2), 3)]


def believed(best: float, meshes: int) -> float:
    """The highest order of convergence that so many nested meshes can show: at most `best`."""
    return best if meshes >= FEW else min(best, CERTAIN)


def remainder(before: float | None, last: float, best: float) -> tuple[float, float | None]:
    """Estimate the sum of all further differences of a sequence under halving of the mesh from its
    last two, `before` None where there is one; and the observed order, if any.

    The order log2(before / last) is held between SLOWEST and `best`; the remaining differences form
    a geometric series, at least what order `best` leaves of the difference before, since a small
    one may be luck. After a change of sign: the last one, or a quarter of the one before.
    """
    order = None
    size = max(abs(last), abs(before or 0.0) / 2**best) / (2**best - 1)
    if before and last and before / last < 0:
        size = max(abs(last), SWING * abs(before))
    elif before and last:
        order = float(np.log2(before / last))
        size = max(size, abs(last) / (2 ** np.clip(order, SLOWEST, best) - 1))
    return float(np.copysign(size, last)), order


def mesh_error(values: Sequence[float], best: float) -> tuple[float, float | None]:
    """Signed error of the last of nested meshes, infinite for a single one; observed order."""
    steps = np.diff(values[-3:])
    if not len(steps):
        return np.inf, None
    before = steps[-2] if len(steps) > 1 else None
    rest, order = remainder(before, steps[-1], believed(best, len(values)))
    return -rest, order


def stuck(name: str, values: Sequence[float]) -> str:
    """One sentence if every halving of the mesh changes the value by as much as the one before."""
    steps = np.diff(values)
    if len(steps) < 3 or np.any(
        steps[-2:] * np.sign(steps[-1]) <= 2**-STUCK * np.abs(steps[-3:-1])
    ):
        return ""
    return f"the {name} does not converge: every refinement changes it by as much as the one before"


class Everywhere:
    """The nested solves of scenes whose parts make their own meshes.

    watches  whether the largest peak may exceed its value by what it changed, as others may
    values   (elements, splits) -> value;   changes[i]  of the value by split i + 1, one for each
             split of the present mesh; without one still the first
    """

    watches = False

    def __init__(self, states: tuple[Scene, ...], quantity: str, options: Options):
        self.states, self.options = states, options
        scene = states[-1]
        self.name, self.best = quantity, best_order(quantity, scene.degree)
        self.usual = MOST_UNKNOWNS[scene.dim]
        self.first = max(FIRST[scene.dim], scene.elements // BELOW)
        meshed = [part for part in scene.parts if hasattr(part, "build_mesh")]
        made = [part.build_mesh(self.first, scene.zone) for part in meshed]
        # what split() can halve
        self.halved = scene.dim == 2 and not any(is_curved(mesh) for mesh in made)
        self.values: dict[tuple[int, int], float] = {}
        self.unknowns: dict[tuple[int, int], int] = {}
        self.changes: list[float] = []
        self.splits = 0
        self.jobs = [(self.first, 0)]
        self.last: Solved | None = None

    @property
    def meshes(self) -> list[float]:
        """The values of the main sequence, doubled elements without splits."""
        return [value for (_, splits), value in sorted(self.values.items()) if splits == 0]

    def solve(self) -> Solved:
        """Solve the next mesh."""
        elements, splits = self.jobs[0]
        self.options.note(
            f"{count(elements, 'element')} across the half-width"
            + (f", {count(splits, 'split')}" if splits else "")
        )
        states = [split_scene(scene, elements // 2**splits, splits) for scene in self.states]
        return solve_states(states, elements, self.options, self.last)

    def judge(self, solved: Solved, reading: Reading) -> Judged:
        """What is known of the error of the value on the mesh that was solved last."""
        elements, splits = job = self.jobs.pop(0)
        self.values[job], self.unknowns[job] = reading.value, solved.reduction.dofs
        if splits:
            self.changes[splits - 1 :] = [reading.value - self.values[elements, splits - 1]]
            self.splits = splits
        if splits == 0 or self.last is None:
            self.last = solved
        mesh, order = mesh_error(self.meshes, self.best)
        grading = 0.0
        if self.changes:
            before = self.changes[-2] if len(self.changes) > 1 else None
            best = believed(self.best, len(self.changes) + 1)
            rest = remainder(before, self.changes[-1], best)[0]
            grading = -rest - sum(self.changes[splits:])
        size = safety(len(self.meshes)) * (abs(mesh) + abs(grading))
        return Judged(size, mesh, grading, order)

    def vain(self) -> str:
        """One sentence that says why further refinement would be in vain, or an empty text."""
        return stuck(self.name, self.meshes)

    @property
    def ready(self) -> bool:
        """Whether enough is known for the target to count as reached."""
        return not self.jobs and len(self.meshes) > 2 and (not self.halved or bool(self.changes))

    def facts(self, solved: Solved) -> dict[str, Any]:
        """What a Level says of the mesh that is solved next to be judged."""
        zones, (elements, splits) = solved.zones, self.jobs[0]
        return {
            "elements": elements,
            "splits": splits,
            "rounds": max(1, len(zones) - 1),
            "zone": zones[-2] if zones else None,
        }

    def advance(
        self, judged: Judged, reading: Reading, contacts: np.ndarray, rivals: Sequence[Peak]
    ) -> float:
        """Choose the next mesh; returns how many unknowns it will have."""
        if not self.jobs:
            n, s = max(elements for elements, _ in self.values), self.splits + 1
            fine = abs(judged.grading) > max(abs(judged.mesh), reading.uncertainty)
            many = len(self.meshes) > 2 and self.halved and 2**s * self.first <= n
            if many and (not self.changes or (fine and not len(contacts))):
                jobs = [(n, i) for i in range(1, s + 1)]
                self.jobs = [job for job in jobs if job not in self.values]
            self.jobs = self.jobs or [(2 * n, 0)]
        return self._unknowns(*self.jobs[0])

    def geometry(self, value: float, before: list[Scene]) -> tuple[float, str]:
        """Nothing changes: there are no guessed boundaries here."""
        return 0.0, ""

    def _unknowns(self, elements: int, splits: int) -> float:
        """How many unknowns a mesh will have, by the growth of those before it."""
        known = self.unknowns
        if splits and (elements // 2**splits, 0) in known:
            return float(known[elements // 2**splits, 0] * 4**splits)
        own = [known[n, 0] for n in sorted(n for n, s in known if s == 0)]
        growth = own[-1] / own[-2] if len(own) > 1 else 2.0 ** self.states[-1].dim
        return float(own[-1] * growth)
