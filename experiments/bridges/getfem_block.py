"""GetFEM: the stiffness of a block of linear tetrahedra."""

import getfem as gf
import numpy as np
import scipy.sparse as sp
from host import COUNT, LAM, MU, give

x, z = np.linspace(-1, 1, COUNT + 1), np.linspace(-1, 0, COUNT // 2 + 1)
mesh = gf.Mesh("regular simplices", x, x, z)
space = gf.MeshFem(mesh, 3)
space.set_fem(gf.Fem("FEM_PK(3,1)"))
model = gf.Model("real")
model.add_fem_variable("u", space)
for name, value in (("lam", LAM), ("mu", MU)):
    model.add_initialized_data(name, value)
rule = gf.MeshIm(mesh, gf.Integ("IM_TETRAHEDRON(2)"))
model.add_isotropic_linearized_elasticity_brick(rule, "u", "lam", "mu")
model.assembly()
A = model.tangent_matrix()
columns, rows = A.csc_ind()
K = sp.csc_matrix((A.csc_val(), rows, columns))
points = np.round(space.basic_dof_nodes()[:, ::3].T, 12)
cells = np.array([space.basic_dof_from_cvid(i)[0][::3] // 3 for i in mesh.cvid()])
give(K, points, cells, np.arange(points.size).reshape(-1, 3))
