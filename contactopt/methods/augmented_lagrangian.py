"""Augmented Lagrangian method (method of multipliers) for contact and friction together.

The forces are the multipliers of the contact conditions; the penalty rho augments them, and each
iteration sets
    r_j = P(r_{j-1} - rho u_j),   u_j = Q r_j + V lambda + q,   with the balance V' r_j + s = 0,
P the map of the law (contactopt.problem.laws). Seen from the forces this is the proximal-point
iteration with the compliance Q + I / rho. The default solves it exactly by semismooth Newton steps;
rho does not change, unlike in `proximal`, and the iteration ends where these steps fail.
explicit = True is Uzawa's variant, u_{j-1} in place of u_j: one product with Q per iteration, rho
from Q's largest eigenvalue, lambda from the balance of the step itself. P is not a projection on a
fixed set, so that the balance is sought with the friction bounds of the last iterate.

Sources: Alart, Curnier (1991); Simo, Laursen (1992), An augmented Lagrangian treatment of contact
problems involving friction; Rockafellar (1976).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from contactopt.checks import check_number
from contactopt.linear.operators import eigenvalue_bound
from contactopt.methods.kernels.alart_curnier import cold_start, coulomb_equations
from contactopt.methods.kernels.balance import project_balanced
from contactopt.methods.kernels.damped import solve_subproblem
from contactopt.methods.kernels.sparse_blocks import block_matrix
from contactopt.methods.method import Iterate, Method, at_rest
from contactopt.problem import InterfaceProblem
from contactopt.problem.cones import cylinder_derivative
from contactopt.problem.laws.law import Law


@dataclass(frozen=True)
class AugmentedLagrangian(Method):
    """The augmented Lagrangian method, exact with the penalty `rho`, in units of one over the mean
    compliance, or with `explicit` in the variant of Uzawa, which chooses its own penalty.
    """

    rho: float = 100.0
    explicit: bool = False
    unsymmetric: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_number("the penalty rho", self.rho, low=0.0)

    def solves(self, law: Law) -> bool:
        """Uzawa's variant holds friction bounds, which associated friction lacks."""
        return law.bounded and not (self.explicit and law.dilatant)

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        return self._uzawa(problem, start) if self.explicit else self._exact(problem, start)

    def _exact(self, problem: InterfaceProblem, start: Iterate | None) -> Iterator[Iterate]:
        point = start or cold_start(problem)
        matrix = block_matrix(problem.Q, problem.dim)
        solved = True
        while solved:
            equations = coulomb_equations(problem, point[0], 1 / self.rho)
            point, solved, _ = solve_subproblem(equations, matrix, point)
            yield point

    def _uzawa(self, problem: InterfaceProblem, start: Iterate | None) -> Iterator[Iterate]:
        r, lam = start or at_rest(problem)
        rho, low = 1 / eigenvalue_bound(problem.Q), problem.law.lowest
        while True:
            y = r - rho * ((problem.Q @ r.ravel()).reshape(r.shape) + problem.q)
            height = y[:, 0] - rho * (problem.V @ lam).reshape(r.shape)[:, 0]
            bound = problem.law.bound(height)
            discs = lambda y, bound=bound: cylinder_derivative(y, bound, low)  # noqa: E731
            r, lam = project_balanced(discs, y, problem.V, problem.s, rho, lam)
            yield r, lam
