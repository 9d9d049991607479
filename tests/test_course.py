"""The chapters run, their exercises grade themselves, and the solutions pass the grades that wrong
answers fail.
"""

import json
import re
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from contactopt import InterfaceProblem, solve
from contactopt.teaching import Slider, check

ROOT = Path(__file__).parents[1]
CHAPTERS = {
    path.stem: path for path in sorted((ROOT / "experiments" / "course").glob("chapter_*.py"))
}


@pytest.fixture
def generate(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "experiments" / "site"))
    import generate

    return generate


def exercises(text):
    return re.findall(r"^# \*\*(\d\.\d)\*\*", text, re.M)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CHAPTERS))
def test_a_chapter_and_its_solutions(name, tmp_path, monkeypatch, capsys):
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    plt.close("all")
    runpy.run_path(str(CHAPTERS[name]), run_name="__main__")
    assert plt.get_fignums(), "a chapter draws the mechanical system"
    plt.close("all")
    verdicts = re.findall(r"^Exercise (\S+): (.*)$", capsys.readouterr().out, re.M)
    assert [number for number, _ in verdicts] == exercises(CHAPTERS[name].read_text())
    assert {verdict for _, verdict in verdicts} == {"right."}
    assert list(tmp_path.iterdir()) == []


def test_there_are_twenty_exercises_and_some_need_pen_and_paper_only():
    text = "".join(path.read_text() for path in CHAPTERS.values())
    assert len(CHAPTERS) == 7 and len(exercises(text)) >= 20
    assert text.count("(Pen and paper.)") >= 8
    assert text.count('tags=["exercise"]') == len(exercises(text))


@pytest.mark.parametrize("name", list(CHAPTERS))
def test_readers_get_questions_without_answers(name, generate):
    text = CHAPTERS[name].read_text()
    asked, solved = (
        generate.without_cells(text, "solution"),
        generate.without_cells(text, "exercise"),
    )
    for cell in re.split(r"^(?=# %%)", text, flags=re.M)[1:]:
        assert (cell in asked) == ('tags=["solution"]' not in cell.splitlines()[0])
        assert (cell in solved) == ('tags=["exercise"]' not in cell.splitlines()[0])
    assert asked.count("= ...") + asked.count("= (..., ...)") == len(exercises(text))


@pytest.mark.parametrize("name", list(CHAPTERS))
def test_a_chapter_has_all_its_parts_and_folds_what_only_draws(name, generate):
    text = CHAPTERS[name].read_text()
    for part in (
        "## The mechanical system",
        "rimal",
        "ual",
        "## The optimality conditions",
        "KKT",
        "cvxpy",
        "## What fails",
    ):
        assert part in text, part
    (notebook,) = (
        page for path, page in generate.notebook("course", name, text) if path.suffix == ".ipynb"
    )
    folded = [
        cell
        for cell in json.loads(notebook)["cells"]
        if cell["metadata"].get("jupyter", {}).get("source_hidden")
    ]
    assert len(folded) == text.count('tags=["hide-input"]') > 0
    assert all(re.search(r"\b(ax|plt)\.", "".join(cell["source"])) for cell in folded), (
        "only drawings are folded"
    )


def test_answers_are_graded(capsys):
    problem = InterfaceProblem(np.diag([1.0, 2.0]), [[-1.0, 1.0]], 0.3)
    right = solve(problem).reactions
    assert check("0.1", ..., problem) is None
    assert check("0.1", right, problem) is True
    assert check("0.1", right[0], problem) is True  # one row may be given as a vector
    assert check("0.1", 1.01 * right, problem) is False
    assert check("0.1", right[:, :1], problem) is False
    assert check("0.2", 2.0, 2.0) is True and check("0.2", 2.01, 2.0) is False
    assert (
        check("0.2", (0.0, 3.0), (0.0, 3.0)) is True
        and check("0.2", (3.0, 0.0), (0.0, 3.0)) is False
    )
    assert check("0.2", 3.0, (3.0, 3.0)) is False
    assert check("0.3", 5, lambda n: n == 5) is True and check("0.3", 4, lambda n: n == 5) is False
    assert capsys.readouterr().out.splitlines()[0] == "Exercise 0.1: not answered yet."


def test_an_answer_that_makes_no_sense_is_not_right():
    problem = InterfaceProblem(np.diag([1.0, 2.0]), [[-1.0, 1.0]], 0.3)
    for answer in ("a lot", None, [[1.0], [2.0, 3.0]]):
        assert check("0.1", answer, problem) is False
        assert check("0.2", answer, 2.0) is False


def test_a_slider_holds_one_picture_for_every_value():
    def draw(value):
        fig, ax = plt.subplots()
        ax.plot([0, value])
        return fig

    before = len(plt.get_fignums())
    html = Slider("load <F>", [0.0, 1.0, 2.0], draw, start=1)._repr_html_()
    assert html.count("data:image/png;base64,") == 3 and 'max="2"' in html and 'value="1"' in html
    assert "load &lt;F&gt;" in html and "<F>" not in html and "http" not in html
    assert html.count("display: block") == 1
    assert len(plt.get_fignums()) == before
