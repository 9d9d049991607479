"""The interface operator Q as an array, a scipy sparse matrix in compressed rows (csr_array), or an
InterfaceOperator known by its products, of which each costs one solve per body. Methods that need
the entries, one product for each interface unknown, ask for `dense(Q)`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from copy import copy
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy.sparse as sp
from scipy.linalg.lapack import dlange, dpocon, dpotrf
from scipy.sparse.linalg import LinearOperator

from contactopt.errors import InputError
from contactopt.linear.counter import Counter
from contactopt.linear.saddle_point import CoupledForm, in_equilibrium
from contactopt.linear.stacked import Stacked

log = logging.getLogger(__name__)

FORMS = ("auto", "explicit", "implicit")  # of Q
NOISE = 1e-13  # relative size of what rounding leaves of a zero
FINEST = 1e-11  # accuracy of products that is not asked for more
DOUBTFUL = 1e-8  # inverse of a condition above which rounding is felt
POWER_STEPS, MARGIN = 10, 1.1  # towards a largest eigenvalue, and the factor on what they find
COLUMNS = 64  # of an inverse or of Q that are made at a time, which bounds the memory beside it
# bytes of an array Q from which on its size is logged: a quarter of a gigabyte
NOTABLE_BYTES = 2**28
# of an array Q; those who factorise it need another one or two of its size
MOST_BYTES = 8_000_000_000

# (X (n,) or (n, j), relative accuracy or None for the best there is) -> the product with X, of its
# shape
Product = Callable[[np.ndarray, float | None], np.ndarray]


class InterfaceOperator(LinearOperator):
    """Q (n, n), symmetric positive semidefinite, by its products [length / force].

    product    x (n,) or (n, j), relative accuracy or None (the best there is) -> Q x
    diagonal   (n,) diagonal of Q or an estimate of it, exactly 0 where a component cannot move
    entries    () -> Q (n, n) where there is a cheaper way to it than n products
    accuracy   relative, of the products; None: the best there is
    inexact    whether a lower accuracy makes a product cheaper
    coupled    the same Q before condensation, where the bodies are solved by iteration; None
               elsewhere
    counter    counts the columns multiplied; by default one of its own. Operators made from another
               one share its counter
    held       (n,) mask of the components that cannot move; by default those whose diagonal is 0
    """

    def __init__(
        self,
        product: Product,
        diagonal: np.ndarray,
        entries: Callable[[], np.ndarray] | None = None,
        accuracy: float | None = None,
        inexact: bool = False,
        coupled: CoupledForm | None = None,
        counter: Counter | None = None,
        held: np.ndarray | None = None,
    ):
        super().__init__(np.dtype(float), (len(diagonal), len(diagonal)))
        self.product, self.diagonal, self.entries = product, diagonal, entries
        self.accuracy, self.inexact, self.coupled = accuracy, inexact, coupled
        self.held = self.diagonal == 0 if held is None else held
        self.counter = counter or Counter()
        self.known: tuple[np.ndarray, Stacked] | None = None

    @property
    def form(self) -> Form:
        return "products" if self.coupled is None else "bodies"

    @property
    def products(self) -> int:
        """Number of columns multiplied so far."""
        return self.counter.total

    def knowing(self, x: np.ndarray, X: Stacked) -> InterfaceOperator:
        """The operator whose products start from displacements X of the bodies that are close to
        theirs.
        """
        known = copy(self)
        known.known = x.copy(), X
        return known

    def _matmat(self, X: np.ndarray) -> np.ndarray:
        if self.known is not None and self.coupled is not None and X.shape[1] == 1:
            x, near = self.known
            if np.array_equal(X[:, 0], x):
                better = in_equilibrium(self.coupled, x, self.accuracy or FINEST, first=near)
                return self.coupled.moved(better, x)[:, None]
        self.counter.total += X.shape[1]
        return np.asarray(self.product(X, self.accuracy))

    def _matvec(self, x: np.ndarray) -> np.ndarray:
        return self._matmat(x.reshape(-1, 1))[:, 0]

    def _rmatvec(self, x: np.ndarray) -> np.ndarray:
        return self._matvec(x)

    def _adjoint(self) -> LinearOperator:
        return self

    def to_dense(self) -> np.ndarray:
        """Q (n, n), symmetric to the last digit, by n products or a cheaper way."""
        n = self.shape[0]
        check_dense(n)
        if self.entries is not None:
            return self.entries()
        Q = np.empty((n, n))
        for first in range(0, n, COLUMNS):
            unit = np.zeros((n, min(COLUMNS, n - first)))
            unit[first + np.arange(unit.shape[1]), np.arange(unit.shape[1])] = 1.0
            Q[:, first : first + unit.shape[1]] = self @ unit
        return np.asarray((Q + Q.T) / 2)

    def scaled(
        self, factor: float, added: np.ndarray, counter: Counter | None = None
    ) -> InterfaceOperator:
        """The operator factor Q + diag(added), with added (n,), and by default a new counter."""

        def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
            return factor * self.product(X, accuracy) + added[:, None] * X

        entries = self.entries
        exact = None if entries is None else lambda: factor * entries() + np.diag(added)
        coupled = None if self.coupled is None else self.coupled.scaled(factor, added)
        diagonal = factor * self.diagonal + added
        return InterfaceOperator(
            product, diagonal, exact, self.accuracy, self.inexact, coupled, counter, self.held
        )

    def loosened(self, accuracy: float) -> InterfaceOperator:
        """The same operator with less accurate products, counted together with its own."""
        loose = copy(self)
        loose.accuracy = accuracy
        return loose

    def block(self, unknowns: np.ndarray) -> InterfaceOperator:
        """Q (m, m) on some unknowns (m,), such as its normal block; both count together."""
        unknowns = np.asarray(unknowns)

        def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
            full = np.zeros((self.shape[0], X.shape[1]))
            full[unknowns] = X
            return self.product(full, accuracy)[unknowns]

        entries = self.entries
        exact = None if entries is None else lambda: entries()[np.ix_(unknowns, unknowns)]
        diagonal, held = self.diagonal[unknowns], self.held[unknowns]
        return InterfaceOperator(
            product, diagonal, exact, self.accuracy, self.inexact, None, self.counter, held
        )


Form = Literal["array", "sparse", "products", "bodies", "convolution"]
Interface: TypeAlias = Any  # np.ndarray, sp.csr_array (scipy has no types) or InterfaceOperator


def form(Q: Interface) -> Form:
    """How Q is known: as 'array' or 'sparse', or by products alone ('bodies' or 'convolution')."""
    if isinstance(Q, np.ndarray):  # most often
        return "array"
    return Q.form if isinstance(Q, InterfaceOperator) else "sparse"


def ill_conditioned(Q: np.ndarray) -> bool:
    """Whether an array Q (n, n), if it is symmetric, is not definite or has a condition above
    1 / DOUBTFUL.
    """
    factor, failed = dpotrf(Q.T, clean=False)
    return bool(failed or dpocon(factor, dlange("1", Q.T))[0] < DOUBTFUL)


def has_entries(Q: Interface) -> bool:
    """Whether the entries of Q are there."""
    return form(Q) in ("array", "sparse")


def sparse(Q: object) -> sp.csr_array:
    """A sparse matrix as new, canonical compressed rows of floats without zeros."""
    rows = sp.csr_array(Q, dtype=float, copy=True)
    rows.sum_duplicates()
    rows.eliminate_zeros()
    return rows


def check_dense(n: int) -> None:
    """Log the size of Q as an array, a warning from NOTABLE_BYTES; InputError beyond MOST_BYTES."""
    size = 8 * n**2
    if size > MOST_BYTES:
        raise InputError(
            f"Q as an array of {n} x {n} entries would take {size:,} bytes, more than"
            f" {MOST_BYTES:,}; take Q = 'implicit' and a method that uses products with Q, such as"
            " newton, or fewer elements."
        )
    level = logging.WARNING if size >= NOTABLE_BYTES else logging.INFO
    log.log(level, "forming Q as an array of %d x %d entries: %s bytes", n, n, f"{size:,}")


def dense(Q: Interface) -> np.ndarray:
    """Q (n, n) as an array; InputError if it would be larger than MOST_BYTES."""
    if isinstance(Q, InterfaceOperator):
        return Q.to_dense()
    if not sp.issparse(Q):
        return Q
    check_dense(Q.shape[0])
    return np.asarray(Q.toarray())


def diagonal(Q: Interface) -> np.ndarray:
    """The diagonal (n,) of Q [length / force], or the estimate of it that an operator has."""
    if isinstance(Q, InterfaceOperator):
        return Q.diagonal
    return np.asarray(Q.diagonal())


def row_sizes(Q: np.ndarray | sp.csr_array) -> np.ndarray:
    """The largest |Q_ij| of each row (n,) [length / force]."""
    if sp.issparse(Q):
        return np.asarray(abs(Q).max(axis=1).toarray()).ravel() if Q.shape[0] else np.zeros(0)
    return np.asarray(np.abs(Q).max(axis=1, initial=0.0))


def asymmetry(Q: Interface) -> float:
    """max |Q - Q'| / max |Q|, which is 0 for an operator by definition."""
    if isinstance(Q, InterfaceOperator):
        return 0.0
    skew: Iterable[np.ndarray]
    if sp.issparse(Q):
        whole, skew = [Q.data], [(Q - Q.T).data]
    else:  # by strips, which stay in the processor's memory
        strips = range(0, len(Q), COLUMNS)
        whole = [Q[i : i + COLUMNS] for i in strips]
        skew = (rows[:, i:] - Q[i:, i : i + COLUMNS].T for i, rows in zip(strips, whole))
    size = max((float(np.abs(part).max(initial=0.0)) for part in whole), default=0.0)
    worst = max((float(np.abs(part).max(initial=0.0)) for part in skew), default=0.0)
    return worst / size if size > 0 else 0.0


