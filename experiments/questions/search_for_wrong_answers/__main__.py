"""Does another way to the answer say the same? `python -m
experiments.questions.search_for_wrong_answers [SCENES [FIRST]]`.

A certificate says that the interface problem is solved. Whether this is the right problem, only
another way can say.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator

import numpy as np

from experiments.questions.search_for_wrong_answers.compare import Verdict, judge
from experiments.questions.search_for_wrong_answers.families import FAMILIES
from experiments.report import template

SCENES = 300  # ten of them suffice for a first look
TEXT = template(__file__)


def verdicts(first: int, last: int) -> Iterator[tuple[Verdict, float]]:
    """What is found for each seed, and the processor time [s] that it took."""
    names = list(FAMILIES)
    for seed in range(first, last):
        begin = time.process_time()
        verdict = judge(seed, FAMILIES[names[seed % len(names)]](np.random.default_rng(seed)))
        yield verdict, time.process_time() - begin


def report(found: list[tuple[Verdict, float]]) -> None:
    """Write how many scenes of each family disagree, and which."""
    from experiments.questions.search_for_wrong_answers.compare import SHARP
    from experiments.report import write

    rows = []
    for family in sorted({verdict.family for verdict, _ in found}):
        mine = [(verdict, seconds) for verdict, seconds in found if verdict.family == family]
        rows.append(
            {
                "family": family,
                "scenes": len(mine),
                "disagreements": sum(verdict.disagrees for verdict, _ in mine),
                "width": float(
                    np.median([width for verdict, _ in mine for width in verdict.widths or (0.0,)])
                ),
                "seconds a scene": float(np.mean([seconds for _, seconds in mine])),
            }
        )
    wrong = [verdict for verdict, _ in found if verdict.wrong]
    listed = "\n".join(
        f"- seed {each.seed}, {each.family}{', several solutions' * each.several}: "
        + "; ".join(each.wrong[:3])
        for each in wrong
    )
    seeds = [verdict.seed for verdict, _ in found]
    text = TEXT.format(
        first=min(seeds),
        last=max(seeds),
        scenes=len(found),
        count=sum(each.disagrees for each in wrong),
        many=sum(each.several for each in wrong),
        sharp=SHARP,
        listed=listed,
    )
    write("search_for_wrong_answers", "A search for wrong answers", text, {"table": rows}, {})


def main(scenes: int = SCENES, first: int = 0) -> int:
    """Solve the scenes, say what each comes to, and return 1 if any disagrees."""
    logging.disable(logging.WARNING)
    found = []
    for verdict, seconds in verdicts(first, first + scenes):
        found.append((verdict, seconds))
        word = "disagrees" if verdict.disagrees else "several solutions"
        outcome = "\n   ".join([word, *verdict.wrong]) if verdict.wrong else "agrees"
        print(f"{verdict.seed} {verdict.family}, {seconds:.1f} s: {outcome}", flush=True)
    report(found)
    return int(any(verdict.disagrees for verdict, _ in found))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:3])))
