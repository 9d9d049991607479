"""Several bodies and pairs: statics, independence of pairs, results by surface, refused input."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
import scipy.sparse as sp
from conftest import block as unit_block
from conftest import two_blocks
from stacks import block, stack

from contactopt import (
    Contact,
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    follow,
    natural_map_residual,
    reduce_bodies,
    run,
    solve,
    transfer,
)
from contactopt.problem import alone
from contactopt.readings.quantities import find_quantity
from contactopt.readings.resultants import holder_resultants, pair_resultants, tables

SOFT = Material(1000.0, 0.3)


@pytest.mark.parametrize("form", ["explicit", "implicit"])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("cells", [(4,), (3, 4)], ids=["matching", "mortar"])
def test_every_interface_of_a_stack_carries_what_rests_on_it(dim, form, cells):
    """Three blocks pushed sideways: force and moment of every interface are those of statics."""
    width, side = 2.0, 0.2
    scene = stack(3, dim, side=side, width=width, cells=cells)
    reduction = reduce_bodies(scene, Q=form)
    solution = solve(reduction.problem, tol=1e-11)
    assert solution.solved and len(reduction.problem.s) == 3 * (3 if dim == 2 else 6)
    volume = width ** (dim - 1)
    for i, found in enumerate(pair_resultants(reduction, solution).values()):
        above = 3 - i  # blocks
        force = np.zeros(dim)
        force[0], force[-1] = -side * above * volume, above * volume
        centre = np.full(dim, width / 2)
        centre[-1] = i + above / 2
        moment = (
            np.cross(centre, force) if dim == 3 else centre[0] * force[1] - centre[1] * force[0]
        )
        assert np.allclose(found.force, force, atol=1e-9 * 3 * volume)
        assert np.allclose(found.moment, moment, atol=1e-9 * 3 * volume * 3)


def test_the_order_of_the_bodies_does_not_matter():
    plain, other = stack(3, side=0.1), stack(3, side=0.1, order=(2, 0, 3, 1))
    first, second = (solve(reduce_bodies(scene).problem, tol=1e-12) for scene in (plain, other))
    assert np.allclose(first.reactions, second.reactions, atol=1e-10)
    assert np.allclose(np.sort(first.multipliers), np.sort(second.multipliers), atol=1e-12)


def test_pairs_that_share_no_elastic_body_do_not_know_of_each_other():
    """Two blocks on one rigid floor: both as if alone, each with its own friction and law."""
    loads = (Traction("top", (0.3, -1.0)),)
    parts = [
        Part(n, block([x, 0], [x + 1, 1], [4, 4]), SOFT, loads=loads, contact="bottom")
        for n, x in (("a", 0), ("b", 3))
    ]
    floor = Rigid("floor", normal=(0, 1))
    contacts = (Contact("a", "floor", 0.7), Contact("b", "floor", 0.6, law="associated"))
    both = reduce_bodies(Scene("two", bodies=(*parts, floor), contacts=contacts))
    together = solve(both.problem, tol=1e-11)
    for part, contact, pair in zip(parts, contacts, both.problem.pairs):
        single = reduce_bodies(Scene("one", bodies=(part, floor), contacts=(contact,)))
        own = solve(single.problem, tol=1e-11)
        assert np.allclose(together.reactions[pair.contacts], own.reactions, atol=1e-10)
        problem, seen = alone(both.problem, together, pair)
        assert natural_map_residual(problem, seen.reactions, seen.multipliers) < 1e-10
        assert type(problem.law) is type(single.problem.law)
        assert np.array_equal(problem.mu, single.problem.mu)


def test_a_pair_alone_is_solved_by_its_part_of_the_solution():
    problem = reduce_bodies(stack(3, side=0.2)).problem
    solution = solve(problem, tol=1e-11)
    u = problem.displacements(solution.reactions, solution.multipliers)
    for pair in problem.pairs:
        part, own = alone(problem, solution, pair)
        assert natural_map_residual(part, own.reactions, own.multipliers) < 1e-9
        assert np.allclose(part.displacements(own.reactions, own.multipliers), u[pair.contacts])
        assert part.chart is pair.chart


def test_the_short_form_is_the_long_one():
    short = two_blocks("plane-strain", mu=0.3)
    long = Scene(
        "long", bodies=short.parts, contacts=(Contact(short.upper.name, short.lower.name, 0.3),)
    )
    a, b = reduce_bodies(short).problem, reduce_bodies(long).problem
    assert np.array_equal(a.Q, b.Q) and np.array_equal(a.V, b.V) and np.array_equal(a.q, b.q)


def test_friction_by_pair_and_by_place():
    scene = stack(2, mu=0.1)
    first, second = scene.contacts
    varied = replace(
        scene, contacts=(replace(first, mu=lambda x: 0.2 + x[0]), replace(second, mu=0.7))
    )
    reduction = reduce_bodies(varied)
    own, other = (pair.contacts for pair in reduction.problem.pairs)
    assert np.allclose(reduction.problem.mu[own], 0.2 + reduction.problem.coordinates[0, own])
    assert np.all(reduction.problem.mu[other] == 0.7)
    assert np.all(reduction.loaded(scene).problem.mu == 0.1)


def test_many_bodies_have_a_sparse_q_that_grows_with_their_number():
    few, many = (
        reduce_bodies(stack(count, side=0.2 / count, mu=0.3)).problem for count in (16, 32)
    )
    assert sp.issparse(few.Q) and sp.issparse(many.Q)
    assert many.Q.nnz < 2.2 * few.Q.nnz
    steps = [solve(problem, tol=1e-10) for problem in (few, many)]
    assert all(solution.solved for solution in steps)
    assert abs(steps[1].iterations - steps[0].iterations) <= 0.3 * steps[0].iterations + 1
    dense = solve(few.explicit(), "newton", tol=1e-10)
    assert np.allclose(dense.reactions, steps[0].reactions, atol=1e-9)


def test_a_wall_is_a_network():
    """Two blocks carry a beam, whose weight is shared out by symmetry; the floor is elastic."""
    floor = Part(
        "floor", block([0, -1], [6, 0], [12, 2]), SOFT, (Support("bottom"),), contact="top"
    )
    legs = [
        Part(n, block([x, 0], [x + 1, 1], [2, 2]), SOFT, contact="bottom")
        for n, x in (("left", 1), ("right", 4))
    ]
    beam = Part(
        "beam",
        block([1, 1], [5, 2], [8, 2]),
        SOFT,
        loads=(Traction("top", (0, -1.0)),),
        contact="bottom",
    )
    contacts = [Contact(leg, "floor", 0.5) for leg in ("left", "right")]
    contacts += [Contact("beam", f"{leg}:top", 0.5, coupling="mortar") for leg in ("left", "right")]
    reduction = reduce_bodies(Scene("wall", bodies=(floor, *legs, beam), contacts=tuple(contacts)))
    solution = solve(reduction.problem, tol=1e-11)
    found = pair_resultants(reduction, solution)
    assert solution.solved and len(found) == 4
    for resultant in found.values():
        assert resultant.force[1] == pytest.approx(2.0, abs=1e-8)
    assert found["left-floor"].force[0] == pytest.approx(-found["right-floor"].force[0], abs=1e-8)


def test_forces_on_every_body_are_in_balance():
    """Loads, pairs, supports and plates: force and moment."""
    lower = Part("lower", block([0, -2], [3, 0], [6, 4]), SOFT, (Support("bottom"),), contact="top")
    middle = Part(
        "middle",
        block([1, 0], [2, 1], [3, 3]),
        SOFT,
        contact="bottom",
        loads=(Traction("right", (-0.1, 0.0)),),
    )
    upper = Part(
        "upper",
        block([1, 1], [2, 2], [3, 3]),
        SOFT,
        loads=(Plate("top", {"y": -2.0}),),
        contact="bottom",
    )
    contacts = (Contact("middle", "lower", 0.4), Contact("upper", "middle:top", 0.4))
    reduction = reduce_bodies(Scene("three", bodies=(lower, middle, upper), contacts=contacts))
    solution = solve(reduction.problem, tol=1e-12)
    pairs, holders = pair_resultants(reduction, solution), holder_resultants(reduction, solution)
    on_lower, on_middle = pairs["middle-lower"], pairs["upper-middle.top"]
    plate, support = holders["body 'upper', plate 'top'"], holders["body 'lower', support 'bottom'"]
    assert np.allclose(plate.force + on_middle.force, 0, atol=1e-9)
    assert plate.force[1] == pytest.approx(-2.0)
    assert np.allclose(plate.moment + on_middle.moment, 0, atol=1e-9)
    assert np.allclose(on_lower.force - on_middle.force + [-0.1, 0.0], 0, atol=1e-9)
    # at half its height
    assert np.allclose(on_lower.moment - on_middle.moment + 0.1 * 0.5, 0, atol=1e-9)
    assert np.allclose(support.force - on_lower.force, 0, atol=1e-9)
    assert np.allclose(support.moment - on_lower.moment, 0, atol=1e-9)


def test_results_by_surface_are_written(tmp_path):
    result = run(stack(2, 3, side=0.2, width=2.0), out=tmp_path)
    names = {file.name for file in tmp_path.iterdir()}
    assert {
        "contact-block0-floor.vtu",
        "contact-block1-block0.top.vtu",
        "pressure-block0-floor.png",
    } <= names
    surface = meshio.read(tmp_path / "contact-block1-block0.top.vtu")
    pair = result.problem.pairs[1].contacts
    assert np.allclose(surface.points.T, result.problem.coordinates[:, pair])
    assert np.allclose(surface.point_data["contact_pressure"], result.pressure[pair])
    corners = surface.points[surface.cells_dict["quad"]]
    sides = corners - np.roll(corners, 1, axis=1)
    # cells cover the surface
    assert np.allclose(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum(), 4.0)
    force = (surface.point_data["contact_traction"] * result.problem.areas[pair, None]).sum(axis=0)
    assert np.allclose(force, result.summary["pairs"]["block1-block0.top"]["force"], atol=1e-9)
    lower, upper = (meshio.read(tmp_path / f"block{i}.vtu") for i in (0, 1))
    top, bottom = np.isclose(lower.points[:, 2], 1), np.isclose(upper.points[:, 2], 1)
    for body, there, sign in ((lower, top, -1), (upper, bottom, 1)):
        order = np.lexsort(body.points[there].T)
        expected = np.lexsort(surface.points.T)
        values = body.point_data["contact_traction"][there][order]
        assert np.allclose(values, sign * surface.point_data["contact_traction"][expected])
    summary = result.summary["pairs"]["block1-block0.top"]
    assert summary["open"] + summary["stick"] + summary["slip"] == summary["contacts"] == 25
    assert result.summary["contact_half_width"] is None


def test_a_start_is_carried_over_pair_by_pair():
    coarse, fine = (reduce_bodies(stack(2, side=0.2, cells=(n,))).problem for n in (8, 16))
    start = transfer(coarse, solve(coarse), fine)
    assert start.reactions[:, 0].sum() == pytest.approx(3.0, rel=0.05)
    exact = solve(fine, tol=1e-10)
    assert np.linalg.norm(start.reactions - exact.reactions) < 0.3 * np.linalg.norm(exact.reactions)
    with pytest.raises(InputError, match="same pairs"):
        named = replace(fine, pairs=tuple(replace(pair, name="other") for pair in fine.pairs))
        transfer(coarse, solve(coarse), named)


def test_tables_of_one_pair_are_those_of_the_whole():
    result = run("punch-2d")
    (pair,) = tables(result.reduction, result.solution)["pairs"].values()
    for name in ("normal_force", "max_pressure", "contact_half_width", "stick_half_width"):
        assert pair[name] == pytest.approx(result.summary[name])
    assert pair["force"][1] == pytest.approx(100.0)


def test_of_two_equal_pairs_each_has_its_normal_force():
    """Their sum is twice the load, which is the force on no body."""
    scene = stack(2, 2, side=0.0, width=2.0, cells=(4,))
    one, history = run(scene, figures=()), follow([scene]).history
    pairs = one.summary["pairs"]
    load = [pytest.approx(pair["force"][1]) for pair in pairs.values()]
    assert len(pairs) == 2 and one.summary["normal_force"] is None
    assert [pair["normal_force"] for pair in pairs.values()] == load
    name = next(iter(pairs))
    with pytest.raises(InputError, match=f"name the pair, as in 'shear_force:{name}'"):
        find_quantity("shear_force", scene)
    assert not {"normal_force", "shear_force"} & history.keys()
    assert [history[f"normal_force:{name}"][-1] for name in pairs] == load


@pytest.mark.parametrize("change,message", [
    (lambda s: replace(s, contacts=(Contact("block0", "block7", 0.1),)),
     "'block7' that is not there.*floor, block0"),
    (lambda s: replace(s, bodies=(*s.bodies, s.bodies[1])), "two bodies are named 'block0'"),
    (lambda s: replace(s, contacts=s.contacts[:1]), "body 'block1' belongs to no contact"),
    (lambda s: replace(s, contacts=(*s.contacts, s.contacts[0])), "given twice"),
    (lambda s: replace(s, contacts=(*s.contacts, Contact("block0:top", "block1", 0.1))),
     "'block1-block0.top' and 'block0.top-block1' join the same two surfaces"),
    (lambda s: replace(s,
     contacts=(*s.contacts, Contact("block1:bottom", "block0:top", 0.0, law="tied"))),
     "join the same two surfaces.*keep one of them"),
    (lambda s: replace(s, contacts=()), "belong together"),
    (lambda s: replace(s, mu=0.3), "not both"),
    (lambda s: Contact("a", "a:top", 0.1), "'a' cannot touch itself"),
    (lambda s: Contact("a", 3, 0.1), "by text"),
    (lambda s: Contact("a", "b", -0.1), "must be a finite number at least 0"),
    (lambda s: Contact("a", "b", 0.1, law="glue"), "unknown law"),
    (lambda s: Contact("a", "b", 0.1, carrier="a"), "carrier"),
    (lambda s: Scene("s", s.bodies[1], s.bodies[2]), "give upper, lower and mu"),
    (lambda s: replace(s, contacts=("block0", "block1")), "must be Contact objects"),
    (lambda s: Part("a/b", unit_block("plane-strain", 0, 1), SOFT), "cannot name a file"),
])  # fmt: skip
def test_wrong_input_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        change(stack(2))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("rigid", [False, True])
def test_pairs_that_share_facets_are_refused(dim, rigid):
    """Other names for the same facets, or for some of them, would share one force as well. Pairs of
    boundaries that only meet at nodes are two pairs.
    """
    scene = stack(2, dim)

    def also(low, high):
        def named(part):
            inside = lambda x: (x[0] > low) & (x[0] < high)  # noqa: E731
            mesh = part.mesh
            middle = mesh.p[:, mesh.facets].mean(axis=1)
            more = {}
            for name, other in (("bottom", "half"), ("top", "half_top")):
                facets = mesh.boundaries[name]
                more[other] = facets[inside(middle[:, facets])]
            for name in ("bottom", "top"):
                facets = mesh.boundaries[name]
                more[f"left_{name}"] = facets[middle[0, facets] < 0.5]
            return replace(part, mesh=mesh.with_boundaries(more))

        parts = tuple(part if isinstance(part, Rigid) else named(part) for part in scene.bodies)
        if rigid:
            pairs = Contact("block0:left_bottom", "floor", 0.5), Contact("block0:half", "floor", 0)
        else:
            pairs = (
                scene.contacts[0],
                Contact("block1:left_bottom", "block0:left_top", 0.5),
                Contact("block0:half_top", "block1:half", 0.5),
            )
        kept = parts[:2] if rigid else parts
        return replace(scene, bodies=kept, contacts=pairs)

    with pytest.raises(InputError, match=r"share facets of both bodies near .*keep each facet"):
        reduce_bodies(also(0.3, 1.0))
    assert reduce_bodies(also(0.5, 1.0)).problem.contacts > 4


def test_surfaces_that_are_not_there_are_refused():
    scene = stack(2)
    with pytest.raises(
        InputError, match=r"'block0'.*no boundary named 'lid'.*bottom, left, right, top"
    ):
        reduce_bodies(
            replace(scene, contacts=(scene.contacts[0], Contact("block1", "block0:lid", 0.1)))
        )
    with pytest.raises(InputError, match="rigid body 'floor' has no surface"):
        reduce_bodies(
            replace(scene, contacts=(Contact("block0", "floor:top", 0.1), scene.contacts[1]))
        )
