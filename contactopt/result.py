"""The result of a run: the solution with its interface problem, the fields of the bodies, and a
summary.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import card, count, line
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.figures.output import PAGE, squeeze, write
from contactopt.problem import InterfaceProblem, Solution
from contactopt.scenes.scene import Scene
from contactopt.solving.paths import PathResult
from contactopt.solving.solve_scene import Solved

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Result:
    """A solved scene.

    `summary` is what summary.json holds; `zones` the half-widths of the contact-zone loop.

    `summary["seconds"]` holds the wall time [s] of each phase: those of the solution (see
    contactopt.solving.solve_scene), `recover` of the fields, `figures` and `files` where some were
    asked for, and `total` of the whole run.

    `path` holds all states of a scene that has a load path; the rest of the result is then that of
    the last state. `estimate` is what refinement to an asked accuracy found.
    """

    scene: Scene
    reduction: Reduction
    solution: Solution
    fields: tuple[Fields, ...]
    zones: tuple[float, ...]
    summary: dict[str, Any]
    path: PathResult | None = None
    estimate: Estimate | None = None

    def __repr__(self) -> str:
        s = self.summary
        states = "" if self.path is None else count(len(self.path.states), "state")
        contacts = count(s["contact_nodes"], "contact")
        aim = "" if self.estimate is None else repr(self.estimate)
        return line(
            "Result",
            self.scene.name,
            s["status"],
            f"residual {s['residual']:.1e}",
            contacts,
            states,
            aim,
        )

    def _repr_html_(self) -> str:
        s, (length, stress) = self.summary, self.scene.units
        rows: dict[str, object] = {
            "status": f"{s['status']}: {self.solution.message}",
            "residual (certificate)": f"{s['residual']:.2e}",
            "unknowns, contacts": f"{s['dofs']}, {s['contact_nodes']}",
            "sum of normal forces": f"{s['normal_force']:.6g} {stress} {length}^2",
            "largest pressure": f"{s['max_pressure']:.6g} {stress}",
        }
        for key in ("approach", "contact_half_width", "stick_half_width"):
            if s[key] is not None:
                rows[key.replace("_", " ")] = f"{s[key]:.6g} {length}"
        if self.estimate is not None:
            rows[self.estimate.quantity] = f"{self.estimate.value:.6g}; {self.estimate.message}"
            rows["meshes"] = "; ".join(
                f"{level.unknowns}: {level.value:.6g}" for level in self.estimate.levels
            )
        return card(f"{self.scene.name}, {self.scene.friction}", rows)

    def view(self, file: str | Path | None = None, show: bool = True) -> Path:
        """Write the result as one page to explore in a browser, and open it.

        The page needs no network and nothing but the browser (contactopt.figures.view_page says
        what is on it).

        Parameters
        ----------
        file : where to write the page, ends in .html; None: a temporary file
        show : whether to open it in the browser

        Returns
        -------
        Path : of the page

        Raises
        ------
        InputError : if plotly is not installed, which the page takes its drawing program from, or
            if the file cannot be written
        """
        import tempfile
        import webbrowser

        from contactopt.figures.view_page import write_page

        if file is None:
            file = Path(tempfile.mkdtemp(prefix="contactopt-")) / PAGE
        with tempfile.TemporaryDirectory() as folder:
            solved = Solved(self.reduction, self.solution, self.zones, self.path)
            write(solved, self.fields, Path(folder), states=True)
            (Path(folder) / "summary.json").write_text(json.dumps(self.summary))
            made = write_page(folder, file)
        if show:
            webbrowser.open(made.resolve().as_uri())
        return made

    @property
    def problem(self) -> InterfaceProblem:
        return self.reduction.problem

    @property
    def pressure(self) -> np.ndarray:
        """Contact pressure at the contact nodes, (k,) [stress]."""
        return np.asarray(self.solution.reactions[:, 0] / self.problem.areas)

    @property
    def traction(self) -> np.ndarray:
        """Tangential traction on the upper body, (k,) or in 3D (k, 2) [stress]."""
        return squeeze(self.solution.reactions[:, 1:] / self.problem.areas[:, None])
