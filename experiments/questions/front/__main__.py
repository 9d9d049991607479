"""What does accuracy cost, and which error is the largest: model, mesh, tolerance or reading?

`python -m experiments.questions.front` measures everything; with names of scenes it measures these
alone, and `figures` draws from the tables. The environment variables TAMAAS, GETFEM and KRATOS name
Pythons that have these peers.
"""

from __future__ import annotations

import sys

from experiments.questions.front.measured import measure_model
from experiments.questions.front.models import all_models
from experiments.questions.front.unseen import judged, tried, unseen
from experiments.report import merged, save

NAME, TABLE = "front", "runs"
KEYS = ("scene", "model", "mesh", "tolerance", "reading")


def main(names: list[str]) -> None:
    models = all_models()
    for model in models[:3] * 2:  # imports and caches are nobody's time
        list(measure_model(model.first))
    for scene in dict.fromkeys(model.scene for model in models):
        if names and scene not in names:
            continue
        for model in (own for own in models if own.scene == scene):
            rows = list(measure_model(model))
            save(NAME, TABLE, merged(NAME, TABLE, rows, KEYS))
            print(scene, model.name, len(rows), flush=True)
    if not names or "unseen" in names:
        rows = []
        for case in unseen():
            rows += list(tried(case))
            save(NAME, "unseen", rows)
            print(judged(rows)[-1], flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
