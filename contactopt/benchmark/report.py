"""Reports: Markdown and one HTML page, from experiment files and the small tables beside the reports. Solves nothing.

An experiment file lists its figures and tables in order, each with a caption, a choice of rows and arguments:

    findings = "mine.py"                        # with a function findings(table) -> three sentences, computed
    [[figures]]
    kind = "speed_accuracy"                     # a function of contactopt.benchmark.figures or .tables
    caption = "Time against accuracy."
    where = {"problem.elements" = 16}           # law = "coulomb" unless given

Its report is REPORTS/NAME/report.md, its table REPORTS/NAME/rows.csv; all reports together are REPORTS/benchmarks.html.
"""

from __future__ import annotations

import base64
import html
import io
import os
import re
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contactopt.benchmark.figures import FIGURES
from contactopt.benchmark.store import COLUMNS, load, require, save
from contactopt.benchmark.tables import TABLES, select
from contactopt.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

LEFT_OUT = ("key", "label", "base_mb", "history")  # of a report's table
PAGE = "benchmarks.html"
DPI, SHADES = 90, 256
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
    """InputError, naming the file, if it cannot be read or asks for a figure that does not exist."""
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read the experiment '{path}': {error}") from error
    for number, entry in enumerate(data.get("figures", []), 1):
        if entry.get("kind") not in FIGURES | TABLES:
            kinds = ", ".join(FIGURES | TABLES)
            raise InputError(f"'{path}', figure {number}: unknown kind {entry.get('kind')!r}; choose from {kinds}.")
        if not entry.get("caption"):
            raise InputError(f"'{path}', figure {number}: it needs a caption.")
    name = data.get("name", path.stem)
    texts = (data.get("title") or name, data.get("text", ""))
    return Layout(
        path, name, *texts, tuple(data.get("figures", ())), data.get("findings", ""), tuple(data.get("columns", ()))
    )


def publish(experiment: str | Path, results: str | Path, reports: str | Path) -> Path:
    """Take the small table of a campaign over into REPORTS/NAME/rows.csv; returns its path."""
    layout = read_layout(experiment)
    kept = {"history"} if any(entry["kind"] == "convergence" for entry in layout.figures) else set()
    columns = [*layout.columns] or [name for name in COLUMNS if name not in LEFT_OUT or name in kept]
    target = Path(reports) / layout.name / "rows.csv"
    save(load(results), target, columns)
    return target


def build(experiments: Sequence[str | Path], reports: str | Path) -> Path:
    """Rebuild the report of every experiment that has a table in `reports`, and the page with all; returns its path.

    Raises InputError if none has one, or if a figure's arguments do not fit its table.
    """
    require("markdown_it", "pandas")
    reports, bodies, errors = Path(reports), [], []
    for path in experiments:
        try:
            layout = read_layout(path)
            folder = reports / layout.name
            if (folder / "rows.csv").exists():
                bodies.append((layout, folder, _write_report(layout, folder)))
        except InputError as error:
            errors.append(str(error))
    if bodies:
        _replace(reports / PAGE, _page(bodies))
    if errors:  # after all the others are done
        raise InputError("; ".join(errors))
    if not bodies:
        raise InputError(
            f"'{reports}' holds no table of these experiments; make one with: contactopt report --run quick"
        )
    return reports / PAGE


def _write_report(layout: Layout, folder: Path) -> str:
    table = load(folder / "rows.csv")
    parts = [f"# {layout.title}", layout.text.strip()]
    if layout.findings:
        parts.append("\n".join(f"{n}. {text}" for n, text in enumerate(_findings(layout, table), 1)))
    for old in folder.glob("figure-*.png"):
        old.unlink()
    for number, entry in enumerate(layout.figures, 1):
        result = _drawn(layout, number, entry, table)
        if entry["kind"] in TABLES:
            parts += [markdown(result), f"*Table {number}. {entry['caption']}*"]
        else:
            picture = folder / f"figure-{number}.png"
            picture.write_bytes(_png(result))
            parts += [f"![{_plain(entry['caption'])}]({picture.name})", f"*Figure {number}. {entry['caption']}*"]
    parts.append(_foot(layout, folder, table))
    text = "\n\n".join(part for part in parts if part) + "\n"
    _replace(folder / "report.md", text)
    return text


