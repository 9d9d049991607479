"""Twelve lectures, written by hand: lectures/NN_NAME.md.

A slide is a section. Its lines that begin with > are the notes for the speaker: minutes first, last
the question to ask. `![](FOLDER/NAME#K)` is figure K of an executed chapter or tutorial, so that no
figure is drawn twice. A lecture is one file that loads nothing: it contains MathJax for its
formulas.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.util import find_spec
from pathlib import Path
from string import Template

import museum
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

SITE = Path(__file__).parent
FILES = sorted((SITE / "lectures").glob("*.md"))
FIGURE = re.compile(r"^!\[\]\((\S+)#(\d+)\)$", re.M)


@dataclass(frozen=True)
class Slide:
    """A title, text and notes in Markdown, and a figure as (script, number)."""

    title: str
    text: str
    notes: str
    figure: tuple[str, int] | None


@dataclass(frozen=True)
class Lecture:
    """A lecture; scripts, rooms of the museum and exercises that belong to it."""

    title: str
    story: str
    sources: tuple[str, ...]
    rooms: tuple[str, ...]
    exercises: str
    slides: tuple[Slide, ...]


@cache
def lecture(number: int) -> Lecture:
    """Read a lecture."""
    head, *sections = re.split(r"^## ", FILES[number - 1].read_text(), flags=re.M)
    told = dict(re.findall(r"^(\w+): (.*)$", head, re.M))
    names = {key: tuple(told.get(key, "").split(", ")) for key in ("Sources", "Rooms")}
    return Lecture(
        head.split("\n", 1)[0].removeprefix("# "),
        told["Story"],
        names["Sources"],
        names["Rooms"] if "Rooms" in told else (),
        told["Exercises"],
        tuple(map(slide, sections)),
    )


def slide(section: str) -> Slide:
    """Read a section."""
    title, text = section.split("\n", 1)
    notes = " ".join(re.findall(r"^> (.*)$", text, re.M))
    text = re.sub(r"^>.*$", "", text, flags=re.M)
    found = FIGURE.search(text)
    return Slide(
        title, FIGURE.sub("", text).strip(), notes, (found[1], int(found[2])) if found else None
    )


def figures(notebook: Path) -> list[str]:
    """The figures of an executed notebook as HTML: pictures, and pictures with a slider."""
    found = []
    for cell in json.loads(notebook.read_text())["cells"]:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                picture = data["image/png"].strip()
                found.append(f'<img alt="" src="data:image/png;base64,{picture}">')
            elif 'class="slider"' in "".join(data.get("text/html", "")):
                found.append("".join(data["text/html"]))
    return found


def tex(formula: str, options: dict) -> str:
    """A formula in the marks that MathJax looks for."""
    return (r"\[{}\]" if options["display_mode"] else r"\({}\)").format(escape(formula))


WORDS = MarkdownIt("commonmark").enable("table").use(dollarmath_plugin, renderer=tex)


def section(one: Slide, notebooks: Path) -> str:
    """A slide as HTML: the figure large, its text beside it."""
    body = f"<div>{WORDS.render(one.text)}</div>" * bool(one.text)
    if one.figure:
        name, number = one.figure
        body += f"<figure>{figures(notebooks / f'{name}.ipynb')[number - 1]}</figure>"
    notes = WORDS.renderInline(one.notes)
    title = WORDS.renderInline(one.title)
    return f"<section><h1>{title}</h1><main>{body}</main><aside>{notes}</aside></section>"


def page(number: int, notebooks: Path) -> str:
    """A lecture as one HTML file: its title and story first, what to do next last."""
    one = lecture(number)
    doors = [f"[{museum.title(room)}](../museum/{room}.html)" for room in one.rooms]
    after = [f"- Try: {door}" for door in doors] + [f"- Solve: {one.exercises}"]
    whole = (
        Slide(one.title, f"Lecture {number} of {len(FILES)}\n\n{one.story}", one.story, None),
        *one.slides,
        Slide(
            "Until the next lecture" if number < len(FILES) else "Now you",
            "\n".join(after),
            "",
            None,
        ),
    )
    mathjax = Path(str(find_spec("sphinx-mathjax-offline").submodule_search_locations[0]))
    script = (mathjax / "static" / "mathjax" / "tex-svg.js").read_text()
    return Template((SITE / "slides.html").read_text()).substitute(
        title=f"{number}. {one.title}",
        slides="\n".join(section(each, notebooks) for each in whole),
        mathjax=script.replace("</script", r"<\/script"),
    )


def index(site: Path) -> str:
    """The page for lecturers: its words, with the table of the lectures in their place."""
    rows = []
    for number in range(1, len(FILES) + 1):
        one = lecture(number)
        read = ", ".join(source(name) for name in one.sources)
        slides = f'<a href="../lectures/{number}.html">{one.title}</a>'
        rows.append(f"| {number} | {slides} | {one.story} | {read} |")
    table = "| | slides | the story | to read |\n|---|---|---|---|\n" + "\n".join(rows)
    return (site / "lecturers.md").read_text().replace("TABLE OF LECTURES", table)


def source(name: str) -> str:
    """A link to a script's page, with the minutes that it takes."""
    text = (SITE.parent / f"{name}.py").read_text()
    title = text.split("\n", 2)[1].removeprefix("# # ").split(".")[0]
    kind = "" if title.startswith("Chapter") else "Tutorial "
    minutes = re.search(r"(?:takes|time:)[\s#]+(\d+)[\s#]+minutes", text)
    return f"[{kind}{title}]({name}.py)" + f" ({minutes[1]} minutes)" * bool(minutes)


def write(notebooks: Path, folder: Path) -> None:
    """Write all lectures to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, len(FILES) + 1):
        (folder / f"{number}.html").write_text(page(number, notebooks))
