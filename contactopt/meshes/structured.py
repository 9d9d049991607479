"""Structured meshes with named boundaries: graded away from the contact, uniform on it."""

from dataclasses import replace
from functools import partial

import numpy as np
from skfem import Mesh, MeshHex, MeshQuad, MeshTet, MeshTri

from contactopt.checks import check_memory
from contactopt.errors import InputError
from contactopt.meshes.cells import straight

MOST_CELLS = 2e7  # of one mesh
NEEDED = 6e3  # bytes of memory that a run takes for each cell, at least
# shortest cell over the length of a grid; below it, places of nodes are lost in rounding
FINEST = 1e-8
ROUNDING = 1e-15  # relative
# a direction that no usual edge or diagonal of a cell is perpendicular to
LEAN = np.array([np.sqrt(3), np.sqrt(2), -1.0])


def graded(length: float, first: float, growth: float) -> np.ndarray:
    """A grid (n,) from 0 to a length whose cells grow from the first one on, neighbours by at most
    the ratio `growth` [length].

    The number of cells is the smallest that keeps the ratio below its bound. The ratio is then
    lowered so that the first cell is exactly as long as asked.
    """
    if first >= length:
        return np.array([0.0, length])
    cells = int(np.ceil(np.log1p(length * (growth - 1) / first) / np.log(growth) - 1e-9))
    if first * cells >= length:  # so few cells that no growth is needed
        return np.linspace(0.0, length, int(np.ceil(length / first - 1e-9)) + 1)
    powers = np.arange(cells)

    def step(ratio: float) -> float:  # Newton's, which falls to the root since the sum is convex
        excess = np.sum(ratio**powers) - length / first
        return float(excess / (powers @ ratio ** (powers - 1.0)))

    ratio = growth
    while (change := step(ratio)) > ROUNDING * ratio:
        ratio -= change
    grid = np.append(0.0, np.cumsum(first * ratio**powers))
    return np.asarray(grid * (length / grid[-1]))


def contact_grid(half_width: float, elements: int, length: float, growth: float) -> np.ndarray:
    """A grid (n,) from 0 to a length: `elements` even cells in the zone up to half_width, beyond it
    cells that grow by at most the ratio `growth` [length].
    """
    zone = np.linspace(0.0, half_width, elements + 1)
    if length <= half_width * (1 + 1e-12):
        return zone
    h = half_width / elements
    return np.concatenate([zone, half_width + graded(length - half_width, h * growth, growth)[1:]])


def tensor_mesh(*grids: np.ndarray) -> MeshQuad | MeshHex:
    """Quadrilaterals or hexahedra on the tensor grid of two or three ascending arrays, the places
    of the nodes along x, y and z [length]; the sides of the box are boundaries 'x-', 'x+', 'y-',
    'y+', 'z-' and 'z+'.

    InputError for more than MOST_CELLS cells, more memory than is free, or cells shorter than
    FINEST of their grid.
    """
    cells = float(np.prod([float(len(grid) - 1) for grid in grids]))
    if cells > MOST_CELLS:
        raise InputError(
            f"a mesh of {cells:.0e} elements is more than {MOST_CELLS:.0e}; take fewer elements."
        )
    check_memory(f"a mesh of {cells:.2g} elements", NEEDED * cells)
    for grid in grids:
        size, shortest = np.ptp(grid), np.diff(grid).min()
        if not shortest >= FINEST * size:
            raise InputError(
                f"elements of size {shortest:.2g} in a body of size {size:.2g} are lost in"
                " rounding; make the contact and its body more alike in size, or take fewer"
                " elements."
            )
    mesh = (MeshQuad if len(grids) == 2 else MeshHex).init_tensor(*grids)
    planes = {}
    for axis, (name, grid) in enumerate(zip("xyz", grids)):
        near = 1e-9 * (grid[-1] - grid[0])
        for sign, value in (("-", grid[0]), ("+", grid[-1])):
            planes[name + sign] = partial(_across, axis, value, near)
    return mesh.with_boundaries(planes)


def _across(axis: int, value: float, near: float, x: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(x[axis] - value) < near)


def rename(mesh: MeshQuad | MeshHex, **names: str) -> MeshQuad | MeshHex:
    """The mesh with further names of boundaries, new="old": rename(mesh, contact="y-")."""
    return mesh.with_boundaries({new: mesh.boundaries[old] for new, old in names.items()})


