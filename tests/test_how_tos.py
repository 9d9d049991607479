"""The how-to pages run as they stand: files are written, commands executed."""

import inspect
import re
import tomllib
from dataclasses import fields
from pathlib import Path

import pytest

from contactopt.benchmark.experiment import Experiment
from contactopt.benchmark.keys import EXPERIMENT, FIGURE, KINDS, help_text
from contactopt.benchmark.report_figures import FIGURES
from contactopt.benchmark.tables import TABLES
from contactopt.cli import main

SITE = Path(__file__).parents[1] / "experiments" / "site"
PAGES = (
    "bring_your_own_matrices", "parts_from_cad", "scene_files", "check_before_solving",
    "stop_and_go_on", "explore", "certificate", "which_method", "experiment_files", "test_set",
    "your_solver", "figures_for_a_paper", "from_calculix", "take_home",
)  # fmt: skip
BLOCK = re.compile(r"```(python|toml|sh|text)\n(.*?)```", re.S)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_page_runs_as_it_stands(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page, names = (SITE / f"{name}.md").read_text(), {}
    if "import gmsh" in page:
        pytest.importorskip("gmsh", exc_type=ImportError)
    for kind, text in BLOCK.findall(page):
        file = re.match(r"# FILE: (\S+)\n", text)
        if file:
            Path(file[1]).write_text(text[file.end() :])
        elif kind == "toml":
            once = re.sub(r"^repeats = \d+$", "repeats = 1", text, flags=re.M)  # for times only
            Path(f"{tomllib.loads(text)['name']}.toml").write_text(once)
        elif kind == "python":
            exec(compile(text, f"{name}.md", "exec"), names)
        elif kind == "sh":
            for line in text.replace("\\\n", "").splitlines():
                assert main(line.split()[1:]) == 0, capsys.readouterr().err
    if name == "experiment_files":
        report = Path("out/bench/friction/report.md").read_text()
        assert report.count("*Table ") == 4 and report.count("*Figure ") == 5
        assert Path("out/bench/friction/report.html").exists()


def test_every_page_is_on_the_list_of_how_tos():
    listed = (SITE / "how_to.md").read_text()
    assert all(f"\n{name}\n" in listed for name in (*PAGES, "your_own_mesh", "compared"))


def test_every_key_of_an_experiment_file_is_explained_with_an_example_that_is_read():
    assert set(EXPERIMENT) == {field.name for field in fields(Experiment)} - {
        "path",
        "skipped",
        "absent",
        "sources",
    }
    drawn = FIGURES | TABLES
    assert set(KINDS) == set(drawn)
    arguments = {name for draw in drawn.values() for name in inspect.signature(draw).parameters} - {
        "table"
    }
    assert set(FIGURE) == arguments | {"kind", "caption", "where", "optional"}
    for key, (_, example) in (EXPERIMENT | FIGURE).items():
        assert key in tomllib.loads(f"{key} = {example}") and f"{key} = {example}" in help_text()
    page = (SITE / "experiment_files.md").read_text()
    assert all(f'kind = "{kind}"' in page and f"`{kind}`" in page for kind in KINDS)
