"""Whether a state that was not solved slides: friction cannot bear its load, whatever sticks."""

from typing import NamedTuple

import numpy as np

from contactopt.cards import force_unit
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import contact_status
from contactopt.problem.unbalanced_loads import escape
from contactopt.scenes.scene import Scene


class Sliding(NamedTuple):
    """A free motion along which friction gives way: its name, the load along it, and the largest
    load that friction bears under the normal forces of the state before [force], nan if it bears
    the load under those.
    """

    motion: str
    load: float
    most: float


def sliding(problem: InterfaceProblem, ended: Solution, before: Solution | None) -> Sliding | None:
    """The free motion along which the load exceeds what friction can hold; None without any.

    The state `ended` without a solution; `before` is the solved state before it, if any.

    With unit displacements V of the contacts in a motion, the load along it has to meet the normal
    forces, sum V_n r_n, and the friction, at most sum b |V_t|, b the bounds of r_n.
    """
    found = None
    for own in (before, ended):
        if own is None or own.reactions.shape != problem.q.shape or not len(problem.s):
            continue
        if not np.all(np.isfinite(own.reactions)):
            continue
        V = problem.V.reshape(*problem.q.shape, -1)
        r_n = np.maximum(own.reactions[:, 0], 0.0)
        along = np.linalg.norm(V[:, 1:], axis=1)
        # ties bear any friction, but nothing along a motion that does not move them
        borne = np.broadcast_to(problem.law.bound(r_n)[:, None], along.shape)
        most = np.multiply(borne, along, out=np.zeros_like(along), where=along > 0).sum(axis=0)
        load = np.abs(problem.s + r_n @ V[:, 0])
        slips = not contact_status(problem, ended.reactions).stick.any()
        worst = int(np.argmax(load - most))
        if load[worst] > (0.9 if slips else 1.0) * most[worst] > 0:  # of what friction bears
            name = problem.motions[worst] if problem.motions else f"motion {worst + 1}"
            held = float(most[worst]) if own is before else np.nan
            found = found or Sliding(name, float(load[worst]), held)
    return found


def _unit(scene: Scene, motion: str) -> str:
    """The unit of the load along a motion: that of a force or of a moment."""
    turns = f" {scene.units[0]}" if "rotation" in motion else ""
    return f"{force_unit(scene.units)}{turns}"


def ending(before: str) -> str:
    """What a run shows of a path that ends after a state."""
    return f"; numbers and files are those of {before}"


def unheld_words(
    why: str,
    problem: InterfaceProblem,
    scene: Scene,
    last: tuple[Solution, np.ndarray],
    names: tuple[str, str],
) -> str:
    """One sentence on a state without a solution, after a solved state, by that on its load."""
    (solution, held), (state, before) = last, names
    if slid := sliding(problem, solution, solution):
        return sliding_words(slid, scene, state, before)
    told, found = "", escape(problem)
    if found is not None and problem.motions:
        number = found.strongest
        load, borne, unit = problem.s[number], held[number], _unit(scene, problem.motions[number])
        told = f"; of these {load:.6g} {unit} it held {borne:.6g} {unit} in {before}"
    return f"{state}: {why.removesuffix('.')}{told}{ending(before)}"


def sliding_words(found: Sliding, scene: Scene, state: str, before: str) -> str:
    """One sentence on a state that slides, after the state `before`, unless that is none."""
    force, most = _unit(scene, found.motion), float(f"{found.most:.3g}")
    load = f"the load along {found.motion} is {found.load:.6g} {force}"
    held = "more than friction holds"
    if before:
        held = held if np.isnan(most) else f"and it held up to about {most:.6g} {force} in {before}"
        held += ending(before)
    return (
        f"{state} slides, every touching contact slips: {load}, {held}; contactopt limit finds the"
        " load that friction bears"
    )
