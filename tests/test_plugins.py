"""Each example of the page of plug-ins is added to a copy of the package and used."""

import json
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
    "load": Kind("A load", listed=False),
    "kind": Kind("A kind of analysis", listed=False),
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
    """Add the plug-in to the package as its section says; the files that are new."""
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


# tries each plug-in by its program and its command, and prints what each of them printed
TRIAL = """
import contextlib, io, json, shlex, sys, traceback
import contactopt
from contactopt.cli import main
assert contactopt.__file__.startswith(sys.argv[1]), contactopt.__file__
printed = {}
for name, (code, command) in json.loads(sys.argv[2]).items():
    with contextlib.redirect_stdout(io.StringIO()) as out:
        try:
            exec(compile(code, name, "exec"), {"__name__": "__main__"})
            assert command is None or main(shlex.split(command)) == 0
        except Exception:
            traceback.print_exc(file=out)
    printed[name] = out.getvalue()
with contextlib.redirect_stdout(io.StringIO()) as out:
    assert main(["list"]) == 0
printed["list"] = out.getvalue()
print(json.dumps(printed))
"""


@pytest.fixture(scope="module")
def added(tmp_path_factory):
    """What each plug-in of the page costs, and what it prints, all in one copy of the package."""
    folder = tmp_path_factory.mktemp("plug-ins")
    package = folder / "contactopt"
    shutil.copytree(ROOT / "contactopt", package, ignore=shutil.ignore_patterns("__pycache__"))
    costs = {name: add(kind, package) for name, kind in KINDS.items()}
    trials = {
        name: (
            blocks(kind.section)["try it"],
            kind.command and f"{kind.command} --no-figures --out {folder / name.split()[0]}",
        )
        for name, kind in KINDS.items()
    }
    done = subprocess.run(
        [sys.executable, "-c", TRIAL, str(folder), json.dumps(trials)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return costs, json.loads(done.stdout)


@pytest.mark.parametrize("name", KINDS)
def test_it_costs_one_file_and_one_line_and_is_used_by_its_name(name, added):
    kind, (costs, printed) = KINDS[name], added
    new, changed = costs[name]
    assert len(new) == kind.files and list(changed.values()) == [kind.lines]
    entry = re.search(
        r'"([\w-]+)"',
        next(code for head, code in blocks(kind.section).items() if head[:3] == "in "),
    )[1]
    assert "Traceback" not in printed[name], printed[name]
    if kind.listed:
        assert re.search(rf"\b{entry}\b", printed["list"].split("\n", 1)[1])
    if kind.command:
        assert entry in kind.command.split() and "solved" in printed[name]


def test_every_plug_in_that_the_page_shows_is_added_here():
    sections = re.findall(r"^## (.*)$", TEXT, re.M)
    shown = {title for title in sections if any(head.startswith("in ") for head in blocks(title))}
    assert shown == {kind.section for kind in KINDS.values()}
