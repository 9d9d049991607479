"""What the README shows is run as it stands."""

import re
from pathlib import Path

import pytest

from contactopt.solving.methods import METHODS

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


@pytest.mark.parametrize("code", re.findall(r"```python\n(.*?)```", README, re.S))
def test_python_examples_run(code, capsys):
    exec(compile(code, "README.md", "exec"), {})
    assert "False" not in capsys.readouterr().out


def test_the_table_of_methods_is_the_table():
    listed = re.findall(r"^\| `(\w+)` \| (.*) \|$", README, re.M)
    assert listed == [(name, what) for name, (_, _, what) in METHODS.items()]


def test_files_that_are_linked_exist():
    for target in re.findall(r"\]\(([^)h][^)]*)\)", README):
        assert (ROOT / target).exists(), target
