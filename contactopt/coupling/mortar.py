"""Mortar coupling of two surfaces whose nodes do not match, with dual multipliers.

One side, the finer one unless told otherwise, carries the contacts. Its linear cells
(contactopt.coupling.faces) have hat functions phi_i; on the part G of every cell that the other
side covers,

    a_i = int_G phi_i,    psi_i linear on the cell,    int_G psi_i phi_j = delta_ij a_i,

the dual basis of the covered part. With the shape functions N_j of the own side and N'_j of the
other, evaluated at the places that face each other,

    W_ij = int_G psi_i N_j / a_i,    W'_ij = int_G psi_i N'_j / a_i,    u_i = W_ij u_j - W'_ij u'_j,

and a contact force r_i acts by r_i W_ij on the own side, by -r_i W'_ij on the other. The functional
psi_i / a_i of a field is the value at contact i of its best linear fit on the covered part. Hence:

* Rows of W and of W' add up to one, so that forces are equal and opposite.
* The psi_i add up to one, so that a uniform pressure, r_i = p a_i, gives every node of both sides
  exactly the integral of its shape function: the patch test, on partly covered faces too.
* A cell that is partly covered is cut down to the smallest similar cell around G, with hat
  functions of its own: a contact outside the other surface moves to its edge, where the force acts.
  Continued to the node, the normals and the gap of a steep side mean nothing. Contacts without any
  covered cell are left out. Those that are hardly covered (WEAK) pass their share on to the
  strongest contact of the cell: the force of an edge over the area of a sliver is no pressure.

**Moments.** Forces act at W x and W' x'. The vector e_i = W_ij x_j - W'_ij x'_j between these
places is zero where the surfaces lie on each other, but not where both are polygons inscribed in
one curve; the moment of interface forces is the sum of e_i x r_i. A gap g_i closes along the normal
before forces arise, so that e_i - g_i n_i is the lever that remains in contact. It is removed by
evaluating the displacement of the own side at its other end, as a rotating surface carries it
there,

    u_i = W u - W' u' - omega_i(u) x l_i,
    omega_i(u) = J^-1 sum_j w_j rho_j x u_j,   J = sum_j w_j (rho_j^2 - rho_j rho_j'),

with omega_i the mean rotation of the nodes of the faces around contact i, rho_j their places from
their centre, w_j the areas of the faces. It is exact for rigid motions, so that these give u = 0 at
l_i = e_i, and by transposition forces on both bodies have no resultant moment. The lever, and what
it changes, is of second order in the size of the faces. l_i also contains the gap itself, but at
most an eighth of the size of a face (levers.SHARE), by about which an arc as long as its radius
deviates from a chord: polygons are in equilibrium whether their curve is known or not, and the rest
of a larger gap is left to the geometry. In an axisymmetric scene moments vanish by symmetry.

**Kinks of linear elements.** With linear elements on the other side, W' has a further term, which
rounds off the kinks of its displacement (contactopt.coupling.rounded_kinks): otherwise finer
contacts would follow them, and pressures converge in first order.

**Frames.** Normals are those of the lower body, whichever side carries the contacts: as everywhere,
and so that the answer does not depend on the choice.

**Planes of symmetry.** At a contact in such a plane the model holds one half of the faces around
it. What the whole would give is the sum with the mirror image: normals, gaps and levers have no
component out of the plane, and the mean rotation none about axes in it (Faces.mirror). Otherwise a
gap that closes along the plane would also be a slip, and raise friction. The rounding of kinks fits
the nodes of the image, too.

**Contacts that are supported.** Where a support holds a component at a contact's node, that
component of u_i is taken from this node alone, and from the other body at the place that faces it
(`alone`); on a plane of symmetry both are at rest. The cone of the contact is untouched.

Sources: Wohlmuth (2000), A mortar finite element method using dual spaces for the Lagrange
multiplier, SIAM J. Numer. Anal. 38, 989-1012; Popp, Gitterle, Gee, Wall (2010), A dual mortar
approach for 3D finite deformation contact with consistent linearization, Int. J. Numer. Meth. Engng
83, 1428-1465; Cichosz, Bischoff (2011), Consistent treatment of boundaries with mortar contact
formulations using dual Lagrange multipliers, Comput. Methods Appl. Mech. Engrg 200, 1317-1332; Puso
(2004), A 3D mortar method for solid mechanics, Int. J. Numer. Meth. Engng 59, 315-336 (rigid
motions of curved interfaces).
"""

