"""What CONTRIBUTING.md says of the project is so; the plug-ins that it shows are added by tests/test_plugins.py."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import contactopt

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
NAMES = re.findall(r"`((?:contactopt|tests|experiments)/[\w/]*(?:\.\w+)?)`", TEXT)


def rows(title: str) -> list[list[str]]:
    """The cells of the rows of the table whose first head is `title`."""
    (table,) = re.findall(rf"^\| {title} \|.*\n\|[-|]*\n((?:\|.*\n)+)", TEXT, re.M)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]


def test_files_and_folders_that_are_named_exist():
    assert len(NAMES) > 15
    for path in NAMES:
        made = "NAME" in path or "/generated/" in path or path in examples()
        assert made or (ROOT / path).exists(), path
    for target in re.findall(r"\]\(([^)#h][^)]*)\)", TEXT):
        assert (ROOT / target).exists(), target


def examples() -> list[str]:
    return re.findall(r"^# (contactopt/\S+\.py)$", TEXT, re.M)


def test_the_map_shows_every_room_in_the_order_of_the_layers():
    """Read from the top: cli first, errors last."""
    shown = [name for cells in rows("room") for name in re.findall(r"`(\w+)(?:/|\.py)`", cells[0])]
    present = {p.stem for p in (ROOT / "contactopt").iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert set(shown) == present - {"__init__", "__main__"} and len(set(shown)) == len(shown)
    layers = re.findall(
        r'^    "((?:contactopt\.\w+)(?: \| contactopt\.\w+)*)",$', (ROOT / "pyproject.toml").read_text(), re.M
    )
    place = {room.removeprefix("contactopt."): i for i, layer in enumerate(layers) for room in layer.split(" | ")}
    assert [place[name] for name in shown] == sorted(place.values())


def test_tables_that_are_named_are_there():
    for _, where, tables in rows("you want to add"):
        folder = re.search(r"`(contactopt/[\w/.]+)`", where)
        for table in re.findall(r"`(\w+)`", tables):
            place = ROOT / folder[1]
            files = [place] if place.is_file() else place.glob("*.py")
            assert any(re.search(rf"^{table}\b.*=", file.read_text(), re.M) for file in files), table


def test_links_within_the_page_lead_to_its_sections():
    heads = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in re.findall(r"^## (.*)$", TEXT, re.M)}
    for anchor in re.findall(r"\]\(#([\w-]+)\)", TEXT):
        assert anchor in heads, anchor


def test_examples_are_in_the_style_of_the_project(tmp_path):
    for number, code in enumerate(re.findall(r"```python\n(# contactopt/.*?)```", TEXT, re.S)):
        (tmp_path / f"example_{number}.py").write_text(code)
    ours = "lint.isort.known-first-party = ['contactopt']"
    command = [
        sys.executable,
        "-m",
        "ruff",
        "check",
        "--no-cache",
        "--config",
        ROOT / "pyproject.toml",
        "--config",
        ours,
    ]
    pytest.importorskip("ruff")
    done = subprocess.run([*map(str, command), str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_version_is_the_same_everywhere():
    assert f"\nversion: {contactopt.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{contactopt.__version__}]" in (ROOT / "CHANGELOG.md").read_text()
    assert f'\nversion = "{contactopt.__version__}"\n' in (ROOT / "pyproject.toml").read_text()


def test_modules_moved_to_places_that_exist():
    """The changelog names the new place of every module; those that it calls old are gone or folders."""
    text = (ROOT / "CHANGELOG.md").read_text()
    moved = dict(re.findall(r"^  \| `(contactopt\.\w+)` \| (`.*`) \|$", text, re.M))
    assert len(moved) > 30
    for old, new in moved.items():
        assert not (ROOT / f"{old.replace('.', '/')}.py").exists(), old
        for name in re.findall(r"`([\w.]+)`", new):
            assert importlib.util.find_spec(name), f"{old} -> {name}"
