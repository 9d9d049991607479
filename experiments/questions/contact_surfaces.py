"""Does `laplacian` fit contact surfaces of any shape, meshed by triangles, and bodies of any ratio
of stiffness?

`python -m experiments.questions.contact_surfaces` makes the tables and the report; it needs the
package gmsh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import gmsh
import numpy as np
from skfem import MeshQuad, MeshTet

from contactopt import InterfaceProblem, Material, Part, Scene, Support, reduce_bodies
from contactopt.meshes.polar import ring
from contactopt.meshes.structured import graded
from contactopt.methods.preconditioners import deflated, preconditioner, smooth_motions
from experiments.questions.preconditioners import condition, iterations
from experiments.report import measure, template

POISSON, HEIGHT, GROWTH = 0.3, 1.0, 1.3
RATIOS = (1e-4, 1.0, 1e4)  # stiffness of the lower body over that of the upper one
SIZES = (0.3, 0.13)  # of the triangles
FINER = 0.075  # on the first two surfaces, at a ratio of one
AROUND = (100, 1000)  # nodes of the ring
UPPER, LOWER = 1.0, -1.0


def disc() -> None:
    gmsh.model.occ.addDisk(0, 0, 0, 1, 1)


def ellipse() -> None:
    gmsh.model.occ.addDisk(0, 0, 0, 1, 0.4)


def square() -> None:
    gmsh.model.occ.addRectangle(-1, -1, 0, 2, 2)


def cut(whole: Callable[[], None], hole: Callable[[], int]) -> Callable[[], None]:
    def make() -> None:
        whole()
        gmsh.model.occ.cut([(2, 1)], [(2, hole())])

    return make


# name -> (how gmsh makes it, size of the triangles at a place over the largest one)
SURFACES: dict[str, tuple[Callable[[], None], Callable[[float, float], float]]] = {
    "disc (fitted on)": (disc, lambda x, y: 1.0),
    "L-shape": (
        cut(square, lambda: int(gmsh.model.occ.addRectangle(0, 0, 0, 1, 1))),
        lambda x, y: 1.0,
    ),
    "annulus": (
        cut(disc, lambda: int(gmsh.model.occ.addDisk(0, 0, 0, 0.5, 0.5))),
        lambda x, y: 1.0,
    ),
    "ellipse": (ellipse, lambda x, y: 0.7),
    "square, graded 1:20 to a corner": (
        square,
        lambda x, y: max(np.hypot(x + 1, y + 1) / np.sqrt(8), 0.05) * 2.6,
    ),
}


def triangles(name: str, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (2, k) and triangles (3, c) of a surface."""
    make, share = SURFACES[name]
    gmsh.initialize(interruptible=False)
    try:
        for option, value in (
            ("General.Terminal", 0),
            ("Mesh.MeshSizeExtendFromBoundary", 0),
            ("Mesh.RandomSeed", 1),
        ):
            gmsh.option.setNumber(option, value)
        make()
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, given: size * share(x, y))
        gmsh.model.mesh.generate(2)
        tags, x, _ = gmsh.model.mesh.getNodes()
        corners = gmsh.model.mesh.getElements(2)[2][0]
    finally:
        gmsh.finalize()
    used, cells = np.unique(corners, return_inverse=True)
    place = {tag: i for i, tag in enumerate(tags)}
    return x.reshape(-1, 3)[[place[tag] for tag in used], :2].T, cells.reshape(-1, 3).T


def extruded(points: np.ndarray, cells: np.ndarray, levels: np.ndarray) -> MeshTet:
    """Prisms over triangles, each cut into three tetrahedra; sorted corners make them agree."""
    k, cells = points.shape[1], np.sort(cells, axis=0)
    p = np.concatenate([np.concatenate([points, np.full((1, k), z)]) for z in levels], axis=1)
    tetrahedra = []
    for i in range(len(levels) - 1):
        a, b, c = cells + i * k
        A, B, C = cells + (i + 1) * k
        tetrahedra += [np.stack([a, b, c, C]), np.stack([a, b, B, C]), np.stack([a, A, B, C])]
    return MeshTet(p, np.concatenate(tetrahedra, axis=1)).oriented()


def stubs(name: str, size: float) -> Scene:
    """Two stubs on each other along a surface, held at their far ends.

    The first layer is as thick as the smallest triangle.
    """
    points, cells = triangles(name, size)
    edge = points[:, cells[1]] - points[:, cells[0]]
    levels = graded(HEIGHT, float(np.linalg.norm(edge, axis=0).min()), GROWTH)

    def part(name: str, side: float) -> Part:
        mesh = extruded(points, cells, side * levels).with_boundaries(
            {
                "contact": lambda x: np.abs(x[2]) < 1e-9,
                "far": lambda x: np.abs(x[2]) > HEIGHT - 1e-9,
            }
        )
        return Part(name, mesh, Material(1.0, POISSON), (Support("far"),))

    return Scene("stubs", part("upper", UPPER), part("lower", LOWER), 0.5, kind="solid")


def around(n: int) -> Scene:
    """A pin in a bush, both held far from the contact, with n nodes around."""
    angles, rise = np.linspace(0, 2 * np.pi, n + 1), graded(1.0, 2 * np.pi / n, 1.4)

    def part(name: str, radii: np.ndarray, **sides: str) -> Part:
        made = ring(radii, angles)
        mesh = MeshQuad(made.p[:, : made.nvertices], made.t)  # its edges are straight
        mesh = mesh.with_boundaries({new: made.boundaries[old] for new, old in sides.items()})
        return Part(name, mesh, Material(1.0, POISSON), (Support("far"),))

    pin = part("pin", 1 - 0.8 * rise[::-1], contact="outer", far="inner")
    return Scene("ring", pin, part("bush", 1 + rise, contact="inner", far="outer"), 0.5)


def pairs(scene: Scene, ratios: tuple[float, ...]) -> Iterator[tuple[float, InterfaceProblem]]:
    """The problem with a lower body of every ratio; its bodies are reduced once."""
    reduction = reduce_bodies(scene, Q="explicit")
    upper, lower = (body.compliance(B) for body, B in zip(reduction.bodies, reduction.maps))
    for ratio in ratios:
        yield ratio, replace(reduction.problem, Q=upper + lower / ratio)


def judge(name: str, ratio: float, problem: InterfaceProblem) -> dict[str, object]:
    P = preconditioner(problem, "laplacian")
    D = deflated(P, problem.Q, smooth_motions(problem))
    row = {
        "surface": name,
        "contacts": problem.contacts,
        "ratio": ratio,
        "none: iterations": iterations(None, problem.Q),
    }
    for title, chosen in (("laplacian", P), ("deflated", D)):
        row |= {
            f"{title}: condition": condition(chosen, problem.Q),
            f"{title}: iterations": iterations(chosen, problem.Q),
        }
    return row


def rows() -> list[dict[str, object]]:
    made = []
    for i, name in enumerate(SURFACES):
        for size in SIZES:
            made += [judge(name, *pair) for pair in pairs(stubs(name, size), RATIOS)]
        if i < 2:
            made += [judge(name, *pair) for pair in pairs(stubs(name, FINER), RATIOS[1:2])]
    for n in AROUND:
        made += [judge("closed ring, in the plane", *pair) for pair in pairs(around(n), RATIOS)]
    return made


if __name__ == "__main__":
    title = "`laplacian` on contact surfaces of any shape"
    measure("contact_surfaces", title, template(__file__), {"rows": rows})
