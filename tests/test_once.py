"""What a solve needs more than once is computed once, and its value is that of a second way."""

from unittest.mock import patch

import numpy as np
import pytest
import skfem
from skfem.helpers import dot
from stacks import stack
from test_mortar import face, grid, line
from test_recovery import MESHES, assembled

from contactopt.bodies.element_stress import nodal_stress, recovery_errors, stress_in, stress_of
from contactopt.bodies.elements import weight_at
from contactopt.bodies.motions import free_motions
from contactopt.coupling import faces, mortar_matrices, segments
from contactopt.coupling.mortar import contact_normals, mortar
from contactopt.coupling.reduction import reduce_bodies
from contactopt.derivatives import linear
from contactopt.derivatives.interface import sensitivity
from contactopt.meshes.cells import straight, volumes
from contactopt.meshes.mesh_refinement import bent, divide
from contactopt.methods.driver import solve
from contactopt.problem import alone
from contactopt.readings.resolution import coarse


def curved_body(kind):
    """A body of second order, one side of which is bent."""
    mesh = MESHES["tetrahedra" if kind == "solid" else "triangles"]
    mesh = mesh.with_boundaries({"side": lambda x: x[0] == 1})
    return assembled(bent(mesh, {"side": lambda x: x + 0.02 * np.sin(3 * x[::-1])}), 2, kind)


@pytest.mark.parametrize("kind", ["solid", "plane-strain", "axisymmetric"])
def test_stress_and_inertia_are_those_of_the_basis_of_scikit_fem(kind):
    body = curved_body(kind)
    plain = skfem.Basis(body.basis.mesh, body.basis.elem, quadrature=(body.basis.X, body.basis.W))
    U = np.random.default_rng(0).standard_normal(plain.N)
    field, x = plain.interpolate(U), np.asarray(plain.global_coordinates())
    hoop = np.asarray(field)[0] / x[0] if body.weight[1] else None
    wanted = stress_of(body.kind.constants(body.material), np.asarray(field.grad), hoop)
    found = stress_in(body, U, plain.X)
    assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()
    some = np.array([5, 2])
    assert np.allclose(stress_in(body, U, plain.X, some), wanted[:, :, some], rtol=1e-12)
    mass = skfem.BilinearForm(lambda u, v, w: dot(u, v) * weight_at(body.weight, w.x))
    motions = free_motions(body.kind, plain, np.zeros(plain.N, dtype=bool), body.weight)
    inertia = mass.assemble(plain) @ motions.fields
    wanted = inertia @ np.linalg.inv(motions.fields.T @ inertia)
    assert np.abs(motions.forces - wanted).max() < 1e-12 * np.abs(wanted).max()


def test_stresses_take_no_shape_functions_for_every_displacement():
    """Not those of a basis, which are as many again for each component."""
    body = curved_body("solid")
    U = np.random.default_rng(0).standard_normal(body.basis.N)
    with patch.object(skfem.ElementVector, "gbasis", side_effect=AssertionError):
        assert np.isfinite(nodal_stress(body, U)).all()
        assert np.isfinite(recovery_errors(body, U, U, U[::-1])).all()


def test_facets_and_edges_of_a_divided_mesh_are_found_once():
    mesh = skfem.MeshTet.init_tensor(*[np.linspace(0, 1, 4)] * 3)
    mesh = mesh.with_boundaries({"side": lambda x: x[0] == 1})
    curves = {"side": lambda x: x + 0.02 * np.sin(3 * x[::-1])}
    found = skfem.MeshTet.build_entities
    with patch.object(skfem.Mesh, "build_entities", side_effect=found) as made:
        fine = divide(mesh, np.arange(9), curves)
        curved = bent(fine, curves)
        flat = straight(curved)
        assert curved.f2t.shape[1] == curved.nfacets == flat.nfacets and curved.nedges > 0
    # facets, edges, edges of facets of the new elements, and facets of a tetrahedron
    new = [call for call in made.call_args_list if call.args[0].shape[1] == fine.nelements]
    assert len(new) == 2
    for name in ("facets", "t2f", "f2t", "edges", "t2e"):
        own = getattr(type(curved)(curved.doflocs, curved.t), name)
        assert np.array_equal(getattr(curved, name), own)
    assert np.array_equal(flat.boundaries["side"], fine.boundaries["side"])
    places = np.asarray(curved.elem().doflocs).T
    places = np.column_stack([places, places.mean(axis=1)])
    assert np.allclose(volumes(curved), curved.mapping().detDF(places), rtol=1e-12)


