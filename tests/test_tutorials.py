"""Every tutorial runs as a script, its assertions hold, its exercises have solutions that run."""

import ast
import re
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

FOLDER = Path(__file__).parents[1] / "experiments" / "tutorials"
TUTORIALS = {path.stem: path for path in sorted(FOLDER.glob("*.py"))}


@pytest.fixture(params=list(TUTORIALS))
def source(request):
    return TUTORIALS[request.param].read_text()


def solutions(source: str) -> list[str]:
    """The Python of each hidden solution, joined: blocks of one solution build on each other."""
    text = "\n".join(line.removeprefix("#").removeprefix(" ") for line in source.splitlines())
    hidden = re.findall(r"<details><summary>Solution</summary>(.*?)</details>", text, re.S)
    return ["\n".join(re.findall(r"```python\n(.*?)```", part, re.S)) for part in hidden]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(TUTORIALS))
def test_tutorial_and_solutions_run(name, tmp_path, monkeypatch, capsys):
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    plt.close("all")
    names = runpy.run_path(str(TUTORIALS[name]), run_name="__main__")
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert figures, "a tutorial has at least one figure"
    for figure in figures:
        for ax in figure.axes:
            assert (
                not ax.axison
                or (ax.get_xlabel() and ax.get_ylabel())
                or ax.get_label() == "<colorbar>"
            )
    for number, code in enumerate(solutions(TUTORIALS[name].read_text()), 1):
        exec(compile(code, f"{name}, solution {number}", "exec"), dict(names))
    plt.close("all")
    assert list(tmp_path.iterdir()) == [], "a tutorial leaves no files behind"


def test_every_exercise_has_a_hidden_solution_with_code(source):
    exercises = re.findall(r"^# \*\*(\d)\.\*\* ", source, re.M)
    assert len(exercises) >= 2 and [int(e) for e in exercises] == list(range(1, len(exercises) + 1))
    assert len(solutions(source)) == len(exercises)
    assert all("assert " in code for code in solutions(source))


def test_it_is_a_notebook_in_the_percent_format(source):
    cells = re.split(r"^# %%", source, flags=re.M)
    assert cells[0] == "", "nothing stands before the first cell"
    assert cells[1].startswith(" [markdown]\n# # "), "the first cell is the title"
    for cell in cells[1:]:
        lines = cell.splitlines()
        if lines[0].startswith(" [markdown]"):
            assert all(line.startswith("#") for line in lines[1:] if line), lines[0:3]
        else:
            compile("\n".join(lines[1:]), "cell", "exec")


def test_claims_are_asserted_and_figures_are_shown_at_the_end(source):
    code = "\n".join(line for line in source.splitlines() if not line.startswith("#"))
    assert len(re.findall(r"^\s*assert ", code, re.M)) >= 5
    assert code.count("plt.show()") == 1 and code.rstrip().splitlines()[-1].startswith("plt.show()")


def test_links_between_tutorials_exist(source):
    for target in re.findall(r"\]\(([\w/.]+\.py)\)", source):
        assert (FOLDER / target).exists(), target


@pytest.mark.parametrize(
    "path",
    [*TUTORIALS.values(), *sorted((FOLDER.parent / "course").glob("*.py"))],
    ids=lambda p: p.stem,
)
def test_no_cell_shows_what_matplotlib_returns(path):
    """The last expression of a cell is shown: a figure is, an object of matplotlib is not."""
    for cell in re.split(r"^# %%", path.read_text(), flags=re.M)[1:]:
        head, _, code = cell.partition("\n")
        last = ast.parse("" if "[markdown]" in head else code).body[-1:]
        shown = ast.unparse(last[0]) if last and isinstance(last[0], ast.Expr) else ""
        assert not re.match(r"(ax|left|right|axes\[\d\])\.(axis|set|legend|plot|text)\b", shown), (
            shown
        )
