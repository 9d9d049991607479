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

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg as la

from contactopt.accuracy.marking import divisible, finer, with_bent_edges
from contactopt.bodies.views import energy
from contactopt.cards import force_unit
from contactopt.coupling.reduction import Reduction, reduce_bodies
from contactopt.defaults import EQUAL
from contactopt.errors import InputError, Unbalanced
from contactopt.linear.operators import dense
from contactopt.methods.driver import solve
from contactopt.problem import InterfaceProblem
from contactopt.problem.scaling import scales_of
from contactopt.runner import states_of
from contactopt.scenes.loads import Load
from contactopt.scenes.scene import Part, Scene
from contactopt.solving.follow import follow_path
from contactopt.solving.solve_scene import Options

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart

GROWTH = 4.0  # of the prescribed motion from push to push
EARLY = 6  # pushes that need not be solved while the motion is small
SMALL = 0.1  # motion over the extent of the contacts, beyond which it is not small
PUSHES = 20  # so that the last one is 1e12 times the first
STEADY = 1e-5  # relative growth of the force below which it no longer grows
ALIKE = 1e-3  # relative difference by which forces are a multiple of others, or two limits the same
AWAY = "slide away, tip over or lift off"
WAYS = {
    "statics": "the largest one that forces in the friction cones balance, confirmed by a push",
    "bound": "a bound: forces in the friction cones balance no larger one",
    "below": "a bound: forces in the friction cones balance no smaller one",
    "tried": "found by solving: below it forces that would hold the bodies do not arise",
    "push": "found by pushing the place of the load until its force no longer grew",
    "supports": "supports bear this load, whatever friction does",
}
FAR = (
    " Contacts that are open now would hold more, but only after a motion that is not small, of"
    " which displacements that are taken for small say nothing."
)
Note = Callable[[str], None]


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
    held = _held(states, load)
    found = []
    for mesh, (before, last) in enumerate(_meshes(held, states[-1]), 1):
        note(f"mesh {mesh} of 2: {last.name}")
        found.append(_on_mesh(before, last, note))
    coarse, (factor, interval, way, *_) = found[0].factor, found[-1]
    error = 0.0 if coarse == factor else abs(factor - coarse)
    words = _words(states[-1], load or "the last step", _force(held[-1], states[-1]), found)
    return Limit(factor, interval, error, way, words, (coarse, factor))


def _rows(scene: Scene) -> dict[str, tuple[float, bool]]:
    """The loads of a scene by their names BODY:BOUNDARY:COMPONENT: the value, and whether it is a
    total force.
    """
    found: dict[str, tuple[float, bool]] = {}
    for part in scene.parts:
        for load in getattr(part, "loads", ()):
            own, place = load.values(scene.components), _place(part, load)
            found |= {f"{place}:{c}".rstrip(":"): (own[c], load.total) for c in own}
        whole = getattr(part, "force", None) or {}
        found |= {f"{part.name}:force:{c}": (whole[c], True) for c in whole}
    return found


def _place(part: AnyPart, load: Load) -> str:
    """What stands before the component in the name of a load."""
    if load.shared:
        return ":".join(("bolt", *load.address(part.name)))
    return f"{part.name}:{load.boundary or 'body_force'}"


def _belongs(name: str, load: str) -> bool:
    return f"{name}:".startswith(f"{load}:")


def _held(states: tuple[Scene, ...], load: str | None) -> tuple[Scene, ...]:
    """The states that are followed before the load grows, which has no share in them."""
    last = states[-1]
    rows = [name for name, (value, _) in _rows(last).items() if value]
    listed = f"its loads are {', '.join(rows) or 'none'}"
    if load is None:
        before = [i for i, own in enumerate(states) if own.state != last.state]
        if len(states) < 2:
            raise InputError(f"scene '{last.name}': name the load that grows; {listed}.")
        return states[: (before[-1] if before else 0) + 1]
    if not any(_belongs(name, load) for name in rows):
        raise InputError(f"scene '{last.name}' has no load '{load}'; {listed}.")
    return tuple(_without(scene, load) for scene in states)


def _without(scene: Scene, load: str) -> Scene:
    """The scene with zero in place of a load."""

    def left(name: str, own: Mapping[str, float]) -> dict[str, float]:
        return {c: 0.0 if _belongs(f"{name}:{c}", load) else own[c] for c in own}

    def eased(name: str, own: Load) -> Load:
        return own.with_values(left(name, own.values(scene.components)))

    def changed(part: Any) -> Any:
        if isinstance(part, Part):
            loads = (eased(_place(part, own), own) for own in part.loads)
            return replace(part, loads=tuple(loads))
        return replace(part, force=part.force and left(f"{part.name}:force", part.force))

    return scene.with_parts(changed)


