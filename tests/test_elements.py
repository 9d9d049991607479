"""Shape and degree of the elements: patch test, weights of the contact surface, exactness."""

from dataclasses import replace
from itertools import permutations, product

import meshio
import numpy as np
import pytest
import skfem
from conftest import MATERIAL, two_blocks
from scipy.sparse.linalg import spsolve
from skfem.helpers import ddot, sym_grad, trace

from contactopt import (
    BodyForce,
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    reduce_bodies,
    run,
    scenes,
    solve,
)
from contactopt.bodies.body import build_body
from contactopt.bodies.elements import Faces, contact_trace, make_basis, weight_at
from contactopt.coupling.back_to_bodies import recover
from contactopt.material import lame
from contactopt.meshes.cells import CURVED, volumes
from contactopt.meshes.cells import SHAPES as CELLS
from contactopt.meshes.structured import rename, simplices, tensor_mesh
from contactopt.scenes.common import with_elements

KINDS = ["plane-strain", "axisymmetric", "solid"]
AREA = {"plane-strain": 1.0, "axisymmetric": np.pi, "solid": 1.0}
SHAPES = [(kind, degree, cut) for kind in KINDS for degree in (1, 2) for cut in (False, True)]


def body_of(kind: str, degree: int, cut: bool, **part):
    scene = with_elements(two_blocks(kind), degree, cut)
    return build_body(scene, replace(scene.lower, **part), 1, None)


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("name", CELLS)
def test_places_on_facets_are_known_in_the_elements(name, curved):
    """The element's own map takes them back to the facet, and the facet's normals point outwards:
    with the divergence theorem the integral of x . n is dim times the volume.
    """
    kind, elements = CELLS[name]
    dim = kind().p.shape[0]
    random = np.random.default_rng(0)
    mesh = kind.init_tensor(*[np.linspace(0, 1, 4)] * dim)
    mesh = kind(mesh.p + 0.05 * random.uniform(-1, 1, mesh.p.shape), mesh.t)
    if curved:
        places = skfem.Basis(mesh, elements[2]()).doflocs
        mesh = CURVED[name](places + 0.01 * random.uniform(-1, 1, places.shape), mesh.t)
    points, weights = skfem.quadrature.get_quadrature(mesh.brefdom, 6)
    at = Faces(mesh, mesh.boundary_facets(), points)
    assert np.abs(mesh.mapping().F(at.inside, at.owner) - at.places).max() < 1e-14
    flux = np.sum(at.places * at.normals * at.scale * weights)
    volume = skfem.Basis(mesh, elements[2](), intorder=6).dx.sum()
    assert flux == pytest.approx(dim * volume, rel=1e-12)


@pytest.mark.parametrize("kind,degree,cut", SHAPES)
def test_patch_test_uniform_pressure_is_exact(kind, degree, cut):
    scene = with_elements(two_blocks(kind, force=3.0), degree, cut)
    reduction = reduce_bodies(scene)
    problem, solution = reduction.problem, solve(reduction.problem, tol=1e-12)
    pressure = 3.0 / AREA[kind]
    assert np.all(problem.areas > 0) and np.all(solution.reactions[:, 0] >= 0)
    assert np.abs(solution.reactions[:, 0] / problem.areas / pressure - 1).max() < 1e-10
    modulus = 5 / (1 - 0.3**2) if kind == "plane-strain" else 5
    assert -solution.multipliers[0] == pytest.approx(3 * pressure / modulus, rel=1e-10)
    for field in recover(reduction, solution):
        axial = field.stress[:, 2 if kind == "solid" else 1]
        assert np.abs(axial / pressure + 1).max() < 1e-10
        expected = pressure if kind != "plane-strain" else pressure * np.sqrt(1 - 0.3 + 0.3**2)
        assert np.abs(field.von_mises / expected - 1).max() < 1e-10


@pytest.mark.parametrize("kind,degree,cut", SHAPES)
def test_stiffness_is_the_weak_form_of_elasticity(kind, degree, cut):
    """Against scikit-fem's own assembly, on a quadrature of its own that is exact but for 1/r."""
    body = body_of(kind, degree, cut)
    lam, shear = lame(MATERIAL)

    @skfem.BilinearForm
    def elasticity(u, v, w):
        volume, volume_v = trace(sym_grad(u)), trace(sym_grad(v))
        energy = ddot(sym_grad(u), sym_grad(v))
        if kind == "axisymmetric":
            volume, volume_v = volume + u[0] / w.x[0], volume_v + v[0] / w.x[0]
            energy = energy + u[0] * v[0] / w.x[0] ** 2
        return (lam * volume * volume_v + 2 * shear * energy) * weight_at(body.weight, w.x)

    fine = skfem.Basis(body.basis.mesh, body.basis.elem, intorder=6)
    same = kind == "axisymmetric"  # 1/r: no rule is exact
    own = skfem.Basis(body.basis.mesh, body.basis.elem, quadrature=(body.basis.X, body.basis.W))
    expected = elasticity.assemble(own if same else fine)
    assert abs(body.A - expected).max() <= 1e-12 * abs(expected).max()


