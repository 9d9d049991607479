"""The museum of counterexamples: one page per theorem, computed in the browser.

Each room is museum/NAME.md, its words, and museum/NAME.js, its sliders and answers. A page holds
everything it needs: core.js (contact), page.js (pictures and sliders), the room and the style.
"""

from __future__ import annotations

import re
from pathlib import Path
from string import Template

from markdown_it import MarkdownIt

FOLDER = Path(__file__).parent / "museum"
# in the order of a visit
ROOMS = (
    "non_monotone",
    "one_node",
    "two_nodes",
    "dragged_plate",
    "cobweb",
    "dual_gap",
    "penalty",
    "stick_zone",
    "seminorm",
    "certified_and_wrong",
)


def title(name: str) -> str:
    """The heading of a room."""
    return (FOLDER / f"{name}.md").read_text().split("\n", 1)[0].removeprefix("# ")


def anchor(name: str) -> str:
    """What a link to the room's section of the index ends with: `museum.md#ANCHOR`."""
    return re.sub(r"[^\w-]", "", title(name).lower().replace(" ", "-"))


def page(name: str) -> str:
    """A room as one HTML file that loads nothing."""
    _, claim, text = (FOLDER / f"{name}.md").read_text().split("\n\n", 2)
    markdown = MarkdownIt("commonmark", {"html": True})
    scripts = [(FOLDER / f"{part}.js").read_text() for part in ("core", "page", name)]
    doors = "".join(
        f'<a href="{room}.html"' + ' aria-current="page"' * (room == name) + f">{title(room)}</a>"
        for room in ROOMS
    )
    return Template((FOLDER / "page.html").read_text()).substitute(
        title=title(name),
        style=(FOLDER / "page.css").read_text(),
        rooms=doors,
        claim=markdown.render(claim),
        text=markdown.render(text),
        script="\n".join([*scripts, "start(room);"]),
    )


def index(site: Path) -> str:
    """The way to all rooms: what each says, and what breaks it."""
    parts = [(site / "museum.md").read_text()]
    for name in ROOMS:
        text = (FOLDER / f"{name}.md").read_text().split("\n", 1)[1]
        words = re.split(r"^## ", text, flags=re.M)[0].strip()
        door = f'<a href="../museum/{name}.html">Enter this room</a>'
        parts.append(f"\n## {title(name)}\n\n{words}\n\n{door}\n")
    return "".join(parts)


def write(folder: Path) -> None:
    """Write all rooms to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ROOMS:
        (folder / f"{name}.html").write_text(page(name))
