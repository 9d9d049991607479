"""Is the guaranteed bound of the error never violated, how much larger than the error is it, and
what does it cost?

The exact solution is known for one family of scenes, a column under its own weight between smooth
walls. For all others its place is taken by quadratic displacements on meshes whose elements have a
quarter of the size (a half of it in space). Their distance from the solution is at most the
distance of the exact one plus their own error, which has a bound as well. So a bound is proved to
be violated if it is less than that distance minus the bound of the fine solution, and it counts
here as violated if it is less than the distance itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem
from scipy.linalg import eigh, null_space
from scipy.sparse.linalg import splu
from skfem.models.elasticity import lame_parameters, linear_elasticity
from skfem.refdom import RefQuad

from contactopt import Material
from contactopt.accuracy.loop import refine
from contactopt.bounds.bound import Bound
from contactopt.bounds.composite_element import WEIGHT, reference_stress
from contactopt.bounds.displaced_stress import bilinear, halved
from contactopt.bounds.equilibrium_elements import EquilibriumElements
from contactopt.bounds.interval import interval
from contactopt.bounds.simplices import Simplices
from contactopt.bounds.tetrahedra import Tetrahedra
from contactopt.bounds.uneven_traction import CONSTANT, regular_tetrahedron
from contactopt.derivatives.interface import CERTIFIED
from contactopt.errors import InputError
from contactopt.figures.style import COLOURS, LETTERS, MARKS, add_legend, paper_axes
from contactopt.meshes.cells import measures
from contactopt.meshes.mesh_refinement import split
from contactopt.methods.diagnosis import diagnose
from contactopt.readings.quantities import find_quantity, value_of
from contactopt.scenes import make_scene
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce, Part, Plate, Rigid, Scene, Support, Traction
from contactopt.solving.limits import Limits
from contactopt.solving.solve_scene import Options, Solved, solve_scene
from experiments.report import measure, template

LAWS = (("frictionless", 0.0), ("tresca", 10.0), ("coulomb", 0.3))
COARSE, FINER = {2: 6, 3: 3}, {2: 2, 3: 1}  # elements along an edge, and halvings of the reference
NAMED = 4  # elements across the half-width of contact of named scenes
SOFT, STIFF = 1000.0, 3000.0  # Young's moduli [stress]
ANY = 1.0  # a residual that the first step of a solver has
REPEATED = 3


def box(dim: int, n: int, up: float, seed: int, across: int = 1) -> Any:
    """A unit cube above (up = 1) or below (-1) the plane of contact, whose inner nodes are moved at
    random; elements are `across` times as long up as they are wide.
    """
    ticks = [np.linspace(0, 1, n + 1)] * (dim - 1)
    kind = skfem.MeshTri if dim == 2 else skfem.MeshTet
    mesh = kind.init_tensor(*ticks, up * np.linspace(0, 1, n // across + 1))
    p, shake = mesh.p.copy(), 0.15 / n * (across == 1)
    inner = np.all((np.abs(p) > 1e-9) & (np.abs(p) < 1 - 1e-9), axis=0)
    p[:, inner] += shake * np.random.default_rng(seed).uniform(-1, 1, p[:, inner].shape)
    names: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "contact": lambda x: np.abs(x[-1]) < 1e-9,
        "far": lambda x: np.abs(x[-1] - up) < 1e-9,
        "right": lambda x: np.abs(x[0] - 1) < 1e-9,
        "left": lambda x: np.abs(x[0]) < 1e-9,
    }
    if dim == 3:
        names["front"] = lambda x: np.abs(x[1]) < 1e-9
    return kind(p, mesh.t).with_boundaries(names)


def held(dim: int, load: str, up: str) -> dict[str, tuple[Any, ...]]:
    """Supports and loads of the upper body."""
    planes = (Support("left", {"x": 0.0}), Support("front", {"y": 0.0}))[: dim - 1]
    wall = (*planes, Support("right"))
    return {
        "pushed": {"supports": (*planes, Support("far", {"x": 0.0, up: -0.1}))},
        "plate": {"supports": planes, "loads": (Plate("far", {up: -100.0}),)},
        "pressed": {"supports": wall, "loads": (Traction("far", (0.0, -100.0)),)},
        "heavy": {"supports": wall, "loads": (BodyForce((0.0, -150.0)),)},
        "sheared": {"supports": (Support("far", {"x": 0.05, up: -0.1}),)},
    }[load]


def on_floor(
    load: str, degree: int, law: str, mu: float, dim: int = 2, nu: float = 0.3, across: int = 1
) -> Scene:
    """A block on a rigid floor that curves away from it."""
    up = "xyz"[dim - 1]
    mesh = box(dim, COARSE[dim] * (2 if across > 1 else 1), 1.0, 0, across)
    floor = Rigid("floor", normal=(0.0,) * (dim - 1) + (1.0,), gap=rounded)
    block = Part("block", mesh, Material(SOFT, nu), **held(dim, load, up))
    kind = "plane-strain" if dim == 2 else "solid"
    return Scene(f"{load}, floor", block, floor, mu, kind, law=law, degree=degree)


def rounded(x: np.ndarray) -> np.ndarray:
    return np.asarray(0.1 * np.sum(x[:-1] ** 2, axis=0))


def two_blocks(
    load: str,
    degree: int,
    law: str,
    mu: float,
    dim: int = 2,
    below: int | None = None,
    wide: float = 1.0,
) -> Scene:
    """Two blocks, the upper one with a lower side that is bent upwards (in space flat), joined by
    mortar if a number of elements `below` is given; in space the upper one may be less `wide`.
    """
    up, number = "xyz"[dim - 1], (COARSE[dim], below or COARSE[dim])
    upper, lower = (box(dim, n, sign, seed) for n, sign, seed in zip(number, (1.0, -1.0), (1, 2)))
    if dim == 2:
        p = upper.p.copy()
        p[1] += 0.05 * p[0] ** 2 * (1 - p[1])
        upper = replace(upper, doflocs=p)
    elif wide < 1:
        upper = replace(upper, doflocs=upper.p * np.array([[wide], [wide], [1.0]]))
    planes = (Support("left", {"x": 0.0}), Support("front", {"y": 0.0}))[: dim - 1]
    top = Part("upper", upper, Material(SOFT, 0.3), **held(dim, load, up))
    free = load == "sheared"
    bottom = Part("lower", lower, Material(STIFF, 0.3), ((), planes)[not free] + (Support("far"),))
    kind = "plane-strain" if dim == 2 else "solid"
    carrier = "upper" if wide < 1 else None
    contact = Contact(
        "upper", "lower", mu, law, coupling="mortar" if below else "auto", carrier=carrier
    )
    name = f"{load}, " + (f"mortar {number[0]} on {below}" if below else "two blocks")
    name += (", narrower" if wide < 1 else "") + (", space" if dim == 3 else "")
    return Scene(name, kind=kind, bodies=(top, bottom), contacts=(contact,), degree=degree)


def scenes() -> Iterator[Scene]:
    """The cases."""
    for degree in (1, 2):
        for law in LAWS:
            for load in ("pushed", "plate", "pressed", "heavy", "sheared"):
                yield on_floor(load, degree, *law)
            for load in ("pushed", "plate", "sheared"):
                yield two_blocks(load, degree, *law)
            yield two_blocks("pushed", degree, *law, below=7)
            yield two_blocks("plate", degree, *law, below=4)
            yield replace(on_floor("pressed", degree, *law, nu=0.48), name="nu = 0.48, floor")
            yield replace(on_floor("pushed", degree, *law, across=4), name="long elements, floor")
            yield replace(on_floor("plate", degree, *law, dim=3), name="plate, floor, space")
            yield two_blocks("pushed", degree, *law, dim=3, below=4)
            yield two_blocks("plate", degree, *law, dim=3, below=2)
            yield two_blocks("pushed", degree, *law, dim=3, below=4, wide=0.63)
        yield two_blocks("pushed", degree, *LAWS[1], dim=3)
        for law in LAWS:
            for load in ("pushed", "plate", "pressed", "heavy"):
                yield revolved(on_floor(load, degree, *law), "disc")
            yield revolved(two_blocks("pushed", degree, *law), "discs")
            yield revolved(two_blocks("sheared", degree, *law), "rings", 0.5)
            yield revolved(two_blocks("pushed", degree, *law, below=7), "mortar of rings", 0.5)
            yield revolved(two_blocks("plate", degree, *law, below=4), "mortar of discs")
        for name in ("stack", "arch", "cylinder-2d", "sphere"):
            yield of_straight_edges(make_scene(name, simplices=True, degree=degree))
    for name in ("punch-2d", "cylinder-2d", "sphere"):
        for mu in (0.0, 0.5):
            scene = make_scene(name, mu=mu)
            yield replace(of_straight_edges(scene), name=f"{name}, quadrilaterals, mu = {mu:g}")


def revolved(scene: Scene, name: str, inner: float = 0.0) -> Scene:
    """A plane scene turned about an axis at the left, or a distance away from it."""

    def about(given: Any) -> Any:
        if given is None:
            return None
        return {{"x": "r", "y": "z"}[key]: value for key, value in given.items()}

    def turned(part: Any) -> Any:
        if not part.elastic:
            return part
        supports = (replace(own, displacement=about(own.displacement)) for own in part.supports)
        loads = (
            replace(own, force=about(own.force)) if isinstance(own, Plate) else own
            for own in part.loads
        )
        mesh = replace(part.mesh, doflocs=part.mesh.p + np.array([[inner], [0.0]]))
        return replace(part, mesh=mesh, supports=tuple(supports), loads=tuple(loads))

    name = f"{scene.name.partition(',')[0]}, {name}"
    bodies: dict[str, Any] = {"bodies": tuple(map(turned, scene.bodies))}
    if scene.upper is not None:
        bodies = {"upper": turned(scene.upper), "lower": turned(scene.lower)}
    return replace(scene, name=name, kind="axisymmetric", **bodies)


def of_straight_edges(scene: Scene, elements: int = NAMED) -> Scene:
    """A named scene on a given mesh."""
    return scene.with_parts(
        lambda part: (
            replace(part, mesh=part.build_mesh(elements, scene.zone), curve=None)
            if part.elastic
            else part
        )
    )


def finer(scene: Scene) -> Scene:
    """The scene of the reference, of triangles or tetrahedra."""

    def halves(part: Any) -> Any:
        if not part.elastic:
            return part
        mesh = halved(part.mesh).mesh if part.mesh.refdom is RefQuad else part.mesh
        return replace(part, mesh=split(mesh, {}))

    for _ in range(FINER[scene.dim]):
        scene = scene.with_parts(halves)
    return replace(scene, degree=2)


def carried(coarse: Simplices, nodal: np.ndarray, fine: Simplices) -> np.ndarray:
    """A displacement at the nodes of a finer mesh, each looked for in the element about it."""
    mesh, places = fine.mesh, fine.quadratic(fine.mesh.p)
    holder = coarse.mesh.element_finder()(*mesh.p[:, mesh.t].mean(axis=1))
    own = np.zeros(places.shape[1], dtype=int)
    for nodes in (*mesh.t, *(mesh.nvertices + fine.between[1])):
        own[nodes] = holder
    if isinstance(coarse, EquilibriumElements) and coarse.corners is not None:
        corners = coarse.corners[:, own]
        N, _ = bilinear(coarse.mesh.p[:, corners], places[..., None])
        return np.asarray(np.einsum("an,can->cn", N[..., 0], nodal[:, corners]))
    origin = coarse.mesh.p[:, coarse.mesh.t[0, own]]
    shares = np.einsum("nai,in->an", coarse.slopes[own], places - origin)
    shares[0] += 1
    corners = nodal[:, coarse.mesh.t[:, own]]
    out = np.einsum("an,can->cn", shares * (2 * shares - 1), corners)
    ends, edges = coarse.between
    for (i, j), edge in zip(ends.T, edges[:, own]):
        out += 4 * shares[i] * shares[j] * nodal[:, coarse.mesh.nvertices + edge]
    return np.asarray(out)


def distance(bound: Bound, fine: Bound, exact: Callable[..., Any] | None = None) -> float:
    """Energy norm of the difference between a solution and the fine or an exact one."""
    total, pairs = 0.0, zip(bound.scene.bodies, bound.scene.cells, fine.scene.cells)
    one, other = (
        b.scene.nodal(b.scene.reduction.displaced(b.scene.solution)) for b in (bound, fine)
    )
    for i, (body, coarse, cells) in enumerate(pairs):
        if coarse is None:
            continue
        wanted = other[i] if exact is None else exact(cells.quadratic(cells.mesh.p))
        missing = wanted - carried(coarse, one[i], cells)
        data = cells.data_of(cells.stress(body.body.material, missing))
        total += bound.scene.factor * cells.products(body.body.material, data, data).sum()
    return float(np.sqrt(total))


def column() -> tuple[Scene, Callable[[np.ndarray], np.ndarray]]:
    """A column under its own weight on a floor, and its exact displacement."""
    mesh, material, weight = box(2, COARSE[2], 1.0, 0), Material(SOFT, 0.3), 150.0
    sides = tuple(Support(name, {"x": 0.0}) for name in ("left", "right"))
    part = Part("block", mesh, material, sides, (BodyForce((0.0, -weight)),))
    scene = Scene("column, floor", part, Rigid("floor"), 0.0, law="frictionless")
    modulus = SOFT * 0.7 / (1.3 * 0.4)

    def exact(x: np.ndarray) -> np.ndarray:
        return np.stack([0 * x[0], weight / modulus * (x[1] ** 2 / 2 - x[1])])

    return scene, exact


def case(scene: Scene, exact: Callable[..., Any] | None = None) -> dict[str, Any]:
    """One row: the error, its bound and its parts, and the same of a quantity."""
    solved, fine = solve_scene(scene), solve_scene(finer(scene))
    bound, best = Bound(solved), Bound(fine)
    error = distance(bound, best, exact)
    row: dict[str, Any] = {"scene": scene.name, "degree": scene.degree, "law": scene.pairs[0].law}
    row |= {"error": error, "bound": bound.error, "ratio": bound.error / error}
    row |= {
        part: getattr(bound, part) for part in ("mesh", "joint", "contact", "friction", "moved")
    }
    row["reference's bound"], row["kappa"] = best.error, ""
    if row["law"] == "coulomb":
        unique = diagnose(solved.reduction.problem.explicit()).guaranteed.unique
        row["kappa"] = 2 * scene.pairs[0].mu / unique if unique > 0 else "none"  # type: ignore[operator]
    plate = any(isinstance(load, Plate) for part in scene.meshed.values() for load in part.loads)
    row |= {"quantity": "", "its error": "", "its bound": "", "its ratio": ""}
    quantity = find_quantity("approach" if plate else "normal_force", scene)
    try:
        middle, width = interval(bound, quantity)
    except InputError:
        return row
    values = [quantity.read(own.reduction, own.solution).value for own in (solved, fine)]
    inside, off = abs(middle - values[1]) <= width, abs(values[0] - values[1])
    most = width + abs(middle - values[0])
    return row | {
        "quantity": quantity.name,
        "its error": off,
        "its bound": most if inside else -most,
        "its ratio": most / off,
    }


def bounds() -> list[dict[str, Any]]:
    return [case(*column()), *(case(scene) for scene in scenes())]


def _seconds(work: Callable[[], Any]) -> float:
    """Median of the CPU time [s]."""
    spent = []
    for _ in range(REPEATED):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return float(np.median(spent))


def constants() -> list[dict[str, Any]]:
    """The constant c of contactopt.bounds.uneven_traction, from above and from below."""
    rows = []
    for halvings in range(1, 4):
        n, found = 2**halvings, composite(halvings)
        points = regular_tetrahedron().mesh.p
        least = compatible(points, Material(1.0, 0.0), np.eye(3), halvings)
        rows.append({"n": n, "c_n": found, "c is at most": found / (1 - 1 / n),
                     "c is at least": least, "in use": CONSTANT})  # fmt: skip
    return rows


def _halved(points: np.ndarray, halvings: int) -> tuple[Any, np.ndarray]:
    """A mesh of a simplex with vertices (dim, dim + 1), and the facets opposite the last one."""
    kind = skfem.MeshTri if len(points) == 2 else skfem.MeshTet
    plain = kind.init_refdom().refined(halvings)
    mesh = kind(
        points[:, 1:] @ plain.p + points[:, :1], plain.t
    )  # may change the numbers of facets
    return mesh, np.flatnonzero(np.all(plain.p[-1, mesh.facets] < 1e-9, axis=0))


def composite(halvings: int) -> float:
    """The largest least energy of composite stresses in a regular tetrahedron under tractions d,
    linear on each of its facets, over int |d|^2, where the moments of d are zero.
    """
    mesh, on = _halved(regular_tetrahedron().mesh.p, halvings)
    dim, cells, x = 3, Tetrahedra(mesh), mesh.p[:, mesh.t]  # (dim, v, e)
    inputs = dim * dim * (dim + 1)  # without the body force
    form, stress = cells.form(Material(1.0, 0.0), slice(None)), reference_stress()[..., :inputs]
    H = WEIGHT * np.einsum("vai,eab,vbj->eij", stress, form, stress, optimize=True)
    energy = cells.by_moments.T @ sp.block_diag(list(H), "csr") @ cells.by_moments
    motions = [np.broadcast_to(one[:, None, None], x.shape) for one in np.eye(dim)]
    for i, j in combinations(range(dim), 2):
        motions.append(np.zeros(x.shape))
        motions[-1][i], motions[-1][j] = x[j], -x[i]
    entries = []
    for number, motion in enumerate(motions):
        for o, own in enumerate(cells.others):
            for (slot, a), c in product(enumerate(own), range(dim)):
                column = (cells.opposite[o] * dim + cells.slots[o, slot]) * dim + c
                row = np.arange(len(H)) * len(motions) + number
                entries.append((cells.sign[o] * motion[c, a], row, column))
    value, row, column = (np.concatenate(parts) for parts in zip(*entries))
    balance = sp.csr_matrix((value, (row, column)), (len(H) * len(motions), energy.shape[0]))
    balance = balance[len(motions) :]  # the first element is in balance if all others are
    inner, outer = (
        (own[:, None] * dim**2 + np.arange(dim**2)).ravel()
        for own in (np.flatnonzero(mesh.f2t[1] >= 0), on)
    )
    energy, held = energy.tocsr(), balance[:, inner]
    whole = sp.bmat([[energy[inner][:, inner], held.T], [held, None]], "csc")
    given = sp.vstack([energy[inner][:, outer], balance[:, outer]]).toarray()
    form = energy[outer][:, outer].toarray() - given.T @ splu(whole).solve(given)
    # moments of the traction whose coefficients are orthonormal, and those of linear functions
    size = float(measures(mesh.p[:, mesh.facets[:, on[:1]]])[0])
    root = np.linalg.cholesky(size / (dim * (dim + 1)) * (np.eye(dim) + 1))
    moments = np.kron(np.eye(len(on)), np.kron(root, np.eye(dim)))
    linear = np.concatenate([np.ones((1, dim, len(on))), mesh.p[: dim - 1, mesh.facets[:, on]]])
    tested = np.einsum("lvf,ij->fvilj", linear, np.eye(dim)).reshape(len(outer), -1)
    free = null_space((moments.T @ tested).T)
    return float(np.linalg.eigvalsh(free.T @ moments.T @ form @ moments @ free)[-1])


def compatible(points: np.ndarray, material: Material, weight: np.ndarray, halvings: int) -> float:
    """The same over int d' W d in any simplex, from below: the energy of stresses with tractions d
    is the largest 2 int d . w - |w|^2 of all displacements w, and here of quadratic ones.
    """
    mesh, on = _halved(points, halvings)
    dim, element = len(points), skfem.ElementTriP2() if len(points) == 2 else skfem.ElementTetP2()
    basis = skfem.CellBasis(mesh, skfem.ElementVector(element), intorder=4)
    facet = skfem.FacetBasis(mesh, skfem.ElementVector(element), facets=on, intorder=4)
    energy = linear_elasticity(*lame_parameters(material.E, material.nu)).assemble(basis).tocsc()
    inverse = np.linalg.inv(weight)
    square = skfem.BilinearForm(
        lambda u, v, _: sum(inverse[i, j] * u[i] * v[j] for i, j in np.ndindex(inverse.shape))
    ).assemble(facet)

    touched = np.unique(basis.get_dofs(on).all())
    others = np.setdiff1d(np.arange(basis.N), touched)
    inner, across = energy[others][:, others], energy[others][:, touched].toarray()
    stiff = energy[touched][:, touched] - across.T @ splu(inner.tocsc()).solve(across)
    x, component = basis.doflocs[:, touched], np.eye(dim)[touched % dim]
    turns = [
        x[j] * component[:, i] - x[i] * component[:, j] for i, j in combinations(range(dim), 2)
    ]
    motions = np.column_stack([component, *turns])
    motions *= np.sqrt(np.trace(stiff)) / np.linalg.norm(motions, axis=0)  # cost nothing else
    shares = np.linalg.solve(points[:, 1:] - points[:, :1], x - points[:, :1])[: dim - 1]
    linear = np.column_stack([component, *(share[:, None] * component for share in shares)])
    square = square[touched][:, touched].toarray()
    tested = square @ linear
    square -= tested @ np.linalg.solve(linear.T @ tested, tested.T)
    return float(eigh(square, stiff + motions @ motions.T, eigvals_only=True)[-1])


def costs() -> list[dict[str, Any]]:
    """What the bound costs beside the solve, CPU time."""
    made: list[tuple[str, Scene, int]] = []
    for degree, n in ((1, 128), (2, 48)):
        for mu in (0.0, 0.5):
            scene = make_scene("punch-2d", simplices=True, degree=degree, mu=mu)
            made.append((f"punch-2d, triangles of degree {degree}, mu = {mu:g}", scene, n))
    for degree, n in ((1, 10), (2, 5)):
        scene = make_scene("punch-3d", simplices=True, degree=degree, mu=0.5)
        made.append((f"punch-3d, tetrahedra of degree {degree}, mu = 0.5", scene, n))
    for degree, n in ((1, 48), (2, 24)):
        scene = of_straight_edges(make_scene("sphere", simplices=True, degree=degree), n)
        made.append((f"sphere, triangles of degree {degree}, mu = {scene.pairs[0].mu:g}", scene, n))
    for given in ("punch-2d", "cylinder-2d", "sphere"):
        scene = of_straight_edges(make_scene(given, mu=0.0), 48)
        made.append((f"{given}, quadrilaterals, mu = 0", scene, 48))
    rows = []
    for name, scene, n in made:
        solved = solve_scene(scene, n)
        whole, own = _seconds(partial(solve_scene, scene, n)), _seconds(partial(Bound, solved))
        bound = Bound(solved)
        rows.append(
            {"scene": name, "unknowns": solved.reduction.dofs, "solve [s]": whole, "bound [s]": own,
             "ratio": own / whole, "bound of the energy norm": bound.error / bound.norm}
        )  # fmt: skip
    return rows


def stopping() -> list[dict[str, Any]]:
    """CPU time of solves that stop in time, with the usual tolerance and after their first step,
    and of a whole search.
    """
    rows = []
    for name, n, solver in (
        ("punch-3d", 16, "multigrid"),
        ("cattaneo-3d", 10, "multigrid"),
        ("cattaneo-3d", 10, "auto"),
    ):
        scene, found = make_scene(name), []
        for tol in (1e-8, CERTIFIED, ANY):
            work = partial(solve_scene, scene, n, scene.zone, Options(solver=solver, tol=tol))
            found.append((_seconds(work), work()))
        saved = _saved(*found[:2], "energy") | {"first step [s]": found[2][0]}  # type: ignore[call-arg]
        rows.append({"work": f"solve {name}, {solver}"} | saved)
    found = []
    for tol in (1.000001e-8, 1e-8):  # one that is asked for, and the usual one
        options, most = Options(solver="multigrid", tol=tol), Limits(unknowns=40_000)
        work = partial(refine, [make_scene("punch-3d")], "energy", 1e-2, options, most)
        found.append((_seconds(work), work()[0]))  # type: ignore[index]
    saved = _saved(*found, "energy") | {"first step [s]": ""}  # type: ignore[call-arg]
    rows.append({"work": "search punch-3d, multigrid"} | saved)
    return rows


def _saved(
    usual: tuple[float, Solved], early: tuple[float, Solved], quantity: str
) -> dict[str, Any]:
    one, other = (value_of(quantity, own.reduction, own.solution) for _, own in (usual, early))
    return {
        "unknowns": early[1].reduction.dofs,
        "usual [s]": usual[0],
        "in time [s]": early[0],
        "saved": 1 - early[0] / usual[0],
        "change of the energy": other / one - 1,
    }


def figures(tables: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    figure, axes = paper_axes(2, wide=True)
    for ax, error, bound, what, line in (
        (axes[0], "error", "bound", "in the energy norm", 3),
        (axes[1], "its error", "its bound", "of approach and normal force", 10),
    ):
        for degree, colour, mark in zip((1, 2), COLOURS, MARKS):
            rows = [row for row in tables["bounds"] if row["degree"] == degree and row[error] != ""]
            x, y = (np.array([abs(row[key]) for row in rows]) for key in (error, bound))
            ax.loglog(x, y, mark, color=colour, label=f"degree {degree}", mfc="white")
        ends = np.array(ax.get_xlim())
        ax.loglog(ends, ends, "k-", lw=0.8)
        ax.loglog(ends, line * ends, "k:", lw=0.8)
        for times in (1, line):
            ax.text(ends[1], times * ends[1], f" {times}", va="center", fontsize=LETTERS)
        ax.set(xlabel=f"error {what} [-]", ylabel="bound [-]")
        add_legend(ax)
    return {"bounds": figure}


TEXT = template(__file__)
TITLE = "Guaranteed bounds of the error"

if __name__ == "__main__":
    tables = {"bounds": bounds, "constants": constants, "costs": costs, "stopping": stopping}
    measure("bounds", TITLE, TEXT, tables, figures)
