"""Scenes on meshes that nobody prepared: Gmsh's, and structured ones shaken and renumbered. A few
regular ones are among them, which multigrid takes fewer cycles for.

A block is pressed and pushed on another one. Lengths have no unit here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt import Material, Part, Scene, Support, Traction, load_mesh
from contactopt.meshes.structured import graded, tensor_mesh

SOFT, HARD = Material(5.0, 0.3), Material(50.0, 0.3)
SHAKEN = 0.2  # way of a node inside, over the distance to its neighbour
COARSER = 1.17  # elements of the lower body over those of the upper one, where nodes do not match
HEIGHT, WIDER = 0.6, 1.3  # of both bodies; width of the lower one over that of the upper one
# of the elements away from the contact, in Gmsh's meshes and in structured ones
GMSH_GROWTH, GROWTH = 0.35, 1.35
SEED = 100


@dataclass(frozen=True)
class Case:
    """One scene; `size` is that of the elements at the contact, over its width."""

    kind: str
    source: str
    degree: int
    matching: bool
    size: float

    @property
    def name(self) -> str:
        match = "matching" if self.matching else "not matching"
        return f"{self.kind}, {self.source}, degree {self.degree}, {match}, {self.size:g}"


# kind, source, degree, matching -> sizes
SIZES = {
    ("plane-strain", "gmsh", 1, False): (0.02, 0.006, 0.003, 4e-4),
    ("plane-strain", "gmsh", 2, True): (0.01, 0.005),
    ("plane-strain", "shaken", 1, True): (0.015, 0.004, 6e-4),
    ("plane-strain", "shaken", 2, False): (0.02, 0.006),
    ("axisymmetric", "gmsh", 1, False): (0.012, 0.004),
    ("axisymmetric", "gmsh", 2, True): (0.012, 0.005),
    ("axisymmetric", "shaken", 2, False): (0.02, 0.006, 0.0015),
    ("plane-strain", "regular", 1, True): (0.01, 0.004),
    ("solid", "regular", 1, True): (0.08, 0.05, 0.022),
    ("solid", "gmsh", 1, False): (0.1, 0.06, 0.05, 0.04),
    ("solid", "gmsh", 1, True): (0.07, 0.045, 0.015),
    ("solid", "gmsh", 2, False): (0.18, 0.12),
    ("solid", "gmsh", 2, True): (0.15,),
    ("solid", "shaken", 1, True): (0.09, 0.05, 0.025),
    ("solid", "shaken", 1, False): (0.08, 0.06),
    ("solid", "shaken", 2, False): (0.17, 0.1, 0.05),
}


def cases() -> list[Case]:
    """All scenes, the small ones first."""
    found = [Case(*kind, size) for kind, sizes in SIZES.items() for size in sizes]
    return sorted(found, key=lambda case: -case.size)


def scene(case: Case) -> Scene:
    """The scene of a case: mu is 0.3, and the upper body floats."""
    dim, wider = 3 if case.kind == "solid" else 2, 1.0 if case.matching else WIDER
    coarse = case.size * (1.0 if case.matching else COARSER)
    if case.source in ("regular", "shaken"):
        upper = _structured(dim, 1.0, HEIGHT, case.size)
        lower = _structured(dim, wider, -HEIGHT, coarse)
        if case.source == "shaken":
            upper, lower = _shaken(upper, SEED), _shaken(lower, SEED + 1)
    else:
        upper = _gmsh("taper", dim, 1.0, HEIGHT, case.size)
        lower = _renumbered(_moved(upper, mirrored=True), SEED)
        if not case.matching:
            lower = _gmsh("block", dim, wider, -HEIGHT, coarse)
    axis = case.kind == "axisymmetric"
    upper = _moved(upper, shift=0.0 if axis else (wider - 1.0) / 2)
    supports = (Support("axis", {"r": 0.0}),) if axis else ()
    push = (0.0, -1.0) if axis else (0.15, *(0.05,) * (dim - 2), -1.0)
    pressed = (Traction("top", push),)
    bodies = (
        Part("upper", _named(upper), HARD, supports, pressed, contact="bottom"),
        Part("lower", _named(lower), SOFT, (*supports, Support("bottom")), contact="top"),
    )
    return Scene(case.name, *bodies, 0.3, kind=case.kind, degree=case.degree)


def _structured(dim: int, width: float, height: float, size: float) -> Any:
    """Rectangles or bricks, whose height grows away from the contact."""
    flat = np.linspace(0, width, max(2, round(width / size)) + 1)
    rise = graded(abs(height), size, GROWTH)
    return tensor_mesh(*[flat] * (dim - 1), rise if height > 0 else -rise[::-1])


def _shaken(mesh: Any, seed: int) -> Any:
    """Triangles or tetrahedra of a structured mesh, whose inner nodes are moved at random."""
    mesh = mesh.to_meshtri() if len(mesh.p) == 2 else mesh.to_meshtet()
    points, inside = mesh.p.copy(), np.setdiff1d(np.arange(mesh.nvertices), mesh.boundary_nodes())
    near = KDTree(points.T).query(points.T, 2)[0][inside, 1]
    rng = np.random.default_rng(seed)
    points[:, inside] += SHAKEN * near * rng.uniform(-1, 1, (len(points), len(inside)))
    return _renumbered(type(mesh)(points, mesh.t), seed)


def _gmsh(shape: str, dim: int, width: float, height: float, size: float) -> Any:
    """Gmsh's mesh of a block, or of one that is narrower, in space round, away from the contact."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ, low, half = gmsh.model.occ, min(0.0, height), width / 2
        if dim == 3 and shape == "block":
            occ.addBox(0, 0, low, width, width, abs(height))
        elif dim == 3:
            occ.addCone(half, half, 0, 0, 0, height, half, 0.8 * half)
        else:
            end = width if shape == "block" else 0.7 * width
            corners = (0, 0), (width, 0), (end, height), (0, height)
            points = [occ.addPoint(x, y, 0) for x, y in corners]
            lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1])]
            occ.addPlaneSurface([occ.addCurveLoop(lines)])
        occ.synchronize()
        field = gmsh.model.mesh.field
        number = field.add("MathEval")
        field.setString(number, "F", f"{size}+{GMSH_GROWTH}*abs({'xyz'[dim - 1]})")
        field.setAsBackgroundMesh(number)
        for source in ("ExtendFromBoundary", "FromPoints"):
            gmsh.option.setNumber(f"Mesh.MeshSize{source}", 0)
        gmsh.model.addPhysicalGroup(dim, [1], name="body")
        gmsh.model.mesh.generate(dim)
        with TemporaryDirectory() as folder:
            gmsh.write(f"{folder}/body.msh")
            return load_mesh(Path(folder) / "body.msh")
    finally:
        gmsh.finalize()


