"""Stresses and tractions of bounds are in equilibrium, and their constants are proved."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import Material
from contactopt.bounds.bound import Bound
from contactopt.bounds.displaced_stress import halved
from contactopt.bounds.equilibrium_elements import EquilibriumElements
from contactopt.bounds.facing_facets import facet_rule
from contactopt.bounds.nearest_tractions import BalancedMoments, ForceResponse
from contactopt.bounds.tetrahedra import Tetrahedra
from contactopt.bounds.uneven_traction import (
    CONSTANT,
    least_energy,
    regular_tetrahedron,
    uneven_squares,
)
from contactopt.bounds.vertex_balance import Balance
from contactopt.meshes.cells import measures
from contactopt.solving.solve_scene import solve_scene
from experiments.questions.bounds import compatible, composite
from tests.test_bounds import MATERIAL, block, cubes, narrower, two_blocks


def clamped(mesh):
    """Displacements of a body that is held all around, under nodal forces."""
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))
    K = linear_elasticity(*lame_parameters(MATERIAL.E, MATERIAL.nu)).assemble(basis)
    inner = np.setdiff1d(np.arange(basis.N), basis.get_dofs().flatten())

    def moved(forces):
        U, table = np.zeros(basis.N), basis.nodal_dofs
        own = np.zeros(basis.N)
        own[table] = forces
        U[inner] = np.linalg.solve(K[inner][:, inner].toarray(), own[inner])
        return U[table]

    return moved


def test_tractions_in_space_become_those_of_elements_in_balance():
    """Of random ones, whose map has the transpose that it says, and is the identity afterwards."""
    random = np.random.default_rng(3)
    cube = skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 4)] * 3)
    inner = np.all((cube.p > 1e-9) & (cube.p < 1 - 1e-9), axis=0)
    p = cube.p + 0.05 * inner * random.standard_normal(cube.p.shape)
    cells = Tetrahedra(skfem.MeshTet(p, cube.t))
    known = np.zeros((cube.facets.shape[1], 3), dtype=bool)
    balance = Balance(cells.forces_of_moments, known)
    space = BalancedMoments(cells, MATERIAL, balance, ForceResponse(1, clamped(cells.mesh)))
    m, other = random.standard_normal((2, 3 * len(known), 3))
    made = space.of(m)
    forces, torques = on_elements(cells, made)
    assert np.abs(forces).max() < 1e-12 and np.abs(torques).max() < 1e-12
    assert np.abs(on_elements(cells, m)[0]).max() > 1.0
    assert np.allclose(space.of(made), made, atol=1e-12)
    assert np.isclose(np.sum(other * made), np.sum(space.transposed(other) * m))


def on_elements(cells, m):
    """Forces and torques (e, 3) on elements by moments of the tractions of their facets."""
    own = cells.seen(m.reshape(-1, 3, 3))  # (4, 3, e, 3)
    x = np.moveaxis(cells.mesh.p[:, cells.mesh.t[cells.others]], 0, -1)
    return own.sum(axis=(0, 1)), np.cross(x, own).sum(axis=(0, 1))


def test_a_linear_stress_is_its_own_equilibrated_stress():
    """With random facets, loads and a stress that balances them exactly, s* = s."""
    mesh, d, random = skfem.MeshTet().refined(1), 3, np.random.default_rng(0)
    p = mesh.p.copy()
    inner = np.all((p > 1e-9) & (p < 1 - 1e-9), axis=0)
    p[:, inner] += 0.05 * random.standard_normal(p[:, inner].shape)
    cells = Tetrahedra(type(mesh)(p, mesh.t))
    slopes = random.standard_normal((d, d, d))
    slopes += slopes.swapaxes(0, 1)
    stress = np.einsum("ijk,kae->eaij", slopes, cells.mesh.p[:, cells.mesh.t])
    held = np.zeros((mesh.facets.shape[1], d), dtype=bool)
    held[cells.mesh.f2t[1] < 0] = True
    load, none = -np.einsum("ijj->i", slopes), np.zeros((*held.shape, d))
    answer = ForceResponse(1, clamped(cells.mesh))
    made, unbalanced = cells.equilibrated(MATERIAL, stress, load, held, none, answer)
    assert np.allclose(made, cells.data_of(stress), atol=1e-12) and unbalanced < 1e-12
    data = cells.data_of(stress)
    E, nu = MATERIAL.E, MATERIAL.nu
    trace = np.trace(stress, axis1=2, axis2=3)
    points = ((1 + nu) * np.sum(stress**2, axis=(2, 3)) - nu * trace**2) / E
    mean, own = stress.mean(axis=1), np.trace(stress.mean(axis=1), axis1=1, axis2=2)
    middle = ((1 + nu) * np.sum(mean**2, axis=(1, 2)) - nu * own**2) / E
    exact = cells.volume * (points.sum(axis=1) + (d + 1) ** 2 * middle) / ((d + 1) * (d + 2))
    assert np.allclose(cells.products(MATERIAL, data, data), exact)


def test_the_nearest_stress_does_not_depend_on_the_numbering():
    """On a strip that is held all around; its elements have stresses of their own."""
    strip, energies = skfem.MeshTri.init_tensor(np.linspace(0, 1, 5), [0.0, 0.7]), []
    stress = np.random.default_rng(1).standard_normal((strip.nelements, 1, 4))
    stress[..., 3] = MATERIAL.nu * (stress[..., 0] + stress[..., 1])
    stress = np.repeat(stress, 18, axis=1)
    for order in (
        np.arange(strip.nvertices),
        np.random.default_rng(2).permutation(strip.nvertices),
    ):
        place = np.argsort(order)
        mesh = skfem.MeshTri(strip.p[:, order], place[strip.t], sort_t=False)
        cells = EquilibriumElements(mesh, 1, False)
        held = (cells.mesh.f2t[1] < 0)[:, None] & np.ones((1, 2), dtype=bool)
        none = np.zeros((*held.shape, 2))
        made, unbalanced = cells.equilibrated(MATERIAL, stress, np.zeros(2), held, none)
        missing = made - cells.data_of(stress)
        energies.append(cells.products(MATERIAL, missing, missing).sum())
        assert unbalanced < 1e-12
    assert energies[0] > 1e-6 and np.isclose(*energies, rtol=1e-10)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("inner", [0.0, 0.5, 50.0, None])
def test_a_stress_of_a_section_does_the_work_of_the_loads(degree, inner):
    """For every displacement, from any stress: it is in equilibrium everywhere."""
    random, mesh, revolved = np.random.default_rng(1), block(4), inner is not None
    mesh = replace(mesh, doflocs=mesh.p + np.array([[inner or 0.0], [0.0]]))
    cells = EquilibriumElements(mesh, degree, revolved)
    first, second = mesh.facets
    height = mesh.p[1, mesh.facets]
    held = np.repeat(np.all(height < 1e-9, axis=0)[:, None], 2, axis=1)
    loaded = np.all(height > 1 - 1e-9, axis=0)
    length = np.linalg.norm(mesh.p[:, second] - mesh.p[:, first], axis=0)
    axis = mesh.p[0] < 1e-9 if revolved else np.zeros(mesh.nvertices, dtype=bool)
    t = random.standard_normal((2, mesh.nvertices)) * ~axis  # in a ring r times tractions
    one, other = t[:, first], t[:, second]
    moments = np.stack([2 * one + other, one + 2 * other]).transpose(2, 0, 1) / 6
    moments *= (length * loaded)[:, None, None]
    force = np.array([1.3, 0.0 if revolved and degree == 1 else -2.0])
    near = random.standard_normal((mesh.nelements, 18 * degree, 4))
    made, unbalanced = cells.equilibrated(MATERIAL, near, force, held, moments)
    w = random.standard_normal((2, mesh.nvertices + len(length)))
    x = cells.quadratic(mesh.p)
    w[:, x[1] < 1e-9] = 0.0
    if revolved:
        w[0, x[0] < 1e-9] = 0.0
    found = cells.products(MATERIAL, made, cells.stress(MATERIAL, w)).sum()
    basis = skfem.CellBasis(mesh, skfem.ElementTriP2(), intorder=4)
    measure = skfem.LinearForm(lambda v, own: (own.x[0] if revolved else 1.0) * v).assemble(basis)
    places = np.argsort(np.lexsort(x)), np.lexsort(basis.doflocs)
    work = force @ w @ measure[places[1][places[0]]]
    a, b, c = w[:, first], w[:, second], w[:, mesh.nvertices + np.arange(len(length))]
    # of a quadratic displacement and a linear traction
    ends = one * (a + 2 * c) + other * (b + 2 * c)
    work += np.sum(ends * length * loaded) / 6
    assert abs(found - work) < 1e-11 * max(1.0, inner or 0.0) and unbalanced < 1e-11


def test_the_stress_of_a_bilinear_displacement():
    """Slopes are those between points near it; on parallelograms the displacement is quadratic."""
    random = np.random.default_rng(0)
    square = skfem.MeshQuad().refined(2)
    sheared = replace(square, doflocs=np.array([[1.0, 0.3], [-0.2, 0.8]]) @ square.p)
    U = random.standard_normal((2, square.nvertices))
    halves = halved(sheared)
    cells = EquilibriumElements(halves.mesh, 1, False, halves.corners)
    plain, nodal = EquilibriumElements(halves.mesh, 1, False), cells.quadratic(U)
    for facet in np.flatnonzero(halves.mesh.f2t[1] >= 0):
        own = halves.corners[:, halves.mesh.f2t[:, facet]]
        if set(own[:, 0]) == set(own[:, 1]):  # a diagonal
            nodal[:, halves.mesh.nvertices + facet] = U[:, own[:, 0]].mean(axis=1)
    one = cells.stress(MATERIAL, cells.quadratic(U))
    assert np.allclose(one, plain.stress(MATERIAL, nodal))
    bent = replace(square, doflocs=square.p + 0.02 * random.standard_normal(square.p.shape))
    halves = halved(bent)
    basis = skfem.CellBasis(bent, skfem.ElementVector(skfem.ElementQuad1()), intorder=6)
    cells = EquilibriumElements(halves.mesh, 1, False, halves.corners)
    found = cells.stress(MATERIAL, cells.quadratic(U))
    energy = linear_elasticity(*lame_parameters(1000.0, 0.3)).assemble(basis)
    flat = U.T.ravel()
    whole = cells.products(MATERIAL, found, found).sum()
    assert np.isclose(whole, flat @ energy @ flat, rtol=1e-4)


@pytest.mark.slow
def test_the_constant_of_uneven_tractions_is_proved():
    """By composite stresses from above, and by displacements from below."""
    most = composite(3) / (1 - 0.5**3)
    assert 0.99 * CONSTANT < most <= CONSTANT
    points = regular_tetrahedron().mesh.p
    assert compatible(points, Material(1.0, 0.0), np.eye(3), 3) > 0.77 * CONSTANT


@pytest.mark.parametrize("shape", ["regular", "tall", "flat", "any"])
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49])
def test_no_uneven_traction_needs_more_energy_than_its_bound(shape, nu):
    """The worst of all tractions on simplices of any shape, turned, and in other units."""
    random, dim = np.random.default_rng(3), 3
    height = {"tall": 4.0, "flat": 0.25}.get(shape, 1.0)
    points = np.diag([1.0] * (dim - 1) + [height]) @ regular_tetrahedron().mesh.p
    if shape == "any":
        points = points + 0.2 * random.standard_normal(points.shape)
    material = Material(1000.0, nu)
    weight = weight_of(points, material)
    assert 0.03 < compatible(points, material, weight, 5 - dim) < 1
    turn = np.linalg.qr(random.standard_normal((dim, dim)))[0]
    order = random.permutation(dim)
    other = weight_of(1e3 * turn @ points[:, [*order, dim]], material)
    assert np.allclose(turn.T @ other @ turn / 1e3, weight, atol=1e-12 * np.abs(weight).max())


def weight_of(points, material):
    """W: a traction d on the facet of the first vertices needs at most the energy int d' W d."""
    dim = len(points)
    cells = Tetrahedra(skfem.MeshTet(points, np.arange(dim + 1)[:, None]))
    size, first = measures(points[:, :dim, None]), np.zeros(1, dtype=int)

    def energy(d):
        return least_energy(cells, material, first, size, np.outer(d, d)[None])[0]

    units = np.eye(dim)
    return np.array([[(energy(a + b) - energy(a - b)) / 4 for a in units] for b in units])


