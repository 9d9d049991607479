"""What can be known of a friction problem before solving it: rank, thresholds of mu, tightness of
its relaxation.

Coefficients are scaled together, mu_i = mu m_i with max m_i = 1; a threshold is a value of mu, the
largest of them. Of Q the symmetric part is taken. D r = r - r' etc. are differences of two states,
E = diag(m), w = u_t.

Inequalities. Two states that obey Signorini have D r_n . D u_n <= 0; two that obey friction with
bounds g, g' have
    D r_t . D w <= sum_i |D g_i| |D w_i|                                                     (F)
by maximal dissipation, in 2D and 3D. With L = diag(L_i) > 0, one number per contact, and b^2 the
largest eigenvalue of L^-1/2 Q_tt L^-1/2, the right side is at most mu b |E D r_n|_L |D w| in the
norm of Q_tt^-1 when g = mu E r_n. If the plates move along the normals only (V_t = 0), D r_n lies
in Z = ker V_n', lambda drops out, and
    D r . D u = D r_n' S D r_n + |D w|^2 in the norm of Q_tt^-1,   S = Q_nn - Q_nt Q_tt^-1 Q_tn.
Let a^2 be the largest eigenvalue of (E L E, S) on Z, k^2 = b^2 times that of (E L E, Q_nn) on Z,
and c^2 < 1 that of (Q_nt Q_tt^-1 Q_tn, Q_nn) on Z: the coupling of normal and tangential
directions. Then, for every load q, s:
 1. Two solutions: x^2 + y^2 <= mu a b x y with x = |D r_n|_S, y = |D w|: equal if mu < 2 / (a b).
    Two Tresca steps from bounds that differ by d: x <= (mu a b / 2) |d|, so the Tresca iteration
    contracts there too.
 2. Normal problem: |D r_n| <= c |D r_t|, norms of Q_nn and Q_tt. Tangential problem for two r_n
    that differ by d: (F) gives |D r_t|^2 <= (c^2 + mu^2 k^2) |d|^2, so that the alternating
    iteration contracts if c^2 (c^2 + mu^2 k^2) < 1; put together for one Tresca step they give x^2
    (1 - c^4) <= (mu c k)^2 |d|^2, the same threshold mu < sqrt(1 - c^4) / (c k).
These `guaranteed` thresholds are sufficient, not sharp: they fall like the square root of the mesh
width, because they allow slip that changes sign from node to node. Singular S or plates that move
tangentially: none, given as 0.

Slip map. Let all contacts press and slip one way, w_i = |w_i| e with one direction e: D r_t = -mu E
e D g, and a step of either iteration is D r_n = mu T D g, T = P Q_nt E e, P the inverse of Q_nn on
Z. The iterations stop converging at spectral radius mu rho(T) = 1; the solution stops being
isolated at an eigenvalue +1 of mu T, that is, by +e or -e, where mu times the largest modulus of a
real eigenvalue of T is 1: two different conditions. Each is exact for these slip directions, and
loads that produce them exist, so that no guarantee can reach beyond: `uniform_slip` thresholds
bound the best possible ones from above (the least over the tangential axes), `guaranteed` from
below. For one contact in 2D without tangential plate motion both equal Q_nn / |Q_nt| = K_tt /
|K_tn|, and that is exact for all loads. Plates that move tangentially are held there.

At a solution the same test takes its own stick, slip and open sets (and, in 3D, how the direction
of slip turns): the linear maps of the Tresca iteration, mu T with stick inside, and of the
alternating iteration, where stick follows r_n one step late. Their spectral radii are the rates of
convergence near this solution, exact unless a contact is between two states; global convergence,
other solutions and the solution's change of state with mu are not covered: a heuristic there.

Relaxation. The cone program  min r'Qr/2 + q'r, |r_t| <= mu r_n, V'r + s = 0  asks for
u_n >= mu |u_t| and r . u = 0. Its solution solves Coulomb's problem if and only if no loaded
contact with friction slips in it (there it has u_n = mu |u_t|, Coulomb u_n = 0). mu = 0 is enough,
and so is stick of all that touches if the rest opens by more than mu |u_t|; Q_nt = 0 is not. It is
solved, and its answer certified for both problems.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from contactopt.cards import card, count, line
from contactopt.errors import InputError
from contactopt.methods.cone import Relaxation
from contactopt.methods.driver import solve
from contactopt.methods.notes import MUCH
from contactopt.problem import (
    InterfaceProblem,
    Solution,
    amplification,
    balance_residual,
    dimensionless,
    natural_map_residual,
)
from contactopt.problem.cones import coulomb_cone
from contactopt.problem.contact_status import contact_status

# a residual of at most the one is a solution, above the other it is none
CERTIFIED, DISTINCT = 1e-8, 1e-6
# an eigenvalue with relatively less imaginary part is real; a smaller one is rounding
REAL, ZERO = 1e-7, 1e-10


@dataclass(frozen=True)
class Thresholds:
    """Bounds of the largest friction coefficient, all coefficients scaled together [-].

    unique       below it there is one solution
    tresca       below it the Tresca iteration contracts
    alternating  below it the alternating iteration contracts
    """

    unique: float
    tresca: float
    alternating: float


@dataclass(frozen=True)
class Local:
    """The slip map at a solution.

    Counts of contacts; rates of convergence per iteration at the actual mu (>= 1: none).

    contraction  mu at which the Tresca map of these stick and slip sets gets spectral radius 1
    singular     mu at which it gets an eigenvalue +1 and the solution stops being isolated; inf:
                 never
    condition    times the certificate bounds the relative error of the forces (`amplification`)
    error        this bound: what is known of the forces [-]
    """

    stick: int
    slip: int
    open: int
    alternating_rate: float
    tresca_rate: float
    contraction: float
    singular: float
    condition: float = np.nan
    error: float = np.nan


@dataclass(frozen=True)
class Diagnosis:
    """See the head of this module; print it for a summary.

    size, held      n of Q (n, n); how many of its rows are zero: supported components, not counted
                    in the rank
    rank            of Q: eigenvalues above n eps times the largest; `least` is the least over the
                    largest
    condition       largest eigenvalue over the least that counts for the rank [-]
    asymmetry       |Q - Q'| / |Q|, Frobenius norms
    guaranteed      sufficient for every load; 0: nothing is guaranteed
    uniform_slip    upper bounds of what could be guaranteed; nan where Q_nn is singular
    exact           both are equal and exact (one contact in 2D)
    relaxation      "tight", "not tight", "undecided" (its solver failed) or "none" (bilateral
                    contact)
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
        if self.least < -self.size * np.finfo(float).eps:
            lines[1] += ", not positive semidefinite"
        if self.local is not None:
            at = self.local
            lines.append(
                f"at the solution: {at.stick} stick, {at.slip} slip, {at.open} open; rate of"
                f" alternating {at.alternating_rate:.3g}, Tresca {at.tresca_rate:.3g} (1 at mu ="
                f" {at.contraction:.3g}); isolated up to mu = {at.singular:.3g}"
            )
            far = "; other forces far away fit nearly as well" if at.error > MUCH else ""
            lines.append(
                f"error of its forces: at most {at.condition:.2g} times the certificate,"
                f" {at.error:.1g} of the typical force, near this solution{far}"
            )
        return "\n".join(lines)

    def _threshold(self, name: str, what: str, field: str) -> str:
        """What is guaranteed up to which friction, and where it is lost."""
        low, high = getattr(self.guaranteed, field), getattr(self.uniform_slip, field)
        if self.exact:
            return f"{name}: {what} for every load if and only if mu < {low:.4g}"
        text = f"{name}: {what} is not guaranteed"
        if low > 0:
            text = f"{name}: {what} for every load if mu < {low:.3g}"
        return text if np.isnan(high) else f"{text}; it is lost for some load at mu = {high:.3g}"

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
    if not problem.law.proportional or problem.law.dilatant:
        raise InputError(
            "diagnose asks what a friction coefficient does, so it needs Coulomb's law or bilateral"
            " contact."
        )
    largest = float(problem.mu.max(initial=0.0))
    scaled, scales = dimensionless(problem)
    scaled = replace(scaled, Q=(scaled.Q + scaled.Q.T) / 2)
    shape = problem.mu / largest if largest > 0 else np.ones(problem.contacts)
    eigenvalues = la.eigvalsh((problem.Q + problem.Q.T) / 2)
    top = float(np.abs(eigenvalues).max(initial=0.0)) or 1.0
    counted = eigenvalues[eigenvalues > len(eigenvalues) * np.finfo(float).eps * top]
    skew = np.linalg.norm(problem.Q - problem.Q.T)
    uniform, one = _uniform_slip(scaled, shape), problem.contacts == 1 and problem.dim == 2
    exact = one and _normal_plates(scaled) and uniform.unique > 0
    local = None
    if solution is not None:
        answer = solution.reactions, solution.multipliers
        residual = natural_map_residual(problem, *answer)
        if residual > DISTINCT:
            raise InputError(
                "diagnose needs a solution of this problem; the residual of this one is"
                f" {residual:.1e}."
            )
        local = _local(scaled, *scales.to_dimensionless(*answer), largest)
        condition = amplification(problem, *answer)
        local = replace(local, condition=condition, error=condition * residual)
    return Diagnosis(
        contacts=problem.contacts,
        dim=problem.dim,
        mu=largest,
        size=len(eigenvalues),
        held=int(np.sum(~np.any(problem.Q, axis=1))),
        rank=len(counted),
        least=float(eigenvalues.min(initial=0.0)) / top,
        condition=float(counted.max() / counted.min()) if len(counted) else np.inf,
        asymmetry=float(skew / (np.linalg.norm(problem.Q) or 1.0)),
        guaranteed=uniform if exact else _guaranteed(scaled, shape),
        uniform_slip=uniform,
        exact=exact,
        relaxation=_relaxation(scaled),
        local=local,
    )