def _force(held: Scene, last: Scene) -> float | None:
    """The force that the factor 1 stands for, where one total force is all of the load."""
    before = _rows(held)
    found = [(v - before.get(name, (0.0,))[0], total) for name, (v, total) in _rows(last).items()]
    changed = [(value, total) for value, total in found if value]
    return changed[0][0] if len(changed) == 1 and changed[0][1] else None


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


class Found(NamedTuple):
    """The limit on one mesh: factor, interval and way as in Limit.

    tried   whether the lower end was found by trial
    closes  whether contacts that are open when the bodies slide away may stop them
    far     whether they would hold more after a motion that is not small
    """

    factor: float
    interval: tuple[float, float] | None
    way: str
    tried: bool = False
    closes: bool = False
    far: bool = False


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
    push = _Push.of(base, base.loaded(last))
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


@dataclass(frozen=True, eq=False)
class _Push:
    """The problem at f = 0, and g (k dim,), l (p,) and c of the head of this module."""

    problem: InterfaceProblem
    g: np.ndarray
    load: np.ndarray
    c: float

    @classmethod
    def of(cls, base: Reduction, loaded: Reduction) -> _Push | None:
        """From the reduced scene without and with the load; None if it moves nothing freely."""
        load = loaded.problem.s - base.problem.s
        size = np.abs([loaded.problem.s, base.problem.s]).max(initial=0.0)
        if not np.abs(load).max(initial=0.0) > EQUAL * size:
            return None
        bodies = zip(base.bodies, loaded.bodies)
        work = [
            2 * energy(old, moved := new.at_rest - old.at_rest, 0 * moved) for old, new in bodies
        ]
        return cls(base.problem, (loaded.problem.q - base.problem.q).ravel(), load, sum(work))

    @property
    def nothing(self) -> float:
        """The factor on the load that is rounding beside the loads that stay."""
        return float(EQUAL * (1 + np.abs(self.problem.s).sum() / np.linalg.norm(self.load)))

    def end(self, largest: bool) -> float:
        """An end of the interval of statics, infinite if it has none; not a number if it is
        empty.
        """
        import cvxpy as cp

        from contactopt.models.static_limit import static_limit

        made = static_limit(self.problem, self.load, largest)
        made.problem.solve(solver=cp.CLARABEL)
        if made.problem.status in ("infeasible", "infeasible_inaccurate"):
            return np.nan
        if made.problem.status in ("unbounded", "unbounded_inaccurate"):
            return np.inf if largest else -np.inf
        found = float(made.variables["f"].value)
        return 0.0 if abs(found) <= 1e2 * self.nothing else found

    def rests(self, f: float) -> bool:
        """Whether the problem with f times the load is solved."""
        old = self.problem
        q = old.q + f * self.g.reshape(old.q.shape)
        try:
            return bool(solve(old.altered(q=q, s=old.s + f * self.load)).solved)
        except Unbalanced:
            return False

    def least(self, upper: float, note: Note) -> float:
        """The least positive f with a solution, by halving below one that has it; minus infinity
        if none is found.
        """
        first = (upper * share for share in (0.999, 0.9, 0.4))
        low, high = 0.0, next((f for f in first if self.rests(f)), 0.0)
        while high - low > ALIKE / 10 * high and high > self.nothing:
            middle = (low + high) / 2
            low, high = (low, middle) if self.rests(middle) else (middle, high)
            note(f"trial: {low:.6g} to {high:.6g}")
        return high if low > 0 else -np.inf

    def force(self, slipped: np.ndarray | float, note: Note) -> tuple[float, bool]:
        """The largest f while motions are small, infinite if it grows for ever, not a number if a
        push is not solved; and whether it grows again when they are not.
        """
        old, size = self.problem, float(np.linalg.norm(self.load))
        turn = la.qr(self.load[:, None])[0]
        turn[:, 0] = self.load / size
        V, s = old.V @ turn, turn.T @ old.s
        v, g, rest = V[:, 0] / size, self.g, s[0] / size
        Q = dense(old.Q) - np.outer(v, g) - np.outer(g, v) + self.c * np.outer(v, v)
        q = old.q + (v * self.c * rest - g * rest).reshape(old.q.shape)
        pushed = old.altered(V=V[:, 1:], s=s[1:], Q=Q, q=q, motions=())
        loaded = old.altered(s=np.abs(old.s) + np.abs(self.load))
        first = size * max(scales_of(own).length for own in (old, loaded))
        d, f, r, start, steepest, still = 0.0, np.nan, np.zeros(q.shape), None, 0.0, np.nan
        bound, at_first = SMALL * np.ptp(old.coordinates, axis=1).max(), None
        for push in range(PUSHES):
            q_d = q + d * v.reshape(q.shape)
            step = q_d.copy()
            step[:, 1:] -= slipped
            now = solve(pushed.altered(q=step), start=start)
            if not now.solved:
                note(f"push {push + 1}: {now.message}")
                if start is None and push < EARLY:  # where nothing rests without the load
                    d = GROWTH * d or first
                    continue
                return np.nan, False
            before, f, last, r = f, -float(v @ now.reactions.ravel()) - rest, r, now.reactions
            f = f if abs(f) > self.nothing else 0.0
            note(f"push {push + 1}: {f:.6g} times the load")
            slope = abs(f - before) / ((1 - 1 / GROWTH * (push > 1)) * d or np.inf)
            steepest = np.fmax(steepest, slope)
            small = STEADY * abs(f) + self.nothing
            if abs(f - before) <= small and (slope <= ALIKE * steepest or abs(f) <= small):
                return max(f, before), False
            if f - still > ALIKE * abs(f) + self.nothing:
                return still, True
            if push > 1 and np.linalg.norm(r - GROWTH * last) <= ALIKE * np.linalg.norm(r):
                break
            u = pushed.altered(q=q_d).displacements(r, now.multipliers)
            at_first = u if at_first is None else at_first
            far = np.linalg.norm(u - at_first, axis=1).max() > bound
            still = f if far and abs(f - before) <= small else np.nan
            slipped, start, d = u[:, 1:], now, GROWTH * d or first
        return np.inf, False


