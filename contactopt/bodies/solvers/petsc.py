"""Conjugate gradients with the algebraic multigrid of PETSc (petsc4py, extra `petsc`), told the
rigid motions of the body.

The preconditioner is GAMG, smoothed aggregation, unless PETSc's own options say otherwise: all of
them are taken with the prefix `contactopt_`, for instance PETSC_OPTIONS="-contactopt_pc_type
hypre".

Sources: Balay et al., PETSc/TAO Users Manual; Adams, Bayraktar, Keaveny, Papadopoulos (2004),
Ultrascalable implicit finite element analyses in solid mechanics with over a half a billion degrees
of freedom, for multigrid of this kind.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from contactopt.bodies.solvers.constants import MOST_ITERATIONS, RTOL
from contactopt.bodies.solvers.multigrid import nodal_blocks, rigid_motions
from contactopt.bodies.solvers.system import BodySolver, Iteration, System
from contactopt.checks import check_number
from contactopt.errors import BackendError, InputError

ALONE = threading.RLock()  # PETSc does not allow calls from two threads at the same time


class PetscSolver(BodySolver):
    """A body on one process of PETSc.

    A solve ends where (r' B r)^1/2, B the preconditioner, has fallen by `rtol`.

    A, ksp  PETSc's matrix and its solver. Both have the unknowns of all nodes, nodes one after the
            other; held unknowns have rows of their own that nothing else touches
    place   (n,) of each unknown among them
    """

    name = "petsc"
    iterative = True

    def __init__(self, system: System):
        super().__init__(system)
        petsc, dim = _library(), len(system.points)
        blocks, self.place, present = nodal_blocks(system.A, system.node, system.component, dim)
        modes = rigid_motions(system.points[:, present])
        modes[np.setdiff1d(np.arange(len(modes)), self.place)] = 0.0
        A, self.size = blocks.tocsr(), len(modes)
        with ALONE:
            here, indices = petsc.COMM_SELF, petsc.IntType
            rows = A.indptr.astype(indices), A.indices.astype(indices), A.data
            self.A = petsc.Mat().createAIJ(A.shape, bsize=dim, csr=rows, comm=here)
            vectors = [
                petsc.Vec().createWithArray(column.copy(), bsize=dim, comm=here)
                for column in np.linalg.qr(modes)[0].T
            ]
            self.A.setNearNullSpace(petsc.NullSpace().create(vectors=vectors, comm=here))
            self.A.setOption(petsc.Mat.Option.SPD, True)
            self.ksp = petsc.KSP().create(here)
            self.ksp.setOperators(self.A)
            self.ksp.setType("cg")
            self.ksp.setNormType(petsc.KSP.NormType.NATURAL)
            self.ksp.getPC().setType("gamg")
            self.ksp.setOptionsPrefix("contactopt_")
            self.ksp.setFromOptions()
            self.ksp.setUp()

    @property
    def iteration(self) -> Iteration:
        return Iteration(self._acting(self.A.mult), self._acting(self.ksp.getPC().apply))

    def solve(self, load: np.ndarray, rtol: float | None = None) -> np.ndarray:
        rtol = RTOL if rtol is None else rtol
        check_number("rtol", rtol, low=0.0, high=1.0)
        out = np.zeros(load.shape)
        for b, x in zip(load.reshape(self.n, -1).T, out.reshape(self.n, -1).T):
            x[:] = self._solution(b, rtol)
        return out

    def _solution(self, b: np.ndarray, rtol: float) -> np.ndarray:
        if not b.any():
            return np.zeros(self.n)
        with ALONE:
            self.ksp.setTolerances(rtol=rtol, atol=0.0, max_it=MOST_ITERATIONS)
            x = self._acting(self.ksp.solve)(b)
            if self.ksp.getConvergedReason() < 0:
                raise BackendError(
                    f"petsc: the error was not reduced by {rtol:g} within {MOST_ITERATIONS}"
                    " iterations."
                )
            return x

    def _acting(self, act: Any) -> Any:
        """PETSc's function of two vectors, as one of an array (n,) that returns an array (n,)."""
        petsc = _library()

        def acting(x: np.ndarray) -> np.ndarray:
            full, out = np.zeros(self.size), np.zeros(self.size)
            full[self.place] = x
            with ALONE:
                vectors = [
                    petsc.Vec().createWithArray(values, comm=petsc.COMM_SELF)
                    for values in (full, out)
                ]
                act(*vectors)
                for vector in vectors:
                    vector.destroy()
            return np.asarray(out[self.place])

        return acting


def _library() -> Any:
    try:
        from petsc4py import PETSc
    except ImportError as error:
        raise InputError(
            "the body solver 'petsc' needs petsc4py: pip install 'contactopt[petsc]', which"
            " compiles PETSc, or your system's package."
        ) from error
    return PETSc
