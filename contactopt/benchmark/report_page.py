"""The report of one finished campaign: figures and tables for papers, and a page to explore.

The page holds every run. Its charts and its table follow the same filters; a click on a run draws
how its residual fell.
"""

from __future__ import annotations

import html
import json
import math
from collections import Counter
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contactopt.benchmark.figure_style import COLOURS
from contactopt.benchmark.keys import COLUMNS
from contactopt.benchmark.reports import Layout, read_layout, rendered, write_report
from contactopt.benchmark.store import load, require
from contactopt.errors import InputError
from contactopt.figures.html import filled, write_html

if TYPE_CHECKING:
    import pandas as pd

PAGE = "report.html"
SHOWN = (
    "problem", "method", "setting", "start", "repeat", "status", "success", "iterations",
    "residual", "tolerance", "error", "solve_seconds", "call_seconds", "cpu_seconds", "peak_mb",
    "contacts", "family", "law", "backend", "message",
)  # fmt: skip
MOST_HISTORIES = 5000  # runs, above which the page leaves their convergence out


def report_campaign(folder: str | Path, experiment: str | Path | None = None) -> Path:
    """Write the report of a finished campaign into its folder: report.md with figures, and
    report.html to explore.

    Parameters
    ----------
    folder : of the campaign, with rows.jsonl, rows.parquet or rows.csv
    experiment : its file; None: the copy in the folder, without which the usual figures are drawn

    Returns
    -------
    Path : of report.html, or of report.md where plotly is not installed

    Raises
    ------
    InputError : if the folder holds no results, or if a figure does not fit them
    """
    require("markdown_it", "pandas")
    folder = Path(folder)
    table = load(folder)
    if table.empty:
        raise InputError(f"'{folder}' holds no runs, so there is nothing to report.")
    path = folder / "experiment.toml" if experiment is None else Path(experiment)
    name = str(table["experiment"].iloc[0])
    known = experiment is not None or path.exists()
    layout = read_layout(path) if known else Layout(path, name, name)
    if not (path.parent / layout.findings).is_file():  # beside a copy there is none
        layout = replace(layout, findings="")
    text = write_report(layout, folder, table)
    if find_spec("plotly") is None:
        return folder / "report.md"
    data = {
        "rows": _rows(table),
        "columns": {name: COLUMNS[name][1] for name in SHOWN if name in table},
        "colours": COLOURS,
    }
    body = filled("report.html", title=html.escape(layout.title), static=rendered(text, folder))
    return write_html(folder / PAGE, layout.title, body, data, ["report.js"])


def _rows(table: pd.DataFrame) -> list[dict[str, Any]]:
    """One mapping per run with the columns that the page shows, and the residuals and seconds of
    its iterations.
    """
    names = [name for name in SHOWN if name in table]
    histories = "history" in table and len(table) <= MOST_HISTORIES
    made = []
    for number, values in enumerate(table[names].itertuples(index=False, name=None)):
        row = {name: _plain(value) for name, value in zip(names, values)}
        if histories and (found := json.loads(table["history"].iloc[number] or "[]")):
            row["history"] = [[_plain(x) for x in column] for column in found]
        made.append(row)
    return made


def _plain(value: Any) -> Any:
    """A value that JSON can hold: numbers with four digits, None where there is none."""
    if isinstance(value, str | bool) or value is None:
        return value
    number = float(value)
    if not math.isfinite(number):
        return None
    return int(number) if number.is_integer() and abs(number) < 1e15 else float(f"{number:.4g}")


def refusals(table: pd.DataFrame) -> list[str]:
    """Say in a sentence each why runs were refused or could not be built, with their number.

    Parameters
    ----------
    table : The table of a campaign.

    Returns
    -------
    The sentences, the most frequent reason first.
    """
    left = table[table["status"].isin(["refused", "not_built"])]
    reasons = Counter(str(message) for message in left["message"])
    return [
        f"{number} {'run was' if number == 1 else 'runs were'} refused: {reason}"
        for reason, number in reasons.most_common()
    ]
