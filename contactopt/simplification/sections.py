"""Solids that one section in plane strain describes: prisms whose ends are held along their axis.

If a solid has hexahedra in layers between two planes across an axis of space, its section is made
of the faces on one plane. If these planes are held along the axis and nothing else changes or
acts along it, strain is plane, and section and solid have the same discrete solution. Tetrahedra
share forces out unevenly along the axis, so that nothing can be proved about their section. The
same is true of a mesh of a body of revolution, which is a polygon.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import skfem
from scipy.spatial import KDTree
from skfem import Mesh

from contactopt.defaults import EQUAL, ROUNDED
from contactopt.scenes.scene import Scene
from contactopt.simplification.findings import Simplification
from contactopt.simplification.images import equal_functions
from contactopt.simplification.proof import Key
from contactopt.simplification.whole import Whole, of_mesh, whole_of, with_pairs

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart


@dataclass(frozen=True)
class _Prism:
    """A solid between the places `ends` along an axis of space."""

    whole: Whole
    axis: int
    ends: tuple[float, float]

    @property
    def axes(self) -> list[int]:
        """The coordinates of the section."""
        return [other for other in range(3) if other != self.axis]

    def lift(self, x: np.ndarray) -> np.ndarray:
        """(3, k) points of the section (2, k) on the lower end."""
        return np.insert(x, self.axis, self.ends[0], axis=0)

    def on_end(self, mesh: Mesh, place: float) -> np.ndarray:
        """Numbers of the facets of a mesh on an end."""
        at = mesh.p[self.axis][mesh.facets]
        return np.flatnonzero(np.abs(at - place).max(axis=0) < EQUAL * self.whole.size)

    def flat(self, mesh: Mesh) -> Any:
        """The section of a mesh; its edges bear the names of the boundaries that stand on them."""
        corners = mesh.facets[:, self.on_end(mesh, self.ends[0])]
        nodes, cells = np.unique(corners, return_inverse=True)
        made = skfem.MeshQuad(mesh.p[self.axes][:, nodes], cells.reshape(corners.shape))
        names: dict[str, np.ndarray] = {}
        outer = made.boundary_facets()
        middles = made.p[:, made.facets[:, outer]].mean(axis=1)
        for name, facets in (mesh.boundaries or {}).items():
            there = mesh.p[self.axes][:, mesh.facets[:, facets]].mean(axis=1)
            own = KDTree(there.T).query(middles.T)[0] < EQUAL * self.whole.size
            names |= {name: outer[own]} if own.any() else {}
        return made.with_boundaries(names)


def section(whole: Whole) -> tuple[list[Simplification], list[str]]:
    """The section that stands for a solid, if there is one, or a sentence on what prevents it."""
    reasons = []
    for prism in _prisms(whole):
        reason, component = _spoils(prism), whole.scene.components[prism.axis]
        if not reason:
            return [_simplification(prism, component)], []
        reasons.append(f"The bodies are prisms along {component}, but {reason}.")
    # Blocks are prisms along each of their edges: then there is nothing to say.
    return [], reasons if len(reasons) == 1 else []


def _prisms(whole: Whole) -> Iterator[_Prism]:
    """The solid along each axis along which all meshes are layers between the same ends."""
    if any(mesh.refdom.__name__ != "RefHex" for mesh in whole.meshes.values()):
        return
    for axis in range(3):
        along = whole.points[axis]
        prism = _Prism(whole, axis, (float(along.min()), float(along.max())))
        for mesh in whole.meshes.values():
            first, last = (np.unique(mesh.facets[:, prism.on_end(mesh, end)]) for end in prism.ends)
            if not len(first) or len(first) != len(last):
                break
            flat = mesh.p[prism.axes]
            if KDTree(flat[:, first].T).query(flat.T)[0].max() > EQUAL * whole.size:
                break
        else:
            yield prism


def _spoils(prism: _Prism) -> str:
    """Half a sentence that says what acts or changes along the axis, or that an end is free."""
    whole, component = prism.whole, prism.whole.scene.components[prism.axis]
    for name, part in whole.parts.items():
        mesh = whole.meshes[name]
        ends = both = np.concatenate([prism.on_end(mesh, place) for place in prism.ends])
        for support in part.supports:
            if (support.displacement or {}).get(component) == 0:
                ends = np.setdiff1d(ends, mesh.boundaries[support.boundary])
        if len(ends):
            return f"the ends of body '{name}' are not held along the axis"
        for load in part.loads:
            values, acting = load.values(whole.scene.components), both[:0]
            if "" in values:  # inside a body nobody knows its direction
                sides = mesh.boundaries[load.boundary] if load.boundary else both
                acting = np.intersect1d(both, sides)
            if values.get(component) or len(acting) or getattr(load, "direction", None):
                where = f" on {load.boundary!r}" if load.boundary else ""
                return f"the {load.what}{where} of body '{name}' acts along the axis"
    for pair in whole.scene.pairs:
        gaps = [whole.rigid[name].gap for name in pair.bodies if name in whole.rigid]
        functions = [function for function in (pair.mu, *gaps) if function is not None]
        if any(np.ndim(function) for function in functions if not callable(function)):
            return f"the gap or the friction of contact '{pair.name}' is given contact by contact"
        for body, boundary in whole.surfaces(pair):
            x, curve = whole.acting(body, boundary), whole.parts[body].curve_of(boundary)
            below = prism.lift(x[prism.axes])
            if not all(equal_functions(f, f, x, below) for f in functions):
                return f"the gap or the friction of contact '{pair.name}' changes along the axis"
            if curve is not None:
                apart = (np.asarray(curve(x)) - curve(below))[prism.axes]
                if not np.abs(apart).max() <= ROUNDED * whole.size:
                    return f"the curve of body '{body}' changes along the axis"
    return ""


def _simplification(prism: _Prism, component: str) -> Simplification:
    axes, scene = prism.axes, _flattened(prism)

    def fold(key: Key, x: np.ndarray) -> tuple[Key, np.ndarray, np.ndarray]:
        return key, x[axes], np.tile(np.eye(3)[:, axes], (x.shape[1], 1, 1))

    what = "A section in plane strain stands for the bodies."
    why = (
        f"The bodies are prisms along {component}, their ends are held along it, and nothing"
        " changes or acts along it. Exact wherever the solution is unique."
    )
    sizes = prism.whole.sizes, whole_of(scene).sizes
    return Simplification("plane strain", what, why, *sizes, scene, (fold,))


def _flattened(prism: _Prism) -> Scene:
    """The scene on its section: vectors and components without those along the axis."""
    scene, axes = prism.whole.scene, prism.axes
    names = {scene.components[old]: new for old, new in zip(axes, "xy")} | {"": ""}

    def values(old: Mapping[str, float] | None) -> Any:
        return None if old is None else {names[c]: v for c, v in old.items() if c in names}

    def below(function: Any) -> Any:
        return (lambda x: function(prism.lift(x))) if callable(function) else function

    def curve(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
        return lambda x: function(prism.lift(x))[axes]

    def part_of(part: Any) -> AnyPart:
        if not part.meshed:
            normal = None if part.normal is None else tuple(part.normal[axis] for axis in axes)
            given = {"force": values(part.force), "displacement": values(part.displacement)}
            return replace(part, normal=normal, gap=below(part.gap), **given)
        there = prism.flat(prism.whole.meshes[part.name]).boundaries or {}
        supports = [
            replace(support, displacement=values(support.displacement))
            for support in part.supports
            if support.boundary in there and values(support.displacement) != {}
        ]
        loads = [
            load.with_values(values(load.values(scene.components)))
            for load in part.loads
            if not load.boundary or load.boundary in there
        ]
        found = {name: part.curve_of(name) for name in scene.surfaces_of(part)}
        curves = {name: curve(function) for name, function in found.items() if function is not None}
        made = replace(part, supports=tuple(supports), loads=tuple(loads), curve=curves or None)
        return replace(made, mesh=of_mesh(part.mesh, prism.flat))

    pairs = tuple(replace(pair, mu=below(pair.mu)) for pair in scene.pairs)
    parts = tuple(part_of(part) for part in scene.parts)
    depth = scene.thickness * (prism.ends[1] - prism.ends[0])
    return with_pairs(scene, parts, pairs, kind="plane-strain", thickness=depth)
