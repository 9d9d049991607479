"""What the README shows is run as it stands, and prints what it says."""

import re
from pathlib import Path

import pytest

from contactopt.cli import make_parser

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.S)


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_python_examples_run_and_print_what_the_readme_says(number, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # what an example writes stays there
    exec(compile(EXAMPLES[number], "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "False" not in said
    if number == 0:
        (shown,) = re.findall(r"^It prints\n\n```\n(.*?)```", README, re.M | re.S)
        expected, printed = (re.findall(r"[\w.]+", text) for text in (shown, said))
        assert len(expected) == len(printed)
        for one, other in zip(expected, printed):
            real = re.fullmatch(r"\d+\.\d+", one)
            assert float(one) == pytest.approx(float(other), rel=1e-9) if real else one == other


def test_files_that_are_linked_exist():
    targets = re.findall(r"\]\(([^)h][^)]*)\)", README)
    assert len(targets) > 10
    for target in targets:
        assert (ROOT / target.split("#")[0]).exists(), target


def test_commands_are_commands():
    """Those of contactopt are read by its own parser; files and modules of the others exist."""
    shell = "\n".join(re.findall(r"```sh\n(.*?)```", README, re.S))
    for line in re.findall(r"bin/contactopt (.*)$", shell, re.M):
        make_parser().parse_args(line.split())
    for path in re.findall(r"\b(experiments/\S+)", shell):
        assert (ROOT / path).exists(), path
    for module in re.findall(r"python -m (experiments[\w.]+)", README):
        place = ROOT / module.replace(".", "/")
        assert place.with_suffix(".py").exists() or (place / "__main__.py").exists(), module
    extras = re.search(
        r"\[project.optional-dependencies\](.*?)\n\[", (ROOT / "pyproject.toml").read_text(), re.S
    )[1]
    for extra in re.findall(r"install (?:-e )?'\.\[(\w+)\]'", shell):
        assert re.search(rf"^{extra} = ", extras, re.M), extra


def test_the_page_is_short():
    assert len(README.split()) <= 900


def test_the_three_doors_come_after_install_and_run():
    heads = re.findall(r"^## (.*)$", README, re.M)
    assert heads[0] == "Install and run"
    assert heads[2:5] == ["I have two meshes", "I compare solvers", "I learn or teach"]
    assert "![" in README.split("## ")[0], "the first screen shows what the package does"


def test_the_section_about_tests_is_one_command_that_ends_with_them():
    """It is run as it stands, line by line, before a change lands."""
    (section,) = re.findall(r"^## Tests$(.*?)^## ", README, re.M | re.S)
    (command,) = re.findall(r"```sh\n(.*?)```", section, re.S)
    assert len(command.splitlines()) == 1 and "-m pytest" in command.split("&&")[-1]
