"""What every experiment writes: reports/NAME/ with report, tables as CSV, and figures."""

from __future__ import annotations

import csv
import os
import platform
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

REPORTS = Path(__file__).parents[1] / "reports"
PAPER = ("punch-2d", "punch-3d", "sphere")  # the paper's scenes
PACKAGES = ("numpy", "scipy", "scikit-fem", "qpsolvers", "cvxpy", "clarabel", "proxsuite", "osqp")

# of figures: one column of a journal and its height [inch], colours of Okabe and Ito, letters [pt]
COLUMN, HEIGHT = 85 / 25.4, 62 / 25.4
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
LETTERS = 7.0
GREY = "#bbbbbb"
Line = tuple[str, Sequence[float], Sequence[float]]


def environment() -> str:
    """Python, packages and machine, in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return (
        f"Python {platform.python_version()}, {packages};"
        f" {platform.machine()}, {os.cpu_count()} cores"
    )


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
    tables: dict[str, list[dict[str, Any]]],
    figures: dict[str, Any],
) -> None:
    """Write reports/name/ with its report.

    `text` is Markdown in which {table} stands for the table of that name.
    """
    folder = REPORTS / name
    folder.mkdir(parents=True, exist_ok=True)
    for stem, rows in tables.items():
        save(name, stem, rows)
    for stem, figure in figures.items():
        figure.savefig(folder / f"{stem}.png", dpi=200)
    body = text
    for stem, rows in tables.items():
        body = body.replace(f"{{{stem}}}", markdown(rows))
    path = folder / "report.md"
    pictures = "\n\n".join(f"![{stem}]({stem}.png)" for stem in figures)
    foot = f"Made by `python -m experiments.questions.{name}`.\nEnvironment: {environment()}."
    path.write_text(f"# {title}\n\n{body}\n\n{pictures}\n\n{foot}\n".replace("\n\n\n\n", "\n\n"))
    print(path.read_text())


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
    text: str,
    tables: dict[str, Callable[[], list[dict[str, Any]]]],
    figures: Callable[[dict[str, list[dict[str, Any]]]], dict[str, Any]] = lambda tables: {},
) -> None:
    """Measure the tables that the command names, or all, and write the report once all are there.

    Each table can be measured by itself; the report takes the others as they were written last.
    """
    chosen = sys.argv[1:] or list(tables)
    unknown = [table for table in chosen if table not in tables]
    if unknown:
        raise SystemExit(f"there is no table {unknown[0]!r}; choose from {', '.join(tables)}.")
    for table in chosen:
        save(name, table, tables[table]())
    known = {table: stored(name, table) for table in tables}
    if all(known.values()):
        write(name, title, text, known, figures(known))


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


def paper_axes(columns: int = 1, wide: bool = False, rows: int = 1) -> tuple[Any, np.ndarray]:
    """A figure of one column's width, or of two where it is `wide`, and its axes, flat."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(
        {"font.size": LETTERS, "axes.labelsize": LETTERS, "legend.fontsize": LETTERS,
         "axes.titlesize": LETTERS, "lines.linewidth": 1.1, "lines.markersize": 3.2,
         "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6}
    )  # fmt: skip
    size = (COLUMN * (2 if wide else 1), HEIGHT * rows)
    figure = Figure(figsize=size, layout="constrained")
    return figure, np.ravel(figure.subplots(rows, columns))


def label_lines(ax: Any, lines: Sequence[Line], styles: Sequence[str] = ()) -> None:
    """Draw at most eight lines on logarithmic axes, the rest grey, with the name of each beside its
    right end.

    Names that would meet are moved apart upwards. A style such as "o--" is that of a family of
    lines.
    """
    ends = []
    for number, (name, x, y) in enumerate(lines):
        colour = COLOURS[number] if number < len(COLOURS) else GREY
        style = styles[number] if styles else "o-"
        order = np.argsort(x)
        across, up = np.asarray(x, dtype=float)[order], np.asarray(y, dtype=float)[order]
        ax.loglog(across, up, style, color=colour, mfc="white" if "--" in style else colour)
        shown = np.flatnonzero(up > 0)
        if number < len(COLOURS) and len(shown):
            ends.append((float(up[shown[-1]]), name, colour))
    low, high = ax.get_ylim()
    height = float(ax.figure.get_figheight() / max(1, ax.get_gridspec().nrows)) * 72 * 0.75
    step = np.log(high / low) * 1.25 * LETTERS / height
    ends.sort()
    places = np.log([end[0] for end in ends])
    for i in range(1, len(places)):
        places[i] = max(places[i], places[i - 1] + step)
    over = max(0.0, places[-1] - np.log(high)) if len(places) else 0.0
    for i in range(len(places) - 1, -1, -1):  # push back down those that left the axes at the top
        top = np.log(high) if i == len(places) - 1 else places[i + 1] - step
        places[i] = min(places[i], top) if over else places[i]
    for place, (_, name, colour) in zip(places, ends):
        where = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        look = {"color": colour, "va": "center", "fontsize": LETTERS}
        ax.annotate(name, (1.0, float(np.exp(place))), (3, 0), **where, **look)
