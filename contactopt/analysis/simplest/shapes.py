"""A scene with the meshes of its bodies, as it is asked for its symmetries: what lies where, and how large it is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from contactopt.analysis.simplest.regions import Region, region
from contactopt.bodies.body import check_mesh
from contactopt.scenes.scene import HalfSpace, Part, Rigid, Scene


@dataclass(frozen=True, eq=False)
class Shapes:
    """A scene and one mesh of each of its elastic bodies (without half-spaces, which have no boundary)."""

    scene: Scene
    meshes: dict[str, Any]

    @cached_property
    def parts(self) -> dict[str, Part]:
        """The elastic bodies by their names."""
        return {part.name: part for part in self.scene.parts if isinstance(part, Part)}

    @cached_property
    def rigid(self) -> dict[str, Rigid]:
        """The rigid bodies by their names."""
        return {part.name: part for part in self.scene.parts if isinstance(part, Rigid)}

    @cached_property
    def wholes(self) -> dict[str, Region]:
        """The whole boundary of each body."""
        return {name: region(mesh, mesh.boundary_facets()) for name, mesh in self.meshes.items()}

    @cached_property
    def fits(self) -> dict[tuple[Any, ...], bool]:
        """What is known of boundaries that fit each other."""
        return {}

    @cached_property
    def _named(self) -> dict[tuple[str, str], Region]:
        return {}

    def boundary(self, body: str, name: str) -> Region:
        """A named boundary of a body."""
        key = (body, name)
        if key not in self._named:
            self._named[key] = region(self.meshes[body], self.meshes[body].boundaries[name])
        return self._named[key]

    @cached_property
    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest coordinates (dim,) of all bodies."""
        points = np.concatenate([mesh.p for mesh in self.meshes.values()], axis=1)
        return points.min(axis=1), points.max(axis=1)

    @property
    def size(self) -> float:
        """Largest extent [length]."""
        low, high = self.corners
        return float((high - low).max())

    @cached_property
    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Centre of volume (dim,) and second moments about it (dim, dim), over the volume."""
        points, volumes = zip(*(_simplices(mesh) for mesh in self.meshes.values()))
        x, v = np.concatenate(points, axis=2), np.concatenate(volumes)  # x (dim, corners, m)
        centre = x.mean(axis=1) @ v / v.sum()
        x = x - centre[:, None, None]
        n = x.shape[1]  # the integral of x x' over a simplex is V (sum x x' + (sum x)(sum x)') / (n (n + 1))
        total = x.sum(axis=1)
        second = np.einsum("iam,jam,m->ij", x, x, v) + np.einsum("im,jm,m->ij", total, total, v)
        return centre, second / (n * (n + 1) * v.sum())


def shapes_of(scene: Scene) -> Shapes | None:
    """The shapes of a scene at its own number of elements; None where a body is a half-space or lives elsewhere."""
    parts = [part for part in scene.parts if isinstance(part, Part)]
    if not all(isinstance(part, (Part, Rigid)) for part in scene.parts):
        return None
    meshes = {part.name: part.build_mesh(scene.elements, scene.zone) for part in parts}
    for part in parts:
        check_mesh(scene, part, meshes[part.name])
    return Shapes(scene, meshes)


def sizes_of(scene: Scene) -> tuple[int, int]:
    """Displacement unknowns and contacts of a scene that are not tied, counted from its meshes without assembling anything.

    Contacts are the nodes of the finer surface of each pair; supports and what faces nothing are not taken off.
    """
    unknowns, nodes = 0, {}
    for part in scene.parts:
        if isinstance(part, Part):
            mesh = part.build_mesh(scene.elements, scene.zone)
            unknowns += scene.dim * _nodes(mesh, scene.degree)
            for name in scene.surfaces_of(part):
                facets = mesh.facets[:, mesh.boundaries[name]]
                count = len(np.unique(facets))
                if scene.degree == 2 and mesh.refdom.__name__ in ("RefQuad", "RefHex"):
                    count += facets.shape[1] * (1 if scene.dim == 2 else 3)
                nodes[part.name, name] = count
        elif isinstance(part, HalfSpace):
            grid = [len(row) for row in part.ticks(scene.elements, scene.zone, scene.dim - 1)]
            unknowns += scene.dim * int(np.prod(grid))
            nodes[part.name, "contact"] = int(np.prod(grid))
    usual = {part.name: getattr(part, "contact", "contact") for part in scene.parts}
    contacts = 0
    for pair in (pair for pair in scene.pairs if pair.law != "tied"):
        contacts += max(nodes.get((body, name or usual[body]), 0) for body, name in zip(pair.bodies, pair.surfaces))
    return unknowns, contacts


def _nodes(mesh: Any, degree: int) -> int:
    """Nodes of the displacement of that degree."""
    count = int(mesh.nvertices)
    if degree == 1:
        return count
    bricks = mesh.refdom.__name__ in ("RefQuad", "RefHex")
    if len(mesh.p) == 2:
        return count + mesh.facets.shape[1] + (mesh.nelements if bricks else 0)
    return count + mesh.edges.shape[1] + (mesh.facets.shape[1] + mesh.nelements if bricks else 0)


def _simplices(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners (dim, dim + 1, m) of simplices that cover the elements of a mesh, and their volumes (m,)."""
    if mesh.refdom.__name__ == "RefHex":
        mesh = type(mesh)(mesh.p[:, : mesh.nvertices], mesh.t).to_meshtet()
    elif mesh.refdom.__name__ == "RefQuad":
        mesh = type(mesh)(mesh.p[:, : mesh.nvertices], mesh.t).to_meshtri()
    corners = mesh.p[:, mesh.t]
    edges = corners[:, 1:] - corners[:, :1]
    factor = 2.0 if len(mesh.p) == 2 else 6.0
    return corners, np.abs(np.linalg.det(np.moveaxis(edges, 2, 0))) / factor