def test_a_pair_alone_takes_one_product_and_what_needs_none_takes_none():
    reduction = reduce_bodies(stack(3, side=0.2), Q="implicit")
    problem = reduction.problem
    solution = solve(problem, tol=1e-9)
    u = problem.displacements(solution.reactions, solution.multipliers)
    for pair in problem.pairs:
        before = problem.Q.products
        part, own = alone(problem, solution, pair)
        assert problem.Q.products == before + 1
        moved = part.displacements(own.reactions, own.multipliers)
        assert np.abs(moved - u[pair.contacts]).max() < 1e-12 * np.abs(u).max()
    before = problem.Q.products
    coarse(reduction, solution)
    assert problem.Q.products == before


def test_the_transposed_solve_makes_one_model_of_q():
    problem = reduce_bodies(stack(2, 3, side=0.2), Q="implicit").problem
    back = sensitivity(problem, solve(problem, tol=1e-9))
    with patch.object(linear, "model_of", side_effect=linear.model_of) as made:
        back.adjoint(reactions=np.ones(problem.q.shape))
    assert made.call_count == 1


def two_sides(dim):
    """Two arcs that touch, of which the upper one has more nodes."""
    bow = {"y": lambda x: -0.1 * (x - 0.4) ** 2}
    if dim == 2:
        return line(grid(9), 2, True, **bow), line(grid(4), 2, False, **bow)

    def place(x):
        return np.stack([x[0], x[1], -0.1 * (x[0] - 0.4) ** 2 - 0.2 * x[1] ** 2])

    ticks = (grid(4), grid(5)), (grid(2), grid(3))
    return [face(*own, 2, up, True, place) for own, up in zip(ticks, (True, False))]


@pytest.mark.parametrize("dim", [2, 3])
def test_only_the_side_that_carries_the_contacts_gets_points_of_integration(dim):
    upper, lower = two_sides(dim)
    with patch.object(faces.Faces, "locate", autospec=True, side_effect=faces.Faces.locate) as seen:
        chosen = mortar(upper, lower)
        first = seen.call_count
        given = mortar(upper, lower, "upper")
    assert chosen.own == 0 and np.array_equal(chosen.gap, given.gap)
    assert dim == 2 or first == seen.call_count - first


@pytest.mark.parametrize("dim", [2, 3])
def test_points_of_integration_know_their_places_and_normals_however_they_are_cut(dim):
    upper, lower = two_sides(dim)
    points = segments.overlap(upper, lower, contact_normals(upper)[0]).points()
    which = points.cell // len(upper.cells)
    place, tangents = upper.locations(which, points.at)
    outward = faces.cross(tangents) * upper.turn[which]
    assert np.allclose(points.place, place, atol=1e-14)
    assert np.allclose(points.normal, outward / np.linalg.norm(outward, axis=0), atol=1e-14)
    whole = mortar(upper, lower)
    with patch.object(faces, "BLOCK", 7), patch.object(mortar_matrices, "BLOCK", 7):
        parts = mortar(upper, lower)
    for name in ("gap", "areas", "normals", "points", "lever"):
        assert np.allclose(getattr(parts, name), getattr(whole, name), rtol=1e-12, atol=1e-14)
    for one, other in zip(parts.weights, whole.weights):
        assert abs(one - other).max() < 1e-13