@pytest.mark.parametrize(
    "scene", [two_blocks(1, below=4), narrower(), cubes(1, below=2), cubes(1, wide=0.63)]
)
def test_what_is_uneven_is_the_traction_less_its_linear_part(scene):
    """By the places of one side alone, where each finds the facet of the other one about it."""
    scene = Bound(solve_scene(scene)).scene
    pair, d = scene.pairs[0], scene.problem.dim
    (lead, other), frame = pair.points, pair.frame[1:]
    at, weights = facet_rule(d, {2: 2000, 3: 40}[d])
    t = pair.of_contacts(scene.tractions) @ pair.frame  # at the vertices of the first side
    inverse = np.linalg.inv(
        np.concatenate([np.ones((1, d, lead.shape[2])), np.einsum("ad,dvf->avf", frame, lead)]).T
    )
    for f in range(other.shape[2]):
        x = frame @ (other[..., f] @ at)
        shares = np.einsum("fav,as->fvs", inverse, np.concatenate([np.ones((1, x.shape[1])), x]))
        inside = shares.min(axis=1)  # (f, s)
        place, there = inside.argmax(axis=0), inside.max(axis=0) > -1e-9
        own = np.einsum("vs,vsd->ds", shares[place, :, np.arange(len(place))].T, t[:, place])
        own *= there
        gram = np.einsum("s,vs,ws->vw", weights, at, at)
        linear = np.linalg.solve(gram, np.einsum("s,vs,ds->vd", weights, at, own))
        rest = own - np.einsum("vd,vs->ds", linear, at)
        wanted = measures(other)[f] * np.einsum("s,ds,es->de", weights, rest, rest)
        found = uneven_squares(scene, pair)[f]
        assert np.allclose(found, wanted, atol=0.03 * np.trace(wanted) + 1e-12)