def _drawn(layout: Layout, number: int, entry: Mapping[str, Any], table: pd.DataFrame) -> Any:
    arguments = {key: value for key, value in entry.items() if key not in ("kind", "caption", "where")}
    where = dict(entry.get("where", {}))
    try:
        rows = select(table, where.pop("law", "coulomb"), **where)
        return (FIGURES | TABLES)[entry["kind"]](rows, **arguments)
    except (InputError, TypeError, KeyError) as error:
        raise InputError(f"'{layout.path}', figure {number} ({entry['kind']}): {error}") from error


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
    backends = sorted({name for text in table["backend"] for name in str(text).split(", ")} - {"native", "nan"})
    link = Path(os.path.relpath(layout.path, folder)).as_posix()
    lines = [
        f"{len(table)} runs, of which {failures} did not keep their tolerance. Every success is a certificate recomputed from "
        "the problem.",
        f"Wall over CPU time of the calls: median {(table['call_seconds'] / table['cpu_seconds']).median():.1f} (more than 1: a busy "
        "machine; CPU times are compared, time limits are wall).",
        f"Experiment: [`{layout.path.name}`]({link}); table: [`rows.csv`](rows.csv).",
        f"Made by `contactopt report --run full {layout.path.stem}`; rebuilt from the table by `contactopt report`.",
        f"Environment: {'; '.join(sorted(set(table['machine'])))}. {'; '.join(sorted(set(table['versions'])))}. One BLAS thread.",
    ]
    return "\n".join(lines + ([f"Backends: {', '.join(backends)}."] if backends else []))


def markdown(table: pd.DataFrame) -> str:
    """A table in Markdown; numbers with three significant digits."""

    def text(value: Any) -> str:
        return f"{value:.3g}" if isinstance(value, float) else str(value).replace("|", "\\|")

    rows = [[text(v) for v in row] for row in table.itertuples(index=False)]
    lines = [[str(c) for c in table.columns], ["---"] * len(table.columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _png(figure: Any) -> bytes:
    """With at most SHADES colours: a third of the size."""
    from PIL import Image

    full, small = io.BytesIO(), io.BytesIO()
    figure.savefig(full, format="png", dpi=DPI)
    Image.open(full).convert("RGB").quantize(SHADES).save(small, format="png", optimize=True)
    return small.getvalue()


def _page(bodies: Sequence[tuple[Layout, Path, str]]) -> str:
    from markdown_it import MarkdownIt

    render = MarkdownIt("commonmark").enable("table").render
    links = "".join(f'<li><a href="#{layout.name}">{html.escape(layout.title)}</a></li>' for layout, _, _ in bodies)
    sections = []
    for layout, folder, text in bodies:

        def inline(match: re.Match[str], folder: Path = folder) -> str:
            return f'src="data:image/png;base64,{base64.b64encode((folder / match[1]).read_bytes()).decode()}"'

        body = re.sub(r'src="(figure-\d+\.png)"', inline, render(text))
        body = re.sub(r'<a href="(?!http|#)[^"]*">(.*?)</a>', r"\1", body)  # the page stands alone
        sections.append(f'<section id="{layout.name}">{body}</section>')
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>contactopt: benchmarks</title><style>{STYLE}</style>'
    return f"{head}<h1>Benchmarks</h1><ul>{links}</ul>{''.join(sections)}</html>\n"


def _plain(text: str) -> str:
    return re.sub(r"[\[\]*`]", "", text)


def _replace(path: Path, text: str) -> None:
    handle, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(handle, "w") as file:
        file.write(text)
    os.chmod(name, 0o644)
    os.replace(name, path)
