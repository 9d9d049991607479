"""Solids that one section describes: prisms whose ends are held along their axis, and bodies of revolution.

A prism ends on two planes across its axis. If these are held along the axis, on rollers, and nothing else changes or acts along
it, then strain is plane and the section is exact: the faces of the elements on one end. Of hexahedra in layers the section also has
the same discrete solution, and the whole proves it. Tetrahedra share their forces out unevenly along the axis, and a body of
revolution is a polygon on its mesh: these sections are offered with the difference that they make.

The axis is one of space. Nothing is cut: the section consists of faces of elements.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from contactopt.scenes.scene import BodyForce, Part, Plate, Scene, Support, Traction
from contactopt.simplification.constants import NEAR
from contactopt.simplification.findings import Simplification
from contactopt.simplification.images import equal_functions, held_space
from contactopt.simplification.proof import Fold, Key
from contactopt.simplification.sections import face_mesh, flattened
from contactopt.simplification.whole import Whole, sizes_of

EVEN = 1e-6  # a direction across or along another one, but for so much; and so for areas
AXIS = "axis of revolution"  # the boundary of a section on it
WIDEST = np.pi / 4  # turn between neighbouring nodes on a ring, at most


class _Section(NamedTuple):
    """How a solid lies on its section.

    kind   of the scene of the section;  axes  coordinates that stay;  along  components of space that nothing may act in
    ring   largest turn between neighbouring nodes on a ring, 0 for a prism
    ends   where a prism ends;  middle  a point (3,) of the axis
    """

    kind: str
    axes: list[int]
    along: list[int]
    ring: float
    ends: tuple[float, float]
    middle: np.ndarray

    def flat(self, x: np.ndarray) -> np.ndarray:
        """(2, k) where points of the solid lie in the section."""
        if self.kind == "plane-strain":
            return x[self.axes]
        return np.stack([np.hypot(*(x - self.middle[:, None])[self.along]), x[self.axes[1]]])

    def lift(self, x: np.ndarray) -> np.ndarray:
        """(3, k) points of the section in the solid."""
        if self.kind == "plane-strain":
            return np.insert(x, self.along[0], self.ends[0], axis=0)
        made = np.tile(self.middle[:, None], x.shape[1])
        made[self.axes] = x[0] + self.middle[self.axes[0]], x[1]
        return made

    def measure(self, corners: np.ndarray) -> float:
        """The length or area that simplices or quadrilaterals (2, n, m) of the section have in the solid, times depth or ring."""
        parts = [corners] if corners.shape[1] < 4 else [corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]]
        total = 0.0
        for part in parts:
            edges = part[:, 1:] - part[:, :1]
            size = np.linalg.norm(edges[:, 0], axis=0)
            if part.shape[1] == 3:
                size = np.abs(edges[0, 0] * edges[1, 1] - edges[1, 0] * edges[0, 1]) / 2
            depth = self.ends[1] - self.ends[0] if not self.ring else 2 * np.pi * part[0].mean(axis=0)
            total += float(np.sum(size * depth))
        return total

    def fills(self, solid: float, flat: float) -> bool:
        """Whether a measure of the solid is that of the section, or of a polygon about it."""
        least = np.sin(self.ring) / self.ring if self.ring else 1.0
        return bool(flat * (least - EVEN) <= solid <= flat * (1 + EVEN))


def section(whole: Whole) -> tuple[list[Simplification], list[str]]:
    """The section that stands for a solid, if there is one, or a sentence about what spoils it."""
    if whole.scene.kind != "solid" or whole.scene.copies != 1:
        return [], []
    reasons: list[tuple[str, str]] = []
    for name, what, made in (*_prisms(whole), *_revolutions(whole)):
        meshes = {body: _section_mesh(mesh, made, whole.size) for body, mesh in whole.meshes.items()}
        if not all(mesh is not None and made.fills(_volume(whole.meshes[b]), made.measure(mesh.p[:, mesh.t])) for b, mesh in meshes.items()):
            continue
        reason = _spoils(whole, made, meshes)
        if not reason:
            return [_simplification(whole, made, name, what, meshes)], []
        reasons.append((what, reason))
    if len(reasons) == 1:  # blocks are prisms along each of their edges: then there is nothing to say
        return [], [f"The bodies are {reasons[0][0]}, but {reasons[0][1]}."]
    return [], []


def _simplification(
    whole: Whole, made: _Section, name: str, what: str, meshes: Mapping[str, Any]
) -> Simplification:
    plane = made.kind == "plane-strain"
    names: dict[str, str | None] = dict.fromkeys("xyz")
    names |= {"xyz"[axis]: new for axis, new in zip(made.axes, "xy" if plane else "rz")}
    scene = flattened(whole.scene, made.kind, names, made.axes, lambda mesh: _section_mesh(mesh, made, whole.size), made.lift)
    if plane:
        scene = replace(scene, thickness=scene.thickness * (made.ends[1] - made.ends[0]))
    else:
        scene = scene.with_parts(lambda part: _on_axis(part, scene))

    def fold(key: Key, x: np.ndarray) -> tuple[Key, np.ndarray, np.ndarray]:
        return key, made.flat(x), np.tile(np.eye(3)[:, made.axes], (x.shape[1], 1, 1))

    layers = plane and all(_layered(whole.meshes[body], mesh, made, whole.size) for body, mesh in meshes.items())
    folds: tuple[Fold, ...] = (fold,) if layers else ()
    why = f"The bodies are {what}; loads, supports, gaps and laws are the same all along. "
    why += "Exact wherever the solution is unique." if folds else "The error is the difference that the meshes make."
    told = f"A section {'in plane strain' if plane else 'on one side of the axis'} stands for the bodies."
    return Simplification(name, told, why, sizes_of(whole.scene), sizes_of(scene), scene, folds)


def _prisms(whole: Whole) -> Iterator[tuple[str, str, _Section]]:
    """Candidates: the name of the simplification, what the bodies are, how they lie on the section."""
    for axis in range(3):
        rows = [mesh.p[axis] for mesh in whole.meshes.values()]
        ends = float(whole.points[axis].min()), float(whole.points[axis].max())
        if all(abs(row.min() - ends[0]) + abs(row.max() - ends[1]) < NEAR * whole.size for row in rows):
            axes = [other for other in range(3) if other != axis]
            made = _Section("plane-strain", axes, [axis], 0.0, ends, np.zeros(3))
            yield "plane strain", f"prisms along {'xyz'[axis]}", made


def _revolutions(whole: Whole) -> Iterator[tuple[str, str, _Section]]:
    """The same for each axis of space, with a half-plane along either of the others for the section."""
    middle = (whole.points.min(axis=1) + whole.points.max(axis=1)) / 2
    for axis, radial in permutations(range(3), 2):
        made = _Section("axisymmetric", [radial, axis], [radial, 3 - axis - radial], 0.0, (0.0, 0.0), middle)
        x = (whole.points - middle[:, None])[made.along]
        outer = np.hypot(*x)
        turn = np.sort(np.arctan2(*x)[outer > outer.max() * (1 - EVEN)])
        ring = float(np.diff([*turn, turn[0] + 2 * np.pi]).max())
        if ring <= WIDEST:
            place = ", ".join(f"{value:.6g}" for value in np.round(middle, 9) + 0.0)
            what = f"of revolution about the line through ({place}) along {'xyz'[axis]}"
            yield "axisymmetry", what, made._replace(ring=ring)


def _section_mesh(mesh: Any, made: _Section, size: float) -> Any:
    """The faces of a solid's elements in its section; None where there are none."""
    near = NEAR * size
    corners = mesh.p[:, mesh.facets]
    if made.kind == "plane-strain":
        inside = np.abs(corners[made.along[0]] - made.ends[0]).max(axis=0) < near
    else:
        x = (corners - made.middle[:, None, None])[made.along]
        inside = (np.abs(x[1]).max(axis=0) < near) & (x[0].min(axis=0) > -near)
    if not inside.any():
        return None
    flat = face_mesh(mesh, np.flatnonzero(inside), made.axes)
    if made.kind == "plane-strain":
        return flat
    flat = replace(flat, doflocs=flat.doflocs - np.array([[made.middle[made.axes[0]]], [0.0]]))
    axis = flat.facets_satisfying(lambda x: np.abs(x[0]) < near, True)
    rings = {name: facets for name, facets in (flat.boundaries or {}).items()}
    return replace(flat, _boundaries=None).with_boundaries(rings | ({AXIS: axis} if len(axis) else {}))


