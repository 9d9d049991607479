"""Guaranteed bounds hold, are close, and refuse what they do not know."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from contactopt import InputError, Material, Part, Plate, Rigid, Scene, Support
from contactopt.accuracy.loop import refine
from contactopt.bounds import bounded
from contactopt.bounds.bound import Bound
from contactopt.bounds.displaced_stress import halved
from contactopt.bounds.equilibrium_elements import EquilibriumElements
from contactopt.bounds.interval import interval
from contactopt.meshes.cells import measures
from contactopt.meshes.mesh_refinement import split
from contactopt.readings.quantities import find_quantity
from contactopt.scenes import make_scene
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import BodyForce
from contactopt.solving.solve_scene import Options, solve_scene

MATERIAL = Material(1000.0, 0.3)

LAWS = {"frictionless": 0.0, "tresca": 10.0, "coulomb": 0.3}


def block(n, up=1.0, seed=0, kind=skfem.MeshTri):
    """A unit square above or below y = 0 of elements whose inner vertices are moved at random."""
    ticks = np.linspace(0, 1, n + 1)
    mesh = kind.init_tensor(ticks, up * ticks)
    p = mesh.p.copy()
    inner = np.all((np.abs(p) > 1e-9) & (np.abs(p) < 1 - 1e-9), axis=0)
    p[:, inner] += 0.15 / n * np.random.default_rng(seed).uniform(-1, 1, p[:, inner].shape)
    named = kind(p, mesh.t).with_boundaries(
        {
            "contact": lambda x: np.abs(x[1]) < 1e-9,
            "far": lambda x: np.abs(x[1] - up) < 1e-9,
            "left": lambda x: np.abs(x[0]) < 1e-9,
        }
    )
    return named


def on_floor(degree=1, law="frictionless", mu=0.0, plate=True, scale=1.0, n=5):
    """Pressed on a rounded rigid floor; lengths in units of `scale`."""
    mesh = block(n)
    mesh = replace(mesh, doflocs=scale * mesh.p)
    held = {"x": 0.0, "y": -0.1 * scale}
    supports = (Support("left", {"x": 0.0}), *(() if plate else (Support("far", held),)))
    loads = (Plate("far", {"y": -100.0 * scale}),) if plate else ()
    floor = Rigid("floor", normal=(0.0, 1.0), gap=lambda x: 0.1 * x[0] ** 2 / scale)
    return Scene("s", Part("b", mesh, MATERIAL, supports, loads), floor, mu, law=law, degree=degree)


def ring_on_floor(degree=1, plate=True, inner=0.0, law="frictionless", mu=0.0):
    """The same of a disc, or a ring with an inner radius."""
    mesh = block(5)
    mesh = replace(mesh, doflocs=mesh.p + np.array([[inner], [0.0]]))
    axis = () if inner else (Support("left", {"r": 0.0}),)
    supports = (*axis, *(() if plate else (Support("far", {"r": 0.0, "z": -0.1}),)))
    loads = (Plate("far", {"z": -300.0}),) if plate else ()
    floor = Rigid("floor", normal=(0.0, 1.0), gap=lambda x: 0.1 * (x[0] - inner) ** 2)
    ring = Part("b", mesh, MATERIAL, supports, loads)
    return Scene("s", ring, floor, mu, "axisymmetric", law=law, degree=degree)


def of_quadrilaterals(scene):
    return scene.with_parts(
        lambda part: replace(part, mesh=block(5, kind=skfem.MeshQuad)) if part.elastic else part
    )


def discs(degree, below):
    """A disc on another one, joined by mortar."""
    axis = Support("left", {"r": 0.0})
    top = Part("upper", block(5, 1.0, 1), MATERIAL, (axis, Support("far", {"z": -0.1})))
    low = Part("lower", block(below, -1.0, 2), Material(3000.0, 0.2), (axis, Support("far")))
    return Scene("s", top, low, 0.0, "axisymmetric", law="frictionless", degree=degree)


def two_blocks(degree=1, law="coulomb", mu=0.3, n=5, below=5):
    top = Part("upper", block(n, 1.0, 1), MATERIAL, (Support("far", {"x": 0.05, "y": -0.1}),))
    low = Part("lower", block(below, -1.0, 2), Material(3000.0, 0.2), (Support("far"),))
    return Scene("s", top, low, mu, law=law, degree=degree)


def narrower():
    """A punch on a wider block, whose edge lies within a facet."""
    mesh = block(6, 1.0, 1)
    mesh = replace(mesh, doflocs=mesh.p * [[0.63], [1.0]])
    wall, pushed = Support("left", {"x": 0.0}), Support("far", {"y": -0.1})
    top = Part("upper", mesh, MATERIAL, (wall, pushed))
    low = Part("lower", block(5, -1.0, 2), Material(3000.0, 0.2), (wall, Support("far")))
    contact = Contact("upper", "lower", 0.0, "frictionless", coupling="mortar", carrier="upper")
    return Scene("s", bodies=(top, low), contacts=(contact,))


def cubes(degree=1, law="coulomb", mu=0.3, below=4, wide=1.0, turn=None, scale=1.0):
    """A cube of three elements a side pushed askew on another one, both turned in space."""
    turn = np.eye(3) if turn is None else turn

    def part(name, n, up, material, moved, wide=1.0):
        ticks = np.linspace(0, 1, n + 1)
        mesh = skfem.MeshTet.init_tensor(wide * ticks, wide * ticks, up * ticks)
        p = mesh.p.copy()
        inner = np.all((np.abs(p) > 1e-9) & (np.abs(p) < np.array([[wide], [wide], [1]]) - 1e-9), 0)
        shake = 0.15 / n * np.random.default_rng(n).uniform(-1, 1, p[:, inner].shape)
        named = type(mesh)(p, mesh.t).with_boundaries(
            {"contact": lambda x: np.abs(x[2]) < 1e-9, "far": lambda x: np.abs(x[2] - up) < 1e-9}
        )
        p[:, inner] += shake
        far = dict(zip("xyz", scale * turn @ moved))
        mesh = replace(named, doflocs=scale * turn @ p)
        return Part(name, mesh, material, (Support("far", far),))

    top = part("upper", 3, 1.0, MATERIAL, np.array([0.05, 0.03, -0.1]), wide)
    low = part("lower", below, -1.0, Material(3000.0, 0.2), np.zeros(3))
    carrier = "upper" if wide < 1 else None
    contact = Contact("upper", "lower", mu, law, coupling="mortar", carrier=carrier)
    return Scene("s", bodies=(top, low), contacts=(contact,), kind="solid", degree=degree)


def fine(scene, times=2):
    """Quadratic displacements on triangles of half the size, as often as asked for."""

    def finer(part):
        quadrilaterals = part.elastic and isinstance(part.mesh, skfem.MeshQuad)
        mesh = halved(part.mesh).mesh if quadrilaterals else part.elastic and part.mesh
        return replace(part, mesh=split(mesh, {})) if part.elastic else part

    for _ in range(times):
        scene = scene.with_parts(finer)
    return solve_scene(replace(scene, degree=2))


HELD = {
    "linear": (on_floor(1, plate=False), 0.0),
    "quadratic": (on_floor(2, plate=False), 0.0),
    "tresca": (on_floor(1, "tresca", 8.0, plate=False), 8.0),
    "matching": (two_blocks(1, "tresca", 8.0), 8.0),
    "quadratic matching": (two_blocks(2, "tresca", 8.0), 8.0),
    "mortar": (two_blocks(1, "tresca", 8.0, below=7), 8.0),
    "coarse below": (two_blocks(2, "frictionless", 0.0, below=4), 0.0),
    "disc": (ring_on_floor(1, plate=False), 0.0),
    "quadratic ring": (ring_on_floor(2, plate=False, inner=0.5), 0.0),
    "mortar of discs": (discs(1, 7), 0.0),
    "quadrilaterals": (of_quadrilaterals(on_floor(1, plate=False)), 0.0),
    "disc of quadrilaterals": (of_quadrilaterals(ring_on_floor(1, plate=False)), 0.0),
    "quadratic mortar of discs": (discs(2, 4), 0.0),
    "mortar in space": (cubes(1, "tresca", 8.0), 8.0),
    "partly covered in space": (cubes(1, "frictionless", 0.0, wide=0.63), 0.0),
}


@pytest.mark.parametrize(("scene", "limit"), HELD.values(), ids=HELD)
def test_no_dual_energy_exceeds_a_primal_one(scene, limit):
    """J of any admissible displacement is at least -J* of any admissible stress: that of each mesh
    bounds those of the other one, and the gap between them is not much more than their distance.
    """
    coarse, best = Bound(solve_scene(scene)), Bound(fine(scene, 4 - scene.dim))
    (low, high), (below, above) = (between(bound, limit) for bound in (coarse, best))
    assert low <= above <= high and below <= high
    most = 12 if scene.dim == 2 else 25  # times; tetrahedra are further off
    assert high - low < most * (high - above) and above - below < 0.3 * (high - low)


def between(bound, limit):
    """-J* and J of a scene in which displacements are prescribed and nothing else is."""
    work = sum(
        limit * np.sum(pair.rule.weights * np.linalg.norm(slip, axis=0))
        for pair in bound.scene.pairs
        for slip in [pair.jump(bound.displacement, pair.rule)[1:]]
    )
    primal = bound.size(bound.strained) ** 2 / 2 + work
    gap = bound.mesh**2 + bound.contact**2 + bound.friction**2
    return primal - gap / 2, primal


def test_the_bound_is_the_error_where_the_stress_is_linear():
    """A column under its own weight: the exact stress is one of those that s* may be."""
    sides = (Support("left", {"x": 0.0}), Support("right", {"x": 0.0}))
    mesh = block(6).with_boundaries({"right": lambda x: np.abs(x[0] - 1) < 1e-9})
    part = Part("b", mesh, MATERIAL, sides, (BodyForce((0.0, -150.0)),))
    scene = Scene("s", part, Rigid("floor"), 0.0, law="frictionless")
    solved = solve_scene(scene)
    bound, cells = Bound(solved), EquilibriumElements(mesh, 1, False)
    modulus, x = 1000.0 * 0.7 / (1.3 * 0.4), cells.quadratic(mesh.p)
    exact = np.stack([0 * x[0], 150.0 / modulus * (x[1] ** 2 / 2 - x[1])])
    found = bound.scene.nodal(solved.reduction.displaced(solved.solution))[0]
    data = cells.data_of(cells.stress(MATERIAL, exact - found))
    error = np.sqrt(cells.products(MATERIAL, data, data).sum())
    assert error <= bound.error <= 1.03 * error


@pytest.mark.parametrize("degree", [1, 2])
def test_mortar_of_surfaces_that_match_changes_nothing(degree):
    """Or little: it rounds off kinks of linear elements, and slips are integrated otherwise."""
    scene = cubes(degree, "tresca", 8.0, below=3)
    other = replace(scene, contacts=(replace(scene.contacts[0], coupling="matching"),))
    one, two = (Bound(solve_scene(own, options=Options(tol=1e-12))) for own in (scene, other))
    names = "mesh", "contact", "friction", "moved"
    terms = [[getattr(bound, name) / bound.norm for name in names] for bound in (one, two)]
    assert np.allclose(*terms, atol=5e-4) and one.joint < 1e-6 * one.norm


@pytest.mark.parametrize(
    "scene",
    [two_blocks(2, below=7), narrower(), cubes(1), cubes(2, wide=0.63), cubes(2, below=2)],
    ids=["plane", "narrower", "space", "partly covered", "coarse below"],
)
def test_bodies_joined_by_mortar_penetrate_nowhere(scene):
    """At random places of all pieces, on which the places of both sides are the same."""
    bound = Bound(solve_scene(scene))
    pair, d = bound.scene.pairs[0], scene.dim
    shares = np.random.default_rng(0).dirichlet(0.7 * np.ones(d), 100).T
    at = np.einsum("ivSc,cs->ivSs", pair.ends.at[..., :d], shares)
    points = pair.ends._replace(at=at)
    gap = pair.jump(bound.displacement, points)[0]
    before = pair.jump(
        bound.scene.nodal(bound.scene.reduction.displaced(bound.scene.solution)), points
    )
    assert gap.min() > -1e-12 and before[0].min() < -1e-5
    one, other = (np.einsum("ld,dSs->lSs", pair.frame, pair.places(i, points)) for i in (0, 1))
    assert np.allclose(one[1:], other[1:], atol=1e-12)
    areas = [measures(own).sum() for own in pair.points]
    assert np.isclose(pair.rule.weights.sum(), min(areas))


@pytest.mark.parametrize("degree", [1, 2])
def test_bounds_in_space_are_the_same_turned_and_in_other_units(degree):
    """Of a cube whose edges lie within facets of the other one, with Coulomb's friction."""
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    made = (
        cubes(degree, wide=0.63),
        cubes(degree, wide=0.63, turn=turn * np.linalg.det(turn), scale=1e3),
    )
    one, other = (Bound(solve_scene(own, options=Options(tol=1e-12))) for own in made)
    for name in ("mesh", "joint", "contact", "friction", "moved"):
        found = [getattr(bound, name) / bound.norm for bound in (one, other)]
        assert np.isclose(*found, rtol=1e-7)