def _normal_plates(problem: InterfaceProblem) -> bool:
    V = problem.V.reshape(*problem.q.shape, -1)
    return bool(np.abs(V[:, 1:]).max(initial=0.0) <= 1e-9 * np.abs(V).max(initial=0.0))


def _parts(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    blocks = np.arange(problem.q.size).reshape(problem.q.shape)
    return blocks[:, 0], blocks[:, 1:].ravel()


def _guaranteed(problem: InterfaceProblem, shape: np.ndarray) -> Thresholds:
    """Statements 1 and 2 of the module's head."""
    n, t = _parts(problem)
    Q = problem.Q
    try:
        Z = la.null_space(problem.V[n].T) if len(problem.s) else np.eye(len(n))
        if not _normal_plates(problem):
            return Thresholds(0.0, 0.0, 0.0)
        if Z.shape[1] == 0:  # the plates determine every normal force
            return Thresholds(np.inf, np.inf, np.inf)
        factor = la.cho_factor(Q[np.ix_(t, t)])
        coupling = Z.T @ Q[np.ix_(n, t)] @ la.cho_solve(factor, Q[np.ix_(t, n)]) @ Z
        normal = Z.T @ Q[np.ix_(n, n)] @ Z
        weight = np.diag(Q)[t].reshape(len(n), -1).mean(axis=1)
        root = np.sqrt(np.repeat(weight, problem.dim - 1))
        b2 = _largest(Q[np.ix_(t, t)] / np.outer(root, root), np.eye(len(t)))
        bound = Z.T @ ((shape**2 * weight)[:, None] * Z)
        ab = np.sqrt(b2 * _largest(bound, normal - coupling))
        c2 = _largest(coupling, normal)
        ck = np.sqrt(b2 * _largest(bound, normal) * c2)
    except la.LinAlgError:
        return Thresholds(0.0, 0.0, 0.0)
    first, second = _over(2.0, ab), _over(np.sqrt(max(0.0, 1 - c2**2)), ck)
    return Thresholds(max(first, second), max(first, second), second)


def _largest(A: np.ndarray, B: np.ndarray) -> float:
    """Largest eigenvalue of A x = value B x, at least 0; LinAlgError unless B is definite."""
    symmetric = (A + A.T) / 2, (B + B.T) / 2
    last = (len(A) - 1,) * 2
    return max(0.0, float(la.eigh(*symmetric, eigvals_only=True, subset_by_index=last)[0]))


def _over(a: float, b: float) -> float:
    return float(a / b) if b > ZERO else np.inf


def _uniform_slip(problem: InterfaceProblem, shape: np.ndarray) -> Thresholds:
    n, t = _parts(problem)
    V = problem.V[:, np.any(np.abs(problem.V[n]) > 1e-9, axis=0)]  # tangential plates are held
    matrix = _bordered(problem.Q[np.ix_(n, n)], V[n])
    radius = real = 0.0
    for axis in range(problem.dim - 1):
        rows = t[axis :: problem.dim - 1]
        right = np.vstack([problem.Q[np.ix_(n, rows)], V[rows].T]) * shape
        try:
            values = la.eigvals(_solve(matrix, right)[: len(n)])
        except la.LinAlgError:
            return Thresholds(np.nan, np.nan, np.nan)
        radius = max(radius, np.abs(values).max())
        real = max(real, np.abs(_real(values)).max(initial=0.0))
    return Thresholds(_over(1.0, real), _over(1.0, radius), _over(1.0, radius))


def _real(values: np.ndarray) -> np.ndarray:
    return np.asarray(values.real[np.abs(values.imag) <= REAL * np.abs(values).max(initial=0.0)])


def _bordered(A: np.ndarray, V: np.ndarray) -> np.ndarray:
    return np.block([[A, V], [V.T, np.zeros((V.shape[1], V.shape[1]))]])


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """LinAlgError also where the matrix is singular to working accuracy."""
    factors, order, _ = la.lapack.dgetrf(matrix)
    pivots = np.abs(np.diag(factors))
    if pivots.min(initial=np.inf) <= 1e-13 * pivots.max(initial=0.0):
        raise la.LinAlgError("singular")
    return np.asarray(la.lapack.dgetrs(factors, order, right)[0])


def _local(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray, largest: float) -> Local:
    """Per closed contact G D r_t + H D w = -mu d D g: H = I in stick, slip along d, G = I else."""
    k, dim = r.shape
    bound, force = problem.mu * np.abs(r[:, 0]), np.linalg.norm(r[:, 1:], axis=1)
    status = contact_status(problem, r)
    closed, stick = status.touching, status.stick
    slip = status.slip & (problem.mu > 0) & (force > 0)
    counts = int(stick.sum()), int(slip.sum()), int((~closed).sum())
    if not np.any(closed):
        return Local(*counts, 0.0, 0.0, np.inf, np.inf)
    d = np.where(slip[:, None], -r[:, 1:] / np.where(slip, force, 1.0)[:, None], 0.0)
    speed = np.linalg.norm(problem.displacements(r, lam)[:, 1:], axis=1)
    along, eye = d[:, :, None] * d[:, None, :], np.eye(dim - 1)
    stiff = np.divide(speed, bound, out=np.ones(k), where=slip)[:, None, None]
    G = la.block_diag(*np.where(stick[:, None, None], 0.0, along + stiff * (eye - along))[closed])
    H = la.block_diag(*((stick | slip)[:, None, None] * (eye - along))[closed])
    direction = la.block_diag(*((problem.mu * np.sign(r[:, 0]))[:, None] * d)[closed][:, :, None])
    rows = np.repeat(closed, dim)
    Q, V = problem.Q[np.ix_(rows, rows)], problem.V[rows]
    part = np.arange(dim * closed.sum()).reshape(-1, dim)
    n, t, m, p = part[:, 0], part[:, 1:].ravel(), len(part), V.shape[1]
    try:
        tresca = np.zeros((len(Q) + p,) * 2)
        tresca[:m] = np.hstack([Q[np.ix_(n, n)], Q[np.ix_(n, t)], V[n]])
        tresca[m : len(Q)] = H @ np.hstack([Q[np.ix_(t, n)], Q[np.ix_(t, t)], V[t]])
        tresca[m : len(Q), m : len(Q)] += G
        tresca[len(Q) :, : len(Q)] = np.hstack([V[n].T, V[t].T])
        right = np.vstack([np.zeros((m, m)), -direction, np.zeros((p, m))])
        values = la.eigvals(_solve(tresca, right)[:m])
        pushes = np.any(np.abs(V[n]) > 1e-9, axis=0)
        A, B = V[:, pushes], V[:, ~pushes]
        tangential = np.block(
            [[G + H @ Q[np.ix_(t, t)], H @ B[t]], [B[t].T, np.zeros((B.shape[1],) * 2)]]
        )
        right = -np.block(
            [[direction + H @ Q[np.ix_(t, n)], H @ A[t]], [np.zeros((B.shape[1], m + A.shape[1]))]]
        )
        r_t = _solve(tangential, right)[: len(t)]
        right = -np.vstack([Q[np.ix_(n, t)], A[t].T]) @ r_t
        late = la.eigvals(_solve(_bordered(Q[np.ix_(n, n)], A[n]), right))
    except la.LinAlgError:
        return Local(*counts, np.nan, np.nan, np.nan, np.nan)
    slow, rate = (float(np.abs(x).max(initial=0.0)) for x in (late, values))
    real = float(_real(values).max(initial=0.0))
    return Local(*counts, slow, rate, _over(largest, rate), _over(largest, real))


def _relaxation(problem: InterfaceProblem) -> str:
    if not Relaxation().solves(problem.law):
        return "none"
    answer = solve(problem, Relaxation(), tol=CERTIFIED)
    if answer.solved:
        return "tight"
    r, u = answer.reactions, problem.displacements(answer.reactions, answer.multipliers)
    error = float(np.linalg.norm(r - coulomb_cone(r - u, problem.mu)))
    optimal = error <= CERTIFIED * np.linalg.norm(r) and balance_residual(problem, r) <= CERTIFIED
    return "not tight" if optimal and answer.residual > DISTINCT else "undecided"