@pytest.mark.parametrize("kind,degree,cut", SHAPES)
def test_weights_pass_on_force_and_its_moment(kind, degree, cut):
    """Rows of W add up to 1; A' W is the force of unit pressure on every node."""
    body = body_of(kind, degree, cut)
    W = body.trace.weights
    assert np.allclose(W.sum(axis=1), 1, atol=1e-12)
    up = (0.0,) * (len(body.unknowns) - 1) + (1.0,)
    scene = with_elements(two_blocks(kind), degree, cut)
    loaded = build_body(scene, replace(scene.lower, loads=(Traction("top", up),)), 1, None)
    assert np.allclose(
        body.trace.areas @ W, loaded.load[body.unknowns[-1]], atol=1e-13 * body.trace.areas.sum()
    )
    if degree == 1:
        assert np.array_equal(body.nodes, W.indices) and np.allclose(W.data, 1)
    mean = W @ body.locations.T
    assert np.abs(mean - body.points.T)[:, -1].max() < 1e-12  # on the plane of contact


@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_a_quadratic_displacement_has_no_error(kind, cut):
    """A clamped-free bar under its own weight."""
    scene = with_elements(two_blocks(kind), 2, cut)
    up = scene.components[-1]
    sides = tuple(s for s in scene.lower.supports if s.boundary != "bottom")
    weight = BodyForce((0.0,) * (scene.dim - 1) + (-2.0,))
    part = replace(
        scene.lower,
        supports=(*sides, Support("bottom", {up: 0.0})),
        loads=(weight,),
        material=MATERIAL,
    )
    part = replace(part, material=Material(5.0, 0.0))
    body = build_body(scene, part, 1, None)
    U = np.zeros(body.basis.N)
    U[body.free] = spsolve(body.A[body.free][:, body.free].tocsc(), body.load[body.free])
    z = body.locations[-1] + 2  # height above the support; length 2
    assert np.allclose(U[body.unknowns[-1]], -2 / 5 * (2 * z - z**2 / 2), atol=1e-12)
    assert np.allclose(U[body.unknowns[0]], 0, atol=1e-12)


def test_rigid_motions_of_curved_elements_cost_nothing():
    mesh = skfem.MeshQuad2.from_mesh(skfem.MeshQuad().refined(2))
    mesh.doflocs[1] += 0.1 * mesh.doflocs[0] ** 2
    mesh = mesh.with_boundaries({"contact": lambda x: x[0] == 0, "far": lambda x: x[0] == 1})
    part = Part("b", mesh, MATERIAL, (Support("far"),))
    for degree, nodes in ((1, 25), (2, 81)):
        body = build_body(Scene("s", part, Rigid("r"), 0.0, degree=degree), part, 1, None)
        turn = np.zeros(body.basis.N)
        turn[body.unknowns[0]], turn[body.unknowns[1]] = -body.locations[1], body.locations[0]
        assert body.unknowns.shape[1] == nodes
        assert np.abs(body.A @ turn).max() < 1e-12 * abs(body.A).max()


def test_cells_with_corners_in_any_order_are_cut_into_tetrahedra_that_fit():
    """Turns and mirror images number the corners of a cube in 48 ways; matching bodies match."""
    corners, ways = skfem.MeshHex().p, []
    for order, signs in product(permutations(range(3)), product([1, -1], repeat=3)):
        turned = (np.array(signs)[:, None] * (corners[list(order)] - 0.5) + 0.5).T
        ways.append([np.abs(corners.T - point).sum(axis=1).argmin() for point in turned])
    rng, grid, faces = np.random.default_rng(5), np.linspace(0, 1, 5), []
    for height in (grid - 1, grid):
        mesh = tensor_mesh(grid, grid, height)
        t = np.stack([cell[ways[rng.integers(48)]] for cell in mesh.t.T], axis=1)
        cut = simplices(skfem.MeshHex(mesh.p, t))
        assert len(cut.boundary_facets()) == 2 * len(mesh.boundary_facets())
        np.testing.assert_allclose(np.abs(volumes(cut)[0]), 1 / 64)  # six times
        flat = cut.facets[:, np.all(cut.p[2, cut.facets] == 0, axis=0)]
        faces.append({frozenset(map(tuple, cut.p[:, facet].T)) for facet in flat.T})
    assert faces[0] == faces[1] and len(faces[0]) == 32


