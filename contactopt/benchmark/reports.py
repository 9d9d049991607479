"""Reports: Markdown and one HTML page, from experiment files and the small tables beside the
reports. Solves nothing.

An experiment file lists its figures and tables in order, each with a caption, a choice of rows and
arguments:

    findings = "mine.py"                        # with a function findings(table) -> three
                                                sentences, computed
    [[figures]]
    kind = "speed_accuracy"                     # a function of contactopt.benchmark.report_figures
                                                or .tables
    caption = "Time against accuracy."
    where = {"problem.elements" = 16}           # law = "coulomb" unless given
    optional = true                             # left out where no row fits, as in a quick version
    time = "cpu_seconds"                        # all other keys are arguments of that function

A file without figures gets the usual ones (USUAL). Its report is REPORTS/NAME/report.md, its table
REPORTS/NAME/rows.csv; all reports together are REPORTS/benchmarks.html.
"""

from __future__ import annotations

import base64
import html
import io
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contactopt.benchmark.campaign_files import subfolder, told
from contactopt.benchmark.report_figures import FIGURES
from contactopt.benchmark.store import COLUMNS, load, require, save
from contactopt.benchmark.tables import TABLES, select
from contactopt.checks import check_name
from contactopt.errors import InputError
from contactopt.files.toml_table import read_table
from contactopt.files.writing import remove_files, replace_file

if TYPE_CHECKING:
    import pandas as pd

# The report of an experiment that asks for no figures.
USUAL = (
    {
        "kind": "success_table",
        "caption": "Runs that kept the tolerance, by setting; how the others ended.",
    },
    {
        "kind": "performance_profile",
        "caption": "Which share of the instances each method solved, and how fast.",
        "metric": "cpu_seconds",
    },
    {
        "kind": "speed_accuracy",
        "caption": "CPU time against certified residual; hollow: the tolerance was missed.",
        "time": "cpu_seconds",
    },
    {
        "kind": "time_table",
        "caption": "Shifted geometric means; a failure counts at the time limit.",
        "metric": "cpu_seconds",
    },
)
# of a figure; all others are arguments of its function
OWN_KEYS = ("kind", "caption", "where", "optional")
LEFT_OUT = ("key", "label", "base_mb", "history")  # of a report's table
PAGE = "benchmarks.html"
DPI, SHADES = 100, 160
QUESTIONS = (
    "Which chart answers which question? Speed against accuracy shows what a certified residual"
    " costs. A performance profile shows where methods fail, at its right end, and which is fast,"
    " at its left. A table of times by start shows what warm starts buy. A map shows for which"
    " numbers a method fails, and time against size how its cost grows."
)
STYLE = """body{max-width:60rem;margin:2rem auto;padding:0 1rem;font:16px/1.5 system-ui,sans-serif;color:#222}
table{border-collapse:collapse;font-size:13px;display:block;overflow-x:auto}td,th{border:1px solid #ccc;padding:.2rem .5rem}
img{max-width:100%}code{background:#f3f3f3}section{border-top:2px solid #999;margin-top:3rem}"""


@dataclass(frozen=True)
class Layout:
    """What an experiment file says of its report."""

    path: Path
    name: str
    title: str
    text: str
    figures: tuple[Mapping[str, Any], ...]
    findings: str
    columns: tuple[str, ...]


def read_layout(path: str | Path) -> Layout:
    """Read how the report of an experiment is laid out.

    Parameters
    ----------
    path : The experiment file.

    Returns
    -------
    Title, text, figures and tables of the report.

    Raises
    ------
    InputError : If the file cannot be read or asks for a figure that does not exist. The message
        names it.
    """
    path = Path(path)
    data = read_table(path, "experiment").data
    figures, columns = data.get("figures", []), data.get("columns", [])
    if not isinstance(figures, list) or not all(isinstance(entry, dict) for entry in figures):
        raise InputError(f"'{path}': 'figures' must be a list of tables, [[figures]].")
    if not isinstance(columns, list) or not all(isinstance(name, str) for name in columns):
        raise InputError(f"'{path}': 'columns' must be a list of texts.")
    for number, entry in enumerate(figures, 1):
        if not isinstance(entry.get("kind"), str) or entry["kind"] not in FIGURES | TABLES:
            kinds = ", ".join(FIGURES | TABLES)
            raise InputError(
                f"'{path}', figure {number}: unknown kind {entry.get('kind')!r}; choose from"
                f" {kinds}."
            )
        if not entry.get("caption") or not isinstance(entry["caption"], str):
            raise InputError(f"'{path}', figure {number}: it needs a caption.")
        if not isinstance(entry.get("where", {}), dict):
            raise InputError(
                f"'{path}', figure {number}: 'where' must be a table of columns and values."
            )
    texts = {key: data.get(key) or "" for key in ("title", "text", "findings")}
    for key, text in texts.items():
        if not isinstance(text, str):
            raise InputError(f"'{path}': '{key}' must be a text.")
    name = data.get("name", path.stem)
    try:
        check_name("'name'", name)
    except InputError as error:
        raise InputError(f"'{path}': {error}") from error
    return Layout(
        path,
        name,
        texts["title"] or name,
        texts["text"],
        tuple(figures),
        texts["findings"],
        tuple(columns),
    )


