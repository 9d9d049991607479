"""Kratos: the stiffness of a block from the elements of its StructuralMechanicsApplication."""

import KratosMultiphysics as Kratos
import numpy as np
import scipy.sparse as sp
from host import COUNT, NU, E, give
from KratosMultiphysics.StructuralMechanicsApplication import LinearElastic3DLaw

steps = np.array([1, COUNT + 1, (COUNT + 1) ** 2])  # to the next point along x, y and z
points = np.mgrid[-1 : 0 : (COUNT // 2 + 1) * 1j, -1 : 1 : steps[1] * 1j, -1 : 1 : steps[1] * 1j]
points = points.reshape(3, -1)[::-1].T
first = np.flatnonzero((points < [1, 1, 0]).all(axis=1))[:, None]
ways = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (1, 0, 2), (2, 1, 0)]
cells = np.concatenate([first + np.cumsum([0, *steps[list(way)]]) for way in ways])
cells[3 * len(first) :, 1:3] = cells[3 * len(first) :, 2:0:-1]  # positive volumes
part = Kratos.Model().CreateModelPart("block")
part.AddNodalSolutionStepVariable(Kratos.DISPLACEMENT)
steel = part.CreateNewProperties(1)
steel[Kratos.YOUNG_MODULUS], steel[Kratos.POISSON_RATIO], steel[Kratos.DENSITY] = E, NU, 1.0
steel[Kratos.CONSTITUTIVE_LAW] = LinearElastic3DLaw()
for number, place in enumerate(points.tolist(), 1):
    part.CreateNewNode(number, *place)
values, A, b = [], Kratos.Matrix(), Kratos.Vector()
for number, cell in enumerate((1 + cells).tolist(), 1):
    element = part.CreateNewElement("SmallDisplacementElement3D4N", number, cell, steel)
    element.Initialize(part.ProcessInfo)
    element.CalculateLocalSystem(A, b, part.ProcessInfo)
    values.append(np.array(A).ravel())
own = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 12)
places = np.repeat(own, 12, axis=1).ravel(), np.tile(own, 12).ravel()
K = sp.coo_matrix((np.concatenate(values), places))
give(K, points, cells, np.arange(points.size).reshape(-1, 3))
