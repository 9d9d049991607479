"""The paper's figures 1, 2, 3a and 3b for our scenes, into reports/figures/."""

from __future__ import annotations

from contactopt import plots, run
from experiments.report import PAPER, REPORTS

if __name__ == "__main__":
    folder = REPORTS / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for name in PAPER:
        result = run(name)
        picture = plots.deformed(result.scene, result.problem, result.fields).figure
        picture.savefig(folder / f"{name}-deformed.png", dpi=100)
        contact = plots.contact_figure(result.scene, result.problem, result.solution)
        contact.savefig(folder / f"{name}-pressure.png", dpi=100)
