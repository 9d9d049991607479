"""Where a plane contact on layers ends: an integral equation, solved by Chebyshev polynomials.

Under a pressure p that is even, with p^ its cosine transform, the surface sinks by

    v(x) = (2 / (pi E')) int_0^oo p^(k) M(k) cos(kx) dk / k.

M is 1 on a half-plane, and M - 1 decays exponentially on layers. With p = sum_j d_j T_2j(x/b) /
sqrt(1 - x^2/b^2), p^(k) = pi b sum_j (-1)^j d_j J_2j(kb) balances a force P if pi b d_0 = P. The
shape v(x) - v(0) at as many places gives the other d_j, to which the 1 of the half-plane adds
2 b d_j T_2j(x/b) / (2 j E'). The pressure ends with a root where sum_j d_j = 0, which is the
equation for b.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq
from scipy.special import jv

TERMS, NODES, FAR = 16, 400, 60.0
_t, _w = np.polynomial.legendre.leggauss(NODES)
K, W = (_t + 1) * FAR / 2, _w * FAR / 2  # wave numbers and their weights


def zone_of(
    fading: np.ndarray,
    shape: Callable[[np.ndarray], np.ndarray],
    force: float,
    between: tuple[float, float],
    terms: int = TERMS,
) -> tuple[float, np.ndarray]:
    """The half-width b and the numbers d_j (terms + 1,).

    fading   (NODES,) M - 1 at the wave numbers K
    shape    x (n,) -> E' (v(x) - v(0)) / 2
    between  two half-widths with b between them
    """

    def numbers(b: float) -> np.ndarray:
        x = np.cos(np.pi * (np.arange(terms) + 0.5) / (2 * terms + 1)) * b  # all but the centre
        j = np.arange(terms + 1)
        plane = b * (np.cos(2 * np.outer(np.arccos(x / b), j)) - (-1.0) ** j) / np.maximum(2 * j, 1)
        plane[:, 0] = 0.0
        columns = plane + waves(x) @ (fading * transforms(b, terms)).T / np.pi
        first = force / (np.pi * b)
        rest = np.linalg.solve(columns[:, 1:], shape(x) - first * columns[:, 0])
        return np.append(first, rest)

    b = float(brentq(lambda b: numbers(b).sum(), *between, xtol=1e-14))
    return b, numbers(b)


def waves(x: np.ndarray) -> np.ndarray:
    """(cos(kx) - 1) dk / k, (n, NODES)."""
    return np.asarray((np.cos(np.outer(x, K)) - 1) * W / K)


def transforms(b: float, terms: int = TERMS) -> np.ndarray:
    """p^ of each d_j at the wave numbers K, (terms + 1, NODES)."""
    j = np.arange(terms + 1)[:, None]
    return np.asarray(np.pi * b * (-1.0) ** j * jv(2 * j, K * b))


def peak_of(d: np.ndarray) -> float:
    """The pressure in the middle."""
    return float(d @ (-1.0) ** np.arange(len(d)))
