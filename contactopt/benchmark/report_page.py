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

from contactopt.benchmark.campaign_files import told
from contactopt.benchmark.figure_style import COLOURS
from contactopt.benchmark.reports import Layout, read_layout, rendered, write_report
from contactopt.benchmark.store import COLUMNS, load, require
from contactopt.errors import InputError
from contactopt.figures.html import write_html

if TYPE_CHECKING:
    import pandas as pd

PAGE = "report.html"
SHOWN = (
    "problem", "method", "setting", "start", "repeat", "status", "success", "iterations", "residual", "tolerance", "error", "solve_seconds",
    "call_seconds", "cpu_seconds", "peak_mb", "contacts", "family", "law", "backend", "message",
)  # fmt: skip
MOST_HISTORIES = 5000  # runs, above which the page leaves their convergence out
QUESTIONS = """
<p><strong>Which chart answers which question?</strong> <em>Speed against accuracy</em> shows what time a certified residual costs: lower
left is better. The <em>performance profile</em> shows where methods fail: its right end is the
share of the instances that a method solved, its left end the share on which it was the fastest.
<em>Time against size</em> shows how the cost grows. To see what warm starts buy, choose the start
warm and then cold and compare the times. <em>Convergence</em> shows one run: click on its row.</p>
"""


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
    layout = _layout(folder, experiment, str(table["experiment"].iloc[0]))
    with told(folder):
        text = write_report(layout, folder, table)
    if find_spec("plotly") is None:
        return folder / "report.md"
    data = {
        "rows": _rows(table),
        "columns": {name: COLUMNS[name][1] for name in SHOWN if name in table},
        "colours": COLOURS,
    }
    return write_html(
        folder / PAGE, layout.title, _body(layout, rendered(text, folder)), data, ["report.js"]
    )


def _layout(folder: Path, experiment: str | Path | None, name: str) -> Layout:
    """What the experiment's file says of its report.

    Findings are left out where the file that computes them is not there.
    """
    path = folder / "experiment.toml" if experiment is None else Path(experiment)
    if experiment is None and not path.exists():
        return Layout(path, name, name, "", (), "", ())
    layout = read_layout(path)
    return layout if (path.parent / layout.findings).is_file() else replace(layout, findings="")


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
    if isinstance(value, str) or value is None:
        return value
    number = float(value)
    if not math.isfinite(number):
        return None
    if isinstance(value, bool) or type(value).__name__ == "bool":
        return bool(value)
    return int(number) if number.is_integer() and abs(number) < 1e15 else float(f"{number:.4g}")


def _body(layout: Layout, static: str) -> str:
    choices = "".join(
        f'<label class="inline">{name} <select id="filter-{name}"><option'
        ' value="">all</option></select></label>'
        for name in ("setting", "start", "family", "method", "status")
    )
    scales = "".join(
        f'<label class="inline"><input type="checkbox" id="log-{axis}" checked> {axis} axis'
        " logarithmic</label>"
        for axis in "xy"
    )
    times = "".join(
        f'<option value="{name}">{words}</option>'
        for name, words in (
            ("cpu_seconds", "CPU time of the call"), ("solve_seconds", "time of the method"), ("call_seconds", "time of the call"),
        )
    )  # fmt: skip
    charts = "".join(
        f'<section><h2>{title}</h2><div id="{name}" class="chart" tabindex="0" role="img" aria-label="{title}"></div></section>'
        for name, title in (
            ("speed", "Speed against accuracy"), ("profile", "Performance profile"), ("size", "Time against size"),
            ("convergence", "Convergence of the chosen runs"),
        )
    )  # fmt: skip
    return f"""<header><h1>{html.escape(layout.title)}</h1>{QUESTIONS}</header><main>
<fieldset><legend>Runs</legend>{choices}<label>words <input type="search" id="words" placeholder="in problem, method or message"></label>
</fieldset><fieldset><legend>Charts</legend><label class="inline">time <select id="time">{times}</select></label>{scales}
<button type="button" id="forget">forget the chosen runs</button></fieldset>
<div class="pair">{charts}</div>
<h2>Runs</h2><p class="note" id="count" aria-live="polite"></p><div class="wide"><table id="runs"><thead></thead><tbody></tbody></table></div>
<p class="note">A button in the head of the table sorts it. Click on a row, or press Enter on it, to see how its residual fell.</p>
<section id="static">{static}</section></main>"""


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
