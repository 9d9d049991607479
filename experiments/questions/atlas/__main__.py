"""Two commands. `python -m experiments.questions.atlas search [METHOD ...]` searches each method
for 100 s more, about an hour on one core for all, and writes the tables; `thresholds` measures only
the tables of thresholds. Without such a word the figures and the report are made from the tables in
a minute. Siconos runs in the Python that has it, Pinocchio in that of the environment variable
PINOCCHIO.
"""

from __future__ import annotations

import json
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.cards import count
from contactopt.figures.style import save_figure
from experiments.questions.atlas import draw
from experiments.questions.atlas.frontiers import measured
from experiments.questions.atlas.problems import Case, run
from experiments.questions.atlas.search import KNOWN, NAMES, continued, cured
from experiments.report import REPORTS, environment, markdown, save, stored, template

Row = dict[str, Any]
FOLDER = REPORTS / "atlas"
WORDS = tomllib.loads(Path(__file__).with_name("methods.toml").read_text())
# what happens above the line of a figure
WORD = {"augmented_lagrangian": "crawls", "acary_cadoux": "cycles or crawls"}
WORD["apg"] = WORD["acary_cadoux"]


def failures() -> list[Row]:
    path = FOLDER / "failures.json"
    return json.loads(path.read_text())["failures"] if path.exists() else []


def record(found: Row) -> Row:
    """A row of the table of failures: the smallest problem, what happens, and what cures it."""
    name = found["method"]
    case = KNOWN.get(name) or (Case.of(found["case"]) if "case" in found else None)
    if case is None:
        return found
    end = run(name, case)
    apart = [run(name, case.without(i)).failed for i in range(len(case.q)) if len(case.q) > 1]
    row = found | {"what": end.what, "residual": float(end.residual), "contacts": len(case.q)}
    return row | {"smallest": not any(apart), "cures": cured(name, case), "case": case.numbers}


def searched(names: list[str]) -> None:
    """Search further, and write the table of failures."""
    rows = {row["method"]: row for row in failures()}
    for name in names:
        for row in continued(name, rows.get(name, {})):
            rows[name] = row
            keep([rows[n] for n in NAMES if n in rows])
        rows[name] = record(rows[name])
        print(name, rows[name].get("what"), flush=True)
        keep([rows[n] for n in NAMES if n in rows])


def thresholds() -> None:
    """Write the tables of thresholds."""
    seeds, plane = measured({name: KNOWN["nsgs"] for name in ("nsgs", "siconos NSGS")})
    save("atlas", "seeds", seeds)
    save("atlas", "frontiers", plane)


def keep(rows: list[Row]) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"environment": environment(), "failures": rows})
    (FOLDER / "failures.json").write_text(text.replace('{"method"', '\n{"method"') + "\n")


def drawn() -> None:
    """The figures and the report."""
    rows, plane, seeds = failures(), stored("atlas", "frontiers"), stored("atlas", "seeds")
    figures = {"agreement": draw.agreement(seeds), "overview": draw.overview(rows)}
    for row in rows:
        name = row["method"]
        own = [one for one in plane if one["method"] == name]
        if own and " " not in name:
            figures[name] = draw.frontier(own, WORD.get(name, "cycles"))
        elif " " not in name:
            figures[name] = draw.shares(row["tried"], row["failed"])
    for stem, figure in figures.items():
        for ending in ("png", "pdf"):
            save_figure(figure, FOLDER / f"{stem}.{ending}")
    (FOLDER / "report.md").write_text(report(rows, seeds))


def total(row: Row, key: str) -> int:
    return sum(n for kind, n in row[key].items() if kind in draw.KINDS)


