"""MFEM (PyMFEM): the stiffness of a block of linear tetrahedra, components one after the other."""

import mfem.ser as mfem
import numpy as np
import scipy.sparse as sp
from host import COUNT, LAM, MU, give

shape = COUNT, COUNT, COUNT // 2, mfem.Element.TETRAHEDRON, 2.0, 2.0, 1.0
mesh = mfem.Mesh.MakeCartesian3D(*shape)
elements = mfem.H1_FECollection(1, 3)
space = mfem.FiniteElementSpace(mesh, elements, 3)
form, constants = mfem.BilinearForm(space), [mfem.ConstantCoefficient(c) for c in (LAM, MU)]
form.AddDomainIntegrator(mfem.ElasticityIntegrator(*constants))
form.Assemble()
form.Finalize()
A = form.SpMat()
K = sp.csr_matrix((A.GetDataArray(), A.GetJArray(), A.GetIArray()))
points = np.array([mesh.GetVertexArray(i) for i in range(mesh.GetNV())]) - 1.0
cells = np.array([mesh.GetElementVertices(i) for i in range(mesh.GetNE())])
points[:, 2] = np.round(points[:, 2], 12)
give(K, points, cells, np.arange(points.size).reshape(3, -1).T)
