"""Short texts about results: one line for a terminal, a small table for a notebook."""

from __future__ import annotations

import html
from collections.abc import Mapping


def count(number: int, thing: str, things: str = "") -> str:
    """Say a number of things in words that agree: '1 contact', '2 contacts'.

    Parameters
    ----------
    number : How many there are.
    thing : The word for one of them.
    things : The word for several; by default the word for one with an s.

    Returns
    -------
    The number and the word.
    """
    return f"{number} {thing if number == 1 else things or thing + 's'}"


def line(name: str, *facts: str) -> str:
    """Write the one-line `repr` of an object: its class, and facts about it.

    Parameters
    ----------
    name : The name of the class.
    facts : What is said of the object. Empty texts are left out.

    Returns
    -------
    A text such as 'Solution(solved, 3 iterations)'.
    """
    return f"{name}({', '.join(fact for fact in facts if fact)})"


def card(title: str, rows: Mapping[str, object]) -> str:
    """Write a small HTML table of names and values, for notebooks. All texts are escaped.

    Parameters
    ----------
    title : The caption of the table.
    rows : The values by their names, one row each.

    Returns
    -------
    The element `table`.
    """
    cells = "".join(
        f'<tr><th scope="row" style="text-align:left">{html.escape(str(name))}</th>'
        f'<td style="text-align:left">{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    return f"<table><caption>{html.escape(title)}</caption><tbody>{cells}</tbody></table>"