def half_sphere_section(radius: float, x: np.ndarray, y: np.ndarray) -> MeshQuad:
    """Meridian section of a half sphere that touches z = 0 at the origin: a quarter disc, whose
    fourth corner is the middle of the arc, with the boundaries 'axis', 'arc' and 'top', the flat
    face at z = radius.

    x (n,) are the distances from the axis of the nodes on the lower part of the arc, from 0 to
    radius / sqrt(2), its middle [length]; y (m,) fractions from 0 to 1 of the way from the arc up,
    graded from the contact.
    """
    mesh = tensor_mesh(x / x[-1], y)
    s, t = mesh.p
    # The sides away from the contact are divided evenly: even fractions of the same node numbers.
    # Towards the contact the lines become upright and level: sheared elements there would move the
    # edge of contact by a share of an element, which is an error of first order.
    s_even = s + t * (np.interp(s, x / x[-1], np.linspace(0, 1, len(x))) - s)
    t_even = t + s * (np.interp(t, y, np.linspace(0, 1, len(y))) - t)
    lower = _arc(radius, np.arcsin(s / np.sqrt(2)))
    right = _arc(radius, np.pi / 4 * (1 + t_even))
    left = np.stack([np.zeros_like(t), radius * t])
    top = np.stack([radius * s_even, np.full_like(s, radius)])
    corner = _arc(radius, np.array(np.pi / 4))[:, None]
    p = (1 - t) * lower + t * top + (1 - s) * left + s * right
    p -= (1 - s) * t * np.array([[0.0], [radius]]) + s * (1 - t) * corner
    p -= s * t * np.array([[radius], [radius]])
    old = mesh.boundaries
    arc = np.concatenate([old["y-"], old["x+"]])
    names = {"axis": old["x-"], "top": old["y+"], "arc": arc}
    return MeshQuad(p, mesh.t).with_boundaries(names)


def _arc(radius: float, angle: np.ndarray) -> np.ndarray:
    return np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle))])


def patch(
    mesh: MeshQuad | MeshHex, boundary: str, name: str, limits: list[float]
) -> MeshQuad | MeshHex:
    """The mesh with a part of one of its boundaries as a boundary of its own, `name`: the facets
    whose midpoints are below limits[i] along each axis i [length].
    """
    facets = np.asarray(mesh.boundaries[boundary])
    middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    inside = np.all([middle[i] < limit for i, limit in enumerate(limits)], axis=0)
    return mesh.with_boundaries({name: facets[inside]})


def simplices(mesh: Mesh) -> MeshTri | MeshTet:
    """Every quadrilateral cut into two triangles, every hexahedron into six tetrahedra, with
    straight edges and the same boundaries; triangles and tetrahedra stay whole.

    A side of a hexahedron is cut by the diagonal through its first corner along LEAN. Neighbours
    thus cut a common side alike, and so do bodies whose meshes match.
    """
    mesh = straight(mesh)
    if isinstance(mesh, MeshTri | MeshTet):
        return mesh
    bare = replace(mesh, _boundaries=None)
    cut = bare.to_meshtri() if isinstance(mesh, MeshQuad) else MeshTet(mesh.p, _tetrahedra(mesh))
    facets = cut.boundary_facets()
    if not mesh.boundaries:
        return cut
    # those of the cell that each outer facet comes from
    sides = mesh.t2f[:, cut.f2t[0, facets] % mesh.nelements]
    corners = mesh.facets[:, sides]  # (corner, side, facet)
    inside = np.all([np.any(corners == vertex, axis=0) for vertex in cut.facets[:, facets]], axis=0)
    origin = sides[np.argmax(inside, axis=0), np.arange(len(facets))]
    names = {name: facets[np.isin(origin, old)] for name, old in mesh.boundaries.items()}
    return cut.with_boundaries(names)


def _tetrahedra(mesh: MeshHex) -> np.ndarray:
    """The corners (4, 6 cells) of six tetrahedra in each hexahedron, cell by cell in each sixth:
    from its first corner along LEAN to the two halves of each of the three sides opposite to it.

    Source: Dompierre et al. (1999), How to subdivide pyramids, prisms and hexahedra into
    tetrahedra.
    """
    rank = np.argsort(np.argsort(LEAN @ mesh.p, kind="stable"))
    first = np.argmin(rank[mesh.t], axis=0)
    made = np.empty((4, 6, mesh.nelements), int)
    for corner in range(8):
        cells = np.flatnonzero(first == corner)
        opposite = [side for side in mesh.refdom.facets if corner not in side]
        made[0][:, cells] = mesh.t[corner, cells]
        for number, side in enumerate(opposite):
            around = mesh.t[side][:, cells]
            turn = np.argmin(rank[around], axis=0) + np.arange(4)[:, None]
            a, b, c, d = np.take_along_axis(around, turn % 4, axis=0)
            made[1:, 2 * number, cells] = a, b, c
            made[1:, 2 * number + 1, cells] = a, c, d
    return made.reshape(4, -1)
