"""A run that is killed after any of its steps leaves a file from which it can be resumed."""

import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contactopt
from contactopt import Plate, Scene, runner
from contactopt.cli import main
from contactopt.files.writing import replace_file
from contactopt.scenes import PATHS, SCENES, make_path, make_scene
from contactopt.scenes.scene_files import read_scene_file
from contactopt.solving.restart import FILE, Restart, read_known
from tests.test_how_tos import BLOCK, SITE

SMALL = {
    "a scene": ("punch-3d", {"elements": 4}),
    "a contact zone": ("cylinder-2d", {"elements": 8}),
    "several pairs": ("stack", {"elements": 2}),
    "a path": ("hertz-dissimilar", {"steps": 3, "elements": 6}),
    "a path of half-spaces": ("rough", {"steps": 2, "points": 40}),
    "a simplified scene": ("press-fit", {"elements": 4, "simplest": True}),
    "an accuracy": ("punch-2d", {"accuracy": 0.3, "quantity": "energy"}),
    "an accuracy of divided meshes": (
        "punch-2d",
        {"elements": 4, "accuracy": 0.2, "quantity": "energy", "adaptive": True},
    ),
    "a path with an accuracy": (
        "hertz-dissimilar",
        {"steps": 2, "elements": 8, "accuracy": 0.3, "quantity": "energy"},
    ),
    "a path with an accuracy on divided meshes": (
        "hertz-dissimilar",
        {"steps": 2, "elements": 6, "accuracy": 0.5, "quantity": "energy", "adaptive": True},
    ),
}  # fmt: skip
MOST = 2  # snapshots of a quick test from which a run is resumed


