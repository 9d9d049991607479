"""The commands that the reports name exist, import, and say what they write; the quick ones run."""

import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
QUESTIONS = ROOT / "experiments" / "questions"
MODULES = sorted(
    path.relative_to(ROOT).with_suffix("").as_posix() for path in QUESTIONS.rglob("*.py")
)
REPORTS = sorted(path for path in (ROOT / "reports").glob("*/report.md"))


def command(path: Path) -> list[str]:
    """The questions that a page names as the commands that made it."""
    return re.findall(r"python -m experiments\.([\w.]+)", path.read_text())


@pytest.mark.parametrize("path", MODULES)
def test_every_experiment_imports_what_exists(path):
    module = import_module(path.replace("/", ".").removesuffix(".__init__"))
    assert module.__doc__ and module.__doc__[0] not in " \n"


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_the_command_that_a_report_names_exists(path):
    if "Experiment: [" in path.read_text():  # made by `contactopt report` from a campaign
        assert (ROOT / "experiments" / "campaigns" / f"{path.parent.name}.toml").exists()
        return
    made_by = command(path)[-1]
    name = path.parent.name
    assert made_by in (f"questions.{name}", name)
    program = ROOT.joinpath("experiments", *made_by.split("."))
    assert program.with_suffix(".py").exists() or (program / "__main__.py").exists()


def test_the_index_of_the_reports_names_each_of_them():
    named = re.findall(r"\((\w+)/report\.md\)", (ROOT / "reports" / "README.md").read_text())
    assert sorted(set(named)) == sorted(path.parent.name for path in REPORTS)


def test_a_report_names_the_command_that_writes_it(tmp_path, monkeypatch, capsys):
    from experiments import report

    monkeypatch.setattr(report, "REPORTS", tmp_path)
    report.write("hertz", "Title", "{table}", {"table": [{"x": 1.0}]}, {})
    assert command(tmp_path / "hertz" / "report.md") == ["questions.hertz"]


@pytest.mark.slow
def test_a_question_runs_as_a_command_and_measures_what_it_says():
    """A scene of the search for wrong answers, of which less than all write no report."""
    command = [sys.executable, "-m", "experiments.questions.search_for_wrong_answers", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert re.fullmatch(r"0 2 blocks, [\d.]+ s: agrees\n", done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["accuracy", "half_spaces"])
def test_a_question_in_a_folder_is_a_command_too(name):
    """Its functions may be sent to other processes, which cannot import what stands in __main__."""
    source = (QUESTIONS / name / "__main__.py").read_text()
    assert '__name__ == "__main__"' in source and "get_context" not in source


@pytest.mark.slow
def test_the_picture_of_the_readme_shows_what_its_caption_says():
    """Computed dots on exact curves, slip and stick named."""
    import numpy as np

    from experiments.questions.contact_picture import picture

    axes = picture().axes[1]
    assert [text.get_text() for text in axes.texts] == ["slip", "stick", "slip"]
    pressure, friction, *dots = axes.lines
    for exact, computed in zip((pressure, friction), dots):
        x, y = computed.get_data()
        inside = np.abs(x) < exact.get_xdata().max()
        expected = np.interp(x, *exact.get_data())
        assert np.median(np.abs(y - expected)[inside]) < 0.01 * expected.max()
        assert np.abs(y - expected)[inside].max() < 0.1 * expected.max()


def test_questions_stand_in_their_folder():
    files = {path.name for path in (ROOT / "experiments").glob("*.py")}
    assert files == {"__init__.py", "report.py"}, "move the question to experiments/questions/"


def test_every_command_that_is_named_somewhere_exists():
    files = [
        ROOT / "README.md",
        *ROOT.glob("contactopt/**/*.py"),
        *ROOT.glob("reports/**/*.md"),
        *ROOT.glob("docs/**/*.md"),
    ]
    named = {
        (match[1], str(path.relative_to(ROOT)))
        for path in files
        for match in re.finditer(
            r"python -m\s+(experiments(?:\.\w+)+)", path.read_text(encoding="utf-8")
        )
    }
    assert len(named) > 5
    assert not [(module, path) for module, path in sorted(named) if find_spec(module) is None]
