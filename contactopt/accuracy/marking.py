"""Which elements are divided, and the meshes that come of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from contactopt.accuracy.polygon import other_polygon
from contactopt.bodies.views import on_elements
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.meshes.cells import is_curved, straight
from contactopt.meshes.given_curves import Curve
from contactopt.meshes.mesh_refinement import Function, bent, divide, facets_of, slivers, split
from contactopt.meshes.structured import simplices
from contactopt.readings.peaks import Peak
from contactopt.scenes.body_kinds import Body
from contactopt.scenes.refined_scenes import part_curves
from contactopt.scenes.scene import Part, Scene

SAMPLES = {2: 32, 3: 8}  # parts of a facet's edge at whose ends a gap function is sampled
CLOSURE = 0.05  # share of the closure by which a sampled gap may fall below the one between nodes


@dataclass(frozen=True, eq=False)
class Shapes:
    """What the meshes of a scene stand for.

    curves   name of the body -> name of the boundary -> curve
    guessed  name of the body -> name of the boundary, where the curve is a guess -> its other
             shape, a function of points on the curve; None where no edge is in doubt
    """

    curves: Mapping[str, Mapping[str, Curve]]
    guessed: Mapping[str, Mapping[str, Function | None]]

    @property
    def names(self) -> str:
        """The guessed boundaries in words."""
        pairs = [(body, name) for body, own in self.guessed.items() for name in own if name]
        found = [f"'{name}' of body '{body}'" for body, name in pairs]
        return ", ".join(found[:3]) + (" and more" if len(found) > 3 else "")

    @property
    def doubtful(self) -> bool:
        """Whether a guess may be wrong."""
        return any(other is not None for own in self.guessed.values() for other in own.values())

    def of(self, part: Body) -> Mapping[str, Curve]:
        return self.curves.get(part.name, {})


def divisible(scene: Scene, simplicial: bool) -> tuple[Scene, Shapes]:
    """Put a scene on meshes of straight elements, with `simplicial` of simplices, and find the
    curves of their boundaries: those of its parts or files, else the smooth outline of the first
    mesh as a guess.
    """
    curves: dict[str, dict[str, Curve]] = {}
    guessed: dict[str, dict[str, Function | None]] = {}

    def prepared(part: Body) -> Body:
        if not isinstance(part, Part):
            return part
        given = part.build_mesh(4, scene.zone)  # elements across its first half-width
        cut = simplices(given) if simplicial else straight(given)
        found = curves[part.name] = part_curves(part, given)
        guessed[part.name] = {
            name: other_polygon(cut, facets_of(cut, name)) if scene.dim == 2 else curve.other
            for name, curve in found.items()
            if not curve.known
        }
        own = {name: found[name] for name in scene.surfaces_of(part) if name in found}
        return replace(part, mesh=cut, curve=own or None)

    return scene.with_parts(prepared), Shapes(curves, guessed)


def with_bent_edges(scene: Scene, shapes: Shapes) -> Scene:
    """The scene as it is solved: edges of quadratic displacements follow the curved boundaries."""
    if scene.degree == 1:
        return scene
    return _with_meshes(scene, lambda part: bent(part.mesh, shapes.of(part)))


def left_out(part: Any, shapes: Shapes) -> np.ndarray:
    """The volumes (elements,) between straight facets and curves; (0,) without a mesh."""
    if not hasattr(part, "mesh"):
        return np.zeros(0)
    straight_edges = not is_curved(part.mesh)
    return slivers(part.mesh, shapes.of(part)) if straight_edges else np.zeros(part.mesh.nelements)


def otherwise(scene: Scene, shapes: Shapes) -> Scene:
    """The scene with every guessed boundary in its other shape, as it is solved."""

    def moved(part: Any) -> Any:
        points, curves = part.mesh.p.copy(), dict[str, Any](shapes.of(part))
        for name, other in shapes.guessed.get(part.name, {}).items():
            if other is None:
                continue
            nodes = np.unique(part.mesh.facets[:, facets_of(part.mesh, name)])
            points[:, nodes] = other(points[:, nodes])
            curves[name] = partial(lambda own, other, x: other(own(x)), curves[name], other)
        mesh = replace(part.mesh, doflocs=points)
        return mesh if scene.degree == 1 else bent(mesh, curves)

    return _with_meshes(scene, moved)


def finer(scene: Scene, marked: tuple[np.ndarray, ...] | None, shapes: Shapes) -> Scene:
    """The scene with marked elements (None: all) divided, and facets that face much finer ones."""
    if marked is None:
        return _with_meshes(scene, lambda part: split(part.mesh, shapes.of(part)))
    for _ in range(6):  # of divisions that keep facing facets about as long as each other
        marked = balanced(scene, marked)
        if not any(len(elements) for elements in marked):
            break
        chosen = {part.name: own for part, own in zip(scene.parts, marked) if len(own)}
        scene = scene.with_parts(partial(_divided, chosen=chosen, shapes=shapes))
        marked = tuple(own[:0] for own in marked)
    return scene


def _divided(part: Body, chosen: Mapping[str, np.ndarray], shapes: Shapes) -> Body:
    if not isinstance(part, Part) or part.name not in chosen:
        return part
    return replace(part, mesh=divide(part.mesh, chosen[part.name], shapes.of(part)))


def _with_meshes(scene: Scene, mesh: Callable[[Part], Any]) -> Scene:
    return scene.with_parts(
        lambda part: replace(part, mesh=mesh(part)) if hasattr(part, "mesh") else part
    )


def unknowns(scene: Scene) -> int:
    """The displacement components of all nodes of the meshes, at least as many as the unknowns."""
    total = 0
    for mesh in (part.mesh for part in scene.parts if hasattr(part, "mesh")):
        inner = (mesh.nfacets if scene.dim == 2 else mesh.nedges) if scene.degree == 2 else 0
        total += scene.dim * int(mesh.nvertices + inner)
    return total


def balanced(scene: Scene, marked: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    """Mark more elements, so that surfaces that face each other stay about as fine."""
    chosen = [set(elements.tolist()) for elements in marked]
    names = [part.name for part in scene.parts]
    for pair in scene.pairs:
        sides = [names.index(body) for body in pair.bodies]
        parts: list[Any] = [scene.parts[i] for i in sides]
        if not all(hasattr(part, "mesh") for part in parts):
            continue
        sought = zip(parts, pair.surfaces)
        faces = [_facets(part, surface or part.contact) for part, surface in sought]
        for one, other in ((0, 1), (1, 0)):
            middle, size, element = faces[one]
            facing, small, theirs = faces[other]
            halved = np.where(np.isin(theirs, list(chosen[sides[other]])), 0.5, 1.0) * small
            distance, near = cKDTree(facing.T).query(middle.T)
            back, mine = cKDTree(middle.T).query(facing.T)
            least = halved[near].copy()
            reached = back <= 2 * size[mine]
            np.minimum.at(least, mine[reached], halved[reached])
            coarse = (size > 1.6 * least) & (distance <= 2 * size)
            chosen[sides[one]].update(element[coarse].tolist())
    return tuple(np.array(sorted(elements), dtype=int) for elements in chosen)


def _facets(part: Any, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles (dim, f) and sizes (f,) of the facets of a boundary [length], and their elements."""
    mesh = straight(part.mesh)
    facets = mesh.boundaries[name]
    corners = mesh.p[:, mesh.facets[:, facets]]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=0).max(axis=0)
    return corners.mean(axis=1), size, mesh.f2t[0, facets]


