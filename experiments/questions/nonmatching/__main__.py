"""Do meshes that do not match give the same answers as meshes that do, and at what cost?"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

from experiments.questions.nonmatching import accuracy, beside, cost, exact  # noqa: E402
from experiments.report import merged, write  # noqa: E402

TEXT = """How accurate is contact between meshes whose nodes do not match? contactopt chooses a
mortar coupling with dual multipliers for them (`contactopt/coupling/mortar.py`). In the tables
`a:b` are the numbers of elements of the upper and of the lower body across the contact half-width.
The finer side carries the contacts, unless a column says otherwise.

## Exact to rounding

A uniform pressure crosses the interface between blocks of quadrilaterals or bricks. The last three
columns are ratios of the spacings. The table has the largest relative error of the pressure at any
contact, whichever side carries the contacts:

{patch}

The next table has the sum of all nodal forces on both bodies, and of their moments. Both are
relative to the sum of the sizes of the contact forces and to the extent of the bodies. The columns
`solved` are for the solution. The columns `random forces` are for random contact forces on the same
curved surfaces, with none on planes of symmetry:

{equilibrium}

The elastic punch (mu = .2, 32:48) in other units:

{units}

## Against exact solutions

The first table has Hertz contact, of a line and of a point. `p in L2` is the error of the pressure
at the contacts, weighted with their areas, over the norm of the pressure:

{hertz}

The second table has Lame's press fit: a quarter of it, with an interference of 1/200 of the radius.
Quadratic elements are isoparametric, and the true circles are known. There is no friction in the
exact solution, whatever mu is. `friction, largest` is the largest friction of any contact, over the
pressure:

{press_fits}

The third table has the rigid punch on a half-space (Spence), with 64 quadratic elements across. It
compares the named scene, whose punch needs no mesh, with an elastic punch that is 1e7 times as
stiff and has a mesh that does not match:

{rigid_punch}

The fourth table has Cattaneo and Mindlin: cylinders are pressed, and then sheared in one step.
Errors are root mean squares over several shears, with their ratios to those of matching meshes of
20:20. In some rows the meshes have nodes at the edges of stick (three shears, each with its own
meshes). Matching nodes gain from this, because both bodies have their kinks there, and a finer side
does not. In the rows `anywhere` there are four shears, on meshes that were made for another shear.

{cattaneo}

The same in three dimensions, for a sphere of linear bricks that is pressed by 100 N and sheared by
30 N in one step:

{solids}

## The elastic punch

Here mu = .2. The error is that of the force between the axis and a place, over its largest value.
The table has its root mean square. The reference has matching meshes of {fine} quadrilaterals of
the same degree:

{elastic_punch}

## Cost

The time from assembled bodies to certified forces (residual 1e-8) is compared with that of one
direct solve of the same two bodies, tied together by the same mortar matrices. The solver is
SuperLU. Times are medians of {repeats} runs in turn, on a machine with much other work. The second
ratio counts the CPU seconds of both threads. Meshes, assembly and the making of the coupling come
before both, and are counted in neither:

{costs}

## CalculiX beside

The elastic punch has 48:32 linear elements and E = 5e5. CalculiX (ccx) has the same meshes, with
hard mortar contact and with surface-to-surface penalty contact (1e3 E / h). The table has the
relative differences of its nodal forces from those of contactopt, in L2, on the contact nodes of
each body. Times are those of one run. The time of contactopt includes meshes and assembly, and the
time of ccx is the one that it states.

{beside}
"""


TABLES: dict[str, Callable[[], list[dict[str, Any]]]] = {
    "patch": exact.patch_tests,
    "equilibrium": exact.equilibrium,
    "units": exact.units,
    "hertz": accuracy.hertz,
    "press_fits": accuracy.press_fits,
    "rigid_punch": accuracy.rigid_punch,
    "cattaneo": accuracy.cattaneo,
    "solids": accuracy.solids,
    "elastic_punch": accuracy.elastic_punch,
    "costs": cost.costs,
    "beside": beside.beside,
}


def main(names: list[str]) -> None:
    """Measure the tables of these names, or all; the others are those of the last report."""
    logging.disable(logging.WARNING)  # press fits overlap on purpose
    tables = {}
    for name, measure in TABLES.items():
        rows = measure() if name in names or not names else []
        tables[name] = (
            rows or merged("nonmatching", name, [], ()) or [{"CalculiX": "not installed"}]
        )
    text = TEXT.replace("{fine}", str(accuracy.FINE)).replace("{repeats}", str(cost.REPEATS))
    write("nonmatching", "Meshes that do not match", text, tables, {})


if __name__ == "__main__":
    main(sys.argv[1:])
