"""`laplacian`: the square root of the Laplacian of any contact surface, on the mesh of the contacts
itself.

A half-space moves under a traction t by (-Laplace)^-1/2 t. With linear elements on the cells of the
contacts, K the stiffness of the Laplacian with natural (Neumann) conditions at free edges and M the
lumped mass, nodal forces r = M t move the contacts by

    G r = M^-1/2 L^-1/2 M^-1/2 r,   L = M^-1/2 K M^-1/2 + shift,   P = M^1/2 L^1/2 M^1/2.

On a surface in space this is what normal forces do. Tangential ones have two directions: waves
along their own direction meet more resistance than waves across it. There K is the stiffness of the
form  grad u : grad v + ALONG div u div v  for tangential fields u and v, which couples both
components.

At an edge M is what a contact inside would have, and the share of it that is there enters with the
power EDGE, as in `neumann`. The shift keeps constants, which a Neumann Laplacian maps to zero; it
belongs to each connected piece of the surface. Components that cannot move are left out. The
inverse root is a rational function whose error falls exponentially with the number of its poles:
each of them is one sparse factorisation of a matrix of the surface. On a surface of few contacts
the eigenvectors of L take less time than those factors, and so does a product with them.

Source: Hale, Higham, Trefethen (2008), Computing A^alpha, log(A), and related matrix functions by
contour integrals, method 3 for the square root. Johnson (1985), Contact mechanics, section 3.6, for
the compliance of the half-space.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.special import ellipj, ellipk, ellipkm1

from contactopt.errors import InputError
from contactopt.methods.preconditioners.constants import (
    ALONG,
    DISTORTED,
    EDGE,
    EIGENVECTORS,
    PIECE,
    SPLIT,
    THINNEST,
)
from contactopt.problem import InterfaceProblem

Act = Callable[[np.ndarray], np.ndarray]
Root = tuple[Act, Act]  # products with P and with G = P^-1


def laplacian(problem: InterfaceProblem, held: np.ndarray) -> Root:
    """Products with P and G = P^-1, scaled so that the mean of the diagonal of G is one (estimated
    as by Hutchinson, 1989). InputError without cells.
    """
    cells = problem.chart.cells
    if cells is None:
        raise InputError(
            "the preconditioner 'laplacian' needs the cells of the contact surface, which are not"
            " known here."
        )
    points = (
        problem.coordinates if len(problem.coordinates) == problem.dim else problem.chart.places
    )
    K, mass, shift, share = surface_matrices(points, cells)
    # Forces are spread over the nodal areas, which differ from the mass where the surface goes
    # around an axis.
    depth = problem.areas / mass
    depth = np.maximum(depth / depth.mean(), THINNEST)
    normal, tangential = slice(0, 1), slice(1, problem.dim)
    roots = [(normal, 1.0 - SPLIT, K), (tangential, 1.0, K)]
    if problem.dim == 3:
        vector = sp.kron(K, sp.identity(2), format="csr") + ALONG * divergences(
            points, problem.chart.places, cells
        )
        roots[1] = (tangential, 1.0, vector)
    made = []
    for components, factor, matrix in roots:
        moves = ~held[:, components]
        if moves.any():
            values = np.repeat([mass, shift, share, depth], moves.shape[1], axis=1)
            made.append((components, moves, factor, _square_root(matrix, values, moves.ravel())))

    def product(X: np.ndarray, inverse: bool) -> np.ndarray:
        out = np.zeros(X.shape)
        for components, moves, factor, root in made:
            own = np.zeros(moves.shape)
            own[moves] = root[inverse](X[:, components][moves]) * (
                factor if inverse else 1 / factor
            )
            out[:, components] = own
        return out

    signs = np.where(np.random.default_rng(0).random(held.shape) < 0.5, -1.0, 1.0) * ~held
    mean = float(np.sum(signs * product(signs, True))) / max(int((~held).sum()), 1) or 1.0
    return lambda X: mean * product(X, False), lambda X: product(X, True) / mean


def surface_matrices(
    points: np.ndarray, cells: np.ndarray
) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray, np.ndarray]:
    """The Laplacian on the mesh of the contacts, for points (d, k) and the corners (v, c) of lines,
    triangles or quadrilaterals, which stand for the mean of both ways to cut them.

    Returns the stiffness K (k, k), the lumped mass (k,), the shift (k,) of the piece that each
    contact is on, and the share (k,) of a full turn that the cells of a contact span: a half at a
    straight edge. Raises InputError if the cells leave out contacts.
    """
    k = points.shape[1]
    K, mass, share = sp.csr_matrix((k, k)), np.zeros(k), np.zeros(k)
    for corners, part in _cut(cells):
        gradients, measure = _simplices(points, corners)
        for i, own in enumerate(corners):
            np.add.at(mass, own, part * measure / len(corners))
            np.add.at(share, own, part * _angle(points[:, np.roll(corners, -i, axis=0)]))
            for j, other in enumerate(corners):
                entries = part * measure * np.einsum("dc,dc->c", gradients[i], gradients[j])
                K = K + sp.csr_matrix((entries, (own, other)), (k, k))
    if np.any(mass <= 0):
        raise InputError(
            "the cells of the contact surface leave out contacts, so that it has no Laplacian."
        )
    piece = connected_components(K, directed=False)[1]
    lengths = [
        np.linalg.norm(np.ptp(points[:, piece == i], axis=1)) for i in range(piece.max() + 1)
    ]
    # The least eigenvalue of a convex surface is at least (pi / diameter)^2 (Payne, Weinberger
    # 1960).
    return K, mass, PIECE * (np.pi / np.array(lengths)[piece]) ** 2, np.minimum(share, 1.0)


def divergences(points: np.ndarray, places: np.ndarray, cells: np.ndarray) -> sp.csr_matrix:
    """The integral of div u div v for tangential fields u and v, a matrix (2 k, 2 k) with the
    components of a contact in a row.

    The components are along the axes of the chart, in which the contacts have the places (2, k).
    Cells whose area differs by a factor of DISTORTED in the chart, as at its seam, are left out.
    """
    k = places.shape[1]
    total = sp.csr_matrix((2 * k, 2 * k))
    for corners, part in _cut(cells):
        gradients, measure = _simplices(places, corners)
        true = _simplices(points, corners)[1]
        apart = np.abs(np.log(np.maximum(measure, 1e-300) / true))
        measure = part * np.where(apart < np.log(DISTORTED), measure, 0.0)
        for i, a in np.ndindex(len(corners), 2):
            for j, b in np.ndindex(len(corners), 2):
                entries = measure * gradients[i][a] * gradients[j][b]
                at = 2 * corners[i] + a, 2 * corners[j] + b
                total = total + sp.csr_matrix((entries, at), (2 * k, 2 * k))
    return total


def _cut(cells: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Corners of lines or triangles with weights; quadrilaterals are cut both ways, half each."""
    if len(cells) < 4:
        return [(cells, 1.0)]
    return [(cells[list(corners)], 0.5) for corners in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))]