@pytest.mark.parametrize(
    ("law", "make", "degree", "plate"),
    [
        ("frictionless", on_floor, 1, True),
        ("frictionless", ring_on_floor, 2, False),
        ("tresca", on_floor, 2, False),
        ("tresca", ring_on_floor, 1, True),
        ("coulomb", on_floor, 1, False),
        ("coulomb", ring_on_floor, 2, True),
        ("coulomb", on_floor, 2, True),
    ],
)
def test_the_interval_of_a_quantity_holds_the_fine_value(law, make, degree, plate):
    """With a plate or a given displacement, of which each law, body and degree has one."""
    names = ("approach" if plate else "normal_force", "energy")
    hold_the_fine_value(make(degree, plate=plate, law=law, mu=LAWS[law]), names)


@pytest.mark.parametrize(("law", "degree"), [("tresca", 1), ("coulomb", 2)])
def test_intervals_hold_where_surfaces_slip_both_ways(law, degree):
    """Both edges of a block that is pressed slip outwards; one facet slips both ways."""
    scene = two_blocks(degree, law, {"tresca": 1.0, "coulomb": 0.05}[law])
    pushed = replace(scene.upper, supports=(Support("far", {"x": 0.0, "y": -0.1}),))
    scene = replace(scene, upper=pushed)
    u = solve_scene(scene)
    slip = u.reduction.problem.displacements(u.solution.reactions, u.solution.multipliers)[:, 1]
    assert slip.min() < -1e-4 and slip.max() > 1e-4
    hold_the_fine_value(scene, ("normal_force", "shear_force", "energy"))


