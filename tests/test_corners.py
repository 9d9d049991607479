"""Contact boundaries around corners: each side has its normals and areas, and curves stay whole."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import skfem
from turned import mirror, moved, turn

from contactopt import (
    Contact,
    InterfaceProblem,
    Material,
    Part,
    Pressure,
    Scene,
    Support,
    Traction,
    natural_map_residual,
    reduce,
    run,
    solve,
)
from contactopt.bodies.corners import copies
from contactopt.bodies.elements import make_basis
from contactopt.methods import exchanged
from contactopt.problem.chart import Pair
from contactopt.problem.laws import find_law

E, NU = 1e4, 0.3
STRESS = {2: np.array([-0.6, -1.0]), 3: np.array([-0.6, -0.3, -1.0])}
KINDS = {
    ("quad", 2): skfem.MeshQuad,
    ("tri", 2): skfem.MeshTri,
    ("quad", 3): skfem.MeshHex,
    ("tri", 3): skfem.MeshTet,
}


def box(low: float, high: float, cells: int, kind: str, dim: int):
    """A square or cube with the boundaries low0, high0, ... and `rest` of all low ones."""
    mesh = KINDS[kind, dim].init_tensor(*[np.linspace(low, high, cells + 1)] * dim)
    return with_sides(mesh, low, high)


def with_sides(mesh, low: float, high: float):
    near = 1e-9
    sides = {}
    for axis in range(len(mesh.p)):
        sides[f"low{axis}"] = partial(lambda x, a: abs(x[a] - low) < near, a=axis)
        sides[f"high{axis}"] = partial(lambda x, a: abs(x[a] - high) < near, a=axis)
        sides[f"seat{axis}"] = partial(
            lambda x, a: (abs(x[a]) < near) & (np.delete(x, a, axis=0).min(axis=0) > 0), a=axis
        )
    sides["seat"] = lambda x: (np.abs(x).min(axis=0) < near) & (x.min(axis=0) > -near)
    return mesh.with_boundaries(sides)


def seat(cells: int, kind: str, dim: int):
    """A box from -1 to 1 without its part of all positive coordinates."""
    mesh = KINDS[kind, dim].init_tensor(*[np.linspace(-1, 1, 2 * cells + 1)] * dim)
    middle = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.restrict(np.flatnonzero(~np.all(middle > 0, axis=0)))
    return with_sides(type(mesh)(mesh.p, mesh.t), -1.0, 1.0)


def seated(cells, kinds, dim, degree, contacts, upper_first=True) -> Scene:
    """A block in a seat, both pressed along the axes, so that the stress is STRESS everywhere."""
    axes = "xyz"[:dim]
    loads = [
        Traction(f"high{i}", tuple(STRESS[dim][i] * (j == i) for j in range(dim)))
        for i in range(dim)
    ]
    supports = tuple(Support(f"low{i}", {name: 0.0}) for i, name in enumerate(axes))
    material = Material(E, NU)
    lower = seat(cells[0], kinds[0], dim)
    upper = box(0.0, 1.0, cells[1], kinds[1], dim)
    lower = Part("seat", lower, material, supports, tuple(loads), contact="seat")
    upper = Part("block", upper, material, (), tuple(loads), contact="seat")
    kind = "solid" if dim == 3 else "plane-strain"
    return Scene("seated", bodies=(lower, upper), contacts=contacts, degree=degree, kind=kind)


def strain(dim: int) -> np.ndarray:
    s = STRESS[dim]
    total = s.sum() + (NU * s.sum() if dim == 2 else 0.0)  # with the stress out of the plane
    return ((1 + NU) * s - NU * total) / E


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("names", [("block", "seat"), ("seat", "block")])
@pytest.mark.parametrize(
    ("cells", "kinds"),
    [((4, 4), ("quad", "quad")), ((4, 7), ("quad", "tri")), ((1, 1), ("tri",) * 2)],
)
def test_a_block_in_a_seat_bears_its_uniform_stress(cells, kinds, names, degree):
    scene = seated(cells, kinds, 2, degree, (Contact(*names, 0.0),))
    result = run(scene, figures=())
    exact = strain(2)[:, None]
    for body in result.fields:
        error = body.displacement - exact * (body.mesh.p + 1)
        assert np.abs(error).max() < 1e-9 * np.abs(exact).max()
    on = np.abs(result.problem.coordinates[0]) < 1e-9
    normal = np.abs(result.reduction.frames[:, 0, 0])
    assert np.all(on[normal > 0.5])
    assert np.allclose(result.pressure, np.where(normal > 0.5, 0.6, 1.0), rtol=1e-8)
    assert np.isclose(result.problem.areas.sum(), 2.0)
    assert not any("constant pressure" in text for text in result.summary["remarks"])


@pytest.mark.parametrize(("law", "mu"), [("coulomb", 0.3), ("coulomb", 1.2), ("bilateral", 0.3)])
@pytest.mark.parametrize(("degree", "kind"), [(1, "quad"), (1, "tri"), (2, "quad"), (2, "tri")])
def test_a_corner_under_constant_pressure_has_no_friction(degree, kind, law, mu):
    scene = seated((2, 2), (kind, kind), 2, degree, (Contact("block", "seat", mu, law=law),))
    loads = [tuple(Traction(f"high{i}", tuple(-np.eye(2)[i])) for i in range(2))] * 2
    bodies = (replace(part, loads=own) for part, own in zip(scene.bodies, loads))
    result = run(replace(scene, bodies=tuple(bodies)), figures=())
    assert np.abs(result.pressure - 1).max() < 1e-6
    assert np.abs(result.solution.reactions[:, 1]).max() < 1e-6


def cubic(cells: int, degree: int, shear: float = 0.0) -> Scene:
    """A cube in a rough seat, pressed by 1 on all sides, and pushed along one edge."""
    scene = seated((cells, cells), ("quad", "quad"), 3, degree, (Contact("block", "seat", 0.3),))
    loads = [tuple(Traction(f"high{i}", tuple(-np.eye(3)[i])) for i in range(3))] * 2
    push = Traction("high2", (0.0, shear, -1.0))
    loads[1] = (*loads[1][:2], push)
    bodies = (replace(part, loads=own) for part, own in zip(scene.bodies, loads))
    return replace(scene, bodies=tuple(bodies))


@pytest.mark.slow
def test_edges_in_space_under_constant_pressure_have_no_friction():
    solution = solve(reduce(cubic(4, 2)))  # 243 contacts exchange forces along three edges
    assert np.abs(solution.reactions[:, 1:]).max() < 1e-6 * solution.reactions[:, 0].max()


@pytest.mark.parametrize("coupled", [0.0, 0.3], ids=["symmetric", "unsymmetric"])
@pytest.mark.parametrize("felt, moved", [(0, 0), (1e-12, 0), (0, 1e-12), (1e-9, 0), (0, 1e-9)])
def test_an_exchange_is_felt_alike_by_displacements_and_by_balance(felt, moved, coupled):
    both, none = np.array([[0, 1, 0, 1], [0, 1, 0, -1]]) / np.sqrt(2)
    Q = np.diag([1.0, 0, 1, 0]) + np.outer(both, both) + felt * np.outer(none, none)
    Q[0, 2] = coupled
    V = np.array([1.0, 0, 1, 0]) + moved * none
    problem = InterfaceProblem(1e-5 * Q, np.zeros((2, 2)), mu=0.5, V=V[:, None], s=[-1.0])
    sizes = exchanged.exchanges(problem, np.arange(2))[2]
    assert np.sum(sizes <= exchanged.UNFELT) == (max(felt, moved) < 1e-10)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_contacts_at_one_place_bear_alike_also_those_that_bore_nothing(share):
    """Two contacts of one normal, of which only the sum of the forces is felt."""
    chart = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.3).chart
    pairs = Pair("a", 0, 1, chart), Pair("b", 1, 2, chart)
    Q = np.eye(4) + np.eye(4, k=2) * [0, 0, 1, 0] + np.eye(4, k=-2) * [1, 0, 0, 0]
    q, at = np.array([[-1.0, 0.0]] * 2), np.zeros((2, 2))
    problem = InterfaceProblem(Q, q, 0.3, pairs=pairs, coordinates=at)
    given = replace(solve(problem), reactions=np.array([[share, 0.0], [1 - share, 0.0]]))
    found = exchanged.least_friction(problem, given, 1e-8)
    assert np.allclose(found.reactions, [[0.5, 0.0]] * 2) and found.residual < 1e-12


@pytest.mark.parametrize("law", ["coulomb", "bilateral"])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.2])
def test_the_least_friction_obeys_the_law(law, share):
    """A node in a corner, pulled off one face: the friction of the other one must hold it."""
    felt = np.array([[1.0, 0, 0, 1], [0, 1, 1, 0]])  # what moves the node along x and y
    chart = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.3).chart
    pairs, at = (Pair("a", 0, 1, chart), Pair("b", 1, 2, chart)), np.zeros((2, 2))
    Q, moved = felt.T @ felt, felt.T @ [-1.0, 0.1]
    rule = find_law(law)(np.array([0.4, 0.4]))
    problem = InterfaceProblem(Q, moved.reshape(2, 2), rule, pairs=pairs, coordinates=at)
    start = np.array([[1.0, -0.1 - share], [share, 0.0]])
    given = replace(solve(problem), reactions=start, residual=0.0)
    assert natural_map_residual(problem, start, np.zeros(0)) < 1e-12
    exact = [[1.0, -0.1], [0.0, 0.0]] if law == "coulomb" else [[1.0, 0.0], [-0.1, 0.0]]
    assert np.allclose(exchanged.least_friction(problem, given, 1e-8).reactions, exact, atol=1e-7)


def meeting(angles, mu, force, named=True) -> InterfaceProblem:
    """A node under a force in several contacts, whose normals have these angles with x."""
    frames = [[[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]] for a in angles]
    B, k = np.concatenate(frames), len(angles)
    chart = InterfaceProblem(np.eye(2), [[-1.0, 0.0]], 0.3).chart
    pairs = [Pair(str(i), i, i + 1, chart) for i in range(k)]
    given = {"pairs": tuple(pairs), "coordinates": np.zeros((2, k))} if named else {}
    return InterfaceProblem(B @ B.T, -(B @ force).reshape(k, 2), mu, **given)


@pytest.mark.parametrize(
    ("angles", "mu", "force", "several"),
    [
        ((0, 0), (0.2, 1.0), (1.4, 0.5), True),  # slip, less where the rougher one bears more
        ((np.pi / 2, -np.pi / 2), (0.5, 0.5), (0.1, 0.05), True),  # slips between two walls
        ((0, 0), (0.5, 0.5), (1.4, 0.8), True),  # slip along one ray
        ((0, 0), (0.5, 0.5), (1.4, 0.7), True),  # between stick and slip
        ((0, 0), (0.5, 0.5), (1.4, 0.2), True),
        ((0, 0.7), (0.5, 0.2), (1.4, -0.7), False),  # between stick and slip on the outer one
        ((0, np.pi), (0.5, 0.5), (1.4, 0.2), True),
    ],
)
def test_forces_that_the_law_allows_to_exchange_are_not_unique(angles, mu, force, several):
    """However the contacts are between two states, and without a named pair of surfaces, too."""
    answer = solve(meeting(angles, mu, force, named=False))
    assert answer.solved and ("not unique" in "".join(answer.notes)) == several
    named = "".join(solve(meeting(angles, mu, force)).notes)
    assert not several or "nothing else but slip" in named


def test_forces_that_are_not_unique_have_a_place():
    """A tie of three contacts whose first node a support holds: two nodes tell two forces apart."""
    parts, grid = [], np.linspace(0.0, 1.0, 2)
    for name, low in (("lower", 0), ("upper", 1)):
        mesh = skfem.MeshQuad.init_tensor(grid, low + grid)
        sides = {"x-": lambda x: x[0] == 0, "y-": lambda x, y=low: x[1] == y}
        mesh = mesh.with_boundaries(sides | {"y+": lambda x, y=low + 1: x[1] == y})
        pressed = (Traction("y+", (0.0, -1.0)),) if low else ()
        parts.append(Part(name, mesh, Material(100.0, 0.3), (Support("x-"),), pressed))
    tie = (Contact("upper:y-", "lower:y+", law="tied"),)
    result = run(Scene("held", bodies=tuple(parts), contacts=tie, degree=2), figures=())
    (said,) = result.summary["remarks"]
    assert "not unique" in said and said.endswith("most of all near (0, 1).")


def test_contacts_at_one_place_that_lack_room_within_the_law_are_solved():
    """The weights of even pressures and of the law are so far apart that rounding decided."""
    force = [-0.3957788211685796, 1.1467833935816263]
    answer = solve(meeting((np.pi / 4, -np.pi / 2, np.pi / 2), 0.5, force))
    assert answer.solved and answer.residual < 1e-10


def test_a_seat_whose_forces_have_the_least_friction_is_not_said_to_be_far_off():
    """Its 27 contacts exchange forces, so that rounding makes the condition of the solution."""
    assert not solve(reduce(cubic(2, 1))).notes


@pytest.mark.parametrize(
    ("bound", "said"),
    [
        (600, "and at 5 more places, where several surfaces meet, the contact forces are not"),
        (10, "and at 6 more places, where several surfaces meet, friction acts; whether its"),
    ],
)
def test_what_edges_exchange_or_what_is_not_looked_at_is_said_once(monkeypatch, bound, said):
    monkeypatch.setattr(exchanged, "FEW", bound)
    monkeypatch.setattr(exchanged, "NEAREST", 27 if bound > 10 else 1)
    for shear in (0.0, 0.2)[bound < 600 :]:
        notes = [
            note for note in solve(reduce(cubic(2, 1, shear))).notes if "surfaces meet" in note
        ]
        assert len(notes) == (shear > 0) and all(said in note for note in notes)


def test_matrices_alone_tell_of_no_surfaces_that_meet():
    """Stacks of rigid blocks have hundreds of places with several contacts, and no corner."""
    problem = reduce(cubic(2, 1, 0.2))
    assert problem.shared_places and not replace(problem, pairs=()).shared_places
    assert not [note for note in solve(replace(problem, pairs=())).notes if "surfaces" in note]


def slanted(rise: float, cells: tuple[int, int], kind: str, degree: int, law: str) -> Scene:
    """Two blocks under the pressure 1 all around; their seam climbs from a frictionless wall."""
    floor, parts = {"left": Support("left", {"x": 0.0}), "low": Support("low", {"y": 0.0})}, []
    for name, n in zip(("lower", "upper"), cells):
        mesh = KINDS[kind, 2].init_tensor(np.linspace(0, 3, 2 * n + 1), np.linspace(0, 1, n + 1))
        sides = {"low": mesh.p[1] == 0, "high": mesh.p[1] == 1, "left": mesh.p[0] == 0}
        sides["right"] = mesh.p[0] == 3
        facets = {side: np.flatnonzero(on[mesh.facets].all(axis=0)) for side, on in sides.items()}
        x, y = mesh.p
        seam = 1 + (rise - 1) * x / 3
        p = np.stack([x, y * seam if name == "lower" else seam + y * (2.5 - seam)])
        mesh = type(mesh)(p, mesh.t, _boundaries=facets)
        held = tuple(floor.values()) if name == "lower" else (floor["left"],)
        pressed = ("right",) if name == "lower" else ("right", "high")
        loads = tuple(Pressure(side, 1.0) for side in pressed)
        contact = "high" if name == "lower" else "low"
        parts.append(Part(name, mesh, Material(E, NU), held, loads, contact=contact))
    pair = Contact("upper", "lower", 0.3 * (law == "coulomb"), law=law)
    return Scene("slanted", bodies=tuple(parts), contacts=(pair,), degree=degree)


@pytest.mark.parametrize("law", ["frictionless", "coulomb", "tied"])
@pytest.mark.parametrize(
    ("cells", "kind", "degree"),
    [((2, 2), "quad", 1), ((2, 2), "quad", 2), ((2, 2), "tri", 2), ((2, 3), "tri", 2)],
)
def test_a_slanted_plane_keeps_its_normal_at_a_wall(cells, kind, degree, law):
    result = run(slanted(1.3, cells, kind, degree, law), figures=())
    assert np.abs(result.pressure - 1).max() < 1e-8
    for body in result.fields:
        assert np.abs(body.stress - [-1, -1, -2 * NU, 0]).max() < 1e-8


@pytest.mark.parametrize(
    ("cells", "kind", "degree"),
    [((2, 2), "quad", 1), ((2, 2), "quad", 2), ((2, 2), "tri", 2), ((2, 3), "tri", 2)],
)
def test_a_slanted_plane_rubs_at_a_wall_that_moves(cells, kind, degree):
    scene = slanted(1.3, cells, kind, degree, "coulomb")
    lower, upper = scene.bodies
    moved = replace(upper, supports=(Support("left", {"x": 0.002}),))
    forces = solve(reduce(replace(scene, bodies=(lower, moved))), tol=1e-10).reactions
    assert np.allclose(forces[:, 1], -0.3 * forces[:, 0]) and forces[:, 0].min() > 0


@pytest.mark.parametrize(
    ("cells", "kinds", "degree"),
    [((2, 2), ("quad", "quad"), 1), ((2, 3), ("quad", "tri"), 1), ((1, 2), ("quad", "quad"), 2)],
)
def test_three_faces_of_a_cube_are_three_sides(cells, kinds, degree):
    scene = seated(cells, kinds, 3, degree, (Contact("block", "seat", 0.0, coupling="mortar"),))
    result = run(scene, figures=())
    exact = strain(3)[:, None]
    for body in result.fields:
        error = body.displacement - exact * (body.mesh.p + 1)
        assert np.abs(error).max() < 1e-8 * np.abs(exact).max()
    assert not any("constant pressure" in text for text in result.summary["remarks"])
    axis = np.argmax(np.abs(result.reduction.frames[:, 0]), axis=1)
    assert np.allclose(result.pressure, -STRESS[3][axis], rtol=1e-7)
    assert np.isclose(result.problem.areas.sum(), 3.0)


@pytest.mark.parametrize("angle", [20.0, 60.0, 90.0, 125.0])
@pytest.mark.parametrize("cells", [(3, 3), (3, 4)])
@pytest.mark.parametrize("names", [("block", "seat"), ("seat", "block")])
def test_one_boundary_around_a_corner_is_two_pairs(angle, cells, names):
    """Loads that are not uniform, at any angle between the sides, convex and concave."""
    pairs = [
        tuple(f"{body}:seat{i}" for body in names) for i in (0, 1)
    ]  # the boundary `seat` by its sides
    both = []
    a = np.deg2rad(angle)
    shear = np.array([[1.0, np.cos(a)], [0.0, np.sin(a)]])
    for contacts in ((Contact(*names, 0.0),), tuple(Contact(*pair, 0.0) for pair in pairs)):
        scene = seated(cells, ("tri", "quad"), 2, 1, contacts)
        loads = (Traction("high0", (-1.0, -0.3)), Traction("high1", (-0.2, -0.7)))

        def changed(part, loads=loads):
            mesh = replace(part.mesh, doflocs=shear @ part.mesh.p)
            held = tuple(Support(s.boundary) for s in part.supports)
            return replace(part, mesh=mesh, supports=held, loads=loads)

        both.append(run(scene.with_parts(changed), figures=()))
    for one, two in zip(both[0].fields, both[1].fields):
        assert np.abs(one.displacement).max() > 1e-6
        assert np.allclose(one.displacement, two.displacement, rtol=0, atol=1e-11)
    assert np.allclose(np.sort(both[0].pressure), np.sort(both[1].pressure), atol=1e-7)


@pytest.mark.parametrize("change", [turn(33.0), turn(90.0), mirror(2), 1e-3 * np.eye(2)])
def test_the_answer_does_not_depend_on_the_axes_and_units(change):
    made = seated((3, 4), ("quad", "tri"), 2, 1, (Contact("block", "seat", 0.2),))
    loads = (Traction("high0", (-1.0, -0.3)), Traction("high1", (-0.2, -0.7)))
    lower, upper = (
        replace(part, supports=tuple(Support(s.boundary) for s in part.supports), loads=loads)
        for part in made.parts
    )
    size = np.sqrt(abs(np.linalg.det(change)))
    smaller = tuple(replace(load, value=tuple(np.array(load.value) / size)) for load in loads)
    here = run(Scene("seated", upper, lower, mu=0.2), figures=())
    upper, lower = (replace(part, loads=smaller) for part in (upper, lower))
    there = run(moved(Scene("seated", upper, lower, mu=0.2), change), figures=())
    assert np.allclose(np.sort(here.pressure), np.sort(there.pressure), atol=1e-7)


def sides(mesh, name: str = "outer", degree: int = 1, curve=None) -> int:
    """The number of copies of nodes at corners."""
    basis = make_basis(mesh, degree, False)
    known = copies(basis, degree, mesh.boundaries[name], mesh, curve)[1]
    return len(known) - len(np.unique(known))
