"""The coupling of bodies: which contacts are partners, the charts of contact surfaces."""

import threading
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.sparse as sp
import turned
from conftest import MATERIAL, two_blocks

from contactopt import (
    InputError,
    InterfaceProblem,
    Part,
    Rigid,
    Scene,
    Support,
    reduce,
    reduce_bodies,
    scenes,
    solve,
)
from contactopt.bodies import BODIES
from contactopt.bodies.protocol import Seen
from contactopt.bodies.rigid import RigidBody
from contactopt.coupling import coupling, matching
from contactopt.linear.concurrency import each
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.readings.quantities import elastic_energy
from contactopt.solving.follow import follow


def renumbered(mesh, seed: int):
    """The same mesh with its nodes and elements in another order."""
    rng = np.random.default_rng(seed)
    new = rng.permutation(mesh.p.shape[1])
    p = np.empty_like(mesh.p)
    p[:, new] = mesh.p
    t = new[mesh.t][:, rng.permutation(mesh.t.shape[1])]
    ends = {name: mesh.p[:, mesh.facets[:, f]].mean(axis=1) for name, f in mesh.boundaries.items()}
    names = {
        name: lambda x, m=middles: np.array(
            [np.abs(m - y[:, None]).sum(axis=0).min() < 1e-9 for y in x.T]
        )
        for name, middles in ends.items()
    }
    return type(mesh)(p, t, sort_t=mesh.sort_t).with_boundaries(names)


@pytest.mark.parametrize(
    "make", [turned.punch, turned.pin_in_bush, scenes.cattaneo], ids=["punch", "pin", "cattaneo"]
)
def test_the_numbering_of_the_meshes_does_not_matter(make):
    scene = make(elements=6) if make is not turned.pin_in_bush else make()
    meshes = [part.build_mesh(scene.elements, None) for part in scene.parts]
    upper, lower = (
        replace(part, mesh=renumbered(m, i)) for i, (part, m) in enumerate(zip(scene.parts, meshes))
    )
    a, b = reduce_bodies(scene), reduce_bodies(replace(scene, upper=upper, lower=lower))
    places = a.problem.coordinates, b.problem.coordinates
    order = [int(np.argmin(np.abs(places[1] - x[:, None]).sum(axis=0))) for x in places[0].T]
    if a.problem.chart.period is None:
        assert order == list(range(len(order)))
    rows = (2 * np.array(order)[:, None] + np.arange(2)).ravel()
    assert (
        np.abs(b.problem.Q[np.ix_(rows, rows)] - a.problem.Q).max()
        < 1e-9 * np.abs(a.problem.Q).max()
    )
    assert np.abs(b.problem.V[rows] - a.problem.V).max() < 1e-12


def test_a_path_makes_its_maps_once(monkeypatch):
    """One map for each body, however many states the path has."""
    made = []
    counted = lambda *arguments: made.append(1) or coupling.local_map(*arguments)  # noqa: E731
    monkeypatch.setattr(matching, "local_map", counted)
    path = follow(scenes.shear_cycle(2, steps=8, elements=6, shear=20.0))
    assert len(path.states) == 41 and path.solved
    elastic_energy(path.reduction, path.solution)
    assert len(made) == 2


def sector(scene, degrees):
    """A pin in a bush cut to a sector of the bush about the lowest point."""
    reach = np.cos(np.deg2rad(degrees / 2))

    def cut(part, radius):
        mesh = part.mesh
        facets = mesh.boundaries[part.contact]
        middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
        return replace(
            part,
            contact="contact",
            mesh=mesh.with_boundaries(
                {"contact": facets[-middle[1] / np.linalg.norm(middle, axis=0) > reach]}
            ),
        )

    return replace(scene, upper=cut(scene.upper, 19.5), lower=cut(scene.lower, 20.0))


