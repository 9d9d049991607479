"""Twelve lectures: slides made of the chapters and the tutorials.

The executed notebooks of the site hold words, formulas, programs and figures. A slide takes a
section's heading, the key sentences of its paragraphs (the first, those that introduce a term, and
the last), its formulas, short programs and figures. The speaker's notes are the whole section. So
no sentence of a slide is written twice. A lecture is one file that loads nothing: formulas are set
by MathJax, which it contains.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape
from importlib.util import find_spec
from pathlib import Path
from string import Template

import museum
from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

SITE = Path(__file__).parent
# title, scripts with the sections that they lend (none: all of them), rooms of the museum
LECTURES: tuple[tuple[str, tuple[tuple[str, tuple[str, ...]], ...], tuple[str, ...]], ...] = (
    (
        "A spring, a node and a floor",
        (("course/chapter_1_contact_without_friction", ()),),
        ("penalty",),
    ),
    (
        "Friction at one node",
        (("course/chapter_2_friction_at_one_node", ("!What fails",)),),
        ("cobweb",),
    ),
    (
        "When friction has no solution, two or three",
        (
            ("course/chapter_2_friction_at_one_node", ("What fails",)),
            ("tutorials/no_one_or_three_solutions", ()),
        ),
        ("one_node", "two_nodes", "dragged_plate", "certified_and_wrong"),
    ),
    ("Duality", (("course/chapter_7_duality", ()),), ("dual_gap",)),
    ("A string on a floor: many nodes", (("course/chapter_3_a_string_on_a_floor", ()),), ()),
    (
        "From bodies to the interface",
        (("course/chapter_4_from_bodies_to_the_interface", ()),),
        (),
    ),
    (
        "The compliance and its preconditioner",
        (("tutorials/why_the_preconditioner_works", ("!Two blocks",)),),
        ("seminorm",),
    ),
    ("Friction on an interface", (("course/chapter_5_friction_on_an_interface", ()),), ()),
    (
        "Large problems in three dimensions",
        (("course/chapter_6_large_and_three_dimensional", ()),),
        (),
    ),
    ("A load cycle and its hysteresis", (("tutorials/a_load_cycle", ()),), ("stick_zone",)),
    ("The derivative of a solution", (("tutorials/derivatives_with_kinks", ()),), ()),
    (
        "Solvers compared: the seminar begins",
        (
            ("tutorials/beat_our_solvers", ()),
            ("tutorials/reading_a_strangers_problem", ("Two ways to measure",)),
        ),
        (),
    ),
)
FULL, CODE_LINES = 10.0, 22  # weight of a full slide in lines of text; longest program
DRAWING = {"plt", "fig", "ax", "axes", "left", "right", "figure", "Slider"}
TAG = "exercise", "solution", "remove-cell"
# how a sentence begins that speaks of the one before
REFERRING = re.compile(
    "(This|That|It|Its|They|Such|These|Then|In them|Here|So|There|From there|But|For us)\\b"
)
# what makes a program worth showing
TEACHING = re.compile(
    r"\b(cp|models)\.|\b(solve|reduce|sensitivity|diagnose|follow)\(|while |for _ in"
)
ASIDE = re.compile(r"Next: |Reading time|\{download\}|You need ")


@dataclass
class Slide:
    """A title, parts as (kind, HTML), and the notes that hold the whole text."""

    title: str
    parts: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    weight: float = 0.0


def sentences(paragraph: str) -> list[str]:
    """The sentences of a paragraph; points within formulas do not end one."""
    found, start = [], 0
    for end in re.finditer(r"(?<=[.!?])(?:\*\*)?\s+(?=[A-Z*$`(\[])", paragraph):
        if paragraph.count("$", 0, end.start()) % 2 == 0:
            found.append(paragraph[start : end.end()].strip())
            start = end.end()
    return [*found, paragraph[start:].strip()]


def key_sentences(paragraph: str, leads: bool) -> list[str]:
    """The first sentence, one that introduces a term, and the last one, which often leads to a
    formula. A sentence that speaks of the one before brings it along.
    """
    found = sentences(paragraph)
    terms = [k for k, one in enumerate(found) if re.search(r"(?<![*\w])\*{1,2}\w", one)]
    kept = {0, *terms[:2]}
    if leads or not found[-1].endswith(":"):
        kept.add(len(found) - 1)
    else:  # what it leads to is not shown
        kept.discard(len(found) - 1)
    chosen: list[str] = []
    for k in sorted(kept):
        refers = k and REFERRING.match(found[k])
        if refers and k - 1 in kept:
            chosen[-1] += " " + found[k]
        else:
            chosen.append(found[k - 1] + " " + found[k] if refers else found[k])
    return chosen


def blocks(text: str) -> list[tuple[str, str]]:
    """The parts of a Markdown cell as (kind, text): title, lead, formula, table, list, words."""
    text = re.sub(r"<details>.*?</details>", "", text, flags=re.S)
    text = re.sub(r"\[([^\]]*)\]\((?!http)[^)]*\)", r"\1", text)  # links within the site
    found = []
    for block in filter(None, (part.strip() for part in text.split("\n\n"))):
        first, line = block.split("\n", 1)[0], re.sub(r"\s+", " ", block)
        lead = re.match(r"\*\*([^*]+?)[.:]?\*\*[.:]? ", line)
        if first.startswith("#"):
            found.append(("title", line.lstrip("# ")))
        elif first.startswith("$$"):
            found.append(("formula", block))
        elif first.startswith("|"):
            found.append(("table", block))
        elif re.match(r"- |\d\. ", first):
            found.append(("list", block))
        elif lead and not re.match(r"[\d.]+$", lead[1]):
            found += [("lead", lead[1]), ("words", line[lead.end() :])]
        elif not ASIDE.match(line):
            found.append(("words", line))
    return found


def program(source: str) -> str:
    """A cell's program without imports, assertions, printing and drawing; nothing if it is long."""
    lines, kept = source.splitlines(), []
    for node in ast.parse(source).body:
        names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        skipped = isinstance(node, ast.Import | ast.ImportFrom | ast.Assert) or names & DRAWING
        if not skipped and not (isinstance(node, ast.Expr) and "print" in names):
            kept += lines[node.lineno - 1 : node.end_lineno]
    text = "\n".join(kept)
    return text if len(kept) <= CODE_LINES and TEACHING.search(text) else ""


