"""Where the mirror image of a body goes on beyond its surface: on planes of symmetry, which are
held along their normal alone. No shear acts there, and a recovered stress may look from both sides:
its shear across the plane is zero, and not what the elements on the one side show.
"""

from __future__ import annotations

import numpy as np
import skfem

from contactopt.bodies.elements import face_nodes, node_unknowns
from contactopt.scenes.scene import Part, Scene, Traction

FLAT = 1e-9  # of the size of the body: how far the nodes of a plane lie from it


def mirrored_nodes(
    scene: Scene, part: Part, basis: skfem.CellBasis, held: np.ndarray
) -> np.ndarray:
    """(dim, nodes) whether a node lies in a plane across that axis on which nothing else than the
    displacement along it is held (n,), and no traction acts; none where the scene has no copies.
    """
    mesh, unknowns = basis.mesh, node_unknowns(basis)
    names = list(scene.surfaces_of(part))
    names += [
        load.boundary
        for load in part.loads
        if isinstance(load, Traction) and np.count_nonzero(load.value)
    ]
    loaded = [np.asarray(mesh.boundaries[name]) for name in names]
    facets = np.setdiff1d(mesh.boundary_facets(), np.concatenate([np.zeros(0, dtype=int), *loaded]))
    made, fixed = np.zeros(unknowns.shape, dtype=bool), held[unknowns]
    facets = facets[np.any(np.all(fixed[:, mesh.facets[:, facets]], axis=1), axis=0)]
    if scene.copies == 1 or not len(facets):
        return made
    nodes = face_nodes(basis, scene.degree, facets)[0].T  # (nodes of a facet, facets)
    places, fixed = basis.doflocs[:, unknowns[0]][:, nodes], fixed[:, nodes]
    size = float(np.ptp(mesh.p, axis=1).max())
    for axis in range(len(unknowns)):
        others = np.delete(fixed, axis, axis=0)
        plane = np.all(fixed[axis], axis=0) & (np.ptp(places[axis], axis=0) < FLAT * size)
        made[axis, np.unique(nodes[:, plane & ~np.any(np.all(others, axis=1), axis=0)])] = True
    return made
