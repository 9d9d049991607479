"""How a solve ended: status, last iterate, certificate, history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from contactopt.cards import card, count, line
from contactopt.linear.stacked import Stacked
from contactopt.problem.feasibility import Infeasible


class Status(StrEnum):
    """How a solve ended: a word for tables, which it is equal to, and a sentence for people."""

    label: str
    sentence: str

    SOLVED = "solved", "the natural-map residual is at most the tolerance"
    SETTLED = (
        "settled",
        "the method ended by its own criterion, but the certificate is above the tolerance",
    )
    ITERATION_LIMIT = (
        "iteration_limit",
        "the iterations ran out with the certificate above the tolerance",
    )
    TIME_LIMIT = "time_limit", "the time ran out with the certificate above the tolerance"
    CYCLING = "cycling", "the iteration came back to an earlier state, so it does not converge"
    STALLED = "stalled", "the iterate no longer changes, but the certificate is above the tolerance"
    DIVERGED = "diverged", "the iterates grew without bound; the last finite one is kept"
    INFEASIBLE = "infeasible", "the problem has no solution, which is proved"
    BACKEND_FAILED = "backend_failed", "a QP or conic backend failed"

    def __new__(cls, label: str, sentence: str) -> Status:
        made = str.__new__(cls, label)
        made._value_ = made.label = label
        made.sentence = sentence
        return made


@dataclass(frozen=True, eq=False)
class Solution:
    """Where a solve ended, whatever the status: the last iterate, of `auto` the best one.

    reactions    (k, dim) nodal forces on the upper body, normal first [force]
    multipliers  (p,) displacements lambda of the plates [length]
    residual     the certificate: natural_map_residual(problem, reactions, multipliers)
    history      one mapping per outer iteration: residual, change (of the tangential force),
                 seconds and, where Q is an operator, products, the method's products with Q so far
    seconds      phase -> seconds of wall time. "solve": of the method; "certificate": of judging
                 its iterates; "checks": of input, scaling and proofs. Who adds a phase of their
                 own names it: recovery, the coarse meshes before this one, the phases of a
                 reduction
    notes        sentences about what was unexpected in the solve: a fallback, a stage
                 that failed. The one that says that the forces of few contacts are nearly not
                 unique is made at the first reading, since it costs more than the solve
    proof        status `infeasible`: what proves that there is no solution
    displacements  of the bodies that are solved by iteration, from methods that work on them (the
                   unknowns X of
                 contactopt.linear.saddle_point) [length]; None from all others
    """

    reactions: np.ndarray
    multipliers: np.ndarray
    status: Status
    residual: float
    iterations: int
    method: str
    history: tuple[dict[str, float], ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    message: str = ""
    notes: Sequence[str] = ()
    proof: Infeasible | None = None
    displacements: Stacked | None = None

    @property
    def products(self) -> int:
        """Products with Q that the method took; 0 where Q is an array."""
        return int(self.history[-1].get("products", 0)) if self.history else 0

    @property
    def solved(self) -> bool:
        return self.status is Status.SOLVED

    def __repr__(self) -> str:
        contacts = count(len(self.reactions), "contact")
        steps = count(self.iterations, "iteration")
        return line(
            "Solution",
            self.status.label,
            f"residual {self.residual:.1e}",
            steps,
            self.method,
            contacts,
        )

    def _repr_html_(self) -> str:
        rows = {
            "status": f"{self.status.label}: {self.message or self.status.sentence}",
            "residual (certificate)": f"{self.residual:.2e}",
            "iterations": self.iterations,
            "method": self.method,
            "contacts": len(self.reactions),
            "time": f"{sum(self.seconds.values()):.3g} s",
        }
        return card("Solution", rows | {f"note {n}": note for n, note in enumerate(self.notes, 1)})
