"""Bodies that only contact holds: exact states, independence of how they are fixed."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
import turned
from stacks import block, stack

from contactopt import (
    BodyForce,
    Contact,
    InputError,
    Material,
    Part,
    Plate,
    Pressure,
    Rigid,
    Scene,
    Support,
    Traction,
    reduce_bodies,
    scenes,
    solve,
)
from contactopt.bodies import assemble, views
from contactopt.bodies import elastic as elastic_bodies
from contactopt.problem import InterfaceProblem
from contactopt.problem.unbalanced_loads import _names, escape, sentence
from contactopt.readings.quantities import elastic_energy
from contactopt.readings.resultants import pair_resultants

SOFT = Material(1000.0, 0.3)
FLOOR = Rigid("floor", normal=(0, 1))


def alone(part, floor=FLOOR, mu=0.5, **more):
    return Scene(
        "alone", bodies=(part, floor), contacts=(Contact(part.name, floor.name, mu),), **more
    )


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_block_under_its_own_weight_without_friction(dim, degree):
    """Confined sideways it stands in uniaxial strain."""
    sides = {"left": "x-", "right": "x+"} | ({"front": "y-", "back": "y+"} if dim == 3 else {})
    mesh = block([0.0] * dim, [1.0] * dim, [4] * dim)
    axes = {name: ("xy".index(side[0]), float(side[1] == "+")) for name, side in sides.items()}
    named = {name: lambda x, i=i, at=at: x[i] == at for name, (i, at) in axes.items()}
    supports = tuple(Support(name, {side[0]: 0.0}) for name, side in sides.items())
    load = BodyForce((0.0,) * (dim - 1) + (-2.0,))
    part = Part("b", mesh.with_boundaries(named), SOFT, supports, (load,), contact="bottom")
    floor = Rigid("floor", normal=(0.0,) * (dim - 1) + (1.0,))
    reduction = reduce_bodies(
        alone(part, floor, 0.0, kind="plane-strain" if dim == 2 else "solid", degree=degree)
    )
    problem = reduction.problem
    solution = solve(problem, tol=1e-12)
    assert problem.motions == (f"body 'b': translation along {'xyz'[dim - 1]}",)
    assert np.allclose(solution.reactions[:, 0] / problem.areas, 2.0, atol=1e-9)
    stiffness = 1000.0 * 0.7 / (1.3 * 0.4)
    if degree == 2:  # the displacement is quadratic
        assert solution.multipliers[0] == pytest.approx(-2.0 / (3 * stiffness), rel=1e-9)
        assert elastic_energy(reduction, solution) == pytest.approx(
            2.0**2 / (6 * stiffness), rel=1e-9
        )


def test_the_rounding_of_normals_is_no_load_along_a_face():
    """A side that is vertical to the last digit but one lifts nothing."""
    mesh = block([0.0, 0.0], [1.0, 1.0], [2, 2])
    p = mesh.p + 1e-16 * (mesh.p[0] == 1.0) * mesh.p[1] * [[1.0], [0.0]] * 2
    mesh = replace(mesh, doflocs=p).with_boundaries({"side": lambda x: x[0] > 0.9})
    held = (Support("left", {"x": 0.0}),)
    mesh = mesh.with_boundaries({"left": lambda x: x[0] == 0})
    part = Part("b", mesh, SOFT, held, (Pressure("side", 2.0),), contact="bottom")
    assert np.ptp(p[0, p[0] > 0.9]) > 0 and not np.any(reduce_bodies(alone(part)).problem.s)


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_traction_holds_a_block_as_a_plate_does(mu):
    """Uniform compression, once under a plate that may slide."""
    mesh = block([0, 0], [2, 1], [6, 4])
    pressed = Part("b", mesh, SOFT, loads=(Traction("top", (0.0, -3.0)),), contact="bottom")
    plate = Plate("top", {"y": -6.0}, glued=False)
    held = replace(pressed, loads=(plate,), supports=(Support("left", {"x": 0.0}),))
    free, guided = (reduce_bodies(alone(part, mu=0.0)) for part in (pressed, held))
    a, b = (solve(reduction.problem, tol=1e-12) for reduction in (free, guided))
    assert np.allclose(a.reactions[:, 0], b.reactions[:, 0], atol=1e-9)
    assert elastic_energy(free, a) == pytest.approx(elastic_energy(guided, b), rel=1e-9)
    with_friction = solve(reduce_bodies(alone(pressed, mu=mu)).problem, tol=1e-12)
    assert with_friction.solved and with_friction.reactions[:, 0].sum() == pytest.approx(6.0)


def test_a_roller_between_two_plates():
    """A disc that touches a floor and a plate."""
    circle = skfem.MeshTri.init_circle(4)
    disc = circle.with_boundaries({"below": lambda x: x[1] < -0.5, "above": lambda x: x[1] > 0.5})
    roller = Part("roller", disc, SOFT, contact="below")
    floor = Rigid("floor", normal=(0, 1), gap=lambda x: x[1] + 1)
    plate = Rigid("plate", normal=(0, 1), gap=lambda x: 1 - x[1], force={"y": -5.0})
    contacts = (Contact("roller", "floor", 0.3), Contact("plate", "roller:above", 0.3))
    reduction = reduce_bodies(Scene("roller", bodies=(roller, floor, plate), contacts=contacts))
    solution = solve(reduction.problem, tol=1e-11)
    below, above = pair_resultants(reduction, solution).values()
    assert solution.solved and len(reduction.problem.s) == 4
    assert np.allclose(below.force, [0.0, 5.0], atol=1e-9) and np.allclose(
        above.force, [0.0, 5.0], atol=1e-9
    )  # on the plate
    assert below.moment[0] == pytest.approx(0.0, abs=1e-9)
    normal = [np.sort(solution.reactions[pair.contacts, 0]) for pair in reduction.problem.pairs]
    assert np.allclose(*normal, atol=1e-7)


def test_a_ring_that_is_free_along_its_axis():
    tube = Part(
        "tube",
        block([1, 0], [2, 3], [4, 6]),
        SOFT,
        loads=(BodyForce((0.0, -2.0)),),
        contact="bottom",
    )
    reduction = reduce_bodies(alone(tube, mu=0.2, kind="axisymmetric"))
    solution = solve(reduction.problem, tol=1e-11)
    assert reduction.problem.motions == ("body 'tube': translation along z",)
    (found,) = pair_resultants(reduction, solution).values()
    assert found.force[1] == pytest.approx(2.0 * np.pi * (2**2 - 1**2) * 3)


@pytest.mark.parametrize("solver", ["superlu", "multigrid"])
def test_floating_bodies_are_in_equilibrium_inside(solver):
    """A U = loads + contact forces at every unknown of a body that nothing holds."""
    reduction = reduce_bodies(stack(2, 3, side=0.2), Q="implicit", solver=solver)
    solution = solve(reduction.problem, tol=1e-9)
    moved = reduction.displaced(solution)
    for body, B, U in zip(reduction.bodies, reduction.maps, moved):
        if views.fields(body, U) is not None:
            error = body.body.A @ U - body.body.load - B.T @ solution.reactions.ravel()
            assert np.abs(error).max() < 1e-6 * np.abs(body.body.load).max()
    u = sum(B @ U for B, U in zip(reduction.maps, moved)).reshape(-1, 3)
    u[:, 0] += reduction.gap
    expected = reduction.problem.displacements(solution.reactions, solution.multipliers)
    assert np.allclose(u, expected, atol=1e-6 * np.abs(expected).max())


def test_the_compliance_does_not_depend_on_the_fixing_unknowns():
    scene = stack(1, cells=(5,))
    made = assemble(scene, scene.parts[1], 1, None).body
    corner, opposite = (
        int(choose(made.locations.sum(axis=0))) for choose in (np.argmin, np.argmax)
    )
    fixing = np.sort([*made.unknowns[:, corner], made.unknowns[0, opposite]])
    other = replace(made, rigid_motions=replace(made.rigid_motions, fixing=fixing))
    T = reduce_bodies(scene).maps[1]
    first, second = (elastic_bodies.condense(body).through(T).entries() for body in (made, other))
    assert not np.array_equal(made.rigid_motions.fixing, other.rigid_motions.fixing)
    assert np.allclose(first, second, atol=1e-10 * np.abs(first).max())
    assert np.linalg.eigvalsh(first).min() > 0


def test_the_compliance_of_a_floating_body_converges_with_the_mesh():
    """A uniform pressure on the bottom of a free block moves it against its inertia: the same on
    every mesh.
    """
    values = []
    for n in (8, 16, 32):
        problem = reduce_bodies(stack(1, cells=(n,))).problem
        r = np.stack([problem.areas, 0 * problem.areas], axis=1).ravel()
        values.append(float(r @ problem.Q @ r))
    assert abs(values[2] - values[1]) < 0.3 * abs(values[1] - values[0])
    assert values[2] == pytest.approx(values[1], rel=0.01)


def test_multipliers_are_mean_displacements():
    reduction = reduce_bodies(stack(1, side=0.1, degree=2))
    solution = solve(reduction.problem, tol=1e-12)
    body = reduction.bodies[1]
    U = reduction.displaced(solution)[1]
    mean = body.body.rigid_motions.forces.T @ U
    assert np.allclose(mean, solution.multipliers, atol=1e-12)


@pytest.mark.parametrize("angle", [30.0, 90.0, 200.0])
def test_a_scene_that_is_turned_has_the_same_answer(angle):
    """The slope and the weight turn with it."""
    R = turned.turn(angle)
    plain = stack(1, side=0.3)
    part, floor = plain.parts[1], plain.parts[0]
    mesh = replace(part.mesh, doflocs=R @ part.mesh.p)
    force = tuple(R @ np.array(part.loads[0].value))
    other = alone(
        replace(part, mesh=mesh, loads=(BodyForce(force),)),
        replace(floor, normal=tuple(R @ [0.0, 1.0])),
    )
    a, b = (solve(reduce_bodies(scene).problem, tol=1e-12) for scene in (plain, other))
    if np.linalg.norm(a.reactions - b.reactions) > 1e-9:
        assert np.allclose(a.reactions, b.reactions[::-1], atol=1e-9)


@pytest.mark.parametrize("scene,message", [
    (stack(2, side=0.6), "body 'block.' slides off .translation along x"),
    (stack(2, 3, side=0.6, width=3.0), "body 'block.' slides off .translation along x"),
    (stack(2, weight=-1.0), "no contact holds body 'block.' .translation along y"),
    (stack(8, side=0.3, width=1.0),
     "more than the contacts can hold: body 'block.' tips over .rotation in the x-y plane"),
    (stack(2, kind="axisymmetric", weight=-1.0),
     "no contact holds body 'block.' .translation along z"),
], ids=["slides", "slides-3d", "lifts", "tips", "axis"])  # fmt: skip
def test_loads_that_nothing_balances_name_body_and_motion(scene, message):
    with pytest.raises(InputError, match=message):
        solve(reduce_bodies(scene).problem)


@pytest.mark.parametrize("side,holds", [(0.49, True), (0.51, False)])
def test_friction_holds_up_to_its_limit(side, holds):
    problem = reduce_bodies(stack(2, side=side, width=4.0, mu=0.5)).problem
    assert (escape(problem) is None) == holds
    if holds:
        assert solve(problem, tol=1e-9).solved


@pytest.mark.parametrize(("angle", "axis"), [(10.0, "x"), (80.0, "y")])
def test_a_motion_that_nothing_resists_is_named_after_its_largest_part(angle, axis):
    R = turned.turn(angle)
    mesh = block([0.0, 0.0], [1.0, 1.0], [2, 2])
    mesh = replace(mesh, doflocs=R @ mesh.p)
    part = Part("b", mesh, SOFT, (), (Traction("top", tuple(-R[:, 1])),), "bottom")
    (note,) = solve(reduce_bodies(alone(part, Rigid("floor", tuple(R[:, 1])), 0.0)).problem).notes
    assert f"motion of body 'b': translation along {axis}:" in note


@pytest.mark.parametrize("law", ["tied", "bilateral", "coulomb"])
@pytest.mark.parametrize("cells", [3, 4])
def test_a_scene_that_nothing_holds_is_solved_or_told_so(law, cells):
    """Two blocks on each other without supports."""

    def told(pull, side=0.0):
        loads = (Traction("top", (side, -1.0)),), (Traction("bottom", (0.0, 1.0 - pull)),)
        upper = Part(
            "upper", block([0.0, 0.0], [1.0, 1.0], [cells] * 2), SOFT, (), loads[0], "bottom"
        )
        lower = Part("lower", block([0.0, -1.0], [1.0, 0.0], [3, 3]), SOFT, (), loads[1], "top")
        pair = Contact("upper", "lower", mu=0.3 * (law != "tied"), law=law)
        return solve(reduce_bodies(Scene("loose", bodies=(upper, lower), contacts=(pair,))).problem)

    found = told(0.0)
    assert found.solved and found.reactions[:, 0].sum() == pytest.approx(1.0)
    (note,) = found.notes
    assert note.startswith("neither supports nor contacts resist a motion of body '")
    assert note.count("translation") == 2 and note.count("rotation") == 1
    for pull, side, motion in ((0.1, 0.0, "translation along y"), (0.0, 0.1, "")):
        with pytest.raises(InputError, match=rf"neither supports nor contacts hold .*{motion}"):
            told(pull, side)


def test_plates_that_are_pulled_off_are_named():
    scene = scenes.flat_punch(2, elements=6)
    lifted = replace(scene, upper=replace(scene.upper, loads=(Plate("top", {"y": 10.0}),)))
    with pytest.raises(
        InputError, match=r"pulls the bodies apart.*body 'punch' .plate 'top' along y"
    ):
        solve(reduce_bodies(lifted).problem)


@pytest.mark.parametrize("law,holds", [("tresca", 0.25), ("frictionless", 0.0)])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_given_bound_of_friction_holds_up_to_bound_times_area(law, holds, dim):
    """A block on an area of one, askew, pushed along the floor by F and pressed by one."""
    part, c, s = Part("b", block([0.0] * dim, [1.0] * dim, [3] * dim), SOFT), 0.8, 0.6
    turn = np.eye(dim)
    turn[0, 0], turn[0, -1], turn[-1, 0], turn[-1, -1] = c, -s, s, c
    mesh = replace(part.mesh, doflocs=turn @ part.mesh.p)
    floor, kind = Rigid("floor", tuple(turn[:, -1])), "solid" if dim == 3 else "plane-strain"

    def told(along, normal):
        load = BodyForce(tuple(along * turn[:, 0] + normal * turn[:, -1]))
        loaded = replace(part, mesh=mesh, loads=(load,), contact="bottom")
        pair = Contact("b", "floor", 0.25, law=law)
        scene = Scene("given", bodies=(loaded, floor), contacts=(pair,), kind=kind)
        problem = reduce_bodies(scene).problem
        found = escape(problem)
        return "" if found is None else sentence(problem, found)

    assert "slides off" in told(1.03 * holds + 1e-3, -1.0) and told(0.0, 1.0)
    assert told(0.97 * holds, -1.0) == ""  # the polygon of directions in space is 2 percent wide


def test_a_body_far_from_the_origin_floats_as_well():
    near, far = stack(1, side=0.2), stack(1, side=0.2)
    part = far.parts[1]
    moved = replace(part, mesh=replace(part.mesh, doflocs=part.mesh.p + 1e4))
    floor = Rigid("floor", normal=(0, 1), gap=lambda x: x[1] - 1e4)
    a, b = (solve(reduce_bodies(scene).problem, tol=1e-9) for scene in (near, alone(moved, floor)))
    assert np.allclose(a.reactions, b.reactions, atol=1e-6)


@pytest.mark.parametrize("side,holds", [(0.08, True), (0.09, False), (0.6, False)])
def test_a_tall_tower_of_many_bodies_stands_up_to_its_limit(side, holds):
    """Twelve blocks, 36 motions: it topples at a side force of width / height = 1 / 12 of its
    weight, and slides at mu.
    """
    scene = stack(12, side=side, cells=(1,), mu=0.5)
    if holds:
        problem = reduce_bodies(scene).problem
        solution = solve(problem)
        assert solution.solved and escape(problem) is None
        assert solution.reactions[:2, 0].sum() == pytest.approx(12.0, rel=1e-9)
    else:
        with pytest.raises(InputError, match="more than the contacts can hold"):
            solve(reduce_bodies(scene).problem)


def test_a_rigid_normal_on_the_wrong_side_is_refused():
    """A floor whose normal points down would hold a block that is pulled up."""
    part = Part(
        "b",
        block([0.0, 0.0], [1.0, 1.0], [2, 2]),
        SOFT,
        loads=(BodyForce((0.0, 2.0)),),
        contact="bottom",
    )
    for floor in (
        Rigid("floor", normal=(0, -1)),
        Rigid("floor", normal=(0, -2), gap=lambda x: x[1] + x[0] ** 2),
    ):
        with pytest.raises(InputError, match="points away from body 'b'"):
            reduce_bodies(alone(part, floor))


def test_loose_motions_are_named_in_the_order_of_the_problem():
    """Whichever is found first: the third is the largest here."""
    labels = tuple(f"body 'a': translation along {axis}" for axis in "xyz")
    none = np.zeros((1, 3))
    problem = InterfaceProblem(np.eye(3), none, [0.0], V=np.eye(3), s=none[0], motions=labels)
    loose = np.array([[0.6, 0.0], [0.8, 0.0], [0.0, 1.0]])
    assert _names(problem, loose) == ", ".join(labels[1:])
