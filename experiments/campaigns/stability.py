"""Findings of the report, computed from its table."""

from __future__ import annotations


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    elastic = table[table["family"] != "rigid_bodies"]
    rigid = table[table["family"] == "rigid_bodies"]
    alternating = elastic[elastic["name"] == "alternating"]
    below = alternating[alternating["problem.mu"] < alternating["guaranteed_mu"]]
    above = alternating[alternating["problem.mu"] >= alternating["alternating_mu"]]
    between = alternating.drop(below.index).drop(above.index)
    lowest = elastic[~elastic["success"]].groupby("method")["problem.mu"].min().sort_values()
    return [
        "Of their runs on elastic bodies the methods certify: "
        + _shares(elastic)
        + ". The least friction coefficient at which one fails: "
        + (", ".join(f"{mu:g} (`{name}`)" for name, mu in lowest.items()) or "none")
        + ".",
        (
            "The threshold that is known before solving holds, and is not sharp. Below it the"
            f" alternating iteration is certified in {_share(below)} runs. Between it and the upper"
            f" bound it is certified in {_share(between)} runs. Above that bound some load breaks"
            f" it. With the loads of these problems it is still certified in {_share(above)} runs."
        ),
        "Of their runs on rank-deficient rigid bodies the methods certify: " + _shares(rigid) + ".",
    ]


def _shares(rows) -> str:  # type: ignore[no-untyped-def]
    kept = rows.groupby("method")["success"].mean().sort_values(ascending=False)
    return ", ".join(f"`{name}` {100 * share:.0f} %" for name, share in kept.items())


def _share(rows) -> str:  # type: ignore[no-untyped-def]
    return f"{int(rows['success'].sum())} of {len(rows)}"
