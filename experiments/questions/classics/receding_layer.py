"""Where a layer without weight leaves a rigid base without friction (after Keer, Dundurs, Tsai
1972, J. Appl. Mech. 39, 1115-1120, for a rigid base).

With p under the layer, q on it, s = k h and hats for cosine transforms, the lower surface rises by

    v(x) = (2 / (pi E')) int_0^oo [p^ (S + N) / 2 + q^ (S - N) / 2] cos(kx) dk / k,
    S = 2 sinh^2(s/2) / (sinh s + s),    N = 2 cosh^2(s/2) / (sinh s - s),

the sum of what squeezes the layer and what bends it. It is even on the base. E' cancels.
"""

from __future__ import annotations

import numpy as np

from experiments.questions.classics.zone_equation import TERMS, K, peak_of, waves, zone_of


def receding_half_width(loaded: float, terms: int = TERMS) -> float:
    """b over the height of the layer for a uniform load on |x| < loaded (over the height)."""
    return _solved(loaded, terms)[0]


def receding_peak(loaded: float, terms: int = TERMS) -> float:
    """The pressure in the middle, over the load per height of the layer."""
    return peak_of(_solved(loaded, terms)[1])


def kernels(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """S and N."""
    with np.errstate(over="ignore"):
        squeezed = 2 * np.sinh(s / 2) ** 2 / (np.sinh(s) + s)
        return squeezed, 2 * np.cosh(s / 2) ** 2 / (np.sinh(s) - s)


def _solved(loaded: float, terms: int) -> tuple[float, np.ndarray]:
    squeezed, bent = kernels(K)
    load = (squeezed - bent) / 2 * np.sin(K * loaded) / (K * loaded) / np.pi
    fading = (squeezed + bent) / 2 - 1
    return zone_of(fading, lambda x: -waves(x) @ load, 1.0, (0.5, loaded + 1.0), terms)