@pytest.mark.parametrize("law", ["tresca", "coulomb"])
def test_intervals_with_friction_are_mirrored_and_in_other_units(law):
    """Of a pushed block: seen in a mirror, and with lengths and forces in other units."""

    def seen(scale, force, sign):
        def part(own):
            upper = own.name == "upper"
            mesh = type(own.mesh)(
                own.mesh.p * scale * np.array([[sign], [1.0]]), own.mesh.t[[1, 0, 2]]
            ).with_boundaries(
                {
                    "contact": lambda x: np.abs(x[1]) < 1e-9 * scale,
                    "far": lambda x: np.abs(np.abs(x[1]) - scale) < 1e-9 * scale,
                }
            )
            moved = {"x": 0.05 * scale * sign, "y": -0.1 * scale}
            supports = (Support("far", moved if upper else None),)
            material = Material(own.material.E * force / scale**2, own.material.nu)
            return replace(own, mesh=mesh, supports=supports, material=material)

        bound = LAWS[law] * (force / scale**2 if law == "tresca" else 1.0)
        scene = replace(two_blocks(1, law, bound).with_parts(part), thickness=scale)
        solved = solve_scene(scene, options=Options(tol=1e-12))
        return np.array(interval(Bound(solved), find_quantity("normal_force", scene))) / force

    plain = seen(1.0, 1.0, 1.0)
    assert np.allclose(seen(1.0, 1.0, -1.0), plain, rtol=1e-6)
    assert np.allclose(seen(1e3, 1e-2, 1.0), plain, rtol=1e-6)