def kept_at_each_step(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Make runs write their file at every step, and keep a copy: what a kill would leave."""
    copies: list[Path] = []

    def keep(self: Restart) -> None:
        if self.file is not None:
            replace_file(self.file, self.save)
            copies.append(folder / f"{len(copies)}.npz")
            shutil.copy(self.file, copies[-1])

    def reached(self: Restart, *point: np.ndarray) -> None:
        self.now = point
        keep(self)

    finished = Restart.finished

    def finish(self: Restart, *solution: object) -> None:
        finished(self, *solution)
        keep(self)

    monkeypatch.setattr(Restart, "reached", reached)
    monkeypatch.setattr(Restart, "finished", finish)
    return copies


def numbers(result: Any) -> np.ndarray:
    """What a run answers: sums over all states, and the quantity that it was asked for."""
    states = [result] if result.path is None else result.path.states
    found = [float(np.abs(state.solution.reactions).sum()) for state in states]
    return np.array([*found, *([result.estimate.value] if result.estimate else [])])


@pytest.mark.parametrize(
    "kind",
    [pytest.param(k, marks=[pytest.mark.slow] * k.startswith("a path with an acc")) for k in SMALL],
)
def test_a_run_goes_on_from_each_of_its_steps(kind, tmp_path, monkeypatch):
    name, options = SMALL[kind]
    options = options | {"figures": ()}
    with monkeypatch.context() as patched:
        copies = kept_at_each_step(tmp_path, patched)
        whole = contactopt.run(name, tmp_path / "whole", **options)
    known = read_known(tmp_path / "whole")
    assert known.complete and known.reactions[-1].shape == whole.solution.reactions.shape
    assert len(known.names) == len(whole.problem.pairs) and copies
    chosen = np.unique(np.linspace(0, len(copies) - 1, MOST).astype(int))
    for number in chosen:
        out = tmp_path / f"resumed-{number}"
        out.mkdir()
        shutil.copy(copies[number], out / FILE)
        again = contactopt.run(name, out, resume=True, **options)
        assert again.solution.solved
        np.testing.assert_allclose(numbers(again), numbers(whole), rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind, step", [("a contact zone", 2), ("a path with an accuracy", 12)])
def test_a_process_that_is_killed_leaves_a_run_that_goes_on(kind, step, tmp_path):
    name, options = SMALL[kind]
    options = options | {"figures": ()}
    program = f"""
import os, signal
import contactopt
from contactopt.solving.restart import Restart

steps = 0
def reached(self, *point):
    global steps
    self.now, steps = point, steps + 1
    self.save(self.file)
    if steps == {step}:
        os.kill(os.getpid(), signal.SIGKILL)
Restart.reached = reached
contactopt.run({name!r}, {str(tmp_path)!r}, **{options!r})
"""
    ended = subprocess.run([sys.executable, "-c", program], env=os.environ, timeout=120)
    assert ended.returncode == -signal.SIGKILL
    again = contactopt.run(name, tmp_path, resume=True, **options)
    np.testing.assert_allclose(numbers(again), numbers(contactopt.run(name, **options)), rtol=1e-3)


def as_path(name: str) -> tuple[Scene, ...]:
    """A named scene as a load path: its own, or half of its loads and all of them."""
    size = {"elements": 4} if name != "rough" else {"points": 40}
    if name in PATHS:
        steps = {"hertz-dissimilar": 2, "rough": 2}.get(name, 1)
        return make_path(name, steps=steps, **size)[:3]
    return with_half_of_it(make_scene(name, **size))


def with_half_of_it(scene: Scene) -> tuple[Scene, ...]:
    def half(part: Any) -> Any:
        if part.meshed:
            return replace(part, loads=tuple(map(lighter, part.loads)))
        force = part.force and {axis: value / 2 for axis, value in part.force.items()}
        return replace(part, force=force)

    def lighter(load: Any) -> Any:
        if isinstance(load, Plate):
            return replace(load, force={axis: value / 2 for axis, value in load.force.items()})
        return replace(load, value=tuple(np.asarray(load.value) / 2))

    return scene.with_parts(half), scene


def of_a_how_to(page: str, folder: Path) -> tuple[Scene, ...]:
    """The scene file of a page as a load path; its meshes are made as the page makes them."""
    text = (SITE / f"{page}.md").read_text()
    if "import gmsh" in text:
        pytest.importorskip("gmsh", exc_type=ImportError)
    file, names = folder / "scene.toml", {}
    for kind, block in BLOCK.findall(text):
        if kind == "python":
            exec(compile(block, page, "exec"), names)
        if kind == "toml" and "[bodies." in block:
            file.write_text(block)
            break
        for line in block.replace("\\\n", "").splitlines() if kind == "sh" else ():
            assert line.split()[1] != "mesh" or main(line.split()[1:]) == 0
    states = read_scene_file(file, HELD.get(page, {})).states
    return states if len(states) > 1 else with_half_of_it(states[0])


# the points of a rough surface are given
NAMED = [(name, adaptive) for name in sorted({*SCENES} - {"rough"}) for adaptive in (False, True)]
PAGES = ("check_before_solving", "scene_files", "take_home", "parts_from_cad", "your_own_mesh")
HELD = {"check_before_solving": {"bodies.block.tractions.1.x": 20}}  # as the page mends it


@pytest.mark.slow
@pytest.mark.parametrize("name, adaptive", [*NAMED, *((page, True) for page in PAGES)])
def test_a_path_with_an_accuracy(name, adaptive, tmp_path, monkeypatch):
    """Every named scene and the parts of the how-tos, saved at each step."""
    monkeypatch.chdir(tmp_path)
    states = of_a_how_to(name, tmp_path) if name in PAGES else as_path(name)
    if adaptive and any(part.elastic and not part.meshed for part in states[0].parts):
        pytest.skip("a half-space has no elements to divide")
    monkeypatch.setattr(runner, "_states", lambda *_: states)
    options = {"figures": (), "accuracy": 0.5, "quantity": "energy", "adaptive": adaptive}
    options["max_unknowns"] = 3000
    with monkeypatch.context() as patched:
        copies = kept_at_each_step(tmp_path, patched)
        whole = contactopt.run("punch-2d", tmp_path / "whole", **options)
    for number in {0, len(copies) // 2, len(copies) - 1}:
        out = tmp_path / f"resumed-{number}"
        out.mkdir()
        shutil.copy(copies[number], out / FILE)
        again = contactopt.run("punch-2d", out, resume=True, **options)
        np.testing.assert_allclose(numbers(again), numbers(whole), rtol=1e-3, atol=1e-9)
