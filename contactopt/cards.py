"""Short texts about results: one line for a terminal, a small table for a notebook."""

import html
import re
from collections.abc import Mapping, Sequence

FORCES = {
    ("mm", "MPa"): "N",
    ("mm", "GPa"): "kN",
    ("m", "Pa"): "N",
    ("m", "kPa"): "kN",
    ("m", "MPa"): "MN",
    ("in", "psi"): "lbf",
}


def count(number: int, thing: str, things: str = "") -> str:
    """Say a number of things in words that agree: '1 contact', '2 contacts'."""
    return f"{number} {thing if number == 1 else things or thing + 's'}"


def line(name: str, *facts: str) -> str:
    """The one-line `repr` of an object without empty facts: 'Solution(solved, 3 iterations)'."""
    return f"{name}({', '.join(fact for fact in facts if fact)})"


def card(title: str, rows: Mapping[str, object], table: Sequence[Sequence[str]] = ()) -> str:
    """Write an HTML table of escaped names and values, below one with a head if that is given."""
    names = "".join(
        f'<tr><th scope="row" style="text-align:left">{html.escape(str(name))}</th>'
        f'<td style="text-align:left">{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    caption = f"<caption>{html.escape(title)}</caption>"
    if table:
        return f"{columns(table, caption)}<table><tbody>{names}</tbody></table>"
    return f"<table>{caption}<tbody>{names}</tbody></table>"


def columns(table: Sequence[Sequence[str]], caption: str = "") -> str:
    """An HTML table below a caption, whose first row is the head. All texts are escaped."""
    head, *rows = ([html.escape(cell).replace("\n", "<br>") for cell in row] for row in table)
    long = (re.sub(r"([.-])(?=[^\W\d])", r"\1<wbr>", cell) for cell in head)  # names break there
    top = "".join(f'<th scope="col">{cell}</th>' for cell in long)
    body = "".join(
        f'<tr><th scope="row">{name}</th>' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
        for name, *cells in rows
    )
    return f"<table>{caption}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def force_unit(units: Sequence[str]) -> str:
    """The name of the unit of force that belongs to units of length and of stress."""
    length, stress = units
    return FORCES.get((length, stress), f"{stress} {length}^2")
