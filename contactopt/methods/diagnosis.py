"""What can be known of a friction problem before solving it: rank, thresholds of mu
(contactopt.methods.thresholds), tightness of its relaxation.

Relaxation. The cone program  min r'Qr/2 + q'r, |r_t| <= mu r_n, V'r + s = 0  asks for
u_n >= mu |u_t| and r . u = 0. Its solution solves Coulomb's problem if and only if no loaded
contact with friction slips in it (there it has u_n = mu |u_t|, Coulomb u_n = 0). mu = 0 is enough,
and so is stick of all that touches if the rest opens by more than mu |u_t|; Q_nt = 0 is not. It is
solved, and its answer certified for both problems. It needs a symmetric Q; where Q is singular it
may have other minimisers, so that one that slips decides nothing.

reports/atlas has the smallest problems on which methods fail, with the thresholds observed there.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from contactopt.cards import card, count, line
from contactopt.defaults import EQUAL, TOL
from contactopt.errors import InputError
from contactopt.linear.operators import NOISE
from contactopt.methods.cone import Relaxation
from contactopt.methods.driver import solve
from contactopt.methods.notes import LOOSE, MUCH
from contactopt.methods.thresholds import (
    Local,
    Thresholds,
    check_definite,
    local_map,
    normal_plates,
    thresholds,
)
from contactopt.problem import (
    InterfaceProblem,
    Scales,
    Solution,
    amplification,
    balance_residual,
    check_problem,
    dimensionless,
    natural_map_residual,
)
from contactopt.problem.cones import coulomb_cone

DISTINCT = 1e-6  # a residual above this is none of a solution; up to TOL it is


def _trust(at: Local) -> str:
    """How far the certificate of a solution bounds its forces."""
    if not at.condition < LOOSE:
        return (
            "its forces are not unique, or nearly not: the certificate does not bound their error"
        )
    far = "; other forces far away fit nearly as well" if at.error > MUCH else ""
    return (
        f"error of its forces: at most {at.condition:.2g} times the certificate, {at.error:.1g} of"
        f" the typical force, near this solution{far}"
    )


def _rounded(value: float, way: Callable[[float], float]) -> float:
    """A positive number with three digits, down or up."""
    if not 0 < value < np.inf:
        return value
    unit = 10.0 ** (np.floor(np.log10(value)) - 2)
    return float(way(value / unit) * unit)


@dataclass(frozen=True)
class Diagnosis:
    """What `diagnose` finds; print it for a summary. The module explains the terms.

    size, held      n of Q (n, n); how many of its rows are zero: supported components, not counted
                    in the rank
    rank            of Q: singular values above n eps times the largest
    least           least eigenvalue of sym(Q) over the largest modulus of them
    condition       largest singular value over the least that counts for the rank [-]
    asymmetry       |Q - Q'| / |Q|, Frobenius norms
    guaranteed      sufficient for every load; 0: nothing is guaranteed
    uniform_slip    upper bounds of what could be guaranteed; nan where Q_nn is singular
    exact           both are equal and exact (one contact in 2D)
    relaxation      "tight", "not tight", "undecided" (its solver failed, or it slips and Q is
                    singular) or "none" (bilateral contact, unsymmetric Q)
    dragged         some plate moves tangentially, and is held in uniform_slip
    """

    contacts: int
    dim: int
    mu: float
    size: int
    held: int
    rank: int
    least: float
    condition: float
    asymmetry: float
    guaranteed: Thresholds
    uniform_slip: Thresholds
    exact: bool
    relaxation: str
    local: Local | None = None
    dragged: bool = False

    def __str__(self) -> str:
        lines = [
            f"{count(self.contacts, 'contact')} in {self.dim}D, mu = {self.mu:g}",
            f"Q: rank {self.rank} of {self.size} (held components: {self.held}), condition"
            f" {self.condition:.2g}, asymmetry {self.asymmetry:.1g}",
            self._threshold("number of solutions", "uniqueness", "unique"),
            self._threshold("Tresca iteration", "convergence", "tresca"),
            self._threshold("alternating iteration", "convergence", "alternating"),
            f"convex relaxation: {self.relaxation}",
        ]
        if self.least < -NOISE:
            lines[1] += ", not positive semidefinite"
        if self.local is not None:
            lines += [self._states(self.local), _trust(self.local)]
        return "\n".join(lines)

    def _threshold(self, name: str, what: str, field: str) -> str:
        """What is guaranteed up to which friction, and where it is lost, rounded safely."""
        low, high = getattr(self.guaranteed, field), getattr(self.uniform_slip, field)
        if self.held and field == "unique":
            what += " (but for the forces of held components)"
        if low == np.inf:
            return f"{name}: {what} for every load and every mu"
        if self.exact and low == high:
            return f"{name}: {what} for every load if and only if mu < {low:.4g}"
        text = f"{name}: {what} is not guaranteed"
        if low > 0:
            text = f"{name}: {what} for every load if mu < {_rounded(low, np.floor):.3g}"
        if not np.isfinite(high):  # not known, or never lost
            return text
        held = "with the plates held tangentially " if self.dragged else ""
        return f"{text}; {held}it is lost for some load at mu = {_rounded(high, np.ceil):.3g}"

    def _states(self, at: Local) -> str:
        """The states at the solution, and what their linear maps say."""
        smooth = self.contacts - at.stick - at.slip - at.open
        said = f"at the solution: {at.stick} stick, {at.slip} slip, {at.open} open"
        said += f", {smooth} touch without friction" if smooth else ""
        if np.isnan(at.singular):
            return f"{said}; the linear system of these states is singular"
        about = "about " if self.dim == 3 and at.slip else ""
        if self.asymmetry <= EQUAL:
            said += (
                f"; rate of alternating {at.alternating_rate:.3g}, Tresca {at.tresca_rate:.3g} (1"
                f" at mu = {about}{at.contraction:.3g})"
            )
        if at.singular == np.inf:
            return f"{said}; isolated in these states at every mu"
        return f"{said}; not isolated in these states at mu = {about}{at.singular:.4g}"

    def __repr__(self) -> str:
        contacts = f"{count(self.contacts, 'contact')} in {self.dim}D"
        unique, rank = self.guaranteed.unique, f"rank {self.rank} of {self.size}"
        sure = f"unique below mu = {unique:.3g}" if unique else "uniqueness not guaranteed"
        return line("Diagnosis", contacts, f"mu = {self.mu:g}", rank, sure)

    def _repr_html_(self) -> str:
        parts = (text.partition(": ") for text in str(self).splitlines()[1:])
        return card(str(self).splitlines()[0], {name: said for name, _, said in parts})


def diagnose(problem: InterfaceProblem, solution: Solution | None = None) -> Diagnosis:
    """Say what is known of a problem before it is solved and, given one, near its solution.

    Parameters
    ----------
    problem : with Coulomb's law or bilateral contact
    solution : of this problem; None: `Diagnosis.local` stays empty

    Returns
    -------
    Diagnosis : rank of Q, thresholds of the friction coefficient, tightness of the convex
        relaxation

    Raises
    ------
    InputError : for laws without a friction coefficient, if the solution does not solve this
        problem, or if the load pulls the bodies apart
    """
    check_problem(problem)
    if not problem.law.proportional or problem.law.dilatant:
        raise InputError(
            "diagnose asks what a friction coefficient does, so it needs Coulomb's law or bilateral"
            " contact."
        )
    problem = problem.explicit()
    largest = float(problem.mu.max(initial=0.0))
    scaled, scales = dimensionless(problem)
    shape = problem.mu / largest if largest > 0 else np.ones(problem.contacts)
    values = la.svdvals(problem.Q)
    counted = values[values > len(values) * np.finfo(float).eps * values.max(initial=0.0)]
    eigenvalues = la.eigvalsh((problem.Q + problem.Q.T) / 2)
    skew = float(np.linalg.norm(problem.Q - problem.Q.T) / (np.linalg.norm(problem.Q) or 1.0))
    energy = skew <= EQUAL
    unloaded = dimensionless(problem.altered(q=0.0 * problem.q))[0]  # for every load
    guaranteed, uniform, exact = thresholds(unloaded, shape, energy)
    return Diagnosis(
        contacts=problem.contacts,
        dim=problem.dim,
        mu=largest,
        size=len(values),
        held=int(np.sum(~np.any(problem.Q, axis=1))),
        rank=len(counted),
        least=float(eigenvalues.min(initial=0.0) / (np.abs(eigenvalues).max(initial=0.0) or 1.0)),
        condition=float(counted.max() / counted.min()) if len(counted) else np.inf,
        asymmetry=skew,
        guaranteed=guaranteed,
        uniform_slip=uniform,
        exact=exact,
        relaxation=_relaxation(scaled) if energy else "none",
        local=None if solution is None else _at(problem, solution, scaled, scales, largest),
        dragged=not normal_plates(unloaded),
    )


def _at(
    problem: InterfaceProblem,
    solution: Solution,
    scaled: InterfaceProblem,
    scales: Scales,
    largest: float,
) -> Local:
    """What is known near a solution; InputError if it is none."""
    answer = solution.reactions, solution.multipliers
    residual = natural_map_residual(problem, *answer)
    if residual > DISTINCT:
        raise InputError(
            "diagnose needs a solution of this problem; the residual of this one is"
            f" {residual:.1e}."
        )
    local = local_map(scaled, *scales.to_dimensionless(*answer), largest)
    condition = amplification(problem, *answer)
    error = condition * residual if np.isfinite(condition) else np.inf
    return replace(local, condition=condition, error=error)


def _relaxation(problem: InterfaceProblem) -> str:
    if not Relaxation().solves(problem.law):
        return "none"
    answer = solve(problem, Relaxation(), tol=TOL)
    r, u = answer.reactions, problem.displacements(answer.reactions, answer.multipliers)
    error = float(np.linalg.norm(r - coulomb_cone(r - u, problem.mu)))
    optimal = error <= TOL * np.linalg.norm(r) and balance_residual(problem, r) <= TOL
    if answer.solved:  # perhaps by the point before the program, which has no minimiser
        return "tight" if error <= DISTINCT * max(1.0, float(np.linalg.norm(r))) else "undecided"
    Z = la.null_space(problem.V.T) if len(problem.s) else np.eye(len(problem.Q))
    try:
        check_definite(Z.T @ problem.Q @ Z, problem.Q)
    except la.LinAlgError:
        return "undecided"
    return "not tight" if optimal and answer.residual > DISTINCT else "undecided"