def hold_the_fine_value(scene, names):
    solved, best = solve_scene(scene), fine(scene)
    for quantity in (find_quantity(name, scene) for name in names):
        middle, width = interval(Bound(solved), quantity)
        close, narrow = interval(Bound(best), quantity)
        value = quantity.read(best.reduction, best.solution).value
        assert abs(middle - value) <= width and abs(close - value) <= narrow < width / 2
        assert abs(middle - close) <= width + narrow


def test_a_solver_that_stops_early_shows_in_the_bound():
    """Forces that are wrong by some percent widen contact and solver terms, and stay a bound."""
    solved = solve_scene(on_floor(plate=False))
    r = solved.solution.reactions.copy()
    r[r[:, 0] > 0, 0] *= 1 + 0.05 * np.cos(np.arange(np.sum(r[:, 0] > 0)))
    worse = replace(solved, solution=replace(solved.solution, reactions=r))
    good, bad = Bound(solved), Bound(worse)
    assert bad.solver > 100 * good.solver and bad.error > good.error


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (make_scene("rigid-punch-2d"), "with linear displacements"),
        (make_scene("rigid-punch-axisymmetric", simplices=True), "rounding leaves no bound"),
        (make_scene("punch-3d"), "triangles, tetrahedra"),
        (replace(on_floor(), mu=0.2, law="associated"), "law 'associated'"),
    ],
)
def test_what_has_no_bound_is_refused(scene, words):
    with pytest.raises(InputError, match=words):
        Bound(solve_scene(scene, 4))


