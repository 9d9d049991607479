"""What a run found, before anything is drawn of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import count, force_unit, line
from contactopt.coupling.back_to_bodies import Fields
from contactopt.coupling.reduction import Reduction
from contactopt.methods.method import NATIVE
from contactopt.problem import InterfaceProblem, Solution
from contactopt.readings.quantities import unit_of
from contactopt.readings.resultants import resultant_words
from contactopt.scenes.scene import Scene
from contactopt.solving.paths import PathResult

if TYPE_CHECKING:
    from contactopt.accuracy.estimate import Estimate


LENGTHS = {
    "approach": "approach of the bodies",
    "contact_half_width": "half-width of contact",
    "stick_half_width": "half-width of sticking",
}
SHOWN = 0.05  # share of the wall time of a run that a phase takes whose time is printed


@dataclass(frozen=True, eq=False)
class Outcome:
    """A solved scene.

    `summary` is what summary.json holds; `zones` the half-widths of the contact-zone loop.

    `summary["seconds"]` holds the wall time [s] of each phase: those of the solution (see
    contactopt.solving.solve_scene), `recover` of the fields, `figures` and `files` where some were
    asked for, and `total` of the whole run.

    `path` holds all states of a scene that has a load path; the rest is then that of the last
    state. Where a step of it was not solved, `solution` says how that step ended, and `shown` is
    the solution of the state before, whose numbers, figures and files are shown. `estimate` is what
    refinement to an asked accuracy found.
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
        return line("Result", titled(s), s["status"], residual, contacts, states, aim)

    @property
    def problem(self) -> InterfaceProblem:
        return self.reduction.problem

    @property
    def shown(self) -> Solution:
        """The solution that numbers, figures and files are of."""
        return self.solution if self.path is None else self.path.states[-1].solution

    @property
    def pressure(self) -> np.ndarray:
        """The contact pressure (k,) at the contact nodes [stress]."""
        return np.asarray(self.shown.reactions[:, 0] / self.problem.areas)

    @property
    def traction(self) -> np.ndarray:
        """The tangential traction on the upper body [stress], (k,) or in 3D (k, 2)."""
        return squeeze(self.shown.reactions[:, 1:] / self.problem.areas[:, None])


def squeeze(t: np.ndarray) -> np.ndarray:
    """Drop the second axis of tangential components (k, d) where d is one, as in 2D."""
    return t[:, 0] if t.shape[1] == 1 else t


def _number(value: float | None, form: str = ".6g") -> str:
    """A number in words; None stands for one that is not finite."""
    return "unknown" if value is None else f"{value + 0.0:{form}}"


def _measured(value: float, quantity: str, summary: dict[str, Any]) -> str:
    """The value of a quantity with its unit."""
    return f"{_number(value)} {unit_of(quantity, tuple(summary['units']))}".rstrip()


def titled(summary: dict[str, Any]) -> str:
    """The name of the scene, with the state whose numbers follow where a later one failed."""
    shown = summary.get("shown")
    return f"{summary['scene']}, {shown}, the last one solved" if shown else str(summary["scene"])


def pair_rows(summary: dict[str, Any]) -> list[tuple[str, ...]]:
    """What each pair of surfaces carries: a head, whose second lines are units, and a row a pair.

    `friction` is the sum of the sizes of all friction forces, as `normal` is that of the normal
    ones, and `of bound` says which share it is of the sum that friction could carry.
    """
    length, stress = summary["units"]
    newton = force_unit((length, stress))
    units = (stress, f"{length}^2", newton, newton, "bound", "", "", "")
    heads = ("peak", "area", "normal", "friction", "of", "stick", "slip", "open")
    rows = [("contact", *(f"{head}\n{unit}".strip() for head, unit in zip(heads, units)))]
    for name, pair in summary["pairs"].items():
        friction, bound = pair.get("friction_force"), pair.get("friction_bound")
        values = (pair["max_pressure"], pair["contact_area"], pair["normal_force"], friction)
        share = "-" if not bound or friction is None else f"{100 * friction / bound:.3g} %"
        counts = (str(pair[key]) for key in ("stick", "slip", "open"))
        rows.append((name, *(_number(value, ".5g") for value in values), share, *counts))
    return rows


def summary_rows(summary: dict[str, Any]) -> dict[str, str]:
    """The numbers of a run in words and with units: what was found, then how far to trust it."""
    length, stress = summary["units"]
    rows = {}
    if len(summary["pairs"]) == 1:
        (force,) = resultant_words(summary).values()
        rows["force on the upper body"] = f"{force} {force_unit((length, stress))}"
    for key, words in LENGTHS.items():
        if summary.get(key) is not None:
            rows[words] = f"{_number(summary[key])} {length}"
    for name, found in summary.get("quantities", {}).items():
        error = "unknown" if found["error"] is None else f"about {found['error']:.1e}"
        said = found.get("message") or f"its relative error on this mesh: {error}"
        rows[name] = f"{_measured(found['value'], name, summary)}; {said}"
    if found := summary.get("accuracy"):
        error = "unknown" if found["error"] is None else f"{found['error']:.1e}"
        rows[found["quantity"]] = (
            f"{_measured(found['value'], found['quantity'], summary)}, estimated relative error"
            f" {error}, asked for {found['target']:g}: {found['message']}"
        )
        sizes = (str(level["unknowns"]) for level in found["levels"])
        rows["unknowns of the meshes"] = ", ".join(sizes)
    return rows | _trust(summary)


def _trust(summary: dict[str, Any]) -> dict[str, str]:
    """How far an answer can be trusted, and of which model it is one."""
    backends = ("normal_backend", "tangential_backend")
    used = {summary[backend] for backend in backends} - {NATIVE}
    by = f" with {' and '.join(sorted(used))}" if used else ""
    why = "" if summary["status"] == "solved" else f" ({summary.get('message')})"
    thick = summary.get("thickness")
    products = f"{summary['products']} products with Q" if summary["q"] == "implicit" else ""
    model = (
        summary["kind"],
        "" if thick is None else f"thickness {thick:g} {summary['units'][0]}",
        f"friction coefficient {summary['mu']:g}",
        count(summary["dofs"], "unknown"),
        count(summary["contact_nodes"], "contact"),
        products,
    )
    certificate = (
        f"certificate {_number(summary['residual'], '.1e')}, {summary['method']}{by},"
        f" {count(summary['outer_iterations'], 'iteration')}"
    )
    shown = summary.get("shown")
    before = {shown: f"solved: {certificate}"} if shown else {}
    return before | {
        "status": f"{summary['status']}{why}" + ("" if shown else f": {certificate}"),
        "model": ", ".join(filter(None, model)),
    }


def remark_rows(summary: dict[str, Any]) -> dict[str, str]:
    """The remarks of a run, numbered."""
    return {f"note {n}": text for n, text in enumerate(summary.get("remarks", ()), 1)}


def time_words(summary: dict[str, Any]) -> str:
    """The wall time of a run, and of its phases that took more than SHOWN of it."""
    seconds = summary["seconds"]
    phases = [
        f"{name} {value:.2f}"
        for name, value in seconds.items()
        if name != "total" and value > SHOWN * seconds["total"]
    ]
    return f"{seconds['total']:.1f} s: {', '.join(phases)}"