@pytest.mark.parametrize("degree", [0, 3, 1.5, "2"])
def test_other_degrees_are_refused(degree):
    with pytest.raises(InputError, match="degree of the displacement must be 1 or 2"):
        scenes.make_scene("punch-2d", degree=degree)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_half_model_is_half_of_the_whole(degree):
    """The tangential component on the plane of symmetry belongs to the support."""
    x = np.array([0.0, 0.3, 0.7, 1.0])
    whole, half = (
        tensor_mesh(grid, np.linspace(0, 1, 4)) for grid in (np.concatenate([-x[:0:-1], x]), x)
    )
    both = []
    for mesh, copies in ((whole, 1), (half, 2)):
        mesh = rename(mesh, contact="y-", top="y+")
        hold = (Support("x-", {"x": 0.0}),) if copies == 2 else ()
        plate = Plate("top", {"y": -1.0})
        part = Part("b", mesh, MATERIAL, hold, (plate,))
        scene = Scene("s", part, Rigid("floor"), 0.2, degree=degree, copies=copies)
        reduction = reduce_bodies(scene)
        both.append((reduction.problem, solve(reduction.problem, tol=1e-12)))
    (a, first), (b, second) = both
    right = np.flatnonzero(a.coordinates[0] > 1e-12)
    right = right[np.argsort(a.coordinates[0, right])]
    own = np.flatnonzero(b.coordinates[0] > 1e-12)
    own = own[np.argsort(b.coordinates[0, own])]
    assert np.allclose(2 * first.reactions[right], second.reactions[own], atol=1e-9)
    assert first.multipliers[0] == pytest.approx(second.multipliers[0], rel=1e-9)


def test_the_gap_of_a_curved_body_does_not_alternate():
    """Edges are straight, the sphere is not: Part.curve knows."""
    scene = scenes.make_scene("sphere", degree=2, elements=8, mu=0.0)
    a = scene.reference.half_width
    ripple = []
    for made in (scene, replace(scene, upper=replace(scene.upper, curve=None))):
        problem = reduce_bodies(made, zone=a).problem
        pressure = solve(problem).reactions[:, 0] / problem.areas / scene.reference.peak
        order = np.argsort(problem.coordinates[0])
        ripple.append(np.abs(np.diff(pressure[order][:8], 3)).max())
    assert ripple[0] < 0.01 < 0.1 < ripple[1]


@pytest.mark.parametrize("name,elements", [("punch-2d", 6), ("sphere", 6), ("punch-3d", 2)])
@pytest.mark.parametrize("cut", [False, True])
def test_scenes_run_with_quadratic_elements(name, elements, cut, tmp_path):
    result = run(name, tmp_path, elements=elements, degree=2, simplices=cut)
    assert result.summary["status"] == "solved"
    assert result.summary["normal_force"] == pytest.approx(100)
    for field in result.fields:
        back = meshio.read(tmp_path / f"{field.name}.vtu")
        assert len(back.points) == field.displacement.shape[1] == len(field.stress)


@pytest.mark.parametrize("solver", ["superlu", "multigrid"])
@pytest.mark.parametrize("cut", [False, True])
def test_quadratic_bodies_by_products(solver, cut):
    """Q as an operator, bodies solved by factors or multigrid, against the explicit one."""
    scene = scenes.make_scene("punch-3d", elements=2, degree=2, simplices=cut)
    explicit = reduce_bodies(scene, Q="explicit").problem
    implicit = reduce_bodies(scene, Q="implicit", solver=solver).problem
    r = np.random.default_rng(0).standard_normal(explicit.q.size)
    assert np.abs(implicit.Q @ r - explicit.Q @ r).max() < 1e-7 * np.abs(explicit.Q @ r).max()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_small_elements_far_from_the_origin_keep_their_areas(dim, degree):
    near = tensor_mesh(*[np.linspace(0.0, 1.0, 5)] * dim).with_boundaries(
        {"contact": lambda x: x[-1] > 1 - 1e-6}
    )
    far = replace(near, doflocs=near.p + 1e5)
    found = [
        contact_trace(
            make_basis(mesh, degree, False), degree, mesh.boundaries["contact"], (1.0, False)
        )
        for mesh in (near, far)
    ]
    for here, there in zip(*found):
        assert abs(there - here).max() < 1e-8


@pytest.mark.parametrize("scale, off", [(1.0, 0.0), (1e-3, 100.0)])
def test_a_traction_on_bricks_of_second_order_wherever_they_are(scale, off):
    """Bricks of any shape, small and far from the origin."""
    mesh = skfem.MeshHex().refined(1)
    inside = np.all((mesh.p > 0) & (mesh.p < 1), axis=0)
    p = scale * (mesh.p + np.where(inside, 0.13, 0.0)) + off
    mesh = skfem.MeshHex2.from_mesh(skfem.MeshHex(p, mesh.t))
    sides = {"top": 1.0, "foot": 0.0}
    mesh = mesh.with_boundaries(
        {
            name: lambda x, at=at: abs(x[2] - off - at * scale) < 1e-3 * scale
            for name, at in sides.items()
        }
    )
    loads = (Traction("top", (1.0, 2.0, 3.0)),)
    part = Part("brick", mesh, MATERIAL, loads=loads, contact="foot")
    scene = Scene("s", part, Rigid("floor"), 0.0, kind="solid", copies=2)
    body = build_body(scene, part, 1, None)
    rows = body.load[body.unknowns]
    total = 2 * scale**2 * np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(rows.sum(axis=1), total, rtol=1e-9)
    places = body.locations[:2] - off
    np.testing.assert_allclose(places @ rows[2] / total[2], np.full(2, scale / 2), rtol=1e-9)
