"""Structured meshes and Gmsh's, and scenes moved: turned, mirrored, in other units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contactopt import BodyForce, HalfSpace, Part, Plate, Rigid, Scene, load_mesh
from contactopt.meshes.structured import tensor_mesh

# a corner of an outline, the size of triangles there, the name of the next side
Corner = tuple[float, float, float, str]


def ticks(places: list[float], size: float) -> np.ndarray:
    """A grid through some places, whose cells are about as long as given."""
    places = [x for x, after in pairwise(places) if after - x > 1e-9] + places[-1:]
    parts = [np.linspace(a, b, max(1, round((b - a) / size)) + 1) for a, b in pairwise(places)]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def named(mesh: Any, sides: Mapping[str, Callable[[np.ndarray], np.ndarray]]) -> Any:
    """The mesh with the facets of its surface named whose middle fulfils a condition."""
    facets = mesh.boundary_facets()
    middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    return mesh.with_boundaries({name: facets[inside(middle)] for name, inside in sides.items()})


def quads(corners: Any, s: np.ndarray, t: np.ndarray) -> Any:
    """Quadrilaterals between four corners; sides bottom, right, top, left."""
    ends = {"bottom": "y-", "right": "x+", "top": "y+", "left": "x-"}
    flat = tensor_mesh(s, (t - t[0]) / (t[-1] - t[0]))
    (x, y), (a, b, c, d) = flat.p, np.asarray(corners, dtype=float)[:, :, None]
    places = (1 - x) * (1 - y) * a + x * (1 - y) * b + x * y * c + (1 - x) * y * d
    names = {new: flat.boundaries[old] for new, old in ends.items()}
    return type(flat)(np.ascontiguousarray(places), flat.t).with_boundaries(names)


def ring(radii: np.ndarray, angles: np.ndarray) -> Any:
    """Quadrilaterals of a whole ring; sides inside and outside."""
    count = len(angles)
    around = np.stack([np.cos(angles), np.sin(angles)])
    points = (radii[:, None, None] * around).transpose(1, 0, 2).reshape(2, -1)
    node = np.arange(points.shape[1]).reshape(len(radii), count)
    after = np.roll(node, -1, axis=1)
    from skfem import MeshQuad

    made = MeshQuad(
        np.ascontiguousarray(points),
        np.stack([node[:-1], node[1:], after[1:], after[:-1]]).reshape(4, -1),
    )
    middle = radii.mean()
    sides = {"inside": lambda x: np.hypot(*x) < middle, "outside": lambda x: np.hypot(*x) > middle}
    return named(made, sides)


def extruded(mesh: Any, z: np.ndarray) -> Any:
    """Bricks over plane quadrilaterals, with their sides, and the ends `near` and `far`."""
    from contactopt.meshes.discs import extrude

    made = extrude(mesh.p, mesh.t, z)
    facets, n = made.boundary_facets(), mesh.p.shape[1]
    corners = made.facets[:, facets]
    levels = corners // n
    flat = levels.min(axis=0) == levels.max(axis=0)
    number = {tuple(pair): i for i, pair in enumerate(np.sort(mesh.facets, axis=0).T)}
    below = np.array(
        [-1 if end else number[tuple(np.unique(own % n))] for end, own in zip(flat, corners.T)]
    )
    sides = {name: facets[np.isin(below, own)] for name, own in mesh.boundaries.items()}
    ends = {"near": facets[flat & (levels[0] == 0)], "far": facets[flat & (levels[0] > 0)]}
    return made.with_boundaries(sides | ends)


def outlined(*loops: list[Corner], order: int = 1, arcs: bool = False) -> Any:
    """Triangles within outlines, by a file of Gmsh; `arcs`: of circles about the origin."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        geo, groups, curves = gmsh.model.geo, {}, []
        middle = geo.addPoint(0, 0, 0) if arcs else 0
        for loop in loops:
            points = [geo.addPoint(x, y, 0, size) for x, y, size, _ in loop]
            lines = []
            for i, (*_, name) in enumerate(loop):
                ends = (points[i], points[(i + 1) % len(loop)])
                bent = arcs and not name.startswith("straight")
                lines.append(
                    geo.addCircleArc(ends[0], middle, ends[1]) if bent else geo.addLine(*ends)
                )
                groups.setdefault(name, []).append(lines[-1])
            curves.append(geo.addCurveLoop(lines))
        geo.addPlaneSurface(curves, 1)
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="body")
        for name, tags in groups.items():
            gmsh.model.addPhysicalGroup(1, tags, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        with TemporaryDirectory() as folder:
            gmsh.write(f"{folder}/body.msh")
            return load_mesh(Path(folder) / "body.msh")
    finally:
        gmsh.finalize()


@dataclass(frozen=True, eq=False)
class Move:
    """A scene as another would write it: x -> length R x, other stresses and numbers."""

    R: np.ndarray
    length: float = 1.0
    stress: float = 1.0
    seed: int | None = None

    def vector(
        self, values: Mapping[str, float], names: tuple[str, ...], factor: float
    ) -> dict[str, float]:
        """Components by name, of which some may be missing if R exchanges axes only."""
        own = np.array([values.get(name, 0.0) for name in names])
        full = self.R @ own * factor
        if len(values) == len(names):
            return dict(zip(names, full.tolist()))
        there = np.abs(self.R) @ np.array([name in values for name in names], dtype=float)
        return {
            name: value for name, value, given in zip(names, full.tolist(), there) if given > 0.5
        }

    def back(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (dim, m) of the moved scene in the frame of the first, without units."""
        return self.R.T @ vectors

    def mesh(self, mesh: Any) -> Any:
        """The mesh moved, and renumbered if its edges are straight."""
        points = np.ascontiguousarray(self.length * (self.R @ mesh.doflocs))
        if self.seed is None or mesh.doflocs.shape[1] != mesh.nvertices:
            return type(mesh)(points, mesh.t).with_boundaries(mesh.boundaries)
        rng = np.random.default_rng(self.seed)
        place = rng.permutation(points.shape[1])
        moved = np.empty_like(points)
        moved[:, place] = points
        made = type(mesh)(
            moved, np.ascontiguousarray(place[mesh.t][:, rng.permutation(mesh.nelements)])
        )
        number = {tuple(sorted(own)): i for i, own in enumerate(made.facets.T)}
        sides = {
            name: np.array([number[tuple(sorted(place[own]))] for own in mesh.facets[:, facets].T])
            for name, facets in mesh.boundaries.items()
        }
        return made.with_boundaries(sides)

    def part(self, part: Any, names: tuple[str, ...]) -> Any:
        """A body of the scene, moved."""
        L, S = self.length, self.stress
        if isinstance(part, HalfSpace):
            force = None if part.force is None else self.vector(part.force, names, S * L**2)
            height = None if part.height is None else lambda x: L * part.height(x / L)
            points = tuple(L * row for row in part.points)
            depth = None if part.depth is None else L * part.depth
            own = replace(part.material, E=part.material.E * S)
            return replace(
                part, points=points, height=height, force=force, depth=depth, material=own
            )
        if isinstance(part, Rigid):
            gap = None if part.gap is None else lambda x: L * part.gap(self.R.T @ x / L)
            normal = None if part.normal is None else tuple(self.R @ np.array(part.normal))
            force = None if part.force is None else self.vector(part.force, names, S * L**2)
            shift = None if part.displacement is None else self.vector(part.displacement, names, L)
            return replace(part, gap=gap, normal=normal, force=force, displacement=shift)
        loads = []
        for load in part.loads:
            if isinstance(load, Plate):
                loads.append(replace(load, force=self.vector(load.force, names, S * L**2)))
            else:
                factor = S / L if isinstance(load, BodyForce) else S
                loads.append(replace(load, value=tuple(self.R @ np.array(load.value) * factor)))
        supports = list(part.supports)
        for i, held in enumerate(supports):
            if held.displacement is not None:
                shift = self.vector(held.displacement, names, L)
                supports[i] = replace(held, displacement=shift)
        curves = {name: self._curve(own) for name, own in (part.curve or {}).items()} or None
        material = replace(part.material, E=part.material.E * S)
        return replace(
            part,
            mesh=self.mesh(part.mesh),
            material=material,
            supports=tuple(supports),
            loads=tuple(loads),
            curve=curves,
        )

    def _curve(
        self, curve: Callable[[np.ndarray], np.ndarray]
    ) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: self.length * (self.R @ curve(self.R.T @ x / self.length))

    def scene(self, scene: Scene) -> Scene:
        """All bodies of a scene of meshes in the long form, moved.

        The friction of Tresca's law is a stress.
        """
        bodies = tuple(self.part(part, scene.components) for part in scene.bodies)
        contacts = tuple(
            replace(pair, mu=pair.mu * self.stress) if pair.law == "tresca" else pair
            for pair in scene.contacts
        )
        return replace(
            scene, bodies=bodies, contacts=contacts, thickness=scene.thickness * self.length
        )


def random_move(rng: np.random.Generator, scene: Scene, swapped: bool = False) -> Move:
    """Any turn if every support and load has all components, or else one that exchanges axes; none
    in an axisymmetric scene.

    An upper half-space lies above: where the sides are exchanged, up is down.
    """
    dim = scene.dim
    if any(isinstance(part, HalfSpace) for part in scene.bodies):
        R = np.diag([*np.ones(dim - 1), -1.0 if swapped else 1.0])
    elif scene.kind == "axisymmetric":
        R = np.diag([1.0, rng.choice([-1.0, 1.0])])
    else:
        parts = [part for part in scene.bodies if isinstance(part, Part)]
        given = [support.displacement for part in parts for support in part.supports]
        given += [own.force for part in parts for own in part.loads if isinstance(own, Plate)]
        rigid = [part for part in scene.bodies if isinstance(part, Rigid)]
        given += [values for part in rigid for values in (part.force, part.displacement)]
        R = np.linalg.qr(rng.normal(size=(dim, dim)))[0] * rng.choice([-1.0, 1.0], dim)
        if not all(values is None or len(values) == dim for values in given):
            R = np.eye(dim)[rng.permutation(dim)] * rng.choice([-1.0, 1.0], dim)
    return Move(
        R, 10.0 ** rng.integers(-3, 4), 10.0 ** rng.integers(-3, 7), int(rng.integers(1000))
    )
