"""Docstrings of the package, which are plain text, as reStructuredText that means nothing else."""

from __future__ import annotations

import re


def as_rst(lines: list[str]) -> list[str]:
    """Docstrings are plain text: aligned and indented lines become literal, the rest is kept from
    meaning anything.

    NumPy's sections, whose titles are underlined with dashes, become rubrics over lists of
    definitions.

    Changes `lines` in place, as autodoc wants it, and returns it.
    """
    out: list[str] = []
    # of the line before: prose, item (of a numbered list), literal or section (of a NumPy
    # docstring)
    kind = "prose"
    for line, following in zip(lines, [*lines[1:], ""]):
        if re.fullmatch(r"-{3,}", following) and line.strip():
            out += ["", f".. rubric:: {line.strip()}", ""]
            kind = "section"
            continue
        if kind == "section":
            if not re.fullmatch(r"-{3,}", line):
                term = line[:1] != " " and (
                    following[:1] == " " or re.match(r"[\w, ]+ : ", line) is not None
                )
                out += [""] if term else []
                out.append(f"    {_plain(line.strip())}" if line[:1] == " " else _plain(line))
            continue
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
        re.sub(r"([*|\\]|(?<=\w)_(?!\w))", r"\\\1", p) if i % 2 == 0 else f"``{p}``"
        for i, p in enumerate(parts)
    ]
    return "".join(escaped)
