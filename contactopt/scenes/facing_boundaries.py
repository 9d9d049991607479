"""Which boundaries of which bodies face each other: the pairs that may touch, found by proximity.

A facet faces another if their outward normals n, m are opposed, m . n < -0.7, and if the centre of
one of them, projected along the normal of the other, lies inside the other and not farther from it
than a distance. So facets that lie beside each other do not, and overlaps count as gaps do.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from skfem import Mesh

from contactopt.defaults import CLOSE
from contactopt.meshes.cells import area_vectors, outer_corners

OPPOSED = -0.7  # cosine of the angle between normals
NEAREST = 12  # facets of the other body that are tried
SIZE = 0.005  # usual distance, over the diagonal of the box around all bodies
LEAST = 0.02  # of the area of the smaller boundary, which must face the other one


@dataclass(frozen=True)
class Facing:
    """Two boundaries that face each other.

    sides  (body, boundary) of each
    share  area that faces the other boundary, over the whole area of both
    gaps   least and largest distance of the facets that do [length]; negative ones are overlaps
    """

    sides: tuple[tuple[str, str], tuple[str, str]]
    share: float
    gaps: tuple[float, float]


def usual_distance(meshes: Mapping[str, Any]) -> float:
    """The distance within which boundaries are a pair unless another one is given [length]."""
    low = np.min([mesh.p.min(axis=1) for mesh in meshes.values()], axis=0)
    high = np.max([mesh.p.max(axis=1) for mesh in meshes.values()], axis=0)
    return SIZE * float(np.linalg.norm(high - low))


def facing_boundaries(meshes: Mapping[str, Any], distance: float) -> list[Facing]:
    """The pairs of boundaries of different bodies that face each other within a distance [length].

    `meshes` are the bodies' by their names, with the boundaries that may touch. Where
    boundaries overlap, the ones that face each other with the largest share of their areas count.
    """
    found = []
    names = [name for name, mesh in meshes.items() if mesh.boundaries]
    surfaces = {name: _Surface(meshes[name]) for name in names}
    for i, upper in enumerate(names):
        for lower in names[i + 1 :]:
            found += _pairs(upper, surfaces[upper], lower, surfaces[lower], distance)
    return found


def as_toml(pairs: Iterable[Facing], mu: float | Sequence[float], length: str) -> str:
    """The pairs as the tables of a scene file, with their friction and a unit of length or ''."""
    unit = length and f" {length}"
    return "\n".join(
        f"[[contacts]]  # gaps from {pair.gaps[0]:.3g} to {pair.gaps[1]:.3g}{unit},"
        f" {100 * pair.share:.3g} % of the areas\n"
        f'upper = "{":".join(pair.sides[0])}"\nlower = "{":".join(pair.sides[1])}"\n'
        f"mu = {json.dumps(mu)}"
        for pair in pairs
    )


class _Surface:
    """The facets of the boundaries of a mesh: corners (dim, c, f), centres, areas, normals."""

    def __init__(self, mesh: Mesh):
        facets = np.unique(np.concatenate([np.asarray(own) for own in mesh.boundaries.values()]))
        self.corners = mesh.p[:, outer_corners(mesh, facets)]
        self.centres = self.corners.mean(axis=1)
        vectors = area_vectors(self.corners)
        self.areas = np.linalg.norm(vectors, axis=0)
        self.normals = vectors / self.areas
        self.members = {
            name: np.isin(facets, np.asarray(own)) for name, own in mesh.boundaries.items()
        }

    def inside(self, number: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Whether places (dim, m) lie inside the facets (m,) when they are projected on them."""
        corners, normals = self.corners[..., number], self.normals[:, number]
        if len(corners) == 2:
            edge = corners[:, 1] - corners[:, 0]
            along = np.sum(edge * (places - corners[:, 0]), axis=0)
            return np.asarray((along >= 0) & (along <= np.sum(edge**2, axis=0)))
        edges = np.roll(corners, -1, axis=1) - corners
        left = np.cross(edges, places[:, None] - corners, axis=0)
        return np.asarray((np.sum(left * normals[:, None], axis=0) >= 0).all(axis=0))


def _faced(own: _Surface, other: _Surface, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (2, m) of facets whose first has its centre over the second, and their gaps (m,)."""
    tries = min(NEAREST, other.centres.shape[1])
    near = KDTree(other.centres.T).query(own.centres.T, k=tries)[1].ravel()
    mine = np.repeat(np.arange(own.centres.shape[1]), tries)
    cosine = np.sum(own.normals[:, mine] * other.normals[:, near], axis=0)
    away = own.centres[:, mine] - other.centres[:, near]
    gap = np.sum(away * other.normals[:, near], axis=0)
    good = (cosine < OPPOSED) & (np.abs(gap) <= distance)
    good[good] = other.inside(near[good], own.centres[:, mine[good]])
    return np.stack([mine[good], near[good]]), gap[good]


def _pairs(upper: str, one: _Surface, lower: str, two: _Surface, distance: float) -> list[Facing]:
    """The pairs of boundaries of two bodies."""
    (over, high), (under, low) = _faced(one, two, distance), _faced(two, one, distance)
    (i, j), gap = np.concatenate([over, under[::-1]], axis=1), np.concatenate([high, low])
    tried = []
    for first, in_first in one.members.items():
        for second, in_second in two.members.items():
            chosen = in_first[i] & in_second[j]
            shared = [one.areas[np.unique(i[chosen])].sum(), two.areas[np.unique(j[chosen])].sum()]
            whole = [one.areas[in_first].sum(), two.areas[in_second].sum()]
            if chosen.any() and max(s / w for s, w in zip(shared, whole)) > LEAST:
                tried.append((sum(shared) / sum(whole), first, second, chosen))
    made, covered = [], np.zeros(len(i), dtype=bool)
    for share, first, second, chosen in sorted(tried, key=lambda own: -own[0]):
        if not covered[chosen].all():
            own = np.where(np.abs(gap[chosen]) < CLOSE * distance, 0.0, gap[chosen])
            gaps = float(own.min()), float(own.max())
            made.append(Facing(((upper, first), (lower, second)), float(share), gaps))
        covered |= chosen
    return made
