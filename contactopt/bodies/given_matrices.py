"""The matrices of a body that another code has assembled, its solver if it gave one, its file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import Surface
from contactopt.bodies.assembly import Matrices
from contactopt.bodies.fields import von_mises
from contactopt.bodies.solvers.system import BodySolver, System
from contactopt.errors import InputError

# (dimension, points of a facet) -> what VTK calls it
CELLS = {
    (2, 2): "line", (2, 3): "line3", (3, 3): "triangle", (3, 4): "quad", (3, 6): "triangle6",
    (3, 8): "quad8", (3, 9): "quad9",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class GivenMatrices(Matrices):
    """The matrices of a MatrixPart.

    surfaces  name of each contact surface -> the surface
    moving    (dim N, n) D: the displacements of the points in the caller's numbering
    solves    function that solves K U = F, if K itself is not known
    facets    name of each surface -> (m, j) points of its facets, as they are given
    stresses  displacements of the points (dim, N) -> their stresses (N, 4 or 6), or None
    names     of the components of these stresses
    """

    unknowns: np.ndarray
    locations: np.ndarray
    surfaces: Mapping[str, Surface]
    moving: sp.csr_matrix
    solves: Callable[[np.ndarray], np.ndarray] | None
    facets: Mapping[str, np.ndarray]
    stresses: Callable[[np.ndarray], np.ndarray | None]
    names: tuple[str, ...]

    @property
    def contact_dofs(self) -> np.ndarray:
        traces = [trace for own in self.surfaces.values() for trace in own.traces]
        return np.unique(np.concatenate([trace.indices for trace in traces]))

    def at_points(self, U: np.ndarray) -> np.ndarray:
        """(dim, N) displacements of the points, from those of the unknowns (n,)."""
        return np.asarray((self.moving @ U)[self.unknowns])

    def write_vtu(self, path: Path, U: np.ndarray, force: np.ndarray) -> None:
        """Write points and facets with displacement, forces and known stresses."""
        import meshio

        data = {"displacement": self.at_points(U), "force": force[self.unknowns]}
        if self.solves is None:
            missing = self.A @ U - self.load - force
            missing[self.free] = 0.0
            data["reaction"] = missing[self.unknowns]
        lack = 3 - len(self.locations)
        cells = [
            (CELLS[len(self.locations), facets.shape[1]], facets) for facets in self.facets.values()
        ]
        vectors = {name: np.pad(each, ((0, lack), (0, 0))).T for name, each in data.items()}
        if (stress := self.stresses(data["displacement"])) is not None:
            vectors["von_mises"] = von_mises(stress)
            vectors |= {f"stress_{name}": own for name, own in zip(self.names, stress.T)}
        points = np.pad(self.locations.T, ((0, 0), (0, lack)))
        meshio.Mesh(points, cells, vectors).write(path, file_format="vtu")

    def solver(self, system: System) -> BodySolver | None:
        return None if self.solves is None else _GivenSolver(system, self)


class _GivenSolver(BodySolver):
    """The caller's own solver."""

    name = "given"

    def __init__(self, system: System, body: GivenMatrices):
        super().__init__(system)
        self._body = body

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        body, made = self._body, []
        assert body.solves is not None
        full = np.zeros((load.size // max(len(load), 1), len(body.load)))
        full[:, body.free] = load.reshape(len(load), -1).T
        for own in full:
            made.append(np.asarray(body.solves(own)).ravel())
            if made[-1].shape != own.shape or not np.isfinite(made[-1]).all():
                raise InputError(
                    f"body '{body.name}': its function gave an array of shape {made[-1].shape}, or"
                    f" numbers that are not finite, for forces of shape {own.shape}."
                )
        return np.stack(made, axis=1)[body.free].reshape(load.shape)
