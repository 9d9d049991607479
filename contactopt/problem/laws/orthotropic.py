"""Coulomb friction that depends on the direction of slip, as on machined surfaces.

A tangential force lies in an ellipse. With e_1 and e_2 the axes of friction in the plane of the
contact and M = mu_1 e_1 e_1' + mu_2 e_2 e_2',

    |M^-1 r_t| <= r_n,  and where u_t != 0:  r_t = -r_n M^2 u_t / |M u_t|.

The second condition is maximal dissipation: among all forces of the ellipse, r_t makes -r_t' u_t
largest, which is then r_n |M u_t|. The slip is therefore normal to the ellipse, u_t = -s M^-2 r_t
with s >= 0, and parallel to the force only along the axes or where mu_1 = mu_2. The support
function |M u_t| of the ellipse of r_n = 1 takes the place of mu |u_t| in De Saxce's form: the
opening is g = |M u_t|, and r is the projection of r - rho (u + g n) on the elliptic cone.

A change of variables makes it Coulomb's law. With m = max(mu_1, mu_2) and S = M / m let

    r_t = S y_t,    v_t = S u_t,    so that    |y_t| <= m r_n,    y_t = -m r_n v_t / |v_t|,

while r_n, u_n and the power r_t' u_t = y_t' v_t stay. An interface problem keeps its form, with
S Q S, S q and S V in place of Q, q and V. Every method therefore solves this law as it solves
Coulomb's: the driver hands it the problem in y and v (contactopt.problem.scaling.isotropic) and
takes its iterates back. The certificate and the derivatives are computed in r and u, where forces
and displacements have one scale each, with Alart and Curnier's map: y_t is projected on the
ellipse. Where mu_1 = mu_2, S is the identity and all numbers are those of Coulomb's law.

In the plane the second axis is normal to the plane, in which nothing moves: the force across does
what it must, and in the plane the friction coefficient is |M e|, with e the direction of the
contact line. Without an angle this is mu_1.

Sources: Michalowski, Mroz (1978), Associated and non-associated sliding rules in contact friction
problems; De Saxce, Feng (1998), The bipotential method.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from contactopt.errors import InputError
from contactopt.problem.cones import split, unit
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.problem.laws.law import Law, Projected
from contactopt.problem.laws.place import Place


@dataclass(frozen=True, eq=False)
class Orthotropic(Law):
    """Coulomb friction with two coefficients, as at the top of this module.

    mu_1, mu_2  (k,) friction coefficients along the two axes of friction; both positive or both 0
    angle       (k,) from the first tangential axis of the contact frame to the first axis of
                friction [rad]
    """

    mu_1: np.ndarray
    mu_2: np.ndarray
    angle: np.ndarray = 0.0  # type: ignore[assignment]
    directed = True

    def __post_init__(self) -> None:
        # an axis has no sign
        object.__setattr__(self, "angle", np.mod(self.angle, np.pi))
        super().__post_init__()
        if np.any((self.mu_1 > 0) != (self.mu_2 > 0)):
            raise InputError(
                "mu_1 and mu_2 of orthotropic friction must be positive, or both zero; take a small"
                " number for a direction of little friction."
            )

    @classmethod
    def of_place(cls, values: np.ndarray, place: Place) -> Orthotropic:
        """From one coefficient, or two, (2,) or (2, k), along the scene's direction and across."""
        k = len(place.areas)
        if values.shape not in ((), (2,), (2, k)):
            raise InputError(
                "orthotropic friction has two coefficients, mu = [along, across] its direction, for"
                f" all contacts or for each of them, shape {(2, k)}; got {values.shape}."
            )
        pair = values if values.ndim == 2 else np.broadcast_to(values, (k, 2)).T
        same = values.ndim == 0  # whatever the direction
        return cls(pair[0], pair[1], np.zeros(k) if same else place.angles())

    @property
    def coefficient(self) -> np.ndarray:
        """(k,) the larger of both coefficients."""
        return np.maximum(self.mu_1, self.mu_2)

    @property
    def plain(self) -> Coulomb:
        return Coulomb(self.coefficient)

    def stretch(self, dim: int) -> np.ndarray:
        radii, turn = self._axes(dim)
        largest = self.coefficient[:, None]
        less = np.where(largest > 0, 1 - radii / np.where(largest > 0, largest, 1.0), 0.0)
        return np.eye(dim - 1) - np.einsum("kia,ki,kib->kab", turn, less, turn)

    def idle(self, y: np.ndarray) -> np.ndarray:
        return np.asarray(y[:, 0] <= 0)

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return np.asarray(self.coefficient * np.maximum(r_n, 0.0))

    def bound_along(self, r: np.ndarray) -> np.ndarray:
        n, t = split(r)
        radii, turn = self._axes(r.shape[1])
        way = np.einsum("kia,ka->ki", turn, unit(t)) / np.where(radii > 0, radii, 1.0)
        size = np.linalg.norm(way, axis=1)
        reach = np.divide(1.0, size, out=self.coefficient.copy(), where=size > 0)
        return np.asarray(np.where(self.rough, reach, 0.0) * np.maximum(n, 0.0))

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        ellipse = self._ellipse(y, np.maximum(r_n, 0.0))
        D = np.zeros((*y.shape, y.shape[1]))
        D[:, 0, 0], D[:, 1:, 1:] = y[:, 0] > 0, ellipse.by_point()
        return np.column_stack([np.maximum(y[:, 0], 0.0), ellipse.nearest()]), D

    def project(self, y: np.ndarray) -> Projected:
        """max(y_n, 0), and y_t projected on the ellipse |M^-1 r_t| <= max(y_n, 0)."""
        P, D = self.nearest_derivative(y, y[:, 0])
        D[:, 1:, 0] = self._ellipse(y, np.maximum(y[:, 0], 0.0)).by_radii(self._axes(y.shape[1])[0])
        D[y[:, 0] <= 0] = 0.0
        return P, D

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        """The derivative with respect to a number that is added to both coefficients."""
        radii, _ = self._axes(y.shape[1])
        size = np.where(radii > 0, radii, 1.0)
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        in_plane = (self.mu_1 * cosine**2 + self.mu_2 * sine**2)[:, None] / size
        grow = np.where(radii > 0, in_plane, 1.0) if y.shape[1] == 2 else np.ones(radii.shape)
        height = np.maximum(y[:, 0], 0.0)
        change = self._ellipse(y, height).by_radii(height[:, None] * grow)
        return np.column_stack([np.zeros(len(y)), change])

    def times(self, factor: float) -> Orthotropic:
        return replace(self, mu_1=factor * self.mu_1, mu_2=factor * self.mu_2)

    def shifted(self, change: np.ndarray) -> Orthotropic:
        """Both coefficients with a number added."""
        mu_1, mu_2 = (np.maximum(mu + change, 0.0) for mu in (self.mu_1, self.mu_2))
        return replace(self, mu_1=mu_1, mu_2=mu_2)

    def _axes(self, dim: int) -> tuple[np.ndarray, np.ndarray]:
        """Radii (k, d) of the tangential forces for r_n = 1, their axes (k, d, d) as rows."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        if dim == 2:
            across = np.hypot(self.mu_1 * cosine, self.mu_2 * sine)
            return across[:, None], np.ones((len(across), 1, 1))
        turn = np.stack([[cosine, sine], [-sine, cosine]]).transpose(2, 0, 1)
        return np.stack([self.mu_1, self.mu_2], axis=1), turn

    def _ellipse(self, y: np.ndarray, height: np.ndarray) -> _Ellipse:
        radii, turn = self._axes(y.shape[1])
        return _Ellipse(height[:, None] * radii, turn, np.einsum("kia,ka->ki", turn, y[:, 1:]))


class _Ellipse:
    """The projection of points t on ellipses with radii a: x = B t with B = (1 + l / a^2)^-1, and
    the least l >= 0 for which |x / a| <= 1.

    All is in the axes of the ellipses, (k, d); `turn` (k, d, d) takes vectors there.
    """

    def __init__(self, radii: np.ndarray, turn: np.ndarray, t: np.ndarray):
        self.turn, self.t = turn, t
        self.flat = np.all(radii == 0, axis=1)
        self.a = a = np.where(radii > 0, radii, 1.0)
        self.outside = (np.linalg.norm(t / a, axis=1) > 1) & ~self.flat
        self.l = np.zeros(len(t))
        for _ in range(60):  # Newton's steps; it takes about five
            # Newton's method on 1 / |x / a| = 1, which is concave: it comes from one side
            z = a * t / (a**2 + self.l[:, None])
            size = np.linalg.norm(z, axis=1)
            beyond = self.outside & (size > 1 + 1e-15)
            if not beyond.any():
                break
            falls = np.sum(z**2 / (a**2 + self.l[:, None]), axis=1)
            self.l[beyond] += ((size - 1) * size**2)[beyond] / falls[beyond]
        self.B = np.where(self.flat[:, None], 0.0, a**2 / (a**2 + self.l[:, None]))
        self.x = self.B * t
        self.normal = np.where(self.outside[:, None], self.x / a**2, 0.0)
        size = np.sum(self.normal * self.B * self.normal, axis=1)
        self.size = np.where(size > 0, size, 1.0)[:, None]

    def nearest(self) -> np.ndarray:
        """(k, d) nearest points."""
        return self._back(self.x)

    def by_point(self) -> np.ndarray:
        """(k, d, d) derivative: B less its part that would leave the ellipse."""
        row = self.B * self.normal
        own = self.B[:, :, None] * np.eye(self.x.shape[1]) - (
            row[:, :, None] * row[:, None, :] / self.size[:, :, None]
        )
        return np.einsum("kia,kij,kjb->kab", self.turn, own, self.turn)

    def by_radii(self, change: np.ndarray) -> np.ndarray:
        """(k, d) derivative along a change (k, d) of the radii; zero inside."""
        turned = 2 * self.l[:, None] * change * self.x / self.a**3
        grows = np.sum(self.normal * self.x * change / self.a, axis=1)[:, None]
        moved = np.sum(self.normal * self.B * turned, axis=1)[:, None]
        along = self.B * turned - self.B * self.normal * (moved - grows) / self.size
        apex = np.where(self.flat[:, None], change * unit(self.t), 0.0)
        return self._back(np.where(self.outside[:, None], along, apex))

    def _back(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(np.einsum("kia,ki->ka", self.turn, x))
