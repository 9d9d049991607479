"""Files of `contactopt run`: names, earlier files, interruptions, numbers that no machine holds."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from contactopt import InputError, Material, Part, Rigid, run, scenes
from contactopt.cli import main
from contactopt.files.writing import OLD, whole_folder
from tests.conftest import block, two_blocks
from tests.test_benchmark_faults import one_line
from tests.test_benchmark_names import BAD_NAMES


@pytest.mark.parametrize("name", BAD_NAMES)
def test_bodies_have_names_that_can_be_files(name):
    for make in (
        lambda: Part(name, block("plane-strain", 0, 1), Material(5.0, 0.3)),
        lambda: Rigid(name),
    ):
        with pytest.raises(InputError, match="name"):
            make()


def test_a_folder_used_again_keeps_nothing_of_the_run_before(tmp_path):
    """The user's files stay, also where they look like those of a run; those of the run go."""
    out, fresh, mine = tmp_path / "out", tmp_path / "fresh", {"notes.txt", "mine.vtu"}
    run(two_blocks("plane-strain"), out)
    first = {file.name for file in out.iterdir()}
    for name in mine:
        (out / name).write_text("mine")
    (out / "path.png").write_text("of a run with a load path")
    run(scenes.flat_punch(2, elements=4), out)
    run(scenes.flat_punch(2, elements=4), fresh)
    last = {file.name for file in out.iterdir()}
    assert last == {file.name for file in fresh.iterdir()} | mine and first - last
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "path.png").write_text("mine")
    run(scenes.flat_punch(2, elements=4), foreign)
    assert (foreign / "path.png").read_text() == "mine"


def test_an_interrupted_run_leaves_nothing(tmp_path):
    """Ctrl-C at several moments: exit code 130, one last line, and either all files or none."""
    for number, wait in enumerate((0.3, 1.0, 2.0)):
        out = tmp_path / f"out{number}" / "below"
        given = ["run", "punch-3d", "--elements", "12", "--out", str(out)]
        command = [sys.executable, "-m", "contactopt", *given]
        heed = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731
        process = subprocess.Popen(
            command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, preexec_fn=heed
        )
        time.sleep(wait)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        if process.returncode != 0 and said:  # it may have been done
            assert process.returncode == 130, said
            one_line(said, "interrupted")
            if out.parent.exists():  # it came after the files had been moved there
                names = sorted(file.name for file in out.iterdir())
                assert "summary.json" in names and "interface.npz" in names, names
                assert names[0][0] != ".", names


@pytest.mark.parametrize("step", ["tempfile.mkdtemp", "os.replace", "shutil.rmtree"])
def test_ctrl_c_while_files_are_moved_leaves_all_or_none(step, tmp_path, monkeypatch):
    real = {"mkdtemp": tempfile.mkdtemp, "replace": os.replace, "rmtree": shutil.rmtree}[
        step.split(".")[1]
    ]

    def interrupted(*given, **named):
        signal.raise_signal(signal.SIGINT)
        return real(*given, **named)

    monkeypatch.setattr(step, interrupted)
    out = tmp_path / "new" / "out"
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background
    try:
        with pytest.raises(KeyboardInterrupt), whole_folder(out) as folder:
            (folder / "a").write_text("1")
            (folder / "b").write_text("2")
    finally:
        signal.signal(signal.SIGINT, before)
    if step == "tempfile.mkdtemp":
        assert not out.parent.exists()
    else:
        assert sorted(file.name for file in out.iterdir()) == ["a", "b"]


HELD = """
thickness = 1
[bodies.pad]
block = { x = [0, 20], y = [0, 10], elements = [8, 4] }
material = { E = 70e3, nu = 0.3 }
contact = "y-"
plates = [{ boundary = "y+", force = { y = -900 } }]
[bodies.floor]
rigid = {}
[[contacts]]
upper = "pad"
lower = "floor"
mu = 0.3
"""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["punch-2d", "--set", "width=1e-300"], "lost in rounding"),
        (["punch-2d", "--set", "width=1e-5"], "lost in rounding"),
        (["pin-in-bush", "--force", "1e150"], "too large"),
        (["pin-in-bush", "--force", "1e-200"], "too small"),
        (["punch-2d", "--force", "1e-320"], "too small: write 0, or take units"),
        (["held.toml", "--set", "bodies.pad.block.x.2=1e200"], "less than 1e+70"),
        (["held.toml", "--set", "bodies.pad.block.x.2=1e-200"], "too small"),
        (["held.toml", "--set", "bodies.pad.material.E=1e-300"], "too small: take units"),
        (["held.toml", "--set", "thickness=1e-308"], "too small: take units"),
        (["held.toml", "--set", "thickness=1e308"], "less than 1e+70"),
        (["hertz-half-space", "--force", "1e-300"], "too small: write 0, or take units"),
        (["punch-2d", "--elements", "1000000000"], "elements"),
        (["punch-2d", "--force", "1e308", "--elements", "4"], "1e+70"),
        (["punch-2d", "--out", "x" * 300], "File name too long"),
        (["x" * 300 + ".toml"], "does not exist"),
    ],
)
def test_sizes_that_numbers_lose_and_names_that_no_file_has(
    arguments, words, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    # as Windows editors write a file, with a mark before the first byte
    Path("held.toml").write_text(HELD, encoding="utf-8-sig")
    assert main(["run", *arguments]) == 2
    one_line(capsys.readouterr().err, words)
    assert not Path("out").exists()


@pytest.mark.parametrize("name", ["punch-2d", "punch-3d", "sphere"])
def test_meshes_beyond_the_memory_that_is_free_are_refused_before_they_are_made(
    name, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("contactopt.checks._free_memory", lambda: 1e6)
    monkeypatch.setattr("skfem.MeshQuad.init_tensor", None)
    monkeypatch.setattr("skfem.MeshHex.init_tensor", None)
    assert main(["run", name, "--elements", "16", "--out", str(tmp_path / "out")]) == 2
    one_line(capsys.readouterr().err, "GB of memory, more than the 0.001 GB that are free")


@pytest.mark.parametrize("place", ["solve_states", "recover"])
def test_the_end_of_memory_in_a_run_is_one_sentence_with_a_size(
    place, tmp_path, capsys, monkeypatch
):
    def full(*given, **more):
        raise MemoryError

    monkeypatch.setattr(f"contactopt.runner.{place}", full)
    assert main(["run", "punch-2d", "--elements", "4", "-q", "--out", str(tmp_path / "out")]) == 2
    one_line(capsys.readouterr().err, "GB were taken when more was asked for")
    left = {"restart.npz"} if place == "recover" else set()  # the solution, to go on with
    assert {file.name for file in tmp_path.glob("out/*")} == left


def test_hidden_folders_of_killed_programs_are_removed_and_those_in_use_are_kept(tmp_path):
    """A program is killed while it writes; one that writes there a day later tidies up."""
    code = (
        "import os, signal, sys\nfrom pathlib import Path\nfrom contactopt.files.writing import"
        " whole_folder\nwith whole_folder(sys.argv[1]) as folder:\n    (folder /"
        " 'half').write_text('x')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)])
    (left,) = tmp_path.glob(".contactopt-*")
    with whole_folder(tmp_path):
        assert left.exists()  # it may belong to a program that is at work
    os.utime(left, (time.time() - 2 * OLD,) * 2)
    with whole_folder(tmp_path) as first, whole_folder(tmp_path) as second:
        assert not left.exists() and first.exists() and second.exists()
        (first / "a").write_text("a")
        (second / "b").write_text("b")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a", "b"]
