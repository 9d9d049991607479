"""A rigid body: its compliance is zero, and its displacement unknowns are its motions.

It has one unknown for each component of a translation. Those with a total force are free motions,
whose displacements are multipliers of the interface problem; the others are given, by default zero.
The total contact force follows them in U, so that the forces that hold the body are known from U.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import Surface, UndividedBody
from contactopt.bodies.protocol import Seen
from contactopt.checks import real_array
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.scenes.scene import Rigid, Scene

log = logging.getLogger(__name__)
FLAT = 1e-3  # normals of a surface that differ by less than this are one direction


@dataclass(frozen=True, eq=False)
class RigidBody(UndividedBody):
    """A rigid body."""

    part: Rigid
    components: tuple[str, ...]

    unknowns = 0
    meshed = False

    @property
    def whole(self) -> range:  # type: ignore[override]
        return range(len(self.components))

    @cached_property
    def at_rest(self) -> np.ndarray:
        return np.concatenate([self.given, 0 * self.given])

    @cached_property
    def fields(self) -> np.ndarray:
        return np.concatenate([self.shifts, 0 * self.shifts])

    @property
    def held(self) -> np.ndarray:
        free = self.part.force or {}
        return np.array([i for i, c in enumerate(self.components) if c not in free], dtype=int)

    def surface(self, name: str | None = None) -> Surface:
        raise InputError(
            f"rigid body '{self.name}' has no contact surface of its own; it needs a body with a"
            " mesh."
        )

    def facing(self, other: Surface, normals: np.ndarray) -> tuple[Surface, np.ndarray]:
        (dim, k), suggested = other.points.shape, normals
        if self.part.normal is not None:
            own = np.array(self.part.normal, dtype=float)
            normals = np.tile(own[:, None] / np.linalg.norm(own), k)
        elif self.part.gap is not None and np.ptp(normals, axis=1).max(initial=0.0) > FLAT:
            log.warning(
                "the gap of rigid body '%s' is taken along the normals of the curved surface of"
                " body '%s', because no normal is given; give Rigid(normal=...) if the gap is"
                " measured along one direction.",
                self.name,
                other.body,
            )
        fixed = np.array([name not in (self.part.force or {}) for name in self.components])
        count, ones = np.arange(k + 1, dtype=np.int32), np.ones(k)
        traces = tuple(
            sp.csr_matrix((ones, np.full(k, c, np.int32), count), (k, 2 * dim)) for c in range(dim)
        )
        held = np.tile(fixed[:, None], k)
        surface = replace(
            other,
            body=self.name,
            normals=normals,
            traces=traces,
            held=held,
            alone=None,
            mesh=None,
            chart=None,
        )
        gap = self._gap(other)
        self._check_side(other, np.sum(normals * suggested, axis=0), gap)
        return surface, gap

    def _check_side(self, other: Surface, facing: np.ndarray, gap: np.ndarray) -> None:
        """Refuse a normal away from the other body, where their cosines `facing` are < 0."""
        nearest = gap <= gap.min(initial=np.inf) + EQUAL * float(np.max(np.abs(gap), initial=0.0))
        if (
            self.part.normal is not None
            and np.sum((facing * other.areas)[nearest]) < -FLAT * other.areas[nearest].sum()
        ):
            raise InputError(
                f"rigid body '{self.name}': its normal points away from body '{other.body}' where"
                " they are nearest; a contact normal points from the lower body to the upper one,"
                " so turn its sign."
            )

    def _gap(self, other: Surface) -> np.ndarray:
        """The initial gap at the contacts from that at the nodes, by their weights."""
        if other.mesh is None:  # its points lie in a plane, its places on the surface
            height = np.sum(other.normals * (other.places - other.points), axis=0)
            if self.part.gap is None:
                return -height
            if height.any():
                raise InputError(
                    f"rigid body '{self.name}' has a gap and half-space '{other.body}' a height;"
                    " give one of them, which then stands for both surfaces."
                )
        elif self.part.gap is None:
            return np.zeros(other.points.shape[1])
        given = self.part.gap(other.places) if callable(self.part.gap) else self.part.gap
        gap = real_array(f"the gap of rigid body '{self.name}'", given).ravel()
        if gap.shape != other.places.shape[1:] or not np.all(np.isfinite(gap)):
            raise InputError(
                f"the gap of rigid body '{self.name}' must give one finite number per contact node."
            )
        return np.asarray(other.weights @ gap)

    def through(self, T: sp.csr_matrix) -> Seen:
        rows = T.shape[0]
        still = np.zeros(rows, dtype=bool)
        return Seen(lambda X, _: np.zeros(X.shape), lambda: np.zeros((rows, rows)), still)

    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: np.ndarray | None = None
    ) -> np.ndarray:
        follows = np.roll(force, len(self.components))
        return np.asarray(self.at_rest + self.fields @ multipliers + follows)

    def internal_forces(self, U: np.ndarray, force: np.ndarray) -> np.ndarray:
        return np.zeros(len(U))

    def loaded(self, scene: Scene, part: Rigid) -> RigidBody:
        """With other values of the total force, and other free components if need be."""
        return RigidBody(part, scene.components)


def assemble_rigid(scene: Scene, part: Rigid, elements: int, zone: float | None) -> RigidBody:
    """The body of a rigid part, which has no mesh."""
    return RigidBody(part, scene.components)
