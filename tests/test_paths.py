import xml.etree.ElementTree as ET
from dataclasses import replace

import meshio
import numpy as np
import pytest
from conftest import MATERIAL, block, two_blocks

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
    natural_map_residual,
    plots,
    reduce,
    run,
    scenes,
    solve,
)  # fmt: skip
from contactopt.solving.follow import follow


def dragged(shift: float, force: float = 3.0, mu: float = 0.4) -> Scene:
    """A block pressed on a rigid floor by a plate, its top dragged sideways by a support."""
    mesh = block("plane-strain", 0, 1)
    part = Part(
        "block",
        mesh,
        MATERIAL,
        (Support("top", {"x": shift}),),
        (Plate("top", {"y": -force}, glued=False),),
        "bottom",
    )
    return Scene("dragged", part, Rigid("floor"), mu)


def sheared(**changes: object) -> tuple[Scene, ...]:
    return scenes.shear_cycle(2, **{"steps": 3, "elements": 10, "shear": 30.0, **changes})


@pytest.fixture(scope="module")
def cycle():
    return follow(sheared())


def test_a_path_of_one_state_is_the_static_problem():
    scene = scenes.flat_punch(2, elements=6)
    path = follow([scene])
    alone = solve(reduce(scene))
    np.testing.assert_allclose(
        path.solution.reactions, alone.reactions, atol=1e-8 * np.abs(alone.reactions).max()
    )
    assert path.solved and len(path.states) == 1


def test_every_step_is_certified_by_its_own_problem(cycle):
    for step, state in enumerate(cycle.states):
        solution = state.solution
        assert (
            natural_map_residual(cycle.problem(step), solution.reactions, solution.multipliers)
            <= 1e-8
        )
    assert cycle.reduction.problem.fingerprint == cycle.problem(-1).fingerprint


def test_slip_that_never_turns_back_needs_no_path(cycle):
    last = cycle.states[3].solution.reactions  # the first time at the largest shear
    once = solve(reduce(cycle.states[3].scene)).reactions
    # up to the slip of the normal load alone, which bodies of finite size are not quite without
    np.testing.assert_allclose(last, once, atol=1e-3 * np.abs(once).max())


def test_unloading_needs_the_path(cycle):
    back = cycle.states[6]
    assert abs(cycle.history["shear_force"][6]) < 1e-6
    # locked in; a single step from zero has none
    assert np.abs(back.solution.reactions[:, 1]).sum() > 5.0
    once = solve(reduce(back.scene)).reactions
    assert np.abs(once[:, 1]).sum() < 0.2


def test_a_cycle_closes_and_is_antisymmetric(cycle):
    h = cycle.history
    shares = np.array([3, 2, 1, 0, -1, -2, -3, -2, -1, 0, 1, 2, 3]) / 3
    np.testing.assert_allclose(h["shear_force"][3:], 30 * shares, atol=1e-6)
    assert h["shift"][15] == pytest.approx(h["shift"][3], rel=1e-3)
    assert h["shift"][9] == pytest.approx(-h["shift"][3], rel=2e-3)
    np.testing.assert_allclose(h["shift"][9:16], -h["shift"][3:10], atol=2e-3 * h["shift"].max())


@pytest.mark.slow
def test_friction_work_is_the_area_of_the_loop():
    h = follow(sheared(steps=12, shear=45.0)).history
    force, shift, work = h["shear_force"][12:], h["shift"][12:], h["friction_work"][12:]
    area = np.sum((force[1:] + force[:-1]) / 2 * np.diff(shift))
    assert work[-1] - work[0] == pytest.approx(area, rel=0.02)
    assert np.all(np.diff(h["friction_work"]) >= 0)


def loads(kind: str):
    """Two states of the blocks under other loads than a plate force alone."""
    base = two_blocks(kind, mu=0.02)
    pull = (0.3, -0.2) if kind != "solid" else (0.3, 0.1, -0.2)
    for share in (0.4, 1.0, 0.7):
        upper = replace(
            base.upper, loads=(*base.upper.loads, Traction("side0", tuple(share * t for t in pull)))
        )
        upper = replace(upper, supports=upper.supports[1:] if kind == "solid" else ())
        lower = replace(
            base.lower, supports=(Support("bottom", dict.fromkeys(base.components, 0.01 * share)),)
        )
        yield replace(base, upper=upper, lower=lower)