def publish(experiment: str | Path, results: str | Path, reports: str | Path) -> Path:
    """Take the small table of a campaign over into REPORTS/NAME/rows.csv.

    Parameters
    ----------
    experiment : The experiment file.
    results : The folder of the campaign.
    reports : The folder of the reports.

    Returns
    -------
    The table.

    Raises
    ------
    InputError : As `read_layout`, `load` and `save` raise it.
    """
    layout = read_layout(experiment)
    kept = {"history"} if any(entry["kind"] == "convergence" for entry in layout.figures) else set()
    columns = [*layout.columns] or [
        name for name in COLUMNS if name not in LEFT_OUT or name in kept
    ]
    target = subfolder(Path(reports), layout.name) / "rows.csv"
    save(load(results), target, columns)
    return target


def build(experiments: Sequence[str | Path], reports: str | Path) -> Path:
    """Rebuild the report of every experiment that has a table in `reports`, and the page with all.

    Parameters
    ----------
    experiments : The experiment files.
    reports : The folder of the reports.

    Returns
    -------
    The page.

    Raises
    ------
    InputError : If none has a table, or if a figure's arguments do not fit its table.
    """
    require("markdown_it", "pandas")
    reports, errors = Path(reports), []
    bodies: list[tuple[Layout, Path, str]] = []
    for path in experiments:
        try:
            layout = read_layout(path)
            if layout.name in [other.name for other, _, _ in bodies]:
                raise InputError(
                    f"'{path}': another experiment is called {layout.name!r} too; rename one."
                )
            folder = subfolder(reports, layout.name)
            if (folder / "rows.csv").exists():
                with told(folder):
                    text = write_report(layout, folder, load(folder / "rows.csv"))
                bodies.append((layout, folder, text))
        except InputError as error:
            errors.append(str(error))
    if bodies:
        with told(reports):
            _replace(reports / PAGE, page_of(bodies))
    if errors:  # after all the others are done
        raise InputError("; ".join(errors))
    if not bodies:
        raise InputError(
            f"'{reports}' holds no table of these experiments; make one with: contactopt report"
            " --run quick"
        )
    return reports / PAGE


def write_report(layout: Layout, folder: Path, table: pd.DataFrame) -> str:
    """Write report.md with its pictures into a folder.

    Parameters
    ----------
    layout : How the report is laid out.
    folder : Where it goes.
    table : The rows of the experiment.

    Returns
    -------
    The Markdown of the report.

    Raises
    ------
    InputError : If a figure does not fit the table.
    """
    parts = [f"# {_one_line(layout.title)}", layout.text.strip()]
    if layout.findings:
        parts.append(
            "\n".join(f"{n}. {text}" for n, text in enumerate(_findings(layout, table), 1))
        )
    remove_files(folder, [old.name for old in folder.glob("figure-*.png")])
    for number, entry in enumerate(layout.figures or USUAL, 1):
        result = _drawn(layout, number, entry, table)
        if result is None:
            continue
        if entry["kind"] in TABLES:
            parts += [_markdown(result), f"*Table {number}. {_one_line(entry['caption'])}*"]
        else:
            picture, caption = folder / f"figure-{number}.png", _one_line(entry["caption"])
            image = _png(result)
            replace_file(picture, lambda file, image=image: file.write_bytes(image))  # type: ignore[misc]
            parts += [f"![{_plain(caption)}]({picture.name})", f"*Figure {number}. {caption}*"]
    parts.append(_foot(layout, folder, table))
    text = "\n\n".join(part for part in parts if part) + "\n"
    _replace(folder / "report.md", text)
    return text


def _drawn(layout: Layout, number: int, entry: Mapping[str, Any], table: pd.DataFrame) -> Any:
    """What a figure's function makes of its rows; None where no row fits an optional one."""
    arguments = {key: value for key, value in entry.items() if key not in OWN_KEYS}
    where = dict(entry.get("where", {}))
    try:
        rows = select(table, where.pop("law", "coulomb"), **where)
    except InputError as error:
        if entry.get("optional"):
            return None
        raise InputError(f"'{layout.path}', figure {number} ({entry['kind']}): {error}") from error
    try:
        return (
            TABLES[entry["kind"]](rows, **arguments)
            if entry["kind"] in TABLES
            else FIGURES[entry["kind"]](_without_formulas(rows), **arguments)
        )
    # InputError is a ValueError
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        raise InputError(f"'{layout.path}', figure {number} ({entry['kind']}): {error}") from error


