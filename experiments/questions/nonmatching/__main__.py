"""Do meshes that do not match give the same answers as meshes that do?"""

from __future__ import annotations

import logging

from experiments.questions.nonmatching import accuracy, exact
from experiments.report import measure

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

## Against exact solutions

The first table has Lame's press fit: a quarter of it, with an interference of 1/200 of the radius.
Quadratic elements are isoparametric, and the true circles are known. There is no friction in the
exact solution, whatever mu is. `friction, largest` is the largest friction of any contact, over the
pressure:

{press_fits}

The second table has Cattaneo and Mindlin: cylinders are pressed, and then sheared in one step.
Errors are root mean squares over several shears, with their ratios to those of matching meshes of
20:20. In some rows the meshes have nodes at the edges of stick (three shears, each with its own
meshes). Matching nodes gain from this, because both bodies have their kinks there, and a finer side
does not. In the rows `anywhere` there are four shears, on meshes that were made for another shear.

{cattaneo}
"""


TABLES = {
    "patch": exact.patch_tests,
    "equilibrium": exact.equilibrium,
    "press_fits": accuracy.press_fits,
    "cattaneo": accuracy.cattaneo,
}


if __name__ == "__main__":
    logging.disable(logging.WARNING)  # press fits overlap on purpose
    measure("nonmatching", "Meshes that do not match", TEXT, TABLES)