def _layered(mesh: Any, flat: Any, made: _Section, size: float) -> bool:
    """Whether a mesh of hexahedra consists of layers of its section."""
    apart = KDTree(flat.p.T).query(made.flat(mesh.p).T)[0].max()
    return bool(mesh.refdom.__name__ == "RefHex" and apart <= NEAR * size)


def _on_axis(part: Any, scene: Scene) -> Any:
    if not isinstance(part, Part) or AXIS not in (part.build_mesh(scene.elements, scene.zone).boundaries or {}):
        return part
    return replace(part, supports=(*part.supports, Support(AXIS, {"r": 0.0})))


def _spoils(whole: Whole, made: _Section, meshes: Mapping[str, Any]) -> str:
    """Half a sentence that says what is not the same all along the axis or around it; empty if everything is."""
    for name, part in whole.parts.items():
        reason = _part_spoils(whole, name, part, made, meshes[name])
        if reason:
            return reason
    for name, rigid in whole.rigid.items():
        for what in ("force", "displacement"):
            if _acts(held_space("xyz", getattr(rigid, what) or {})[1], made):  # type: ignore[arg-type]
                return f"the {what} of rigid body '{name}' acts {_across(made)}"
        if rigid.normal is not None and _acts(np.array(rigid.normal, float), made):
            return f"the normal of rigid body '{name}' is not across the axis"
        if rigid.gap is not None and not callable(rigid.gap):
            return f"the gap of rigid body '{name}' is given contact by contact"
    for pair in whole.scene.pairs:
        if np.ndim(pair.mu) if not callable(pair.mu) else False:
            return f"the friction of contact '{pair.name}' is given contact by contact"
        gaps = [whole.rigid[name].gap for name in pair.bodies if name in whole.rigid]
        for side, name in enumerate(pair.bodies):
            if name not in whole.parts:
                continue
            x = whole.acting(name, whole.surface_of(pair, side))
            flat = made.lift(made.flat(x))
            functions = [function for function in (pair.mu, *gaps) if callable(function)]
            if not all(equal_functions(function, function, x, flat) for function in functions):
                return f"the gap or the friction of contact '{pair.name}' changes {_across(made)}"
            curve = whole.parts[name].curve_of(whole.surface_of(pair, side))
            if curve is not None and np.abs(made.flat(curve(x)) - made.flat(curve(flat))).max() > NEAR * whole.size:
                return f"the curve of body '{name}' changes {_across(made)}"
    return ""