def _words(scene: Scene, load: str, force: float | None, found: list[Found]) -> str:
    """The answer in a few sentences: both ends, whether 1 lies between them, whence they come."""
    factor, interval, way, tried, closes, far = found[-1]
    if interval is None:
        return f"{scene.name}: the bodies {AWAY}, whatever the factor on {load} is."
    low, high = interval
    if low == high == 0:
        return f"{scene.name}: any {load} makes the bodies {AWAY}: the factor is 0."
    why = WAYS["supports"] if way == "supports" else "its friction grows with the load"
    if np.isinf([low, high]).all():
        which = "factor" if way == "supports" else "positive factor"
        return f"{scene.name}: no {which} on {load} makes the bodies {AWAY}: {why}."
    given = "friction can hold them" if low <= 1 <= high else "they do"
    given += ", unless contacts that are open now stop them" if closes and high < 1 else ""
    if np.abs(np.array(interval) - 1).min() <= STEADY:
        given = "they are at the limit"
    below = f"below {low:.5g} times "
    if np.isnan(factor):
        unknown = f"{scene.name}: the limit of {load} is unknown, because a push was not solved; -v"
        at_one = f"; at 1, the load as given, {given}" if low > 1 else ""
        also = f" The bodies {AWAY} {below}it{at_one}." if low > 0 else ""
        return f"{unknown} says which.{also}"
    total = "" if force is None else f" ({factor * force:.5g} {force_unit(scene.units)})"
    below_by = WAYS["tried" if tried else "below"]
    sources = [f"the lower end is {below_by}"] if np.isfinite(low) else []
    if factor == np.inf:
        ends = f"{below}{load}, and at no larger factor: {why}"
    else:
        sources = [f"the upper end is {WAYS[way]}", *sources]
        other = f", and {below}it" if np.isfinite(low) else ""
        ends = f"above {factor:.5g} times {load}{total}{other}"
    source = "; ".join(sources).capitalize()
    return (
        f"{scene.name}: the bodies {AWAY} {ends}. At 1, the load as given, {given}. {source};"
        f" {_apart(found)}.{FAR if far else ''}"
    )


def _apart(found: list[Found]) -> str:
    """By how much the ends on two meshes differ, in words."""
    coarse, fine = found[0].interval, found[-1].interval
    ends = [(a, b) for a, b in zip(coarse or (np.nan, np.nan), fine or ()) if np.isfinite(b)]
    most = np.max([abs(a - b) / abs(b) if b else np.inf for a, b in ends if a != b], initial=0.0)
    if not np.isfinite(most):
        return "a coarser mesh gives another answer, so that this one is uncertain"
    if most <= STEADY:
        return f"two meshes differ by less than {100 * STEADY:g} %"
    return f"two meshes differ by {100 * most:.1g} %"
