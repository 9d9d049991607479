"""Reports from experiment files and the small tables beside the reports. Solves nothing.

An experiment file lists its figures and tables in order (`contactopt.benchmark.keys.FIGURE` has the
keys), or gets the usual ones (USUAL). Its report is REPORTS/NAME/report.md, its table rows.csv or
rows.parquet beside it.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contactopt.benchmark.entries import twice_in
from contactopt.benchmark.experiment import Experiment, read_layout
from contactopt.benchmark.keys import COLUMNS, USUAL
from contactopt.benchmark.plugins import run_file
from contactopt.benchmark.ranking import BUSY, machines_said, wall_over_cpu
from contactopt.benchmark.report_figures import FIGURES
from contactopt.benchmark.store import load, require, save
from contactopt.benchmark.tables import TABLES, select
from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.figures.style import save_figure
from contactopt.files.writing import remove_files, whole_folder
from contactopt.screen import progress

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# of a figure; all others are arguments of its function
OWN_KEYS = ("kind", "caption", "where", "optional")
LEFT_OUT = ("key", "label", "history")  # of a report's table
TABLE_FILES = ("csv", "parquet")
MOST_LINES = 2000  # of a table that is kept as text
SHADES = 56


def publish(experiment: Path, results: Path, reports: Path) -> None:
    """Copy the table of a campaign to REPORTS/NAME, a large one rounded to three digits."""
    layout = read_layout(experiment)
    drawn = {entry["kind"] for entry in layout.figures}
    left_out = set(LEFT_OUT) - ({"history"} if "leader_table" in drawn else set())
    columns = [*layout.columns] or [name for name in COLUMNS if name not in left_out]
    table, folder = load(results, absent=True), reports / layout.name
    kept = table["repeat"] == 0
    if len(table) > MOST_LINES:
        kept &= table["tolerance"] == table.groupby(["problem", "method"])["tolerance"].transform(
            "min"
        )
        for name in table.select_dtypes("float"):
            table[name] = [float(f"{value:.3g}") for value in table[name]]
    table["history"] = table["history"].where(kept, "[]")
    remove_files(folder, [f"rows.{kind}" for kind in TABLE_FILES])
    kind = TABLE_FILES[len(table) > MOST_LINES]
    save(table, folder / f"rows.{kind}", columns)


def has_table(folder: Path) -> bool:
    """Whether a report of the project has its table."""
    return any((folder / f"rows.{kind}").exists() for kind in TABLE_FILES)


def layouts(experiments: Sequence[str | Path]) -> list[Experiment]:
    """What experiment files say of their reports; InputError if two have the same name."""
    found = [read_layout(path) for path in experiments]
    if twice := twice_in(layout.name for layout in found):
        raise InputError(f"two experiments are called {twice!r}; rename one.")
    return found


def build(experiments: Sequence[str | Path], reports: str | Path) -> list[Experiment]:
    """Rebuild the report of every experiment with a table; InputError if none has one."""
    require("markdown_it", "pandas")
    made = [one for one in layouts(experiments) if has_table(Path(reports) / one.name)]
    if not made:
        raise InputError(
            f"'{reports}' holds no table of these experiments;"
            " make one with: contactopt report --run quick"
        )
    with progress("reports", len(made)) as shown:
        for layout in made:
            folder = Path(reports) / layout.name
            write_report(layout, folder, load(folder))
            shown.count()
    return made


def write_report(
    layout: Experiment,
    folder: Path,
    table: pd.DataFrame,
    formats: Sequence[str] = (),
    said: Sequence[str] = (),
) -> str:
    """Write report.md with `said` at its end, and its pictures, to a folder; its Markdown."""
    parts = [f"# {_one_line(layout.title)}", layout.text.strip()]
    if layout.findings:
        found = enumerate(_findings(layout, table), 1)
        parts.append("\n".join(f"{n}. {text}" for n, text in found))
    with whole_folder(folder, [old.name for old in folder.glob("figure-*.*")]) as made:
        for number, entry in enumerate(layout.figures or USUAL, 1):
            result, caption = _drawn(layout, number, entry, table), _one_line(entry["caption"])
            if result is None:
                continue
            if isinstance(result, str):
                parts.append(result)
            elif entry["kind"] in TABLES:
                parts += [_markdown(result), f"*Table {number}. {caption}*"]
            else:
                picture, plain = f"figure-{number}.png", re.sub(r"[\[\]*`]", "", caption)
                (made / picture).write_bytes(_png(result))
                for ending in {*formats} - {"png"}:
                    save_figure(result, made / f"figure-{number}.{ending}")
                parts += [f"![{plain}]({picture})", f"*Figure {number}. {caption}*"]
        parts.append("\n".join([_foot(layout, folder, table), *said]))
        text = "\n\n".join(part for part in parts if part) + "\n"
        (made / "report.md").write_text(text, encoding="utf-8")
    return text


def _drawn(layout: Experiment, number: int, entry: Mapping[str, Any], table: pd.DataFrame) -> Any:
    """What a figure's function makes of its rows, or a sentence, or None if it is optional."""
    kind, where = entry["kind"], entry.get("where", {})
    arguments = {key: value for key, value in entry.items() if key not in OWN_KEYS}
    try:
        try:
            rows = select(table, **where)
        except InputError as error:
            left = f"Number {number} ({kind}) is left out: {error}"
            return None if entry.get("optional") else left
        if kind in TABLES:
            return TABLES[kind](rows, **arguments)
        # names are not formulas for Matplotlib to set
        return FIGURES[kind](rows.replace(r"\$", r"\\$", regex=True), **arguments)
    # InputError is a ValueError
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        raise InputError(f"'{layout.path}', figure {number} ({kind}): {error}") from error


