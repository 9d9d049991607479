"""Does another way to the answer say the same? `python -m
experiments.questions.search_for_wrong_answers [SCENES [FIRST]]`.

A certificate says that the interface problem is solved. Whether this is the right problem, only
another way can say.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable

import numpy as np

from experiments.questions.search_for_wrong_answers import blocks, round_bodies
from experiments.questions.search_for_wrong_answers.compare import Case, Verdict, judge
from experiments.report import template, write

SCENES = 120  # ten of them suffice for a first look
FAMILIES: tuple[Callable[[np.random.Generator], Case], ...] = (
    blocks.stack,
    lambda rng: blocks.stack(rng, 3),
    blocks.bridge,
    lambda rng: round_bodies.pressed(rng, "roller"),
    lambda rng: round_bodies.pressed(rng, "ball"),
    lambda rng: round_bodies.pressed(rng, "pin"),
)


def verdict(seed: int) -> Verdict:
    """What is found for a seed."""
    return judge(seed, FAMILIES[seed % len(FAMILIES)](np.random.default_rng(seed)))


def report(found: list[tuple[Verdict, float]]) -> None:
    """Write how many scenes of each family disagree, and which."""
    rows = []
    for family in dict.fromkeys(verdict.family for verdict, _ in found):
        mine = [(verdict, seconds) for verdict, seconds in found if verdict.family == family]
        widths = [width for verdict, _ in mine for width in verdict.widths or (0.0,)]
        rows.append(
            {
                "family": family,
                "scenes": len(mine),
                "disagreements": sum(bool(verdict.wrong) for verdict, _ in mine),
                "width": float(np.median(widths)),
                "seconds a scene": float(np.mean([seconds for _, seconds in mine])),
            }
        )
    wrong = [verdict for verdict, _ in found if verdict.wrong]
    listed = "\n".join(
        f"- seed {each.seed}, {each.family}: " + "; ".join(each.wrong[:3]) for each in wrong
    )
    seeds = [verdict.seed for verdict, _ in found]
    text = template(__file__).format(
        first=min(seeds),
        last=max(seeds),
        scenes=len(found),
        count=len(wrong),
        model=round_bodies.MODEL,
        listed=listed,
    )
    write("search_for_wrong_answers", "A search for wrong answers", text, {"table": rows}, {})


def main(scenes: int = SCENES, first: int = 0) -> int:
    """Solve the scenes, say what each comes to, and return 1 if any disagrees."""
    logging.disable(logging.WARNING)
    found = []
    for seed in range(first, first + scenes):
        begin = time.process_time()
        one = verdict(seed)
        found.append((one, time.process_time() - begin))
        outcome = "\n   ".join(["disagrees", *one.wrong]) if one.wrong else "agrees"
        print(f"{seed} {one.family}, {found[-1][1]:.1f} s: {outcome}", flush=True)
    if scenes >= SCENES:
        report(found)
    return int(any(one.wrong for one, _ in found))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])))