def eigenvalue_bound(Q: np.ndarray | sp.csr_array) -> float:
    """A number above the largest eigenvalue of a semidefinite Q, by power steps; 1 for a zero Q."""
    n, value = Q.shape[0], 0.0
    v = (1 + 0.1 * np.cos(1.0 + np.arange(n))).astype(Q.dtype)
    for _ in range(POWER_STEPS if n else 0):
        v /= np.linalg.norm(v)
        v = Q @ v
        value = float(np.linalg.norm(v))
        if value == 0.0:
            break
    return MARGIN * value or 1.0


def held(Q: Interface) -> np.ndarray:
    """The mask (n,) of the components that cannot move: they are coupled to no other one."""
    if isinstance(Q, InterfaceOperator):
        return Q.held
    size = abs(Q)
    coupling = np.asarray(size.sum(axis=1)).ravel() - size.diagonal()
    return np.asarray(coupling <= NOISE * row_sizes(Q).max(initial=0.0))


def shifted(Q: Interface, added: np.ndarray) -> Interface:
    """Q + diag(added), of the same form as Q; products with it count with those of Q."""
    if sp.issparse(Q):
        return sp.csr_array(Q + sp.diags_array(added))
    if not isinstance(Q, InterfaceOperator):
        return Q + np.diag(added)
    return Q.scaled(1.0, added, Q.counter)


