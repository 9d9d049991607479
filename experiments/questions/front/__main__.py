"""What does accuracy cost, and which error is the largest: model, mesh, tolerance or reading?

`python -m experiments.questions.front` measures everything, which takes half an hour of one core;
with the names of scenes or tables it measures these alone, and `figures` draws from the tables. The
environment variables TAMAAS and GETFEM name Pythons that have these peers.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from typing import Any

from experiments.questions.front.draw import (
    draw_front,
    draw_line,
    draw_regions,
    draw_rule,
    front,
)
from experiments.questions.front.measured import Row, measure_model
from experiments.questions.front.models import all_models
from experiments.questions.front.peers import peers
from experiments.questions.front.regions import regions
from experiments.questions.front.unseen import SEEDS, judged, tried, unseen
from experiments.report import (
    figures_alone,
    markdown,
    merged,
    save,
    save_figures,
    stored,
    template,
    write,
)

NAME, TABLE = "front", "runs"
KEYS = ("scene", "model", "mesh", "tolerance", "reading")
OTHERS: dict[str, Callable[[], list[Row]]] = {
    "regions": regions,
    "unseen": lambda: [row for seed in SEEDS for case in unseen(seed) for row in tried(case, seed)],
    "rule": lambda: list(judged(stored(NAME, "unseen"))),
    "peers": lambda: list(peers()),
}


def measure_scenes(names: list[str]) -> None:
    """All models of some scenes, or of all; each model is written once it is measured."""
    models = all_models()
    for model in models[:2] * 2:  # imports and caches are nobody's time
        list(measure_model(model.first))
    for model in models:
        if not names or model.scene in names:
            save(NAME, TABLE, merged(NAME, TABLE, list(measure_model(model)), KEYS))
            print(model.scene, model.name, flush=True)


def figures(made: dict[str, list[Row]]) -> dict[str, Any]:
    """One figure for each finding."""
    return {
        "front": draw_front(made["front"]),
        "line": draw_line(made[TABLE], made["peers"]),
        "regions": draw_regions(made["regions"]),
        "rule": draw_rule(made["rule"]),
    }


def report(made: dict[str, list[Row]]) -> None:
    """The report, whose numbers are those of the tables."""
    rule = made["rule"]
    good = [row for row in rule if row["meets"] == "yes" and row["ratio"] <= 2]
    missed = [row for row in rule if row not in good]
    words = ", ".join(
        f"{row['scene']} ({row['quantity']}: {100 * row['rule error']:.2g} %,"
        f" {row['ratio']:.2g} times the best)"
        for row in missed
    )
    one = [row for row in made["front"] if row["accuracy"] == 0.01]
    most = {
        kind: max(row["cpu"] for row in one if row["with"] == kind)
        for kind in ("all models", "meshes")
    }
    runs = Counter((row["seed"], row["scene"]) for row in made["unseen"])
    before = stored(NAME, "before")  # by the rule that did not know the share of stick
    text = template(__file__).format(
        good=len(good),
        count=len(rule),
        accurate=sum(row["meets"] == "yes" for row in rule),
        before=len(before),
        before_good=sum(r["meets"] == "yes" and r["ratio"] <= 2 for r in before),
        strict=sum(row["meets"] == "yes" and row["lucky ratio"] <= 2 for row in rule),
        meshes_tried=f"{min(runs.values())} to {max(runs.values())}",
        missed=words or "none",
        most=most["all models"],
        meshes=most["meshes"],
        runs=len(made[TABLE]),
    )
    for name in ("front", "rule", "peers"):
        text = text.replace(f"[{name}]", markdown(made[name]))
    write(NAME, "What accuracy costs", text, {}, figures(made))


def main(names: list[str]) -> None:
    asked = [name for name in names if name in OTHERS]
    if not figures_alone():
        if not names or len(asked) < len(names):
            measure_scenes([name for name in names if name not in OTHERS])
        for name in asked or (() if names else OTHERS):
            save(NAME, name, OTHERS[name]())
    made = {name: stored(NAME, name) for name in (TABLE, *OTHERS)}
    if not all(made.values()):
        return
    made |= {"front": front(made[TABLE])}
    save(NAME, "front", made["front"])
    if figures_alone():
        save_figures(NAME, figures(made))
    else:
        report(made)


if __name__ == "__main__":
    main(sys.argv[1:])
