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

TEXT = """Mortar coupling with dual multipliers (contactopt/interface/mortar.py), chosen by itself where nodes do not match. `a:b` are the
elements of the upper and the lower body across the contact half-width; the finer side carries the contacts unless a
column says otherwise.

## Exact to rounding

Uniform pressure across the interface, blocks with quadrilaterals or bricks, ratios of the spacings; the largest relative error of
the pressure at any contact, whichever side carries them:

{patch}

Sum of all nodal forces on both bodies, and of their moments, over the sum of the contact forces' sizes and the extent of the
bodies: of the solution, and of random contact forces on the same curved surfaces (none on planes of symmetry):

{equilibrium}

The elastic punch (mu = .2, 32:48) in other units:

{units}

## Against exact solutions

Hertz, line and point. `p in L2` is the error at the contacts, with their areas, over the norm:

{hertz}

Lame's press fit (a quarter, interference 1/200 of the radius; isoparametric elements if quadratic), with the true circles known.
There is no friction in the exact solution, whatever mu; `friction, largest` is that of any contact, over the pressure:

{press_fits}

The rigid punch on a half-space (Spence), 64 elements across, quadratic: the named scene, whose punch needs no mesh, and the same
with an elastic punch 1e7 times as stiff, whose mesh does not match:

{rigid_punch}

Cattaneo and Mindlin: cylinders pressed, then sheared in one step; root mean squares over shears, and their ratios to those of
matching meshes of 20:20. Where the meshes have nodes at the edges of stick (three shears, each with its meshes), matching nodes turn
this to account, because both bodies have the same kinks there, and the fine side does not. Nodes anywhere: four shears on
meshes made for another one.

{cattaneo}

The same in space, a sphere of linear bricks, pressed by 100 N and sheared by 30 N in one step:

{solids}

## The elastic punch

mu = .2; root mean squares of the errors of the force between the axis and a place, over its largest value, against matching
meshes of {fine} quadrilaterals of the same degree:

{elastic_punch}

## Cost

From assembled bodies to certified forces (residual 1e-8) over one direct solve of the same two bodies tied together by the same
mortar matrices, SuperLU, medians of {repeats} runs in turn on a machine with much other work; the second ratio counts CPU seconds of
both threads. Meshes, assembly and the coupling itself come before both and are counted in neither:

{costs}

## CalculiX beside

The elastic punch with 48:32 linear elements, E = 5e5, in CalculiX on the same meshes: mortar contact (hard), and
surface-to-surface penalty (1e3 E / h). Differences are of nodal forces from contactopt's, in L2, relative, on the contact
nodes of each body; times are those of one run, for contactopt with meshes and assembly, for ccx as it states them.

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
        tables[name] = rows or merged("nonmatching", name, [], ()) or [{"CalculiX": "not installed"}]
    text = TEXT.replace("{fine}", str(accuracy.FINE)).replace("{repeats}", str(cost.REPEATS))
    write("nonmatching", "Meshes that do not match", text, tables, {})


if __name__ == "__main__":
    main(sys.argv[1:])
