"""Pages made from what the project already holds: tables, docstrings, tutorials, reports. Written to `generated/`."""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import inspect
import os
import re
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import contactopt
import contactopt.cli
from contactopt.solving.methods import METHODS

ROOT = Path(__file__).parents[2]
# the order in which a course would take them
TUTORIALS = (
    "one_contact_node",
    "from_bodies_to_compliance",
    "why_the_preconditioner_works",
    "four_roads_to_one_answer",
    "no_one_or_three_solutions",
    "a_load_cycle",
    "beat_our_solvers",
    "reading_a_strangers_problem",
)
# reports about accuracy; all others are about performance
ACCURACY = (
    "accuracy",
    "elements",
    "patch_test",
    "hertz",
    "stick_ratio",
    "cattaneo",
    "load_cycle",
    "calculix",
    "qp_backends",
)
PICTURE = re.compile(r"!\[(.*?)\]\((?!http)(.*?)\)")
# module -> what its page is called; every public name that `contactopt` exports lives in one of them
MODULES = {
    "scene": "Scenes: what to model",
    "scenes": "Named scenes",
    "mesh": "Structured meshes",
    "runner": "From a scene to files in one call",
    "reduction": "Reduction to the interface",
    "problem": "The interface problem and its certificate",
    "driver": "Solving",
    "warm": "Warm starts",
    "diagnosis": "Diagnosis",
    "enumeration": "All solutions of small problems",
    "paths": "Load paths",
    "animation": "Pictures of load paths",
    "quantities": "Quantities whose accuracy can be asked for",
    "models": "Convex programs in cvxpy",
    "operators": "The interface operator by its products",
    "preconditioners": "Preconditioners",
    "factors": "Factors of the bodies",
    "linear": "Solvers of the bodies",
    "cones": "Cones and projections",
    "recover": "Displacements and stresses",
    "analytic": "Exact solutions",
    "fclib": "FCLib files",
    "plots": "Figures",
    "benchmark": "Benchmarks",
    "errors": "Errors",
}


def write_pages(site: Path) -> None:
    """Write site/generated from scratch; a file that has not changed keeps its time, so that it is not read again."""
    folder, pages = site / "generated", dict(all_pages(site))
    for path in folder.rglob("*") if folder.exists() else ():
        if path.is_file() and path.relative_to(folder) not in pages:
            path.unlink()
    for name, content in pages.items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(content, Path):
            if not target.exists() or target.read_bytes() != content.read_bytes():
                shutil.copyfile(content, target)
        elif not target.exists() or target.read_text() != content:
            target.write_text(content)


def all_pages(site: Path) -> Iterator[tuple[Path, str | Path]]:
    """Name in `generated` -> text, or the file to be copied."""
    found = {path.stem: path for path in (ROOT / "experiments" / "tutorials").glob("*.py")}
    ordered = [name for name in TUTORIALS if name in found] + sorted(set(found) - set(TUTORIALS))
    for name in ordered:
        yield Path("tutorials", f"{name}.py"), found[name]
    yield Path("tutorials.md"), index("Tutorials", TUTORIAL_TEXT, [f"tutorials/{name}" for name in ordered])
    for name in METHODS:
        yield Path("methods", f"{name}.md"), method_page(site, name)
    table = "\n".join(f"| [{name}](methods/{name}.md) | {what} |" for name, (_, _, what) in METHODS.items())
    text = f"{METHODS_TEXT}\n| method | what it is |\n|---|---|\n{table}\n"
    yield Path("methods.md"), index("Methods", text, [f"methods/{name}" for name in METHODS], hidden=True)
    yield Path("command_line.md"), command_line()
    present = {name: title for name, title in MODULES.items() if importlib.util.find_spec(f"contactopt.{name}")}
    for name, title in present.items():
        yield Path("api", f"{name}.md"), module_page(name, title)
    yield Path("api.md"), index("Reference", reference_table(), [f"api/{name}" for name in present])
    reports = {name_of(path): path for path in sorted((ROOT / "reports").glob("*/report.md"))}
    reports |= {name_of(path): path for path in sorted((ROOT / "reports").glob("*.md"))}
    about = [name for name in ACCURACY if name in reports]
    for page, names in (("accuracy", about), ("performance", [name for name in reports if name not in about])):
        text = (site / f"{page}.md").read_text() + "".join(opening(reports[name]) for name in names)
        yield Path(f"{page}.md"), text + contents([f"reports/{name}" for name in names], hidden=True)
    for name, path in reports.items():
        yield Path("reports", f"{name}.md"), report(path)
        for picture in PICTURE.findall(path.read_text()):
            if (path.parent / picture[1]).exists():  # Sphinx names what is missing
                yield Path("reports", base(path), picture[1]), path.parent / picture[1]


TUTORIAL_TEXT = """Each is a script, a notebook (open the file in Jupyter with jupytext, or in VS Code) and this page,
about ten minutes to read. All claims are asserted; exercises hide their solutions.
"""
METHODS_TEXT = """Every method is called by name, `contactopt.solve(problem, "newton")`, and every answer of every method
gets the same certificate. Letters and signs are those of [the mathematics](../mathematics.md).
"""


def command_line() -> str:
    """The help of every command."""
    parser = contactopt.cli.make_parser()
    commands = next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction)).choices
    pages = [f"# Command line\n\n{inspect.getdoc(contactopt.cli)}\n"]
    for name, command in commands.items():
        command.formatter_class = partial(argparse.HelpFormatter, width=100)
        pages.append(f"## contactopt {name}\n\n```text\n{command.format_help()}```\n")
    return "\n".join(pages)


