"""What a run found, before anything is drawn of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import card, count, line
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.problem import InterfaceProblem, Solution
from contactopt.scenes.scene import Scene
from contactopt.solving.paths import PathResult

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate


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
            levels = self.estimate.levels
            rows["meshes"] = "; ".join(f"{one.unknowns}: {one.value:.6g}" for one in levels)
        return card(f"{self.scene.name}, {self.scene.friction}", rows)

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
