import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import two_blocks

from contactopt import Contact, InputError, Plate, Rigid, cli, run, scenes, solve
from contactopt.accuracy import everywhere, loop, refine
from contactopt.accuracy.everywhere import best_order, mesh_error, remainder
from contactopt.coupling.reduction import reduce_bodies
from contactopt.material import Material
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.readings.peaks import Reading, at_rim
from contactopt.readings.quantities import ROWS, Quantity, value_of
from contactopt.scenes.refined_scenes import split_scene
from contactopt.scenes.scene import Part, Support
from contactopt.solving.limits import Limits
from contactopt.solving.zone import solve_zone


def punch(**changes):
    """Rigid flat punch on a small block, without friction: quick."""
    return scenes.flat_punch(2, **{"rigid": "punch", "mu": 0.0, "elements": 8} | changes)


# The estimate


@pytest.mark.parametrize("order", [0.8, 1.0, 1.7, 2.0])
def test_the_remainder_of_a_power_of_the_mesh_size_is_exact(order):
    values = 3 + 0.1 * 2.0 ** (-order * np.arange(3))
    rest, found = remainder(*np.diff(values), 2)
    assert found == pytest.approx(order)
    assert values[-1] + rest == pytest.approx(3, abs=1e-12)


def test_the_remainder_does_not_trust_luck():
    # what second order leaves of the difference before
    assert remainder(1.0, 1e-6, 2)[0] == pytest.approx(1 / 12)
    # no slower than order 3/4
    assert remainder(1.0, 0.9, 2)[0] == pytest.approx(0.9 / (2**0.75 - 1))
    rest, order = remainder(1.0, -0.1, 2)
    assert rest == pytest.approx(-0.25) and order is None
    assert remainder(None, 0.3, 2) == (pytest.approx(0.1), None)
    assert remainder(0.0, 0.0, 2)[0] == 0


def test_no_functional_of_contact_is_believed_to_have_order_4():
    """The last step of these energies is small by luck; the limit is about 7.804."""
    rest, order = mesh_error([8.198854, 8.480154, 7.820111, 7.815798], best_order("energy", 2))
    assert order is not None and order > 7
    assert 0.5 < everywhere.safety(4) * abs(rest) / (7.815798 - 7.804) < 4
    assert best_order("energy", 1) == best_order("width", 2) == 2


def test_three_meshes_do_not_confirm_an_order_above_2():
    """These energies fall with order 3 and pass the limit, which is about 6.579."""
    values, best = [6.52629, 6.58031, 6.58651], best_order("energy", 2)
    rest, order = mesh_error(values, best)
    assert order is not None and order > 3
    assert 0.5 < everywhere.safety(3) * abs(rest) / (values[-1] - 6.579) < 4
    assert everywhere.safety(1) == everywhere.safety(2) > everywhere.safety(3)


# Meshes with halved elements


def test_split_keeps_boundaries_and_puts_nodes_on_the_arc():
    sphere = scenes.sphere()
    coarse, fine = (
        scene.upper.build_mesh(8, 20.0) for scene in (sphere, split_scene(sphere, 8, 1))
    )
    assert fine.nelements == 4 * coarse.nelements
    assert set(fine.boundaries) == set(coarse.boundaries)
    nodes = np.unique(fine.facets[:, fine.boundaries["contact"]])
    x, z = fine.p[:, nodes]
    sagitta = 400 - np.sqrt(400**2 - (20 / 16) ** 2)
    assert np.abs(z - (400 - np.sqrt(400**2 - x**2))).max() < 1e-4 * sagitta
    assert np.allclose(np.diff(np.sort(x))[:10], 20 / 16)


# Quantities


def test_the_fitted_peak_is_hertz_where_the_axis_node_is_not():
    scene = scenes.sphere(
        mu=0.0, radius=4000, foundation_radius=8000, foundation_height=8000, rigid="sphere"
    )
    reduction = reduce_bodies(scene, 32, scene.reference.half_width)
    solution = solve(reduction.problem)
    nodal = solution.reactions[0, 0] / reduction.problem.areas[0]
    assert abs(nodal / scene.reference.peak - 1) > 5e-3
    peak = value_of("pressure", reduction, solution)
    assert peak == pytest.approx(scene.reference.peak, rel=2e-3)


