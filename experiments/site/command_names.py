"""The names that options of the command line take, from the tables of the package.

    python -m experiments.site.command_names

writes contactopt/cli/names.json.
"""

from __future__ import annotations

import json
from pathlib import Path

from contactopt.bodies.solvers import SOLVERS
from contactopt.figures.style import FORMATS
from contactopt.linear.operators import FORMS
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.problem.laws import LAWS
from contactopt.readings.places import PLACED
from contactopt.readings.quantities import ROWS
from contactopt.scenes import PATHS, SCENES
from contactopt.scenes.material_library import library

FILE = Path(__file__).parents[2] / "contactopt" / "cli" / "names.json"


def names() -> dict[str, dict[str, str]]:
    """Argument -> the names that it takes, and what each is, if it says so; a scene may be a file,
    too, and a quantity is of a place.
    """
    paths = {name: " (load path)" for name in PATHS}
    materials = {
        name: f"E = {made.E:g} {made.stress}, nu = {made.nu:g}: {made.source}"
        for name, made in library().items()
    }
    return {
        "scene": {name: what + paths.get(name, "") for name, (_, _, what, *_) in SCENES.items()},
        "material": materials,
        "law": {name: what for name, (_, _, what) in LAWS.items()},
        "method": {name: what for name, (_, _, what) in METHODS.items()},
        "normal": dict.fromkeys(QP, ""),
        "tangential": dict.fromkeys([*QP, *CONIC], ""),
        "Q": dict.fromkeys(FORMS, ""),
        "preconditioner": {name: what for name, (_, _, what) in PRECONDITIONERS.items()}
        | {"none": ""},
        "solver": dict.fromkeys(["auto", *SOLVERS], ""),
        "quantity": dict.fromkeys([*ROWS, *PLACED], ""),
        "figures": dict.fromkeys(FORMATS, ""),
    }


if __name__ == "__main__":
    FILE.write_text(json.dumps(names(), indent=1) + "\n")
