"""What is read inside a body: where, and what displacement and stress are found there."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from skfem import Mesh

PLACES = {2: ((0, 0), (1, 1), (2, 2), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))}


@dataclass(frozen=True, eq=False)
class Fields:
    """One body after the solve, at the n nodes of its mesh, of which the vertices come first.

    mesh          of scikit-fem, with the places of all nodes in `mesh.p`: of second order where the
                  displacement is quadratic, with nodes in the middle of edges, quadrilaterals and
                  hexahedra
    names         of the components of the stress;   displacement  (dim, n) [length]
    stress        (n, 4 or 6) [stress];   von_mises  (n,)
    contact       name -> (n,) or (n, 3) contact quantities at the nodes, if they were asked for
    """

    name: str
    mesh: Mesh
    names: tuple[str, ...]
    displacement: np.ndarray
    stress: np.ndarray
    von_mises: np.ndarray
    contact: Mapping[str, np.ndarray] = field(default_factory=dict)

    def write_vtu(self, path: Path) -> None:
        """Write the body as a VTU file with displacement, stress, von Mises stress and contact
        quantities at the nodes.

        Cells of second order are VTK's quadratic triangles and tetrahedra, biquadratic
        quadrilaterals and triquadratic hexahedra (22, 24, 28 and 29).
        """
        import meshio

        from contactopt.meshes.cells import elements_of

        flat = {f"stress_{name}": column for name, column in zip(self.names, self.stress.T)}
        vectors = np.pad(self.displacement, ((0, 3 - len(self.displacement)), (0, 0))).T
        data = {"displacement": vectors, "von_mises": self.von_mises, **flat, **self.contact}
        points = np.pad(self.mesh.p.T, ((0, 0), (0, 3 - len(self.mesh.p))))
        meshio.Mesh(points, [elements_of(self.mesh)], data).write(path, file_format="vtu")


@dataclass(frozen=True)
class Region:
    """Where in a body: on a named boundary, at a point, in the circle or ball around a point, or
    everywhere.

    boundary  its name;   point  coordinates [length];   radius  around the point [length]
    """

    boundary: str = ""
    point: tuple[float, ...] = ()
    radius: float | None = None


class Validity(NamedTuple):
    """What small displacements and the equations of a body are worth at a displacement.

    imbalance  sum of the nodal forces that nothing balances, relative to that of all forces on the
               body
    strain     largest principal strain, and rotation  largest rotation [rad], in the middle of an
               element
    moved      largest displacement [length]
    mean_strain  root mean square of the largest principal strains over the body
    """

    imbalance: float = 0.0
    strain: float = 0.0
    rotation: float = 0.0
    moved: float = 0.0
    mean_strain: float = 0.0


def von_mises(stress: np.ndarray) -> np.ndarray:
    """The von Mises stress (m,) of stresses (m, 4 or 6), normal components first."""
    normal, shear = stress[:, :3], stress[:, 3:]
    deviator = normal - normal.mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(1.5 * np.sum(deviator**2, axis=1) + 3 * np.sum(shear**2, axis=1)))


def von_mises_slopes(stress: np.ndarray) -> np.ndarray:
    """The derivatives of the von Mises stress by these components; 0 where there is no stress."""
    normal, size = stress[:, :3], von_mises(stress)[:, None]
    slopes = np.concatenate(
        [1.5 * (normal - normal.mean(axis=1, keepdims=True)), 3 * stress[:, 3:]], axis=1
    )
    return np.divide(slopes, size, out=np.zeros(slopes.shape), where=size > 0)