@pytest.mark.parametrize("name", ["sphere", "cylinder-2d"])
def test_the_half_width_of_a_round_body_is_of_second_order(name):
    """A linear elastic body on a rigid one: sheared elements would move the edge by .3 of one."""
    scene = scenes.make_scene(name, mu=0.0, rigid="foundation")
    solved = [solve_zone(scene, elements) for elements in (16, 32, 64)]
    widths = [value_of("width", one.reduction, one.solution) for one in solved]
    assert abs(widths[1] / widths[2] - 1) < 3e-4
    assert abs(widths[0] - widths[1]) > 3 * abs(widths[1] - widths[2])


def test_the_peak_of_an_exact_ellipse_is_exact():
    scene = scenes.sphere(mu=0.0, elements=8)
    reduction = reduce_bodies(scene)
    x, areas = reduction.problem.coordinates[0], reduction.problem.areas
    solution = solve(reduction.problem)
    reactions = np.zeros_like(solution.reactions)
    reactions[:, 0] = areas * np.sqrt(np.maximum(0, 1 - (x / x[7]) ** 2))
    ellipse = replace(solution, reactions=reactions)
    assert value_of("pressure", reduction, ellipse) == pytest.approx(1, rel=1e-9)
    assert value_of("width", reduction, ellipse) == pytest.approx(x[7], rel=1e-9)


def test_clapeyron():
    """Without gap and loads but a plate's, the elastic energy is half the plate's work."""
    reduction = reduce_bodies(punch())
    solution = solve(reduction.problem, tol=1e-12)
    work = 100 * value_of("approach", reduction, solution)
    assert value_of("energy", reduction, solution) == pytest.approx(work / 2, rel=1e-9)


def test_quantities_in_3d_agree_with_the_plane():
    """A flat punch on a quarter model presses most at its corner; its peak is at the rim."""
    reduction = reduce_bodies(scenes.flat_punch(3, elements=4))
    assert at_rim(reduction, solve(reduction.problem))
    reduction = reduce_bodies(scenes.cattaneo(3, elements=6))
    solution = solve(reduction.problem)
    assert not at_rim(reduction, solution)
    assert value_of("pressure", reduction, solution) == pytest.approx(
        reduction.scene.reference.peak, rel=0.05
    )


# Refinement


@pytest.mark.slow
def test_refinement_meets_the_target_from_coarse_to_fine():
    scene = punch()
    rough, first = refine([scene], "approach", 3e-2)
    fine, second = refine([scene], "approach", 2e-3)
    assert first.reached and second.reached and second.error <= 2e-3
    assert fine.reduction.dofs > rough.reduction.dofs
    assert fine.reduction.dofs == second.levels[-1].unknowns
    assert second.levels[-1].value == second.value
    truth = refine([scene], "approach", 5e-4)[1].extrapolated
    assert 0.5 < second.error / abs(second.value / truth - 1) < 4
    assert abs(second.extrapolated / truth - 1) < abs(second.value / truth - 1) / 2


def test_the_pressure_of_a_corner_is_refused_when_it_has_grown():
    solved, estimate = refine([punch()], "pressure", 1e-2)
    assert not estimate.reached and estimate.error is None and "corner" in estimate.message
    assert len(estimate.levels) == 3 and solved.solution.solved


def test_a_quantity_that_does_not_converge_is_given_up(monkeypatch):
    """The force density at the corner node grows like h^-1/2."""

    def corner(reduction, s):
        return Reading((s.reactions[:, 0] / reduction.problem.areas).max())

    monkeypatch.setitem(
        ROWS, "corner", ("", lambda name, rest, scene: Quantity(name, None, corner))
    )
    _, estimate = refine([punch()], "corner", 1e-3)
    assert not estimate.reached and "does not converge" in estimate.message
    assert len(estimate.levels) < 7


def test_a_limit_on_unknowns(monkeypatch):
    monkeypatch.setitem(everywhere.MOST_UNKNOWNS, 2, 3000)
    solved, estimate = refine([punch()], "energy", 1e-6)
    assert not estimate.reached and "unknowns, more than 3,000" in estimate.message
    assert solved.reduction.dofs <= 3000 and estimate.error > 1e-6


def test_a_limit_on_memory(monkeypatch):
    """The next mesh is not begun where the meshes so far show that it would take more."""
    taken = iter(np.arange(100) * 1e6)  # each solve takes a megabyte
    monkeypatch.setattr(loop, "resident_memory", lambda: next(taken))
    solved, estimate = refine([punch()], "energy", 1e-6, limits=Limits(memory=0.005))
    assert not estimate.reached and "GB of memory, more than 0.005 GB" in estimate.message
    count = len(estimate.levels)
    assert 2 <= count < 5 and solved.solution.solved
    most = 3000
    monkeypatch.setattr(loop, "resident_memory", lambda: 0.0)  # a system that does not tell
    monkeypatch.setitem(everywhere.MOST_UNKNOWNS, 2, most + 1)
    _, estimate = refine([punch()], "energy", 1e-6)
    assert "unknowns, more than" in estimate.message and len(estimate.levels) >= count


