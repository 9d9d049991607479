"""NGSolve: the stiffness of a block of linear tetrahedra, components one after the other."""

import numpy as np
import scipy.sparse as sp
from host import COUNT, LAM, MU, give
from ngsolve import VOL, BilinearForm, Grad, InnerProduct, Sym, VectorH1, div, dx
from ngsolve.meshes import MakeStructured3DMesh

mesh = MakeStructured3DMesh(
    hexes=False,
    nx=COUNT,
    ny=COUNT,
    nz=COUNT // 2,
    mapping=lambda x, y, z: (2 * x - 1, 2 * y - 1, z - 1),
)
space = VectorH1(mesh, order=1)
u, v = space.TnT()
energy = 2 * MU * InnerProduct(Sym(Grad(u)), Sym(Grad(v))) + LAM * div(u) * div(v)
form = BilinearForm(energy * dx).Assemble()
rows, columns, values = (np.array(part) for part in form.mat.COO())
K = sp.coo_matrix((values, (rows, columns)))
points = np.array([vertex.point for vertex in mesh.vertices])
cells = np.array([[vertex.nr for vertex in cell.vertices] for cell in mesh.Elements(VOL)])
give(K, points, cells, np.arange(points.size).reshape(3, -1).T)
