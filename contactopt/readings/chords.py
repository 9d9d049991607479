"""What the pressure owes to facets that stand for curves.

Facets leave the curve between its nodes. Those of meshes of second order are parabolas, whose
distance from it falls with the fourth power of their size. Where the meshes of two curved surfaces
do not match, the gap between their facets therefore differs from that between the curves, by
another amount at every contact. If elements of second degree have straight edges, the nodes within
edges do not lie on the curve either. At contact i the gap of the curves is larger than that of the
facets by

    d_i = int psi_i (c_upper - c_lower) . n / int phi_i,

with the ways c from facets to curves (contactopt.meshes.mesh_refinement.boundary_curves) and the
functions phi_i, psi_i of the mortar coupling (contactopt.coupling.mortar); where nodes match, and
at a rigid body, it is the value at the node. This is small or not beside what the bodies give way
there: the pressure between the curves is larger by dr / areas, where on the contacts that touch,
and those that would,

    Q_nn dr = -(u_n + d),    V_n' dr = 0.

A few steps of conjugate gradients tell how large dr is.

Straight edges of second degree also meet at an angle t, where the stress along the curve has to
turn. It pulls at the corners, by t times itself, and the pressure there changes by KINK t of itself
or so, however small the overlap is and whether the meshes match or not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from skfem import Mesh
from skfem.quadrature import get_quadrature
from skfem.refdom import RefLine, RefTri

from contactopt.coupling.coupling import Coupling
from contactopt.coupling.reduction import Reduction
from contactopt.defaults import EQUAL
from contactopt.meshes.barycentric import barycentric, frames_of
from contactopt.meshes.cells import in_triangles, measures, outer_corners, straight
from contactopt.meshes.facet_surfaces import edge_middles
from contactopt.meshes.mesh_refinement import boundary_curves
from contactopt.problem import Solution

NEAREST = 12  # facets among which that of a point is looked for
# steps of conjugate gradients and the part of the residual that ends them: dr is no more exact
STEPS, LEFT = 12, 1e-2
# Of the largest pressure. Of 90 press fits of rings and shells with random meshes, all 85 that were
# more than 5 % off changed by more than this, and one of the others.
SHOWN = 0.05
# Pressure at the corners over the angle between edges, beside rings of Lame with curved edges:
# .13 to .21 for walls thicker than half of the radius, .5 for one of a fifth
KINK = 0.3
SIDES = {2: np.array([[0], [1]]), 3: np.array([[0, 1, 2], [1, 2, 0]])}  # of lines, of triangles
INSIDE = 8  # order of the quadrature in a cell, whose points sample the chords of the other side


def chord_remarks(reduction: Reduction, solution: Solution) -> list[str]:
    """A sentence on each pair whose largest pressure owes more than SHOWN to straight facets."""
    if not solution.solved:
        return []
    d, angles = _heights_and_angles(reduction)
    if not np.any(d) and not np.any(angles):
        return []
    problem, r = reduction.problem, solution.reactions[:, 0]
    change = pressure_changes(reduction, solution, d)
    pressure = np.divide(r, problem.areas, out=np.zeros(len(r)), where=problem.areas > 0)
    turned, found = KINK * angles * pressure, []
    for pair in problem.pairs:
        own = pair.contacts
        least = SHOWN * np.abs(pressure[own]).max(initial=0.0)
        if np.abs(change[own]).max() > least:
            effect = f"changes the gap by up to {np.abs(d[own]).max():.3g}"
            more = ", or the same nodes"
        elif turned[own].max() > least:
            degrees = np.degrees(angles[own].max())
            effect, more = f"turns the stress along them by {degrees:.2g} degrees", ""
        else:
            continue
        found.append(
            f"the facets of '{pair.name}' stand for curves, and leave them between their nodes:"
            f" this {effect}, and the pressure changes by more than {SHOWN:.0%}; give the"
            f" boundaries their `curve`, or finer meshes of second order{more}, or ask for an"
            " accuracy."
        )
    return found


def chord_heights(reduction: Reduction) -> np.ndarray:
    """By how much the curves' gap exceeds that of the facets at each contact, (k,) [length]."""
    return _heights_and_angles(reduction)[0]


