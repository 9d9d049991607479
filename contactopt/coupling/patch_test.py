"""Whether a coupling transmits a constant pressure: the patch test of one pair of surfaces.

A pressure of one on all contacts is the forces r_i = A_i n_i. Through the maps of the coupling they
become nodal forces T' r of each body. They are right where they are the consistent nodal forces of
the body's own surface, int N_j n. Its own contacts give these: the sum of a_i n_i times their own
traces. What counts is the component along the normal of the surface. The comparison costs about one
product with each sparse map.

**What is allowed.** On flat surfaces the test holds to rounding (EQUAL). On curved ones the two
sides see one contact on faces of slightly different size and direction. Let c be the cosine of the
angle between the normal of a contact and those of the nodes that it acts on, or between these and
the faces around them. An area, and a component along a normal, then differ by 1 - c each, on both
sides. A gap g between surfaces of curvature kappa changes areas by g kappa. A
surface of revolution has a second curvature |n_r| / r.

**What is compared.** Where one surface ends on the faces of the other, or turns away from it, faces
are covered in part. Nodes are compared unless a contact that acts on them also acts on the rim of
the other surface; there they are compared only if all faces are known to be covered.

A coupling of nodes whose facets are the same on both sides is right by construction, and tolerates
what curvature and gap do. A coupling of nodes whose facets differ must hold to rounding.

Source: Taylor, Papadopoulos (1991), On a patch test for contact problems in two dimensions, in:
Wriggers, Wagner (eds), Nonlinear Computational Mechanics, Springer, 690-702.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import Mesh, Surface
from contactopt.defaults import EQUAL
from contactopt.meshes.cells import rim
from contactopt.scenes.contact import SIDES

if TYPE_CHECKING:
    from contactopt.coupling.coupling import Coupling

CORNERS = {"RefTri": 2, "RefQuad": 2, "RefTet": 3, "RefHex": 4}  # of a face of these elements
GAP = 3.0  # what a gap makes of an area, over gap and curvature: 2 on a sphere, and its square
CHORD = 4.0  # two areas and two components along normals, over 1 - c


class Misfit(NamedTuple):
    """Where a coupling gives a body other forces than a constant pressure does.

    side   0 or 1: the upper or the lower body
    place  (dim,) the node with the largest error [length]
    error  of the force there, over this force or the mean force on the nodes of a face there
    """

    side: int
    place: np.ndarray
    error: float


def misfit(made: Coupling, surfaces: Sequence[Surface | None]) -> Misfit | None:
    """The node where a coupling fails the patch test most; None where it passes.

    made      the coupling
    surfaces  the upper and the lower surface; None for a body that follows the other one
    """
    sides = [
        _Side(made, number, surface, surface.mesh)
        for number, surface in enumerate(surfaces)
        if surface is not None and surface.mesh is not None
    ]
    if not sides:
        return None
    allowed = np.full(len(made.gap), EQUAL)
    if made.conforming or made.share is not None:
        allowed += _chords(made, sides)
    found = []
    for number, side in enumerate(sides):
        excess = side.error - _largest(side.acts.T, allowed)
        excess[~_compared(made, side, sides[number - 1])] = 0.0
        worst = int(np.argmax(excess))
        if excess[worst] > 0:
            found.append(
                Misfit(side.number, side.mesh.locations[:, worst], float(side.error[worst]))
            )
    return max(found, key=lambda one: one.error, default=None)


class _Side:
    """One body of a coupling of k contacts, at the s nodes of its surface.

    number   0 for the upper body, 1 for the lower one
    acts     (k, s) 1 where a contact acts on a node
    seen     (s,) whether any does
    normals  (dim, s) unit normals
    error    (s,) of the normal forces, over them or, where it is larger, the mean on the nodes of
             a face there
    cosine   (k,) of the angle between the normals of contacts and of their nodes
    held     (s,) whether a support holds a node along its normal
    """

    def __init__(self, made: Coupling, number: int, surface: Surface, mesh: Mesh) -> None:
        self.number, self.surface, self.mesh = number, surface, mesh
        T = (made.upper, made.lower)[number]
        along = [T[:: len(surface.points)] @ row.T for row in mesh.picked]  # normal components
        own = [trace @ row.T for trace, row in zip(surface.traces, mesh.picked)]
        pressed = surface.areas * surface.normals
        towards = np.stack([abs(W).T @ part for W, part in zip(own, pressed)])
        self.normals = towards / np.maximum(np.linalg.norm(towards, axis=0), 1e-300)

        def normal(forces: list[np.ndarray]) -> np.ndarray:
            return np.asarray(np.sum(self.normals * np.stack(forces), axis=0))

        right = normal([W.T @ part for W, part in zip(own, pressed)])
        sign = 2.0 * number - 1  # frames have the lower body's normals
        given = sign * normal([W.T @ made.areas for W in along])
        mean = np.abs(right)[mesh.faces].mean(axis=1)
        scale = np.abs(right)
        np.maximum.at(scale, mesh.faces, mean[:, None])
        self.error = np.abs(given - right) / np.maximum(scale, 1e-300)
        pattern = sp.csr_matrix(sum(abs(W) for W in along))
        self.acts = sp.csr_matrix(pattern > 0, dtype=float)
        self.seen = np.diff(self.acts.tocsc().indptr) > 0
        rigid = np.linalg.norm([W.sum(axis=1) for W in along], axis=0).ravel()  # 1 where right
        moved = sum(W @ n for W, n in zip(along, self.normals))
        self.cosine = sign * moved / np.maximum(rigid, 1e-300)
        self.held = np.any(mesh.held & (np.abs(self.normals) > EQUAL), axis=0)

    def turn(self) -> np.ndarray:
        """(k,) largest 1 - cosine at a contact: of its normal, and of the faces at its nodes."""
        faces = self.mesh.faces
        between = np.sum(self.normals[:, faces] * self.mesh.outward[:, :, None], axis=0)
        at_nodes = np.zeros(len(self.error))
        np.maximum.at(at_nodes, faces, 1 - between)
        return np.abs(1 - self.cosine) + _largest(self.acts, at_nodes)

    def ends(self) -> np.ndarray:
        """(s,) nodes on an edge of one face only, and those of faces that are covered in part."""
        ends = self.beside()
        ends[rim(self.mesh.faces[:, : CORNERS[self.mesh.kind]].T)] = True
        return ends

    def beside(self) -> np.ndarray:
        """(s,) nodes of faces with a node on which no contact acts."""
        faces, alone = self.mesh.faces, ~self.seen
        beside = np.zeros(len(alone), dtype=bool)
        beside[faces[alone[faces].any(axis=1)]] = True
        return beside


def _compared(made: Coupling, side: _Side, other: _Side) -> np.ndarray:
    """(s,) nodes of a side around which the other one covers all faces, as far as one knows."""
    if made.share is None:
        return side.seen  # contacts are nodes of both sides
    rim, beside = other.acts @ other.ends() > 0, side.beside()
    if np.abs(made.areas.sum() / side.surface.areas.sum() - 1) < EQUAL:  # all is covered
        rim[:], beside[:] = False, False
    elif side.number == SIDES.index(made.carrier):
        rim &= np.abs(made.share - 1) > EQUAL
    for one in (side, other):  # where supports take the forces
        rim |= one.acts @ one.held > 0
    return np.asarray(side.seen & ~beside & (side.acts.T @ rim == 0))


def _largest(acts: sp.csr_matrix, values: np.ndarray) -> np.ndarray:
    """The largest of some values >= 0 in every row of a pattern."""
    return np.asarray(acts.multiply(values[None]).max(axis=1).todense()).ravel()


def _chords(made: Coupling, sides: list[_Side]) -> np.ndarray:
    """(k,) what curvature and gap make of the force of a contact."""
    turn = sum(side.turn() for side in sides)
    size = np.zeros(len(made.gap))
    for one in range(len(made.cells)):
        ends = made.cells[one], made.cells[one - 1]
        length = np.linalg.norm(made.positions[:, ends[0]] - made.positions[:, ends[1]], axis=0)
        for end in ends:
            np.maximum.at(size, end, length)
    bent = np.sqrt(2 * turn) / np.where(size > 0, size, np.inf)  # curvature
    if any(side.mesh.measure[1] for side in sides):  # and that of the circles around the axis
        r = np.abs(made.positions[0])
        bent = bent + np.abs(made.frames[:, 0, 0]) / np.where(r > 0, r, np.inf)
    return np.asarray(CHORD * turn + GAP * np.abs(made.gap) * bent)
