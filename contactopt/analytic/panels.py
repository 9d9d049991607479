"""Integral equations on the contact |x| < a, mapped to the whole line by x = a tanh(v).

In v the edges lie at infinity and Cauchy's kernel depends on a difference alone: dx / (t - x)
becomes cosh(u) dv / (cosh(v) sinh(u - v)), so that stick and slip zones of every size are resolved
alike. Functions are even or odd: the unknowns are values at nodes v > 0. Between them stand
polynomials, on panels that shrink towards the stick limit v = b where the tractions are not smooth;
singular integrals of the polynomials are exact.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre

EVEN, ODD = 1, -1
ORDER = 12  # nodes per panel; even, so that zero is no node
RATIO = 0.25  # of neighbouring panels towards the stick limit
SMALLEST = 1e-5  # panel, relative to min(b, 1)
LARGEST_PANEL = 1.5  # panel; the kernels have poles at a distance of pi from the real line
TAIL = 16.0  # the grid ends at b + TAIL: with what lies beyond, e^-TAIL is lost
NEAR = 2.0  # half-lengths from a panel's centre up to which a singular kernel needs the exact rule

NODES, WEIGHTS = legendre.leggauss(ORDER)
# values -> P_m
TRANSFORM = (legendre.legvander(NODES, ORDER - 1) * WEIGHTS[:, None] * (np.arange(ORDER) + 0.5)).T
LEFT = ORDER // 2  # nodes of the central panel at v < 0


def _panel_edges(b: float) -> np.ndarray:
    """Right ends of the panels, less b: equal from the centre, refined beside b, ended at TAIL."""
    scale = min(b, 1.0)
    inward = [SMALLEST * scale]
    while inward[-1] / RATIO < 0.6 * scale:
        inward.append(inward[-1] / RATIO)
    rest = b - inward[-1]
    count = int(np.ceil(rest / LARGEST_PANEL + 0.5 - 1e-9))
    equal = rest * (np.arange(count) + 0.5) / (count - 0.5) - b
    outward = [SMALLEST * scale]
    while outward[-1] < TAIL:
        outward.append(min(outward[-1] / RATIO, outward[-1] + LARGEST_PANEL))
    return np.concatenate([equal[:-1], -np.array(inward[::-1]), [0.0], outward])


@dataclass(frozen=True, eq=False)
class Panels:
    """The grid for a stick limit b.

    Matrices take values (N,) of an even or odd function at the nodes to such values.

    Positions are kept as distances from b, exact where the panels are smallest.
    """

    b: float

    @cached_property
    def edges(self) -> np.ndarray:
        return _panel_edges(self.b)

    @cached_property
    def half(self) -> np.ndarray:
        return np.concatenate([[self.b + self.edges[0]], np.diff(self.edges) / 2])

    @cached_property
    def centre(self) -> np.ndarray:
        return np.concatenate([[-self.b], (self.edges[1:] + self.edges[:-1]) / 2])

    @cached_property
    def columns(self) -> np.ndarray:
        """Nodes less b, those of the central panel at v < 0 first."""
        return (self.centre[:, None] + self.half[:, None] * NODES).ravel()

    @cached_property
    def v(self) -> np.ndarray:
        """(N,) nodes > 0, ascending."""
        return self.b + self.columns[LEFT:]

    @cached_property
    def weights(self) -> np.ndarray:
        """(N,) of the integral over v > 0 of an even function."""
        return (self.half[:, None] * WEIGHTS).ravel()[LEFT:]

    @cached_property
    def stick(self) -> np.ndarray:
        return self.columns[LEFT:] < 0

    def evaluate(
        self, values: np.ndarray, v: np.ndarray, parity: int, mean: float = 0.0
    ) -> np.ndarray:
        """The function at v >= 0; even or odd about a mean; constant past the grid."""
        y = np.minimum(np.atleast_1d(v) - self.b, self.edges[-1])
        panel = np.searchsorted(self.edges[:-1], y, side="left")
        full = np.concatenate([mean + parity * (values[LEFT - 1 :: -1] - mean), values]).reshape(
            -1, ORDER
        )
        basis = legendre.legvander((y - self.centre[panel]) / self.half[panel], ORDER - 1)
        return np.asarray(np.sum(basis * (full @ TRANSFORM.T)[panel], axis=-1).reshape(np.shape(v)))

    def primitive(self, parity: int) -> np.ndarray:
        """Matrix of the integral from 0 to each node."""
        matrix, to_node, end = self._inside(parity)
        matrix[:LEFT, :LEFT] = to_node
        matrix[LEFT:, :LEFT] = end
        for half, start in zip(self.half[1:], range(LEFT, len(self.v), ORDER)):
            matrix[start + ORDER :, start : start + ORDER] = half * WEIGHTS
        return matrix

    def remainder(self, parity: int) -> np.ndarray:
        """Matrix of the integral from each node to the end of the grid; one more row: from 0."""
        inside, to_node, end = self._inside(parity)
        matrix = np.zeros((len(self.v) + 1, len(self.v)))
        matrix[:LEFT, :LEFT], matrix[-1, :LEFT] = end - to_node, end
        for half, start in zip(self.half[1:], range(LEFT, len(self.v), ORDER)):
            own = slice(start, start + ORDER)
            matrix[:start, own] = matrix[-1, own] = half * WEIGHTS
            matrix[own, own] = half * WEIGHTS - inside[own, own]
        return matrix

    def _inside(self, parity: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Integrals from each panel's left end (the central one's: 0) to its nodes, and its end."""
        from_zero, from_left = (
            legendre.legval(np.append(NODES, 1.0), legendre.legint(np.eye(ORDER), lbnd=low)).T
            @ TRANSFORM
            for low in (0.0, -1.0)
        )
        central = self.half[0] * _fold(from_zero, parity)
        matrix = np.zeros((len(self.v), len(self.v)))
        for half, start in zip(self.half[1:], range(LEFT, len(self.v), ORDER)):
            matrix[start : start + ORDER, start : start + ORDER] = half * from_left[:-1]
        return matrix, central[LEFT:-1], central[-1]

    def log_tanh(self, parity: int) -> np.ndarray:
        """(1/pi) int f(v) ln |tanh((u - v) / 2)| dv, from the primitive of 1 / (pi sinh)."""
        u, v, same = self.v[:, None], self.v, np.eye(len(self.v), dtype=bool)
        direct = np.abs(np.tanh(np.where(same, 1.0, self._distance()) / 2))
        mirror = np.tanh((u + v) / 2)
        if parity == EVEN:
            kernel = np.log(direct * mirror)
        # direct / mirror = (sinh u - sinh v) / (sinh u + sinh v), without cancellation where u << v
        else:
            ratio = np.sinh(np.minimum(u, v)) / np.sinh(np.maximum(u, v))
            far = ratio < 0.5
            kernel = np.where(
                far, -2 * np.arctanh(np.where(far, ratio, 0.0)), np.log(direct / mirror)
            )
        kernel = np.where(same, -np.log(2) + parity * np.log(mirror), kernel)
        return (kernel * self.weights + _fold(self._correction(log=True), parity)) / np.pi

    def hilbert(self, parity: int) -> np.ndarray:
        """(1/pi) int F(s) / (t - s) ds over |s| < 1, from values of F at s = tanh(v)."""
        u, v, same = self.v[:, None], self.v, np.eye(len(self.v), dtype=bool)
        product = np.where(same, 1.0, np.sinh(self._distance()) * np.sinh(u + v))
        shape = np.sinh(2 * u) if parity == EVEN else 2 * np.cosh(u) ** 2 * np.tanh(v)
        kernel = shape / product
        kernel = np.where(same, parity / np.sinh(2 * u), kernel)
        correction = self._correction(log=False) * (np.cosh(u) / np.cosh(self.b + self.columns))
        return (kernel * self.weights + _fold(correction, parity)) / np.pi

    def abel(self, parity: int) -> np.ndarray:
        """int_t^1 r p / sqrt(r^2 - t^2) dr (f even) or t int_t^1 p / sqrt(r^2 - t^2) dr."""
        u, v, y = self.v[:, None], self.b + self.columns, self.columns[LEFT:]
        local, panel = self._local(), np.arange(len(self.half))
        own = (np.arange(len(y)) + LEFT)[:, None] // ORDER
        near = (np.abs(local) < NEAR) | (panel == own)
        beyond = np.repeat(~near & (panel > own), ORDER, axis=1)
        root = np.sqrt(np.where(beyond, np.sinh(self.columns - y[:, None]) * np.sinh(v + u), 1.0))
        shape = np.cosh(u) * np.tanh(v) if parity == EVEN else np.sinh(u)
        full = np.where(beyond, shape * (self.half[:, None] * WEIGHTS).ravel() / root, 0.0)

        i, k = np.nonzero(near & (panel >= own))
        t, high = self.v[i], self.edges[k] - y[i]
        low = np.maximum(self.centre[k] - self.half[k] - y[i], 0.0)
        first, last = (np.sqrt(np.sinh(d) * np.sinh(2 * t + d))[:, None] for d in (low, high))
        nodes, weights = legendre.leggauss(ORDER + 4)
        # w^2 = sinh^2 v - sinh^2 u takes the root away
        w = (first + last) / 2 + (last - first) / 2 * nodes
        v = np.arcsinh(np.hypot(np.sinh(t)[:, None], w))
        distance = np.arcsinh(w**2 / np.sinh(v + t[:, None]))
        weights = (last - first) / 2 * weights / np.cosh(v)
        grows = np.cosh if parity == EVEN else np.sinh
        weights = grows(t)[:, None] * weights / grows(v)
        basis = legendre.legvander(
            (distance + (y[i] - self.centre[k])[:, None]) / self.half[k][:, None], ORDER - 1
        )
        full[i[:, None], k[:, None] * ORDER + np.arange(ORDER)] = (
            np.einsum("pg,pgm->pm", weights, basis) @ TRANSFORM
        )
        return _fold(full, parity)

    def _distance(self) -> np.ndarray:
        return self.columns[LEFT:, None] - self.columns[LEFT:]

    def _local(self) -> np.ndarray:
        """Where each node lies from each panel's centre, in half-lengths."""
        return (self.columns[LEFT:, None] - self.centre) / self.half

    def _correction(self, log: bool) -> np.ndarray:
        """Exact less Gauss rule (without u = v) for ln |u - v| or 1 / (u - v) on near panels."""
        local = self._local()
        i, k = np.nonzero(np.abs(local) < NEAR)
        moments = (_log_moments if log else _cauchy_moments)(local[i, k]) @ TRANSFORM
        columns, half = k[:, None] * ORDER + np.arange(ORDER), self.half[k][:, None]
        distance = self.columns[LEFT:][i][:, None] - self.columns[columns]
        same = distance == 0
        distance = np.where(same, 1.0, distance)
        full = np.zeros((len(self.v), len(self.columns)))
        if log:
            moments = half * (moments + np.log(half) * WEIGHTS)
        kernel = np.log(np.abs(distance)) if log else 1 / distance
        full[i[:, None], columns] = moments - np.where(same, 0.0, half * WEIGHTS * kernel)
        return full