def at_contacts(reduction: Reduction, contacts: np.ndarray) -> tuple[np.ndarray, ...]:
    """For each body the elements at the nodes of some contacts."""
    weights = np.zeros(reduction.problem.q.shape)
    weights[contacts] = 1.0
    return tuple(np.flatnonzero(own) for own in spread(reduction, weights))


def spread(reduction: Reduction, weights: np.ndarray) -> list[np.ndarray]:
    """What the elements of each body share of weights (k, dim) of contacts at their nodes."""
    parts = zip(reduction.bodies, reduction.maps)
    return [on_elements(body, np.asarray(abs(B).T @ weights.ravel())) for body, B in parts]


def plateau(reduction: Reduction, pressure: np.ndarray, peaks: Sequence[Peak]) -> np.ndarray:
    """Contacts that press at least as much as the least of some peaks on their own pair. Where many
    peaks come close to the largest one, the surface is divided as one, since facets of different
    lengths would make peaks of their own.
    """
    least = np.full(len(pressure), np.inf)
    for pair in reduction.problem.pairs:
        named = [one for one in peaks if len(one.contacts)]
        own = [one.value for one in named if pair.start <= one.contacts[0] < pair.stop]
        least[pair.contacts] = min(own, default=np.inf)
    return np.flatnonzero(pressure >= least)


def overlooked(reduction: Reduction, touching: np.ndarray, apart: np.ndarray) -> np.ndarray:
    """The contacts between which the gap of a rigid body is smaller than that of the nodes
    suggests. The gap is sampled within every facet. It counts if the difference exceeds the sum of
    the distance of the surfaces, `apart` (k,) [length], and a share CLOSURE of the closure, which
    the contacts `touching` (k,) show.
    """
    scene, problem = reduction.scene, reduction.problem
    found = [np.empty(0, dtype=int)]
    parts = {part.name: part for part in scene.parts}
    for pair, made, coupling in zip(scene.pairs, problem.pairs, reduction.couplings):
        gaps = [getattr(parts[body], "gap", None) for body in pair.bodies]
        gap = next((own for own in gaps if callable(own)), None)
        cells, touches = coupling.cells.T, touching[made.contacts]
        if gap is None or not np.size(cells):
            continue
        corners = cells[:, : scene.dim]  # of a quadrilateral half
        shares = _lattice(scene.dim)
        own, clear = coupling.gap, np.maximum(apart[made.contacts], 0.0)
        points = np.einsum("sc,dvc->dvs", shares, problem.coordinates[:, made.contacts][:, corners])
        sampled = np.asarray(gap(points.reshape(scene.dim, -1)), dtype=float)
        sampled = sampled.reshape(points.shape[1:])
        between = own[corners] @ shares.T
        closure = float(np.ptp(own[touches])) if touches.any() else 0.0
        bound = clear[corners] @ shares.T + CLOSURE * closure
        rounding = 1e-9 * float(np.abs(problem.coordinates).max())
        hidden = np.any(between - sampled > bound + rounding, axis=1)
        found.append(np.unique(corners[hidden]) + made.start)
    return np.concatenate(found)


def _lattice(dim: int) -> np.ndarray:
    """Shares (s, dim) of the corners at evenly spaced places within a facet."""
    n = SAMPLES[dim]
    ticks = np.arange(1, n) / n
    if dim == 2:
        return np.stack([1 - ticks, ticks], axis=1)
    first, second = (part.ravel() for part in np.meshgrid(ticks, ticks))
    inside = first + second < 1
    return np.stack([1 - first - second, first, second], axis=1)[inside]


def check_refinable(scene: Scene) -> None:
    """InputError, before anything is solved, for a scene that has no mesh to refine."""
    if not any(hasattr(part, "mesh") for part in scene.parts):
        raise InputError(
            f"scene '{scene.name}' has no mesh to refine: give the points of half-spaces as a"
            " function (elements, zone) -> points; bodies by matrices are as fine as they are."
        )
