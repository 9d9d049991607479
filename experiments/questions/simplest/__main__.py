"""What may be left out of a scene before it is solved, what does that save, and which errors does
it make?
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from experiments.questions.simplest import nearly
from experiments.questions.simplest.chart import bias, chart_rows, draw_chart
from experiments.report import markdown, measure

# random scenes; the first argument may be another number, for a quick look at them alone
COUNT = 500
PARTS: dict[str, Callable[[], list[dict[str, Any]]]] = {
    "chart": chart_rows,
    "nearly": lambda: nearly.table(nearly.rows(COUNT)),
    "prices": nearly.prices,
    "bias": lambda: [{"the block's peak pressure over that of a half-plane, less one": bias()}],
}
TEXT = f"""{(__doc__ or "").strip()}

## Speed against accuracy

One scene, four models: a rigid cylinder on an elastic block, whose peak pressure Hertz knows. The
finite elements are quadratic. The block is 120 contact half-widths wide and 60 deep, and ends
there: `bias` is what that changes. Errors are root mean squares over five forces, because a mesh
can fit one force by luck; seconds are the least of the five, and those of the adaptive model are
for all its meshes together.

{{chart}}

{{bias}}

## Exact or not

{COUNT} random scenes in five kinds, most of them only nearly symmetric: by an asperity, a patch of
other friction, a ridge, a crown, a bore off the middle, a turn of the mesh, a force, a support, a
node or a material, each by a random amount from 1e-7 to .3. What `contactopt.simplify` calls exact
is compared with the whole: `proof` is the certificate that it computed itself, `certificate` that
of the reduced whole with the mirrored or drawn-out forces, `difference` the largest relative
difference of energy, approach and peak pressure from the whole's own solution. Wrong is a
difference above 1e-4.

{{nearly}}

The symmetric punches that are not called exact stand on facets half as long as their own. Mortar
integrals over surfaces whose nodes do not lie on each other treat the neighbours of the plane a
little differently in a half, by about 1e-4. The proof refuses that.

## The price of the proof

Processor seconds of the whole scene, and of its part with the proof. The proof assembles the whole
and does not solve it. This pays in space. In the plane, where assembling is most of the work, one
solve of the whole costs less than a half and its proof; a half pays where it is solved more than
once, as in a search for an accuracy.

{{prices}}
"""


def figures(tables: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    model_error = abs(float(next(iter(tables["bias"][0].values()))))
    return {"chart": draw_chart(tables["chart"], model_error)}


if __name__ == "__main__":
    if sys.argv[1:] and sys.argv[1].isdigit():  # so many scenes, for a quick look
        print(markdown(nearly.table(nearly.rows(int(sys.argv[1])))))
    else:
        measure("simplest", "The cheapest model first", TEXT, PARTS, figures)
