"""What a mesh file holds, in words that a scene file takes: bodies, boundaries and facing pairs."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh

from contactopt.bodies.elements import Faces
from contactopt.cards import count
from contactopt.checks import remembered
from contactopt.scenes.facing_boundaries import as_toml, facing_boundaries, usual_distance

UNITS = 'units = { length = "mm", stress = "MPa" }  # change it if the mesh has another'
DEGREE = 4  # of the quadrature of volumes and areas
DIGITS = 1e-5  # share of a size that is shown
SHAPE = 0.02  # by how much a boundary may be off a plane or a circle [of 1, of its radius]


def mesh_words(path: Path, meshes: Mapping[str | None, Any]) -> tuple[str, dict[str, Any]]:
    """The beginning of a scene file in TOML with sizes in comments, and the meshes by its names."""
    named = {re.sub(r"[^\w-]", "-", group or path.stem): mesh for group, mesh in meshes.items()}
    solid = any(len(mesh.p) == 3 for mesh in meshes.values())
    inside, side = ("volume", "area") if solid else ("area", "length")
    rings = any("axisymmetric" in remembered(mesh).values() for mesh in meshes.values())
    kind = "solid" if solid else "axisymmetric" if rings else "plane-strain"
    lines = [f'kind = "{kind}"', UNITS]
    for (name, mesh), group in zip(named.items(), meshes):
        size = np.abs(mesh.p).max()
        low, high = _place(mesh.p.min(axis=1), size), _place(mesh.p.max(axis=1), size)
        said = f"{count(mesh.nelements, 'element')}, {inside} {_measure(mesh)[0]:.5g}"
        lines += [f"\n[bodies.{name}]  # {said}", f"# from {low} to {high}", f'mesh = "{path}"']
        lines += [*([] if group is None else [f'group = "{group}"']), 'material = "steel"']
        for boundary, facets in (mesh.boundaries or {}).items():
            area, middle = _measure(mesh, np.asarray(facets))
            lines.append(
                f"# boundary {boundary!r}: {side} {area:.5g}, middle {_place(middle, size)}"
                + _shape(mesh, np.asarray(facets))
            )
    pairs = facing_boundaries(named, usual_distance(named)) if len(named) > 1 else []
    return "\n".join([*lines, *(["", as_toml(pairs, 0.3, "mm")] if pairs else [])]), named


def _place(x: np.ndarray, size: float = 1.0) -> str:
    """Coordinates in brackets; what is nothing beside the size is 0."""
    shown = np.where(np.abs(x) < DIGITS * size, 0.0, x)
    return "(" + ", ".join(f"{value:.5g}" for value in shown) + ")"


def _measure(mesh: Mesh, facets: np.ndarray | None = None) -> tuple[float, np.ndarray]:
    """Volume of a mesh, or area of facets, and the middle of it; edges are curved as they are."""
    from skfem.quadrature import get_quadrature

    mapping = mesh._mapping()
    if facets is None:
        X, W = get_quadrature(mesh.refdom, DEGREE)
        dx, x = np.abs(mapping.detDF(X)) * W, mapping.F(X)
    else:
        X, W = get_quadrature(mesh.brefdom, DEGREE)
        dx, x = np.abs(mapping.detDG(X, find=facets)) * W, mapping.G(X, find=facets)
    return float(dx.sum()), np.sum(x * dx, axis=(1, 2)) / dx.sum()


def _shape(mesh: Mesh, facets: np.ndarray) -> str:
    """The normal of a flat boundary, or the radius of a circle, cylinder or sphere."""
    from skfem.quadrature import get_quadrature

    at = Faces(mesh, facets, get_quadrature(mesh.brefdom, DEGREE)[0])
    x, n = (f.reshape(len(mesh.p), -1) for f in (at.places, at.normals))
    mean = n.mean(axis=1, keepdims=True)
    if np.abs(n - mean).max() < SHAPE:
        return f", normal {_place((mean / np.linalg.norm(mean)).ravel())}"
    values, axes = np.linalg.eigh(n @ n.T / n.shape[1])
    if len(n) == 3 and values[0] < SHAPE**2:
        x, n = (axes[:, 1:].T @ field for field in (x, n))
    x, n = x - x.mean(axis=1, keepdims=True), n - n.mean(axis=1, keepdims=True)
    radius = np.sum(x * n) / np.sum(n * n)
    if np.abs(x - radius * n).max() > SHAPE * abs(radius):
        return ""
    return f", radius {abs(radius):.4g}" + (", hollow" if radius < 0 else "")
