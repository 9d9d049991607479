"""Scenes coupled by mortar, and what the tests of mortar.py measure on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem

from contactopt import InterfaceProblem, Material, Part, Scene, Support
from contactopt.bodies.body import build_body
from contactopt.interface.condensation import ReducedBody, reduce_body
from contactopt.interface.faces import faces_of
from contactopt.interface.matching import _frames
from contactopt.interface.mortar import Mortar, mortar
from contactopt.scenes.meshes import rename, tensor_mesh


@dataclass
class Coupled:
    """A scene reduced with a mortar coupling: u = T0 U0 - T1 U1 + gap n."""

    problem: InterfaceProblem
    bodies: list[ReducedBody]
    maps: list[sp.csr_matrix]
    mortar: Mortar
    frames: np.ndarray

    @property
    def unknowns(self) -> int:
        return sum(len(b.body.free) for b in self.bodies)

    def forces(self, reactions: np.ndarray) -> list[np.ndarray]:
        """Nodal forces (dim, nodes) on both bodies."""
        signs = (1.0, -1.0)
        return [s * (T.T @ reactions.ravel())[b.body.unknowns] for s, T, b in zip(signs, self.maps, self.bodies)]

    def displacements(self, solution: Any) -> list[np.ndarray]:
        out, start = [], 0
        for sign, T, b in zip((1.0, -1.0), self.maps, self.bodies):
            p = b.motions.shape[1]
            force = sign * (T.T @ solution.reactions.ravel())
            force[np.setdiff1d(np.arange(len(force)), b.body.free)] = 0
            out.append(b.displacement(force, solution.multipliers[start : start + p])[b.body.unknowns])
            start += p
        return out


def assemble(m: Mortar, frames: np.ndarray, bodies: list) -> list[sp.csr_matrix]:
    """T (k dim, n) of both bodies."""
    dim, k = m.normals.shape
    own = bodies[m.own]
    fixed = np.ones(own.A.shape[0], dtype=bool)
    fixed[own.free] = False
    held = fixed[own.unknowns[:, m.nodes]]
    maps = []
    for i, body in enumerate(bodies):
        T = sp.csr_matrix((k * dim, body.A.shape[0]))
        for c, row in enumerate(m.components(i, held)):
            turn = sp.csr_matrix(
                (frames[:, :, c].ravel(), (np.arange(k * dim), np.repeat(np.arange(k), dim))), (k * dim, k)
            )
            for d, part in enumerate(row):
                G = sp.coo_matrix(turn @ part)
                T = T + sp.csr_matrix((G.data, (G.row, body.unknowns[d, G.col])), T.shape)
        maps.append(sp.csr_matrix(T))
    return maps


def couple(scene: Any, own: str | None = None, elements: int | None = None, zone: float | None = None) -> Coupled:
    elements, zone = elements or scene.elements, zone or scene.zone
    parts = (scene.upper, scene.lower)
    bodies = [build_body(scene, part, elements, zone) for part in parts]
    sides = [
        faces_of(b.name, b.basis, b.degree, b.basis.mesh.boundaries[p.contact], b.weight, b.locations, p.curve)
        for b, p in zip(bodies, parts)
    ]
    m = mortar(*sides, own)
    frames = _frames(m.normals)
    maps = assemble(m, frames, bodies)
    reduced = [reduce_body(b, schur=False) for b in bodies]
    dim, k = m.normals.shape
    Q, q = 0.0, np.zeros((k, dim))
    q[:, 0] = m.gap
    V, s = [], []
    for sign, T, b in zip((1.0, -1.0), maps, reduced):
        load = np.zeros((T.shape[1], T.shape[0]))
        load[b.body.free] = T.T.toarray()[b.body.free]
        Q = Q + T @ b.elastic(load)
        q = q + sign * (T @ b.at_rest).reshape(q.shape)
        V.append(sign * (T @ b.motions))
        s.append(b.resultants)
    problem = InterfaceProblem(
        (Q + Q.T) / 2, q, np.full(k, scene.mu), np.concatenate(V, axis=1), np.concatenate(s), m.areas, m.points
    )
    return Coupled(problem, reduced, maps, m, frames)


def resultants(forces: list[np.ndarray], points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Sum over both bodies of the forces, and of their moments about the origin (3,)."""

    def tall(x: np.ndarray) -> np.ndarray:
        return np.pad(x, ((0, 3 - len(x)), (0, 0)))

    moment = sum(np.cross(tall(x), tall(f), axis=0).sum(axis=1) for x, f in zip(points, forces))
    return sum(f.sum(axis=1) for f in forces), moment


