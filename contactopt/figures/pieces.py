"""Finite elements as what can be drawn: flat pieces and straight lines between nodes, for elements
of first and second order.

Elements are named, and their nodes numbered, as in meshio and VTU files. A face of second order is
drawn as pieces between all of its nodes, and its edges as lines through the nodes in their middles.
"""

import numpy as np

from contactopt.meshes.cells import alone, mirrored

# nodes of the faces of a solid element, each face numbered as a plane element, seen from outside
FACES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "tetra10": ((0, 2, 1, 6, 5, 4), (0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (0, 3, 2, 7, 9, 6)),
    "hexahedron": (
        (0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7),
    ),
    "hexahedron27": (
        (0, 3, 2, 1, 11, 10, 9, 8, 24), (4, 5, 6, 7, 12, 13, 14, 15, 25),
        (0, 1, 5, 4, 8, 17, 12, 16, 22), (1, 2, 6, 5, 9, 18, 13, 17, 21),
        (2, 3, 7, 6, 10, 19, 14, 18, 23), (3, 0, 4, 7, 11, 16, 15, 19, 20),
    ),
}  # fmt: skip
PLANE = {"tetra": "triangle", "tetra10": "triangle6", "hexahedron": "quad", "hexahedron27": "quad9"}
# nodes of the tetrahedra or hexahedra that a solid element is drawn as
SOLIDS = {
    "tetra": ((0, 1, 2, 3),),
    "tetra10": (
        (0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3),
        (4, 5, 6, 8), (4, 6, 7, 8), (5, 9, 6, 8), (6, 9, 7, 8),
    ),
    "hexahedron": ((0, 1, 2, 3, 4, 5, 6, 7),),
    "hexahedron27": (
        (0, 8, 24, 11, 16, 22, 26, 20), (8, 1, 9, 24, 22, 17, 21, 26),
        (24, 9, 2, 10, 26, 21, 18, 23), (11, 24, 10, 3, 20, 26, 23, 19),
        (16, 22, 26, 20, 4, 12, 25, 15), (22, 17, 21, 26, 12, 5, 13, 25),
        (26, 21, 18, 23, 25, 13, 6, 14), (20, 26, 23, 19, 15, 25, 14, 7),
    ),
}  # fmt: skip
# nodes of the flat pieces of a plane element, in the sense of its corners
PIECES = {
    "triangle": ((0, 1, 2),),
    "triangle6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad": ((0, 1, 2, 3),),
    "quad9": ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)),
}
# nodes along the edges of a plane element, from corner to corner
EDGES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "triangle6": ((0, 3, 1), (1, 4, 2), (2, 5, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "quad9": ((0, 4, 1), (1, 5, 2), (2, 6, 3), (3, 7, 0)),
}
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad9": 4}


def surface(kind: str, elements: np.ndarray, points: np.ndarray) -> tuple[str, np.ndarray]:
    """The plane elements that a body shows, as kind and nodes (m, v), seen from outside."""
    if kind not in FACES:
        return kind, elements
    faces = np.concatenate([elements[:, list(face)] for face in FACES[kind]])
    plane = PLANE[kind]
    outer = alone(faces[:, : CORNERS[plane]])
    owners, faces = elements[outer % len(elements)], faces[outer]
    corners = points[faces[:, : CORNERS[plane]]]
    outward = corners.mean(axis=1) - points[owners].mean(axis=1)
    inside_out = np.sum(_normals(corners) * outward, axis=1) < 0
    faces[inside_out] = mirrored(plane, faces[inside_out].T).T
    return plane, faces


def solids(kind: str, elements: np.ndarray) -> np.ndarray:
    """Solid elements as straight tetrahedra (m, 4) or hexahedra (m, 8); none of plane elements."""
    if kind not in SOLIDS:
        return np.zeros((0, 4), dtype=int)
    return np.concatenate([elements[:, list(part)] for part in SOLIDS[kind]])


def pieces(kind: str, elements: np.ndarray) -> np.ndarray:
    """Flat pieces (m, 3) or (m, 4), by their corners, of plane elements."""
    return np.concatenate([elements[:, list(piece)] for piece in PIECES[kind]])


def triangles(flat: np.ndarray) -> np.ndarray:
    """Flat pieces (m, 3) or (m, 4) as triangles."""
    return np.concatenate([flat[:, :3], flat[:, [0, 2, 3]]]) if flat.shape[1] == 4 else flat


def mesh_lines(kind: str, elements: np.ndarray) -> np.ndarray:
    """The edges of plane elements, each once, as (m, 2 or 3) nodes from corner to corner."""
    edges = _edges(kind, elements)
    return np.asarray(
        edges[np.unique(np.sort(edges[:, [0, -1]], axis=1), axis=0, return_index=True)[1]]
    )


def outline(kind: str, elements: np.ndarray) -> np.ndarray:
    """As mesh_lines, those edges that belong to one element only."""
    edges = _edges(kind, elements)
    return np.asarray(edges[alone(edges[:, [0, -1]])])


def sharp_edges(kind: str, elements: np.ndarray, points: np.ndarray, cosine: float) -> np.ndarray:
    """The edges of a closed surface where the normals of both faces have a smaller cosine."""
    edges = _edges(kind, elements)
    normals = _normals(points[elements[:, : CORNERS[kind]]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    face = np.tile(np.arange(len(elements)), CORNERS[kind])
    key = np.sort(edges[:, [0, -1]], axis=1)
    order = np.lexsort(key.T)
    same = np.all(key[order[1:]] == key[order[:-1]], axis=1)
    one, other = order[:-1][same], order[1:][same]
    flat = np.sum(normals[face[one]] * normals[face[other]], axis=1)
    return np.asarray(edges[one[flat < cosine]])


def segments(lines: np.ndarray) -> np.ndarray:
    """Lines (m, 2 or 3) through nodes as straight pieces (k, 2)."""
    return np.concatenate([lines[:, i : i + 2] for i in range(lines.shape[1] - 1)])


def _edges(kind: str, elements: np.ndarray) -> np.ndarray:
    return np.concatenate([elements[:, list(edge)] for edge in EDGES[kind]])


def _normals(corners: np.ndarray) -> np.ndarray:
    """Normals (m, 3) of plane elements with corners (m, c, 3), of no particular length."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0])
