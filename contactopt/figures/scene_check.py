"""What is known of a scene before anything is solved: what holds and loads each body, how the
surfaces of each pair lie to each other, and what the run will cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.accuracy.proposal import accuracy_lines
from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.bodies.solvers import solvers_there
from contactopt.cards import count
from contactopt.checks import overheard
from contactopt.coupling.compliance import filling
from contactopt.coupling.costs import FORM_OF, estimates
from contactopt.coupling.coupling import Coupling
from contactopt.coupling.posed import Posed, free_problem, posed
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.figures.sheet import part_lines
from contactopt.problem import InterfaceProblem
from contactopt.problem.unbalanced_loads import escape, resisted, sentence
from contactopt.readings.hertz_size import hertz
from contactopt.readings.plausibility import doubts, said_of_meshes
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Scene
from contactopt.solving.solve_scene import STEPS

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart

FLAT = 0.01  # degrees by which normals may differ and still be one direction
WORDS = {
    "dense": "Q as an array",
    "products": "products with Q by factors",
    "coupled": "bodies and contact at once",
}
# bytes: of Python with its packages, and for each entry of a stiffness with its copies, of factors
# by a solver, and of Q with its copies; `python -m experiments.questions.scene_check` measures them
PROCESS, STIFFNESS, DENSE = 1.6e8, 40.0, 32.0
FACTORS = {"superlu": 26.0, "pardiso": 12.0, "multigrid": 0.0}


@dataclass(frozen=True, eq=False)
class SceneCheck:
    """What check_scene() found.

    scene    that was checked, of a load path the last state
    posed    its assembled bodies and coupled surfaces
    free     the rigid motions V, s that supports and plates leave to the bodies, as an interface
             problem whose Q means nothing
    costs    (way, solver) -> estimated seconds of one solution; empty where nobody knows them
    memory   estimated bytes of the cheapest way
    notes    one sentence for everything that will probably not go as it is meant
    text     all of it in words
    """

    scene: Scene
    posed: Posed
    free: InterfaceProblem
    costs: dict[tuple[str, str], float]
    memory: float
    notes: tuple[str, ...]
    text: str


def check_scene(
    states: Sequence[Scene], solve: dict[str, Any] | None = None, told: Sequence[str] = ()
) -> SceneCheck:
    """Look at a scene, or the last state of a load path, without solving it. `solve` are options of
    the run (method, Q, solver), `told` earlier remarks. InputError for what cannot be solved.
    """
    scene, options = states[-1], solve or {}
    with overheard() as heard:
        made = posed(scene)
    free = free_problem(scene, made)
    once = len(states) == 1 and options.get("method") in STEPS
    costs, memory = _costs(scene, made, options, once)
    coupled = [text for own in made.couplings for text in own.remarks]
    told = list(dict.fromkeys([*told, *said_of_meshes(scene), *heard]))
    notes = [
        *told,
        *_balance(states, made, free),
        *doubts(scene, made.couplings, made.planes, states),
        *coupled,
    ]
    length, stress = scene.units
    lines = [f"{scene.name}: {scene.kind}, lengths in {length}, stresses in {stress}"]
    for part, body in zip(scene.parts, made.bodies):
        lines += part_lines(
            scene, part, body.body.basis.mesh if isinstance(body, AssembledElastic) else None
        )
        lines.append(f"  {count(body.unknowns, 'unknown')}; {_held(part, body.name, free)}")
    predicted = hertz(scene, made, free)
    for pair, own in zip(scene.pairs, made.couplings):
        lines += _pair_lines(scene, pair, own)
        sides = zip(pair.bodies, pair.surfaces)
        faces = [f"{b}:{s or scene.meshed[b].contact}" for b, s in sides if b in scene.meshed]
        if pair.name in predicted and scene.given and faces:
            lines += predicted[pair.name].words(length, faces[0], float(own.areas.sum()))
    if scene.copies > 1:
        where = " and ".join(_direction(plane.inward) for plane in made.planes)
        where = where and f", across planes with normals {where}"
        lines.append(f"{scene.copies} images make the whole{where}")
    if len(states) > 1:
        lines.append(f"load path of {len(states)} states; the last one is described")
    lines += _cost_lines(costs, memory, len(states))
    lines += accuracy_lines(scene, made) if len(states) == 1 else []
    lines += [f"note: {note}" for note in notes]
    return SceneCheck(scene, made, free, costs, memory, tuple(notes), "\n".join(lines))


def _held(part: AnyPart, name: str, free: InterfaceProblem) -> str:
    """What holds a body."""
    start = f"body '{name}': "
    names = [name.removeprefix(start) for name in free.motions if name.startswith(start)]
    plates = any(load.level for load in getattr(part, "loads", ()))
    holders = [
        word
        for word, there in (("supports", getattr(part, "supports", ())), ("plates", plates))
        if there
    ]
    by = f"held by its {' and '.join(holders)}" if holders else "held as a whole"
    if not names:
        return by
    return f"{by if holders else 'held by contact alone'}, contact has to hold: {', '.join(names)}"


def _balance(states: Sequence[Scene], made: Posed, free: InterfaceProblem) -> list[str]:
    """Loads that no contact forces can balance, and motions that nothing resists."""
    found = []
    for number, state in enumerate(states, 1):
        problem = free if state is states[-1] else free_problem(state, _posed_again(state, made))
        if (gone := escape(problem)) is not None:
            where = f"in state {number} " if len(states) > 1 else ""
            found.append(where + sentence(problem, gone))
    if found or not free.motions:
        return found[:1]
    return [said] if (said := resisted(free)[2]) else []


def _posed_again(state: Scene, made: Posed) -> Posed:
    """The same bodies under the loads of another state of the path."""
    from contactopt.bodies.body import reload_body

    bodies: list[Any] = []
    body: Any
    part: Any
    for body, part in zip(made.bodies, state.parts):
        if isinstance(body, AssembledElastic):
            bodies.append(AssembledElastic(reload_body(body.body, state, part), part))
        else:
            bodies.append(body.loaded(state, part))
    return made._replace(bodies=tuple(bodies))


def _direction(n: np.ndarray) -> str:
    return f"({', '.join(f'{value:.3g}' for value in np.round(n, 6) + 0.0)})"


def _pair_lines(scene: Scene, pair: Contact, own: Coupling) -> list[str]:
    """How the surfaces of a pair lie to each other before they are loaded."""
    length, size = scene.units[0], float(np.ptp(own.positions, axis=1).max(initial=0.0)) or 1.0
    total = float(own.areas.sum())
    lines = [
        f"pair '{pair.name}': {pair.friction}; {count(len(own.gap), 'contact')} by {own.kind},"
        f" area {total:.5g} {length}^2",
        f"  by {own.kind} because {own.why}",
    ]
    normals = own.frames[:, 0]
    mean = np.average(normals, axis=0, weights=own.areas)
    mean /= np.linalg.norm(mean) or 1.0
    apart = float(np.degrees(np.arccos(np.clip(normals @ mean, -1.0, 1.0))).max(initial=0.0))
    varied = "" if apart < FLAT else f", which they leave by up to {apart:.3g} degrees"
    lines.append(f"  normals from '{pair.lower}' to '{pair.upper}': {_direction(mean)}{varied}")
    touch = np.abs(own.gap) <= EQUAL * size
    gap = np.where(touch, 0.0, own.gap)
    overlap = gap < 0
    words = [f"initial gap {gap.min():.4g} to {gap.max():.4g} {length}"]
    words += [f"{touch.sum()} touch"] if touch.any() else []
    if overlap.any():
        share = float(own.areas[overlap].sum()) / total
        words.append(f"{overlap.sum()} overlap, {100 * share:.3g} % of the area")
    return [*lines, f"  {', '.join(words)}"]


def _costs(
    scene: Scene, made: Posed, options: dict[str, Any], once: bool
) -> tuple[dict[tuple[str, str], float], float]:
    """The seconds of every way that is open, and the bytes of the cheapest one."""
    works = [body.work for body in made.bodies]
    if not any(work.stiffness for work in works):
        return {}, PROCESS + 2.8e3 * made.maps[0].shape[0] / scene.dim  # bytes a point
    Q, solver = (options.get(key, "auto") for key in ("Q", "solver"))
    unknowns = round(filling(made.maps) ** 0.5)
    solvers = solvers_there() if solver == "auto" else (solver,)
    costs = estimates(works, unknowns, scene.dim, solvers, Q, once)
    if not costs:
        raise InputError(f"no way is open to Q = '{Q}' with the body solver '{solver}'.")
    way, by = min(costs, key=lambda own: costs[own])
    entries = "factors_contact_last" if way == "dense" else "factors"
    memory = PROCESS + STIFFNESS * sum(work.stiffness for work in works)
    memory += FACTORS.get(by, FACTORS["superlu"]) * sum(getattr(work, entries)[0] for work in works)
    return costs, memory + (DENSE * unknowns**2 if way == "dense" else 0.0)


def _cost_lines(costs: dict[tuple[str, str], float], memory: float, states: int) -> list[str]:
    """The estimates in words, the cheapest way first."""
    if not costs:
        return [f"cost: about {memory / 1e9:.2g} GB; products with Q by Fourier transforms"]
    first, *others = sorted(costs, key=lambda own: costs[own])
    each = ", for the first state; the others are cheaper" if states > 1 else ""
    told = [
        f"cost: about {costs[first]:.2g} s and {memory / 1e9:.2g} GB{each}",
        f"  way: {WORDS[first[0]]} ({FORM_OF[first[0]]}), bodies by {first[1]}",
    ]
    if others:
        rest = ", ".join(f"{WORDS[way]} by {by} {costs[way, by]:.2g} s" for way, by in others)
        told.append(f"  other ways: {rest}")
    return told
