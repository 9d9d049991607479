"""Reports from experiment files and the small tables beside the reports. Solves nothing.

An experiment file lists its figures and tables in order (`contactopt.benchmark.keys.FIGURE` has the
keys), or gets the usual ones (USUAL). Its report is REPORTS/NAME/report.md, its table rows.csv or
rows.parquet beside it; all reports together are REPORTS/benchmarks.html.
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

from contactopt.benchmark.keys import COLUMNS
from contactopt.benchmark.ranking import BUSY, wall_over_cpu
from contactopt.benchmark.report_figures import FIGURES
from contactopt.benchmark.store import load, require, save
from contactopt.benchmark.tables import TABLES, select
from contactopt.checks import check_name
from contactopt.errors import InputError
from contactopt.figures.html import filled
from contactopt.figures.style import save_figure
from contactopt.files.toml_table import Table, read_table
from contactopt.files.writing import remove_files, whole_file, whole_folder

if TYPE_CHECKING:
    import pandas as pd

# The report of an experiment that asks for no figures.
USUAL = (
    {
        "kind": "leader_table",
        "caption": "Leaders at the certificate 1e-6: shifted geometric means of the times in"
        " seconds; a failure counts as the time limit.",
    },
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
)
# of a figure; all others are arguments of its function
OWN_KEYS = ("kind", "caption", "where", "optional")
WITH_HISTORY = {"convergence", "leader_table"}  # kinds whose reports draw convergence
LEFT_OUT = ("key", "label", "history")  # of a report's table
TABLE_FILES = ("csv", "parquet")
MOST_LINES = 2000  # of a table that is kept as text
PAGE = "benchmarks.html"
SHADES = 56


@dataclass(frozen=True)
class Layout:
    """What an experiment file says of its report."""

    path: Path
    name: str
    title: str
    text: str = ""
    figures: tuple[Mapping[str, Any], ...] = ()
    findings: str = ""
    columns: tuple[str, ...] = ()


def read_layout(path: str | Path) -> Layout:
    """The layout of an experiment's report; InputError if unreadable or with unknown figures."""
    path = Path(path)
    root = read_table(path, "experiment")
    name = root.take("name", str, path.stem)
    with root.about("name"):
        check_name("'name'", name)
    title, text, findings = (root.take(key, str, "") for key in ("title", "text", "findings"))
    columns = root.take("columns", list, [], what="a list of texts")
    if not all(isinstance(column, str) for column in columns):
        raise root.fail("'columns' must be a list of texts.", "columns")
    for number, entry in enumerate(root.tables("figures"), 1):
        _check_figure(number, entry)
    figures = root.data.get("figures", ())
    return Layout(path, name, title or name, text, tuple(figures), findings, tuple(columns))


def _check_figure(number: int, entry: Table) -> None:
    kind, caption = entry.data.get("kind"), entry.data.get("caption")
    if not isinstance(kind, str) or kind not in FIGURES | TABLES:
        kinds = ", ".join(FIGURES | TABLES)
        raise entry.fail(f"figure {number}: unknown kind {kind!r}; choose from {kinds}.", "kind")
    if not caption or not isinstance(caption, str):
        raise entry.fail(f"figure {number}: it needs a caption.", "caption")
    if not isinstance(entry.data.get("where", {}), dict):
        raise entry.fail(
            f"figure {number}: 'where' must be a table of columns and values.", "where"
        )


def publish(experiment: Path, results: Path, reports: Path) -> None:
    """Take the small table of a campaign over into REPORTS/NAME.

    A large one keeps three digits, and the course of the tightest run of each method alone.
    """
    layout = read_layout(experiment)
    drawn = {entry["kind"] for entry in layout.figures}
    left_out = set(LEFT_OUT) - ({"history"} if drawn & WITH_HISTORY else set())
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


def build(experiments: Sequence[str | Path], reports: str | Path) -> Path:
    """Rebuild the report of every experiment that has a table in `reports`, and the page with all,
    which is returned; InputError if none has, or if a figure's arguments do not fit its table.
    """
    require("markdown_it", "pandas")
    page, errors = Path(reports) / PAGE, []
    made: dict[str, tuple[Layout, str]] = {}
    for path in experiments:
        try:
            layout = read_layout(path)
            if layout.name in made:
                raise InputError(
                    f"'{path}': another experiment is called {layout.name!r} too; rename one."
                )
            folder = page.parent / layout.name
            if has_table(folder):
                text = write_report(layout, folder, load(folder))
                made[layout.name] = layout, rendered(text, folder)
        except InputError as error:
            errors.append(str(error))
    if made:
        names = {
            html.escape(name): (html.escape(own.title), body) for name, (own, body) in made.items()
        }
        links = (f'<li><a href="#{name}">{title}</a></li>' for name, (title, _) in names.items())
        parts = (f'<section id="{name}">{body}</section>' for name, (_, body) in names.items())
        text = filled("benchmarks.html", links="".join(links), sections="".join(parts))
        with whole_file(page) as file:
            file.write_text(text, encoding="utf-8")
    if errors:
        raise InputError("; ".join(errors))
    if not made:
        raise InputError(
            f"'{reports}' holds no table of these experiments;"
            " make one with: contactopt report --run quick"
        )
    return page


