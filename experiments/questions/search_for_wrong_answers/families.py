"""The families of random scenes, by name."""

from __future__ import annotations

from collections.abc import Callable

from experiments.questions.search_for_wrong_answers import blocks, others
from experiments.questions.search_for_wrong_answers.blocks import Random
from experiments.questions.search_for_wrong_answers.compare import Case

FAMILIES: dict[str, Callable[[Random], Case]] = {
    "blocks": blocks.stack,
    "three": lambda rng: blocks.stack(rng, 3),
    "slab": lambda rng: blocks.stack(rng, 2, "slab"),
    "space": lambda rng: blocks.stack(rng, 2, "space"),
    "crown": blocks.crown,
    "round crown": lambda rng: blocks.crown(rng, True),
    "wedge": blocks.wedge,
    "bridge": blocks.bridge,
    "floor": blocks.floor,
    "pin": others.pin,
    "fit": others.fit,
    "roller": others.roller,
    "ball": others.ball,
    "exact": others.exact,
    "heights": others.heights,
    "large": others.large,
}