@pytest.mark.parametrize("degrees", [60, 170, 300])
def test_a_sector_of_a_bush_matches_along_the_radius(degrees):
    reduction = reduce_bodies(sector(turned.pin_in_bush(clearance=2.0), degrees))
    assert np.allclose(reduction.coupling.gap, 2.0, rtol=0.02)
    assert reduction.problem.chart.period is None and len(reduction.coupling.gap) > 4
    places = reduction.problem.chart.places[0]
    # arc length from the middle
    assert np.all(np.diff(places) > 0) and places[0] == pytest.approx(-places[-1])


def test_two_curved_bodies_may_match_along_the_mean_normal():
    """Nodes at the same x on a hill and a valley: partners across, not along the slope's normal."""
    x = np.linspace(-1.0, 1.0, 9)

    def body(low, high, curve):
        mesh = rename(tensor_mesh(x, np.linspace(low, high, 5)), bottom="y-", top="y+")
        return mesh.morphed(None, lambda p: p[1] + curve * p[0] ** 2 * (1 - np.abs(p[1])))

    upper = Part("upper", body(0.0, 1.0, 0.6), MATERIAL, (Support("top"),), (), "bottom")
    lower = Part("lower", body(-1.0, 0.0, 0.2), MATERIAL, (Support("bottom"),), (), "top")
    reduction = reduce_bodies(Scene("hill", upper, lower, 0.3))
    n, at = reduction.coupling.frames[:, 0], reduction.coupling.positions[0]
    assert np.allclose(at, x)
    assert np.allclose(reduction.coupling.gap, 0.4 * x**2 * n[:, 1], atol=1e-12)


def test_partners_half_a_sector_off_are_refused():
    scene = turned.pin_in_bush(clearance=0.5, sectors=40)
    wrong = turned.moved(scene, turned.turn(180 / 40)).upper
    with pytest.raises(
        InputError, match=r"interface nodes do not match.*lies .* off the normal.*same nodes"
    ):
        reduce_bodies(replace(scene, upper=wrong), coupling="matching")


@pytest.mark.parametrize("dim", [2, 3])
def test_half_and_quarter_models_are_mirrored_at_their_planes(dim):
    """The charts of named scenes are their coordinates, on either side of the plane."""
    scene = scenes.flat_punch(dim, elements=3)
    problem = reduce(scene)
    assert problem.chart.mirrored == (True,) * (dim - 1)
    assert np.array_equal(problem.chart.places, problem.coordinates[: dim - 1])

    def reflected(part):
        def mesh(elements, zone):
            made = part.build_mesh(elements, zone)
            return replace(made, doflocs=turned.mirror(dim) @ made.p)

        return replace(part, mesh=mesh)

    other = reduce(replace(scene, upper=reflected(scene.upper), lower=reflected(scene.lower)))
    assert other.chart.mirrored == (True,) * (dim - 1)
    sizes = [np.sort(np.abs(p.chart.places), axis=None) for p in (problem, other)]
    assert np.allclose(*sizes, atol=1e-12)


def test_a_full_model_is_measured_from_its_middle():
    chart = reduce(turned.punch(elements=4)).chart
    assert chart.mirrored == (False,) and np.allclose(chart.places[0], np.linspace(-20, 20, 9))
    chart = reduce(turned.punch(3, elements=3)).chart  # 40 by 30: the longer side comes first
    assert chart.mirrored == (False, False)
    assert np.allclose(np.sort(np.unique(chart.places.round(9)[0])), np.linspace(-20, 20, 7))
    assert np.allclose(np.abs(chart.places[1]).max(), 15)


def test_a_clamped_end_is_no_plane_of_symmetry():
    base = two_blocks("plane-strain")
    clamped = replace(base.lower, supports=(Support("side0"), Support("bottom")))
    upper = replace(base.upper, supports=(Support("side0"),), loads=())
    assert not any(reduce(replace(base, upper=upper, lower=clamped, copies=2)).chart.mirrored)
    assert reduce(replace(base, copies=2)).chart.mirrored == (True,)


