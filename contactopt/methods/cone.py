"""Friction as a second-order cone program: the convex relaxation, and the fixed point that corrects
it.

Both solve, over Coulomb's cones,
    min  r' Q r / 2 + (q + mu s n)' r    subject to  |r_t| <= mu r_n,  V' r + s_plates = 0.
`Relaxation` solves it once with s = 0. That is another law, friction with an associated flow rule:
where a contact slips its gap opens by mu |u_t|, so that a block dragged along a plane rises from
it. `AcaryCadoux` repeats it with s = |u_t| of the last answer, which takes the opening back; a
fixed point is exactly a solution of Coulomb's problem. On a problem whose law is associated
friction both solve that law, in one program. The answer of each program is made exact by Newton
steps on r = P(r - u), P the projection on the cones; where Q is badly rank-deficient these may
fail, and the certificate stays at what the backend's accuracy gives.

Source: Acary, Cadoux, Lemarechal, Malick (2011), A formulation of the linear discrete Coulomb
friction problem via convex optimization.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from contactopt.errors import InputError
from contactopt.methods.backends import CONIC, find
from contactopt.methods.backends.conic import Conic
from contactopt.methods.backends.direct import CoulombSOCP
from contactopt.methods.kernels.semismooth import Projection, crossover
from contactopt.methods.method import Iterate, Method
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import coulomb_cone_derivative
from contactopt.problem.laws.law import Law

BRIDGES = ("clarabel", "cvxpy")


@dataclass(frozen=True)
class AcaryCadoux(Method):
    """The fixed point of Acary and Cadoux: one cone program after another.

    The `bridge` 'clarabel' calls that solver directly; 'cvxpy' solves
    contactopt.models.acary_cadoux as it is written there, with the conic `backend`.
    """

    bridge: str = "clarabel"
    backend: str = "clarabel"

    def __post_init__(self) -> None:
        if self.bridge not in BRIDGES:
            raise InputError(f"unknown bridge {self.bridge!r}; choose from {', '.join(BRIDGES)}.")
        if self.bridge == "clarabel" and self.backend != "clarabel":
            raise InputError(
                f"backend {self.backend!r} needs bridge='cvxpy'; the direct bridge knows clarabel"
                " only."
            )

    def backends(self, dim: int) -> tuple[str, str]:
        return (find(self.backend, CONIC).name,) * 2

    def solves(self, law: Law) -> bool:
        return law.unilateral and law.proportional

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        solve = cone_program(problem, self.bridge, self.backends(problem.dim)[0])
        opening = np.zeros(problem.contacts) if start is None else _opening(problem, *start)
        while True:
            r, multipliers = solve(opening)
            yield r, multipliers
            opening = _opening(problem, r, multipliers)


@dataclass(frozen=True)
class Relaxation(AcaryCadoux):
    """One cone program, whose solution is that of associated friction."""

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        return islice(super().iterate(problem), 1)


def _opening(problem: InterfaceProblem, r: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
    """mu |u_t| (k,), zero where the law is associated friction itself."""
    return problem.law.opening(problem.displacements(r, multipliers)[:, 1:])


def cone_program(
    problem: InterfaceProblem, bridge: str, backend: str
) -> Callable[[np.ndarray], Iterate]:
    """The cone program defined at the top, from the opening mu s (k,) [length] to its answer."""
    V, s_plates = problem.V, problem.s
    if bridge == "cvxpy":
        from contactopt.models import acary_cadoux

        conic = Conic.using(backend, acary_cadoux(problem), problem.Q)
    else:
        direct = CoulombSOCP.using(problem.Q, problem.mu, V, s_plates)

    def solve(opening: np.ndarray) -> Iterate:
        c = problem.q.copy()
        c[:, 0] += opening
        if bridge == "cvxpy":
            mu = problem.mu
            answer = conic.solve(s=np.divide(opening, mu, out=np.zeros_like(mu), where=mu > 0))
            r, lam = answer["r"], answer["approach"]
        else:
            r, lam = direct.solve(c.ravel())
        project: Projection = lambda y: coulomb_cone_derivative(y, problem.mu)  # noqa: E731
        return crossover(problem.Q, c.ravel(), V, s_plates, project, r.reshape(c.shape), lam)

    return solve
