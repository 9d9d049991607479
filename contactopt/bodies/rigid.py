"""A rigid body: its compliance is zero, and its displacement unknowns are its motions.

It has one unknown for each component of a translation. Those with a total force are free motions,
whose displacements are multipliers of the interface problem; the others are given, by default zero.
The total contact force follows them in U, so that the forces that hold the body are known from U.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.fields import Validity
from contactopt.bodies.protocol import Guides, Surface
from contactopt.checks import real_array
from contactopt.errors import InputError
from contactopt.linear.operators import Product
from contactopt.scenes.scene import Rigid, Scene

log = logging.getLogger(__name__)
NEAREST = 1e-9  # contacts are as near as the nearest one up to this fraction of the gaps
FLAT = 1e-3  # normals of a surface that differ by less than this are one direction


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A rigid body of a scene with the components of its displacement; it needs no preparation, so
    it is both stages.
    """

    part: Rigid
    components: tuple[str, ...]

    unknowns = interface_unknowns = 0
    meshed = parallel = iterative = False
    complete = True
    equilibrium = None

    @property
    def name(self) -> str:
        return self.part.name

    @property
    def at_rest(self) -> np.ndarray:
        values = self.part.displacement or {}
        given = [float(values.get(name, 0.0)) for name in self.components]
        return np.array([*given, *(0.0 for _ in given)])

    @property
    def motions(self) -> np.ndarray:
        columns = [self.components.index(name) for name in self._force]
        return np.eye(2 * len(self.components))[:, columns]

    @property
    def motion_names(self) -> tuple[str, ...]:
        return tuple(f"translation along {component}" for component in self._force)

    @property
    def resultants(self) -> np.ndarray:
        return np.array(list(self._force.values()), dtype=float)

    @property
    def _force(self) -> dict[str, float]:
        return dict(self.part.force or {})

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
        fixed = np.array([name not in self._force for name in self.components])
        trace = [
            sp.csr_matrix((np.ones(k), (np.arange(k), np.full(k, c))), (k, 2 * dim))
            for c in range(dim)
        ]
        held = np.tile(fixed[:, None], k)
        surface = Surface(
            self.name,
            other.points,
            normals,
            other.areas,
            other.weights,
            other.places,
            tuple(trace),
            held,
            other.cells,
        )
        gap = self._gap(other)
        self._check_side(other, np.sum(normals * suggested, axis=0), gap)
        return surface, gap

    def _check_side(self, other: Surface, facing: np.ndarray, gap: np.ndarray) -> None:
        """Refuse a normal that points away from the other body where the bodies are nearest.

        `facing` (k,) is the cosine between the normal and the one that the other body suggests.
        """
        nearest = gap <= gap.min(initial=np.inf) + NEAREST * float(np.max(np.abs(gap), initial=0.0))
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
        """The initial gap at the contacts from that at the nodes, with the weights of the
        displacements.
        """
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

    def guides(self) -> Guides:
        return Guides(np.zeros((len(self.components), 0)))

    def iterates(self, solver: str) -> bool:
        return False

    def prepare(self, solver: str, entries: bool) -> RigidBody:
        return self

    def product(self, T: sp.csr_matrix) -> Product:
        return lambda X, accuracy: np.zeros(X.shape)

    def convolution(self, T: sp.csr_matrix) -> None:
        return None

    def compliance(self, T: sp.csr_matrix) -> np.ndarray:
        return np.zeros((T.shape[0], T.shape[0]))

    def moved(self, T: sp.csr_matrix) -> np.ndarray:
        return np.zeros(T.shape[0], dtype=bool)

    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: Any = None
    ) -> np.ndarray:
        return np.asarray(
            self.at_rest + self.motions @ multipliers + np.roll(force, len(self.components))
        )

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(U)), np.zeros(len(self.resultants))

    def material_work(
        self, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray
    ) -> float:
        return 0.0

    def load_work(
        self, scene: Scene, part: Rigid, dual: np.ndarray, weights: np.ndarray, W: np.ndarray
    ) -> float:
        new = self.loaded(scene, part)
        return float(
            dual @ (new.at_rest - self.at_rest) + weights @ (new.resultants - self.resultants)
        )

    def energy_gradient(self, U: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(U)), np.zeros(len(U))

    def energy_change(self, constant: str, U: np.ndarray, force: np.ndarray) -> float:
        return 0.0

    def recovery_errors(self, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
        return (np.zeros(0),) * len(others)

    def on_elements(self, values: np.ndarray) -> np.ndarray:
        return np.zeros(0)

    def stress_map(self, region: object, by_poisson: bool = False) -> None:
        return None

    def energy(self, U: np.ndarray) -> float:
        return 0.0

    def external_forces(self, U: np.ndarray) -> np.ndarray:
        """The forces that keep the body in equilibrium with the contact forces."""
        dim = len(self.components)
        return np.concatenate([-U[dim:], np.zeros(dim)])

    def held_by(self, U: np.ndarray, force: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Nothing: what holds a rigid body is what its contacts ask for."""
        return {}

    def fields(self, U: np.ndarray) -> None:
        return None

    def seen(self, T: sp.csr_matrix, U: np.ndarray) -> np.ndarray:
        return np.asarray(T @ U)

    def limits(self, U: np.ndarray, force: np.ndarray) -> Validity:
        return Validity()

    def grounded(self, modulus: float) -> RigidBody:
        return self

    def pulled(self, U: Any) -> RigidBody:
        return self

    def loaded(self, scene: Scene, part: Rigid) -> RigidBody:
        """With other values of the total force, and other free components if need be."""
        return assemble_rigid(scene, part, 0, None)


def assemble_rigid(scene: Scene, part: Rigid, elements: int, zone: float | None) -> RigidBody:
    """Make a rigid body of a scene.

    Parameters
    ----------
    scene, part : The scene and one of its rigid parts.
    elements, zone : Not used: a rigid body has no mesh.

    Returns
    -------
    The body, whose unknowns are its motions.
    """
    return RigidBody(part, scene.components)
