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
from experiments.report import measure, template

TEXT = template(__file__)


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
