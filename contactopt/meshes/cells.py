"""Elements of a mesh: their corners and orientation, straight and curved, and their volumes."""

from itertools import combinations

import numpy as np
import skfem
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

SHAPES = {
    "RefTri": (skfem.MeshTri, {1: skfem.ElementTriP1, 2: skfem.ElementTriP2}),
    "RefQuad": (skfem.MeshQuad, {1: skfem.ElementQuad1, 2: skfem.ElementQuad2}),
    "RefTet": (skfem.MeshTet, {1: skfem.ElementTetP1, 2: skfem.ElementTetP2}),
    "RefHex": (skfem.MeshHex, {1: skfem.ElementHex1, 2: skfem.ElementHex2}),
}
CURVED = {
    "RefTri": skfem.MeshTri2, "RefQuad": skfem.MeshQuad2,
    "RefTet": skfem.MeshTet2, "RefHex": skfem.MeshHex2,
}  # fmt: skip
CELLS = {  # what meshio and VTK call the elements, by whether they are of second order
    "RefTri": ("triangle", "triangle6"), "RefQuad": ("quad", "quad9"),
    "RefTet": ("tetra", "tetra10"), "RefHex": ("hexahedron", "hexahedron27"),
}  # fmt: skip
# what scikit-fem finds of the facets and edges of elements when it is asked, and keeps in the mesh
FOUND = ("_facets", "_t2f", "_f2t", "_edges", "_t2e", "_f2e")
# nodes of an element of first or second order numbered the other way round, in the order of meshio
MIRRORED = {
    "triangle": (0, 2, 1, 5, 4, 3),
    "quad": (0, 3, 2, 1, 7, 6, 5, 4, 8),
    "tetra": (0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    "hexahedron": (
        *(4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11),
        *(16, 17, 18, 19, 20, 21, 22, 23, 25, 24, 26),
    ),
}


def is_curved(mesh: skfem.Mesh) -> bool:
    """Say whether a mesh has nodes of its own on edges, which may lie off the straight line."""
    return int(mesh.p.shape[1]) != int(mesh.nvertices)


def knowing(mesh: skfem.Mesh, old: skfem.Mesh) -> skfem.Mesh:
    """A mesh with the elements of an `old` one, and what is known of their facets and edges."""
    if np.array_equal(mesh.t, old.t):
        vars(mesh).update({name: vars(old)[name] for name in FOUND if name in vars(old)})
    return mesh


def straight(mesh: skfem.Mesh) -> skfem.Mesh:
    """Make the mesh of the same vertices and boundaries with straight edges."""
    if not is_curved(mesh):
        return mesh
    corners = np.ascontiguousarray(mesh.p[:, : mesh.nvertices])
    plain = SHAPES[mesh.refdom.__name__][0]
    return knowing(plain(corners, mesh.t, _boundaries=mesh.boundaries), mesh)


def second_order(mesh: skfem.Mesh, places: np.ndarray) -> skfem.Mesh:
    """Make the mesh of second order from the places (dim, n) of all nodes of a quadratic
    displacement, vertices first [length]; the mesh itself if it is curved. Boundaries keep their
    names.
    """
    if is_curved(mesh):
        return mesh
    made = CURVED[mesh.refdom.__name__](np.ascontiguousarray(places), mesh.t)
    return made.with_boundaries(mesh.boundaries) if mesh.boundaries else made


def elements_of(mesh: skfem.Mesh) -> tuple[str, np.ndarray]:
    """List the elements of a mesh of first or second order: their name, a value of CELLS, and their
    nodes (e, v) in the order of VTK, numbered so that volumes are positive.
    """
    nodes = np.array(mesh.dofs.element_dofs)
    names = CELLS[mesh.refdom.__name__]
    if names[0] == "hexahedron":
        from skfem.io.meshio import HEX_MAPPING

        nodes = nodes[HEX_MAPPING[: len(nodes)]]
    # the edges that meet at the first corner span a positive volume
    ends = {"triangle": [1, 2], "quad": [1, 3], "tetra": [1, 2, 3], "hexahedron": [1, 3, 4]}
    sides = mesh.p[:, nodes[ends[names[0]]]] - mesh.p[:, nodes[:1]]
    turned = np.linalg.det(sides.transpose(2, 1, 0)) < 0
    nodes[:, turned] = mirrored(names[0], nodes[:, turned])
    return names[is_curved(mesh)], nodes.T


def mirrored(kind: str, nodes: np.ndarray) -> np.ndarray:
    """The nodes (v, e) of elements of a kind of meshio, numbered the other way round."""
    return nodes[list(MIRRORED[kind.rstrip("0123456789")][: len(nodes)])]


def facet_nodes(mesh: skfem.Mesh, facets: np.ndarray) -> np.ndarray:
    """Number all nodes (n,) on facets (f,), each once, those within edges and faces included."""
    if not is_curved(mesh):
        return np.unique(mesh.facets[:, facets])
    return np.unique(mesh.dofs.get_facet_dofs(facets).flatten())


def volumes(mesh: skfem.Mesh, nodes: np.ndarray | None = None) -> np.ndarray:
    """Signed volumes (e, n + 1) over those of the reference, at n nodes and the centre of cells
    with `nodes` at (dim, n, e), by default those of the mesh.
    """
    nodes = mesh.doflocs[:, mesh.dofs.element_dofs] if nodes is None else nodes
    shape = mesh.elem()
    places = np.asarray(shape.doflocs).T
    places = np.concatenate([places, places.mean(axis=1, keepdims=True)], axis=1)
    slopes = np.stack([shape.lbasis(places, i)[1] for i in range(nodes.shape[1])])
    return np.linalg.det(np.einsum("aie,ibq->eqab", nodes, slopes, optimize=True))


def overlapping(mesh: skfem.Mesh) -> int | None:
    """The number of a triangle or tetrahedron that lies over its neighbour, on the same side of the
    facet between them; None without any, and for elements of other shapes, which fold within
    themselves before that.
    """
    if len(mesh.t) != len(mesh.p) + 1:
        return None
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    corners = mesh.facets[:, inner]
    normals = area_vectors(mesh.p[:, corners])
    sides = []
    for cell in mesh.f2t[:, inner]:
        across = mesh.t[:, cell].sum(axis=0) - corners.sum(axis=0)  # the corner off the facet
        sides.append(np.sum(normals * (mesh.p[:, across] - mesh.p[:, corners[0]]), axis=0))
    over = inner[sides[0] * sides[1] > 0]
    return int(mesh.f2t[0, over[0]]) if len(over) else None


def split_twice(mesh: skfem.Mesh) -> np.ndarray | None:
    """The middle (3,) of a quadrilateral inside a body that tetrahedra split along different
    diagonals, so that they share its corners but no side; None without any.
    """
    if len(mesh.p) != 3 or len(mesh.t) != 4:
        return None
    facets = mesh.facets[:, mesh.boundary_facets()]
    edges = np.sort(facets[[[0, 1, 2], [1, 2, 0]]], axis=0).reshape(2, -1)
    apart = np.concatenate([facets[2], facets[0], facets[1]])  # from each edge
    order = np.lexsort(edges)
    edges, apart = edges[:, order], apart[order]
    same = np.flatnonzero(np.all(edges[:, 1:] == edges[:, :-1], axis=0))
    quads = np.sort(np.concatenate([edges[:, same], [apart[same], apart[same + 1]]]), axis=0)
    known, count = np.unique(quads, axis=1, return_counts=True)
    known = known[:, count > 1]
    if not known.size:
        return None
    sides = set(map(tuple, np.sort(facets, axis=0).T.tolist()))
    cells = set(map(tuple, np.sort(mesh.t, axis=0).T.tolist()))
    for quad in map(tuple, known.T.tolist()):
        if quad not in cells and sides.issuperset(combinations(quad, 3)):
            return np.asarray(mesh.p[:, quad].mean(axis=1))
    return None


def outer_corners(mesh: skfem.Mesh, facets: np.ndarray) -> np.ndarray:
    """Numbers (c, f) of the corners of facets (f,) of the surface, in the order around each that
    makes normals point outwards; in the plane the body is on their left.
    """
    cell = mesh.f2t[0, facets]
    local = np.argmax(mesh.t2f[:, cell] == facets, axis=0)
    nodes = mesh.t[np.array(mesh.refdom.facets)[local].T, cell]
    corners = mesh.p[:, nodes]
    outwards = corners.mean(axis=1) - mesh.p[:, mesh.t[:, cell]].mean(axis=1)
    wrong = np.sum(area_vectors(corners) * outwards, axis=0) < 0
    nodes[:, wrong] = nodes[::-1, wrong]
    return np.asarray(nodes)


def sides_of(cells: np.ndarray) -> np.ndarray:
    """(ends of a side, v, c) nodes of the sides of lines, triangles and quadrilaterals (v, c): each
    corner, or each edge from it on.
    """
    return cells[None] if len(cells) == 2 else np.stack([cells, np.roll(cells, -1, axis=0)])


def rim(cells: np.ndarray) -> np.ndarray:
    """Ends (1 or 2, m), in ascending order, of the sides that one of the cells (v, c) alone has."""
    sides = sides_of(cells)
    sides = np.sort(sides.reshape(len(sides), -1), axis=0)
    known, count = np.unique(sides, axis=1, return_counts=True)
    return np.asarray(known[:, count == 1])


def alone(corners: np.ndarray) -> np.ndarray:
    """Numbers of the rows of `corners` (m, c) that no other row repeats, in whatever order."""
    rows = np.sort(corners, axis=1)
    _, first, count = np.unique(rows, axis=0, return_index=True, return_counts=True)
    return np.sort(first[count == 1])


def facets_at(mesh: skfem.Mesh, corners: np.ndarray) -> np.ndarray:
    """Numbers (m,) of the facets with these corners (c, m), in whatever order; -1 where there is
    none, and where a corner is -1 or a node within an edge. A sum of random numbers, one for each
    node, stands for the corners.
    """
    size = mesh.nvertices
    drawn = np.random.default_rng(0).integers(0, 2**63, size + 1, dtype=np.uint64)
    known = drawn[mesh.facets].sum(axis=0)
    wanted = drawn[np.where(corners < size, corners, -1)].sum(axis=0)
    order = np.argsort(known)
    found = order[np.searchsorted(known, wanted, sorter=order).clip(max=len(order) - 1)]
    return np.where(known[found] == wanted, found, -1)


def in_triangles(nodes: np.ndarray) -> np.ndarray:
    """Corners of lines and triangles as they are, those (4, c) of quadrilaterals cut in two."""
    if len(nodes) < 4:
        return nodes
    return np.concatenate([nodes[[0, 1, 2]], nodes[[0, 2, 3]]], axis=1)


def measures(corners: np.ndarray) -> np.ndarray:
    """Lengths or areas (c,) of lines or triangles with corners (dim, v, c)."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = np.einsum("dac,dbc->cab", edges, edges)
    return np.asarray(np.sqrt(np.linalg.det(gram)) / (corners.shape[1] - 1))


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """Area times normal (dim, f) of facets (dim, c, f) [length^2]; normals are right of edges."""
    if len(corners) == 2:
        x, y = corners[:, 1] - corners[:, 0]
        return np.stack([y, -x])
    first, second = corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1]
    if corners.shape[1] == 3:
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(np.cross(first, second, axis=0) / 2)


def joined(pairs: np.ndarray, count: int) -> np.ndarray:
    """(count,) the number of the piece that each belongs to when pairs (2, m) are joined."""
    graph = coo_matrix((np.ones(pairs.shape[1]), tuple(pairs)), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1])