def report(rows: list[Row], seeds: list[Row]) -> str:
    table = [
        {
            "method": f"`{row['method']}`",
            "contacts": row.get("contacts", "none found"),
            "friction": float(np.max(row["case"]["mu"])) if "case" in row else "",
            "what it does": row.get("what", ""),
            "certificate": row.get("residual", ""),
            "searched": total(row, "tried"),
            "failed": total(row, "failed"),
        }
        for row in rows
    ]
    ratios: dict[str, list[float]] = {}
    for row in seeds:
        ratios.setdefault(row["method"], []).append(row["observed"] / row["predicted"] - 1)
    errors = [
        {
            "method": f"`{name}`",
            "problems": len(all_of),
            "within 5 %": int(np.isfinite(all_of).sum()),
            "largest error of these [%]": float(100 * np.nanmax(np.abs(all_of))),
        }
        for name, all_of in ratios.items()
    ]
    lines = {row["method"] for row in stored("atlas", "frontiers")}
    parts = {
        "failures": markdown(table),
        "thresholds": markdown(errors),
        "sections": "\n\n".join(section(row, WORDS[row["method"]], lines) for row in rows),
        "environment": environment(),
        "own": sum(row.get("contacts", 9) <= 3 for row in rows if " " not in row["method"]),
        "hits": hits(seeds, False),
        "peers": hits(seeds, True),
        "auto": f"{total(rows[0], 'tried'):,}",
        "auto failed": total(rows[0], "failed"),
    }
    text = template(__file__)
    for key, value in parts.items():
        text = text.replace("{" + key + "}", str(value))
    return text


def hits(seeds: list[Row], peers: bool) -> str:
    """How many thresholds were observed near their prediction."""
    seen = [np.isfinite(row["observed"]) for row in seeds if (" " in row["method"]) == peers]
    return f"{int(sum(seen))} of {len(seen)}"


def section(row: Row, words: dict[str, Any], drawn: set[str]) -> str:
    """The paragraph of a method, with its figure: a threshold for those in `drawn`, else shares."""
    name = row["method"]
    lines = [f"### {name}", f"{words['iterates']} Threshold: {words['threshold']}."]
    if "case" in row:
        case = Case.of(row["case"])
        lines.append(
            f"The smallest failing problem has {numbers(case)} The method {row['what']}, and ends"
            f" with a certificate of {row['residual']:.1e}. {words['mechanism']}{taken(words)}"
        )
    elif failed := total(row, "failed"):
        again = "but not when these were run again"
        lines.append(f"It failed on {failed} of {total(row, 'tried')} searched problems, {again}.")
    else:
        lines.append(f"None of {total(row, 'tried'):,} searched problems makes it fail.")
    if " " not in name:
        told = f"Share of the problems on which `{name}` fails. Grey: no failure was found."
        if name in drawn:
            told = f"Where `{name}` begins to fail: predicted (line) and observed (points)."
        lines.append(f"![{name}]({name}.png)\n\n*{told}*")
    return "\n\n".join(lines)


def taken(words: dict[str, Any]) -> str:
    """What is taken away so that the method solves the problem."""
    settings = [f"`{key} = {value:g}`" for key, value in words.get("settings", {}).items()]
    cure = settings[0] if settings else words.get("cure")
    return f" Check: with {cure} the method solves this problem." if cure else ""


def numbers(case: Case) -> str:
    """The data of a problem, to copy."""

    def text(x: np.ndarray) -> str:
        return f"`{np.array2string(x, separator=', ', precision=6)}`".replace("\n", "")

    (k, dim), where = case.q.shape, {2: "the plane", 3: "three dimensions"}
    said = f"{count(k, 'contact')} in {where[dim]}, mu = {case.mu.max():g}, Q = {text(case.Q)}"
    said += f", q = {text(case.q)}"
    if len(case.s):
        said += f", a plate with V = {text(case.V.ravel())} and s = {text(case.s)}"
    if case.start is not None:
        said += f", begun at {text(case.start)}"
    return said + "."


if __name__ == "__main__":
    if sys.argv[1:2] == ["search"]:
        searched(sys.argv[2:] or NAMES)
    if sys.argv[1:] in (["search"], ["thresholds"]):
        thresholds()
    drawn()