def _angle(x: np.ndarray) -> np.ndarray:
    """Share (c,) of a full turn at the first corner of x (d, v, c); a half for a line."""
    if x.shape[1] == 2:
        return np.full(x.shape[2], 0.5)
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    cosine = np.sum(a * b, axis=0) / (np.linalg.norm(a, axis=0) * np.linalg.norm(b, axis=0))
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)) / (2 * np.pi))


def _simplices(points: np.ndarray, corners: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Gradients (d, c) of each corner's linear function, and lengths or areas (c,)."""
    x = points[:, corners]  # (d, v, c)
    if len(corners) == 2:
        chord = x[:, 1] - x[:, 0]
        square = np.sum(chord**2, axis=0)
        return [-chord / square, chord / square], np.sqrt(square)
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    aa, ab, bb = (np.sum(y * z, axis=0) for y, z in ((a, a), (a, b), (b, b)))
    square = np.maximum(aa * bb - ab**2, 1e-300)
    second, third = (bb * a - ab * b) / square, (aa * b - ab * a) / square
    return [-second - third, second, third], np.sqrt(square) / 2


def _square_root(K: sp.csr_matrix, values: np.ndarray, moves: np.ndarray) -> Root:
    """Products with P and with G on the unknowns of the mask `moves` (n,), for K (n, n).

    values  (4, n) mass, shift, share and depth of the contact of each unknown
    """
    mass, shift, share, depth = values[:, moves]
    full = mass / share
    weight = np.sqrt(full * depth) * share**EDGE
    scale = sp.diags(full**-0.5)
    L = sp.csc_matrix(scale @ K[moves][:, moves] @ scale + sp.diags(shift))
    root = _by_eigenvectors(L) if L.shape[0] <= EIGENVECTORS else _by_poles(L, float(shift.min()))
    return lambda x: weight * (L @ root(weight * x)), lambda x: root(x / weight) / weight


def _by_eigenvectors(L: sp.csc_matrix) -> Callable[[np.ndarray], np.ndarray]:
    """Products with L^-1/2, an array: the fewest operations for each product where L is small."""
    values, vectors = eigh(L.toarray())
    dense = (vectors / np.sqrt(values)) @ vectors.T
    return lambda x: np.asarray(dense @ x)


def _by_poles(L: sp.csc_matrix, low: float) -> Callable[[np.ndarray], np.ndarray]:
    """Products with L^-1/2, a sum of sparse solves, for L with eigenvalues of at least `low`."""
    eye = sp.eye(L.shape[0], format="csc")
    order = dict(permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    high = float(abs(L).sum(axis=1).max())
    poles = [(c, splu(L + s * eye, **order)) for c, s in zip(*inverse_root(low, high))]
    return lambda x: np.asarray(sum(c * factors.solve(x) for c, factors in poles))


def inverse_root(low: float, high: float, accuracy: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    """c (j,) and s (j,) > 0: sum of c / (x + s) is x^-1/2 to this accuracy between the bounds."""
    m = low / high
    inner, outer = float(ellipk(m)), float(ellipkm1(m))  # K(m) and K(1 - m)
    count = int(np.ceil(-np.log(accuracy / 4) * outer / (2 * np.pi * inner)))
    sn, cn, dn, _ = ellipj((np.arange(count) + 0.5) * outer / count, 1 - m)
    return 2 * outer * np.sqrt(low) / (np.pi * count) * dn / cn**2, low * (sn / cn) ** 2
