"""A contact surface as the mortar coupling sees it: faces, linear cells for multipliers, places.

A face is described by the nodes of its displacement; its geometry is interpolated from their
coordinates with the same shape functions, which is exact for straight and for isoparametric
elements alike. The multipliers live on linear cells, the same as on one body alone
(contactopt.bodies.elements): halves of lines, quarters of squares, whole triangles.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt.bodies.elements import FACES, TIED
from contactopt.defaults import EQUAL

# kind of the elements -> corners of a face, shape functions of the displacement by degree
_SHAPES = {
    "RefTri": (2, {1: skfem.ElementLineP1(), 2: skfem.ElementLineP2()}),
    "RefQuad": (2, {1: skfem.ElementLineP1(), 2: skfem.ElementLineP2()}),
    "RefTet": (3, {1: skfem.ElementTriP1(), 2: skfem.ElementTriP2()}),
    "RefHex": (4, {1: skfem.ElementQuad1(), 2: skfem.ElementQuad2()}),
}
NEWTON, STEPS = 1e-13, 30  # accuracy of a place on a face, in its own coordinates
BLOCK = 8192  # points at a time, so that what is computed of them stays in the cache


@dataclass(frozen=True, eq=False)
class Faces:
    """The candidate contact boundary of one body.

    name    of the body
    kind    of its elements, the key of contactopt.bodies.elements.FACES
    degree  of the displacement, 1 or 2
    points  (dim, n) coordinates of all nodes of the body [length]
    faces   (f, j) nodes of every face: its corners in cyclic order, then the nodes on its edges,
            then its centre
    turn    (f,) +1 where the normal of the corners' order (in 2D: the direction of the face turned
            clockwise) points outward, -1 where it points inward
    weight  of the integrals: a factor, and whether it is multiplied by r
            (contactopt.bodies.elements.weight_at)
    curve   function (dim, m) -> (dim, m) that puts points of the faces on the true surface; None:
            the faces are it
    mirror  (dim, n) components across planes of symmetry that nodes lie in: what is modelled is
            half of what is there; None: there is no such plane
    every   whether all nodes of quadratic faces are vertices of linear cells
    """

    name: str
    kind: str
    degree: int
    points: np.ndarray
    faces: np.ndarray
    turn: np.ndarray
    weight: tuple[float, bool] = (1.0, False)
    curve: Callable[[np.ndarray], np.ndarray] | None = None
    mirror: np.ndarray | None = None
    every: bool = False

    @property
    def dim(self) -> int:
        return len(self.points)

    @property
    def corners(self) -> int:
        return _SHAPES[self.kind][0]

    @property
    def places(self) -> np.ndarray:
        """(dim - 1, j) reference coordinates of the nodes of a face."""
        return np.asarray(FACES[self.kind][2][:, : self.faces.shape[1]])

    @property
    def cells(self) -> np.ndarray:
        """(c, v) nodes of a face that are the vertices of its linear cells."""
        if self.degree == 1:
            return np.arange(self.corners)[None]
        plain = FACES[self.kind][3]
        return np.asarray(TIED.get(self.kind, plain) if self.every else plain)

    def cell_nodes(self) -> np.ndarray:
        """(f c, v) nodes of the body that are the vertices of all linear cells."""
        return self.faces[:, self.cells].reshape(-1, self.cells.shape[1])

    def around(self) -> sp.csr_array:
        """(f, n) one where a node of the body is a corner of a face."""
        corners = self.faces[:, : self.corners]
        ends = np.arange(0, corners.size + 1, self.corners)
        shape = len(corners), self.points.shape[1]
        return sp.csr_array((np.ones(corners.size), corners.ravel(), ends), shape=shape)

    @cached_property
    def curved(self) -> bool:
        """Whether an inner node of a face lies off the linear interpolation of the corners."""
        count = self.corners
        hats = evaluate(FACES[self.kind][1], self.places)[0][:count, count:]
        nodes = self.points[:, self.faces]
        off = nodes[:, :, count:] - nodes[:, :, :count] @ hats
        size = np.ptp(nodes[:, :, :count], axis=2).max(axis=0)
        return bool(np.any(np.abs(off) > EQUAL * size[:, None]))

    @cached_property
    def distorted(self) -> bool:
        """Whether the map from the reference face is more than affine."""
        nodes = self.points[:, self.faces]
        size = np.ptp(nodes, axis=2).max(axis=0)
        if self.curved or self.corners < 4:
            return self.curved
        skew = nodes[:, :, 0] - nodes[:, :, 1] + nodes[:, :, 2] - nodes[:, :, 3]
        return bool(np.any(np.abs(skew) > EQUAL * size))

    def shapes(self, at: np.ndarray) -> np.ndarray:
        """(j, m) shape functions of the displacement at reference coordinates (dim - 1, m)."""
        return evaluate(_SHAPES[self.kind][1][self.degree], at)[0]

    def local(self, cell: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Coordinates (dim - 1, m) on linear cells (m,), 0 to 1, of places `at` on the face."""
        first = self.places[:, self.cells[:, 0]]
        # the cells lie along the axes: the first edge along one, the last along the other
        ends = self.cells[:, [1, -1]][:, : len(first)]
        width = np.stack([self.places[d, end] - first[d] for d, end in enumerate(ends.T)])
        return np.asarray((at - first[:, cell]) / width[:, cell])

    def hats(self, local: np.ndarray) -> np.ndarray:
        """(v, m) hat functions of a linear cell at coordinates (dim - 1, m) on it."""
        return evaluate(FACES[self.kind][1], local)[0]

    def locations(self, face: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (dim, m) on faces (m,) at reference points, tangents (dim, dim - 1, m) there."""
        element = _SHAPES[self.kind][1][self.degree] if self.curved else FACES[self.kind][1]
        N, slope = evaluate(element, at)
        place, tangents = np.zeros((self.dim, len(face))), np.zeros((self.dim, len(at), len(face)))
        for node, value, rate in zip(self.faces[:, : len(N)].T, N, slope):
            x = self.points[:, node[face]]
            place += x * value
            tangents += x[:, None] * rate
        return place, tangents

    def stretched(self, face: np.ndarray, tangents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outward unit normals (dim, m) on faces (m,) with tangents (dim, dim - 1, m), and areas
        (m,) per area of the reference face.
        """
        normal = cross(tangents) * self.turn[face]
        size = np.linalg.norm(normal, axis=0)
        return normal / size, size

    def mirrored(self, vectors: np.ndarray, nodes: np.ndarray | None = None) -> np.ndarray:
        """Vectors (dim, k) at nodes (k,), or at all, summed with their mirror images."""
        if self.mirror is None:
            return vectors
        return np.where(self.mirror if nodes is None else self.mirror[:, nodes], 0.0, vectors)

    def true(self, x: np.ndarray) -> np.ndarray:
        """Points (dim, m) of the faces moved to the true surface."""
        return x if self.curve is None else np.asarray(self.curve(x), dtype=float)

    def locate(
        self, face: np.ndarray, x: np.ndarray, axes: np.ndarray, start: np.ndarray
    ) -> np.ndarray:
        """Reference coordinates (dim - 1, m) on faces (m,) where axes (m, dim - 1, dim) see the
        points x (dim, m), by Newton's iteration from `start`; one step is exact on affine faces.
        """
        at = np.array(np.broadcast_to(start, (self.dim - 1, len(face))))
        for first in range(0, len(face), BLOCK):
            own = slice(first, first + BLOCK)
            at[:, own] = self._located(face[own], x[:, own], axes[own], at[:, own])
        return at

    def _located(
        self, face: np.ndarray, x: np.ndarray, axes: np.ndarray, at: np.ndarray
    ) -> np.ndarray:
        left = np.arange(len(face))
        for _ in range(STEPS):
            here, tangents = self.locations(face[left], at[:, left])
            own, off = axes[left], x[:, left] - here
            A = [[_along(own, i, t) for t in tangents.swapaxes(0, 1)] for i in range(len(at))]
            step = _solve(A, [_along(own, i, off) for i in range(len(at))])
            at[:, left] = np.clip(at[:, left] + step, -2.0, 3.0)
            left = left[np.abs(step).max(axis=0) >= NEWTON]
            if not len(left) or not self.distorted:
                break
        return at


def _along(axes: np.ndarray, number: int, vectors: np.ndarray) -> np.ndarray:
    """Products (m,) of vectors (dim, m) with one of the axes (m, dim - 1, dim) of each."""
    return np.asarray(sum(a * v for a, v in zip(axes[:, number].T, vectors)))


def _solve(A: list[list[np.ndarray]], b: list[np.ndarray]) -> np.ndarray:
    """Solutions (n, m) of m systems A[row][column] of one or two equations; far if singular."""
    if len(b) == 1:
        over, divisor = np.stack(b), A[0][0]
    else:
        (a00, a01), (a10, a11) = A
        over = np.stack([a11 * b[0] - a01 * b[1], a00 * b[1] - a10 * b[0]])
        divisor = a00 * a11 - a01 * a10
    return np.divide(over, divisor, out=np.full_like(over, 9.0), where=divisor != 0)


def evaluate(element: skfem.Element, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (j, m) and derivatives (j, dim - 1, m) of an element at (dim - 1, m)."""
    both = [element.lbasis(at, j) for j in range(len(element.doflocs))]
    value = np.stack([np.broadcast_to(v, at.shape[1:]) for v, _ in both])
    slopes = [np.broadcast_to(np.asarray(s).reshape(len(at), -1), at.shape) for _, s in both]
    return value, np.stack(slopes)


def faces_of(
    name: str,
    kind: str,
    degree: int,
    nodes: np.ndarray,
    outward: np.ndarray,
    weight: tuple[float, bool],
    points: np.ndarray,
    curve: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Faces:
    """The surface of faces with `nodes` (f, j) and normals like `outward` (dim, f)."""
    made = Faces(name, kind, degree, points, nodes, np.ones(len(nodes)), weight, curve)
    return replace(made, turn=np.sign(np.sum(face_normals(made) * outward, axis=0)))


def face_normals(surface: Faces) -> np.ndarray:
    """(dim, f) outward unit normals at the middle of every face."""
    middle = surface.places[:, : surface.corners].mean(axis=1)
    count = len(surface.faces)
    face, at = np.arange(count), np.repeat(middle[:, None], count, axis=1)
    return surface.stretched(face, surface.locations(face, at)[1])[0]


def cross(tangents: np.ndarray) -> np.ndarray:
    """Normals (dim, m), as long as the surface is stretched, from tangents (dim, dim - 1, m)."""
    if len(tangents) == 2:
        return np.stack([tangents[1, 0], -tangents[0, 0]])
    return np.cross(tangents[:, 0], tangents[:, 1], axis=0)


def patches(surface: Faces, own: bool) -> tuple[np.ndarray, np.ndarray]:
    """The polygons that stand for a face when surfaces are cut: their vertices (p, v) among its
    nodes, and their linear cell (p,), over which they never reach where the side is `own`.
    """
    if surface.curved and surface.kind == "RefTet":
        return TIED["RefTet"], np.arange(4) % len(surface.cells)
    if own or surface.curved:
        return surface.cells, np.arange(len(surface.cells))
    return np.arange(surface.corners)[None], np.zeros(1, dtype=int)
