"""Whether a state that was not solved slides: friction cannot bear its load, whatever sticks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from contactopt.cards import force_unit
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.contact_status import contact_status
from contactopt.scenes.scene import Scene

NEAR = 0.9  # share of what friction bears from which on a state without a sticking contact slides


class Sliding(NamedTuple):
    """A free motion along which friction gives way: its name, the load along it, and the largest
    load that friction bears under the normal forces [force].
    """

    motion: str
    load: float
    most: float


def sliding(problem: InterfaceProblem, ended: Solution, before: Solution | None) -> Sliding | None:
    """Find the free motion along which the load is more than friction bears, in a state that ended
    without a solution, after a solved one, if any. None where friction may bear all of it.

    With unit displacements V of the contacts in a motion, the load s along it has to meet the
    normal forces r_n, sum V_n r_n, and the friction, which makes at most sum b |V_t| with the
    bounds b of r_n.
    """
    found = None
    for own in (before, ended):
        if own is None or own.reactions.shape != problem.q.shape or not len(problem.s):
            continue
        if not np.all(np.isfinite(own.reactions)):
            continue
        V = problem.V.reshape(*problem.q.shape, -1)
        r_n = np.maximum(own.reactions[:, 0], 0.0)
        slip, bound = np.linalg.norm(V[:, 1:], axis=1), problem.law.bound(r_n)[:, None]
        # a tie has no bound, and bears nothing of a motion without slip
        most = np.multiply(bound, slip, out=np.zeros_like(slip), where=slip > 0).sum(axis=0)
        load = np.abs(problem.s + r_n @ V[:, 0])
        slips = not contact_status(problem, ended.reactions).stick.any()
        worst = int(np.argmax(load - most))
        if load[worst] > (NEAR if slips else 1.0) * most[worst] > 0:
            name = problem.motions[worst] if problem.motions else f"motion {worst + 1}"
            found = found or Sliding(name, float(load[worst]), float(most[worst]))
    return found


def sliding_words(found: Sliding, scene: Scene, state: str, before: str) -> str:
    """One sentence on a state that slides, after the state `before`; without one the forces are
    known too badly to say what friction holds.
    """
    force, most = force_unit(scene.units), float(f"{found.most:.3g}")
    load = f"the load along {found.motion} is {found.load:.6g} {force}"
    held = "more than friction holds"
    if before:
        held = (
            f"and it held up to about {most:.6g} {force} in {before}; numbers and files are those"
            f" of {before}"
        )
    return f"{state} slides, every touching contact slips: {load}, {held}"
