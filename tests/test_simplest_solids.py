"""Solids in plane strain, ties and friction without effect are found; what the command says."""

from dataclasses import replace

import numpy as np
import pytest
from test_simplest import SOFT, TIGHT, numbers, prism, punch

import contactopt
from contactopt import InputError, Part, Rigid, Scene, Support, cli, scenes, simplify
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.solving.solve_scene import solve_scene


def test_a_solid_that_is_a_plate_between_rollers_is_in_plane_strain():
    solid, plane = prism(), punch(force={"x": 1.0, "y": -10.0})
    found = simplify(solid, solve=False)
    assert [each.name for each in found.found] == ["plane strain"]
    assert found.scene.kind == "plane-strain"
    whole, section = (solve_scene(scene, options=TIGHT) for scene in (solid, found.scene))
    exact = solve_scene(replace(plane, thickness=1.5), options=TIGHT)
    assert np.allclose(numbers(section), numbers(exact), rtol=1e-8)
    assert np.allclose(numbers(whole), numbers(section), rtol=1e-8)


@pytest.mark.parametrize(
    "scene, reason", [(prism(held=False), "the ends of body"), (prism(push=1.0), "along the axis")]
)
def test_a_prism_that_is_not_in_plane_strain(scene, reason):
    found = simplify(scene, solve=False)
    assert "plane strain" not in [each.name for each in found.found]
    assert any(reason in note for note in found.notes), found.notes


@pytest.mark.parametrize("way", ["gap", "friction", "curve"])
def test_what_changes_along_a_prism_is_seen(way):
    """On a part of a roller, where three stations along it see nothing."""

    def band(x: np.ndarray) -> np.ndarray:
        return np.abs(x[1] - 0.62) < 0.05

    ticks = np.linspace(-2, 2, 9), np.linspace(0, 2, 5), np.linspace(-2, 0, 4)
    mesh = rename(tensor_mesh(*ticks), contact="z+", bottom="z-", near="y-", far="y+")

    def roller(spoilt: bool) -> Scene:
        ridge, slip, crown = (spoilt and way == name for name in ("gap", "friction", "curve"))
        curve = (lambda x: x + np.array([[0], [0], [1e-3]]) * np.sin(x[1])) if crown else None
        held = (Support("bottom"), Support("near", {"y": 0.0}), Support("far", {"y": 0.0}))
        upper = Rigid(
            "roller", (0.0, 0.0, 1.0), lambda x: x[0] ** 2 / 20 - ridge * 0.1 * band(x), {"z": -1.0}
        )
        block = Part("block", mesh, SOFT, held, curve=curve)
        return Scene(
            "roller", upper, block, lambda x: 0.3 - slip * 0.2 * band(x) + 0 * x[0], kind="solid"
        )

    for spoilt in (False, True):
        found = simplify(roller(spoilt))
        assert ("plane strain" in [each.name for each in found.found if each.exact]) != spoilt


def test_blocks_that_stick_are_tied_and_the_assumption_is_checked():
    stack = scenes.stack(tilt=8.0, mu=0.3)
    found = simplify(stack)
    assert "tied contacts" in [each.name for each in found.found]
    ties = found["tied contacts"]
    assert ties.scene is not None and ties.check is not None and ties.after[1] < ties.before[1]
    one, other = (solve_scene(scene, options=TIGHT) for scene in (stack, ties.scene))
    assert np.allclose(numbers(one), numbers(other), rtol=1e-6)
    assert "as was assumed" in ties.check(other)
    slippery = simplify(scenes.stack(tilt=8.0, mu=0.16)).found
    assert not [each for each in slippery if each.name == "tied contacts"]


def test_ties_that_would_slip_are_told():
    steep = scenes.stack(tilt=8.0, mu=0.3)
    ties = simplify(steep)["tied contacts"]
    tilted = scenes.stack(tilt=20.0, mu=0.6)
    loads = {part.name: part.loads for part in tilted.parts if isinstance(part, Part)}
    other = ties.scene.with_parts(
        lambda part: replace(part, loads=loads[part.name]) if isinstance(part, Part) else part
    )
    other = replace(
        other,
        contacts=tuple(
            replace(pair, mu=0.6) if pair.law == "coulomb" else pair for pair in other.contacts
        ),
    )
    assert "would slip" in ties.check(solve_scene(other))


def test_friction_that_does_nothing_is_left_out():
    found = simplify(scenes.press_fit(mu=0.4))
    assert found["frictionless contacts"].error < 1e-6
    assert "slide by at most" in found["frictionless contacts"].check(
        solve_scene(found["frictionless contacts"].scene)
    )
    different = simplify(scenes.cylinder(mu=0.4, rigid="cylinder"))
    assert "frictionless contacts" not in [each.name for each in different.found]


def test_a_report_reads_well_and_names_are_known():
    found = simplify(punch())
    assert "mirror symmetry" in repr(found) and "<table>" in found._repr_html_()
    assert str(found).count("\n") > 3
    with pytest.raises(
        InputError, match="no simplification 'plane strain'; found were: mirror symmetry"
    ):
        found["plane strain"]
    with pytest.raises(InputError, match="must be a Scene"):
        simplify("punch-2d")
    assert not simplify(scenes.hertz_half_space()).found
    with pytest.raises(InputError, match="no boundary named 'wall'"):
        simplify(punch(support=(Support("wall"),)))


def test_the_command_says_what_may_be_left_out_and_run_applies_it(tmp_path, capsys):
    assert cli.main(["simplify", "arch", "--set", "elements=2"]) == 0
    assert "needs no more than one half of the bodies" in capsys.readouterr().out
    run = [
        "run",
        "arch",
        "--elements",
        "2",
        "--no-figures",
        "--simplest",
        "--out",
        str(tmp_path / "half"),
    ]
    assert cli.main(run) == 0
    told = capsys.readouterr()
    assert "needs no more than one half" in told.err and "arch" in told.out


def test_a_load_path_is_not_simplified():
    with pytest.raises(InputError, match="load path"):
        contactopt.run("cattaneo-2d", simplest=True)
