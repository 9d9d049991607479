"""scikit-fem: the stiffness of a block of linear tetrahedra."""

import numpy as np
import skfem
from host import COUNT, LAM, MU, give
from skfem.models.elasticity import linear_elasticity

x, z = np.linspace(-1, 1, COUNT + 1), np.linspace(-1, 0, COUNT // 2 + 1)
mesh = skfem.MeshTet.init_tensor(x, x, z)
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))
K = linear_elasticity(LAM, MU).assemble(basis)
give(K, mesh.p.T, mesh.t.T, basis.nodal_dofs.T)
