"""A scene with the meshes of its bodies: how large it is, and where its gaps and friction act."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import skfem
from skfem import Mesh

from contactopt.bodies.body import check_mesh
from contactopt.meshes.cells import SHAPES
from contactopt.problem.laws import find_law
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Part, Rigid, Scene
from contactopt.simplification.constants import BETWEEN


@dataclass(frozen=True, eq=False)
class Whole:
    """A scene of elastic and rigid bodies, and one mesh of each elastic one."""

    scene: Scene
    meshes: dict[str, Any]

    @cached_property
    def parts(self) -> dict[str, Part]:
        """The elastic bodies by their names."""
        return self.scene.meshed

    @cached_property
    def rigid(self) -> dict[str, Rigid]:
        """The rigid bodies by their names."""
        return self.scene.rigid

    @cached_property
    def points(self) -> np.ndarray:
        """(dim, n) the nodes of all bodies [length]."""
        return np.concatenate([mesh.doflocs for mesh in self.meshes.values()], axis=1)

    @property
    def size(self) -> float:
        """Largest extent [length]."""
        return float(np.ptp(self.points, axis=1).max())

    @cached_property
    def sizes(self) -> tuple[int, int]:
        """Displacement unknowns, held ones too, and contacts that are not tied, by the meshes."""
        numbers, contacts = {}, 0
        for name, mesh in self.meshes.items():
            element = SHAPES[mesh.refdom.__name__][1][self.scene.degree]()
            numbers[name] = skfem.Dofs(mesh, element)
        for pair in self.scene.pairs:
            if find_law(pair.law).bounded:
                contacts += max(
                    len(numbers[body].get_facet_dofs(self.meshes[body].boundaries[at]).flatten())
                    for body, at in self.surfaces(pair)
                )
        return self.scene.dim * sum(int(each.N) for each in numbers.values()), contacts

    def corners(self, body: str, boundary: str) -> np.ndarray:
        """(dim, corners, m) of the facets of a boundary [length]."""
        mesh = self.meshes[body]
        return np.asarray(mesh.p[:, mesh.facets[:, mesh.boundaries[boundary]]])

    def surface_of(self, pair: Contact, side: int) -> str:
        """The name of the boundary of a side of a pair; empty for a rigid body."""
        part = self.parts.get(pair.bodies[side])
        return "" if part is None else pair.surfaces[side] or part.contact

    def surfaces(self, pair: Contact) -> list[tuple[str, str]]:
        """(body, boundary) of the elastic sides of a pair."""
        named = [(pair.bodies[side], self.surface_of(pair, side)) for side in (0, 1)]
        return [(body, boundary) for body, boundary in named if boundary]

    def acting(self, body: str, boundary: str) -> np.ndarray:
        """(dim, s) nodes of a boundary and points between them, on its curve as well."""
        if (body, boundary) not in self._acting:
            x, curve = (
                lattice_points(self.corners(body, boundary)),
                self.parts[body].curve_of(boundary),
            )
            curved = [] if curve is None else [np.asarray(curve(x), dtype=float)]
            self._acting[body, boundary] = np.concatenate([x, *curved], axis=1)
        return self._acting[body, boundary]

    @cached_property
    def _acting(self) -> dict[tuple[str, str], np.ndarray]:
        return {}


def lattice_points(corners: np.ndarray) -> np.ndarray:
    """(dim, s) evenly spaced points of facets with corners (dim, n, m), which are among them."""
    t = np.linspace(0.0, 1.0, BETWEEN + 1)
    a, b = (grid.ravel() for grid in np.meshgrid(t, t))
    inside = a + b <= 1 + 1e-12
    weights = {
        2: np.stack([1 - t, t]),
        3: np.stack([1 - a - b, a, b])[:, inside],
        4: np.stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b]),
    }[corners.shape[1]]
    return np.asarray(np.einsum("dcm,cs->dsm", corners, weights).reshape(len(corners), -1))


def has_meshes(scene: Scene) -> bool:
    """Whether all bodies are elastic with meshes, or rigid."""
    return len(scene.meshed) + len(scene.rigid) == len(scene.parts)


def whole_of(scene: Scene) -> Whole:
    """The scene with its meshes."""
    meshes = {
        name: part.build_mesh(scene.elements, scene.zone) for name, part in scene.meshed.items()
    }
    for name, part in scene.meshed.items():
        check_mesh(scene, part, meshes[name])
    return Whole(scene, meshes)


def with_pairs(
    scene: Scene, bodies: tuple[Any, ...], pairs: tuple[Contact, ...], **others: Any
) -> Scene:
    """The scene with other bodies, pairs and fields; in its short form if that holds them."""
    if not scene.contacts and len(pairs) == 1 and len(bodies) == 2:
        upper, lower = bodies
        others |= {"upper": upper, "lower": lower, "mu": pairs[0].mu, "law": pairs[0].law}
    else:
        others |= {"upper": None, "lower": None, "mu": None, "law": "coulomb"}
        others |= {"bodies": bodies, "contacts": pairs}
    return replace(scene, **others)


def of_mesh(mesh: Mesh, change: Callable[[Any], Any]) -> Any:
    """A changed mesh, or the function that makes it where the mesh is a function."""
    if callable(mesh):
        return lambda elements, zone: change(mesh(elements, zone))
    return change(mesh)
