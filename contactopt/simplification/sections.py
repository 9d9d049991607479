"""Plane scenes from solid ones: sections of meshes made of faces of their elements, components and vectors without one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import skfem

from contactopt.simplification.whole import of_mesh
from contactopt.scenes.scene import Plate, Rigid, Scene

Lift = Callable[[np.ndarray], np.ndarray]


def face_mesh(mesh: Any, facets: np.ndarray, axes: list[int]) -> Any:
    """Some faces of a solid's elements in one plane as a mesh of the plane, with the names of the boundaries they end on.

    Parameters
    ----------
    mesh
        Of tetrahedra or hexahedra.
    facets
        Numbers of the faces (m,).
    axes
        The two coordinates that stay.

    Returns
    -------
    MeshTri or MeshQuad
        Its edges bear the names of the boundaries whose faces end on them.
    """
    corners = mesh.facets[:, facets]
    nodes, cells = np.unique(corners, return_inverse=True)
    cells = cells.reshape(corners.shape)
    points = mesh.p[np.ix_(np.array(axes), nodes)]
    ahead, far = points[:, cells[1]] - points[:, cells[0]], points[:, cells[2]] - points[:, cells[0]]
    turns = ahead[0] * far[1] - ahead[1] * far[0] < 0
    cells[1:, turns] = cells[:0:-1, turns]
    made = (skfem.MeshTri if len(cells) == 3 else skfem.MeshQuad)(points, cells)
    outer = made.boundary_facets()
    ends = np.sort(nodes[made.facets[:, outer]], axis=0)
    names = {}
    for name, members in (mesh.boundaries or {}).items():
        rims = mesh.facets[:, np.setdiff1d(members, facets)]
        edges = np.concatenate([np.sort(rims[[i, i - 1]], axis=0) for i in range(len(rims))], axis=1)
        width = mesh.p.shape[1] + 1
        own = np.isin(ends[0] * width + ends[1], edges[0].astype(np.int64) * width + edges[1])
        if own.any():
            names[name] = outer[own]
    return made.with_boundaries(names)


def flattened(
    scene: Scene,
    kind: str,
    names: Mapping[str, str | None],
    axes: list[int],
    flat: Callable[[Any], Any],
    lift: Lift,
) -> Scene:
    """The scene on sections: components by their new names, vectors without the component that is left out."""

    def values(old: Mapping[str, float] | None) -> dict[str, float] | None:
        return None if old is None else {str(names[c]): v for c, v in old.items() if names[c] is not None}

    def below(function: Any) -> Any:
        return (lambda x: function(lift(x))) if callable(function) else function

    def curve(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        shift = lift(np.zeros((2, 1)))[axes]
        return lambda x: function(lift(x))[axes] - shift

    def part_of(part: Any) -> Any:
        if isinstance(part, Rigid):
            normal = None if part.normal is None else tuple(part.normal[axis] for axis in axes)
            force, displacement = values(part.force), values(part.displacement)
            return replace(part, normal=normal, gap=below(part.gap), force=force, displacement=displacement)
        mesh = of_mesh(part.mesh, flat)
        there = part_boundaries(mesh, scene)
        supports = tuple(
            replace(support, displacement=values(support.displacement))
            for support in part.supports
            if support.boundary in there and values(support.displacement) != {}
        )
        loads: list[Any] = []
        for load in part.loads:
            if isinstance(load, Plate):
                loads.append(replace(load, force=values(load.force) or {}))
            else:
                loads.append(replace(load, value=tuple(load.value[axis] for axis in axes)))
        found = {name: part.curve_of(name) for name in scene.surfaces_of(part)}
        curves = {name: curve(function) for name, function in found.items() if function is not None}
        return replace(part, mesh=mesh, supports=supports, loads=tuple(loads), curve=curves or None)

    pairs = tuple(replace(pair, mu=below(pair.mu)) for pair in scene.pairs)
    parts = tuple(part_of(part) for part in scene.parts)
    if scene.contacts:
        return replace(scene, kind=kind, bodies=parts, contacts=pairs)
    return replace(scene, kind=kind, upper=parts[0], lower=parts[1], mu=pairs[0].mu)


def part_boundaries(mesh: Any, scene: Scene) -> set[str]:
    """Names of the boundaries that a mesh has, made at the scene's own number of elements if it is a function."""
    made = mesh(scene.elements, scene.zone) if callable(mesh) else mesh
    return {name for name, facets in (made.boundaries or {}).items() if len(facets)}
