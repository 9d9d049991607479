"""Findings of the report, computed from its table."""

from __future__ import annotations

from contactopt.benchmark.tables import time_table


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    asked = table[table["setting"].isin(["low", "mid", "high"])]
    raw, exact = (asked[asked["method.exact"] == value] for value in (False, True))
    own = asked[asked["name"] != "friction_socp"]
    kept = raw.groupby("method.backend")["success"].mean()
    mid = time_table(asked[asked["setting"] == "mid"], metric="cpu_seconds").sort_values(
        "shifted mean"
    )
    cone = mid[mid["method"].str.startswith("friction_socp")].iloc[0]
    return [
        "Answers of the conic backends as they come keep the tolerance asked for in"
        f" {100 * raw['success'].mean():.0f} % of {len(raw)} runs ("
        + ", ".join(f"{name} {100 * share:.0f} %" for name, share in kept.items())
        + f"). With active-set steps they keep it in {100 * exact['success'].mean():.0f} %.",
        (
            "Projection and Newton methods on the same problems keep it in"
            f" {100 * own['success'].mean():.0f} % of {len(own)} runs. Failures: {_failures(own)}."
        ),
        (
            f"At 1e-6 `{mid.iloc[0]['method']}` has the least shifted geometric mean CPU time"
            f" ({1e3 * mid.iloc[0]['shifted mean']:.2g} ms). The best use of a conic backend is"
            f" `{cone['method']}`. It takes {cone['over the least']:.0f} times as long, with"
            " cvxpy's compilation."
        ),
    ]


def _failures(rows) -> str:  # type: ignore[no-untyped-def]
    failed = rows[~rows["success"]].groupby(["method", "status"]).size()
    return (
        ", ".join(f"{n} of `{name}` ({status})" for (name, status), n in failed.items()) or "none"
    )
