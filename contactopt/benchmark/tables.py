"""Tables of a report: f(table, ...) -> DataFrame; and the choice of rows that figures and tables
are made of.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

INSTANCE = ["problem", "setting", "start"]
SHIFT = 1e-3  # s, of shifted geometric means


def select(table: pd.DataFrame, law: str = "coulomb", **where: Any) -> pd.DataFrame:
    """Choose the rows of one law whose columns have given values.

    Parameters
    ----------
    table : The rows.
    law : The law; '' for all.
    where : For a column a value or a list of them; '' stands for no value.

    Returns
    -------
    The rows that are left, at least one.

    Raises
    ------
    InputError : On an unknown column, or if no row is left.
    """
    rows = table[table["law"] == law] if law else table
    for column, value in where.items():
        if column not in rows:
            raise InputError(f"the table has no column {column!r}.")
        values = list(value) if isinstance(value, list | tuple) else [value]
        rows = rows[rows[column].isin(values) | (rows[column].isna() & ("" in values))]
    if rows.empty:
        raise InputError(f"no row with law {law!r} and {where}.")
    return rows


def success_table(table: pd.DataFrame, by: str = "method", across: str = "setting") -> pd.DataFrame:
    """Count the runs that kept the tolerance, those with a right claim, and the ways of failing.

    Parameters
    ----------
    table : The rows.
    by : The column whose values have a row each.
    across : The column whose values have a column each.

    Returns
    -------
    Percentages and failures.
    """
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
    """Compute the shifted geometric mean of times, a failure counted at its time limit, with median
    and quartiles.

    With shift sh = 1 ms it is exp(mean(log(t + sh))) - sh. The last column is the median over
    instances of the spread (largest - least) / median of repeats.

    Parameters
    ----------
    table : The rows.
    metric : The column with the times [s].
    by, across : The columns whose values have a row each.

    Returns
    -------
    Times [s], and the mean over the least one.
    """
    import pandas as pd

    out = []
    for value, runs in groups(table, across):
        rows: list[dict[str, Any]] = []
        for name, r in groups(runs, by):
            times = r[metric].where(r["success"], r["time_limit"]).to_numpy(float)
            mean = float(np.exp(np.mean(np.log(times + SHIFT))) - SHIFT)
            solved = r.loc[r["success"], metric]
            low, mid, high = (
                (float(q) for q in solved.quantile([0.25, 0.5, 0.75]))
                if len(solved)
                else (np.nan,) * 3
            )
            repeats = (
                r[r["success"]]
                .groupby(INSTANCE)[metric]
                .agg(lambda t: (t.max() - t.min()) / t.median())
            )
            rows.append(
                {
                    across: value,
                    by: name,
                    "solved": f"{len(solved)} of {len(r)}",
                    "shifted mean": mean,
                }
            )
            rows[-1] |= {
                "median": mid,
                "quartiles": f"{low:.2g} to {high:.2g}",
                "spread of repeats": repeats.median(),
            }
        best = min(row["shifted mean"] for row in rows)
        out += [row | {"over the least": row["shifted mean"] / best} for row in rows]
    return pd.DataFrame(out)


def groups(table: pd.DataFrame, by: str) -> list[tuple[str, pd.DataFrame]]:
    """Split a table into groups, sorted by name; settings from the loosest to the tightest.

    Parameters
    ----------
    table : The rows.
    by : The column whose values are the names.

    Returns
    -------
    The name and the rows of each group.

    Raises
    ------
    InputError : If there is no such column.
    """
    if by not in table:
        raise InputError(f"the table has no column {by!r}.")
    found = [(str(name), rows) for name, rows in table.groupby(by, sort=True)]
    return sorted(found, key=lambda pair: -pair[1]["tolerance"].max()) if by == "setting" else found


TABLES: dict[str, Callable[..., Any]] = {f.__name__: f for f in (success_table, time_table)}