def _without_formulas(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with every $ in a text marked as a plain character: names are not formulas for
    Matplotlib to set.
    """
    texts = [
        name
        for name in rows
        if name != "history" and rows[name].map(lambda value: isinstance(value, str)).any()
    ]
    plain = {
        name: rows[name].map(lambda v: v.replace("$", r"\$") if isinstance(v, str) else v)
        for name in texts
    }
    return rows.assign(**plain)


def _findings(layout: Layout, table: pd.DataFrame) -> list[str]:
    path = layout.path.parent / layout.findings
    spec = spec_from_file_location(f"contactopt_findings_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError(f"'{layout.path}': findings '{layout.findings}' is not a Python file.")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
        return list(module.findings(table))
    except Exception as error:
        raise InputError(f"findings '{path}' failed: {type(error).__name__}: {error}") from error


def _foot(layout: Layout, folder: Path, table: pd.DataFrame) -> str:
    failures = int((~table["success"]).sum())
    backends = sorted(
        {name for text in table["backend"] for name in str(text).split(", ")} - {"native", "nan"}
    )
    link = Path(os.path.relpath(layout.path, folder)).as_posix()
    kept = (folder / "rows.csv").exists()  # a report of the project, not the folder of a campaign
    name = "rows.csv" if kept else "rows.parquet"
    again = (
        f"`contactopt report --run full {layout.path.stem}`; rebuilt from the table by `contactopt"
        " report`"
    )
    lines = [
        (
            f"{len(table)} runs, of which {failures} did not keep their tolerance. Every success is"
            " a certificate recomputed from the problem."
        ),
        (
            "The median of wall time over CPU time of the calls is"
            f" {(table['call_seconds'] / table['cpu_seconds']).median():.1f}. More than 1 means a"
            " busy machine. CPU times are compared, and time limits are wall times."
        ),
        f"Experiment: [`{layout.path.name}`]({link}); table: [`{name}`]({name}).",
        (
            f"Made by {again}."
            if kept
            else (
                "Made by `contactopt bench`; rebuilt from the table by `contactopt report` with"
                " this folder."
            )
        ),
        _one_line(
            f"Environment: {'; '.join(sorted(set(table['machine'])))}."
            f" {'; '.join(sorted(set(table['versions'])))}. One BLAS thread."
        ),
    ]
    return "\n".join(lines + ([f"Backends: {', '.join(backends)}."] if backends else []))


def _markdown(table: pd.DataFrame) -> str:
    """A table in Markdown; numbers with three significant digits."""

    def text(value: Any) -> str:
        return f"{value:.3g}" if isinstance(value, float) else _literal(str(value))

    rows = [[text(v) for v in row] for row in table.itertuples(index=False)]
    lines = [[_literal(str(c)) for c in table.columns], ["---"] * len(table.columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _literal(text: str) -> str:
    """The text in a cell of a table."""
    return _one_line(text).replace("|", "\\|")


def _png(figure: Any) -> bytes:
    """With at most SHADES colours: a third of the size."""
    from PIL import Image

    full, small = io.BytesIO(), io.BytesIO()
    figure.savefig(full, format="png", dpi=DPI)
    Image.open(full).convert("RGB").quantize(SHADES).save(small, format="png", optimize=True)
    return small.getvalue()


def page_of(bodies: Sequence[tuple[Layout, Path, str]]) -> str:
    """Make one HTML page of reports. It stands alone.

    Parameters
    ----------
    bodies : Layout, folder and Markdown of each report.

    Returns
    -------
    The HTML.
    """
    links = "".join(
        f'<li><a href="#{html.escape(layout.name)}">{html.escape(layout.title)}</a></li>'
        for layout, _, _ in bodies
    )
    sections = [
        f'<section id="{html.escape(layout.name)}">{rendered(text, folder)}</section>'
        for layout, folder, text in bodies
    ]
    head = (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>contactopt: benchmarks</title>'
    )
    head += f"<style>{STYLE}</style>"
    return (
        f"{head}<h1>Benchmarks</h1><p>{QUESTIONS}</p><ul>{links}</ul>{''.join(sections)}</html>\n"
    )


def rendered(text: str, folder: Path) -> str:
    """Make HTML of Markdown, with the pictures of the report embedded.

    Raw HTML is shown as text. Links to files beside the report become text, since the page may
    stand elsewhere.

    Parameters
    ----------
    text : The Markdown.
    folder : Where its pictures are.

    Returns
    -------
    The HTML.
    """
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    made = re.sub(r'<a href="(?!https?:|#)[^"]*">(.*?)</a>', r"\1", str(parser.render(text)))
    for file in folder.glob("figure-*.png"):
        data = base64.b64encode(file.read_bytes()).decode()
        made = made.replace(f'src="{file.name}"', f'src="data:image/png;base64,{data}"')
    return made


def _plain(text: str) -> str:
    return re.sub(r"[\[\]*`]", "", text)


def _replace(path: Path, text: str) -> None:
    replace_file(path, lambda file: file.write_text(text, encoding="utf-8"))
