"""The gallery: thirty short programs, each with a title, an assertion and a figure with labels."""

import ast
import re
import runpy
import time
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

FOLDER = Path(__file__).parents[1] / "experiments" / "gallery"
PROGRAMS = {path.stem: path for path in sorted(FOLDER.glob("*.py"))}
STATEMENTS, LINES, SECONDS = 10, 60, 60
LONG = {"nlp_calibration", "slp_even_pressure"}  # have as many lines as all may have
spent: list[float] = []


@pytest.mark.parametrize("name", list(PROGRAMS))
def test_program_runs_and_draws(name, tmp_path, monkeypatch):
    matplotlib.use("Agg")
    monkeypatch.chdir(tmp_path)
    plt.close("all")
    began = time.process_time()
    runpy.run_path(str(PROGRAMS[name]), run_name="__main__")
    spent.append(time.process_time() - began)
    assert plt.get_fignums(), "a program of the gallery has a figure"
    for ax in plt.gcf().axes:
        assert ax.get_xlabel() and ax.get_ylabel() and ax.has_data()
    plt.close("all")
    assert list(tmp_path.iterdir()) == []
    assert sum(spent) < SECONDS


@pytest.mark.parametrize("name", list(PROGRAMS))
def test_program_is_short(name):
    text = PROGRAMS[name].read_text()
    tree = ast.parse(text)
    statements = [node for node in ast.walk(tree) if isinstance(node, ast.stmt)][1:]
    imports = [node for node in statements if isinstance(node, ast.Import | ast.ImportFrom)]
    assert len(text.splitlines()) <= LINES
    assert name in LONG or len(statements) - len(imports) <= STATEMENTS
    assert any(isinstance(node, ast.Assert) for node in statements)
    for node in imports:
        module = getattr(node, "module", None) or node.names[0].name
        assert module.count(".") <= 1
    assert re.search(r"\nClass: .*Mechanics: ", ast.get_docstring(tree) or "", re.S)


def test_there_are_thirty():
    assert len(PROGRAMS) >= 30