import logging
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import KDTree
from skfem.quadrature import get_quadrature

from contactopt.bodies.elements import FACES, weight_at
from contactopt.checks import place_words
from contactopt.coupling.faces import NEWTON, Faces, cross, evaluate
from contactopt.coupling.levers import levers, rotations_times
from contactopt.coupling.mortar_matrices import Integrals, collect, integrate, tidy
from contactopt.coupling.segments import Overlap, overlap
from contactopt.defaults import CLOSE, EQUAL
from contactopt.errors import InputError

NUDGE = 0.05  # of the way to the centre of a face: about the first point of integration on it

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Mortar:
    """k contacts between two surfaces; of every pair, the upper body comes first.

    own      0 or 1: the body whose nodes carry the contacts
    nodes    (k,) these nodes
    areas    (k,) areas of the covered parts, with the weight of the integrals
    normals  (dim, k) unit normals, outward from the lower body
    gap      (k,) initial gap [length]
    points   (dim, k) positions: of the nodes, or of the other surface's edge if it ends before
    share    (k,) the areas over those of the faces: less than one where the other surface ends
    weights  two (k, nodes of the body): what the displacement of the nodes contributes to that of
             the contacts
    across   [c] (k, nodes of the other body): what is added to its weights in component c; empty
             where there is no plane of symmetry
    alone    two (k, nodes of the body): the displacement at the contact's own node, and at the
             place facing it
    lever    (dim, k) l_i, from the other body to the own one [length]; zero where the surfaces lie
             on each other
    carried  [c][d] (k, nodes of the own body): what displacements d contribute to component c of
             omega_i x l_i; empty where all levers are zero
    """

    own: int
    nodes: np.ndarray
    areas: np.ndarray
    normals: np.ndarray
    gap: np.ndarray
    points: np.ndarray
    share: np.ndarray
    weights: tuple[sp.csr_matrix, sp.csr_matrix]
    alone: tuple[sp.csr_matrix, sp.csr_matrix]
    lever: np.ndarray
    across: list[sp.csr_matrix]
    carried: list[list[sp.csr_matrix]]

    def components(self, body: int, held: np.ndarray) -> list[list[sp.csr_matrix]]:
        """Matrices [c][d] (k, nodes): what displacements d of the nodes of a body contribute to
        component c of the contacts, of the upper body, 0, or the lower one, 1.

        At the contacts' nodes on the own body supports hold the components `held` (dim, k).
        """
        dim = len(self.lever)
        plain, alone = self.weights[body], self.alone[body]
        made = [[sp.csr_matrix(plain.shape)] * dim for _ in range(dim)]
        added = self.across if body != self.own else []
        for c, W in enumerate([plain + more for more in added] or [plain] * dim):
            made[c][c] = W - sp.diags(held[c].astype(float)) @ (W - alone) if held[c].any() else W
            if body == self.own and self.carried:
                free = sp.diags((~held[c]).astype(float))
                made[c] = [there - free @ part for there, part in zip(made[c], self.carried[c])]
        return made


