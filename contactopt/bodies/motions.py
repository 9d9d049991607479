"""Rigid motions that no support and no plate holds, and the forces that meet a resultant without
making the body move.

The stiffness A of a body that floats is singular: A Z = 0 for its free rigid motions Z (n, m). With
m fixing unknowns left out, G = A^-1 (zero on the fixing unknowns) gives the displacement under
forces in balance. Let S (n, m) be forces with Z' S = I. The compliance of the floating body is

    C = (I - Z S') G (I - S Z') = G - Z Y' - Y Z',      Y = G S - Z (S' G S) / 2,

which is symmetric, positive semidefinite and does not depend on the fixing unknowns: a resultant Z'
F is met by the forces -S (Z' F), and displacements have no part S' U along the motions. Under
balanced forces both do nothing. Here S is proportional to the inertia forces of the motions, S = M
Z (Z' M Z)^-1 with the mass matrix M of unit density, so that C converges with the mesh (a point
force would not) and the multiplier of a motion is the mean displacement of the body (inertia
relief).

Source: Farhat, Roux (1991), A method of finite element tearing and interconnecting and its parallel
solution algorithm, Int. J. Numer. Meth. Engng 32, 1205-1227, for floating bodies whose motions are
multipliers of the interface.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import skfem

from contactopt.bodies.elements import Weight, interpolated, nodal_forces, node_unknowns
from contactopt.defaults import EQUAL, ROUNDED
from contactopt.errors import InputError
from contactopt.scenes.kinds import Kind

BALANCED = 1e-13  # share of the work of all forces below which their sum is rounding


@dataclass(frozen=True, eq=False)
class Motions:
    """Free rigid motions of a body, m of them.

    fields  (n, m) displacements Z, zero at unknowns that are held; the largest displacement of a
            node is about one, so that multipliers are displacements [length]
    names   what each of them is, for messages
    fixing  (m,) unknowns that hold the body where its stiffness has to be solvable
    forces  (n, m) nodal forces S of unit resultants, Z' S = I
    """

    fields: np.ndarray
    names: tuple[str, ...]
    fixing: np.ndarray
    forces: np.ndarray


def work(fields: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """The resultants (m,) of nodal forces (n,) in motions (n, m), rounding made zero: that of sums,
    and that of the normals which turn a pressure into forces.
    """
    found, size = fields.T @ forces, np.abs(fields).max(axis=0, initial=0.0) * np.abs(forces).sum()
    return np.where(np.abs(found) > BALANCED * size, found, 0.0)


def rigid_fields(x: np.ndarray) -> np.ndarray:
    """Rigid motions (dim, k, m) of points: unit translations, then rotations about the middle."""
    dim = len(x)
    made = np.zeros((*x.shape, dim * (dim + 1) // 2))
    made[range(dim), :, range(dim)] = 1.0
    centred = x - x.mean(axis=1, keepdims=True)
    centred /= np.linalg.norm(centred, axis=0).max(initial=0.0) or 1.0
    for mode, (i, j) in enumerate(_planes(dim), dim):
        made[i, :, mode], made[j, :, mode] = centred[j], -centred[i]
    return made


def _planes(dim: int) -> list[tuple[int, int]]:
    """The axes of the planes in which a body can turn."""
    return [(i, j) for i in range(dim) for j in range(i)]


def free_motions(kind: Kind, basis: skfem.CellBasis, held: np.ndarray, weight: Weight) -> Motions:
    """The rigid motions that leave held unknowns (n,) at rest, with inertia by `weight`."""
    R, labels = whole_motions(kind, basis)
    combined, names = kernel(R[held], labels)
    Z = R @ combined
    Z[held] = 0.0
    if not len(names):
        return Motions(Z, (), np.zeros(0, dtype=int), Z.copy())
    free = np.flatnonzero(~held)
    fixing = free[la.qr(Z[free].T, pivoting=True, mode="r")[1][: len(names)]]
    forces = [nodal_forces(basis, interpolated(basis, z), weight) for z in Z.T]  # of inertia
    inertia = np.stack(forces, axis=1)
    inertia[held] = 0.0
    return Motions(Z, names, np.sort(fixing), inertia @ np.linalg.inv(Z.T @ inertia))


def whole_motions(kind: Kind, basis: skfem.CellBasis) -> tuple[np.ndarray, tuple[str, ...]]:
    """All rigid motions of a body (n, m) as if nothing held it, and what each of them is."""
    unknowns, components = node_unknowns(basis), kind.components
    x = basis.doflocs[:, unknowns[0]]
    labels = motion_labels(components)
    R = np.zeros((basis.N, len(labels)))
    R[unknowns] = rigid_fields(x)
    one = slice(1, 2) if kind.revolved else slice(None)
    return R[:, one], labels[one]


def motion_labels(components: tuple[str, ...]) -> tuple[str, ...]:
    """What each of the motions of `rigid_fields` is."""
    planes = [(components[j], components[i]) for i, j in _planes(len(components))]
    turns = (f"rotation in the {first}-{second} plane" for first, second in planes)
    return (*(f"translation along {component}" for component in components), *turns)


def kernel(held: np.ndarray, labels: tuple[str, ...]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Combinations (m, j) of motions that leave held unknowns at rest, pure ones first; names."""
    count = len(labels)
    values, vectors = np.linalg.eigh(held.T @ held)
    kernel = vectors[:, values < ROUNDED * len(held)] if len(held) else np.eye(count)
    pure = np.flatnonzero(np.abs(1 - np.sum(kernel**2, axis=1)) < EQUAL)
    columns = [np.eye(count)[:, i] for i in pure]
    rest = kernel - np.eye(count)[:, pure] @ kernel[pure]
    u, sizes, _ = np.linalg.svd(rest, full_matrices=False)
    columns += [column / column[np.argmax(np.abs(column))] for column in u[:, sizes > 0.5].T]
    made = np.stack(columns, axis=1) if columns else np.zeros((count, 0))
    return made, tuple(_name(column, labels) for column in made.T)


def _name(column: np.ndarray, labels: tuple[str, ...]) -> str:
    """That of its rotation, if a combination has one, otherwise of its largest translation."""
    turning = np.array([label.startswith("rotation") for label in labels])
    size = np.abs(column)
    size = size * np.where(turning, 1e3, 1.0) * (size > 1e-3 * size.max())
    return labels[int(np.argmax(size))]


def check_free(name: str, A: sp.csr_matrix, motions: Motions) -> None:
    """Refuse a stiffness (n, n) that resists its free motions, by rounding of coordinates."""
    if not len(motions.names):
        return
    error = np.abs(A @ motions.fields).max(axis=0) / (
        np.abs(A.diagonal()).max() * np.abs(motions.fields).max(axis=0)
    )
    if error.max() > EQUAL:
        raise InputError(
            f"body '{name}': its stiffness resists the rigid motion"
            f" '{motions.names[int(np.argmax(error))]}'; move the mesh nearer to the origin."
        )
