"""Do contacts keep areas, even pressure and exact peaks on meshes that nobody prepared?"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from tempfile import TemporaryDirectory
from typing import Any

import gmsh
import numpy as np
import skfem
from scipy.spatial.transform import Rotation
from skfem.quadrature import get_quadrature

from contactopt import BodyForce, Material, Part, Scene, Support, load_mesh, reduce_bodies, solve
from contactopt.analytic import Reference, contact_modulus, hertz_line, hertz_point, pin_in_hole
from contactopt.bodies.elements import FACES
from contactopt.coupling.faces import Faces, cross, faces_of
from contactopt.coupling.mortar import mortar
from experiments.report import markdown, template, write

PAIRS = 1000
SHAPES, MESHES = ("roller", "ball", "pin"), 30
FACETS = (8.0, 20.0)  # on the half-width of contact, on either side
LIMITS = {"peak at a node": 0.015, "peak": 0.015, "half-width": 0.02}
CLEARANCE = 1e-3  # of the pin, over its radius
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
        return (
            self.slope @ x + self.curvature @ x**2 / 2 + self.waves * np.sum(np.cos(5 * x), axis=0)
        )


def grid(rng: np.random.Generator, low: float, high: float) -> np.ndarray:
    """Places between two ends: even, graded to one end, or at random."""
    n = int(rng.integers(2, 13))
    step = [np.ones(n), rng.uniform(1, 1.5) ** np.arange(n), rng.uniform(0.2, 1, n)][
        rng.integers(3)
    ]
    return low + (high - low) * np.append(0, np.cumsum(step)) / step.sum()


def surface(rng: np.random.Generator, dim: int, ends: np.ndarray, shape: Any, up: bool) -> Faces:
    """A random mesh of a surface between `ends`, at z = shape(x); `up`: its body lies below."""
    kind = str(rng.choice(["RefTri", "RefQuad"] if dim == 2 else ["RefTet", "RefHex"]))
    degree = int(rng.integers(1, 3))
    if dim == 2:
        mesh = skfem.MeshLine(grid(rng, *ends[0]))
    else:
        mesh = (skfem.MeshTri if kind == "RefTet" else skfem.MeshQuad).init_tensor(
            *(grid(rng, *e) for e in ends)
        )
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
    return np.bincount(
        own.faces[face].T.ravel(), (own.shapes(at) * measure).ravel(), own.points.shape[1]
    )


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
    """Areas and forces of uniform pressure where a random surface faces another one."""
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
    reach = (
        ends + rng.uniform(-0.4, 0.4, (dim - 1, 1)) * beside
        if parallel
        else np.array([[-1.0, 1.0]] * (dim - 1))
    )
    other = surface(rng, dim, reach, lambda x: above(x) + lift, False)
    common = np.minimum(ends, reach)[:, 1] - np.maximum(ends, reach)[:, 0]
    part = float(np.prod(common / np.ptp(ends, axis=1))) if beside else 1.0
    own, other = moved(rng, own, other)
    m = mortar(own, other, "upper") if rng.integers(2) else mortar(other, own, "lower")
    W = m.weights[m.own]
    exact = integrals(own)
    row = {"seed": seed, "dim": dim, "surfaces": "flat" if flat else "curved", "gap / facet": ratio}
    row["area"] = float(abs(m.areas.sum() / exact.sum() / part - 1))
    row["share"] = float(np.abs(m.share - 1).max()) if not beside else 0.0
    force = [np.abs(m.areas @ W - exact).max() / exact.mean()] if not beside else []
    if parallel and not beside:
        exact = integrals(other)
        force.append(np.abs(m.areas @ m.weights[1 - m.own] - exact).max() / exact.mean())
    return row | {"uniform pressure": max(force, default=0.0)}


def pairs(count: int) -> list[dict[str, Any]]:
    """The largest errors among random pairs of surfaces, by dimension and shape."""
    rows = [pair(seed) for seed in range(count)]
    made = []
    for dim in (2, 3):
        for kind in ("flat", "curved"):
            own = [row for row in rows if row["dim"] == dim and row["surfaces"] == kind]
            worst = {
                key: max((row[key] for row in own), default=0.0)
                for key in ("area", "share", "uniform pressure")
            }
            made.append({"space": f"{dim}D", "surfaces": kind, "pairs": len(own)} | worst)
    return made


def meshed(
    rng: np.random.Generator, build: Any, side: Any, sizes: tuple[float, float, float], order: int
) -> Any:
    """A mesh by one of Gmsh's methods, of elements of the first size up to the distance of the
    third, then growing up to
    the second; `side` (x, y) names the boundaries.
    """
    fine, coarse, reach = sizes
    options = {
        "General.Terminal": 0,
        "Mesh.RandomSeed": rng.uniform(0.5, 2),
        "Mesh.Algorithm": rng.choice([1, 5, 6, 8]),
    }
    options |= {
        "Mesh.RecombineAll": rng.integers(2),
        "Mesh.RecombinationAlgorithm": 3,
        "Mesh.ElementOrder": order,
    }
    gmsh.initialize(interruptible=False)
    try:
        for key, value in (
            options | {"Mesh.MeshSizeExtendFromBoundary": 0, "Mesh.MeshSizeFromPoints": 0}
        ).items():
            gmsh.option.setNumber(key, float(value))
        body = build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        grow, field = rng.uniform(0.15, 0.35), gmsh.model.mesh.field
        number = field.add("MathEval")
        away = f"(Sqrt(x^2 + y^2) - {reach})"
        field.setString(number, "F", f"Min({coarse}, {fine} + {grow} * ({away} + Abs({away})) / 2)")
        field.setAsBackgroundMesh(number)
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in body], name="body")
        sides: dict[str, list[int]] = {}
        for _, line in gmsh.model.getBoundary(body, oriented=False):
            x, y, _ = gmsh.model.occ.getCenterOfMass(1, line)
            sides.setdefault("axis" if abs(x) < 1e-6 * reach else side(x, y), []).append(line)
        for name, lines in sides.items():
            gmsh.model.addPhysicalGroup(1, lines, name=name)
        gmsh.model.mesh.generate(2)
        with TemporaryDirectory() as folder:
            gmsh.write(f"{folder}/body.msh")
            return load_mesh(f"{folder}/body.msh")
    finally:
        gmsh.finalize()


def half_disc(occ: Any, y: float, radius: float) -> list[tuple[int, int]]:
    right = [(2, occ.addRectangle(0, y - 2 * radius, 0, 2 * radius, 4 * radius))]
    return list(occ.intersect([(2, occ.addDisk(0, y, 0, radius, radius))], right)[0])


def circle(y: float, radius: float) -> Any:
    """The function that puts points on a circle."""
    middle = np.array([[0.0], [y]])
    return lambda x: middle + radius * (x - middle) / np.linalg.norm(x - middle, axis=0)


@dataclass(frozen=True)
class Case:
    """A round body of radius R, above (up = 1) or below another one, and what is exact."""

    shape: str
    radius: float
    up: float
    force: float
    exact: Reference
    materials: tuple[Material, Material]


def case(shape: str, rng: np.random.Generator) -> Case:
    """A roller or a ball with a small contact, or a pin that fills up to a third of its hole."""
    radius, steel = float(10 ** rng.uniform(-1, 2)), Material(210e3, 0.3)
    soft = steel if shape == "pin" else Material(steel.E * 10 ** rng.uniform(-0.5, 0.5), 0.3)
    modulus, a = contact_modulus(steel, soft), radius * rng.uniform(0.02, 0.05)
    if shape == "pin":
        force = modulus * CLEARANCE * radius * 10 ** rng.uniform(-1, 0.3)
        exact = pin_in_hole(force, radius, CLEARANCE * radius, modulus)
    elif shape == "roller":
        force = np.pi * a**2 * modulus / (4 * radius)
        exact = hertz_line(force, radius, modulus)
    else:
        force = 4 * a**3 * modulus / (3 * radius)
        exact = hertz_point(force, radius, modulus)
    return Case(shape, radius, float(rng.choice([-1, 1])), force, exact, (steel, soft))


def scene(one: Case, rng: np.random.Generator) -> tuple[Scene, dict[str, Any]]:
    """Half of both bodies, meshed apart from each other."""
    R, up, pin, a = one.radius, one.up, one.shape == "pin", one.exact.half_width
    order, degree = (int(rng.integers(1, 3)) for _ in range(2))
    fine = a / rng.uniform(*FACETS, 2)
    r, wide = (R * (1 - CLEARANCE), 30 * R) if pin else (R, 4 * R)

    def plate(occ: Any) -> Any:
        if pin:
            return occ.cut(half_disc(occ, up * R, wide), [(2, occ.addDisk(0, up * R, 0, R, R))])[0]
        return [(2, occ.addRectangle(0, -wide if up > 0 else 0, 0, wide, wide))]

    def side(x: float, y: float) -> str:
        if pin:
            return "contact" if np.hypot(x, y - up * R) < 2 * R else "far"
        return "contact" if abs(y) < 1e-6 * R else "side" if abs(x - wide) < 1e-6 * R else "far"

    disc = meshed(
        rng,
        lambda occ: half_disc(occ, up * r, r),
        lambda x, y: "contact",
        (fine[0], r / 5, 1.3 * a),
        order,
    )
    base = meshed(rng, plate, side, (fine[1], wide / 5, 1.3 * a), order)
    volume = 4 / 3 * np.pi * r**3 if one.shape == "ball" else np.pi * r**2 / 2
    across = "r" if one.shape == "ball" else "x"
    share = 1.0 if one.shape == "ball" else 0.5
    hold = Support("axis", {across: 0.0})
    push = BodyForce((0.0, -up * share * one.force / volume))
    bodies = (
        Part("disc", disc, one.materials[0], (hold,), (push,), "contact", circle(up * r, r)),
        Part(
            "base",
            base,
            one.materials[1],
            (hold, Support("far")),
            (),
            "contact",
            circle(up * R, R) if pin else None,
        ),
    )
    kind = "axisymmetric" if one.shape == "ball" else "plane-strain"
    made = Scene(
        one.shape,
        *(bodies if up > 0 else bodies[::-1]),
        0.0,
        kind=kind,
        degree=degree,
        law="frictionless",
    )
    return made, {
        "order": order,
        "degree": degree,
        "facets": f"{a / fine[0]:.0f}, {a / fine[1]:.0f}",
    }


def read(x: np.ndarray, p: np.ndarray, areas: np.ndarray, terms: int) -> tuple[float, float]:
    """Peak and half-width where p^2 is a polynomial in x^2, fitted where p is not small."""
    inside = (p > 0.15 * p.max()) & (areas > 0)
    A = np.vander((x[inside] / x[inside].max()) ** 2, terms, increasing=True)
    c = np.linalg.lstsq(A * areas[inside, None], p[inside] ** 2 * areas[inside], rcond=None)[0]
    roots = np.roots(c[::-1])
    end = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.8)].real.min(initial=np.inf)
    return float(np.sqrt(c[0])), float(np.sqrt(end) * x[inside].max())


def mesh(shape: str, seed: int) -> dict[str, Any]:
    """Errors of the peak and of the half-width on two meshes that know nothing of each other."""
    rng = np.random.default_rng([seed, *shape.encode()])
    one = case(shape, rng)
    made, row = scene(one, rng)
    reduction = reduce_bodies(made)
    problem, solution = reduction.problem, solve(reduction.problem)
    place = reduction.coupling.positions
    x = (
        one.radius * np.arctan2(place[0], one.radius - one.up * place[1])
        if shape == "pin"
        else place[0]
    )
    area = problem.areas
    p = np.divide(solution.reactions[:, 0], area, out=np.zeros_like(area), where=area > 0)
    row = {"shape": shape, "seed": seed, "carrier": reduction.coupling.carrier} | row
    row |= {"status": solution.status.label, "contacts": problem.contacts}
    terms = 3 if shape == "pin" else 2
    peak, width = read(x, p, area, terms)
    known = read(x, np.nan_to_num(one.exact.pressure(x)), area, terms)
    row["peak at a node"] = float(p.max()) / one.exact.peak - 1
    row |= {"peak": peak / one.exact.peak - 1, "half-width": width / one.exact.half_width - 1}
    return row | {
        "reading": max(abs(known[0] / one.exact.peak - 1), abs(known[1] / one.exact.half_width - 1))
    }


def meshes(count: int) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The largest errors by shape and degree, and all rows that miss a limit."""
    rows = [mesh(shape, seed) for shape in SHAPES for seed in range(count)]
    worst = []
    for shape in SHAPES:
        for degree in (1, 2):
            own = [row for row in rows if row["shape"] == shape and row["degree"] == degree]
            largest = {
                key: max((abs(row[key]) for row in own), default=0.0)
                for key in (*LIMITS, "reading")
            }
            worst.append({"shape": shape, "degree": degree, "meshes": len(own)} | largest)
    missed = [row for row in rows if any(abs(row[key]) > limit for key, limit in LIMITS.items())]
    return worst, missed or [{"shape": "none"}]


TEXT = template(__file__)


def main(count: int, each: int, quick: bool) -> None:
    """Measure and write the report; `quick` prints the tables only."""
    worst, missed = meshes(each)
    tables = {"pairs": pairs(count), "meshes": worst, "missed": missed}
    if quick:
        print("\n\n".join(map(markdown, tables.values())))
        return
    title = "Surfaces that face each other: areas, patch test, and exact pressures"
    write("facing_surfaces", title, TEXT.format(count=count, meshes=each), tables, {})


if __name__ == "__main__":
    quick = "--quick" in sys.argv
    main(*((20, 1) if quick else (PAIRS, MESHES)), quick)
