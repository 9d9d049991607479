"""Do contacts keep their areas and a uniform pressure, and Hertz and Persson their peaks, on meshes that nobody prepared?"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import skfem
from scipy.spatial.transform import Rotation
from skfem.quadrature import get_quadrature

from contactopt.bodies.elements import FACES
from contactopt.interface.faces import Faces, cross, faces_of
from contactopt.interface.mortar import mortar
from experiments.report import write

PAIRS = 1000
GAPS = (1e-4, 1e3)  # over the mean size of the facets
ELEMENTS = {  # kind of the body's elements -> those of its surface
    "RefTri": (skfem.ElementLineP1(), skfem.ElementLineP2()),
    "RefQuad": (skfem.ElementLineP1(), skfem.ElementLineP2()),
    "RefTet": (skfem.ElementTriP1(), skfem.ElementTriP2()),
    "RefHex": (skfem.ElementQuad1(), skfem.ElementQuad2()),
}


@dataclass(frozen=True)
class Shape:
    """A surface z = f(x): a slope, a curvature and waves, in every direction of x."""

    slope: np.ndarray
    curvature: np.ndarray
    waves: float

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return self.slope @ x + self.curvature @ x**2 / 2 + self.waves * np.sum(np.cos(5 * x), axis=0)


def grid(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Places between two ends: even, graded to one end, or at random."""
    n = int(rng.integers(2, 13))
    step = [np.ones(n), rng.uniform(1, 1.5) ** np.arange(n), rng.uniform(0.2, 1, n)][rng.integers(3)]
    return low + (high - low) * np.append(0, np.cumsum(step)) / step.sum()


def surface(rng: np.random.Generator, dim: int, ends: np.ndarray, shape: Any, up: bool) -> Faces:
    """A random mesh of a surface between `ends` (dim - 1, 2), lifted to z = shape(x); `up`: its body lies below."""
    kind, degree = str(rng.choice(["RefTri", "RefQuad"] if dim == 2 else ["RefTet", "RefHex"])), int(rng.integers(1, 3))
    if dim == 2:
        mesh = skfem.MeshLine(grid(rng, *ends[0]))
    else:
        mesh = (skfem.MeshTri if kind == "RefTet" else skfem.MeshQuad).init_tensor(*(grid(rng, *e) for e in ends))
        p, inner = mesh.p.copy(), mesh.interior_nodes()
        shortest = min(float(np.diff(np.unique(row)).min()) for row in p)
        p[:, inner] += rng.uniform(-0.2, 0.2, (2, len(inner))) * shortest
        mesh = type(mesh)(p, mesh.t)
    basis = skfem.Basis(mesh, ELEMENTS[kind][degree - 1])
    points = np.vstack([basis.doflocs, shape(basis.doflocs)])
    faces = basis.element_dofs.T
    outward = np.tile(np.eye(dim)[:, [-1]] * (1 if up else -1), len(faces))
    return faces_of("b", kind, degree, faces, outward, (1.0, False), points)


def integrals(own: Faces) -> np.ndarray:
    """Integrals of the shape functions of all nodes over the surface."""
    at, share = get_quadrature(FACES[own.kind][0], 12)
    count = len(own.faces)
    face, at = np.repeat(np.arange(count), len(share)), np.tile(at, count)
    measure = np.tile(share, count) * np.linalg.norm(cross(own.locations(face, at)[1]), axis=0)
    return np.bincount(own.faces[face].T.ravel(), (own.shapes(at) * measure).ravel(), own.points.shape[1])


def moved(rng: np.random.Generator, *sides: Faces) -> list[Faces]:
    """The surfaces turned, moved, and in another unit of length, all alike."""
    dim, unit = sides[0].dim, 10 ** rng.uniform(-6, 6)
    turn = Rotation.random(random_state=rng).as_matrix()
    if dim == 2:
        c, s = np.cos(angle := rng.uniform(0, 7)), np.sin(angle)
        turn = np.array([[c, -s], [s, c]])
    shift = rng.uniform(-10, 10, (dim, 1))
    return [replace(side, points=unit * (turn @ side.points + shift)) for side in sides]


def pair(seed: int) -> dict[str, Any]:
    """Areas and forces of uniform pressure where a random surface faces another one that covers it or parallels it."""
    rng = np.random.default_rng(seed)
    dim, flat = int(rng.integers(2, 4)), bool(rng.integers(2))
    parallel = flat and bool(rng.integers(2))
    bend, waves = (0.0, 0.0) if flat else rng.uniform(0, [0.6, 0.02])
    tilt = rng.uniform(-1, 1, dim - 1) * (0 if parallel else 3 if flat else 0.5)
    below = Shape(np.zeros(dim - 1), bend * rng.uniform(-1, 1, dim - 1), waves)
    above = Shape(tilt, bend * rng.uniform(-1, 1, dim - 1), waves)
    ends = np.array([[-0.5, 0.5]] * (dim - 1)) * rng.uniform(0.5, 1.0, (dim - 1, 1))
    own = surface(rng, dim, ends, below, True)
    ratio = float(np.exp(rng.uniform(*np.log(GAPS))))
    gap = ratio * float(np.ptp(ends, axis=1).mean()) / len(own.faces) ** (1 / (dim - 1))
    gap = gap if flat else min(gap, 0.5)  # beyond the centres of curvature nothing faces anything
    inside = np.stack(np.meshgrid(*(np.linspace(*e, 30) for e in ends))).reshape(dim - 1, -1)
    lift = gap + float(np.max(below(inside) - above(inside)))
    beside = parallel and bool(rng.integers(2))
    reach = ends + rng.uniform(-0.4, 0.4, (dim - 1, 1)) * beside if parallel else np.array([[-1.0, 1.0]] * (dim - 1))
    other = surface(rng, dim, reach, lambda x: above(x) + lift, False)
    common = np.minimum(ends, reach)[:, 1] - np.maximum(ends, reach)[:, 0]
    part = float(np.prod(common / np.ptp(ends, axis=1))) if beside else 1.0
    own, other = moved(rng, own, other)
    m = mortar(own, other, "upper") if rng.integers(2) else mortar(other, own, "lower")
    W = m.weights[m.own]
    exact = integrals(own)
    row = {"seed": seed, "dim": dim, "surfaces": "flat" if flat else "curved", "gap / facet": ratio}
    row["area"] = abs(m.areas.sum() / exact.sum() / part - 1)
    force = [np.abs(m.areas @ W - exact).max() / exact.mean()] if not beside else []
    if parallel and not beside:
        exact = integrals(other)
        force.append(np.abs(m.areas @ m.weights[1 - m.own] - exact).max() / exact.mean())
    places = [m.areas @ V @ s.points.T for V, s in zip(m.weights, (own, other) if m.own == 0 else (other, own))]
    return row | {"uniform pressure": max(force, default=0.0)}


def pairs(count: int) -> list[dict[str, Any]]:
    """The largest errors among random pairs of surfaces, by dimension and shape."""
    rows = [pair(seed) for seed in range(count)]
    made = []
    for dim in (2, 3):
        for kind in ("flat", "curved"):
            own = [row for row in rows if row["dim"] == dim and row["surfaces"] == kind]
            worst = {key: max((row[key] for row in own), default=0.0) for key in ("area", "uniform pressure")}
            made.append({"space": f"{dim}D", "surfaces": kind, "pairs": len(own)} | worst)
    return made