def _fold(full: np.ndarray, parity: int) -> np.ndarray:
    """Columns of the central panel at v < 0 added to their mirror images."""
    folded = full[:, LEFT:].copy()
    folded[:, :LEFT] += parity * full[:, LEFT - 1 :: -1]
    return folded


def _cauchy_moments(x: np.ndarray) -> np.ndarray:
    """int_-1^1 P_m(t) / (x - t) dt = 2 Q_m(x), (k, ORDER): DLMF 14.12.13, principal values."""
    return np.where(_away(x), _by_quadrature(x, log=False), 2 * _second_kind(x)[:, :ORDER])


def _log_moments(x: np.ndarray) -> np.ndarray:
    """int_-1^1 P_m(t) ln |x - t| dt, (k, ORDER), by (2 m + 1) P_m = (P_m+1 - P_m-1)'."""
    second = _second_kind(x)
    higher = 2 * (second[:, 2:] - second[:, : ORDER - 1]) / (2 * np.arange(1, ORDER) + 1)
    zeroth = (x + 1) * np.log(np.abs(x + 1)) - (x - 1) * np.log(np.abs(x - 1)) - 2
    return np.where(_away(x), _by_quadrature(x, log=True), np.column_stack([zeroth, higher]))


def _away(x: np.ndarray) -> np.ndarray:
    return np.abs(x[:, None]) > 1.2  # half-lengths, where a rule of 40 nodes is exact


def _by_quadrature(x: np.ndarray, log: bool) -> np.ndarray:
    nodes, weights = legendre.leggauss(40)
    distance = np.where(_away(x), x[:, None], 2.0) - nodes
    kernel = np.log(np.abs(distance)) if log else 1 / distance
    return kernel @ (legendre.legvander(nodes, ORDER - 1) * weights[:, None])


def _second_kind(x: np.ndarray) -> np.ndarray:
    """Legendre functions Q_0 .. Q_ORDER by their forward recurrence."""
    values = [np.log(np.abs((1 + x) / (1 - x))) / 2]
    values.append(x * values[0] - 1)
    for m in range(1, ORDER):
        values.append(((2 * m + 1) * x * values[m] - m * values[m - 1]) / (m + 1))
    return np.column_stack(values)
