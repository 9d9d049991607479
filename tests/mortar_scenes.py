"""Scenes coupled by mortar, and what the tests of mortar.py measure on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

import numpy as np
import skfem

from contactopt import InterfaceProblem, Material, Part, Scene, Support, reduce_bodies
from contactopt.bodies.elements import mean_normals, nodes_on
from contactopt.coupling.coupling import COUPLINGS, Coupling
from contactopt.coupling.faces import faces_of
from contactopt.coupling.mortar import Mortar, mortar
from contactopt.coupling.mortar_surfaces import couple_surfaces
from contactopt.coupling.reduction import Reduction
from contactopt.meshes.structured import tensor_mesh


@dataclass
class Coupled:
    """A scene reduced with a mortar coupling, and the coupling's own contacts."""

    reduction: Reduction
    mortar: Mortar

    @property
    def problem(self) -> InterfaceProblem:
        return self.reduction.problem

    @property
    def bodies(self) -> Any:
        return self.reduction.bodies

    @property
    def unknowns(self) -> int:
        return sum(b.unknowns for b in self.bodies)

    def forces(self, reactions: np.ndarray) -> list[np.ndarray]:
        """Nodal forces (dim, nodes) on both bodies."""
        maps = self.reduction.coupling.upper, -self.reduction.coupling.lower
        return [(T.T @ reactions.ravel())[b.body.unknowns] for T, b in zip(maps, self.bodies)]


def upper_carries(scene: Any, pair: Any, upper: Any, lower: Any) -> Coupling:
    return couple_surfaces(scene, replace(pair, carrier="upper"), upper, lower)


def lower_carries(scene: Any, pair: Any, upper: Any, lower: Any) -> Coupling:
    return couple_surfaces(scene, replace(pair, carrier="lower"), upper, lower)


def couple(
    scene: Any, own: str | None = None, elements: int | None = None, zone: float | None = None
) -> Coupled:
    name = "mortar" if own is None else f"{own}_carries"
    kinds = {
        f"{side}_carries": ("mortar_scenes", f"{side}_carries", "") for side in ("upper", "lower")
    }
    with patch.dict(COUPLINGS, kinds):
        reduction = reduce_bodies(scene, elements, zone, coupling=name)
    parts, sides = (scene.upper, scene.lower), []
    for b, p in zip((r.body for r in reduction.bodies), parts):
        facets = b.basis.mesh.boundaries[p.contact]
        faces = (f(b.basis, b.degree, facets) for f in (nodes_on, mean_normals))
        sides.append(
            faces_of(
                b.name,
                b.basis.mesh.refdom.__name__,
                b.degree,
                *faces,
                b.weight,
                b.locations,
                p.curve,
            )
        )
    return Coupled(reduction, mortar(*sides, own))


def resultants(forces: list[np.ndarray], points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Sum over both bodies of the forces, and of their moments about the origin (3,)."""

    def tall(x: np.ndarray) -> np.ndarray:
        return np.pad(x, ((0, 3 - len(x)), (0, 0)))

    moment = sum(np.cross(tall(x), tall(f), axis=0).sum(axis=1) for x, f in zip(points, forces))
    return sum(f.sum(axis=1) for f in forces), moment


def ring(
    inner: float, outer: float, layers: int, sectors: int, angle: float, curved: bool = False
) -> Any:
    """A ring or a part of it from angle 0 on."""
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
                np.hypot(*x) < radius * 1.0001
                if radius == inner
                else np.hypot(*x) > (inner + 3 * outer) / 4
            )
            for name, radius in (("inner", inner), ("outer", size.max()))
        }
    )


def press_fit(
    sectors: tuple[int, int],
    degree: int,
    interference: float,
    kept: bool,
    curved: bool,
    kind: str = "",
    mu=0.0,
):
    """A quarter of a ring 2 < r < 3 pressed on a ring 1 < r < 2."""
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