def index(title: str, text: str, pages: list[str], hidden: bool = False) -> str:
    """A page with a table of contents below its text."""
    return f"# {title}\n\n{text}{contents(pages, hidden)}"


def contents(pages: list[str], hidden: bool) -> str:
    """A table of contents; hidden: in the sidebar only."""
    listed = "\n".join(pages)
    return f"\n```{{toctree}}\n:maxdepth: 1\n{':hidden:' if hidden else ''}\n\n{listed}\n```\n"


def method_page(site: Path, name: str) -> str:
    """What a method is, its settings, what was written about it by hand, its docstring."""
    module, cls, what = METHODS[name]
    method = getattr(importlib.import_module(module), cls)
    rows = "".join(f"| `{f.name}` | `{f.default!r}` |\n" for f in dataclasses.fields(method))
    settings = f"| setting | default |\n|---|---|\n{rows}\n{inspect.getdoc(method)}\n" if rows else "No settings.\n"
    notes = site / "notes" / f"{name}.md"
    by_hand = notes.read_text() if notes.exists() else ""
    source = "\n".join(as_rst(inspect.getdoc(importlib.import_module(module)).splitlines()))
    docstring = f"## In the words of its module\n\n`{module}`\n\n```{{eval-rst}}\n{source}\n```\n"
    return f"# {name}\n\n{what[:1].upper()}{what[1:]}.\n\n{by_hand}\n## Settings\n\n{settings}\n{docstring}"


def module_page(name: str, title: str) -> str:
    """All public names of a module, from their docstrings."""
    members = getattr(importlib.import_module(f"contactopt.{name}"), "__all__", None)
    imported = "   :imported-members:\n" if members else ""
    return f"# {title}\n\n```{{eval-rst}}\n.. automodule:: contactopt.{name}\n{imported}```\n"


def reference_table() -> str:
    """The names that `contactopt` exports, each with the first sentence about it."""
    rows = []
    for name in contactopt.__all__:
        thing = getattr(contactopt, name)
        home = name if inspect.ismodule(thing) else thing.__module__.split(".")[1]
        first = inspect.getdoc(thing).split("\n\n")[0].replace("\n", " ").replace("|", "\\|")
        rows.append(f"| [{name}](api/{home}.md) | {re.split(r'(?<=[.:]) ', first)[0]} |")
    return "\n".join(["What `import contactopt` offers:\n", "| name | what it is |", "|---|---|", *rows, ""])


def name_of(path: Path) -> str:
    """reports/NAME/report.md or reports/NAME.md -> NAME."""
    return path.parent.name if path.name == "report.md" else path.stem


def base(path: Path) -> str:
    """The folder that a report's pictures are named from, below reports/."""
    return os.path.relpath(path.parent, ROOT / "reports")


def report(path: Path) -> str:
    """A report as a page: pictures from its folder, other files by their place in the repository."""
    text = PICTURE.sub(rf"![\1]({Path(base(path), 'x').parent.as_posix()}/\2)", path.read_text())

    def place(link: re.Match) -> str:
        target = os.path.relpath(path.parent / link[2], ROOT)
        return f"{link[1]} (`{target}`)" if link[1].strip("`") not in target else f"`{target}`"

    return re.sub(r"(?<!!)\[([^\]]*)\]\((?!http|#)([^)]*)\)", place, text)


def opening(path: Path) -> str:
    """Title, first paragraph and first picture of a report, and the way to all of it."""
    text = PICTURE.sub(r"![\1](reports/\2)", report(path))
    title, *paragraphs = text.strip().split("\n\n")
    first = next((p for p in paragraphs if p[0] not in "|#!"), "")
    picture = PICTURE.search(text)
    shown = f"{picture[0]}\n\n" if picture else ""
    return f"\n## {title.removeprefix('# ')}\n\n{first}\n\n{shown}[All of this report](reports/{name_of(path)}.md)\n"


def as_rst(lines: list[str]) -> list[str]:
    """Docstrings are plain text: aligned and indented lines become literal, the rest is kept from meaning anything.

    Changes `lines` in place, as autodoc wants it, and returns it.
    """
    out: list[str] = []
    kind = "prose"  # of the line before: prose, item (of a numbered list) or literal
    for line in lines:
        aligned = bool(line) and (line[0] == " " or re.search(r"\S {2,}\S", line) is not None)
        if line.strip() and kind == "item" and line[0] == " ":
            out[-1] += " " + _plain(line.strip())
        elif aligned or (kind == "literal" and not line.strip()):
            language = "pycon" if line.lstrip().startswith(">>>") else "text"
            out += ["", f".. code-block:: {language}", ""] if kind != "literal" else []
            out.append("    " + line if line.strip() else "")
            kind = "literal"
        else:
            number = re.match(r"(\d+)\. ", line)
            out += [""] if number or kind == "literal" else []
            out.append(f"{number[1]}\\. {_plain(line[number.end() :])}" if number else _plain(line))
            kind = "item" if number else "prose"
    lines[:] = [*out, ""]
    return lines


def _plain(text: str) -> str:
    """Prose without mark-up, but for `code`."""
    parts = text.split("`")
    if len(parts) % 2 == 0:  # a stray backtick: none is code
        parts = [text.replace("`", "'")]
    escaped = [
        re.sub(r"([*|\\]|(?<=\w)_(?!\w))", r"\\\1", p) if i % 2 == 0 else f"``{p}``" for i, p in enumerate(parts)
    ]
    return "".join(escaped)
