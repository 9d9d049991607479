"""The pages to look things up: one for each room of the package, and one for each table of
plug-ins.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docstrings import as_rst

import contactopt
from contactopt.bodies.solvers import SOLVERS
from contactopt.coupling.coupling import COUPLINGS
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.problem.laws import LAWS
from contactopt.scenes import PATHS, SCENES

Pages = Iterator[tuple[Path, str | Path]]


def opening(name: str) -> str:
    """Title and first words of a page that is made from a table."""
    return (Path(__file__).parent / "openings" / f"{name}.md").read_text()


def contents(pages: list[str], hidden: bool = False) -> str:
    """A table of contents; hidden: in the sidebar only."""
    listed = "\n".join(pages)
    return f"\n```{{toctree}}\n:maxdepth: 1\n{':hidden:' if hidden else ''}\n\n{listed}\n```\n"


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A table in Markdown."""
    lines = [head, tuple("---" for _ in head), *rows]
    return (
        "\n".join(
            "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
        )
        + "\n"
    )


# --- the rooms ---


def rooms(root: Path) -> list[str]:
    """The rooms of the package from the bottom up, in the order of the layers in pyproject.toml."""
    contracts = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["importlinter"][
        "contracts"
    ]
    layers = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [
        room.strip().removeprefix("contactopt.")
        for layer in reversed(layers)
        for room in layer.split("|")
    ]


def purposes(root: Path) -> dict[str, str]:
    """What each room is for, as the map of the house in CONTRIBUTING.md says it."""
    rows = re.findall(r"^\| (`[^|]*`) \| (.*) \|$", (root / "CONTRIBUTING.md").read_text(), re.M)
    return {name: what for rooms, what in rows for name in re.findall(r"`(\w+)(?:/|\.py)`", rooms)}


def room_pages(root: Path) -> Pages:
    """The reference: the names that `contactopt` offers, the rooms, and all public names of each
    room.
    """
    names, purpose = rooms(root), purposes(root)
    for name in names:
        yield Path("api", f"{name}.md"), room_page(name, purpose[name])
    listed = table(
        ("room", "what it is for"),
        [(f"[{name}](api/{name}.md)", purpose[name]) for name in names],
    )
    text = f"{exported_names(names, purpose)}\n## The rooms\n\n{ROOMS_TEXT}\n{listed}"
    pages = [f"api/{name}" for name in names]
    yield Path("api.md"), f"# Reference\n\n{text}{contents(pages, hidden=True)}"


ROOMS_TEXT = """The folders of the package are the stages through which data flows. A room
imports only from the rooms that stand above it in this table; a contract of the import linter
checks this.
"""


