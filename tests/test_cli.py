"""The command line: what it prints, and where."""

import json
import subprocess
import sys

import pytest

import contactopt
from contactopt import cli
from contactopt.cli.completion import script
from contactopt.scenes import SCENES


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out.strip() == f"contactopt {contactopt.__version__}"


def test_set_changes_any_argument_of_a_scene(tmp_path, capsys):
    arguments = ["run", "punch-2d", "--no-figures", "--json", "--out", str(tmp_path)]
    assert (
        cli.main([*arguments, "--set", "elements=4", "--set", "width=30", "--set", "rigid=punch"])
        == 0
    )
    printed = capsys.readouterr()
    summary = json.loads(printed.out)  # nothing else is on the standard output
    assert summary == json.loads((tmp_path / "summary.json").read_text()) and not printed.err
    assert summary["contact_half_width"] == pytest.approx(15) and summary["contact_nodes"] == 5
    assert not list(tmp_path.glob("*.png")) and "figures" not in summary["seconds"]


@pytest.mark.parametrize(
    "given,words",
    [
        (["--set", "widht=30"], "no argument 'widht'; its arguments are width, height"),
        (["--set", "width"], "--set needs NAME=VALUE"),
        (["--set", "mu=0.1", "--mu", "0.2"], "'mu' is given twice"),
        (["--set", "width=wide"], "width must be a finite number"),
    ],
)
def test_arguments_that_a_scene_does_not_take_are_refused_with_those_it_takes(
    given, words, tmp_path, capsys
):
    assert cli.main(["run", "punch-2d", "-q", *given, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert words in error and len(error.splitlines()) == 1


def test_quiet_says_results_only_and_verbose_says_the_steps(tmp_path, capsys):
    arguments = ["run", "punch-2d", "--elements", "4", "--no-figures", "--out", str(tmp_path)]
    assert cli.main([*arguments, "-q"]) == 0
    printed = capsys.readouterr()
    assert not printed.err and "solved" in printed.out
    done = subprocess.run(
        [sys.executable, "-m", "contactopt", *arguments, "-v"], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert "contactopt.solving.solve_scene: punch-2d: 4 elements, solved" in done.stderr


def test_figures_are_written_in_the_formats_asked_for_and_old_ones_go(tmp_path):
    scene = contactopt.scenes.flat_punch(2, elements=4)
    contactopt.run(scene, tmp_path, figures=("svg", "pdf"))
    assert (tmp_path / "pressure.svg").read_text().startswith("<?xml")
    assert not (tmp_path / "pressure.png").exists()
    assert (tmp_path / "deformed.pdf").read_bytes()[:4] == b"%PDF"
    contactopt.run(scene, tmp_path, figures=())
    assert not list(tmp_path.glob("*.svg")) + list(tmp_path.glob("*.pdf"))
    with pytest.raises(contactopt.InputError, match="formats of png, svg, pdf"):
        contactopt.run(scene, tmp_path, figures="png")


@pytest.mark.parametrize("name", ["punch-2d", "pin-in-bush", "rough"])
def test_show_says_what_a_scene_is(name, capsys):
    assert cli.main(["show", name]) == 0
    text = capsys.readouterr().out
    assert SCENES[name][2] in text and "arguments" in text and "source: contactopt/scenes/" in text
    assert {
        "punch-2d": "nothing is known exactly",
        "pin-in-bush": "known exactly: Persson",
        "rough": "7 states",
    }[name] in text


def test_the_sketch_has_the_proportions_of_the_scene(capsys):
    """A punch of 20 x 40 on a foundation of 80 x 80, half model: a third of the lines, a quarter of
    the columns.
    """
    cli.main(["show", "punch-2d", "--set", "mu=0.1"])
    lines = capsys.readouterr().out.splitlines()
    punch = [line for line in lines if line and set(line) == {"#"}]
    foundation = [line for line in lines if line and set(line) == {"*"}]
    assert len(foundation) == 2 * len(punch) and len(foundation[0]) == 4 * len(punch[0])
    assert any("mu = 0.1" in line for line in lines)


def test_show_reads_a_scene_file(tmp_path, capsys):
    file = tmp_path / "scene.toml"
    assert cli.main(["new", str(file)]) == 0 and cli.main(["show", str(file)]) == 0
    assert "body '" in capsys.readouterr().out


def test_bash_completes_commands_options_and_scenes():
    def complete(*words):
        line = " ".join(f"'{word}'" for word in ("contactopt", *words))
        code = (
            f"{script(cli.make_parser(), 'bash')}\nCOMP_WORDS=({line}); COMP_CWORD={len(words)};"
            f" _shtab_contactopt x '{words[-1]}'"
        )
        done = subprocess.run(
            ["bash", "-c", code + '; echo "${COMPREPLY[@]}"'],
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    assert complete("sh") == ["show"]
    assert complete("run", "punch") == ["punch-2d", "punch-3d"]
    assert complete("run", "--pre") == ["--preconditioner"]
    assert "newton" in complete("run", "--method", "")


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_get_a_script_of_their_own(shell, capsys):
    assert cli.main(["completion", shell]) == 0
    assert "punch-3d" in capsys.readouterr().out


def test_a_reader_that_wants_no_more_output_is_no_error():
    """As in `contactopt list | head -1`."""
    command = [sys.executable, "-m", "contactopt", "list"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
    assert process.returncode == 0
