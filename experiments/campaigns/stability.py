"""Findings of the report, computed from its table."""

from __future__ import annotations

from contactopt.benchmark.tables import select, told


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    return told(table, elastic, threshold, rigid)


def _elastic(table):  # type: ignore[no-untyped-def]
    return select(table, family=sorted({*table["family"]} - {"rigid_bodies"}))


def elastic(table) -> str:  # type: ignore[no-untyped-def]
    rows = _elastic(table)
    lowest = rows[~rows["success"]].groupby("method")["problem.mu"].min().sort_values()
    return (
        "Of their runs on elastic bodies the methods certify: "
        + _shares(rows)
        + ". The least friction coefficient at which one fails: "
        + (", ".join(f"{mu:g} (`{name}`)" for name, mu in lowest.items()) or "none")
        + "."
    )


def threshold(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(_elastic(table), name="alternating")
    below = rows[rows["problem.mu"] < rows["guaranteed_mu"]]
    above = rows[rows["problem.mu"] >= rows["alternating_mu"]]
    between = rows.drop(below.index).drop(above.index)
    return (
        "The threshold that is known before solving holds, and is not sharp. Below it the"
        f" alternating iteration is certified in {_share(below)} runs. Between it and the upper"
        f" bound it is certified in {_share(between)} runs. Above that bound some load breaks"
        f" it. With the loads of these problems it is still certified in {_share(above)} runs."
    )


def rigid(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, family="rigid_bodies")
    return f"Of their runs on rank-deficient rigid bodies the methods certify: {_shares(rows)}."


def _shares(rows) -> str:  # type: ignore[no-untyped-def]
    kept = rows.groupby("method")["success"].mean().sort_values(ascending=False)
    return ", ".join(f"`{name}` {100 * share:.0f} %" for name, share in kept.items())


def _share(rows) -> str:  # type: ignore[no-untyped-def]
    return f"{int(rows['success'].sum())} of {len(rows)}"
