"""Pages made from what the project already holds: tables, docstrings, tutorials, reports.

Written to `generated/`.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import jupytext
import lectures
import museum
import reference
from reference import contents, opening

import contactopt.cli
from experiments.course.nbgrader import solved

ROOT = Path(__file__).parents[2]
# the order in which a course would take them
TUTORIALS = (
    "why_the_preconditioner_works",
    "no_one_or_three_solutions",
    "a_load_cycle",
    "beat_our_solvers",
    "reading_a_strangers_problem",
    "derivatives_with_kinks",
    "half_space_or_finite_elements",
)
# the order in which the chapters are read: duality comes after the first two
CHAPTERS = (1, 2, 7, 3, 4, 5, 6)
PICTURE = re.compile(r"!\[(.*?)\]\((?!http)(.*?)\)")


def write_pages(site: Path) -> None:
    """Write site/generated from scratch; a file that has not changed keeps its time, so that it is
    not read again.
    """
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
        yield from notebook("tutorials", name, found[name].read_text())
    listed = contents([f"tutorials/{name}" for name in ordered])
    yield Path("tutorials.md"), opening("tutorials") + listed
    yield from notebook("gallery", "gallery", gallery())
    yield from course(site)
    yield Path("museum.md"), museum.index(site)
    yield Path("lecturers.md"), lectures.index(site)
    yield from reference.plug_in_pages(site)
    yield Path("command_line.md"), command_line()
    yield from reference.room_pages(ROOT)
    reports = {name_of(path): path for path in sorted((ROOT / "reports").glob("*/report.md"))}
    listed = (ROOT / "reports" / "README.md").read_text()
    yield Path("measured.md"), re.sub(r"\((\w+)/report\.md\)", r"(reports/\1.md)", listed)
    first = listed.split("\n## ")[1]  # reports about accuracy; all others are about performance
    about = re.findall(r"\((\w+)/report\.md\)", first)
    for page, names in (
        ("accuracy", about),
        ("performance", [name for name in reports if name not in about]),
    ):
        text = (site / f"{page}.md").read_text() + "".join(
            beginning(reports[name]) for name in names
        )
        yield (
            Path(f"{page}.md"),
            text + contents([f"reports/{name}" for name in names], hidden=True),
        )
    for name, path in reports.items():
        yield Path("reports", f"{name}.md"), report(path)
        for picture in PICTURE.findall(path.read_text()):
            if (path.parent / picture[1]).exists():  # Sphinx names what is missing
                yield Path("reports", base(path), picture[1]), path.parent / picture[1]


# A page that is not executed does not know its language otherwise.
PYTHON = (
    "# ---\n# jupyter:\n#   language_info:\n#     name: python\n#     pygments_lexer: python\n#"
    " ---\n\n"
)


KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def notebook(folder: str, name: str, text: str, head: str = "") -> Iterator[tuple[Path, str]]:
    """A percent script as a page that offers the notebook, and the notebook; `head` describes a
    page that is not executed.
    """
    title, rest = text.split("\n", 2)[1], text.split("\n", 2)[2]
    offer = f"#\n# {{download}}`Download this page as a notebook <../notebooks/{name}.ipynb>`"
    yield Path(folder, f"{name}.py"), f"{head}# %% [markdown]\n{title}\n{offer}\n{rest}"
    # notebooks, which are all in one folder, refer to each other
    local = re.sub(r"\]\((?:\.\./\w+/)?(\w+)\.py\)", r"](\1.ipynb)", text)
    book = jupytext.reads(local, "py:percent")
    book.metadata["kernelspec"] = KERNEL
    for cell in book.cells:  # what the page folds, JupyterLab folds too
        if "hide-input" in cell.metadata.get("tags", []):
            cell.metadata["jupyter"] = {"source_hidden": True}
    yield Path("notebooks", f"{name}.ipynb"), jupytext.writes(book, "ipynb")


GALLERY = """# %% [markdown]
# # Gallery
#
# Short programs, most of at most ten statements besides their imports. Each says its class of
# mathematical program and its mechanics, asserts what it shows, and draws a figure.
"""


def gallery() -> str:
    """The programs of the gallery as one script, with a heading and a figure for each."""
    parts = [GALLERY]
    for path in sorted((ROOT / "experiments" / "gallery").glob("*.py")):
        _, text, code = path.read_text().split('"""', 2)
        title, about = text.strip().split("\n\n", 1)
        lines = "\n".join(f"# {line}" for line in about.splitlines())
        parts.append(f"# %% [markdown]\n# ## {title.rstrip('.')}\n#\n{lines}\n")
        parts.append(f"# %%\n{code.strip()}\nplt.show()\n")
    return "\n".join(parts)


def course(site: Path) -> Iterator[tuple[Path, str]]:
    """Each chapter twice: with exercises to answer, and with their solutions."""
    folder = ROOT / "experiments" / "course"
    paths = [next(folder.glob(f"chapter_{number}_*.py")) for number in CHAPTERS]
    chapters = {path.stem: path.read_text() for path in paths}
    for name, text in chapters.items():
        yield from notebook("course", name, text)
        answers = re.sub(r"^# # (Chapter \d)", r"# # Solutions: \1", solved(text), flags=re.M)
        yield from notebook("course", f"solutions_{name}", answers, PYTHON)
    pages = [f"course/{name}" for name in chapters] + [
        f"course/solutions_{name}" for name in chapters
    ]
    yield Path("course.md"), (site / "course.md").read_text() + contents(pages, hidden=False)


def command_line() -> str:
    """The help of every command."""
    parser = contactopt.cli.make_parser()
    commands = next(
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    ).choices
    pages = [f"# Command line\n\n{inspect.getdoc(contactopt.cli)}\n"]
    for name, command in commands.items():
        command.formatter_class = partial(command.formatter_class, width=100)
        pages.append(f"## contactopt {name}\n\n```text\n{command.format_help()}```\n")
    return "\n".join(pages)


def name_of(path: Path) -> str:
    """reports/NAME/report.md -> NAME."""
    return path.parent.name


def base(path: Path) -> str:
    """The folder that a report's pictures are named from, below reports/."""
    return os.path.relpath(path.parent, ROOT / "reports")


def report(path: Path) -> str:
    """A report as a page: pictures from its folder, other files by their place in the
    repository.
    """
    text = PICTURE.sub(rf"![\1]({Path(base(path), 'x').parent.as_posix()}/\2)", path.read_text())

    def place(link: re.Match) -> str:
        target = os.path.relpath(path.parent / link[2], ROOT)
        return f"{link[1]} (`{target}`)" if link[1].strip("`") not in target else f"`{target}`"

    return re.sub(r"(?<!!)\[([^\]]*)\]\((?!http|#)([^)]*)\)", place, text)


def beginning(path: Path) -> str:
    """Title, first paragraph and first picture of a report, and the way to all of it."""
    text = PICTURE.sub(r"![\1](reports/\2)", report(path))
    title, *paragraphs = text.strip().split("\n\n")
    first = next((p for p in paragraphs if p[0] not in "|#!"), "")
    picture = PICTURE.search(text)
    shown = f"{picture[0]}\n\n" if picture else ""
    return (
        f"\n## {title.removeprefix('# ')}\n\n{first}\n\n{shown}[All of this"
        f" report](reports/{name_of(path)}.md)\n"
    )
