"""FEniCSx: the stiffness of a block of linear tetrahedra, in the order of dolfinx's unknowns."""

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem, mesh
from host import COUNT, LAM, MU, give
from mpi4py import MPI

ends, count = [[-1.0, -1.0, -1.0], [1.0, 1.0, 0.0]], [COUNT, COUNT, COUNT // 2]
block = mesh.create_box(MPI.COMM_SELF, ends, count, mesh.CellType.tetrahedron)
# Release 0.8 gave `VectorFunctionSpace` up: there, `fem.functionspace(block, ("P", 1, (3,)))`.
space = fem.VectorFunctionSpace(block, ("P", 1))
u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
strain = ufl.sym(ufl.grad(u))
stress = LAM * ufl.tr(strain) * ufl.Identity(3) + 2 * MU * strain
form = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx)
A = fem.petsc.assemble_matrix(form)
A.assemble()
K = sp.csr_matrix(A.getValuesCSR()[::-1])
points = space.tabulate_dof_coordinates()
cells = space.dofmap.list.array.reshape(-1, 4)
give(K, points, cells, np.arange(points.size).reshape(-1, 3))