@pytest.mark.parametrize("kind", ["plane-strain", "axisymmetric", "solid"])
def test_energy_balance_of_general_loads(kind):
    states = list(loads(kind))
    if kind != "axisymmetric":  # held against sliding away and turning by the glued plate
        states = [
            replace(
                s,
                upper=replace(
                    s.upper, loads=(replace(s.upper.loads[0], glued=True), s.upper.loads[1])
                ),
            )
            for s in states
        ]
    path = follow(states, tol=1e-10)
    h = path.history
    assert path.solved and h["friction_work"][-1] > 0
    np.testing.assert_allclose(h["energy_error"], 0.0, atol=1e-9)
    spent = h["elastic_energy"] + h["friction_work"] + h["step_work"]
    np.testing.assert_allclose(h["external_work"], spent, rtol=1e-8)


def test_energy_balance_from_the_interface_alone(cycle):
    """s' dlambda - r' dq = d(r' Q r / 2) + D with mean forces: the interface's share of the same
    balance.
    """
    problem = cycle.reduction.problem
    for old, new in zip(cycle.states[:-1], cycle.states[1:]):
        r0, r1 = (state.solution.reactions.ravel() for state in (old, new))
        moved = new.solution.multipliers - old.solution.multipliers
        elastic = (r1 @ problem.Q @ r1 - r0 @ problem.Q @ r0) / 2
        assert (old.s + new.s) @ moved / 2 == pytest.approx(elastic + new.contact, abs=1e-9)


def test_gross_sliding_saturates_at_the_friction_bound():
    shifts = [0.0, 2.0, 4.0, 6.0, 4.0, 2.0, 0.0, 2.0, 4.0, 6.0]
    path = follow([dragged(d) for d in shifts])
    h = path.history
    assert path.solved
    assert h["shear_force"][3] == pytest.approx(1.2, rel=1e-9)
    assert h["shear_force"][6] == pytest.approx(-1.2, rel=1e-9)
    # mu N times the way
    assert h["friction_work"][3] - h["friction_work"][2] == pytest.approx(1.2 * 2.0, rel=1e-8)
    assert h["stick_nodes"][3] == 0 and h["slip_nodes"][3] == h["contact_nodes"][3] > 2
    np.testing.assert_allclose(h["energy_error"], 0.0, atol=1e-9)
    np.testing.assert_allclose(h["shift"], shifts, atol=1e-12)


def test_a_mirrored_load_gives_the_mirrored_history():
    right, left = (
        follow([dragged(s * d) for d in (0.1, 0.3, 0.2)], tol=1e-12).history for s in (1, -1)
    )
    # the block's mesh is not symmetric, so that only the whole scene's mirror image would agree
    # exactly
    assert np.sign(left["shear_force"]).tolist() == (-np.sign(right["shear_force"])).tolist()
    flipped = follow([_mirror(dragged(-d)) for d in (0.1, 0.3, 0.2)], tol=1e-12).history
    np.testing.assert_allclose(flipped["shear_force"], -right["shear_force"], rtol=1e-8)
    np.testing.assert_allclose(
        flipped["friction_work"], right["friction_work"], rtol=1e-8, atol=1e-12
    )


def _mirror(scene: Scene) -> Scene:
    mesh = scene.upper.mesh
    p = mesh.p.copy()
    p[0] *= -1
    turned = replace(mesh, doflocs=p, t=mesh.t[[0, 3, 2, 1]], _boundaries=None)
    return replace(scene, upper=replace(scene.upper, mesh=turned.with_boundaries(
        {"top": lambda x: x[1] == 1, "bottom": lambda x: x[1] == 0})))  # fmt: skip


