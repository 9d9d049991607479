"""Short texts about results: one line for a terminal, a small table for a notebook."""

from __future__ import annotations

import html
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
    """Say a number of things in words that agree: '1 contact', '2 contacts'. The word for several
    is that for one with an s, unless it is given.
    """
    return f"{number} {thing if number == 1 else things or thing + 's'}"


def line(name: str, *facts: str) -> str:
    """The one-line `repr` of an object without empty facts: 'Solution(solved, 3 iterations)'."""
    return f"{name}({', '.join(fact for fact in facts if fact)})"


def card(title: str, rows: Mapping[str, object]) -> str:
    """Write a small HTML table of names and values, for notebooks. All texts are escaped."""
    cells = "".join(
        f'<tr><th scope="row" style="text-align:left">{html.escape(str(name))}</th>'
        f'<td style="text-align:left">{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    return f"<table><caption>{html.escape(title)}</caption><tbody>{cells}</tbody></table>"


def force_unit(units: Sequence[str]) -> str:
    """The name of the unit of force that belongs to units of length and of stress."""
    length, stress = units
    return FORCES.get((length, stress), f"{stress} {length}^2")
