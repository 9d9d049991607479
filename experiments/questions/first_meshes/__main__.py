"""Does the answer depend on the first mesh, and is its claimed error true? Five parts by Gmsh, six
first meshes each.

    python -m experiments.questions.first_meshes [PART ...] [QUANTITY ...]

With names of parts and quantities, these are measured alone, and the report keeps the other rows.
The meshes know neither where the parts touch nor their shape: curved boundaries are chords, or
edges of second order, without a `curve`. References are made in another way: Lame's formulas, a
half-plane without a mesh, or a mesh that Gmsh makes fine.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from contactopt import InputError, Scene
from contactopt.accuracy import refine
from contactopt.readings.peaks import Reading
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


def readings(scene: Scene, quantities: tuple[str, ...]) -> dict[str, Reading]:
    """Quantities of a scene on its own mesh."""
    solved = solve_scene(scene)
    return {
        name: find_quantity(name, scene).read(solved.reduction, solved.solution)
        for name in quantities
    }


@dataclass(frozen=True)
class Case:
    """make  (first mesh, size at the contact) -> scene;   exact  quantities known in another way;
    small  for references;   fine  as make, for references
    """

    make: Callable[..., Scene]
    quantities: tuple[str, ...]
    small: float
    exact: Callable[[], dict[str, float]] | None = None
    fine: Callable[..., Scene] | None = None

    def reference(self) -> dict[str, tuple[float, float]]:
        """The references and their relative errors, from a mesh that is twice as coarse, and from
        what the reading on the finer one says of itself.
        """
        if self.exact is not None:
            return {name: (value, SURE) for name, value in self.exact().items()}
        coarse, fine = (
            readings((self.fine or self.make)(FINE, factor * self.small), self.quantities)
            for factor in (2, 1)
        )
        found = {}
        for name, read in fine.items():
            off = max(abs(coarse[name].value - read.value), read.uncertainty)
            found[name] = read.value, max(off / abs(read.value), SURE)
        return found


def on_half_plane() -> dict[str, float]:
    return {"pressure": readings(half_plane(), ("pressure",))["pressure"].value}


CASES = {
    "dovetail": Case(dovetail, ("pressure", "energy"), 0.0005),
    "lug": Case(
        lug, ("pressure", "energy", "von_mises:lug:contact"), 0.24, fine=partial(lug, ends=True)
    ),
    "press fit": Case(press_fit, ("pressure", "von_mises:shaft:bore"), 0.5, lame),
    "flat-and-rounded": Case(punch, ("pressure",), 0.01, on_half_plane),
    "pin in a bush": Case(pin_in_bush, ("pressure", "energy"), 0.4),
}


def rows_of(name: str, asked: list[str]) -> list[dict[str, Any]]:
    """All searches of one part, of all of its quantities unless some are asked for."""
    case, rows = CASES[name], []
    references = case.reference()
    for first in MESHES:
        for quantity, (truth, slack) in references.items():
            if asked and quantity not in asked:
                continue
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
                true = abs(found.value / truth - 1)
                claim = np.inf if found.error is None else found.error
                rows.append(
                    row
                    | {
                        "value": found.value,
                        "reference": truth,
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


def main(names: list[str]) -> None:
    asked = [name for name in names if name not in CASES]
    for name in [name for name in names if name in CASES] or list(CASES):
        save(NAME, TABLE, merged(NAME, TABLE, rows_of(name, asked), KEYS))
    report(stored(NAME, TABLE))


def told(row: dict[str, Any]) -> str:
    return f"{row['part']}, {row['quantity']}, {row['first mesh']}, {row['refined']}"


def report(rows: list[dict[str, Any]]) -> None:
    rows = [row | {key: row[key] == "True" for key in ("reached", "within")} for row in rows]
    done = [row for row in rows if row["value"] != ""]
    reached = [row for row in done if row["reached"]]
    # smaller errors are luck, or the reference's
    sized = [
        row for row in reached if row["true error"] > max(TARGET / 20, row["of the reference"])
    ]
    small = [row for row in sized if row["effectivity"] < EFFECTIVE[0]]
    large = [row for row in sized if row["effectivity"] > EFFECTIVE[1]]
    good = len(sized) - len(small) - len(large)
    missed = [told(row) for row in done if not row["within"]]
    refused = [f"{told(row)}: {row['said']}" for row in rows if row["said"]]
    text = f"""{sum(row["within"] for row in done)} of {len(rows)} searches give an answer that
agrees with the reference within their claimed error. {len(reached)} of them reached the
target, {sum(row["within"] for row in reached)} of these agree. The effectivity, the claimed
error over the true one, lies between {EFFECTIVE[0]} and {EFFECTIVE[1]} for {good} of {len(sized)}
searches that reached the target with a true error above {TARGET / 20:g} and above that of the
reference. Smaller true errors are luck, or those of the reference.
Less is claimed of {"; ".join(map(told, small)) or "none"}. More is claimed of
{"; ".join(map(told, large)) or "none"}.

Outside their claims are: {"; ".join(missed) or "none"}. No answer came from:
{"; ".join(refused) or "none"}.

Nodes that do not match let the pressure of linear elements scatter from node to node, and the claim
holds this scatter, which may be several times the error, or what another local maximum may grow.
Where the edge of contact moves through the elements, the error changes its sign from mesh to mesh,
and a small last change may be luck: of three meshes the claim holds what order 2 leaves of the
change before. A search that refines locally claims what refinement changed of the corrected value,
too. The largest stress of the lug is at the edge of contact, where its reading is uncertain on
every mesh, also on that of the reference.

The pressure of the dovetail has no limit in the linearised model. Where the flank meets the
rounding, the curvature of the surface jumps. The normals there turn, and a blade that slides by u
closes the gap by u times their angle. So the gap has a kink. For a jump k of the curvature the
pressure there grows by E* k u ln 2 / (2 pi) with every halving of the elements once they are
smaller than about u. Searches that go so far say that no mesh bounds it. Their claim is then
infinite, and counts as agreeing. The reference of the dovetail, whose elements are about as large
as u there, does not show this.

Each search asked for {TARGET:g} within {SECONDS:g} s. The meshes know neither where the parts touch
nor their shape. A reference is Lame's formula, a half-plane of 8,192 points, or a mesh that Gmsh
makes fine; its error is then its difference from one that is twice as coarse, or what its reading
says of itself if this is more.

{{searches}}
"""
    write(NAME, "First meshes", text, {TABLE: rows}, {})


if __name__ == "__main__":
    main(sys.argv[1:])
