"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np

from contactopt.benchmark.report_figures import fitted_exponent
from contactopt.benchmark.tables import groups, time_table


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    asked = table[table["setting"].isin(["low", "mid", "high"])]
    raw, exact = (asked[asked["method.exact"] == value] for value in (False, True))
    default = table[(table["setting"] == "default") & (table["method.exact"] == False)]  # noqa: E712
    claims = raw.groupby("method.backend").agg(
        claimed=("claimed", "mean"), kept=("success", "mean")
    )
    liars = claims[claims["claimed"] - claims["kept"] > 0.05]
    cost = (
        exact[exact["success"]].groupby("problem")["cpu_seconds"].median()
        / raw[raw["claimed"]].groupby("problem")["cpu_seconds"].median()
    )
    mid = time_table(asked[asked["setting"] == "mid"], metric="cpu_seconds")
    fastest = mid.sort_values("shifted mean").iloc[0]
    other = mid[mid["method"] != "auto"].sort_values("shifted mean").iloc[0]
    own = mid[mid["method"] == "auto"]
    solved = asked[asked["success"] & (asked["setting"] == "mid")]
    powers = [p for _, rows in groups(solved, "method") if np.isfinite(p := _power(rows))]
    return [
        (
            f"A backend's word is not enough. Of {len(raw)} answers taken as they come at settings"
            f" 1e-3 to 1e-9, {100 * raw['success'].mean():.0f} % keep the tolerance that was asked"
            f" for. {len(liars)} of {len(claims)} backends claim more than the certificate confirms"
            f" ({', '.join(sorted(liars.index)) or 'none'}). At default settings the median"
            f" residual over all backends is {default['residual'].median():.0e}."
        ),
        (
            f"A crossover mends this. With active-set steps {100 * exact['success'].mean():.0f} %"
            f" of {len(exact)} runs keep the tolerance, and the median residual is"
            f" {exact['residual'].median():.0e}. This changes the CPU time by"
            f" {100 * (cost.median() - 1):+.0f} % (median over sizes, all backends together)."
        ),
        f"At 1e-6 the least shifted geometric mean CPU time is that of `{fastest['method']}` "
        f"({1e3 * fastest['shifted mean']:.2g} ms). "
        + (
            ""
            if other["method"] == fastest["method"]
            else (
                f"The best backend, `{other['method']}`, takes"
                f" {other['over the least']:.1f} times as long. "
            )
        )
        + ", ".join(
            f"`{row['method']}` takes {row['over the least']:.1f} times as long"
            for _, row in own.iterrows()
        )
        + f". Times grow with a power of the size between {min(powers):.1f} and {max(powers):.1f}"
        " (larger half of the sizes).",
    ]


def _power(rows) -> float:  # type: ignore[no-untyped-def]
    medians = rows.groupby("contacts")["cpu_seconds"].median()
    return fitted_exponent(medians.index.to_numpy(float), medians.to_numpy())
