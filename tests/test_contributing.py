"""What CONTRIBUTING.md says is so; tests/test_plugins.py runs its page of plug-ins."""

import re
import subprocess
import sys
from pathlib import Path

import contactopt

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text()
PAGE = (ROOT / "experiments" / "site" / "add_a_plug_in.md").read_text()
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
        assert (ROOT / target.split("#")[0]).exists(), target


def examples() -> list[str]:
    return re.findall(r"^# (contactopt/\S+\.py)$", PAGE, re.M)


def test_the_map_shows_every_room_in_the_order_of_the_layers():
    """Read from the top: cli first, errors last."""
    shown = [name for cells in rows("room") for name in re.findall(r"`(\w+)(?:/|\.py)`", cells[0])]
    present = {
        p.stem
        for p in (ROOT / "contactopt").iterdir()
        if p.suffix == ".py" or (p / "__init__.py").exists()
    }
    assert set(shown) == present - {"__init__", "__main__"} and len(set(shown)) == len(shown)
    layers = re.findall(
        r'^    "((?:contactopt\.\w+)(?: \| contactopt\.\w+)*)",$',
        (ROOT / "pyproject.toml").read_text(),
        re.M,
    )
    place = {
        room.removeprefix("contactopt."): i
        for i, layer in enumerate(layers)
        for room in layer.split(" | ")
    }
    assert [place[name] for name in shown] == sorted(place.values())


def test_tables_that_are_named_are_there():
    for _, where, tables in rows("you want to add"):
        folder = re.search(r"`(contactopt/[\w/.]+)`", where)
        for table in re.findall(r"`(\w+)`", tables):
            place = ROOT / folder[1]
            files = [place] if place.is_file() else place.glob("*.py")
            assert any(re.search(rf"^{table}\b.*=", file.read_text(), re.M) for file in files), (
                table
            )


def test_links_lead_to_sections_of_their_page():
    for text, anchors in ((TEXT, r"\]\(#([\w-]+)\)"), (PAGE, r"add_a_plug_in\.md#([\w-]+)\)")):
        titles = re.findall(r"^## (.*)$", text, re.M)
        heads = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
        found = re.findall(anchors, TEXT)
        assert found and set(found) <= heads


def test_examples_are_in_the_style_of_the_project(tmp_path):
    for number, code in enumerate(re.findall(r"```python\n(# contactopt/.*?)```", PAGE, re.S)):
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
    done = subprocess.run([*map(str, command), str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_the_page_is_short():
    assert len(TEXT.split()) <= 1300  # a hundred of them are the section on English


def test_version_is_the_same_everywhere():
    assert f"\nversion: {contactopt.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"\n## [{contactopt.__version__}]" in (ROOT / "CHANGELOG.md").read_text()
    assert f'\nversion = "{contactopt.__version__}"\n' in (ROOT / "pyproject.toml").read_text()
