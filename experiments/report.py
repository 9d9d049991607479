"""What every experiment writes: reports/NAME/report.md, its table as CSV with the environment, its
figures.
"""

from __future__ import annotations

import csv
import os
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

REPORTS = Path(__file__).parents[1] / "reports"
PAPER = ("punch-2d", "punch-3d", "sphere")  # the paper's scenes
PACKAGES = ("numpy", "scipy", "scikit-fem", "qpsolvers", "cvxpy", "clarabel", "proxsuite", "osqp")


def environment() -> str:
    """Python, packages and machine, in one line."""
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return (
        f"Python {platform.python_version()}, {packages}; {platform.machine()}, {os.cpu_count()}"
        " cores"
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
        with open(folder / f"{stem}.csv", "w", newline="") as file:
            file.write(f"# {environment()}\n")
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    for stem, figure in figures.items():
        figure.savefig(folder / f"{stem}.png", dpi=120)
    body = text.format(**{stem: markdown(rows) for stem, rows in tables.items()})
    path = folder / "report.md"
    pictures = "\n\n".join(f"![{stem}]({stem}.png)" for stem in figures)
    foot = f"Made by `python -m experiments.questions.{name}`.\nEnvironment: {environment()}."
    path.write_text(f"# {title}\n\n{body}\n\n{pictures}\n\n{foot}\n".replace("\n\n\n\n", "\n\n"))
    print(path.read_text())


def merged(
    name: str, table: str, rows: list[dict[str, Any]], keys: tuple[str, ...]
) -> list[dict[str, Any]]:
    """The committed table of an experiment with these rows in place of those that have the same
    values of `keys`.
    """
    path = REPORTS / name / f"{table}.csv"
    if not path.exists():
        return rows
    with open(path, newline="") as file:
        old = list(csv.DictReader(line for line in file if not line.startswith("#")))
    new = {tuple(str(row[key]) for key in keys): row for row in rows}
    kept = [{key: number(value) for key, value in row.items()} for row in old]
    return [new.pop(tuple(str(row[key]) for key in keys), row) for row in kept] + list(new.values())


def number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text
