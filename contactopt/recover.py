"""From reactions back to the bodies: displacement and stress fields (paper, eq (13))."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.body import Body, lame
from contactopt.problem import Solution
from contactopt.reduction import ReducedBody, Reduction

STRESSES = {
    "plane-strain": ("xx", "yy", "zz", "xy"),
    "axisymmetric": ("rr", "zz", "tt", "rz"),
    "solid": ("xx", "yy", "zz", "xy", "yz", "xz"),
}
PLACES = {2: ((0, 0), (1, 1), (2, 2), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))}


@dataclass(frozen=True, eq=False)
class Fields:
    """One body after the solve, at its n mesh nodes.

    displacement (dim, n) [length];  stress (n, 4 or 6) [stress], components named in `names`;  von_mises (n,)
    """

    name: str
    mesh: Any
    names: tuple[str, ...]
    displacement: np.ndarray
    stress: np.ndarray
    von_mises: np.ndarray

    def write_vtu(self, path: Path) -> None:
        """The body as a VTU file with displacement, stress components and von Mises stress at the nodes."""
        from skfem.io.meshio import to_meshio

        flat = {f"stress_{name}": column for name, column in zip(self.names, self.stress.T)}
        vectors = np.pad(self.displacement, ((0, 3 - len(self.displacement)), (0, 0))).T
        data = {"displacement": vectors, "von_mises": self.von_mises, **flat}
        mesh = to_meshio(self.mesh, point_data=data, encode_cell_data=False, encode_point_data=False)
        mesh.points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.points.shape[1])))
        mesh.write(path, file_format="vtu")


def recover(reduction: Reduction, solution: Solution) -> tuple[Fields, ...]:
    """Displacement and stress of the elastic bodies of a solved scene, upper body first."""
    out, start = [], 0
    for body, nodes, sign, plates in zip(reduction.bodies, reduction.nodes, (1.0, -1.0), reduction.plates):
        multipliers = solution.multipliers[start : start + plates]
        start += plates
        if body is not None:
            out.append(body_fields(reduction, body, nodes, sign * solution.reactions, multipliers))
    return tuple(out)


def body_fields(
    reduction: Reduction, body: ReducedBody, nodes: np.ndarray, reactions: np.ndarray, multipliers: np.ndarray
) -> Fields:
    """Fields of one body under contact forces (k, dim) on it, in the local frames, and plate displacements (p,)."""
    basis = body.body.basis
    force = np.zeros(basis.N)
    force[basis.nodal_dofs[:, nodes].T] = np.einsum("ka,kac->kc", reactions, reduction.frames)
    force[~np.isin(np.arange(basis.N), body.body.free)] = 0.0
    U = body.displacement(force, multipliers)
    stress = nodal_stress(body.body, U)
    dim = basis.mesh.p.shape[0]
    full = np.stack([stress[i, j] for i, j in PLACES[dim]], axis=1)
    mean = np.trace(stress) / 3
    deviator = stress - mean * np.eye(3)[:, :, None]
    von_mises = np.sqrt(1.5 * np.sum(deviator**2, axis=(0, 1)))
    names = STRESSES[reduction.scene.kind]
    return Fields(body.body.name, basis.mesh, names, U[basis.nodal_dofs], full, von_mises)


def nodal_stress(body: Body, U: np.ndarray) -> np.ndarray:
    """Stress tensor (3, 3, n) at the mesh nodes: element means, averaged with the elements' volumes.

    Axes are x, y, z or, in an axisymmetric scene, r, z, theta.
    """
    basis, mesh = body.basis, body.basis.mesh
    lam, shear = lame(body.material)
    field = basis.interpolate(U)
    gradient = np.asarray(field.grad)
    dim = len(gradient)
    strain = np.zeros((3, 3, *gradient.shape[2:]))
    strain[:dim, :dim] = (gradient + gradient.swapaxes(0, 1)) / 2
    if body.weight[1]:
        strain[2, 2] = np.asarray(field)[0] / np.asarray(basis.global_coordinates())[0]
    stress = 2 * shear * strain + lam * np.trace(strain) * np.eye(3)[:, :, None, None]
    volume = basis.dx.sum(axis=1)
    element = np.sum(stress * basis.dx, axis=3)  # integral over each element
    corners = mesh.t
    total = np.zeros((3, 3, mesh.p.shape[1]))
    weight = np.bincount(corners.ravel(), np.tile(volume, len(corners)), mesh.p.shape[1])
    for i in range(3):
        for j in range(3):
            total[i, j] = np.bincount(corners.ravel(), np.tile(element[i, j], len(corners)), mesh.p.shape[1])
    return total / weight
