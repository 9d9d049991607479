"""The factors on a load between which friction holds the bodies.

With f times a load, u = Q r + V lambda + q + f g and V' r + s + f l = 0 (contactopt.problem): the
load adds g to the displacements at r = 0 [length] and l to the resultants [force].

1. Statics. The factors f with forces r in the friction cones K and V' r + s + f l = 0 form an
   interval, perhaps without 0, whose ends contactopt.models.static_limit finds. No f outside lets
   the bodies rest, whatever their elasticity. By the static theorem the ends are the limits where
   friction is associated. Coulomb's may be less, and where elasticity makes the normal forces, as
   in a fit or under a clamp, nothing bounds them here: the interval has no end.
2. Push. The load is replaced by a prescribed motion of the place where it acts, and f is its
   reaction. The displacement along the load is w = l' lambda + g' r + c f, with c = F' C F of the
   forces F of the load. Turn the motions so that l = |l| e_1. Then V_1' r + s_1 + |l| f = 0 gives
   f, and w = d gives lambda_1. What remains has no row and no column of either,

       Q* = Q - (v g' + g v') + c v v',   q* = q + v (d + c s_1 / |l|) / |l| - g s_1 / |l|,
       v = V_1 / |l|   (g s_1 / |l| and c s_1 / |l| from the loads that stay),

   and Q* is semidefinite because [Q g; g' c] is. After the states of the load path, d grows from
   0 by the factor GROWTH from push to push, slip measured from the push before, until f no longer
   does, by far less than with the steepest push.
   What contacts make of it that close after a motion beyond SMALL is not counted: displacements
   are taken for small, and an open corner may close in them by a turn of 2 rad.
   It grows for ever where all forces grow with d: the cones and the laws are homogeneous, so that
   nothing but what stays, however small beside it, could end that.
3. Trial. Forces of a body that locks itself balance any load, but need not arise. Where statics has
   no positive lower end and the bodies do not rest without the load, the least factor at which the
   problem is solved is found by halving.

The push gives Coulomb's limit, and the upper end of statics is confirmed or corrected by it. A
lower end of statics, which a load has that presses the bodies together, stays a bound. The error is
the difference between two meshes, of which the finer one has elements of half the size.

Source: Drucker (1954), Coulomb friction, plasticity, and limit loads, J. Appl. Mech. 21, 71-74.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.accuracy.marking import divisible, finer, with_bent_edges
from contactopt.coupling.reduction import reduce_bodies
from contactopt.errors import Unbalanced
from contactopt.holding.answer import Found, answer
from contactopt.holding.grown_load import force_of, held_states
from contactopt.holding.push import ALIKE, Note, Push
from contactopt.runner import states_of
from contactopt.scenes.scene import Scene
from contactopt.solving.follow import follow_path
from contactopt.solving.solve_scene import Options


@dataclass(frozen=True)
class Limit:
    """At which factors on a load the bodies slide away, tip over or lift off.

    factor    above which the bodies slide; infinite: they never do; not a number: no push could be
              solved
    interval  of the factors at which forces in the friction cones balance the loads. Its upper
              end is `factor`. Below its lower end the bodies slide, too, even if `factor` is
              infinite. None: the bodies rest at no factor
    error     of the factor, estimated from two meshes, as an absolute number
    way       'statics', 'bound', 'push' or 'supports', which the sentence explains
    sentence  the answer in words
    factors   on the coarser and on the finer mesh
    """

    factor: float
    interval: tuple[float, float] | None
    error: float
    way: str
    sentence: str
    factors: tuple[float, float]

    def __str__(self) -> str:
        return self.sentence


def limit(
    scene: str | Path | Scene,
    load: str | None = None,
    *,
    note: Note = lambda text: None,
    **changes: Any,
) -> Limit:
    """Find the factor on a load at which friction no longer holds the bodies.

    Parameters
    ----------
    scene : as for contactopt.run
    load : which load grows, as BODY:BOUNDARY:COMPONENT, or all those that begin with BODY or
        BODY:BOUNDARY; or BODY:body_force, or bolt:NAME. A body without a mesh has BODY:force. With
        None the loads grow that the last step of the load path changes
    note : receives progress messages
    changes : as for contactopt.run

    Returns
    -------
    Limit : the factor on the load in the last state, or on what the last step changes

    Raises
    ------
    InputError : for a load that is not there, which names those that are
    """
    return limit_of(states_of(scene, **changes)[0], load, note)


def limit_of(
    states: tuple[Scene, ...], load: str | None = None, note: Note = lambda text: None
) -> Limit:
    """As limit(), of the states of a load path."""
    held = held_states(states, load)
    found = []
    for mesh, (before, last) in enumerate(_meshes(held, states[-1]), 1):
        note(f"mesh {mesh} of 2: {last.name}")
        found.append(_on_mesh(before, last, note))
    coarse, (factor, interval, way, *_) = found[0].factor, found[-1]
    error = 0.0 if coarse == factor else abs(factor - coarse)
    words = answer(states[-1], load or "the last step", force_of(held[-1], states[-1]), found)
    return Limit(factor, interval, error, way, words, (coarse, factor))


def _meshes(held: tuple[Scene, ...], last: Scene) -> Iterator[tuple[tuple[Scene, ...], Scene]]:
    """The states and the loaded scene on a mesh and on one with elements of half the size."""
    states = (*held, last)
    if not last.given:
        for elements in (max(1, last.elements // 2), 2 * max(1, last.elements // 2)):
            *before, loaded = (replace(scene, elements=elements) for scene in states)
            yield tuple(before), loaded
        return
    made = [divisible(scene, False) for scene in states]
    shapes, scenes = made[-1][1], [scene for scene, _ in made]
    for _ in range(2):
        *before, loaded = (with_bent_edges(scene, shapes) for scene in scenes)
        yield tuple(before), loaded
        scenes = [finer(scene, None, shapes) for scene in scenes]


def _on_mesh(held: tuple[Scene, ...], last: Scene, note: Note) -> Found:
    """The limit on one mesh."""
    options = Options(Q="explicit", note=note)
    slipped: np.ndarray | float = 0.0
    rests = False
    try:
        path = follow_path(held, None, None, options)
        reduction, rests = path.reduction, path.solved
        if rests:
            slipped = path.states[-1].displacements[:, 1:]
    except Unbalanced:  # without the load nothing rests
        reduction = reduce_bodies(held[-1], Q="explicit")
    base = reduction.loaded(held[-1])
    push = Push.of(base, base.loaded(last))
    if push is None:
        return Found(np.inf, (-np.inf, np.inf), "supports")
    low, high = (push.end(largest) for largest in (False, True))
    if np.isnan(high):
        return Found(0.0, None, "statics")
    note(f"statics: {low:.6g} to {high:.6g}")
    found, far = push.force(slipped, note)
    tried = False
    if low <= 0 < high and not rests:
        least = push.least(min(1.0, found, high), note)
        tried, low = bool(least > low), max(low, least)
    if np.isnan(found) and np.isfinite(high):
        return Found(high, (low, high), "bound", tried)
    if found == high or abs(found - high) <= ALIKE * min(abs(high), abs(found)) + push.nothing:
        return Found(high, (low, high), "statics", tried)
    closes = found < high and bool(push.problem.gaps.max() > 0)
    return Found(found, (low, found), "push", tried, closes, far)