def slab(
    kind: str, low: float, high: float, cells: int, start: float = 0.0, end: float = 1.0, power: float = 1.3
) -> Any:
    """Two layers of elements between two heights and two places, `cells` of uneven width; boundaries as conftest.block."""
    grids = [start + (end - start) * np.linspace(0.0, 1.0, cells + 1) ** power] * (2 if kind == "solid" else 1)
    up = "z" if kind == "solid" else "y"
    names = {f"side{i}": f"{'xy'[i]}-" for i in range(len(grids))} | {"top": f"{up}+", "bottom": f"{up}-"}
    return rename(tensor_mesh(*grids, np.linspace(low, high, 3)), **names)


def ring(inner: float, outer: float, layers: int, sectors: int, angle: float, curved: bool = False) -> Any:
    """A ring or a part of it from angle 0 on; boundaries inner, outer, start, end. `curved`: of isoparametric elements."""
    full = angle > 2 * np.pi - 1e-9
    mesh = tensor_mesh(np.linspace(inner, outer, layers + 1), np.linspace(0, angle, sectors + 1))
    names = {"inner": "x-", "outer": "x+", "start": "y-", "end": "y+"}
    boundaries = {new: mesh.boundaries[old] for new, old in names.items()}
    if curved:
        mesh = skfem.MeshQuad2.from_mesh(mesh)
    r, phi = mesh.p if not curved else mesh.doflocs
    p = np.stack([r * np.cos(phi), r * np.sin(phi)])
    if not full:
        return type(mesh)(p, mesh.t).with_boundaries(boundaries)
    mesh = skfem.MeshQuad(p, mesh.t)
    last = np.isclose(phi, angle)
    target = np.arange(p.shape[1])
    target[last] = [np.argmin(np.hypot(*(p - p[:, [i]])) + 10 * last) for i in np.flatnonzero(last)]
    keep = np.unique(target)
    number = np.zeros(p.shape[1], dtype=int)
    number[keep] = np.arange(len(keep))
    closed = skfem.MeshQuad(p[:, keep], number[target[mesh.t]])
    size = np.hypot(*closed.p)
    return closed.with_boundaries(
        {
            name: lambda x, radius=radius: (
                np.hypot(*x) < radius * 1.0001 if radius == inner else np.hypot(*x) > (inner + 3 * outer) / 4
            )
            for name, radius in (("inner", inner), ("outer", size.max()))
        }
    )


def press_fit(
    sectors: tuple[int, int], degree: int, interference: float, kept: bool, curved: bool, kind: str = "", mu=0.0
):
    """A quarter of a ring 2 < r < 3 pressed on a ring 1 < r < 2; `kept`: the true circles are known."""
    material = Material(5.0, 0.3)
    sides = (Support("start", {"y": 0.0}), Support("end", {"x": 0.0}))

    def circle(radius):
        return (lambda x: radius * x / np.hypot(*x)) if kept else None

    def part(name, inner, outer, n, contact, radius):
        mesh = ring(inner, outer, max(2, n // 2), n, np.pi / 2, curved)
        return Part(name, mesh, material, sides, contact=contact, curve=circle(radius))

    half = 0.0 if not kept else interference / 2
    shift = interference / 2 - half
    outer = part("outer", 2 - shift, 3, sectors[0], "inner", 2 - interference / 2)
    inner = part("inner", 1, 2 + shift, sectors[1], "outer", 2 + interference / 2)
    scene = Scene("press fit", outer, inner, mu, degree=degree)
    stiff = 5.0 / (1 - 0.09)
    return scene, interference * stiff / 2 / ((9 + 4) / (9 - 4) + (4 + 1) / (4 - 1))
