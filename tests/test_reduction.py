from dataclasses import replace

import numpy as np
import pytest
from conftest import MATERIAL, block, two_blocks

from contactopt import (
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    reduce,
    reduce_bodies,
    scenes,
    solve,
)
from contactopt.coupling.back_to_bodies import recover

KINDS = ["plane-strain", "axisymmetric", "solid"]
AREA = {"plane-strain": 1.0, "axisymmetric": np.pi, "solid": 1.0}


@pytest.mark.parametrize("kind", KINDS)
def test_patch_test_uniform_pressure_is_exact(kind):
    """Two blocks without friction under a frictionless plate: p = F/A, approach = F/A (h1 + h2) / E
    (or plane strain).
    """
    scene = two_blocks(kind, force=3.0)
    reduction = reduce_bodies(scene)
    problem = reduction.problem
    solution = solve(problem, tol=1e-12)
    pressure = 3.0 / AREA[kind]
    assert solution.solved
    assert np.abs(solution.reactions[:, 0] / problem.areas / pressure - 1).max() < 1e-10
    modulus = 5 / (1 - 0.3**2) if kind == "plane-strain" else 5
    assert -solution.multipliers[0] == pytest.approx(3 * pressure / modulus, rel=1e-10)
    for field in recover(reduction, solution):
        axial = field.stress[:, 2 if kind == "solid" else 1]
        assert np.abs(axial / pressure + 1).max() < 1e-10
        expected = pressure if kind != "plane-strain" else pressure * np.sqrt(1 - 0.3 + 0.3**2)
        assert np.abs(field.von_mises / expected - 1).max() < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_compliance_is_the_trailing_block_of_the_inverse(kind):
    for body in reduce_bodies(two_blocks(kind)).bodies:
        free = body.body.free
        inverse = np.linalg.inv(body.body.A[free][:, free].toarray())
        place = np.searchsorted(free, body.interface)
        expected = inverse[np.ix_(place, place)]
        assert (
            np.abs(body.solver.trailing_inverse() - expected).max() < 1e-12 * np.abs(expected).max()
        )


@pytest.mark.parametrize(
    "scene",
    [
        *map(two_blocks, KINDS),
        scenes.flat_punch(3, elements=3),
        scenes.sphere(elements=6, rigid="sphere"),
    ],
)
def test_products_by_body_solves_are_those_of_the_explicit_operator(scene):
    reduction = reduce_bodies(scene)
    Q = reduction.problem.Q
    assert np.abs(reduction.operator @ np.eye(len(Q)) - Q).max() < 1e-11 * np.abs(Q).max()


def test_schur_complement_is_the_inverse_of_the_compliance():
    """Eq (13): S = A_cc - A_ci A_ii^-1 A_ic."""
    body = reduce_bodies(scenes.flat_punch(2, elements=6)).bodies[1]
    contact = body.interface
    interior = np.setdiff1d(body.body.free, contact)
    A = body.body.A
    A_ii, A_ic = A[interior][:, interior].toarray(), A[interior][:, contact].toarray()
    S = A[contact][:, contact].toarray() - A_ic.T @ np.linalg.solve(A_ii, A_ic)
    assert np.abs(S @ body.solver.trailing_inverse() - np.eye(len(S))).max() < 1e-10


@pytest.mark.parametrize(
    "scene",
    [scenes.flat_punch(2, elements=4), scenes.flat_punch(3, elements=3), scenes.sphere(elements=6)],
)
def test_recovered_bodies_are_in_equilibrium_and_meet_the_interface_equation(scene):
    reduction = reduce_bodies(scene)
    problem = reduction.problem
    solution = solve(problem, tol=1e-10)
    fields = recover(reduction, solution)
    jump = np.zeros(problem.q.shape)
    for body, B, field in zip(reduction.bodies, reduction.maps, fields):
        basis = body.body.basis
        U = np.zeros(basis.N)
        U[basis.nodal_dofs] = field.displacement
        force = B.T @ solution.reactions.ravel()
        free = body.body.free
        assert (
            np.abs((body.body.A @ U - body.body.load - force)[free]).max()
            < 1e-9 * np.abs(force).max()
        )
        jump += (B @ U).reshape(jump.shape)
    rest = problem.displacements(solution.reactions, solution.multipliers) - jump
    assert np.abs(rest[:, 1:]).max() < 1e-9
    x = problem.coordinates[0]
    # what is left is the initial gap below the sphere
    radius = 400.0 if scene.name == "sphere" else np.inf
    assert np.allclose(
        rest[:, 0], 0.0 if radius == np.inf else radius - np.sqrt(radius**2 - x**2), atol=1e-9
    )


