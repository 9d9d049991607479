"""Scenes whose two bodies have meshes of different sizes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import skfem

from contactopt import Contact, Material, Part, Plate, Scene, Support, scenes
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.scenes.common import with_elements

MATERIAL = Material(5.0, 0.3)


def apart(
    scene: Scene, upper: int, lower: int, degree: int | None = None, carrier: str | None = None
) -> Scene:
    """The scene of two bodies with so many elements of each across the contact half-width."""
    top, base = scene.upper, scene.lower
    assert isinstance(top, Part) and isinstance(base, Part)
    parts = (
        replace(top, mesh=lambda _, zone: top.build_mesh(upper, zone)),
        replace(base, mesh=lambda _, zone: base.build_mesh(lower, zone)),
    )
    made = with_elements(
        replace(scene, upper=parts[0], lower=parts[1], elements=max(upper, lower)), degree
    )
    return made if carrier is None else carried(made, carrier)


def carried(scene: Scene, carrier: str) -> Scene:
    """The scene in its long form, with the side that carries the contacts."""
    pair = replace(scene.pairs[0], carrier=carrier)
    return replace(scene, upper=None, lower=None, mu=None, bodies=scene.parts, contacts=(pair,))


def stacked(kind: str, degree: int, cells: tuple[int, int], carrier: str) -> Scene:
    """Two blocks of one width under 3 units of force, with so many cells across."""
    up, dim = {"plane-strain": ("y", 2), "axisymmetric": ("z", 2), "solid": ("z", 3)}[kind]
    across = {"plane-strain": "x", "axisymmetric": "r", "solid": "xy"}[kind]

    def block(name: str, count: int, heights: tuple[float, float]) -> Part:
        grids = [np.linspace(0, 1, count + 1) ** (1.3 if name == "upper" else 1.0)] * (dim - 1)
        ends = {f"side {c}": f"{'xy'[i]}-" for i, c in enumerate(across)}
        axis = "xyz"[dim - 1]
        mesh = rename(
            tensor_mesh(*grids, np.linspace(*heights, 3)), top=f"{axis}+", bottom=f"{axis}-", **ends
        )
        sides = tuple(Support(f"side {c}", {c: 0.0}) for c in across)
        if name == "upper":
            plate = Plate("top", {up: -3.0}, glued=False)
            return Part(name, mesh, MATERIAL, sides, (plate,), contact="bottom")
        return Part(name, mesh, MATERIAL, (*sides, Support("bottom", {up: 0.0})), contact="top")

    bodies = block("upper", cells[0], (0.0, 1.0)), block("lower", cells[1], (-2.0, 0.0))
    pair = Contact("upper", "lower", 0.3, coupling="mortar", carrier=carrier)
    return Scene("blocks", kind=kind, degree=degree, bodies=bodies, contacts=(pair,))


def press_fit(
    sectors: tuple[int, int], degree: int, carrier: str, mu: float = 0.0
) -> tuple[Scene, float]:
    """A quarter of a ring 2 < r < 3 pressed on a ring 1 < r < 2, and Lame's pressure."""
    interference = 0.01
    sides = (Support("start", {"y": 0.0}), Support("end", {"x": 0.0}))

    def part(
        name: str, inner: float, outer: float, count: int, contact: str, radius: float
    ) -> Part:
        mesh = tensor_mesh(
            np.linspace(inner, outer, max(2, count // 2) + 1), np.linspace(0, np.pi / 2, count + 1)
        )
        names = {"inner": "x-", "outer": "x+", "start": "y-", "end": "y+"}
        boundaries = {new: mesh.boundaries[old] for new, old in names.items()}
        if degree == 2:
            mesh = skfem.MeshQuad2.from_mesh(mesh)
        r, phi = mesh.doflocs
        mesh = type(mesh)(np.stack([r * np.cos(phi), r * np.sin(phi)]), mesh.t).with_boundaries(
            boundaries
        )
        return Part(
            name,
            mesh,
            MATERIAL,
            sides,
            contact=contact,
            curve=lambda x: np.asarray(radius * x / np.hypot(*x)),
        )

    outer = part("outer", 2, 3, sectors[0], "inner", 2 - interference / 2)
    inner = part("inner", 1, 2, sectors[1], "outer", 2 + interference / 2)
    pair = Contact("outer", "inner", mu, coupling="mortar", carrier=carrier)
    scene = Scene("press fit", degree=degree, bodies=(outer, inner), contacts=(pair,))
    stiffness = MATERIAL.E / (1 - MATERIAL.nu**2)
    return scene, interference * stiffness / 2 / (13 / 5 + 5 / 3)


def punch(
    elements: int = 32, length: float = 1.0, force: float = 1.0, mu: float = 0.2, **changes: Any
) -> Scene:
    """The paper's 2D punch with other units of length and force."""
    sizes = dict(
        width=40.0, height=40.0, foundation_width=160.0, foundation_height=80.0, depth=40.0
    )
    material = Material(changes.pop("modulus", 5.0) * force / length**2, 0.3)
    scaled = {name: size * length for name, size in sizes.items()}
    loads = {
        "force": 100.0 * force,
        "mu": mu,
        "elements": elements,
        "upper": material,
        "lower": material,
    }
    return scenes.flat_punch(2, **scaled, **loads, **changes)  # type: ignore[arg-type]
