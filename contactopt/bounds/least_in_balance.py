"""A quadratic form made least under linear equations, by an augmented Lagrangian."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from contactopt.errors import InputError

SOFT = 1e-12  # of the scaled form: equations leave nothing free
STIFF = 1e6  # of the equations, in the same scale


class LeastInBalance:
    """The minimiser of x' K x / 2 + slope' x under C x = values. The system is factorised once, for
    all slopes and values. InputError for elements without a height, for which K is singular.
    """

    def __init__(self, K: sp.csr_matrix, C: sp.csr_matrix):
        self._scale = 1 / np.sqrt(K.diagonal())
        D = sp.diags(self._scale)
        self._K, C = D @ K @ D, C @ D
        self._size = 1 / np.sqrt(np.asarray(C.multiply(C).sum(axis=1)).ravel())
        self._C = sp.diags(self._size) @ C
        system = self._K + STIFF * (self._C.T @ self._C) + SOFT * sp.eye(len(self._scale))
        options = {"SymmetricMode": True}
        try:
            self._factors = splu(
                system.tocsc(), "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options
            )
        except RuntimeError as error:
            raise InputError("the mesh has triangles too thin for a bound.") from error

    def find(self, slope: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, float]:
        """x, and what C x misses over the largest share of x in it."""
        K, C, slope, values = self._K, self._C, self._scale * slope, self._size * values
        x, multipliers, missed = np.zeros(len(slope)), np.zeros(len(values)), -values
        found = np.inf
        for number in range(20):  # of the multipliers, at most
            x -= self._factors.solve(K @ x + slope + C.T @ (multipliers + STIFF * missed))
            missed = C @ x - values
            multipliers += STIFF * missed
            largest = float((abs(C) @ np.abs(x)).max(initial=0.0)) or 1.0
            found = float(np.abs(missed).max(initial=0.0)) / largest
            if number and found < 1e-11:  # of the largest share in an equation
                break
        return self._scale * x, found
