"""Structured meshes with named boundaries: graded away from the contact, uniform on it."""

from __future__ import annotations

import numpy as np
from skfem import MeshHex, MeshQuad, MeshTet, MeshTri

from contactopt.errors import InputError

MOST_CELLS = 2e7  # of one mesh


def graded(length: float, first: float, growth: float) -> np.ndarray:
    """Grid from 0 to `length` whose spacing starts at about `first` and grows by a ratio of at most `growth`.

    The number of cells is the smallest that keeps the ratio; the ratio is then lowered so that the first cell is
    exactly `first`. A grid that would need one cell or less is a single cell.
    """
    from scipy.optimize import brentq

    if first >= length:
        return np.array([0.0, length])
    cells = int(np.ceil(np.log1p(length * (growth - 1) / first) / np.log(growth) - 1e-9))
    if first * cells >= length:  # so few cells that no growth is needed
        return np.linspace(0.0, length, int(np.ceil(length / first - 1e-9)) + 1)

    def excess(ratio: float) -> float:
        return float(first * np.sum(ratio ** np.arange(cells)) - length)

    ratio = brentq(excess, 1.0, growth * (1 + 1e-12)) if excess(growth) > 0 else growth
    grid = np.concatenate([[0.0], np.cumsum(first * ratio ** np.arange(cells))])
    return np.asarray(grid * (length / grid[-1]))


def contact_grid(half_width: float, elements: int, length: float, growth: float) -> np.ndarray:
    """Uniform grid of `elements` cells on [0, half_width], then graded out to `length`."""
    zone = np.linspace(0.0, half_width, elements + 1)
    if length <= half_width * (1 + 1e-12):
        return zone
    h = half_width / elements
    return np.concatenate([zone, half_width + graded(length - half_width, h * growth, growth)[1:]])


def tensor_mesh(*grids: np.ndarray) -> MeshQuad | MeshHex:
    """Bricks on a tensor grid. Boundaries 'x-', 'x+', 'y-', 'y+' (, 'z-', 'z+'): the faces of the box."""
    cells = np.prod([float(len(grid) - 1) for grid in grids])
    if cells > MOST_CELLS:
        raise InputError(f"a mesh of {cells:.0e} elements is more than {MOST_CELLS:.0e}; take fewer elements.")
    mesh = (MeshQuad if len(grids) == 2 else MeshHex).init_tensor(*grids)
    planes = {}
    for axis, (name, grid) in enumerate(zip("xyz", grids)):
        near = 1e-9 * (grid[-1] - grid[0])
        for sign, value in (("-", grid[0]), ("+", grid[-1])):
            planes[name + sign] = lambda x, axis=axis, value=value, near=near: np.abs(x[axis] - value) < near
    return mesh.with_boundaries(planes)


def rename(mesh: MeshQuad | MeshHex, **names: str) -> MeshQuad | MeshHex:
    """The mesh with boundaries of tensor_mesh under further names, e.g. rename(mesh, contact="y-")."""
    return mesh.with_boundaries({new: mesh.boundaries[old] for new, old in names.items()})


def half_sphere_section(radius: float, x: np.ndarray, y: np.ndarray) -> MeshQuad:
    """Meridian section of a half sphere that touches z = 0 at the origin; its flat face is at z = radius.

    x  radii of the nodes on the lower part of the arc, from 0 to radius / sqrt(2) (the arc's middle);
    y  fractions from 0 to 1 of the way from the arc up, graded from the contact.
    The quarter disc has three corners; the arc's middle serves as the fourth. Boundaries: 'axis', 'arc', 'top'.
    """
    mesh = tensor_mesh(x / x[-1], y)
    s, t = mesh.p
    # The sides away from the contact are divided evenly: even fractions of the same node numbers.
    s_even = np.interp(s, x / x[-1], np.linspace(0, 1, len(x)))
    t_even = np.interp(t, y, np.linspace(0, 1, len(y)))
    lower = _arc(radius, np.arcsin(s / np.sqrt(2)))
    right = _arc(radius, np.pi / 4 * (1 + t_even))
    left = np.stack([np.zeros_like(t), radius * t])
    top = np.stack([radius * s_even, np.full_like(s, radius)])
    corner = _arc(radius, np.array(np.pi / 4))[:, None]
    p = (1 - t) * lower + t * top + (1 - s) * left + s * right
    p -= (1 - s) * t * np.array([[0.0], [radius]]) + s * (1 - t) * corner + s * t * np.array([[radius], [radius]])
    names = {"axis": "x-", "top": "y+"}
    arc = np.concatenate([mesh.boundaries["y-"], mesh.boundaries["x+"]])
    boundaries = {new: mesh.boundaries[old] for new, old in names.items()} | {"arc": arc}
    return MeshQuad(p, mesh.t).with_boundaries(boundaries)


def _arc(radius: float, angle: np.ndarray) -> np.ndarray:
    return np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle))])


def patch(mesh: MeshQuad | MeshHex, boundary: str, name: str, limits: list[float]) -> MeshQuad | MeshHex:
    """Add boundary `name`: the facets of `boundary` whose midpoints lie within [0, limits[i]] along axis i."""
    facets = np.asarray(mesh.boundaries[boundary])
    middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    inside = np.all([middle[i] < limit for i, limit in enumerate(limits)], axis=0)
    return mesh.with_boundaries({name: facets[inside]})


def simplices(mesh: MeshQuad | MeshHex) -> MeshTri | MeshTet:
    """Every quadrilateral cut into two triangles, every hexahedron into six tetrahedra; boundaries keep their names.

    Edges become straight. Bodies cut from meshes with the same cells on their contact faces match there, since all
    cells are cut the same way. Raises InputError if neighbours are not: number the vertices of all cells in one order.
    """
    vertices = mesh.p[:, : mesh.nvertices]
    cut = MeshQuad(vertices, mesh.t).to_meshtri() if len(vertices) == 2 else MeshHex(vertices, mesh.t).to_meshtet()
    facets = cut.boundary_facets()
    if len(facets) != (len(mesh.p) - 1) * len(mesh.boundary_facets()):
        raise InputError("the mesh cannot be cut into simplices: its cells number their vertices in different orders.")
    sides = mesh.t2f[:, cut.f2t[0, facets] % mesh.nelements]  # those of the cell that each outer facet comes from
    corners = mesh.facets[:, sides]  # (corner, side, facet)
    inside = np.all([np.any(corners == vertex, axis=0) for vertex in cut.facets[:, facets]], axis=0)
    origin = sides[np.argmax(inside, axis=0), np.arange(len(facets))]
    return cut.with_boundaries({name: facets[np.isin(origin, old)] for name, old in (mesh.boundaries or {}).items()})