def mortar(upper: Faces, lower: Faces, own: str | None = None) -> Mortar:
    """Find the contacts between two surfaces, with areas, normals and gaps, and the weights of the
    displacements of both sides.

    `own`, 'upper' or 'lower', is the body that carries the contacts; by default the one with more
    contacts where they face each other. InputError if the surfaces face each other nowhere.
    """
    if own not in (None, "upper", "lower"):
        raise InputError(
            f"the side that carries the contacts must be 'upper', 'lower' or None; got {own!r}."
        )
    pair = (upper, lower)
    first = 0 if own == "upper" else 1
    mine, theirs = pair[first], pair[1 - first]
    # Where the surfaces face each other, along the normals of the side that carries the contacts.
    normals, sizes, full = contact_normals(mine)
    pieces = overlap(mine, theirs, normals)
    here = _contacts(mine, pieces.cell // len(mine.cells))
    if own is None and _contacts(theirs, pieces.face) > here:
        return mortar(upper, lower, "upper")
    if not len(pieces.cell):
        raise InputError(
            f"the contact boundaries of body '{upper.name}' and body '{lower.name}' face each other"
            " nowhere; check the boundaries' names, the bodies' positions, and which of them is"
            " the upper one."
        )
    points = pieces.points()
    sums = integrate(mine, theirs, points, full)
    nodes = sums.nodes
    # Normals are always those of the lower body: its own at its nodes, or as they are seen from the
    # contacts.
    n = mine.mirrored(normals[:, nodes] if first == 1 else _seen(theirs, sums), nodes)
    n = n / np.linalg.norm(n, axis=0)
    up = -n if first == 1 else n  # along which x - x' opens the gap
    # The gap is the part of the mean vector along the normal, positive where the bodies are apart.
    gap = np.sum(up * mine.mirrored(sums.apart, nodes), axis=0)
    lever = np.zeros_like(n)
    if not mine.weight[1]:
        # e_i = W x - W' x', the vector between the places where the two forces of a contact act,
        # and its lever.
        e = (sums.own @ mine.points.T).T - _at_contacts(sums, theirs.points)
        lever = levers(mine.mirrored(e, nodes), up, gap, sizes[nodes])
    carried = rotations_times(lever, mine, nodes) if np.any(lever) else []
    x = mine.points[:, nodes]
    fixed = ~sums.partial if mine.mirror is None else ~sums.partial | mine.mirror[:, nodes]
    x = np.where(fixed, x, (sums.own @ mine.points.T).T)
    if sums.least < -CLOSE * np.ptp(mine.points, axis=1).max():
        where = place_words(sums.nearest)
        said = "bodies '%s' and '%s' overlap initially, by up to %.3g at (%s)"
        _log.warning(said, upper.name, lower.name, -sums.least, where)
    weights, alone = (sums.own, sums.other), _alone(mine, theirs, points, nodes, x, normals)
    if first == 1:
        weights, alone = weights[::-1], alone[::-1]
    share = sums.areas / sums.full
    # with the weight r a part of a face may have the integral of all of it
    share = np.where(sums.partial, np.minimum(share, 1 - 2 * EQUAL), share)
    return Mortar(
        first, nodes, sums.areas, n, gap, x, share, weights, alone, lever, sums.across, carried
    )


def _at_contacts(sums: Integrals, vectors: np.ndarray) -> np.ndarray:
    """Vectors (dim, k) at the contacts from those (dim, n) at the nodes of the other side."""
    seen = (sums.other @ vectors.T).T
    for c, more in enumerate(sums.across):
        seen[c] += more @ vectors[c]
    return np.asarray(seen)


def _seen(other: Faces, sums: Integrals) -> np.ndarray:
    """Unit normals (dim, k) of the other side at the contacts."""
    normals = contact_normals(other)[0]
    # nodes that are no vertices of linear cells
    between = np.setdiff1d(np.arange(other.faces.shape[1]), other.cells)
    hats = evaluate(FACES[other.kind][1], other.places[:, between])[0]
    normals[:, other.faces[:, between]] = normals[:, other.faces[:, : other.corners]] @ hats
    n = _at_contacts(sums, normals)
    return np.asarray(n / np.linalg.norm(n, axis=0))


def _contacts(surface: Faces, faces: np.ndarray) -> int:
    """Number of contacts on some faces of a surface."""
    return len(np.unique(surface.faces[np.unique(faces)][:, surface.cells]))


def contact_normals(surface: Faces) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outward unit normals (dim, n) at contact nodes from the linear fits on all cells around them,
    the sizes (n,) of these cells [length], and the integrals (n,) of the hat functions over them,
    with the surface's weight. All are zero at points that are no contact nodes.
    """
    n, count = surface.points.shape[1], len(surface.faces)
    total, area, full = np.zeros(surface.points.shape), np.zeros(n), np.zeros(n)
    reference, hat = FACES[surface.kind][:2]
    at, share = get_quadrature(reference, 4)
    phi = evaluate(hat, at)[0]
    dual = (phi * share).sum(axis=1)[:, None] * np.linalg.solve(phi * share @ phi.T, phi)
    share = share / len(surface.cells)  # of the reference face
    for cell in surface.cells:
        places = np.tile(surface.places[:, cell] @ phi, count)
        face = np.repeat(np.arange(count), at.shape[1])
        x, tangents = surface.locations(face, places)
        normal = cross(tangents) * surface.turn[face]
        split = normal.reshape(len(normal), count, -1)
        length = np.linalg.norm(split, axis=0)
        weight = np.broadcast_to(weight_at(surface.weight, x), len(face))
        weighted = length * weight.reshape(length.shape)
        for v, corner in enumerate(cell):
            node = surface.faces[:, corner]
            area += np.bincount(node, length @ (phi[v] * share), n)
            full += np.bincount(node, weighted @ (phi[v] * share), n)
            for d in range(len(total)):
                total[d] += np.bincount(node, split[d] @ (dual[v] * share), n)
    total = surface.mirrored(total)
    if surface.mirror is not None:
        area *= 2.0 ** surface.mirror.sum(axis=0)  # with the images of the cells
    long = np.linalg.norm(total, axis=0)
    normals = np.divide(total, long, where=area > 0, out=np.zeros_like(total))
    return normals, area ** (1 / (surface.dim - 1)), full


def _centres(surface: Faces) -> np.ndarray:
    """(dim, n) the mean centres of the faces around all points of a surface; zero elsewhere."""
    middle = surface.points[:, surface.faces].mean(axis=2)
    node, j = surface.faces.ravel(), surface.faces.shape[1]
    count = np.maximum(np.bincount(node, minlength=surface.points.shape[1]), 1)
    sums = [np.bincount(node, np.repeat(row, j), len(count)) for row in middle]
    return np.stack(sums) / count


def _alone(
    own: Faces, other: Faces, points: Overlap, nodes: np.ndarray, x: np.ndarray, normals: np.ndarray
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """The own node of every contact, and the other side's shape functions on its normal."""
    k = len(nodes)
    mine = sp.csr_matrix((np.ones(k), (np.arange(k), nodes)), (k, own.points.shape[1]))
    # a point on the faces of the node itself: at a corner others are as near
    inward = NUDGE * (_centres(own)[:, nodes] - x)
    near = KDTree(points.place.T).query((x + inward).T)[1]
    n, axes = normals[:, nodes].T[:, None], points.axes[near]
    axes = axes - np.sum(axes * n, axis=2, keepdims=True) * n
    face = points.face[near]
    there, off = _on_face(other, face, x, axes, points.there[:, near])
    # The face of the nearest point of integration need not be the one that the node sees.
    around = other.around()
    lost = np.flatnonzero(off > 0)
    beside = sp.coo_array(around[face[lost]] @ around.T)
    row, tried = lost[beside.row], beside.col
    middle = np.full(other.dim - 1, 1 / other.corners if other.corners == 3 else 0.5)
    start = np.repeat(middle[:, None], len(row), axis=1)
    places, missed = _on_face(other, tried, x[:, row], axes[row], start)
    order = np.lexsort((-missed, row))  # of each contact the best face comes last, and stays
    order = order[missed[order] < off[row[order]]]
    face[row[order]], there[:, row[order]] = tried[order], places[:, order]
    N = other.shapes(there).T[:, None]
    theirs = collect(N, np.arange(k)[:, None], other.faces[face], (k, other.points.shape[1]))
    return mine, tidy(theirs)


def _on_face(
    surface: Faces, face: np.ndarray, x: np.ndarray, axes: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where faces (m,) see points x (dim, m), moved onto them: reference coordinates (dim - 1, m),
    and how far from the points this is along the axes (m,), 0 where they are on the faces.
    """
    seen = surface.locate(face, x, axes, start)
    there = np.clip(seen, 0.0, 1.0)
    if surface.corners == 3:
        there /= np.maximum(there.sum(axis=0), 1.0)
    missed = x - surface.locations(face, there)[0]
    off = np.linalg.norm(np.einsum("mad,dm->am", axes, missed), axis=0)
    return there, np.where(np.abs(there - seen).max(axis=0) > NEWTON, off, 0.0)