def test_an_arc_is_measured_along_itself():
    """A rigid punch on a quarter of a ring: the chart is radius times angle."""
    sectors = 64
    mesh = turned.ring(1.0, 2.0, 2, sectors)
    facets = mesh.boundaries["outside"]
    middle = mesh.p[:, mesh.facets[:, facets]].mean(axis=1)
    mesh = mesh.with_boundaries({"contact": facets[(middle > 0).all(axis=0)]})
    part = Part("ring", mesh, MATERIAL, (Support("inside"),))
    problem = reduce(Scene("s", Rigid("shell"), part, 0.3))
    angle = np.arctan2(problem.coordinates[1], problem.coordinates[0])
    arc = -2.0 * (angle - (angle.max() + angle.min()) / 2)  # t1 is n turned clockwise
    assert np.allclose(problem.chart.places[0], arc, atol=2e-2)
    steps = np.abs(np.diff(problem.chart.places[0]))
    chords = np.linalg.norm(np.diff(problem.coordinates), axis=0)
    assert np.allclose(steps, chords, rtol=1e-3)


def test_friction_may_be_a_function_of_the_place():
    scene = scenes.flat_punch(2, elements=6, mu=0.4)
    varied = replace(scene, mu=lambda x: np.where(x[0] < 10, 0.1, 0.5))
    problem = reduce(varied)
    assert np.array_equal(problem.mu, np.where(problem.coordinates[0] < 10, 0.1, 0.5))
    same = solve(reduce(replace(scene, mu=lambda x: np.full(x.shape[1], 0.4))))
    assert np.allclose(same.reactions, solve(reduce(scene)).reactions, atol=1e-9)
    assert reduce_bodies(scene).loaded(varied).problem.mu.min() == 0.1
    for wrong in (
        lambda x: -np.ones(x.shape[1]),
        lambda x: np.ones(2),
        lambda x: np.full(x.shape[1], np.nan),
    ):
        with pytest.raises(InputError, match="friction"):
            reduce(replace(scene, mu=wrong))
    with pytest.raises(InputError, match="one number or one per contact"):
        reduce(replace(scene, mu=[0.1, 0.2]))


@dataclass(frozen=True)
class Sprung(Rigid):
    """A rigid body on springs that resist its translations, each of stiffness k [force /
    length].
    """

    k: float = 1.0


@dataclass(frozen=True, eq=False)
class SprungBody(RigidBody):
    def through(self, T):
        def entries():
            return (T @ T.T).toarray() / self.part.k

        moved = np.asarray(abs(T).sum(axis=1)).ravel() > 0
        return Seen(lambda X, _: T @ (T.T @ X) / self.part.k, entries, moved)

    def displacement(self, force, multipliers, free=None):
        return force / self.part.k

    def internal_forces(self, U, force):
        return self.part.k * U


def assemble_sprung(scene, part, elements, zone):
    return SprungBody(part, scene.components)


@pytest.mark.parametrize("form", ["explicit", "implicit"])
def test_a_kind_of_body_is_added_by_one_line(monkeypatch, form):
    """The springs add to the approach and to the energy what the force asks of them."""
    monkeypatch.setitem(BODIES, Sprung, (__name__, "assemble_sprung", "a rigid body on springs"))
    scene = replace(two_blocks("plane-strain", force=3.0), lower=Sprung("floor", k=2.0))
    reduction = reduce_bodies(scene, Q=form)
    solution = solve(reduction.problem, tol=1e-11)
    block_alone = 3.0 * (1 - 0.3**2) / 5
    assert -solution.multipliers[0] == pytest.approx(block_alone + 3.0 / 2.0, rel=1e-8)
    assert elastic_energy(reduction, solution) == pytest.approx(
        3.0 * block_alone / 2 + 9.0 / (2 * 2.0), rel=1e-8
    )
    u = sum(B @ U for B, U in zip(reduction.maps, reduction.displaced(solution)))
    expected = reduction.problem.displacements(solution.reactions, solution.multipliers).ravel()
    assert np.allclose(u, expected, atol=1e-9)


