"""Friction coefficients up to which a problem has one solution and iterations converge.

Coefficients are scaled together, mu_i = mu m_i with max m_i = 1; a threshold is a value of mu, the
largest of them. Q may be unsymmetric; sym(A) = (A + A') / 2. D r = r - r' etc. are differences of
two states, E = diag(m), w = u_t.

Inequalities. Two states that obey Signorini have D r_n . D u_n <= 0; two that obey friction with
bounds g, g' have
    D r_t . D w <= sum_i |D g_i| |D w_i|                                                     (F)
by maximal dissipation, in 2D and 3D. Norms of w are those of sym(W), W = Q_tt^-1. With L =
diag(L_i) > 0, one number per contact, and b^2 the largest eigenvalue of (L^-1, sym(W)), the right
side is at most mu b |E D r_n|_L |D w| when g = mu E r_n. If the plates move along the normals only
(V_t = 0), D r_n lies in Z = ker V_n', lambda drops out, and
    D r . D u = D r_n' S D r_n + D r_n' C D w + |D w|^2,   S = Q_nn - Q_nt W Q_tn,
with C = Q_nt W - Q_tn' W', which is zero if Q is symmetric. Let a^2 be the largest eigenvalue of
(E L E, sym(S)) on Z, and d the largest value of D r_n' C D w for D r_n and D w of norm one. For a
symmetric Q let also k^2 = b^2 times the largest eigenvalue of (E L E, Q_nn) on Z, and c^2 < 1 that
of (Q_nt W Q_tn, Q_nn) on Z: the coupling of normal and tangential directions. Then, for every load
q, s:
 1. Two solutions: x^2 + y^2 <= (mu a b + d) x y with x = |D r_n|_S, y = |D w|: equal if
    mu < (2 - d) / (a b). Two Tresca steps from bounds that differ by D: x <= mu a b |D| / (2 - d),
    so the Tresca iteration contracts there too.
 2. Q symmetric. Normal problem: |D r_n| <= c |D r_t|, norms of Q_nn and Q_tt. Tangential problem
    for two r_n that differ by D: (F) gives |D r_t|^2 <= (c^2 + mu^2 k^2) |D|^2, so that the
    alternating iteration contracts if c^2 (c^2 + mu^2 k^2) < 1; put together for one Tresca step
    they give x^2 (1 - c^4) <= (mu c k)^2 |D|^2, the same threshold mu < sqrt(1 - c^4) / (c k).
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
below. For one contact in 2D with det Q > 0, without tangential plate motion, both equal Q_nn /
|Q_nt|, and that is exact for all loads: the map from the point to q consists of four linear pieces,
which cover the plane once if and only if all of their determinants have one sign. Plates that move
tangentially are held there. The iterations need a symmetric Q.

At a solution the same test takes its own stick, slip and open sets (and, in 3D, how the direction
of slip turns): the linear maps of the Tresca iteration, mu T with stick inside, and of the
alternating iteration, where stick follows r_n one step late. Their spectral radii are the rates of
convergence near this solution, exact unless a contact is between two states; global convergence,
other solutions and the solution's change of state with mu are not covered: a heuristic there.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from contactopt.problem import InterfaceProblem
from contactopt.problem.contact_status import contact_status

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


def normal_plates(problem: InterfaceProblem) -> bool:
    V = problem.V.reshape(*problem.q.shape, -1)
    return bool(np.abs(V[:, 1:]).max(initial=0.0) <= 1e-9 * np.abs(V).max(initial=0.0))


def _parts(problem: InterfaceProblem) -> tuple[np.ndarray, np.ndarray]:
    blocks = np.arange(problem.q.size).reshape(problem.q.shape)
    return blocks[:, 0], blocks[:, 1:].ravel()


def thresholds(
    problem: InterfaceProblem, shape: np.ndarray, energy: bool
) -> tuple[Thresholds, Thresholds, bool]:
    """Guaranteed thresholds of mu * `shape`, those of uniform slip, and whether both agree."""
    low, high = Thresholds(0.0, 0.0, 0.0), _uniform_slip(problem, shape)
    if not energy:
        high = Thresholds(high.unique, np.nan, np.nan)
    if not normal_plates(problem):
        return low, high, False
    low = _guaranteed(problem, shape, energy)
    if problem.contacts > 1 or problem.dim > 2 or not _turns_one_way(problem):
        return low, high, False
    return (high if energy else Thresholds(high.unique, 0.0, 0.0)), high, True


def _turns_one_way(problem: InterfaceProblem) -> bool:
    """Whether det Q (2, 2) and its entry for slip are positive, unless a plate gives the force."""
    Q = problem.Q
    try:
        check_definite(Q[1:, 1:], Q)
        if not np.any(problem.V[0]):
            check_definite(Q[:1, :1] - Q[:1, 1:] @ Q[1:, :1] / Q[1, 1], Q)
    except la.LinAlgError:
        return False
    return True


def _guaranteed(problem: InterfaceProblem, shape: np.ndarray, energy: bool) -> Thresholds:
    """Statements 1 and 2 from the top; 2 if Q has an `energy`."""
    n, t = _parts(problem)
    nn, nt, tn, tt = (problem.Q[np.ix_(i, j)] for i in (n, t) for j in (n, t))
    try:
        Z = la.null_space(problem.V[n].T) if len(problem.s) else np.eye(len(n))
        W = np.linalg.inv(check_definite(tt, tt))
        if Z.shape[1] == 0:  # the plates determine every normal force
            return Thresholds(np.inf, np.inf, np.inf) if energy else Thresholds(np.inf, 0.0, 0.0)
        weight = np.diag(tt).reshape(len(n), -1).mean(axis=1)
        bound = Z.T @ ((shape**2 * weight)[:, None] * Z)
        normal, S = Z.T @ nn @ Z, Z.T @ (nn - nt @ W @ tn) @ Z
        C = Z.T @ (nt @ W - tn.T @ W.T)
        b2 = _largest(np.diag(1 / np.repeat(weight, problem.dim - 1)), W)
        ab = np.sqrt(b2 * _largest(bound, check_definite(S, normal)))
        d = np.sqrt(_largest(C @ np.linalg.solve((W + W.T) / 2, C.T), S))
        first = _over(2.0 - d, ab) if d < 2 else 0.0
        if not energy:
            return Thresholds(first, 0.0, 0.0)
        c2 = _largest(normal - S, normal)
        ck = np.sqrt(b2 * _largest(bound, normal) * c2)
    except la.LinAlgError:
        return Thresholds(0.0, 0.0, 0.0)
    second = _over(np.sqrt(max(0.0, 1 - c2**2)), ck)
    return Thresholds(max(first, second), max(first, second), second)


def check_definite(A: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """A, if its symmetric part is definite far above another's rounding, else LinAlgError."""
    least = np.inf if not A.size else la.eigvalsh((A + A.T) / 2, subset_by_index=(0, 0))[0]
    if least <= 1e-10 * np.abs(beside).max(initial=0.0):  # not above rounding
        raise la.LinAlgError("not definite")
    return A


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


def local_map(problem: InterfaceProblem, r: np.ndarray, lam: np.ndarray, largest: float) -> Local:
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
