"""Where a layer without weight leaves a rigid base without friction (after Keer, Dundurs, Tsai
1972, J. Appl. Mech. 39, 1115-1120, for a rigid base): an integral equation, solved by Chebyshev
polynomials.

With p under the layer, q on it, s = k h and hats for cosine transforms, the lower surface rises by

    v(x) = (2 / (pi E')) int_0^oo [p^ (S + N) / 2 + q^ (S - N) / 2] cos(kx) dk / k,
    S = 2 sinh^2(s/2) / (sinh s + s),    N = 2 cosh^2(s/2) / (sinh s - s),

the sum of what squeezes the layer and what bends it. With p = sum_j d_j T_2j(x/b) / sqrt(1 -
x^2/b^2), p^(k) = pi b sum_j (-1)^j d_j J_2j(kb) balances the load if pi b d_0 = 1. v is even on the
base: v(x) = v(0) at as many places gives the other d_j. (S + N) / 2 - 1 decays exponentially; the 1
is the half-plane, whose part is 2 b d_j T_2j(x/b) / (2 j E'). The pressure ends with a root where
sum_j d_j = 0, which is the equation for b. E' cancels.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.special import jv

TERMS, NODES, FAR = 16, 400, 60.0


def receding_half_width(loaded: float, terms: int = TERMS) -> float:
    """b over the height of the layer for a uniform load on |x| < loaded (over the height)."""
    return _solved(loaded, terms)[0]


def receding_peak(loaded: float, terms: int = TERMS) -> float:
    """The pressure in the middle, over the load per height of the layer."""
    _, d = _solved(loaded, terms)
    return float(d @ (-1.0) ** np.arange(terms + 1))


def kernels(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """S and N."""
    with np.errstate(over="ignore"):
        squeezed = 2 * np.sinh(s / 2) ** 2 / (np.sinh(s) + s)
        return squeezed, 2 * np.cosh(s / 2) ** 2 / (np.sinh(s) - s)


def _solved(loaded: float, terms: int) -> tuple[float, np.ndarray]:
    b = float(brentq(lambda b: _pressure(b, loaded, terms).sum(), 0.5, loaded + 1.0))
    return b, _pressure(b, loaded, terms)


def _pressure(b: float, loaded: float, terms: int) -> np.ndarray:
    """The coefficients d_j."""
    t, w = np.polynomial.legendre.leggauss(NODES)
    k, w = (t + 1) * FAR / 2, w * FAR / 2
    squeezed, bent = kernels(k)
    own, other = (squeezed + bent) / 2 - 1, (squeezed - bent) / 2
    x = np.cos(np.pi * (np.arange(terms) + 0.5) / (2 * terms + 1)) * b  # all but the centre
    wave = (np.cos(np.outer(x, k)) - 1) * w / k  # (place, wave number)
    j = np.arange(terms + 1)
    spread = np.pi * b * (-1.0) ** j[:, None] * jv(2 * j[:, None], k * b)  # p^ of each d_j
    angles = np.arccos(x / b)
    plane = b * (np.cos(2 * np.outer(angles, j)) - (-1.0) ** j) / np.maximum(2 * j, 1)
    plane[:, 0] = 0.0
    columns = plane + wave @ (own * spread).T / np.pi
    load = wave @ (other * np.sin(k * loaded) / (k * loaded)) / np.pi
    first = 1 / (np.pi * b)
    rest = np.linalg.solve(columns[:, 1:], -load - first * columns[:, 0])
    return np.append(first, rest)
