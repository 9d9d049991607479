"""Does every pair of surfaces transmit a constant pressure, or say where it does not? `python -m
experiments.questions.patch_test [PAIRS [FIRST]]`.
"""

from __future__ import annotations

import logging
import sys

from experiments.questions.patch_test.judge import Verdict, judge
from experiments.questions.patch_test.pairs import pair
from experiments.report import template, write

PAIRS = 300


def report(found: list[Verdict]) -> None:
    """Write how many pairs of each kind are wrong, and how often the check speaks."""
    rows = []
    for kind in sorted({one.kind for one in found}):
        mine = [one for one in found if one.kind == kind]
        rows.append(
            {
                "pair": kind,
                "pairs": len(mine),
                "by mortar": sum(one.coupling == "mortar" for one in mine),
                "error of forces": max(one.forces for one in mine),
                "of pressures": max(one.pressure for one in mine),
                "remarks": sum(bool(one.said) and one.coupling != "refused" for one in mine),
                "refused": sum(one.coupling == "refused" for one in mine),
                "wrong": sum(one.wrong for one in mine),
            }
        )
    listed = "\n".join(
        f"- seed {one.seed}, {one.kind}, errors {one.forces:.2g} and {one.pressure:.2g}:"
        f" {'; '.join(one.said) or 'no remark'}"
        for one in found
        if one.wrong or one.said
    )
    text = template(__file__).format(
        pairs=len(found),
        wrong=sum(one.wrong for one in found),
        spoken=sum(bool(one.said) and one.coupling != "refused" for one in found),
        listed=listed or "None.",
    )
    write("patch_test", "A constant pressure on every pair of surfaces", text, {"pairs": rows}, {})


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    given = [int(word) for word in sys.argv[1:3]]
    count, first = (*given, *(PAIRS, 0)[len(given) :])
    report([judge(seed, pair(seed)) for seed in range(first, first + count)])