def test_units_do_not_matter():
    small = follow(sheared(elements=6)).history
    stiff = follow(sheared(elements=6, material=Material(5e6, 0.3), force=1e8, shear=3e7)).history
    assert stiff["friction_work"] == pytest.approx(1e6 * small["friction_work"], rel=1e-6)
    assert stiff["stick_half_width"] == pytest.approx(small["stick_half_width"], rel=1e-6)


@pytest.mark.parametrize("simplices", [pytest.param(False, marks=pytest.mark.slow), True])
def test_quadratic_elements_follow_the_same_path(cycle, simplices):
    states = scenes.make_path(
        "cattaneo-2d", degree=2, simplices=simplices, steps=3, elements=10, shear=30.0
    )
    h = follow(states).history
    np.testing.assert_allclose(h["energy_error"], 0.0, atol=1e-9)
    for name in ("shear_force", "shift", "friction_work"):
        np.testing.assert_allclose(
            h[name], cycle.history[name], atol=0.05 * np.abs(cycle.history[name]).max()
        )


def test_growing_contact_of_dissimilar_bodies():
    states = scenes.growing_indentation(mu=0.3, elements=48, steps=24)
    h, exact = follow(states).history, states[-1].reference
    assert h["contact_half_width"][-1] == pytest.approx(exact.half_width, rel=0.01)
    assert h["approach"][-1] == pytest.approx(exact.approach, rel=0.01)
    ratio = exact.stick_half_width / exact.half_width
    path = h["stick_half_width"][-1] / h["contact_half_width"][-1]
    once = follow(states[-1:]).history
    assert path == pytest.approx(ratio, abs=0.05)
    # one big step is wrong
    assert once["stick_half_width"][-1] / once["contact_half_width"][-1] < ratio - 0.3
    np.testing.assert_allclose(h["energy_error"], 0.0, atol=1e-9)


def test_a_step_that_is_not_solved_ends_the_path():
    path = follow(sheared(), method="tresca", max_iterations=1)
    assert not path.solved and len(path.states) == 1 and path.states[0].solution.iterations == 1


def test_bad_paths_are_refused():
    with pytest.raises(InputError, match="no states"):
        follow([])
    held = replace(dragged(0.1).upper, supports=(Support("top"),), loads=())
    with pytest.raises(InputError):
        follow([dragged(0.1), replace(dragged(0.1), upper=held)])


def test_a_state_that_nothing_can_hold_is_named():
    def pushed(x):
        block = dragged(0.0).upper
        plate = Plate("top", {"x": x, "y": -1.0})
        return Scene("pushed", replace(block, supports=(), loads=(plate,)), Rigid("floor"), 0.4)

    words = r"^state 3 of 3 slides, .*body 'block': plate 'top' along x is 0.5"
    with pytest.raises(InputError, match=words):
        follow([pushed(x) for x in (0.0, 0.3, 0.5)])


@pytest.mark.parametrize("kept", [True, False])
def test_bodies_of_every_state_carry_its_own_loads(kept):
    """Displacements at a state are those of the path that ends there, kept or found again."""

    def pushed(x):
        block = replace(dragged(0.0).upper, supports=(), loads=(Traction("top", (x, -1.0)),))
        return Scene("pushed", block, Rigid("floor"), 0.4)

    states = [pushed(x) for x in (0.0, 0.1, 0.2)]
    path = follow(states)
    for step in (0, 1, 2, -1):
        until = follow(states[: step % 3 + 1])
        exact = until.reduction.displaced(until.states[-1].solution)[0]
        if not kept:
            path = replace(path, states=tuple(replace(own, bodies=()) for own in path.states))
        found = path.at(step)[0].displaced(path.at(step)[1])[0]
        np.testing.assert_allclose(found, exact, atol=1e-9 * np.abs(exact).max())


def test_files_of_a_path(cycle, tmp_path):
    import pandas as pd

    cycle.write(tmp_path / "new")
    assert {p.name for p in (tmp_path / "new").iterdir()} == {"history.csv", "path.npz"}
    table = pd.read_csv(tmp_path / "new" / "history.csv")
    for name, column in cycle.history.items():
        np.testing.assert_allclose(table[name], column)
    data = np.load(tmp_path / "new" / "path.npz")
    assert (
        data["reactions"].shape
        == data["displacements"].shape
        == (16, cycle.reduction.problem.contacts, 2)
    )


