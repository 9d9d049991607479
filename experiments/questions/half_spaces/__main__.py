"""What does a half-space cost, and how exact is it: Cattaneo and Mindlin, rough surfaces?

`python -m experiments.questions.half_spaces` makes every table and the report; names of tables, as
in `python -m experiments.questions.half_spaces cattaneo rough`, make these alone and the report
from all that are there.
"""

from __future__ import annotations

from experiments.questions.half_spaces.exact import cattaneo_rows
from experiments.questions.half_spaces.rough import friction_rows, rough_rows, wavy_rows
from experiments.report import measure, template

TEXT = template(__file__)


TABLES = {
    "cattaneo": cattaneo_rows,
    "wavy": wavy_rows,
    "rough": rough_rows,
    "friction": friction_rows,
}


if __name__ == "__main__":
    measure("half_spaces", "Half-spaces: exactness and cost", TEXT, TABLES)