def _acts(vector: np.ndarray, made: _Section) -> bool:
    """Whether a vector has a part in which nothing may act."""
    return bool(np.abs(vector[made.along]).max() > EVEN * np.abs(vector).max()) if np.any(vector) else False


def _across(made: _Section) -> str:
    return "along the axis" if made.kind == "plane-strain" else "around or across the axis"


def _part_spoils(whole: Whole, name: str, part: Part, made: _Section, flat: Any) -> str:
    covered: set[int] = set()
    mesh = whole.meshes[name]
    ends = _ends(mesh, made, whole.size)
    for item in (*part.supports, *part.loads):
        what = f"the {type(item).__name__.lower()}" + ("" if isinstance(item, BodyForce) else f" on {item.boundary!r}")
        what += f" of body '{name}'"
        if isinstance(item, (BodyForce, Traction)):
            held, value = [], np.array(item.value, float)
        else:
            values = item.force if isinstance(item, Plate) else item.displacement
            P, value = held_space(("x", "y", "z"), values)
            held = [axis for axis in range(3) if P[axis, axis]]
        if _acts(value, made):
            return f"{what} acts {_across(made)}"
        if made.ring and len(set(held) & set(made.along)) == 1:
            return f"{what} holds one component across the axis"
        if isinstance(item, BodyForce):
            continue
        own = set(np.asarray(mesh.boundaries[item.boundary]).tolist())
        if own <= ends and isinstance(item, Support) and held == made.along and not made.ring:
            covered |= own
        elif not _runs(whole, name, item.boundary, made, flat):
            return f"{what} does not run {_along(made)}"
    for surface in whole.scene.surfaces_of(part):
        if not _runs(whole, name, surface, made, flat):
            return f"the contact surface {surface!r} of body '{name}' does not run {_along(made)}"
    return "" if ends <= covered else f"the ends of body '{name}' are not held along the axis"


def _along(made: _Section) -> str:
    return "along the whole axis" if made.kind == "plane-strain" else "all around the axis"


def _ends(mesh: Any, made: _Section, size: float) -> set[int]:
    """The facets of a prism on its two ends."""
    if made.ring:
        return set()
    at = mesh.p[made.along[0]][mesh.facets]
    return {
        int(number) for end in made.ends for number in np.flatnonzero(np.abs(at - end).max(axis=0) < NEAR * size)
    }


def _runs(whole: Whole, body: str, boundary: str, made: _Section, flat: Any) -> bool:
    """Whether a boundary is that of the section, all along."""
    edges = (flat.boundaries or {}).get(boundary, ())
    if not len(edges):
        return False
    return made.fills(_area(whole.corners(body, boundary)), made.measure(flat.p[:, flat.facets[:, edges]]))


def _area(corners: np.ndarray) -> float:
    """Of triangles or quadrilaterals in space, by their corners (3, n, m) [length^2]."""
    total = 0.0
    for a, b, c in [(0, 1, 2), (0, 2, 3)][: corners.shape[1] - 2]:
        across = np.cross(corners[:, b] - corners[:, a], corners[:, c] - corners[:, a], axis=0)
        total += float(np.linalg.norm(across, axis=0).sum()) / 2
    return total


def _volume(mesh: Any) -> float:
    """Of a solid mesh [length^3]."""
    if mesh.refdom.__name__ == "RefHex":
        mesh = type(mesh)(mesh.p[:, : mesh.nvertices], mesh.t).to_meshtet()
    corners = mesh.p[:, mesh.t[:4]]
    return float(np.abs(np.linalg.det(np.moveaxis(corners[:, 1:] - corners[:, :1], 2, 0))).sum()) / 6


