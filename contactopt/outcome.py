"""What a run found, before anything is drawn of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import card, count, force_unit, line
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.methods.method import NATIVE
from contactopt.problem import InterfaceProblem, Solution
from contactopt.readings.resultants import resultant_words
from contactopt.scenes.scene import Scene
from contactopt.solving.paths import PathResult

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate


LENGTHS = {
    "approach": "approach of the bodies",
    "contact_half_width": "half-width of the contact",
    "stick_half_width": "half-width of the stick zone",
}


@dataclass(frozen=True, eq=False)
class Outcome:
    """A solved scene.

    `summary` is what summary.json holds; `zones` the half-widths of the contact-zone loop.

    `summary["seconds"]` holds the wall time [s] of each phase: those of the solution (see
    contactopt.solving.solve_scene), `recover` of the fields, `figures` and `files` where some were
    asked for, and `total` of the whole run.

    `path` holds all states of a scene that has a load path; the rest is then that of the last
    state. `estimate` is what refinement to an asked accuracy found.
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
        contacts, residual = count(s["contact_nodes"], "contact"), f"residual {s['residual']:.1e}"
        aim = "" if self.estimate is None else repr(self.estimate)
        return line("Result", self.scene.name, s["status"], residual, contacts, states, aim)

    def _repr_html_(self) -> str:
        notes = {f"note {n}": text for n, text in enumerate(self.summary["remarks"], 1)}
        return card(f"{self.scene.name}, {self.scene.friction}", summary_rows(self.summary) | notes)

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


def squeeze(t: np.ndarray) -> np.ndarray:
    """Drop the second axis of tangential components (k, d) where d is one, as in 2D."""
    return t[:, 0] if t.shape[1] == 1 else t


def _number(value: float | None, form: str = ".6g") -> str:
    """A number in words; None stands for one that is not finite."""
    return "unknown" if value is None else f"{value + 0.0:{form}}"


def summary_rows(summary: dict[str, Any]) -> dict[str, str]:
    """The numbers of a run in words and with units, for a terminal, a page or a notebook."""
    length, stress = summary["units"]
    newton, backends = force_unit((length, stress)), ("normal_backend", "tangential_backend")
    used = {summary[backend] for backend in backends} - {NATIVE}
    by = f" with {' and '.join(sorted(used))}" if used else ""
    rows = {
        "status": f"{summary['status']}: {summary.get('message')}",
        "residual (certificate)": _number(summary["residual"], ".2e"),
        "unknowns of the bodies": str(summary["dofs"]),
        "contacts": str(summary["contact_nodes"]),
        "friction coefficient": f"{summary['mu']:g}",
        "method": f"{summary['method']}{by}, {count(summary['outer_iterations'], 'iteration')}",
        "sum of the normal forces": f"{_number(summary['normal_force'])} {newton}",
        "largest pressure": f"{_number(summary['max_pressure'])} {stress}",
    }
    if summary["q"] == "implicit":
        rows["Q"] = f"{summary['products']} products with vectors"
    thick = summary.get("thickness")
    depth = "" if thick is None else f" at a thickness of {thick:g} {length}"
    for name, force in resultant_words(summary).items():
        pair = summary["pairs"][name]
        rows[f"contact '{name}'"] = (
            f"force on the upper body {force} {newton}; largest pressure"
            f" {_number(pair['max_pressure'])} {stress}; contact area"
            f" {_number(pair['contact_area'])} {length}^2{depth}; {pair['open']} open,"
            f" {pair['stick']} stick, {pair['slip']} slip; coupled by {pair['coupling']} because"
            f" {pair['coupled_because']}"
        )
    for key, words in LENGTHS.items():
        if summary.get(key) is not None:
            rows[words] = f"{_number(summary[key])} {length}"
    if found := summary.get("accuracy"):
        error = "unknown" if found["error"] is None else f"{found['error']:.1e}"
        rows[found["quantity"]] = (
            f"{found['value']:.6g}, estimated relative error {error}, asked for"
            f" {found['target']:g}: {found['message']}"
        )
        sizes = (str(level["unknowns"]) for level in found["levels"])
        rows["unknowns of the meshes"] = ", ".join(sizes)
    return rows