def slides(cells: list[dict], chosen: tuple[str, ...], words: MarkdownIt) -> Iterator[Slide]:
    """The slides of a script: `chosen` names its sections, or with ! those that are left out."""
    left_out = {"Exercises", "References", *(name[1:] for name in chosen if name[0] == "!")}
    wanted = {name for name in chosen if name[0] != "!"}
    slide, section, whole, found = Slide(""), "", [], list(parts(cells))
    for k, (kind, text) in enumerate(found):
        if kind in ("title", "lead"):
            section = text if kind == "title" else section
            yield slide
            slide, whole = Slide(text), []
            continue
        if section in left_out or (wanted and section not in wanted):
            continue
        shown, weight = drawn(kind, text, words)
        there = {part for part, _ in slide.parts}
        busy = "figure" in there or (kind == "figure" and there & {"code", "table"})
        follows = drawn(*found[k + 1], words)[1] if kind == "leading" else 0
        if slide.parts and (slide.weight + weight + min(follows, 5.0) > FULL or busy):
            yield slide
            slide = Slide(slide.title)
        if kind in ("words", "leading"):
            whole.append(text)
        slide.notes = whole
        slide.weight += weight
        slide.parts.append((kind, shown))
    yield slide


def parts(cells: list[dict]) -> Iterator[tuple[str, str]]:
    """The parts of all cells; a paragraph is marked where it leads to a formula or a program."""
    found = list(pieces(cells))
    for (kind, text), (after, _) in zip(found, [*found[1:], ("title", "")]):
        leads = kind == "words" and after not in ("words", "title", "lead", "figure")
        yield ("leading" if leads else kind), text


def pieces(cells: list[dict]) -> Iterator[tuple[str, str]]:
    """The parts of all cells as (kind, text)."""
    for cell in cells:
        tags, source = cell["metadata"].get("tags", []), "".join(cell["source"])
        if set(tags) & set(TAG):
            continue
        if cell["cell_type"] == "markdown":
            yield from blocks(source)
            continue
        if "hide-input" not in tags and (code := program(source)):
            yield "code", code
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                yield (
                    "figure",
                    f'<img alt="" src="data:image/png;base64,{data["image/png"].strip()}">',
                )
            elif 'class="slider"' in "".join(data.get("text/html", "")):
                yield "figure", "".join(data["text/html"])