def test_half_model_gives_the_answer_of_the_whole():
    """The mirror image, modelled: same pressure, same approach, same total force."""
    half = scenes.flat_punch(2, elements=6)

    def mirrored(part, keep):
        mesh = part.mesh(6, None)
        whole = mesh + mesh.mirrored((1, 0))
        names = {
            name: lambda x, b=mesh.p[:, mesh.facets[:, mesh.boundaries[name]]]: (
                np.isclose(x[1], b[1].max()) & (np.abs(x[0]) <= b[0].max() * (1 + 1e-9))
            )
            for name in keep
        }
        return replace(part, mesh=whole.with_boundaries(names), supports=part.supports[1:])

    upper = mirrored(half.upper, ("contact", "top"))
    lower = mirrored(half.lower, ("contact", "bottom"))
    whole = replace(half, upper=upper, lower=lower, copies=1)
    a, b = (solve(reduce(scene), tol=1e-11) for scene in (half, whole))
    pa, pb = reduce(half), reduce(whole)
    right = np.flatnonzero(pb.coordinates[0] >= -1e-9)
    right = right[np.argsort(pb.coordinates[0, right])]
    assert b.multipliers == pytest.approx(a.multipliers, rel=1e-8)
    assert np.allclose(b.reactions[right, 0][1:] * 2, a.reactions[1:, 0], rtol=1e-7)
    assert b.reactions[:, 0].sum() == pytest.approx(100.0) == pytest.approx(a.reactions[:, 0].sum())
    assert np.allclose(
        (b.reactions / pb.areas[:, None])[right], a.reactions / pa.areas[:, None], atol=1e-8
    )
    assert np.allclose(b.reactions[::-1, 1], -b.reactions[:, 1], atol=1e-8)


def test_a_plate_that_a_support_resists_is_condensed():
    """No multiplier is left, the problem is linear in the force, and the plate only redistributes
    it.
    """
    base = two_blocks("plane-strain", mu=0.4)
    mesh = base.upper.mesh.with_boundaries({"grip": lambda x: (x[0] == 0) & (x[1] < 0.4)})
    held = replace(base.upper, mesh=mesh, supports=(Support("grip"),))
    scenes_ = [
        replace(base, upper=replace(held, loads=(Plate("top", {"y": -f}),))) for f in (3.0, 6.0)
    ]
    problem, doubled = (reduce(scene) for scene in scenes_)
    assert problem.V.shape == (2 * 5, 0)
    assert np.allclose(doubled.q, 2 * problem.q) and np.any(problem.q)
    one, two = solve(problem, tol=1e-10), solve(doubled, tol=1e-10)
    assert one.solved and np.allclose(two.reactions, 2 * one.reactions, atol=1e-7)
    # Condensed plate = the constraint "all of the top moves as one", here by minimising the energy
    # over its height.
    body = reduce_bodies(scenes_[0]).bodies[0]
    A, M = body.body.A, body.body.motion[:, 0]
    free = np.append(body.body.free, A.shape[0])
    bordered = np.block(
        [[A.toarray(), (A @ M)[:, None]], [(A @ M)[None], np.array([[M @ (A @ M)]])]]
    )
    load = np.append(np.zeros(A.shape[0]), -3.0)
    x = np.zeros(len(load))
    x[free] = np.linalg.solve(bordered[np.ix_(free, free)], load[free])
    assert np.allclose(body.at_rest, x[:-1] + M * x[-1], atol=1e-12)


def test_prescribed_displacement_loads_as_the_force_it_needs():
    base = two_blocks("plane-strain", force=3.0)
    driven = replace(
        base.upper, loads=(), supports=(*base.upper.supports, Support("top", {"y": -1.2}))
    )
    solution = solve(reduce(replace(base, upper=driven)), tol=1e-11)
    assert solution.reactions[:, 0].sum() == pytest.approx(1.2 / 3 * 5 / (1 - 0.3**2), rel=1e-9)


def test_a_rigid_body_is_the_limit_of_a_stiff_one():
    stiff = reduce(scenes.flat_punch(2, elements=6, upper=Material(5e7, 0.3)))
    rigid = reduce(scenes.flat_punch(2, elements=6, rigid="punch"))
    a, b = solve(stiff, tol=1e-10), solve(rigid, tol=1e-10)
    assert np.allclose(a.reactions, b.reactions, atol=1e-3 * np.abs(b.reactions).max())
    assert a.multipliers[0] == pytest.approx(b.multipliers[0], rel=1e-4)
    floor = solve(reduce(scenes.flat_punch(2, elements=6, rigid="foundation")), tol=1e-10)
    assert floor.solved and floor.reactions[:, 0].sum() == pytest.approx(100)