def _findings(layout: Experiment, table: pd.DataFrame) -> list[str]:
    path = layout.path.parent / layout.findings
    made = run_file(path, f"'{layout.path}': findings")
    try:
        return list(made.findings(table))
    except Exception as error:
        raise InputError(f"findings '{path}' failed: {type(error).__name__}: {error}") from error


def _foot(layout: Experiment, folder: Path, table: pd.DataFrame) -> str:
    failures = int((~table["success"]).sum())
    backends = {name for text in table["backend"] for name in str(text).split(", ")}
    backends -= {"native", "nan"}
    busy = wall_over_cpu(table)
    link = Path(os.path.relpath(layout.path, folder)).as_posix()
    files = (f"rows.{kind}" for kind in reversed(TABLE_FILES))
    name = next((file for file in files if (folder / file).exists()), "rows.jsonl")
    made = "`contactopt bench`; rebuilt from the table by `contactopt report` with this folder"
    if not (folder / "rows.jsonl").exists() and layout.path.parent != folder:
        # a report of the project, not the folder of a campaign
        made = (
            f"`contactopt report --run full {layout.path.stem}` (`quick` for fewer problems);"
            " rebuilt from the table by `contactopt report`"
        )
    machines, versions = ("; ".join(sorted(set(table[key]))) for key in ("machine", "versions"))
    lines = [
        f"{count(len(table), 'run')}, of which {failures} did not reach their tolerance. Every"
        " success is a certificate recomputed from the problem.",
        f"Wall time over CPU time of the calls is {busy:.2f}, a median over the methods. More than"
        f" 1 means a busy machine, and above {BUSY:g} nothing is ranked. CPU times are compared,"
        " and time limits are wall times.",
        f"Experiment: [`{layout.path.name}`]({link}); table: [`{name}`]({name}).",
        f"Made by {made}.",
        _one_line(f"Environment: {machines}. {versions}. One BLAS thread."),
    ]
    lines[1:1] = machines_said(table)
    return "\n".join(lines + ([f"Backends: {', '.join(sorted(backends))}."] if backends else []))


def _markdown(table: pd.DataFrame) -> str:
    """A table in Markdown; numbers with three significant digits."""

    def text(value: object) -> str:
        if isinstance(value, float):
            return f"{value:.3g}"
        return _one_line(value).replace("|", "\\|")

    rows = [[text(v) for v in row] for row in table.itertuples(index=False)]
    lines = [[text(str(c)) for c in table.columns], ["---"] * len(table.columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _png(figure: Figure) -> bytes:
    """With at most SHADES colours: a third of the size."""
    from PIL import Image

    full, small = io.BytesIO(), io.BytesIO()
    figure.savefig(full, format="png")
    Image.open(full).convert("RGB").quantize(SHADES).save(small, format="png", optimize=True)
    return small.getvalue()
