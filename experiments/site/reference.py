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
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docstrings import as_rst

import contactopt
from contactopt.bodies.solvers import SOLVERS
from contactopt.methods import METHODS
from contactopt.methods.backends import CONIC, QP
from contactopt.methods.preconditioners import PRECONDITIONERS
from contactopt.scenes import PATHS, SCENES

Pages = Iterator[tuple[Path, str | Path]]


def index(title: str, text: str, pages: list[str], hidden: bool = False) -> str:
    """A page with a table of contents below its text."""
    return f"# {title}\n\n{text}{contents(pages, hidden)}"


def contents(pages: list[str], hidden: bool) -> str:
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
    yield Path("api.md"), index("Reference", text, [f"api/{name}" for name in names], hidden=True)


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
        "scenes": f"# Named scenes\n\n{SCENES_TEXT}\n{scenes_table()}",
        "methods": methods_index(),
        "laws": described("Friction laws", LAWS_TEXT, optional("contactopt.problem.laws", "LAWS")),
        "couplings": described(
            "Couplings", COUPLINGS_TEXT, optional("contactopt.coupling.coupling", "COUPLINGS")
        ),
        "preconditioners": described("Preconditioners", PRECONDITIONERS_TEXT, PRECONDITIONERS),
        "body_solvers": described("Solvers of the bodies", SOLVERS_TEXT, SOLVERS),
        "backends": f"# Backends\n\n{BACKENDS_TEXT}\n{backends_tables()}",
    }
    present = {name: page for name, page in pages.items() if page}
    for name, page in present.items():
        yield Path(f"{name}.md"), page
    yield Path("plug_ins.md"), index("What can be chosen by its name", PLUG_INS_TEXT, list(present))


PLUG_INS_TEXT = """Each of these pages is made from a table of the package, so it lists all that
there is. A new entry costs one file and one line in its table: [how to add
one](../contributing.md).
"""


def methods_index() -> str:
    rows = [(f"[{name}](methods/{name}.md)", what) for name, (_, _, what) in METHODS.items()]
    text = f"{METHODS_TEXT}\n{table(('method', 'what it is'), rows)}"
    return index("Methods", text, [f"methods/{name}" for name in METHODS], hidden=True)


METHODS_TEXT = """Every method is called by its name, `contactopt.solve(problem, "newton")`, and
every answer of every method gets the same certificate. The letters and signs are those of [the
mathematics](../mathematics.md).
"""
SCENES_TEXT = """A named scene is run by `contactopt run NAME` or `contactopt.run("NAME")`. Its
arguments are those of the function in [`contactopt.scenes`](api/scenes.md) that makes it. A scene
with a load path is solved state by state.
"""
PRECONDITIONERS_TEXT = """A preconditioner is an approximate inverse of the compliance $Q$. It makes
iterative methods short, where $Q$ is known by its products only. It is chosen by its name:
`contactopt.run("punch-2d", preconditioner="neumann")`, or `--preconditioner neumann` on the command
line.
"""
SOLVERS_TEXT = """A body solver solves the linear system of one elastic body. It is chosen by its
name: `contactopt.run("punch-2d", solver="superlu")`, or `--solver superlu` on the command line. The
default, `auto`, chooses by size.
"""
LAWS_TEXT = """A law says which forces a contact can carry, and how these forces depend on its
motion. A scene names its law: `Scene(..., law="bilateral")`, or `Contact(..., law="bilateral")` for
one pair of surfaces. The sections below come from the table of laws.
"""
COUPLINGS_TEXT = """A coupling says how the displacements of two contact surfaces make the relative
displacements of the contacts. The default, `auto`, takes `matching` if the nodes of the two
surfaces match, and `mortar` if they do not.
"""
BACKENDS_TEXT = """A backend is a solver of quadratic or cone programs that others wrote. (A
quadratic program has a quadratic cost and linear constraints. A cone program may also bound the
length of a vector.) A backend is chosen by its name: `contactopt.solve(problem, normal="osqp")`, or
`--normal osqp` on the command line. The packages that do not come with contactopt are installed by
`pip install 'contactopt[backends]'` or one by one.
"""


def optional(module: str, name: str) -> dict[str, tuple[str, str, str]]:
    """A table of plug-ins, empty where the package has none of that kind."""
    return getattr(importlib.import_module(module), name, {}) if find_spec(module) else {}


def described(title: str, text: str, plug_ins: dict[str, tuple[str, str, str]]) -> str:
    """A page made from a table name -> (module, name there, what it is), with the docstring of each
    entry.
    """
    if not plug_ins:
        return ""
    rows = [(f"`{name}`", what, f"`{module}`") for name, (module, _, what) in plug_ins.items()]
    parts = [f"# {title}\n\n{text}\n{table(('name', 'what it is', 'module'), rows)}"]
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
