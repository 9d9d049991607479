"""What may be left out of a scene before it is solved, what does that save, and which errors does it make?"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

from experiments.questions.simplest.chart import bias, chart_rows, draw_chart
from experiments.questions.simplest.found import found_rows, size_rows, spoilt_rows
from experiments.report import REPORTS, write

FOLDER = REPORTS / "simplest"
PARTS: dict[str, Callable[[], list[dict[str, Any]]]] = {
    "chart": chart_rows,
    "found": found_rows,
    "spoilt": spoilt_rows,
    "sizes": size_rows,
    "bias": lambda: [{"the block's peak pressure over that of a half-plane, less one": bias()}],
}
TEXT = f"""{(__doc__ or "").strip()}

## Speed against accuracy

One scene, four models: a rigid cylinder on an elastic block, whose peak pressure Hertz knows. The finite elements are quadratic. The
block is 120 contact half-widths wide and 60 deep, and ends there: `bias` is what that changes. Errors are root mean squares over
five forces, because a mesh can fit one force by luck; seconds are the least of the five, and those of the adaptive model are for
all its meshes together.

{{chart}}

{{bias}}

## What was found

`contactopt.simplify` was asked about scenes of the library and about meshes that nobody prepared. `error said` is what the report of
the scene says; the other errors are measured against the whole scene on its own mesh. Simplifications of one scene follow each
other, so that the last exact one contains those above it. Half-spaces are measured against the largest nodal pressure of the whole
scene, whose own mesh makes most of that difference; the last table has fine meshes. The pressure of the pillar is infinite at its
edge, and so a number of the mesh alone. `search` is the processor time of `simplify`, with its coarse solves: more
than one solve of a small scene. It pays where a scene is refined, or solved more than once.

{{found}}

## What was not found

Scenes that look symmetric and are not. What spoils the symmetry is said where the bodies themselves are symmetric.

{{spoilt}}

## Half-planes instead of blocks and cylinders

The estimate is .5 (a / L)^2 + .15 s^2 and the misfit of the gap, with a the contact half-width, L the distance to the end of the
bodies and s the slope of the gap at the edge of the contact; half-spaces are offered up to an estimate of 5 %.

{{sizes}}
"""


def main(chosen: list[str]) -> None:
    """Measure the chosen parts, or all, and write the report once all are known."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    kept = FOLDER / "parts.json"
    tables = json.loads(kept.read_text()) if kept.exists() else {}
    for name in chosen or PARTS:
        if name != "report":
            tables[name] = PARTS[name]()
            kept.write_text(json.dumps(tables, indent=1, default=float) + "\n")
    if set(PARTS) <= set(tables):
        model_error = abs(float(next(iter(tables["bias"][0].values()))))
        write("simplest", "The cheapest model first", TEXT, tables, {"chart": draw_chart(tables["chart"], model_error)})


if __name__ == "__main__":
    main(sys.argv[1:])
