"""Elastic stiffness of a mesh of displacement elements."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt.bodies.elements import weight_at
from contactopt.material import Material, lame


def stiffness(basis: skfem.CellBasis, material: Material, weight: tuple[float, bool]) -> sp.csr_matrix:
    """Elastic stiffness: the integral of sigma(u) : epsilon(v), with the hoop strain u_r / r if axisymmetric.

    With g_ia the derivative of shape function i along a, component a of node i and component b of node j meet in
    lambda g_ia g_jb + G g_ib g_ja + G (g_i . g_j) delta_ab: one batched matrix product for all elements.
    """
    lam, shear = lame(material)
    dim = basis.mesh.p.shape[0]
    fields = [basis.basis[i][0] for i in range(0, basis.Nbfun, dim)]  # component 0 of every shape function
    g = np.stack([np.asarray(f.grad[0]) for f in fields])  # (i, a, element, point)
    measure = basis.dx * weight_at(weight, np.asarray(basis.global_coordinates()))
    g = np.ascontiguousarray(np.moveaxis(g, (2, 0, 1, 3), (0, 1, 2, 3)))  # (element, i, a, point)
    divergence = g
    if weight[1]:
        hoop = np.stack([np.asarray(f)[0] for f in fields], axis=1) / np.asarray(basis.global_coordinates())[0][:, None]
        divergence = g.copy()
        divergence[:, :, 0] += hoop
    K = lam * _pairs(divergence, measure)
    H = _pairs(g, measure)
    K += shear * H.transpose(0, 1, 4, 3, 2)
    gradients = np.einsum("eiaja->eij", H)
    for a in range(dim):
        K[:, :, a, :, a] += shear * gradients
    if weight[1]:
        K[:, :, 0, :, 0] += 2 * shear * _pairs(hoop[:, :, None], measure)[:, :, 0, :, 0]
    dofs = basis.element_dofs.T  # (element, i a)
    n = dofs.shape[1]
    rows, columns = np.repeat(dofs, n, axis=1).ravel(), np.tile(dofs, n).ravel()
    return sp.csr_matrix((K.ravel(), (rows, columns)), (basis.N, basis.N))


def _pairs(f: np.ndarray, measure: np.ndarray) -> np.ndarray:
    """Integrals of f_ia f_jb: f (element, i, a, point), measure (element, point) -> (element, i, a, j, b)."""
    flat = f.reshape(len(f), -1, f.shape[3])
    return np.asarray((flat * measure[:, None]) @ flat.transpose(0, 2, 1)).reshape(*f.shape[:3], *f.shape[1:3])
