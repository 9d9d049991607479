"""Coulomb friction under monotone normal load, fully coupled: rigid flat punches, and round bodies
built from them.

Self-similar: one static step from zero is exact (Spence's theorem). On a contact |x| < a, with E*/2
the unit of stress, p the pressure, q the shear traction on the lower body away from the centre and
Dundurs' beta:
    normal displacement constant on |x| < a,   no tangential displacement on |x| < c,   q = mu p
                                               sign(x) on c < |x| < a.
Plane strain, H f = (1/pi) int f(s) / (x - s) ds:     H p = beta q on |x| < a,   H q = -beta p on
|x| < c. Axisymmetric, Abel transforms P = int_t^a r p / sqrt(r^2 - t^2) dr and Q = t int_t^a q /
sqrt(r^2 - t^2) dr:
    P + beta H Q = E* approach / 2 on t < a,   Q - beta H P = 0 on t < c.
c is where the tractions join without a singularity: with a larger stick zone q would go to +inf
there, with a smaller one to -inf. Textbook formulas drop beta q (Goodman's approximation); here
they give the first guess. Sources: Spence (1968), Proc. R. Soc. A 305, 55-80; Spence (1973), An
eigenvalue problem for elastic contact with finite friction, Proc. Camb. Phil. Soc. 73, 249-268;
Spence (1975), J. Elasticity 5, 297-319. Half-space: Johnson (1985), eq (2.25), (3.18).
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from contactopt.analytic.panels import EVEN, LEFT, ODD, ORDER, TRANSFORM, Panels
from contactopt.analytic.reference import check_beta
from contactopt.checks import check_number

# artanh(c/a): below, c/a is called zero; above, it is one in double precision
SMALLEST_ARTANH, LARGEST_ARTANH = 1e-9, 19.5


@dataclass(frozen=True, eq=False)
class UnitPunch:
    """The rigid flat punch with a = 1 and unit force, for beta >= 0.

    p, q      values of (pressure, shear) sqrt(1 - x^2) at the nodes x = tanh(v)
    approach  E* a approach / force, axisymmetric; nan in plane strain
    """

    panels: Panels
    p: np.ndarray
    q: np.ndarray
    approach: float = np.nan

    @property
    def stick_ratio(self) -> float:
        b = self.panels.b
        return 0.0 if b < 1.01 * SMALLEST_ARTANH else float(np.tanh(b))

    def pressure(self, v: np.ndarray) -> np.ndarray:
        return self.panels.evaluate(self.p, v, EVEN)

    def shear(self, v: np.ndarray) -> np.ndarray:
        return self.panels.evaluate(self.q, v, ODD)

    @cached_property
    def centre(self) -> tuple[float, float]:
        """Pressure and slope of the shear traction at x = 0."""
        zero, ratio = np.zeros(1), self.q / np.tanh(self.panels.v)
        return float(self.pressure(zero)[0]), float(self.panels.evaluate(ratio, zero, EVEN)[0])

    @cached_property
    def _history(self) -> tuple[np.ndarray, np.ndarray]:
        """int_v^inf of p / x^2 and q / x^2, dx, without their poles in the central panel."""
        v, central = self.panels.v, np.arange(len(self.p)) < LEFT
        p0, slope = (value * central for value in self.centre)
        p = (self.p * np.cosh(v) - p0) / np.sinh(v) ** 2
        q = (self.q * np.cosh(v) / np.tanh(v) - slope) / (np.sinh(v) * np.cosh(v))
        return self.panels.remainder(EVEN) @ p, self.panels.remainder(ODD) @ q

    def grown_pressure(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """x int_x^1 p(s) / s^2 ds: punches of all sizes up to one, in proportion to size."""
        *values, mean = self._history[0]
        pole = self.centre[0] * np.maximum(1 - x / np.tanh(self.panels.half[0]), 0.0)
        return pole + x * self.panels.evaluate(np.array(values), v, ODD, mean)

    def grown_shear(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        relative = x / np.tanh(self.panels.half[0])
        pole = -self.centre[1] * np.log(np.where((relative > 0) & (relative < 1), relative, 1.0))
        return x * (pole + self.panels.evaluate(self._history[1][:-1], v, EVEN))


@lru_cache(maxsize=64)
def unit_punch(mu: float, beta: float, axisymmetric: bool) -> UnitPunch:
    """Solve for the stick zone under a rigid flat punch of unit half-width, mu > 0, 0 < beta < 1.

    The ratio c/a is within about 1e-7 of the exact one. The tractions are within about 1e-6 away
    from x = c and the edges.
    """
    from scipy.optimize import brentq

    solve = _axisymmetric if axisymmetric else _plane

    def excess(log_b: float) -> float:
        return _excess(solve(float(np.exp(log_b)), mu, beta), mu)

    low, high = np.log(SMALLEST_ARTANH), np.log(LARGEST_ARTANH)
    # The right zone is the smallest whose excess vanishes; under a bonded punch q = mu p at 2 eta v
    # = atan(mu).
    bonded = np.log(np.arctan(mu) * np.pi / (2 * np.arctanh(beta)))
    start = float(np.clip(min(bonded, _uncoupled(mu, beta, axisymmetric)), low, high))
    step, sign = 0.2, np.sign(excess(start))
    end = start
    while sign * excess(end := float(np.clip(end - sign * step, low, high))) > 0:
        if end in (low, high):
            return solve(float(np.exp(end)), mu, beta)
        step *= 1.5
    root = brentq(excess, *sorted((start, end)), xtol=1e-9, rtol=1e-12) if sign else start
    return solve(float(np.exp(root)), mu, beta)


def stick_ratio(mu: float, beta: float, axisymmetric: bool = False) -> float:
    """Half-width of the stick zone over that of contact, c / a, under growing normal load.

    It is the same for a rigid flat punch and for round bodies with quadratic gaps. It is right to
    1e-6; values below 1e-9 are returned as zero.

    Parameters
    ----------
    mu : Friction coefficient, at least 0 [-].
    beta : Dundurs' constant, of size below one [-]. Its sign only turns the shear traction. Zero
        means no slip, c / a = 1.
    axisymmetric : Whether the punch is a disc rather than a strip.

    Returns
    -------
    c / a [-].
    """
    check_number("the friction coefficient mu", mu, low=0.0, closed=True)
    check_beta(beta)
    if mu == 0 or beta == 0:
        return float(mu > 0)
    return unit_punch(float(mu), abs(float(beta)), axisymmetric).stick_ratio


def _plane(b: float, mu: float, beta: float) -> UnitPunch:
    """Both equations integrated once: logarithmic kernels make the discrete equations stable."""
    panels = Panels(b)
    slip, stick = ~panels.stick, panels.stick
    even, odd = panels.log_tanh(EVEN), panels.log_tanh(ODD)
    sum_even, sum_odd = panels.primitive(EVEN), panels.primitive(ODD)
    p, q = _eliminate(
        even - beta * mu * sum_odd * slip,
        -beta * sum_odd[:, stick],
        beta * sum_even[stick] + mu * odd[stick] * slip,
        odd[np.ix_(stick, stick)],
    )
    force = 2 * panels.weights @ (p / np.cosh(panels.v))
    return UnitPunch(panels, p / force, np.concatenate([q, mu * p[slip]]) / force)


def _axisymmetric(b: float, mu: float, beta: float) -> UnitPunch:
    """The displacement under the punch is one half in units of 2 / E*."""
    panels = Panels(b)
    slip, stick = ~panels.stick, panels.stick
    even, odd = panels.abel(EVEN), panels.abel(ODD)
    hilbert_p, hilbert_q = panels.hilbert(EVEN)[stick] @ even, panels.hilbert(ODD) @ odd
    p, q = _eliminate(
        even + beta * mu * hilbert_q * slip,
        beta * hilbert_q[:, stick],
        mu * odd[stick] * slip - beta * hilbert_p,
        odd[np.ix_(stick, stick)],
    )
    force = 4 * panels.weights @ (even @ p / np.cosh(panels.v) ** 2)
    return UnitPunch(panels, p / force, np.concatenate([q, mu * p[slip]]) / force, 2 / force)


def _eliminate(
    pp: np.ndarray, pq: np.ndarray, qp: np.ndarray, qq: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Solve pp p + pq q = 1, qp p + qq q = 0 by blocks: pivots across them add rounding errors."""
    columns = np.linalg.solve(pp, np.column_stack([np.ones(len(pp)), pq]))
    matrix, right = qq - qp @ columns[:, 1:], -qp @ columns[:, 0]
    scale = 1 / np.abs(matrix).max(axis=1)
    q = np.linalg.solve(matrix * scale[:, None], right * scale)
    return columns[:, 0] - columns[:, 1:] @ q, q


def _excess(punch: UnitPunch, mu: float) -> float:
    """q - mu p at the end of the stick zone: positive where the zone is too large."""
    end = np.count_nonzero(punch.panels.stick)
    panel = slice(end - ORDER, end)
    return float(np.sum(TRANSFORM @ (punch.q[panel] - mu * punch.p[panel])))


def _uncoupled(mu: float, beta: float, axisymmetric: bool) -> float:
    """ln artanh(c/a) without beta q: K'(k)/K(k) or, on a circle, b / tanh b from beta and mu."""

    from scipy.optimize import brentq
    from scipy.special import ellipkm1

    def difference(log_b: float) -> float:
        b = np.exp(log_b)
        complete = ellipkm1(np.tanh(b) ** 2)  # K'
        if axisymmetric:
            return float(complete * mu / beta - b / np.tanh(b))
        return float(complete / ellipkm1(1 / np.cosh(b) ** 2) - beta / mu)

    low, high = np.log(SMALLEST_ARTANH), np.log(LARGEST_ARTANH)
    if difference(low) * difference(high) > 0:
        return low if difference(low) < 0 else high
    return float(brentq(difference, low, high))
