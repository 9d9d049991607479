"""Tables of a report, and the choice of rows that figures and tables are made of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.benchmark.ranking import SHIFT, coverage_table, leader_table
from contactopt.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

INSTANCE = ["problem", "setting"]


def select(table: pd.DataFrame, **where: object) -> pd.DataFrame:
    """The rows whose columns have the values `where`; InputError if there are none."""
    rows = table
    for column, value in where.items():
        if column not in rows:
            raise InputError(f"the table has no column {column!r}.")
        values = list(value) if isinstance(value, list | tuple) else [value]
        rows = rows[rows[column].isin(values) | (rows[column].isna() & ("" in values))]
    if rows.empty:
        raise InputError(f"no row with {where}.")
    return rows


def told(
    table: pd.DataFrame, *findings: Callable[[pd.DataFrame], str | Sequence[str]]
) -> list[str]:
    """The sentences that functions find in a table, or a sentence for what the table lacks."""
    sentences: list[str] = []
    for finding in findings:
        try:
            found = finding(table)
        except InputError as error:
            found = f"The table lacks the runs for the finding `{finding.__name__}`: {error}"
        sentences += [found] if isinstance(found, str) else found
    return sentences


def success_table(table: pd.DataFrame, by: str = "method", across: str = "setting") -> pd.DataFrame:
    """Percent of runs that reached the tolerance, of right claims, and the ways of failing."""
    import pandas as pd

    groups(table, across)  # complains if there is no such column
    prefix = f"{across.rpartition('.')[2]} " if pd.api.types.is_numeric_dtype(table[across]) else ""
    rows = []
    for name, runs in groups(table, by):
        right = float((runs["claimed"] == runs["success"]).mean())
        failures = runs.loc[~runs["success"], "status"].value_counts()
        shares = {
            f"{prefix}{value} [%]": 100 * float(r["success"].mean())
            for value, r in groups(runs, across)
        }
        rows.append(
            {by: name, "runs": len(runs), **shares, "right claim [%]": 100 * right}
            | {"failures": ", ".join(f"{n} {status}" for status, n in failures.items())}
        )
    return pd.DataFrame(rows).fillna("")


def time_table(
    table: pd.DataFrame, metric: str = "solve_seconds", by: str = "method", across: str = "setting"
) -> pd.DataFrame:
    """The shifted geometric mean of the times [s] in a column, a failure counted at its time limit,
    with median and quartiles, and over the least mean.

    With shift sh = 1 ms it is exp(mean(log(t + sh))) - sh. The last but one column is the median
    over instances of the spread (largest - least) / median of repeats.
    """
    import pandas as pd

    out = []
    for value, runs in groups(table, across):
        rows: list[dict[str, Any]] = []
        for name, r in groups(runs, by):
            times = r[metric].where(r["success"], r["time_limit"]).to_numpy(float)
            solved = r[r["success"]]
            low, mid, high = map(float, solved[metric].quantile([0.25, 0.5, 0.75]))
            repeats = solved.groupby(INSTANCE)[metric].agg(
                lambda t: (t.max() - t.min()) / t.median()
            )
            rows.append(
                {
                    across: value,
                    by: name,
                    "solved": f"{len(solved)} of {len(r)}",
                    "shifted mean": float(np.exp(np.mean(np.log(times + SHIFT))) - SHIFT),
                    "median": mid,
                    "quartiles": f"{low:.2g} to {high:.2g}",
                    "spread of repeats": repeats.median(),
                }
            )
        best = min(row["shifted mean"] for row in rows)
        out += [row | {"over the least": row["shifted mean"] / best} for row in rows]
    return pd.DataFrame(out)


def groups(table: pd.DataFrame, by: str) -> list[tuple[str, pd.DataFrame]]:
    """The rows of each value of a column by name; settings go from loose to tight."""
    if by not in table:
        raise InputError(f"the table has no column {by!r}.")
    found = [(str(name), rows) for name, rows in table.groupby(by, sort=True)]
    return sorted(found, key=lambda pair: -pair[1]["tolerance"].max()) if by == "setting" else found


TABLES: dict[str, Callable[..., Any]] = {
    f.__name__: f for f in (leader_table, coverage_table, success_table, time_table)
}
