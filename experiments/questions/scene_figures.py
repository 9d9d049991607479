"""The paper's figures 1, 2, 3a and 3b for our scenes, into reports/figures/."""

from __future__ import annotations

from contactopt import plots, run
from contactopt.figures.style import save_figure
from experiments.report import PAPER, REPORTS

if __name__ == "__main__":
    folder = REPORTS / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for name in PAPER:
        result = run(name)
        picture = plots.deformed(result.scene, result.problem, result.fields).figure
        save_figure(picture, folder / f"{name}-deformed.png")
        contact = plots.contact_figure(result.scene, result.problem, result.solution)
        save_figure(contact, folder / f"{name}-pressure.png")
