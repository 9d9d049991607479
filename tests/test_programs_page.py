"""The page of the programs of friction runs and shows every program of contactopt.models."""

import re
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt

from contactopt import models

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "experiments" / "site" / "programs_of_friction.md").read_text()


def cells():
    found = re.findall(r"```\{code-cell\} ipython3\n(.*?)```", PAGE, re.S)
    return [re.sub(r"^:tags:.*\n", "", cell) for cell in found]


def test_the_page_and_its_solutions_run(capsys):
    matplotlib.use("Agg")
    plt.close("all")
    names = {}
    for cell in cells():
        exec(compile(cell, "cell", "exec"), names)
    drawn = len(plt.get_fignums())
    plt.close("all")
    programs = set(models.__all__) - {"Program"}
    assert drawn == len(programs) == 7
    assert all(f"models.{name}(" in PAGE for name in programs)
    assert capsys.readouterr().out.count("CLARABEL") == 7
    solutions = re.findall(r"```py\n(.*?)```", PAGE, re.S)
    assert len(solutions) == 2
    for solution in solutions:
        exec(compile(solution, "solution", "exec"), dict(names))
    assert all(len(line) <= 80 for cell in cells() for line in cell.splitlines())


def test_it_is_one_click_from_the_first_page():
    for page in ("README.md", "experiments/site/index.md"):
        assert "programs_of_friction.md)" in (ROOT / page).read_text()