def test_units_change_nothing():
    """N-mm-MPa against N-m-Pa."""
    mm = scenes.flat_punch(2, elements=6)
    m = scenes.flat_punch(
        2,
        elements=6,
        width=0.04,
        height=0.04,
        foundation_width=0.16,
        foundation_height=0.08,
        depth=0.04,
        upper=Material(5e6, 0.3),
        lower=Material(5e6, 0.3),
    )
    a, b = solve(reduce(mm), tol=1e-11), solve(reduce(m), tol=1e-11)
    assert np.allclose(a.reactions, b.reactions, atol=1e-8)
    assert a.multipliers[0] == pytest.approx(1e3 * b.multipliers[0], rel=1e-9)


def test_coulomb_solution_turns_with_the_scene():
    """The same two blocks on their side: normals come from the mesh, not from an axis."""

    def turned(part, sides):
        mesh = part.mesh
        flipped = type(mesh)(np.stack([-mesh.p[1], mesh.p[0]]), mesh.t, _boundaries=mesh.boundaries)
        swap = {"x": "y", "y": "x"}
        supports = tuple(
            Support(s.boundary, {swap[c]: v for c, v in s.displacement.items()})
            for s in part.supports
        )
        loads = tuple(Plate(p.boundary, {"x": -p.force["y"]}, glued=p.glued) for p in part.loads)
        return replace(part, mesh=flipped, supports=supports, loads=loads)

    base = two_blocks("plane-strain", mu=0.2)
    base = replace(base, upper=replace(base.upper, material=Material(50.0, 0.1)))
    side = replace(base, upper=turned(base.upper, 1), lower=turned(base.lower, 1))
    a, b = solve(reduce(base), tol=1e-10), solve(reduce(side), tol=1e-10)
    assert a.solved and b.solved
    assert np.allclose(np.sort(a.reactions[:, 0]), np.sort(b.reactions[:, 0]), atol=1e-8)
    assert np.allclose(
        np.sort(np.abs(a.reactions[:, 1])), np.sort(np.abs(b.reactions[:, 1])), atol=1e-8
    )


@pytest.mark.parametrize(
    "cells,shift,message", [(5, 0.0, "has 5 contact nodes"), (4, 0.05, "lies .* off the normal")]
)
def test_interface_nodes_that_do_not_match_are_refused(cells, shift, message):
    base = two_blocks("plane-strain")
    mesh = block("plane-strain", -2, 0, cells)
    inner = (mesh.p[0] > 0) & (mesh.p[0] < 1)
    moved = type(mesh)(
        mesh.p + shift * np.stack([inner, 0 * inner]), mesh.t, _boundaries=mesh.boundaries
    )
    with pytest.raises(InputError, match=f"interface nodes do not match.*{message}.*same nodes"):
        reduce_bodies(replace(base, lower=replace(base.lower, mesh=moved)), coupling="matching")


def test_rigid_gap_must_be_finite():
    base = two_blocks("plane-strain")
    with pytest.raises(InputError, match="not finite"):
        reduce(replace(base, lower=Rigid("wall", gap=lambda x: np.full(x.shape[1], np.nan))))


def test_two_rigid_bodies_are_refused():
    with pytest.raises(InputError, match=r"both bodies of contact .* are rigid"):
        Scene("s", Rigid("a"), Rigid("b"), 0.1)


def test_a_plate_that_moves_along_the_contact():
    """Two multipliers, pressed and dragged: sticks below the friction limit, and the shift is an
    output.
    """
    mesh = block("plane-strain", 0, 1)
    upper = Part("u", mesh, MATERIAL, (), (Plate("top", {"x": 0.5, "y": -3.0}),), contact="bottom")
    lower = Part("l", block("plane-strain", -2, 0), MATERIAL, (Support("bottom"),), contact="top")
    problem = reduce(Scene("drag", upper, lower, 0.5))
    assert problem.V.shape == (10, 2)
    solution = solve(problem, tol=1e-9)
    assert solution.solved
    assert solution.reactions[:, 0].sum() == pytest.approx(3.0)
    assert solution.reactions[:, 1].sum() == pytest.approx(-0.5)
    assert solution.multipliers[0] > 0 > solution.multipliers[1]
