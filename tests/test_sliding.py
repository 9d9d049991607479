"""Past what friction holds, the run says which state slides, and writes the states before."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import MATERIAL, block

from contactopt import (
    InterfaceProblem,
    Part,
    Plate,
    Rigid,
    Scene,
    Solution,
    Status,
    Support,
    Traction,
    run,
)
from contactopt.errors import Unbalanced
from contactopt.figures.view_page import certificate_words
from contactopt.outcome import summary_rows, titled
from contactopt.problem.laws.tied import Tied
from contactopt.solving import solve_scene
from contactopt.solving.follow import follow
from contactopt.solving.restart import FILE, read_known
from contactopt.solving.sliding import sliding, sliding_words


def fitted(push, thick=0.02, kind="axisymmetric"):
    """A shaft in a hub with an interference, which holds it by friction against a push along z."""
    shaft = block(kind, -1.0, 1.0, cells=6)
    hub = block(kind, -1.0, 1.0, cells=6)
    hub = replace(hub, doflocs=hub.p + np.array([[1.0 - thick], [0.0]]), _boundaries=None)
    hub = hub.with_boundaries({"bore": lambda x: x[0] < 1.0, "foot": lambda x: x[1] < -1.0 + 1e-9})
    shaft = shaft.with_boundaries({"skin": lambda x: x[0] > 1.0 - 1e-9})
    pushed = Plate("top", {"z": -push}, glued=False)
    return Scene(
        "fit",
        Part("hub", hub, MATERIAL, (Support("foot", {"z": 0.0}),), contact="bore"),
        Part("shaft", shaft, MATERIAL, (), (pushed,), contact="skin"),
        0.15,
        kind=kind,
    )  # fmt: skip


def dragged(push):
    """A block that a plate presses on a rigid floor and pushes sideways."""
    loads = (Plate("top", {"x": push, "y": -1.0}),)
    part = Part("block", block("plane-strain", 0, 1), MATERIAL, (), loads, contact="bottom")
    return Scene("dragged", part, Rigid("floor"), 0.4)


def most(make):
    """What friction bears: mu times the normal force without a push."""
    return 0.4 if make is dragged else 0.15 * run(fitted(0.0)).summary["normal_force"]


def written(scenes, tmp_path, monkeypatch, **options):
    """The result of a load path as `run` writes it."""
    import contactopt.runner as runner

    monkeypatch.setattr(runner, "_states", lambda *_: tuple(scenes))
    return runner.run("punch-2d", tmp_path, **options)


def all_finite(value):
    if isinstance(value, dict):
        return all(map(all_finite, value.values()))
    if isinstance(value, list):
        return all(map(all_finite, value))
    return not isinstance(value, float) or math.isfinite(value)


@pytest.mark.parametrize("make", [fitted, dragged])
def test_the_states_before_one_that_slides_are_written(make, tmp_path, monkeypatch):
    limit = most(make)
    scenes = [make(share * limit) for share in (0.0, 0.5, 0.9, 1.3)]
    result = written(scenes, tmp_path, monkeypatch, html=True)
    assert not result.solution.solved and len(result.path.states) == 3
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert all_finite(summary) and summary["states"] == 3 and summary["status"] != "solved"
    assert "state 4 of 4" in summary["message"] and "slides" in summary["message"]
    words = "slides, every touching contact slips"
    assert words in summary["message"] and "in state 3" in summary["message"]
    said = float(summary["message"].partition("held up to about ")[2].split()[0])
    assert said == pytest.approx(limit, rel=0.1)
    assert not any("so thin" in text for text in summary["remarks"])
    assert len((tmp_path / "history.csv").read_text().splitlines()) == 4
    path = np.load(tmp_path / "path.npz")
    assert len(path["reactions"]) == 3 and np.all(np.isfinite(path["displacements"]))
    table = next(tmp_path.glob("contact-*.csv")).read_text().splitlines()
    assert {row.split(",")[0] for row in table[1:]} == {"1", "2", "3"}
    assert (tmp_path / "view.html").exists() and not read_known(tmp_path).complete
    assert (tmp_path / FILE).exists()
    again = follow(scenes[:3])
    scale = np.abs(path["reactions"]).max()
    np.testing.assert_allclose(
        path["reactions"][-1], again.states[-1].solution.reactions, atol=1e-6 * scale
    )


@pytest.mark.parametrize("make", [fitted, dragged])
def test_what_is_shown_of_a_path_that_ended_early_is_its_last_solved_state(make, monkeypatch):
    """Its numbers and remarks are those of the path without the state that slides."""
    scenes = [make(share * most(make)) for share in (0.0, 0.5, 0.9, 1.3)]
    summary, before = (
        written(scenes[:count], None, monkeypatch, read=("pressure",)).summary for count in (4, 3)
    )
    assert bool(before["remarks"]) == (make is dragged)
    assert summary["shown"] == "state 3" and before["shown"] is None
    ended = ("status", "message", "seconds", "shown", "remarks")
    assert set(before["remarks"]) <= set(summary["remarks"])
    assert {key: value for key, value in summary.items() if key not in ended} == {
        key: value for key, value in before.items() if key not in ended
    }
    assert titled(summary) == f"{summary['scene']}, state 3, the last one solved"
    assert summary_rows(summary)["state 3"].startswith("solved: certificate")
    assert certificate_words(summary).startswith("The path ends after state 3, whose forces are a")


def test_a_state_that_tips_over_says_what_the_one_before_held():
    scenes = []
    for push in (0.0, 0.1, 2.0):
        scene = replace(dragged(0.0), mu=5.0)
        loads = (Traction("top", (push, -1.0)),)
        scenes.append(replace(scene, upper=replace(scene.upper, loads=loads)))
    with pytest.raises(Unbalanced) as told:
        follow(scenes)
    words = str(told.value)
    assert "tips over" in words and "in state 2; numbers and files are those of state 2" in words


def test_a_state_that_slides_is_given_up_before_the_method_ends(monkeypatch):
    """What follows the first stages of the default method may take hours."""
    limit, whole = most(fitted), solve_scene.solve

    def first_stages(problem, max_iterations, **given):
        return whole(problem, max_iterations=min(max_iterations, 12), **given)

    monkeypatch.setattr(solve_scene, "solve", first_stages)
    found = follow([fitted(0.0), fitted(1.3 * limit)])
    assert len(found.states) == 1 and "state 2 of 2 slides" in found.failed.message


def test_a_single_state_that_slides_says_so(tmp_path):
    result = run(fitted(1.3 * most(fitted)), tmp_path)
    assert not result.solution.solved
    assert "slides, every touching contact" in result.summary["message"]
    assert not any("so thin" in text for text in result.summary["remarks"])
    json.dumps(json.loads((tmp_path / "summary.json").read_text()), allow_nan=False)


def test_a_tie_bears_nothing_of_a_motion_without_slip():
    """Its bound is infinite: 0 times infinity is no number, and warned."""
    V = np.array([[1.0], [0.0], [0.0]])
    problem = InterfaceProblem(np.eye(3), np.zeros((1, 3)), law=Tied(), V=V, s=[1.0])
    ended = Solution(np.ones((1, 3)), np.ones(1), Status.STALLED, 1.0, 0, "auto")
    assert sliding(problem, ended, None) is None


def test_a_load_that_the_state_before_held_is_not_what_it_held_up_to():
    """The pressure falls and the load stays, so that the load is not what is held."""
    V = np.array([[0.0], [1.0]])
    problem = InterfaceProblem(np.eye(2), np.zeros((1, 2)), mu=0.3, V=V, s=[100.0])
    before, ended = (
        Solution(np.array([[N, -0.3 * N]]), np.ones(1), status, 1.0, 0, "auto")
        for N, status in ((500.0, Status.SOLVED), (300.0, Status.STALLED))
    )
    found = sliding(problem, ended, before)
    words = sliding_words(found, dragged(1.0), "state 3", "state 2")
    assert "more than friction holds; numbers and files are those of state 2" in words
