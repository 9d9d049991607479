"""Adding a plug-in costs one file and one line: each example of the page is added to a copy of the
package and used by its name.
"""

import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "experiments" / "site" / "add_a_plug_in.md"
TEXT = PAGE.read_text()
# how a table begins in its module; the line of a new entry goes below
OPENING = r"^{table}\b[^\n]*\{{\n(?:    \w+\.name: \w+\n    for \w+ in \(\n)?"


@dataclass(frozen=True)
class Kind:
    """A kind of plug-in: the title of its section, and what it may cost.

    command  of `contactopt`, by which the new entry is used; None where it has no name there
    listed   whether `contactopt list` shows it
    files    that are added;  lines  that are added to the module with the table
    """

    section: str
    command: str | None = None
    listed: bool = True
    files: int = 1
    lines: int = 1


KINDS = {
    "scene": Kind("A scene", "run block --elements 4"),
    "method": Kind("A method", "run punch-2d --mu 0.2 --elements 4 --tol 1e-3 --method projection"),
    "law": Kind("A law"),
    "coupling": Kind("A coupling", listed=False),
    "preconditioner": Kind(
        "A preconditioner", "run punch-2d --elements 8 --q implicit --preconditioner fourier"
    ),
    "backend": Kind("A backend", files=0),
    "body solver": Kind("A body solver", "run punch-2d --elements 4 --solver dense"),
}


def blocks(section: str) -> dict[str, str]:
    """The Python of a section by the comment in the first line of each block, without that line."""
    (text,) = re.findall(rf"^## {section}$(.*?)(?=^## |\Z)", TEXT, re.M | re.S)
    found = (block.split("\n", 1) for block in re.findall(r"```python\n(.*?)```", text, re.S))
    return {head.removeprefix("# "): body for head, body in found}


def insert(text: str, at: int, lines: str) -> str:
    return text[:at] + lines + text[at:]


def add(kind: Kind, package: Path) -> tuple[list[Path], dict[Path, int]]:
    """Add the plug-in to the package as its section says; the files that are new, and lines added
    to the others.
    """
    new, changed = [], {}
    for head, code in blocks(kind.section).items():
        where = re.search(r"(contactopt/\S+\.py)$", head)
        if where is None:
            continue
        path = package.parent / where[1]
        if head == where[1]:
            assert not path.exists(), "the example exists by now: choose another"
            path.write_text(code)
            new.append(path)
            continue
        text = path.read_text()
        table = re.match(r"in (\w+), ", head)
        assert table, head
        start = re.search(OPENING.format(table=table[1]), text, re.M)
        assert start, f"{table[1]} does not begin in {where[1]}"
        path.write_text(insert(text, start.end(), code.rstrip(",\n") + ",\n"))
        changed[path] = changed.get(path, 0) + len(code.splitlines())
    return new, changed


@pytest.mark.parametrize("name", KINDS)
def test_it_costs_one_file_and_one_line_and_is_used_by_its_name(name, tmp_path):
    kind, package = KINDS[name], tmp_path / "contactopt"
    shutil.copytree(ROOT / "contactopt", package, ignore=shutil.ignore_patterns("__pycache__"))
    new, changed = add(kind, package)
    assert len(new) == kind.files and list(changed.values()) == [kind.lines]
    entry = re.search(
        r'"([\w-]+)"',
        next(code for head, code in blocks(kind.section).items() if head[:3] == "in "),
    )[1]

    trial = (
        "import contactopt, sys\nassert contactopt.__file__.startswith(sys.argv[1]),"
        " contactopt.__file__\n"
    )
    trial += blocks(kind.section)["try it"]
    trial += "\nfrom contactopt.cli import main\nassert main(['list']) == 0\n"
    if kind.command:
        assert entry in kind.command.split()
        trial += f"assert main({[*kind.command.split(), '--out', str(tmp_path / 'out')]!r}) == 0\n"
    done = subprocess.run(
        [sys.executable, "-c", trial, str(tmp_path)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    if kind.listed:
        assert re.search(rf"\b{entry}\b", done.stdout.split("\n", 1)[1])
    if kind.command:
        assert "solved" in done.stdout


def test_every_plug_in_that_the_page_shows_is_added_here():
    sections = re.findall(r"^## (.*)$", TEXT, re.M)
    shown = {title for title in sections if any(head.startswith("in ") for head in blocks(title))}
    assert shown == {kind.section for kind in KINDS.values()}
