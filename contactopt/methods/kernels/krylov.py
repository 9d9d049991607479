"""Newton steps from products with Q alone: PCG and GMRES preconditioned by the same step for a
model of Q.

A step solves  (I - D + D rho Q) dr + D rho V dlambda = error,  V' dr = -balance
               (contactopt.methods.kernels.semismooth). Where D is
symmetric (all contacts glued, the normal problem, Tresca friction) let U diag(delta) U' = D with
delta > 0. Then

    dr = U alpha + dr0,   dr0 = (I - U U') error,   (U'QU + B) alpha + U'V dlambda = U'error /
                          (delta rho) - U'Q dr0,

B = (1 - delta) / (delta rho), symmetric positive definite on the balance V'U alpha = -balance -
V'dr0: projected PCG (Gould, Hribar, Nocedal 2001). Coulomb's D is not symmetric: GMRES. In both the
preconditioner is the same system with Q replaced by its model G, whose products cost an FFT, solved
by an inner iteration: if c1 G <= Q <= c2 G then the preconditioned system is that well conditioned
whatever sticks, slips or is open. Q is needed once per iteration.
"""

import logging
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, cg

from contactopt.errors import InputError
from contactopt.linear.operators import Interface, loosened
from contactopt.methods.constants import MODEL_PRODUCTS, MODEL_STEP, PRODUCT_SHARE
from contactopt.methods.kernels.linearised import CYCLES, RESTART, Border, Linearised
from contactopt.methods.kernels.semismooth import Equations, Evaluated
from contactopt.methods.method import Iterate
from contactopt.methods.notes import note
from contactopt.methods.preconditioners import (
    Preconditioner,
    deflated,
    preconditioner,
    restricted,
    smooth_motions,
)
from contactopt.problem import InterfaceProblem

logger = logging.getLogger(__name__)


def model_of(
    problem: InterfaceProblem, name: str | None = None, deflate: bool = True
) -> Preconditioner:
    """The preconditioner of a problem by its name, or 'none'. By default `neumann` where contacts
    lie on a grid, `laplacian` where the cells of a surface are known, else the identity, with a
    note. With `deflate` smooth motions are solved for exactly. InputError for one that does not
    fit.
    """
    missing: list[str] = []
    for choice in ("neumann", "laplacian") if name is None else (name,) * (name != "none"):
        try:
            P = preconditioner(problem, choice)
        except InputError as error:
            if name is not None:
                raise
            missing.append(str(error))
            continue
        if not deflate:
            return P
        return deflated(P, loosened(problem.Q, MODEL_PRODUCTS), smooth_motions(problem))
    if missing:
        note(
            logger,
            "no preconditioner fits these contacts, so iterative steps go without one:"
            f" {' '.join(missing)}",
        )
    return Preconditioner(problem.q.size, lambda x: x)


@dataclass(frozen=True, eq=False)
class Krylov:
    """Steps from products with Q alone, preconditioned by P."""

    P: Preconditioner

    def __call__(
        self, equations: Equations, at: Evaluated, rtol: float = 0.0, ridge: float = 0.0
    ) -> Iterate | None:
        """As `Solve`, without a ridge; None if the iteration does not get anywhere."""
        Q = loosened(equations.Q, PRODUCT_SHARE * rtol)
        if np.array_equal(at.D, at.D.transpose(0, 2, 1)):
            dr, multipliers = self._symmetric(equations, at, Q, rtol)
        else:
            linearised, error = Linearised(equations, at.D), at.error.ravel()
            inverse = linearised.inverse(self.P, MODEL_STEP * rtol)
            dr, multipliers = linearised.solve(lambda x: Q @ x, inverse, error, at.balance, rtol)
        if not (np.all(np.isfinite(dr)) and np.all(np.isfinite(multipliers))):
            return None
        return dr.reshape(at.error.shape), multipliers

    def _symmetric(self, equations: Equations, at: Evaluated, Q: Interface, rtol: float) -> Iterate:
        V, error = equations.V, at.error.ravel()
        # The unknowns alpha are the amounts of the directions U in which a contact may still change
        # its force.
        U, delta, rho = _directions(at.D, equations.rho)
        # B defined at the top; a proximal subproblem adds its weight to Q.
        added = (1 - delta) / (delta * rho) + equations.weight
        # dr0, the part of the step outside these directions, is known at once.
        known = error - U @ (U.T @ error)
        right = (U.T @ error) / (delta * rho)
        if np.any(known):
            right -= U.T @ (Q @ known)
        # In these directions the balance reads W' alpha = b.
        W, b = U.T @ V, -at.balance - V.T @ known
        m = len(delta)
        if m == 0:
            return known, np.zeros(len(b))
        # N, an approximate inverse of the system U'QU + B, keeps the balance by two projections:
        # off, and its transpose, which removes multipliers from a residual.
        near = restricted(self.P, U, added)
        border = Border(lambda x: near @ x, W, W)
        off, Y, K = border.off, border.Y, border.K

        def off_t(x: np.ndarray) -> np.ndarray:
            return np.asarray(x - W @ (K @ (Y.T @ x)))

        def product(x: np.ndarray) -> np.ndarray:
            return np.asarray(U.T @ (Q @ (U @ x)) + added * x)

        # Start at an alpha that has the balance; all corrections then keep it.
        start = Y @ (K @ b)
        residual = right - product(start) if np.any(start) else right
        shape = m, m
        system = LinearOperator(shape, matvec=lambda x: off_t(product(off(x.ravel()))), dtype=float)
        inverse = LinearOperator(shape, matvec=lambda x: off(near @ off_t(x.ravel())), dtype=float)
        # The residual is compared with the right side without multipliers, or with the first
        # residual if that is larger.
        size = max(np.linalg.norm(off_t(right)), np.linalg.norm(off_t(residual)))
        beta, _ = cg(
            system, off_t(residual), rtol=0.0, atol=rtol * size, M=inverse, maxiter=RESTART * CYCLES
        )
        alpha = start + off(beta)
        # The multipliers are what is left of the residual, which lies in the range of W.
        multipliers = K @ (Y.T @ (right - product(alpha))) if len(b) else b
        return known + U @ alpha, multipliers


def _directions(D: np.ndarray, rho: np.ndarray) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
    """Eigenvectors U (k d, m) of all D, their eigenvalues delta > 0 (m,), and rho (m,) of each."""
    k, d = D.shape[:2]
    # The eigenvectors of each contact's D become columns of U, which touch the rows of that contact
    # only.
    values, vectors = np.linalg.eigh(D)
    contact, which = np.nonzero(values > 1e-8)  # eigenvalues of D below this are zero
    columns = vectors[contact, :, which]  # (m, d)
    rows = (contact[:, None] * d + np.arange(d)).ravel()
    m = len(contact)
    U = sp.csr_matrix((columns.ravel(), (rows, np.repeat(np.arange(m), d))), (k * d, m))
    U.eliminate_zeros()
    return U, values[contact, which], rho[contact]