def test_a_quantity_without_a_bound_is_refused():
    scene = on_floor(1, "coulomb", 0.3)
    solved = solve_scene(scene)
    found = bounded(solved, find_quantity("approach", scene), 1.0)
    assert "if friction is small, which contactopt diagnose tests" in found.sentence
    found = bounded(solved, find_quantity("pressure", scene), 1.0)
    assert found.bound is None and "no bound of the pressure" in found.missing
    assert 0 < found.energy["mesh"] < found.energy["error"] < 1


def test_a_search_says_bound_or_estimate():
    scene = on_floor()
    _, found = refine([scene], "approach", 0.02, adaptive=True, bound=True)
    assert found.guarantee.sentence.startswith("bound:") and found.guarantee.bound < 0.1
    _, found = refine([make_scene("punch-2d", mu=0.0)], "approach", 0.05, bound=True)
    assert found.guarantee.bound < 0.1
    _, found = refine([make_scene("punch-3d")], "approach", 0.3, bound=True)
    assert found.guarantee.sentence.startswith("estimate, no bound: body")
    assert refine([scene], "approach", 0.1)[1].guarantee is None


def test_a_search_stops_its_solvers_in_time_unless_a_tolerance_is_asked_for():
    """The residual is a tenth of the accuracy at most, and small enough for derivatives."""
    for tol, most in ((1e-8, 1e-5), (1e-12, 1e-12)):
        solved, found = refine([on_floor()], "energy", 0.05, Options(tol=tol), adaptive=True)
        assert found.reached and solved.solution.residual <= most