def test_parts_of_no_known_kind_are_refused():
    from contactopt.bodies import assemble

    with pytest.raises(
        InputError, match="must be one of Part, MatrixPart, Rigid, HalfSpace; got str"
    ):
        assemble(two_blocks("plane-strain"), "block", 1, None)


def test_a_large_array_is_announced_and_a_huge_one_refused(monkeypatch, caplog):
    from contactopt.linear import operators

    scene = scenes.flat_punch(2, elements=4)  # 5 contacts: 10 x 10 entries, 800 bytes
    monkeypatch.setattr(operators, "NOTABLE_BYTES", 800)
    with caplog.at_level("INFO"):
        reduce(scene, Q="explicit", solver="superlu")
    assert "10 x 10 entries: 800 bytes" in caplog.text and "solver superlu" in caplog.text
    assert "explicit Q of 10 unknowns" in caplog.text
    monkeypatch.setattr(operators, "MOST_BYTES", 799)
    with pytest.raises(
        InputError, match="would take 800 bytes, more than 799; take Q = 'implicit'"
    ):
        reduce(scene, Q="explicit")
    assert reduce(scene, Q="implicit").contacts == 5
    rows = sp.csr_array(np.eye(10))
    # the same limit for sparse rows
    with pytest.raises(InputError, match="would take 800 bytes, more than 799"):
        InterfaceProblem(rows, np.zeros((5, 2)), 0.3).explicit()


def test_bodies_work_at_the_same_time_where_they_can():
    here, meeting = threading.get_ident(), threading.Barrier(2, timeout=20)

    def act(item):
        if item < 2:
            meeting.wait()  # passes only if both run at once
        return item**2, threading.get_ident() == here

    assert each(act, range(3), [True, True, False]) == ((0, False), (1, False), (4, True))
    assert (
        each(lambda item: threading.get_ident() == here, range(3), [False, True, False])
        == (True,) * 3
    )
    with pytest.raises(ZeroDivisionError):
        each(lambda item: 1 / item, [1, 0])


def test_a_surface_is_asked_for_by_its_name():
    from contactopt.bodies import assemble

    scene = two_blocks("plane-strain")
    body = assemble(scene, scene.lower, 1, None)
    assert np.array_equal(body.surface("top").points, body.surface().points) and body.meshed
    with pytest.raises(
        InputError, match="body 'lower' has no contact surface 'bottom'; it has top"
    ):
        body.surface("bottom")


def test_a_pin_in_a_bush_in_space():
    """Gaps along the radius, and frames that are orthonormal and right-handed."""
    from contactopt.meshes.discs import extrude

    def body(inner, outer, contact, support, R):
        plane = turned.ring(inner, outer, 2, 24)
        mesh = extrude(plane.p, plane.t, np.linspace(0.0, 5.0, 3))
        names = {
            "inside": lambda x: np.hypot(*x[:2]) < 1.05 * inner,
            "outside": lambda x: np.hypot(*x[:2]) > 0.95 * outer,
        }
        mesh = mesh.with_boundaries(names)
        return Part(
            contact, replace(mesh, doflocs=R @ mesh.p), MATERIAL, (Support(support),), (), contact
        )

    R = turned.turn_about((1.0, 2.0, -0.5), 67.0)
    pin, bush = body(1.0, 2.0, "outside", "inside", R), body(2.1, 4.0, "inside", "outside", R)
    made = reduce_bodies(Scene("bush", pin, bush, 0.3, kind="solid")).coupling
    assert np.allclose(made.gap, 0.1, rtol=0.03) and len(made.gap) == 24 * 3
    assert np.allclose(np.einsum("kac,kbc->kab", made.frames, made.frames), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(made.frames), 1.0)
    axis = R @ [0.0, 0.0, 1.0]
    radial = made.positions - np.outer(axis, axis @ made.positions)
    assert np.all(np.sum(made.frames[:, 0].T * radial, axis=0) < -0.95 * 2.1)  # towards the pin
