"""The report of one finished campaign: figures and tables for papers, and a page to look things up.

The page ranks the solvers on the problems that its filters leave. It has a section for each solver
and for each problem, which links lead to, and every run with its repeats in one row.
"""

from __future__ import annotations

import base64
import html
import json
import logging
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.benchmark.experiment import Experiment, read_layout
from contactopt.benchmark.merging import joined
from contactopt.benchmark.ranking import (
    NOISE,
    achieved,
    agreement,
    factors,
    points,
    ranking,
    reruns,
    taken,
    unranked,
    wall_over_cpu,
)
from contactopt.benchmark.reports import write_report
from contactopt.benchmark.store import ABSENT, require
from contactopt.benchmark.testset import SETS, problems
from contactopt.errors import InputError
from contactopt.figures.html import filled, write_html
from contactopt.figures.style import COLOURS
from contactopt.methods import METHODS

if TYPE_CHECKING:
    import pandas as pd

PAGE = "report.html"
RESAMPLES = 400  # bootstrap samples of the problems, drawn again with each change of a filter
ACCURACIES = (1e-3, 1e-6, 1e-8)  # certificates at which methods are ranked
COLUMNS_SHOWN = (
    "tolerance", "residual", "claimed", "status", "cpu", "low", "high", "wall", "bridge", "memory",
    "repeats",
)  # fmt: skip
_log = logging.getLogger(__name__)
PROTOCOL = (
    "Methods are compared at the certificate that they reach, read off in logarithms between the"
    " tolerances asked. A certificate is computed here from the problem and the answer; what a"
    " method says of itself is in the column 'claimed'. CPU times are medians over the repeats."
    " A failure counts as the time limit. Times below {noise:g} ms count as {noise:g} ms. A problem"
    " that a method refuses is not applicable to it, which is no failure: a ranking compares on the"
    " problems that all its methods take. The column 'takes' says how many each of them takes."
    " Problems that no method solves are left out of a ranking. The rank interval holds 95 % of"
    " {resamples} bootstrap samples of the problems. {tau}"
)


def report_campaign(
    folder: str | Path,
    experiment: str | Path | None = None,
    others: Sequence[str | Path] = (),
    figures: Sequence[str] = (),
) -> Path:
    """Write the report of a finished campaign into its folder: report.md with figures, and
    report.html to look things up, one file with everything in it, which is returned. InputError if
    the folder holds no results, or if a figure does not fit them.

    folder      with rows.jsonl, rows.parquet or rows.csv
    experiment  file of the campaign; by default the copy in the folder, without which the usual
                figures are drawn
    others      files or folders with rows of other people, which join those of the campaign
    figures     formats of the figures, of png, svg and pdf; PNG is always written
    """
    require("markdown_it", "pandas")
    folder = Path(folder)
    rows, said = joined(folder, others)
    for sentence in said:
        _log.warning("%s", sentence)
    table = rows[rows["status"] != ABSENT].reset_index(drop=True)
    if table.empty:
        raise InputError(f"'{folder}' holds no runs, so there is nothing to report.")
    path = folder / "experiment.toml" if experiment is None else Path(experiment)
    name = str(table["experiment"].iloc[0])
    known = experiment is not None or path.exists()
    layout = read_layout(path) if known else Experiment(name, title=name, path=path)
    if not (path.parent / layout.findings).is_file():  # beside a copy there is none
        layout = replace(layout, findings="")
    text = write_report(layout, folder, table, figures, said)
    body = filled("report.html", title=html.escape(layout.title), static=_rendered(text, folder))
    data = page_data(table) | {"absent": _absent(rows)}
    return write_html(folder / PAGE, layout.title, body, data, ["report.js"])


