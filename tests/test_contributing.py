"""The plug-ins that CONTRIBUTING.md shows are registered and run as they stand; the files it names exist."""

import importlib
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

import contactopt

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
TABLES = {
    "A scene": ("contactopt.scenes", "SCENES"),
    "A method": ("contactopt.solving.methods", "METHODS"),
    "A law": ("contactopt.problem.laws", "LAWS"),
    "A backend": ("contactopt.solving.backends", "CONIC"),
    "A preconditioner": ("contactopt.solving.preconditioners", "PRECONDITIONERS"),
}


def blocks(section: str) -> list[str]:
    text = re.search(rf"^## {section}$(.*?)^## ", TEXT, re.M | re.S)
    return re.findall(r"```python\n(.*?)```", text.group(1), re.S)


def home(path: str, monkeypatch) -> dict:
    """Where the code of a file lives: the module as it is, or a new one of that name."""
    name = path.removesuffix(".py").replace("/", ".")
    if (ROOT / path).exists():
        return vars(importlib.import_module(name)) | {}
    module = ModuleType(name)
    monkeypatch.setitem(sys.modules, name, module)
    return vars(module)


@pytest.mark.parametrize("section", TABLES)
def test_plug_in_runs_as_shown(section, monkeypatch):
    module, table = TABLES[section]
    names = dict(vars(importlib.import_module(module)))
    *code, line, trial = blocks(section)
    assert line.startswith(f"# in {table}\n") and trial.startswith("# try it\n")
    for source in code:
        where = home(re.match(r"# (\S+\.py)\n", source).group(1), monkeypatch)
        exec(compile(source, "CONTRIBUTING.md", "exec"), where)
        names |= where
    (entry,) = eval("{" + line + "\n}", names).items()
    assert entry[0] not in names[table], "the example exists by now: choose another"
    monkeypatch.setitem(names[table], *entry)
    exec(compile(trial, "CONTRIBUTING.md", "exec"), {})


def test_files_and_tables_that_are_named_exist():
    for path in re.findall(r"`((?:contactopt|tests|experiments)/[\w/]+\.py)`", TEXT):
        assert "NAME" in path or (ROOT / path).exists(), path
    for module, table in TABLES.values():
        assert getattr(importlib.import_module(module), table)


def test_version_is_the_same_everywhere():
    assert f"\nversion: {contactopt.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{contactopt.__version__}]" in (ROOT / "CHANGELOG.md").read_text()
    assert f'\nversion = "{contactopt.__version__}"\n' in (ROOT / "pyproject.toml").read_text()
