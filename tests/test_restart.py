"""A stopped run goes on, and a finished one is a start; the answer is the certified one."""

import json

import numpy as np
import pytest

import contactopt
from contactopt import InputError, scenes
from contactopt.cli import main
from contactopt.solving.restart import FILE, PATIENCE, Known, Restart, read_known
from contactopt.solving.solve_scene import solve_scene

PATH = {"steps": 2, "elements": 4}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    return contactopt.run("cattaneo-2d", out, figures=(), **PATH), out


def stopped(out, after, **more):
    """A run that a person stops while it writes its note about a state."""

    def note(text):
        if text.startswith(f"state {after}"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        contactopt.run("cattaneo-2d", out, figures=(), note=note, **PATH, **more)


def test_a_path_that_a_person_stopped_goes_on(tmp_path, whole):
    stopped(tmp_path, 4)
    assert [file.name for file in tmp_path.iterdir()] == [FILE]
    known = read_known(tmp_path)
    assert not known.complete and len(known.reactions) == 4  # three done, one iterate
    result = contactopt.run("cattaneo-2d", tmp_path, figures=(), resume=True, **PATH)
    iterations = [state.solution.iterations for state in result.path.states]
    assert iterations[:3] == [0, 0, 0] and iterations[4] > 0
    scale = np.abs(whole[0].solution.reactions).max()
    for state, same in zip(result.path.states, whole[0].path.states):
        assert state.solution.solved
        np.testing.assert_allclose(
            state.solution.reactions, same.solution.reactions, atol=1e-6 * scale
        )
    with pytest.raises(InputError, match="is complete"):
        contactopt.run("cattaneo-2d", tmp_path, figures=(), resume=True, **PATH)


def test_a_time_limit_stops_a_run_and_resume_ends_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = ["run", "cattaneo-2d", "--elements", "4", "--set", "steps=1", "--no-figures"]
    assert main([*line, "--time-limit", "0"]) == 1
    assert "the time ran out" in capsys.readouterr().out
    assert main([*line, "--resume"]) == 0
    assert main([*line, "--resume"]) == 2
    assert "is complete" in (said := capsys.readouterr().err) and "--start out/cattaneo-2d" in said
    for content in (b"PK", b"", b"no archive"):
        (tmp_path / FILE).write_bytes(content)
        assert main([*line, "--start", "."]) == 2
        assert "is damaged; run the scene again" in capsys.readouterr().err
    assert main([*line, "--resume", "--start", "out/cattaneo-2d"]) == 2
    assert "exclude each other" in capsys.readouterr().err


def test_a_finished_scene_is_the_start_of_a_changed_one(tmp_path, whole):
    _, out = whole
    cold = contactopt.run("cattaneo-2d", mu=0.55, figures=(), **PATH)
    warm = contactopt.run("cattaneo-2d", mu=0.55, figures=(), start=out, **PATH)
    np.testing.assert_allclose(
        warm.solution.reactions, cold.solution.reactions,
        atol=1e-6 * np.abs(cold.solution.reactions).max(),
    )  # fmt: skip
    other = contactopt.run("cattaneo-2d", start=out, figures=(), steps=1, elements=6)
    assert all(state.solution.solved for state in other.path.states)
    same = contactopt.run(scenes.cattaneo(2, elements=4), start=out, figures=())
    assert same.solution.solved  # a single scene starts from the last state of a path


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_a_start_is_turned_and_finds_its_place(angle):
    """Tractions of another mesh, whose frames point elsewhere, are those in space."""
    scene = scenes.make_scene("punch-3d", elements=4)
    solved = solve_scene(scene)
    reduction, r = solved.reduction, solved.solution.reactions
    turn = np.array(
        [[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]]
    )
    known = Known(
        [pair.name for pair in reduction.problem.pairs],
        np.array([len(r)]),
        reduction.problem.motions,
        reduction.problem.coordinates + 1e-9,  # not the same places: interpolated
        reduction.problem.areas,
        np.einsum("ab,kbc->kac", turn, reduction.frames),
        (r @ turn.T)[None],
        solved.solution.multipliers[None],
        0.0,
        True,
    )
    start = known.start(-1, reduction)
    np.testing.assert_allclose(start.reactions, r, atol=1e-5 * np.abs(r).max())
    np.testing.assert_allclose(start.multipliers, solved.solution.multipliers)


def test_what_does_not_fit_is_told(tmp_path, whole):
    _, out = whole
    with pytest.raises(InputError, match="no pair of surfaces of this scene"):
        contactopt.run("punch-2d", start=out)
    with pytest.raises(InputError, match="2 dimensions does not fit"):
        contactopt.run("punch-3d", elements=2, start=out)
    with pytest.raises(InputError, match=f"holds no {FILE}"):
        contactopt.run("punch-2d", start=tmp_path)
    (tmp_path / FILE).write_bytes(b"no archive")
    with pytest.raises(InputError, match="is damaged"):
        contactopt.run("punch-2d", start=tmp_path)
    np.savez(tmp_path / FILE, names=np.array(["a"]))
    with pytest.raises(InputError, match="is damaged"):
        contactopt.run("punch-2d", start=tmp_path)
    with pytest.raises(InputError, match="give the folder"):
        contactopt.run("punch-2d", resume=True)


def test_iterates_are_kept_from_time_to_time(tmp_path):
    """A process that is killed leaves what it wrote last."""
    scene = scenes.make_scene("punch-2d", elements=4)
    made = contactopt.coupling.reduction.reduce_bodies(scene)
    restart = Restart(tmp_path / FILE)
    restart.begin(made)
    r, lam = np.ones(made.problem.q.shape), np.ones(len(made.problem.s))
    restart.reached(r, lam)
    assert not (tmp_path / FILE).exists()
    restart.written -= 2 * PATIENCE
    restart.reached(2 * r, lam)
    assert read_known(tmp_path).reactions.max() == 2.0


def test_an_interrupted_command_says_how_to_go_on(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line = ["run", "cattaneo-2d", "--elements", "4", "--set", "steps=1", "--no-figures"]
    with monkeypatch.context() as patched:

        def finished(self, solution):
            self.done.append((solution.reactions, solution.multipliers))
            raise KeyboardInterrupt

        patched.setattr(Restart, "finished", finished)
        assert main(line) == 130
    assert "go on with --resume" in capsys.readouterr().err
    assert main([*line, "--resume"]) == 0
    assert "state 1 of 6: solved, 0 iterations" in capsys.readouterr().err


def test_the_summary_of_a_resumed_run_counts_no_iterations(tmp_path):
    first = contactopt.run("punch-2d", tmp_path, elements=8, figures=())
    again = contactopt.run("punch-2d", elements=8, figures=(), start=tmp_path)
    assert again.solution.iterations == 0 and "earlier run" in again.solution.message
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "solved"
    assert again.summary["max_pressure"] == pytest.approx(first.summary["max_pressure"], rel=1e-9)
