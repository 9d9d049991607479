"""Lines of a TOML file are known, and its expressions compute and do nothing else."""

import tomllib

import numpy as np
import pytest

from contactopt import InputError
from contactopt.files.toml_table import lines_of
from contactopt.scenes.expressions import Expression


def test_lines_of_all_ways_to_write_toml():
    text = (
        'a = 1 # b = 2\n"quoted key".c = """\nd = 3\n[e]\n"""\n[f."g.h"]\ni = [\n  1,\n  { j = 2, k'
        " = [3,\n 4] },\n]\n[[l]]\nm = 'x = 1'\n[[l]]\nm = 1979-05-27\n[l.n]\no ="
        " \"\\\"]\"\n[[l.p]]\nq = '''\n'''\n[[l.p]]\nq.r = -1.5e3\n"
    )
    data, lines = tomllib.loads(text), lines_of(text)
    found = {"a": 1, "quoted key": 2, "f": 6, "l": 12}
    assert {key: lines.get((key,), 6 if key == "f" else None) for key in data} == found
    places = {
        ("quoted key", "c"): 2,
        ("f", "g.h", "i"): 7,
        ("f", "g.h", "i", 0): 8,
        ("f", "g.h", "i", 1, "j"): 9,
        ("f", "g.h", "i", 1, "k", 1): 10,
        ("l", 0, "m"): 13,
        ("l", 1, "m"): 15,
        ("l", 1, "n"): 16,
        ("l", 1, "n", "o"): 17,
        ("l", 1, "p", 0, "q"): 19,
        ("l", 1, "p", 1): 21,
        ("l", 1, "p", 1, "q", "r"): 22,
    }
    assert {place: lines[place] for place in places} == places


def test_expressions_compute_and_do_nothing_else():
    points = np.array([[0.0, 1.0, 2.0], [4.0, 4.0, 4.0]])
    read = Expression("where(x < 1, 0.2, sqrt(y) / 2) - -x**2 * sin(pi / 2)", ("x", "y"))
    np.testing.assert_allclose(read(points), [0.2, 2.0, 5.0])
    for text in (
        "z",
        "__import__('os')",
        "x.real",
        "().__class__",
        "9**9**9**9",
        "[1]",
        "x if x else y",
        "lambda: 1",
        "sqrt(x, out=y)",
        "(" * 5000 + "x",
        "x" * 600,
        "1e999",
        "sqrt",
        "'a' * 9",
        "True",
    ):
        with pytest.raises(InputError):
            Expression(text, ("x", "y"))(points)
    with pytest.raises(InputError, match=r"no finite value at \(0, 4\)"):
        Expression("1 / x", ("x", "y"))(points)
    Expression("sqrt(x, y)", ("x", "y"))(points)  # numpy's second argument is where it writes
    np.testing.assert_array_equal(points[1], 4.0)
