"""What every experiment writes: reports/NAME/ with report, tables as CSV, and figures."""

from __future__ import annotations

import csv
import os
import platform
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from contactopt.figures.style import save_figure

REPORTS = Path(__file__).parents[1] / "reports"
Tables = dict[str, list[dict[str, Any]]]
PACKAGES = ("numpy", "scipy", "scikit-fem", "qpsolvers", "cvxpy", "clarabel", "proxsuite", "osqp")


def environment() -> str:
    """Python, packages and machine, in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return (
        f"Python {platform.python_version()}, {packages};"
        f" {platform.machine()}, {os.cpu_count()} cores"
    )


def template(script: str) -> str:
    """The text of a question's report: NAME.md beside NAME.py, report.md in a folder of that name.

    {table} stands in it for the table of that name. A text in which a question puts numbers by
    `str.format` has {{table}} instead.
    """
    path = Path(script)
    stem = "report" if path.name == "__main__.py" else path.stem
    return path.with_name(f"{stem}.md").read_text(encoding="utf-8")


def markdown(rows: list[dict[str, Any]]) -> str:
    """A table; floats with four significant digits."""

    def text(value: Any) -> str:
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(text(row[h]) for h in head) + " |" for row in rows])


def write(
    name: str,
    title: str,
    text: str,
    tables: Tables,
    figures: dict[str, Any],
    command: str = "",
) -> None:
    """Write reports/name/ with its report.

    `text` is Markdown in which {table} stands for the table of that name; figures that it does not
    show come last. `command` is the module that makes it, by default experiments.questions.name.
    """
    folder = REPORTS / name
    folder.mkdir(parents=True, exist_ok=True)
    for stem, rows in tables.items():
        save(name, stem, rows)
    save_figures(name, figures)
    body = text
    for stem, rows in tables.items():
        body = body.replace(f"{{{stem}}}", markdown(rows))
    path = folder / "report.md"
    pictures = "\n\n".join(f"![{s}]({s}.png)" for s in figures if f"]({s}.png)" not in body)
    made = command or f"experiments.questions.{name}"
    foot = f"Made by `python -m {made}`.\nEnvironment: {environment()}."
    path.write_text(f"# {title}\n\n{body}\n\n{pictures}\n\n{foot}\n".replace("\n\n\n\n", "\n\n"))
    print(path.read_text())


def save_figures(name: str, figures: dict[str, Any]) -> None:
    """Write the figures of a report alone: what `python -m experiments.questions.NAME figures` does
    to draw them again from the tables, as PDF, too.
    """
    for stem, figure in figures.items():
        for ending in ("png", "pdf") if figures_alone() else ("png",):
            save_figure(figure, REPORTS / name / f"{stem}.{ending}")


def figures_alone() -> bool:
    """Whether the command asks to draw the figures again and to measure nothing."""
    return sys.argv[1:] == ["figures"]


def save(name: str, table: str, rows: list[dict[str, Any]]) -> None:
    """Write one table of a report."""
    folder = REPORTS / name
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / f"{table}.csv", "w", newline="") as file:
        file.write(f"# {environment()}\n")
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def stored(name: str, table: str) -> list[dict[str, Any]]:
    """The rows of a table as they were written last; none if it is not there."""
    path = REPORTS / name / f"{table}.csv"
    if not path.exists():
        return []
    with open(path, newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return [{key: number(value) for key, value in row.items()} for row in rows]


def measure(
    name: str,
    title: str,
    text: str | Callable[[Tables], str],
    tables: dict[str, Callable[[], list[dict[str, Any]]]],
    figures: Callable[[Tables], dict[str, Any]] = lambda tables: {},
) -> None:
    """Measure the tables that the command names, or all, and write the report once all are there.

    Each table can be measured by itself; the report takes the others as they were written last. The
    text may be made of the tables, where it holds numbers of them.
    """
    if figures_alone():
        return save_figures(name, figures({table: stored(name, table) for table in tables}))
    chosen = sys.argv[1:] or list(tables)
    unknown = [table for table in chosen if table not in tables]
    if unknown:
        raise SystemExit(f"there is no table {unknown[0]!r}; choose from {', '.join(tables)}.")
    for table in chosen:
        save(name, table, tables[table]())
    known = {table: stored(name, table) for table in tables}
    if all(known.values()):
        write(name, title, text(known) if callable(text) else text, known, figures(known))


def merged(
    name: str, table: str, rows: list[dict[str, Any]], keys: tuple[str, ...]
) -> list[dict[str, Any]]:
    """The committed table with these rows in place of those with the same `keys`.

    A column that only the committed or only the new rows have is empty in the others.
    """
    new = {tuple(str(row[key]) for key in keys): row for row in rows}
    kept = stored(name, table)
    out = [new.pop(tuple(str(row[key]) for key in keys), row) for row in kept] + list(new.values())
    columns = dict.fromkeys(column for row in rows + kept for column in row)
    return [{column: row.get(column, "") for column in columns} for row in out]


def number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text