def drawn(kind: str, text: str, words: MarkdownIt) -> tuple[str, float]:
    """The HTML of a part, and its weight in lines."""
    if kind in ("words", "leading"):
        chosen = key_sentences(text, kind == "leading")
        html = "".join(f"<li>{words.renderInline(one)}</li>" for one in chosen)
        return html, sum(0.5 + len(one) / 75 for one in chosen)
    if kind == "code":
        return f"<pre><code>{escape(text)}</code></pre>", 0.75 * (text.count("\n") + 2)
    if kind == "figure":
        return text, 2.0
    return words.render(text), {"formula": 2.5}.get(kind, 1.0 + text.count("\n") * 0.9)


def lecture(number: int, notebooks: Path) -> list[Slide]:
    """The slides of a lecture, from the notebooks in that folder: first its title, last what to
    do next.
    """
    title, scripts, rooms = LECTURES[number - 1]
    words = MarkdownIt("commonmark").enable("table").use(dollarmath_plugin, renderer=tex)
    found, tasks, readings = [], [], []
    for name, chosen in scripts:
        cells = json.loads((notebooks / f"{name}.ipynb").read_text())["cells"]
        found += [slide for slide in slides(cells, chosen, words) if slide.parts]
        text = "\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")
        tasks += re.findall(r"^\*\*(\d(?:\.\d+)?)\.?\*\* ", text, re.M) if not chosen else []
        readings.append(text.split("\n", 1)[0].lstrip("# "))
    doors = [
        f'<li>Try it: <a href="../museum/{room}.html">{museum.title(room)}</a></li>'
        for room in rooms
    ]
    after = [f"<li>Read: {escape(reading)}</li>" for reading in readings] + doors
    if tasks:
        after.append(f"<li>Solve: exercises {tasks[0]} to {tasks[-1]}</li>")
    opening = Slide(title, [("words", f"<li>Lecture {number} of {len(LECTURES)}</li>")])
    return [opening, *found, Slide("Until the next lecture", [("words", "".join(after))])]


def tex(formula: str, options: dict) -> str:
    """A formula in the marks that MathJax looks for."""
    return (r"\[{}\]" if options["display_mode"] else r"\({}\)").format(escape(formula))


def section(slide: Slide) -> str:
    """A slide as HTML: words on the left, figure on the right."""
    pictures = "".join(html for kind, html in slide.parts if kind == "figure")
    rest, bullets = [], ("words", "leading")
    for kind, html in slide.parts:
        if kind in bullets and rest and rest[-1].endswith("</ul>"):
            rest[-1] = rest[-1].removesuffix("</ul>") + html + "</ul>"
        elif kind != "figure":
            rest.append(f"<ul>{html}</ul>" if kind in bullets else html)
    body = f"<div>{''.join(rest)}</div>" * bool(rest) + f"<figure>{pictures}</figure>" * bool(
        pictures
    )
    words = MarkdownIt().use(dollarmath_plugin, renderer=tex)
    notes = "".join(f"<p>{words.renderInline(text)}</p>" for text in slide.notes)
    title = words.renderInline(slide.title)
    # a full stop stays at its formula
    body = re.sub(r'(<span class="math inline">[^<]*</span>)([.,;:)]+)', r"<nobr>\1\2</nobr>", body)
    return f"<section><h1>{title}</h1><main>{body}</main><aside>{notes}</aside></section>"


def page(number: int, notebooks: Path) -> str:
    """A lecture as one HTML file."""
    mathjax = Path(str(find_spec("sphinx-mathjax-offline").submodule_search_locations[0]))
    script = (mathjax / "static" / "mathjax" / "tex-svg.js").read_text()
    return Template((SITE / "slides.html").read_text()).substitute(
        title=f"{number}. {LECTURES[number - 1][0]}",
        slides="\n".join(section(slide) for slide in lecture(number, notebooks)),
        mathjax=script.replace("</script", r"<\/script"),
    )


def index(site: Path) -> str:
    """The page for lecturers: its words, with the table of the lectures in their place."""
    rows = []
    for number, (title, scripts, rooms) in enumerate(LECTURES, 1):
        sources = ", ".join(source(name) for name, _ in scripts)
        doors = ", ".join(
            f"[{museum.title(room)}](museum.md#{museum.anchor(room)})" for room in rooms
        )
        slides = f'<a href="../lectures/{number}.html">{title}</a>'
        rows.append(f"| {number} | {slides} | {sources} | {doors or '-'} |")
    table = "| | slides | made of | rooms of the museum |\n|---|---|---|---|\n" + "\n".join(rows)
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
    for number in range(1, len(LECTURES) + 1):
        (folder / f"{number}.html").write_text(page(number, notebooks))