def test_given_meshes_are_halved():
    estimate = run(two_blocks("plane-strain"), accuracy=0.02, quantity="approach").estimate
    assert [level.splits for level in estimate.levels] == list(range(len(estimate.levels)))
    assert estimate.reached


def test_given_meshes_of_solids_are_divided_too():
    _, estimate = refine([two_blocks("solid")], "approach", 0.1, limits=Limits(6000))
    assert len(estimate.levels) > 1
    assert estimate.levels[-1].unknowns > 4 * estimate.levels[0].unknowns


@pytest.mark.slow
def test_a_load_path_is_refined_as_a_whole():
    result = run("cattaneo-2d", steps=1, elements=16, accuracy=0.05, quantity="energy")
    assert result.path is not None and len(result.path.states) == 6
    assert result.estimate.reached


def test_units_do_not_matter():
    mm = refine([punch()], "energy", 1e-2)[1]
    metres = punch(
        width=0.04, height=0.04, foundation_width=0.16, foundation_height=0.08, depth=0.04,
        upper=Material(5e6, 0.3), lower=Material(5e6, 0.3),
    )  # fmt: skip
    m = refine([metres], "energy", 1e-2)[1]
    assert m.value * 1e3 == pytest.approx(mm.value, rel=1e-8)
    assert m.error == pytest.approx(mm.error, rel=1e-5)


def test_command_line(tmp_path, capsys):
    arguments = [
        "run",
        "punch-2d",
        "--out",
        str(tmp_path),
        "--accuracy",
        "0.02",
        "--quantity",
        "energy",
    ]
    assert cli.main(arguments) == 0
    text = capsys.readouterr().out
    assert "estimated relative error" in text and "below the target" in text
    found = json.loads((tmp_path / "summary.json").read_text())["accuracy"]
    assert found["reached"] and found["error"] <= 0.02
    assert [level["elements"] for level in found["levels"]][:3] == [8, 16, 32]
    assert cli.main([*arguments[:-1], "pressure"]) == 1
    assert "corner" in capsys.readouterr().out
    assert "NaN" not in (tmp_path / "summary.json").read_text()


@pytest.mark.parametrize("changes,words", [
    ({"accuracy": 0.1}, "accuracy and quantity belong together"),
    ({"quantity": "energy"}, "accuracy and quantity belong together"),
    ({"accuracy": 0.1, "quantity": "noise"},
     "choose from pressure.*, width.*, approach, stick.*, energy"),
    ({"accuracy": 0.0, "quantity": "energy"}, "the accuracy must be a finite number"),
])  # fmt: skip
def test_bad_input(changes, words):
    with pytest.raises(InputError, match=words):
        run("punch-2d", **changes)


# Against exact solutions


def test_a_quantity_of_one_of_several_pairs():
    """A cylinder on a block, and elsewhere a block on a floor: its pressure is Hertz's."""
    round_one = scenes.cylinder(mu=0.0, force=30.0)
    mesh = rename(
        tensor_mesh(np.linspace(0, 2, 3), np.linspace(0, 1, 3)), axis="x-", contact="y-", top="y+"
    )
    plate = Plate("top", {"y": -1.0}, glued=False)
    block = Part("block", mesh, Material(5.0, 0.3), (Support("axis", {"x": 0.0}),), (plate,))
    names = round_one.upper.name, round_one.lower.name
    pairs = Contact(*names, 0.0), Contact("block", "floor", 0.3)
    scene = replace(
        round_one,
        upper=None,
        lower=None,
        mu=None,
        bodies=(*round_one.parts, block, Rigid("floor")),
        contacts=pairs,
    )
    result = run(scene, accuracy=0.1, quantity="pressure:" + "-".join(names), figures=())
    assert result.estimate.reached
    assert result.estimate.value == pytest.approx(round_one.reference.peak, rel=0.02)
    for wrong, message in (
        (
            "pressure",
            "2 pairs of surfaces, each with its own forces, pressure and half-widths; name",
        ),
        ("pressure:a-b", "there is no pair of surfaces 'a-b'; the pairs are .*, block-floor"),
        ("energy:block-floor", "the energy belongs to the whole scene"),
    ):
        with pytest.raises(InputError, match=message):
            run(scene, accuracy=0.02, quantity=wrong, figures=())