def room_page(room: str, purpose: str) -> str:
    """All public names of the modules of a room, from their docstrings."""
    parts = []
    homes = [home(getattr(contactopt, name)) for name in contactopt.__all__ if name[0].isupper()]
    # what users hold in their hands comes first
    for name in sorted(modules(f"contactopt.{room}"), key=lambda name: name not in homes):
        # A package exports names of its modules, which are described where they stand and not a
        # second time.
        parts.append(
            f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n   :ignore-module-all:\n```\n"
        )
    return f"# {room}\n\n{purpose}\n\n" + "\n".join(parts)


def modules(name: str) -> list[str]:
    """The module of that name and, if it is a package, those below it, none whose name begins with
    an underscore.
    """
    module = importlib.import_module(name)
    below = pkgutil.walk_packages(getattr(module, "__path__", []), f"{name}.")
    found = [
        name,
        *(info.name for info in below if not info.name.rsplit(".", 1)[1].startswith("_")),
    ]
    return [each for each in found if worth_a_section(each)]


def worth_a_section(name: str) -> bool:
    """Whether a module has a docstring or names of its own."""
    module = importlib.import_module(name)
    own = (thing for key, thing in vars(module).items() if not key.startswith("_"))
    return bool(module.__doc__) or any(getattr(thing, "__module__", None) == name for thing in own)


def home(thing: Any) -> str:
    """The module in which something is described."""
    return thing.__name__ if inspect.ismodule(thing) else thing.__module__


def exported_names(names: list[str], purpose: dict[str, str]) -> str:
    """The names that `contactopt` exports by rooms, the interface problem first, each with the
    first sentence about it.
    """
    rows: dict[str, list[tuple[str, ...]]] = {}
    for name in contactopt.__all__:
        thing = getattr(contactopt, name)
        room = home(thing).split(".")[1]
        first = (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ")
        sentence = re.split(r"(?<=[.:]) ", first)[0].rstrip(":.") + "."
        rows.setdefault(room, []).append((f"[{name}](api/{room}.md)", sentence))
    order = sorted(rows, key=lambda room: (room != "problem", room == "errors", names.index(room)))
    parts = [
        f"### {room}\n\n{purpose[room]}\n\n" + table(("name", "what it is"), rows[room])
        for room in order
    ]
    return "## What `import contactopt` offers\n\n" + "\n".join(parts)


# --- the tables of plug-ins ---


def plug_in_pages(site: Path) -> Pages:
    """One page for each kind of plug-in, one for each method, and the page that leads to them."""
    for name in METHODS:
        yield Path("methods", f"{name}.md"), method_page(site, name)
    pages = {
        "scenes": scenes_table(),
        "methods": methods_table(),
        "laws": described(LAWS),
        "couplings": described(COUPLINGS),
        "preconditioners": described(PRECONDITIONERS),
        "body_solvers": described(SOLVERS),
        "backends": backends_tables(),
    }
    for name, page in pages.items():
        yield Path(f"{name}.md"), f"{opening(name)}\n{page}"
    yield Path("plug_ins.md"), opening("plug_ins") + contents(list(pages))


def methods_table() -> str:
    rows = [(f"[{name}](methods/{name}.md)", what) for name, (_, _, what) in METHODS.items()]
    pages = [f"methods/{name}" for name in METHODS]
    return table(("method", "what it is"), rows) + contents(pages, hidden=True)


def described(plug_ins: dict[str, tuple[str, str, str]]) -> str:
    """A table name -> (module, name there, what it is), and the docstring of each entry."""
    rows = [(f"`{name}`", what, f"`{module}`") for name, (module, _, what) in plug_ins.items()]
    parts = [table(("name", "what it is", "module"), rows)]
    for name, (module, attribute, _) in plug_ins.items():
        thing = getattr(importlib.import_module(module), attribute)
        parts.append(f"\n## {name}\n\n{as_block(inspect.getdoc(thing) or '')}")
    return "\n".join(parts)


def scenes_table() -> str:
    rows = [
        (f"`{name}`", what, "yes" if name in PATHS else "")
        for name, (_, _, what, *_) in SCENES.items()
    ]
    return table(("scene", "what it is", "load path"), rows)


def backends_tables() -> str:
    """Backends of quadratic programs and of cone programs, with the package of each."""
    parts = []
    for title, known in (("Quadratic programs", QP), ("Cone programs", CONIC)):
        rows = [
            (f"`{backend.name}`", f"`{backend.package}`", settings(backend))
            for backend in known.values()
        ]
        parts.append(f"## {title}\n\n{table(('backend', 'package', 'settings'), rows)}")
    return "\n".join(parts)


def settings(backend: Any) -> str:
    return ", ".join(f"`{key}={value!r}`" for key, value in backend.settings.items())


def method_page(site: Path, name: str) -> str:
    """What a method is, its settings, what was written about it by hand, its docstring."""
    file, cls, what = METHODS[name]
    module = f"contactopt.methods.{file}"
    method = getattr(importlib.import_module(module), cls)
    rows = [(f"`{f.name}`", f"`{f.default!r}`") for f in dataclasses.fields(method)]
    listed = (
        f"{table(('setting', 'default'), rows)}\n{as_block(inspect.getdoc(method) or '')}\n"
        if rows
        else "It has no settings.\n"
    )
    notes = site / "notes" / f"{name}.md"
    by_hand = notes.read_text() if notes.exists() else ""
    source = as_block(inspect.getdoc(importlib.import_module(module)) or "")
    docstring = f"## In the words of its module\n\n`{module}`\n\n{source}"
    return (
        f"# {name}\n\n{what[:1].upper()}{what[1:]}.\n\n{by_hand}\n##"
        f" Settings\n\n{listed}\n{docstring}"
    )


def as_block(docstring: str) -> str:
    """A docstring as a block of reStructuredText in a page of Markdown."""
    source = "\n".join(as_rst(docstring.splitlines()))
    return f"```{{eval-rst}}\n{source}\n```\n"
