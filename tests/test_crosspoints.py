"""Seams that meet contacts and each other: as one body, and with forces that are unique."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import skfem
from turned import mirror, turn

from contactopt import (
    Contact,
    Material,
    Part,
    Rigid,
    Scene,
    Support,
    Traction,
    natural_map_residual,
    reduce_bodies,
    run,
    solve,
)
from contactopt.coupling.patch_test import misfit
from contactopt.coupling.posed import posed
from contactopt.readings.resolution import remarks

MATERIAL = Material(100.0, 0.3)
KINDS = {
    ("quad", 2): skfem.MeshQuad,
    ("tri", 2): skfem.MeshTri,
    ("quad", 3): skfem.MeshHex,
    ("tri", 3): skfem.MeshTet,
}


def box(low, high, cells, kind="quad"):
    """A box with the boundaries x-, x+, y-, ..."""
    grids = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells)]
    mesh = KINDS[kind, len(low)].init_tensor(*grids)
    on = {}
    for axis, name in enumerate("xyz"[: len(low)]):
        for sign, at in (("-", low[axis]), ("+", high[axis])):
            on[name + sign] = partial(lambda x, a, at: abs(x[a] - at) < 1e-9, a=axis, at=at)
    return mesh.with_boundaries(on)


def floor_of(kind: str):
    """A rigid floor, or a finer elastic one whose nodes match no others."""
    if kind == "rigid":
        return Rigid("floor")
    mesh = box((-1.0, -1.0), (3.0, 0.0), (40, 10))
    return Part("floor", mesh, MATERIAL, (Support("y-"),), contact="y+")


def seam(cells, floor="rigid", mu=0.3, degree=1, carrier=None, kinds=("quad", "quad"), slant=0.0):
    """Two tied blocks side by side on a floor, with different loads; `slant` leans the seam."""
    parts = []
    for i, (n, kind) in enumerate(zip(cells, kinds)):
        mesh = box((i, 0.0), (i + 1.0, 1.0), (n, n), kind)
        x, y = mesh.p
        mesh = replace(mesh, doflocs=np.array([x + slant * y * (1 - abs(x - 1)), y]))
        held = () if i else (Support("x-", {"x": 0.0}),)
        load = Traction("y+", (0.0, (-1.5, -1.0)[i]))
        parts.append(Part("LR"[i], mesh, MATERIAL, held, (load,), contact="y-"))
    contacts = (
        Contact("L", "floor", mu),
        Contact("R", "floor", mu),
        Contact("R:x-", "L:x+", 0.0, law="tied", carrier=carrier),
    )
    return Scene("seam", bodies=(*parts, floor_of(floor)), contacts=contacts, degree=degree)


@cache
def without_seam(floor: str, mu: float, slant: float) -> tuple[float, float]:
    """The force on the left half of one fine body, and the pressure where the seam would end."""
    n = 32
    mesh = box((0.0, 0.0), (2.0, 1.0), (2 * n, n))
    on = dict(mesh.boundaries)
    mesh = mesh.with_boundaries(
        {
            "left": lambda x: (abs(x[1] - 1) < 1e-9) & (x[0] < 1),
            "right": lambda x: (abs(x[1] - 1) < 1e-9) & (x[0] > 1),
        }
    ).with_boundaries(on)
    x, y = mesh.p
    mesh = replace(mesh, doflocs=np.array([x + slant * y * (1 - abs(x - 1)), y]))
    loads = (Traction("left", (0.0, -1.5)), Traction("right", (0.0, -1.0)))
    part = Part("one", mesh, MATERIAL, (Support("x-", {"x": 0.0}),), loads, contact="y-")
    result = run(Scene("one", part, floor_of(floor), mu=mu), figures=())
    x = result.problem.coordinates[0]
    half = np.where(abs(x - 1) < 1e-9, 0.5, x < 1)
    return float(half @ result.solution.reactions[:, 0]), float(np.interp(1.0, x, result.pressure))


CASES = [
    ((6, 6), {}),
    ((6, 7), {}),
    ((7, 6), {}),
    ((6, 7), {"carrier": "lower"}),
    ((6, 7), {"degree": 2}),
    ((6, 6), {"degree": 2, "kinds": ("tri", "quad")}),
    ((6, 8), {"kinds": ("quad", "tri")}),
    ((6, 7), {"slant": 0.4}),
    ((6, 7), {"slant": -0.4, "degree": 2}),
]


@pytest.mark.parametrize(
    ("cells", "how", "mu", "floor"),
    [
        *((*case, 0.3, "elastic") for case in CASES),
        *((*case, 0.0, "elastic") for case in CASES[1::3]),
        *((*case, 0.3, "rigid") for case in CASES[::2]),
    ],
)
def test_a_seam_on_a_floor_is_as_one_body(cells, how, mu, floor):
    force, pressure = without_seam(floor, mu, how.get("slant", 0.0))
    result = run(seam(cells, floor, mu, **how), figures=())
    assert result.solution.solved
    assert result.summary["pairs"]["L-floor"]["normal_force"] == pytest.approx(force, rel=3e-3)
    for own in result.problem.pairs[:2]:
        x = result.problem.coordinates[0, own.contacts]
        end = np.argmin(abs(x - 1))
        assert abs(x[end] - 1) < 1e-6
        assert result.pressure[own.contacts][end] == pytest.approx(pressure, rel=0.06)


def quarters(cells, laws, dim=2, degree=1, kinds=("quad",) * 8):
    """2^dim boxes that meet in one point, in a uniform stress along the axes; one law an axis."""
    axes, stress = "xyz"[:dim], (-0.6, -1.0, -0.3)[:dim]
    parts, contacts = [], []
    for number in range(2**dim):
        place = [number >> i & 1 for i in range(dim)]
        name = "".join(map(str, place))
        mesh = box(place, np.add(place, 1), (cells[number],) * dim, kinds[number])
        held = tuple(Support(f"{a}-", {a: 0.0}) for i, a in enumerate(axes) if not place[i])
        loads = tuple(
            Traction(f"{a}+", tuple(stress[i] * (a == b) for b in axes))
            for i, a in enumerate(axes)
            if place[i]
        )
        parts.append(Part(name, mesh, MATERIAL, held, loads, contact="x-"))
        for i, a in enumerate(axes):
            if place[i]:
                other = "".join(str(p * (i != j)) for j, p in enumerate(place))
                mu = 0.3 if laws[i] == "coulomb" else 0.0
                contacts.append(Contact(f"{name}:{a}-", f"{other}:{a}+", mu, laws[i]))
    kind = "solid" if dim == 3 else "plane-strain"
    made = Scene("4", bodies=tuple(parts), contacts=tuple(contacts), degree=degree, kind=kind)
    return made, np.array(stress)


LAWS = [("tied", "tied"), ("tied", "coulomb"), ("frictionless", "tied"), ("coulomb", "tied")]
MESHES = [
    ((4, 4, 4, 4), ("quad",) * 4),
    ((4, 5, 6, 3), ("quad", "tri") * 2),
    ((3, 3, 4, 5), ("tri",) * 4),
]


@pytest.mark.parametrize(
    ("cells", "kinds", "laws", "degree"),
    [
        (*mesh, laws, 1 + (i + j) % 2)
        for i, mesh in enumerate(MESHES)
        for j, laws in enumerate(LAWS)
    ],
)
def test_four_bodies_at_a_point_bear_a_uniform_stress(cells, kinds, laws, degree):
    scene, stress = quarters(cells, laws, 2, degree, kinds)
    uniform_and_independent(scene, stress)


@pytest.mark.parametrize(
    ("cells", "degree", "laws"),
    [
        ((2,) * 8, 1, ("tied", "tied", "frictionless")),
        ((1, 2, 1, 2, 2, 1, 2, 1), 1, ("tied",) * 3),
        ((1, 2, 1, 2, 2, 1, 2, 1), 1, ("coulomb", "tied", "tied")),
        ((1,) * 8, 2, ("coulomb", "tied", "tied")),
    ],
)
def test_eight_bodies_at_a_point_bear_a_uniform_stress(cells, degree, laws):
    scene, stress = quarters(cells, laws, 3, degree)
    uniform_and_independent(scene, stress)


@pytest.mark.parametrize("dim, cells", [(2, (4,) * 4), (2, (4, 5, 6, 3)), (3, (2,) * 8)])
def test_of_forces_that_a_corner_can_exchange_those_with_the_least_friction_are_given(dim, cells):
    """Any small share of the kernel is a solution, too; without friction the forces are unique."""
    scene, _ = quarters(cells, ("coulomb",) * dim, dim)
    problem = reduce_bodies(scene).problem
    solution = solve(problem)
    alike = len({*cells}) == 1
    assert not any("are not unique" in note for note in solution.notes)
    assert np.abs(solution.reactions[:, 1:]).max() < 1e-6 * solution.reactions.max()
    if alike:
        there = np.repeat(np.all(problem.coordinates.T == 1.0, axis=1), dim)
        y = np.zeros(problem.q.size)
        y[there] = np.linalg.svd(problem.Q[:, there])[2][-1]
        share = 0.01 * solution.reactions.max() * y.reshape(problem.q.shape)
        assert (
            natural_map_residual(problem, solution.reactions + share, solution.multipliers) < 1e-9
        )
    for laws in (("frictionless",) * dim, ("coulomb", *("tied",) * (dim - 1))):
        problem = reduce_bodies(quarters(cells, laws, dim)[0]).problem
        assert not any("are not unique" in note for note in solve(problem).notes)


def uniform_and_independent(scene, stress):
    """The pressures are those of the stress; the conditions of ties and of contacts that are closed
    and stick do not depend on each other.
    """
    result = run(scene, figures=())
    assert not any("constant pressure" in text for text in result.summary["remarks"])
    made = result.reduction
    frames = made.frames
    assert np.allclose(result.pressure, -np.abs(frames[:, 0]) @ stress, rtol=0, atol=1e-7)
    dim = len(stress)
    rows = [
        np.arange(own.start * dim, own.stop * dim, dim if pair.law == "frictionless" else 1)
        for own, pair in zip(result.problem.pairs, scene.pairs)
    ]
    free = [body.body.free for body in made.bodies]
    B = np.concatenate([part[:, own].toarray() for part, own in zip(made.maps, free)], axis=1)
    B = B[np.concatenate(rows)]
    B = B[np.linalg.norm(B, axis=1) > 1e-12]  # others are held by supports
    values = np.linalg.svd(B, compute_uv=False)
    assert len(B) < B.shape[1] and values[-1] > 1e-3 * values[0]


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cells", [(4, 4), (4, 5)])
def test_a_seam_of_revolution_is_as_one_body(cells, degree):
    def part(name, start, end, n, traction):
        mesh = box((start, 0.0), (end, 1.0), (n * round(end - start), n))
        return Part(name, mesh, MATERIAL, (), (Traction("y+", (0.0, traction)),), contact="y-")

    floor = Rigid("floor")
    core, rim = part("core", 0.0, 1.0, cells[0], -1.5), part("rim", 1.0, 2.0, cells[1], -1.0)
    contacts = (
        Contact("core", "floor", 0.3),
        Contact("rim", "floor", 0.3),
        Contact("rim:x-", "core:x+", 0.0, law="tied"),
    )
    kind = "axisymmetric"
    scene = Scene("r", bodies=(core, rim, floor), contacts=contacts, degree=degree, kind=kind)
    found = run(scene, figures=())
    mesh = box((0.0, 0.0), (2.0, 1.0), (40, 20))
    mesh = mesh.with_boundaries(
        {
            "in": lambda x: (abs(x[1] - 1) < 1e-9) & (x[0] < 1),
            "out": lambda x: (abs(x[1] - 1) < 1e-9) & (x[0] > 1),
        }
    )
    loads = (Traction("in", (0.0, -1.5)), Traction("out", (0.0, -1.0)))
    one = Part("one", mesh, MATERIAL, (), loads, contact="y-")
    whole = run(Scene("one", one, floor, mu=0.3, kind=kind), figures=())
    r = whole.problem.coordinates[0]
    half = np.where(abs(r - 1) < 1e-9, 0.5, r < 1)
    force = half @ whole.solution.reactions[:, 0]
    pressure = whole.pressure[np.argmin(abs(r - 1))]
    assert found.summary["pairs"]["core-floor"]["normal_force"] == pytest.approx(force, rel=1e-2)
    at = abs(found.problem.coordinates - [[1.0], [0.0]]).max(axis=0) < 1e-9
    assert np.allclose(found.pressure[at], pressure, rtol=0.06)
    assert at.sum() == 2


def four_on_floor(cells, degree=1, mu=0.3):
    """Four tied blocks in space, 2 by 2, on a rough floor, each with another load."""
    parts, contacts = [], []
    for number, load in enumerate((-1.0, -1.5, -0.7, -1.2)):
        i, j = number % 2, number // 2
        n = cells[number]
        mesh = box((i, j, 0), (i + 1, j + 1, 1), (n, n, n))
        held = (() if i else (Support("x-", {"x": 0.0}),)) + (
            () if j else (Support("y-", {"y": 0.0}),)
        )
        top = (Traction("z+", (0.0, 0.0, load)),)
        parts.append(Part(f"b{i}{j}", mesh, MATERIAL, held, top, contact="z-"))
        contacts.append(Contact(f"b{i}{j}", "floor", mu))
    ties = [("b10:x-", "b00:x+"), ("b11:x-", "b01:x+"), ("b01:y-", "b00:y+"), ("b11:y-", "b10:y+")]
    contacts += [Contact(*tie, 0.0, law="tied") for tie in ties]
    bodies = (*parts, Rigid("floor", normal=(0.0, 0.0, 1.0)))
    return Scene("4", bodies=bodies, contacts=tuple(contacts), degree=degree, kind="solid")


@pytest.mark.parametrize(
    ("cells", "degree"), [((4, 4, 4, 4), 1), ((3, 4, 3, 4), 1), ((2, 3, 2, 3), 2)]
)
def test_four_blocks_in_space_on_a_rough_floor(cells, degree):
    result = run(four_on_floor(cells, degree), figures=())
    # one body of 8 x 8 x 4 elements of degree 2: 0.8977 on the first quarter; 0.9582 in the middle
    force = result.summary["pairs"]["b00-floor"]["normal_force"]
    assert force == pytest.approx(0.8977, rel=5e-3)
    x = result.problem.coordinates
    middle = np.linalg.norm(x - [[1.0], [1.0], [0.0]], axis=0) < 1e-9
    assert middle.sum() == 4
    assert np.allclose(result.pressure[middle], 0.9582, rtol=0.15)


@pytest.mark.parametrize("degree", [1, 2])
def test_what_is_left_of_a_seam_passes_the_patch_test(degree):
    flat = [seam((4, 4)), seam((4, 5)), seam((5, 4), kinds=("tri", "quad"), slant=0.3)]
    spaces = [four_on_floor((1,) * 4), four_on_floor((1, 2, 2, 1))]
    for scene in [*flat, *spaces, quarters((2, 3, 2, 3), ("tied", "tied"))[0]]:
        made = posed(replace(scene, degree=degree))
        bodies = {body.name: body for body in made.bodies}
        for pair, own in zip(scene.pairs, made.couplings):
            if pair.law == "tied":
                sides = [bodies[body].surface(s) for body, s in zip(pair.bodies, pair.surfaces)]
                assert misfit(own, sides) is None and not own.remarks


def test_every_contact_on_the_floor_stays():
    for cells in ((6, 6), (6, 7)):
        made = reduce_bodies(seam(cells))
        counts = [len(own.gap) for own in made.couplings]
        assert counts == [cells[0] + 1, cells[1] + 1, max(cells)]


@pytest.mark.parametrize("change", [turn(90.0), mirror(2), 1e3 * np.eye(2)])
def test_the_answer_does_not_depend_on_the_axes_and_units(change):
    scene = seam((4, 5), mu=0.3)
    size = np.sqrt(abs(np.linalg.det(change)))
    names = dict(zip("xy", np.abs(change / size).argmax(axis=0)))

    def moved(part):
        if isinstance(part, Rigid):
            return part
        held = tuple(
            replace(s, displacement={"xy"[names[a]]: 0.0 for a in s.displacement})
            for s in part.supports
        )
        loads = tuple(replace(x, value=tuple(change @ x.value / size)) for x in part.loads)
        mesh = replace(part.mesh, doflocs=change @ part.mesh.p)
        return replace(part, mesh=mesh, supports=held, loads=loads)

    here, there = (run(s, figures=()) for s in (scene, scene.with_parts(moved)))
    for own, other in zip(here.problem.pairs, there.problem.pairs):
        a, b = here.pressure[own.contacts], there.pressure[other.contacts]
        assert np.allclose(np.sort(a), np.sort(b), atol=1e-7)


def test_only_a_tie_whose_forces_jump_is_remarked_on():
    """A tie of one element keeps both contacts, of which a floor makes one superfluous."""
    result = run(seam((1, 1)), figures=())
    assert not any("tie" in text for text in result.summary["remarks"])
    start, reactions = result.problem.pairs[2].start, result.solution.reactions.copy()
    reactions[start : start + 2, 0] += 50.0, -50.0
    said = remarks(result.reduction, replace(result.solution, reactions=reactions))
    assert len(said) == 1 and "the tie 'R.x--L.x+' jump" in said[0] and "(1, 0)" in said[0]


@pytest.mark.parametrize(("held", "mu"), [({"y": 0.0}, 0.0), ({"y": 0.0}, 0.3), (None, 0.3)])
@pytest.mark.parametrize(("cells", "degree"), [((6, 6), 1), ((6, 7), 1), ((8, 7), 1), ((6, 7), 2)])
def test_a_seam_between_a_support_and_a_floor_is_as_one_body(cells, degree, held, mu):
    """The support is one with the floor, so that the seam gives up its end there too."""

    def force(bodies, contacts, name, degree=1):
        made = Scene(name, bodies=bodies, contacts=contacts, degree=degree)
        return run(made, figures=()).summary["pairs"]["R.y--floor"]["normal_force"]

    guide = (Support("x-", {"x": 0.0}),) if held else ()
    left = Part(
        "L",
        box((0.0, 0.0), (1.0, 1.0), (cells[0],) * 2),
        MATERIAL,
        (Support("y-", held), *guide),
        (Traction("y+", (0.0, -1.5)),),
    )
    right = box((1.0, 0.0), (2.0, 1.0), (cells[1],) * 2)
    right = Part("R", right, MATERIAL, (), (Traction("y+", (0.0, -1.0)),))
    touch, tie = Contact("R:y-", "floor", mu), Contact("R:x-", "L:x+", 0.0, law="tied")
    found = force((left, right, Rigid("floor")), (touch, tie), "two", degree)

    def one(n):
        mesh = box((0.0, 0.0), (2.0, 1.0), (2 * n, n))
        halves = {
            f"{name}{side}": partial(
                lambda x, y, s: (abs(x[1] - y) < 1e-9) & (s * (x[0] - 1) > 0), y=y, s=s
            )
            for name, y in (("y-", 0.0), ("y+", 1.0))
            for side, s in (("l", -1), ("r", 1))
        }
        halves["x-"] = lambda x: abs(x[0]) < 1e-9
        halves["y-"] = halves.pop("y-r")
        loads = (Traction("y+l", (0.0, -1.5)), Traction("y+r", (0.0, -1.0)))
        supports = (Support("y-l", held), *guide)
        part = Part("R", mesh.with_boundaries(halves), MATERIAL, supports, loads)
        return force((part, Rigid("floor")), (touch,), "one")

    # the support takes half an element of the pressure from one body: of first order
    assert found == pytest.approx(2 * one(24) - one(12), rel=5e-3)