def _heights_and_angles(reduction: Reduction) -> tuple[np.ndarray, np.ndarray]:
    """As chord_heights(), and the angles (k,) between straight edges of second degree."""
    scene, known, found = reduction.scene, dict[str, Any](), []
    angles = [np.zeros(len(own.gap)) for own in reduction.couplings]

    def way(name: str, surface: str | None) -> Way | None:
        part = scene.meshed.get(name)
        if part is None:
            return None
        surface = surface or part.contact
        if part.curve_of(surface) is not None:
            return None
        if name not in known:
            mesh = part.build_mesh(scene.elements, scene.zone)
            known[name] = mesh, boundary_curves(mesh)
        mesh, curves = known[name]
        curve = curves.get(surface)
        return None if curve is None else Way(mesh, surface, curve, scene.degree)

    for pair, coupling, angle in zip(scene.pairs, reduction.couplings, angles):
        if coupling.kind == "matching" and scene.degree == 1:  # contacts are nodes on the curve
            found.append(np.zeros(len(coupling.gap)))
            continue
        ways = [way(*side) for side in zip(pair.bodies, pair.surfaces)]
        for own in ways if scene.degree == 2 else ():
            if own is not None:
                np.maximum(angle, own.angles(coupling.positions), out=angle)
        gaps = [getattr(scene.rigid.get(body), "gap", None) for body in pair.bodies]
        if any(map(callable, gaps)):
            found.append(_rigid_heights(coupling, ways, gaps))
        else:
            found.append(_heights(coupling, ways))
    return np.concatenate(found), np.concatenate(angles)


def _rigid_heights(coupling: Coupling, ways: list[Way | None], gaps: list[Any]) -> np.ndarray:
    """As chord_heights(), of a pair with a rigid body, whose gap is a function of the place."""
    way = next((own for own in ways if own is not None), None)
    if way is None:
        return np.zeros(len(coupling.gap))
    gap, x = next(own for own in gaps if callable(own)), coupling.positions
    return np.asarray(gap(x + way(x)) - gap(x), dtype=float)


