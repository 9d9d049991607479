"""Does the answer depend on the first mesh, and is its claimed error true? Five parts by Gmsh, six
first meshes each.

    python -m experiments.questions.first_meshes [PART ...]

With the names of parts, these are measured alone, and the report keeps the rows of the others. The
meshes know neither where the parts touch nor their shape: curved boundaries are chords, or
edges of second order, without a `curve`. References are made in another way: Lame's formulas, a
half-plane without a mesh, or a mesh that Gmsh makes fine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt import InputError, Scene
from contactopt.accuracy import refine
from contactopt.readings.quantities import find_quantity
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import solve_scene
from experiments.questions.first_meshes.parts import (
    First,
    dovetail,
    half_plane,
    lame,
    lug,
    pin_in_bush,
    press_fit,
    punch,
)
from experiments.report import merged, save, stored, write

TARGET, SECONDS = 0.02, 60.0  # accuracy asked for, and time for one search
SURE = 1e-3  # least relative error of a reference
EFFECTIVE = 0.5, 4.0
NAME, TABLE, KEYS = "first_meshes", "searches", ("part", "quantity", "first mesh", "refined")


MESHES = [
    First(size, graded, order)
    for order in (1, 2)
    for size, graded in ((1.0, False), (0.5, False), (1.0, True))
]
FINE = First(0.5, True, 2)


def values(scene: Scene, quantities: tuple[str, ...]) -> dict[str, float]:
    """Quantities of a scene on its own mesh."""
    solved = solve_scene(scene)
    return {
        name: find_quantity(name, scene).read(solved.reduction, solved.solution).value
        for name in quantities
    }


@dataclass(frozen=True)
class Case:
    """make  (first mesh, size at the contact) -> scene;   exact  quantities known in another way;
    small  for references
    """

    make: Callable[..., Scene]
    quantities: tuple[str, ...]
    small: float
    exact: Callable[[], dict[str, float]] | None = None

    def reference(self) -> tuple[dict[str, float], dict[str, float]]:
        """The references, and their relative errors, from a mesh that is twice as coarse."""
        if self.exact is not None:
            return self.exact(), dict.fromkeys(self.quantities, SURE)
        coarse, fine = (
            values(self.make(FINE, factor * self.small), self.quantities) for factor in (2, 1)
        )
        return fine, {
            name: max(abs(coarse[name] / fine[name] - 1), SURE) for name in self.quantities
        }


CASES = {
    "dovetail": Case(dovetail, ("pressure", "energy"), 0.0005),
    "lug": Case(lug, ("pressure", "energy", "von_mises:lug:contact"), 0.24),
    "press fit": Case(press_fit, ("pressure", "von_mises:shaft:bore"), 0.5, lame),
    "flat-and-rounded": Case(
        punch, ("pressure",), 0.01, lambda: values(half_plane(), ("pressure",))
    ),
    "pin in a bush": Case(pin_in_bush, ("pressure", "energy"), 0.4),
}


def rows_of(name: str) -> list[dict[str, Any]]:
    """All searches of one part."""
    case, rows = CASES[name], []
    truth, slacks = case.reference()
    for first in MESHES:
        for quantity in case.quantities:
            slack = slacks[quantity]
            for adaptive in (True, False):
                begin = time.process_time()
                row = {"part": name, "quantity": quantity, "first mesh": first.name,
                       "refined": "locally" if adaptive else "everywhere"}  # fmt: skip
                try:
                    scene = case.make(first)
                    _, found = refine(
                        [scene], quantity, TARGET, limits=Limits(seconds=SECONDS), adaptive=adaptive
                    )
                except InputError as error:
                    rows.append(row | {"said": str(error)[:60]})
                    print(rows[-1], flush=True)
                    continue
                true = abs(found.value / truth[quantity] - 1)
                claim = np.inf if found.error is None else found.error
                rows.append(
                    row
                    | {
                        "value": found.value,
                        "reference": truth[quantity],
                        "true error": true,
                        "of the reference": slack,
                        "claimed": claim,
                        "geometry": found.geometry_error,
                        "reached": found.reached,
                        "within": bool(true <= claim + slack),
                        "effectivity": claim / max(true, slack),
                        "unknowns": found.levels[-1].unknowns,
                        "seconds": time.process_time() - begin,
                        "said": "",
                    }
                )
                print(
                    {key: f"{x:.4g}" if isinstance(x, float) else x for key, x in rows[-1].items()},
                    flush=True,
                )
    return rows


def main(chosen: list[str]) -> None:
    for name in chosen:
        save(NAME, TABLE, merged(NAME, TABLE, rows_of(name), KEYS))
    report(stored(NAME, TABLE))


def report(rows: list[dict[str, Any]]) -> None:
    rows = [row | {key: row[key] == "True" for key in ("reached", "within")} for row in rows]
    done = [row for row in rows if row["value"] != ""]
    reached = [row for row in done if row["reached"]]
    # smaller errors are luck, or the reference's
    sized = [row for row in reached if row["true error"] > TARGET / 20]
    good = sum(EFFECTIVE[0] <= row["effectivity"] <= EFFECTIVE[1] for row in sized)
    missed = [
        f"{row['part']}, {row['quantity']}, {row['first mesh']}"
        for row in done
        if not row["within"]
    ]
    refused = [
        f"{row['part']}, {row['quantity']}, {row['first mesh']}: {row['said']}"
        for row in rows
        if row["said"]
    ]
    text = f"""{sum(row["within"] for row in done)} of {len(rows)} searches give an answer that
agrees with the reference within their claimed error. {len(reached)} of them reached the
target, {sum(row["within"] for row in reached)} of these agree. The effectivity, the claimed
error over the true one, lies between {EFFECTIVE[0]} and {EFFECTIVE[1]} for {good} of {len(sized)}
searches that reached the target with a true error above {TARGET / 20:g}. Smaller true errors
are luck, or those of the reference.

Outside their claims are: {"; ".join(missed) or "none"}. No answer came from:
{"; ".join(refused) or "none"}.

The pressure of the dovetail has no limit in the linearised model. Where the flank meets the
rounding, the curvature of the surface jumps. The normals there turn, and a blade that slides by u
closes the gap by u times their angle. So the gap has a kink. For a jump k of the curvature the
pressure there grows by E* k u ln 2 / (2 pi) with every halving of the elements once they are
smaller than about u. Searches that go so far say that no mesh bounds it. Their claim is then
infinite, and counts as agreeing. The reference of the dovetail, whose elements are about as large
as u there, does not show this.

Each search asked for {TARGET:g} within {SECONDS:g} s. The meshes know neither where the parts touch
nor their shape. A reference is Lame's formula, a half-plane of 8,192 points, or a mesh that Gmsh
makes fine; its error is then its difference from one that is twice as coarse.

{{searches}}
"""
    write(NAME, "First meshes", text, {TABLE: rows}, {})


if __name__ == "__main__":
    main(sys.argv[1:] or list(CASES))