def write_report(
    layout: Layout, folder: Path, table: pd.DataFrame, formats: Sequence[str] = ()
) -> str:
    """Write report.md into a folder, and its pictures as PNG and in more formats; its Markdown."""
    parts = [f"# {_one_line(layout.title)}", layout.text.strip()]
    if layout.findings:
        found = enumerate(_findings(layout, table), 1)
        parts.append("\n".join(f"{n}. {text}" for n, text in found))
    with whole_folder(folder, [old.name for old in folder.glob("figure-*.*")]) as made:
        for number, entry in enumerate(layout.figures or USUAL, 1):
            result, caption = _drawn(layout, number, entry, table), _one_line(entry["caption"])
            if result is None:
                continue
            if entry["kind"] in TABLES:
                parts += [_markdown(result), f"*Table {number}. {caption}*"]
            else:
                picture, plain = f"figure-{number}.png", re.sub(r"[\[\]*`]", "", caption)
                (made / picture).write_bytes(_png(result))
                for ending in {*formats} - {"png"}:
                    save_figure(result, made / f"figure-{number}.{ending}")
                parts += [f"![{plain}]({picture})", f"*Figure {number}. {caption}*"]
        parts.append(_foot(layout, folder, table))
        text = "\n\n".join(part for part in parts if part) + "\n"
        (made / "report.md").write_text(text, encoding="utf-8")
    return text


def _drawn(layout: Layout, number: int, entry: Mapping[str, Any], table: pd.DataFrame) -> Any:
    """What a figure's function makes of its rows; None where no row fits an optional one."""
    kind, where = entry["kind"], dict(entry.get("where", {}))
    arguments = {key: value for key, value in entry.items() if key not in OWN_KEYS}
    try:
        try:
            rows = select(table, where.pop("law", "coulomb"), **where)
        except InputError:
            if entry.get("optional"):
                return None
            raise
        if kind in TABLES:
            return TABLES[kind](rows, **arguments)
        # names are not formulas for Matplotlib to set
        return FIGURES[kind](rows.replace(r"\$", r"\\$", regex=True), **arguments)
    # InputError is a ValueError
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        raise InputError(f"'{layout.path}', figure {number} ({kind}): {error}") from error


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
        f"{len(table)} runs, of which {failures} did not keep their tolerance. Every success is a"
        " certificate recomputed from the problem.",
        f"The median of wall time over CPU time of the calls is {busy:.2f}. More than 1 means a"
        f" busy machine, and above {BUSY:g} nothing is ranked. CPU times are compared, and time"
        " limits are wall times.",
        f"Experiment: [`{layout.path.name}`]({link}); table: [`{name}`]({name}).",
        f"Made by {made}.",
        _one_line(f"Environment: {machines}. {versions}. One BLAS thread."),
    ]
    return "\n".join(lines + ([f"Backends: {', '.join(sorted(backends))}."] if backends else []))


def _markdown(table: pd.DataFrame) -> str:
    """A table in Markdown; numbers with three significant digits."""

    def text(value: Any) -> str:
        if isinstance(value, float):
            return f"{value:.3g}"
        return _one_line(value).replace("|", "\\|")

    rows = [[text(v) for v in row] for row in table.itertuples(index=False)]
    lines = [[text(str(c)) for c in table.columns], ["---"] * len(table.columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _png(figure: Any) -> bytes:
    """With at most SHADES colours: a third of the size."""
    from PIL import Image

    full, small = io.BytesIO(), io.BytesIO()
    figure.savefig(full, format="png")
    Image.open(full).convert("RGB").quantize(SHADES).save(small, format="png", optimize=True)
    return small.getvalue()


def rendered(text: str, folder: Path) -> str:
    """HTML of Markdown, with the pictures in `folder` embedded; raw HTML is shown as text, and
    links to files become text, since the page may stand elsewhere.
    """
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    made = re.sub(r'<a href="(?!https?:|#)[^"]*">(.*?)</a>', r"\1", str(parser.render(text)))
    for file in folder.glob("figure-*.png"):
        data = base64.b64encode(file.read_bytes()).decode()
        made = made.replace(f'src="{file.name}"', f'src="data:image/png;base64,{data}"')
    return made
