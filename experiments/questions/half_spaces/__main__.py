"""What does a half-space cost, and how exact is it: Hertz, Cattaneo-Mindlin, rough surfaces,
against Tamaas?

`TAMAAS=/path/to/python python -m experiments.questions.half_spaces` makes every table and the
report; names of tables, as in `python -m experiments.questions.half_spaces hertz rough`, make these
alone and the report from all that are there. Tamaas may live in an environment of its own; without
TAMAAS this Python is used if it has Tamaas. Set OMP_NUM_THREADS=1.
"""

from __future__ import annotations

from experiments.questions.half_spaces.exact import cattaneo_rows, hertz_rows
from experiments.questions.half_spaces.rough import (
    friction_rows,
    rough_rows,
    tamaas_rows,
    wavy_rows,
)
from experiments.report import measure

TEXT = """How accurate and how fast are half-spaces? Every transform has one thread. Times are CPU
seconds of the process, on a machine on which other programs ran as well. "CPU s, problem" is the
time to make the interface problem. "solve" is the time of `contactopt.solve`, with its certificate.
The tables were made one by one, while other programs ran. Therefore compare times within a table
only.

## Hertz: a rigid sphere on a half-space

The square of points is 2.5 contact radii wide. The peak is that of a parabola in r^2, fitted to p^2
within half a contact radius. The width is the zero of a line that is fitted to p^2 beyond. For nu =
.3 the largest von Mises stress on the axis is .620 p0, at the depth .481 a. It is computed from a
parabola through nine depths, at the points next to the axis.

{hertz}

## Cattaneo and Mindlin: two spheres, sheared to half of mu P

The exact formulas hold for nu = 0. For nu = .3 they neglect the friction across the shear. The
table then has the deviation from them, which converges to a limit of its own, and the distance of
both tractions to those with 128 points a radius. The loss is that of a cycle of 16 steps.

{cattaneo}

## Rough surfaces

A rigid rough surface is pressed with a mean pressure of .005 E*. It has at most 16 waves along a
side, the Hurst exponent .8, and the rms slope .1. It is not periodic. With friction it is sheared
to half of mu P, with mu = .3, and all components are coupled. The numbers of products, of Newton
steps and of their iterations are those on the finest grid. Every row is made by a process of its
own. "kB a point" is the growth of its memory, per point.

{wavy}

The number of Newton's steps hardly grows. Their iterations and the products grow slowly. But
without friction they grow by more than 30 % from 64 x 64 to 1024 x 1024 points. On the coarsest of
these grids a wave has four points only. The cause of this growth is not known.

The next two tables have at most 64 waves along a side, without friction and with it. Newton's steps
with friction went round in circles on 1024 x 1024 points of this surface, where the contacts of one
summit turned their slip about. They end since these contacts are solved by themselves
(`contactopt.methods.kernels.elimination`).

{rough}

{friction}

## Tamaas

Tamaas is another code. Its solver of Polonsky, Keer and Rey gets the same gap, load and tolerance,
and has its own stopping rule. Both codes run one after the other. The certificate of contactopt
judges both answers. The time to make the model of Tamaas is not counted. The time to make the
problem here stands beside the time of the solve.

{tamaas}
"""


TABLES = {
    "hertz": hertz_rows,
    "cattaneo": cattaneo_rows,
    "wavy": wavy_rows,
    "rough": rough_rows,
    "friction": friction_rows,
    "tamaas": tamaas_rows,
}


if __name__ == "__main__":
    measure("half_spaces", "Half-spaces: exactness, cost, and Tamaas", TEXT, TABLES)
