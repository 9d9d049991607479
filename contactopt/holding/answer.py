"""What was found on two meshes, in words."""

from typing import NamedTuple

import numpy as np

from contactopt.cards import force_unit
from contactopt.holding.push import STEADY
from contactopt.scenes.scene import Scene

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


def answer(scene: Scene, load: str, force: float | None, found: list[Found]) -> str:
    """The answer in a few sentences: both ends, whether 1 lies between them, and where they come
    from.
    """
    factor, interval, way, tried, closes, far = found[-1]
    if interval is None:
        return f"{scene.name}: the bodies {AWAY}, whatever the factor on {load} is."
    low, high = interval
    if low == high == 0:
        return f"{scene.name}: any amount of {load} makes the bodies {AWAY}: the factor is 0."
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