def page_data(table: pd.DataFrame) -> dict[str, Any]:
    """What the page shows of the runs."""
    found = points(table)
    names, methods = list(dict.fromkeys(table["problem"])), sorted(set(table["method"]))
    takes = taken(found).reindex(index=names, columns=methods).fillna(True)
    sets = (one for number in SETS for one in problems(testset=number))
    of_set = {one.name: {"tier": one.tier, **one.known.get("tags", {})} for one in sets}
    tags = {name: _tags(rows.iloc[0], of_set) for name, rows in table.groupby("problem")}
    accuracies = _accuracies(found)
    times = [achieved(found, a).reindex(names)[methods] for a in accuracies]
    first = ranking(found, accuracies[len(accuracies) // 2])["method"]
    number = {name: i for i, name in enumerate(names)}
    shown = [
        [number[p], methods.index(m), *(_plain(value) for value in rest)]
        for p, m, *rest in found[["problem", "method", *COLUMNS_SHOWN]].itertuples(index=False)
    ]
    divided = {name: by for name, (by, _) in factors(table).items()}
    return {
        "methods": methods,
        "order": list(first) + [name for name in methods if name not in set(first)],
        "problems": [{"name": name, "tags": tags[name]} for name in names],
        "columns": ["problem number", "method number", *COLUMNS_SHOWN],
        "points": shown,
        "accuracies": accuracies,
        "times": [[[_plain(t) for t in row] for row in seconds.to_numpy()] for seconds in times],
        "takes": takes.to_numpy().astype(bool).tolist(),
        "limits": [_plain(t) for t in found.groupby("problem")["limit"].max().reindex(names)],
        "ours": [name for name in methods if name.partition("(")[0] in METHODS],
        "histories": _histories(table, number, methods),
        "cards": _cards(table, divided),
        "busy": unranked(table),
        "protocol": PROTOCOL.format(noise=1e3 * NOISE, resamples=RESAMPLES, tau=_tau(table, found)),
        "colours": COLOURS[:6],
        "resamples": RESAMPLES,
    }


def _accuracies(found: pd.DataFrame) -> list[float]:
    """The certificates at which a table can be ranked: those between its tolerances."""
    low, high = found["tolerance"].min(), found["tolerance"].max()
    return [a for a in ACCURACIES if low <= a <= high] or [float(low)]


def _tau(own: pd.DataFrame, found: pd.DataFrame) -> str:
    """Say how two reruns of the table agree."""
    if own["repeat"].max() == 0:
        return "Each run was made once, so nothing is known of a rerun."
    even, odd = map(points, reruns(own))
    tau = agreement(even, odd, _accuracies(found)[-1])
    return f"Kendall's tau of the ranks of the even and of the odd repeats is {tau:.2f}."


def _tags(row: pd.Series, of_set: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """What is known of a problem: some columns of its runs, and the tags of the test set."""
    own = {name: _plain(row[name]) for name in ("family", "dim", "contacts")}
    own |= {"plates": bool(row["plates"]), "mu": _plain(row.get("problem.mu", np.nan))}
    warm = row.get("problem.warm")
    own["sequence"] = "no" if warm not in (True, False) else "warm" if warm else "cold"
    return own | of_set.get(str(row["problem"]), {})


def _histories(own: pd.DataFrame, number: dict[str, int], methods: list[str]) -> list[list[Any]]:
    """(problem, method, certificates, seconds) of the tightest run of each method."""
    if "history" not in own:
        return []
    made = []
    kept = own[(own["repeat"] == 0) & (own["history"].str.len() > 2)].sort_values("tolerance")
    for row in kept.drop_duplicates(["problem", "method"]).itertuples():
        residuals, seconds, _ = json.loads(row.history)
        chosen = np.unique(np.geomspace(1, len(residuals), 30).astype(int)) - 1  # of a curve
        curves = [[_plain(curve[i]) for i in chosen] for curve in (residuals, seconds)]
        made.append([number[row.problem], methods.index(row.method), *curves])
    return made


def _cards(table: pd.DataFrame, divided: Mapping[str, float]) -> list[dict[str, Any]]:
    """Where rows come from: a card for each source, machine and set of versions."""
    import pandas as pd

    made = []
    sources = table if "source" in table else table.assign(source="")
    for (source, machine, versions), rows in sources.groupby(["source", "machine", "versions"]):
        backends = {name for text in rows["backend"].fillna("") for name in text.split(", ")}
        made.append(
            {
                "source": source,
                "runs": len(rows),
                "machine": machine,
                "times divided by": _plain(divided.get(machine, 1.0)),
                "calibration [s]": _plain(rows.get("calibration", pd.Series(np.nan)).median()),
                "wall over CPU": _plain(wall_over_cpu(rows)),
                "versions": versions,
                "external solvers": ", ".join(sorted(backends - {"", "native"})),
                "tolerances asked": ", ".join(f"{t:g}" for t in sorted(set(rows["tolerance"]))),
                "time limit [s]": ", ".join(f"{t:g}" for t in sorted(set(rows["time_limit"]))),
                "from": rows["time"].min(),
                "to": rows["time"].max(),
            }
        )
    return made


def _absent(rows: pd.DataFrame) -> list[tuple[str, str]]:
    there = set(rows.loc[rows["status"] != ABSENT, "method"])
    left = rows[(rows["status"] == ABSENT) & ~rows["method"].isin(there)]
    return list(dict.fromkeys(zip(left["method"], left["message"])))


def _plain(value: float | str | bool | None) -> float | str | bool | None:
    """A value that JSON can hold: numbers with four digits, None where there is none."""
    if isinstance(value, str | bool | np.bool_) or value is None:
        return bool(value) if isinstance(value, np.bool_) else value
    number = float(value)
    if not math.isfinite(number):
        return None
    return int(number) if number.is_integer() and abs(number) < 1e15 else float(f"{number:.4g}")


def refusals(table: pd.DataFrame) -> list[str]:
    """Say in a sentence each why runs were refused or could not be built, most frequent first."""
    left = table[table["status"].isin(["refused", "not_built"])]
    reasons = Counter(str(message) for message in left["message"])
    return [
        f"{number} {'run was' if number == 1 else 'runs were'} refused: {reason}"
        for reason, number in reasons.most_common()
    ]


def _rendered(text: str, folder: Path) -> str:
    """HTML of Markdown with pictures embedded; raw HTML and links to files become text."""
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    made = re.sub(r'<a href="(?!https?:|#)[^"]*">(.*?)</a>', r"\1", str(parser.render(text)))
    for file in folder.glob("figure-*.png"):
        data = base64.b64encode(file.read_bytes()).decode()
        made = made.replace(f'src="{file.name}"', f'src="data:image/png;base64,{data}"')
    return made
