"""The result of a run as one page to explore, made from the files of the run.

The page shows the bodies, which can be turned, enlarged, cut and coloured by stress or
displacement; their deformation follows a slider. Half and quarter models are shown whole. On the
contact surface it shows pressure, traction, gap, slip, and which contacts stick, slip or are open.
A click on a place shows its values with their units. A load path has a slider over its states and
the loop of force and displacement. The bodies move with it where the run wrote all of their states,
which it does if they are small enough (MOST_NUMBERS in contactopt.figures.output).
"""

import html
import io
import json
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.cards import columns
from contactopt.errors import InputError
from contactopt.figures.html import filled, remark_list, write_html
from contactopt.figures.page_data import page_data
from contactopt.outcome import pair_rows, summary_rows, titled

WORDS = {
    "peak": "peak pressure",
    "area": "contact area",
    "normal": "normal force",
    "friction": "friction force",
    "of": "of what friction can carry",
    "stick": "contacts that stick",
}


def write_page(folder: str | Path, file: str | Path) -> Path:
    """Write the page of a run from its folder; InputError if it is none."""
    folder = Path(folder)
    try:
        silent = io.StringIO()
        with (
            warnings.catch_warnings(action="ignore"),
            redirect_stderr(silent),
            redirect_stdout(silent),
        ):
            summary = json.loads((folder / "summary.json").read_text())
            data = page_data(folder, summary)
            title, body = f"contactopt: {titled(summary)}", _body(summary, data)
            json.dumps(data, allow_nan=False)
    # a damaged file breaks its reader in any way; that of meshio exits
    except (Exception, SystemExit) as error:
        raise InputError(
            f"'{folder}' is not the folder of a finished run ({_why(error)}); make one with:"
            f" contactopt run SCENE --out {folder}"
        ) from error
    return write_html(file, title, body, data, ["painter.js", "view.js"])


def _why(error: BaseException) -> str:
    """What is wrong with the files of a run, without the words of Python."""
    if isinstance(error, FileNotFoundError):
        return f"there is no {Path(error.filename).name} in it"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, json.JSONDecodeError):
        return f"its summary.json is damaged in line {error.lineno}"
    return str(error) if isinstance(error, InputError) else "one of its files is damaged"


def certificate_words(summary: dict[str, Any]) -> str:
    """What the certificate says, for people who meet it for the first time."""
    residual, shown = summary["residual"], summary.get("shown")
    if summary["status"] == "infeasible" and not shown:
        return (
            "No forces solve this problem: a proof of that"
            " was found. What is shown is the last iterate."
        )
    size = "" if residual is None or not np.isfinite(residual) else f"{residual:.1e}"
    said = (
        f"The certificate is {size}. It was recomputed from the problem alone, and says how well"
        " the forces fulfil the laws of contact and friction: penetration, tension, friction"
        " beyond its bound and the direction of slip are each at most about this fraction of a"
        " typical force or length of the problem."
    )
    if summary["status"] == "solved":
        return f"These forces are a solution. {said}"
    why = summary.get("message") or summary["status"]
    if shown:
        return f"The path ends after {shown}, whose forces are a solution. {said} Then: {why}"
    return f"This is not a solution, only the last iterate ({why}). {said}"


def _answer(summary: dict[str, Any]) -> str:
    """The rows of the command line's table of pairs as columns, with longer names."""
    heads, *pairs = pair_rows(summary)
    names = [""]
    for head in heads[1:]:
        name, _, unit = head.partition("\n")
        names.append(WORDS.get(name, name) + (f" [{unit}]" if unit and name != "of" else ""))
    return f'<div class="answer">{columns([*zip(names, *pairs)])}</div>'


def _body(summary: dict[str, Any], data: dict[str, Any]) -> str:
    """The HTML of the page, all names in it escaped."""
    followers = (
        "The contact follows the slider: pressure, traction, status, gap, slip since the state"
        " before, and arrows. The bodies are those of the last state: the run kept no others,"
        " because they are too large."
    )
    if data["moving"] or not data["bodies"]:
        followers = (
            "The page follows the slider; single stresses inside the bodies are those of the last"
            " state. The slip is that since the state before."
        )
    rows = {html.escape(name): html.escape(words) for name, words in summary_rows(summary).items()}
    verdict, _, certificate = certificate_words(summary).partition(". ")
    opened = "" if summary["status"] == "solved" else " open"
    return filled(
        "view.html",
        scene=html.escape(titled(summary)),
        certificate=f"<details{opened}><summary>{html.escape(verdict)}.</summary>"
        f"<p>{html.escape(certificate)}</p></details>",
        remarks=remark_list(summary.get("remarks", ())),
        move="move" if data["dim"] == 2 else "turn",
        followers=followers,
        arrows="forces on the upper body",
        pairs=_answer(summary),
        convention="Sign convention: the pressure is positive in compression; tractions are those"
        " on the upper body.",
        cells="".join(
            f'<tr><th scope="row">{name}</th><td>{value}</td></tr>' for name, value in rows.items()
        ),
    )