def _moved(mesh: Any, shift: float = 0.0, mirrored: bool = False) -> Any:
    """The mesh shifted along the contact, or its mirror image beyond the contact."""
    points = mesh.p.copy()
    points[:-1] += shift
    points[-1] *= -1 if mirrored else 1
    order = [1, 0, *range(2, len(mesh.t))] if mirrored else slice(None)
    return type(mesh)(points, np.ascontiguousarray(mesh.t[order]))


def _renumbered(mesh: Any, seed: int) -> Any:
    place = np.random.default_rng(seed).permutation(mesh.nvertices)
    points = np.empty_like(mesh.p)
    points[:, place] = mesh.p
    return type(mesh)(points, np.ascontiguousarray(place[mesh.t]))


def _named(mesh: Any) -> Any:
    """The mesh with its lower and upper side and the side on the axis named."""
    facets = mesh.boundary_facets()
    x, z = mesh.p[:, mesh.facets[:, facets]][[0, -1]]
    level = {"bottom": (z, z.min()), "top": (z, z.max()), "axis": (x, 0.0)}
    sides = {
        name: facets[np.all(np.abs(at - place) < 1e-6, axis=0)]
        for name, (at, place) in level.items()
    }
    return mesh.with_boundaries(sides)


def warm() -> Iterator[Scene]:
    """Small scenes whose solution imports what is imported late."""
    for kind in ("plane-strain", "solid"):
        yield scene(Case(kind, "gmsh", 1, False, 0.25))
