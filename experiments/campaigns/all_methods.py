"""Findings of the report, computed from its table."""

from __future__ import annotations

from contactopt.benchmark.tables import time_table


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    kept = table.groupby("method")["success"].mean().sort_values(ascending=False)
    every = kept[kept == 1.0].index.tolist()
    overall = time_table(table.assign(setting="all"), metric="cpu_seconds").sort_values(
        "shifted mean"
    )
    both = table[table["success"]].pivot_table(
        index=["problem", "setting", "method"], columns="start", values=["iterations"]
    )
    ratio = (
        (both["iterations"]["warm"] / both["iterations"]["cold"])
        .groupby("method")
        .median()
        .dropna()
    )
    worst = kept[kept < 0.75]
    return [
        f"Of {kept.size} methods on {table['problem'].nunique()} problems,"
        f" {_names(every) or 'none'} certified every run. "
        + "Fewer than three quarters of their runs were certified with: "
        + (", ".join(f"`{m}` ({100 * s:.0f} %)" for m, s in worst.items()) or "none")
        + ".",
        (
            "A failure counts as the time limit. The least shifted geometric mean CPU time is that"
            f" of `{overall.iloc[0]['method']}` ({1e3 * overall.iloc[0]['shifted mean']:.2g} ms)."
            f" Then follow `{overall.iloc[1]['method']}` ({overall.iloc[1]['over the least']:.1f}"
            f" times) and `{overall.iloc[2]['method']}`"
            f" ({overall.iloc[2]['over the least']:.1f} times)."
        ),
        "A warm start from nine tenths of load and friction changes the median number of iterations"
        " by the factors "
        + ", ".join(f"{value:.2g} (`{name}`)" for name, value in ratio.sort_values().items())
        + ".",
    ]


def _names(names) -> str:  # type: ignore[no-untyped-def]
    return ", ".join(f"`{name}`" for name in names)
