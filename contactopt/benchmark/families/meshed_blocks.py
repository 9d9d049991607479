"""Elastic blocks in the plane that stand on each other, with meshes that do not match."""

from typing import Any

import numpy as np

from contactopt.benchmark.families.of_scenes import problem_of
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.problem import InterfaceProblem
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Scene, Support


def meshed_blocks(
    blocks: int = 2,
    elements: int = 8,
    mu: float = 0.5,
    stiffness_ratio: float = 1.0,
    shear: float = 0.1,
    tied: bool = False,
    unstructured: bool = False,
    seed: int = 0,
) -> InterfaceProblem:
    """Blocks on a block that is held: each is half an element finer than the one below, so that
    nodes of two surfaces never match, and carries its weight and a push to the side.

    stiffness_ratio  Young's modulus of the last block over that of the lowest one
    shear            push over weight
    tied             the lowest two blocks are glued to each other
    unstructured     triangles of Delaunay over random nodes; else quadrilaterals
    """
    if blocks < 2 or elements < 2:
        raise InputError("meshed_blocks needs at least two blocks and two elements.")
    rng = np.random.default_rng(seed)
    modulus = 100.0 * np.geomspace(1, stiffness_ratio, blocks)
    bodies, contacts = [], []
    for i in range(blocks):
        width = 1.6 if i == 0 else 1.0 - 0.05 * i
        count = (elements * 8 // 5 if i == 0 else elements) + i
        mesh = _mesh(width, float(i), count, unstructured, rng)
        held = (Support("bottom"),) if i == 0 else ()
        load = () if i == 0 else (BodyForce((shear, -1.0)),)
        material = Material(float(modulus[i]), 0.3)
        bodies.append(Part(f"block {i}", mesh, material, held, load, contact="bottom"))
        if i:
            law, own = ("tied", 0.0) if tied and i == 1 else ("coulomb", mu)
            contacts.append(Contact(f"block {i}", f"block {i - 1}:top", own, law=law))
    scene = Scene("blocks", bodies=tuple(bodies), contacts=tuple(contacts), kind="plane-strain")
    return problem_of(scene)


def _mesh(
    width: float, low: float, count: int, unstructured: bool, rng: np.random.Generator
) -> Any:
    """A block of height one, with boundaries bottom and top."""
    from skfem import MeshTri

    from contactopt.meshes.structured import rename, tensor_mesh

    x, y = np.linspace(-width / 2, width / 2, count + 1), np.linspace(low, low + 1, count + 1)
    if not unstructured:
        return rename(tensor_mesh(x, y), bottom="y-", top="y+")
    from scipy.spatial import Delaunay

    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    h = np.array([x[1] - x[0], y[1] - y[0]])
    # inner nodes move both ways, those of the sides along the side
    nodes[1:-1, :, 0] += 0.3 * h[0] * rng.uniform(-1, 1, nodes[1:-1, :, 0].shape)
    nodes[:, 1:-1, 1] += 0.3 * h[1] * rng.uniform(-1, 1, nodes[:, 1:-1, 1].shape)
    flat = nodes.reshape(-1, 2)
    cells = Delaunay(flat).simplices
    a, b = (flat[cells[:, i]] - flat[cells[:, 0]] for i in (1, 2))
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    cells = cells[area > 1e-6 * h.prod()]
    mesh = MeshTri(np.ascontiguousarray(flat.T), np.ascontiguousarray(cells.T))
    return mesh.with_boundaries(
        {"bottom": lambda p: p[1] < low + 1e-9, "top": lambda p: p[1] > low + 1 - 1e-9}
    )