def turned(Q: Interface, S: sp.csr_array) -> Interface:
    """S Q S for a symmetric regular S, of the same form as Q."""
    if sp.issparse(Q):
        return sp.csr_array(S @ Q @ S)
    if not isinstance(Q, InterfaceOperator):
        return S @ (S @ Q.T).T

    def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
        return np.asarray(S @ Q.product(S @ X, accuracy))

    entries, held = Q.entries, np.asarray(abs(S) @ ~Q.held) == 0
    exact = None if entries is None else lambda: S @ (S @ entries()).T
    estimate = S.multiply(S) @ Q.diagonal
    return InterfaceOperator(product, estimate, exact, Q.accuracy, Q.inexact, held=held)


def block(Q: Interface, unknowns: np.ndarray) -> Interface:
    """Q on some unknowns (m,) alone, of the same form; products count with those of Q."""
    if sp.issparse(Q):
        return sp.csr_array(Q[unknowns][:, unknowns])
    return Q.block(unknowns) if isinstance(Q, InterfaceOperator) else Q[np.ix_(unknowns, unknowns)]


def loosened(Q: Interface, accuracy: float) -> Interface:
    """Q with products no more accurate than asked, or Q where this saves no work."""
    accuracy = max(accuracy, FINEST)
    return Q.loosened(accuracy) if isinstance(Q, InterfaceOperator) and Q.inexact else Q