class Way:
    """The way from the facets of a boundary to the curve that they stand for.

    corners  (dim, dim, f) those of the facets, quadrilaterals cut in two
    off      (dim, 1 or 3, f) from the middles of their chords 01, 12, 20 to those of their edges
    angle    (f,) at which straight edges of second degree meet their neighbours
    """

    def __init__(
        self, mesh: Mesh, name: str, curve: Callable[[np.ndarray], np.ndarray], degree: int
    ) -> None:
        mesh = mesh if degree == 2 else straight(mesh)
        facets = np.asarray(mesh.boundaries[name])
        nodes = outer_corners(mesh, facets)
        edges = mesh.p[:, np.stack([nodes, np.roll(nodes, 1, axis=0)])]  # (dim, 2, c, f)
        middles = edges.mean(axis=1).reshape(len(mesh.p), -1)
        heights = np.linalg.norm(curve(middles) - middles, axis=0).reshape(nodes.shape)
        lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=0)
        angle = (8 * heights / lengths).max(axis=0)
        nodes, middles = edge_middles(mesh, facets)
        self.corners = mesh.p[:, nodes]
        self.off = middles - self.corners[:, SIDES[len(nodes)]].mean(axis=1)
        bent = np.any(np.abs(self.off) > EQUAL * lengths.max(), axis=(0, 1))
        self.angle = np.where(bent, 0.0, np.resize(angle, nodes.shape[1]))
        self.frames = frames_of(self.corners)
        self.curve, self.tree = curve, cKDTree(self.corners.mean(axis=1).T)

    def feet(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places (dim, m) of the facets nearest to points, and the numbers of these facets."""
        count = min(NEAREST, self.corners.shape[2])
        near = self.tree.query(points.T, k=count)[1].reshape(-1, count)
        share = np.clip(barycentric(self.frames, near, points)[0], 0, 1)
        share = share / share.sum(axis=0)
        both = 4 * np.prod(share[SIDES[len(share)]], axis=0)  # one in the middle of each edge
        feet = np.sum(self.corners[:, :, near] * share, axis=1)
        feet += np.sum(self.off[:, :, near] * both, axis=1)
        best = np.argmin(np.linalg.norm(feet - points[:, :, None], axis=0), axis=1)
        return feet[:, np.arange(len(best)), best], near[np.arange(len(best)), best]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        foot = self.feet(points)[0]
        return np.asarray(self.curve(foot) - foot)

    def angles(self, points: np.ndarray) -> np.ndarray:
        """The angles (m,) at which the edges nearest to points meet their neighbours."""
        return np.asarray(self.angle[self.feet(points)[1]])


def _heights(coupling: Coupling, ways: list[Way | None]) -> np.ndarray:
    """As chord_heights(), of one pair with the ways of its upper and its lower surface."""
    count, normals = len(coupling.gap), coupling.frames[:, 0].T
    upper = coupling.carrier == "upper"

    def opened(points: np.ndarray, n: np.ndarray, gap: np.ndarray) -> np.ndarray:
        found = np.zeros(points.shape[1])
        # from the surface of the contacts to that of the other body
        places = (points, points - gap * n) if upper else (points + gap * n, points)
        for sign, way, at in zip((1.0, -1.0), ways, places):
            if way is not None:
                found += sign * np.sum(way(at) * n, axis=0)
        return found

    if not any(ways):
        return np.zeros(count)
    if coupling.kind == "matching":
        return opened(coupling.positions, normals, coupling.gap)
    cells = in_triangles(coupling.cells)
    corners = coupling.positions[:, cells]
    size = measures(corners)
    total, whole = np.zeros(count), np.zeros(count)
    inner, weights = get_quadrature(RefLine if len(cells) == 2 else RefTri, INSIDE)
    for share, weight in zip(np.vstack([1 - inner.sum(axis=0), inner]).T, weights):
        at, n = (np.einsum("dvc,v->dc", values, share) for values in (corners, normals[:, cells]))
        height = weight * size * opened(at, n, share @ coupling.gap[cells])
        for part, node in zip(share, cells):
            np.add.at(total, node, ((len(cells) + 1) * part - 1) * height)
            np.add.at(whole, node, part * weight * size)
    return np.divide(total, whole, out=np.zeros(count), where=whole > 0)


def pressure_changes(reduction: Reduction, solution: Solution, d: np.ndarray) -> np.ndarray:
    """By how much the pressure changes, (k,) [stress], if the gap grows by d (k,) [length]."""
    problem = reduction.problem
    u = reduction.moved(solution)[:, 0]
    touching = problem.law.pressed(solution.reactions)
    near = (problem.areas > 0) & (touching | (u + d < 0))
    root = np.where(near, np.sqrt(np.maximum(problem.areas, 0.0)), 0.0)
    # with the unknowns dr / root, orthogonal to root V
    basis = np.linalg.qr(root[:, None] * problem.V[:: problem.dim])[0]

    def product(y: np.ndarray) -> np.ndarray:
        r = np.zeros(problem.q.shape)
        r[:, 0] = root * y
        return free(root * (problem.Q @ r.ravel()).reshape(r.shape)[:, 0])

    def free(y: np.ndarray) -> np.ndarray:
        return np.asarray(y - basis @ (basis.T @ y))

    left = free(-root * np.where(touching, d, u + d))
    found, step, square = np.zeros(len(d)), left, float(left @ left)
    least = LEFT**2 * square
    for _ in range(STEPS):
        if square <= least:
            break
        moved = product(step)
        length = square / float(step @ moved)
        found, left = found + length * step, left - length * moved
        before, square = square, float(left @ left)
        step = left + square / before * step
    change = root * found
    return np.divide(change, problem.areas, out=np.zeros(len(d)), where=near)