def test_run_follows_the_path_of_a_named_scene(tmp_path):
    result = run("cattaneo-2d", tmp_path, steps=1, elements=8, shear=20.0)
    assert {"history.csv", "path.npz", "path.png", "summary.json"} <= {
        p.name for p in tmp_path.iterdir()
    }
    check_files_of_states(result, tmp_path)
    assert result.summary["states"] == len(result.path.states) == 6
    assert result.summary["shear_force"] == pytest.approx(20.0)
    assert result.summary["friction_work"] == result.path.history["friction_work"][-1] > 0
    assert run("punch-2d", elements=4).path is None


def check_files_of_states(result, folder):
    """Every state has its rows and its files, and the series names each of them once."""
    import pandas as pd

    count, (pair,) = len(result.path.states), result.problem.pairs
    table = pd.read_csv(folder / f"contact-{pair.name}.csv")
    assert list(table.state) == list(np.repeat(np.arange(1, count + 1), result.problem.contacts))
    history = pd.read_csv(folder / "history.csv")
    pushed = table["area [mm^2]"] * table["traction_x [MPa]"]
    sums = pushed.groupby(table.state).sum().to_numpy()
    np.testing.assert_allclose(sums, history[f"force:{pair.name}:x"], atol=1e-9)
    np.testing.assert_allclose(history["force:upper:far:x"], -sums, atol=1e-6)  # what was applied
    named = [
        (own.get("timestep"), own.get("file"))
        for own in ET.parse(folder / "states.pvd").iter("DataSet")
    ]
    files = {f.name for f in folder.glob("*-state*.vtu")}
    assert {file for _, file in named} == files and len(named) == len(files) == 3 * count
    last = meshio.read(folder / f"upper-state{count:04d}.vtu")
    same = meshio.read(folder / "upper.vtu")
    np.testing.assert_allclose(last.point_data["displacement"], same.point_data["displacement"])


def test_the_loop_is_drawn_over_the_shift_or_the_approach():
    cycle = follow(sheared(elements=8)[:4])
    assert plots.loop(cycle).get_xlabel() == "shift [mm]"
    growing = follow(scenes.growing_indentation(elements=8, steps=2))
    assert plots.loop(growing).get_xlabel() == "approach [mm]"


def test_a_path_refuses_states_of_other_bodies():
    scene = scenes.flat_punch(dim=2)
    for change in ({"material": Material(7.0, 0.1)}, {"name": "other"}):
        other = replace(scene, upper=replace(scene.upper, **change))
        with pytest.raises(InputError):
            follow([scene, other], elements=2)


def test_a_stack_without_loads_has_no_remarks_and_stays_where_it_slid():
    """A middle body turns freely between the others, where Newton's system was singular."""
    mesh, states = block("plane-strain", 0, 1), []
    for x, y in ((0.0, 0.0), (0.5, -3.0), (0.0, 0.0), (0.0, -3.0)):
        plate = Plate("top", {"x": x, "y": y})
        top = Part("top", mesh, MATERIAL, (), (plate,), "bottom")
        middle = Part("middle", block("plane-strain", -1, 0, 7, 1.6), MATERIAL, contact="bottom")
        low = block("plane-strain", -2, -1, 9, 2.1)
        base = Part("base", low, MATERIAL, (Support("bottom"),), contact="top")
        pairs = Contact("top", "middle:top", 0.3), Contact("middle", "base", 0.3)
        bodies = top, middle, base
        states.append(Scene("stack", bodies=bodies, contacts=pairs))
    path = follow(states)
    assert path.solved and not any(state.solution.notes for state in path.states)
    assert not np.any(path.states[2].solution.reactions)
    for own in path.reduction.problem.pairs:  # what bends back slides to both sides
        slip = path.states[2].slip[own.contacts, 0]
        assert abs(slip.mean()) < 1e-9 < 1e-3 < np.abs(slip).max()
