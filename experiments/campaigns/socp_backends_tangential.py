"""Findings of the report, computed from its table."""

from __future__ import annotations

from contactopt.benchmark.tables import select, time_table, told

ASKED = ["low", "mid", "high"]


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    return told(table, backends, own_methods, times)


def backends(table) -> str:  # type: ignore[no-untyped-def]
    asked = select(table, setting=ASKED)
    raw, exact = (select(asked, **{"method.exact": value}) for value in (False, True))
    kept = raw.groupby("method.backend")["success"].mean()
    return (
        "Answers of the conic backends as they come reach the tolerance asked for in"
        f" {100 * raw['success'].mean():.0f} % of {len(raw)} runs ("
        + ", ".join(f"{name} {100 * share:.0f} %" for name, share in kept.items())
        + f"). With active-set steps they keep it in {100 * exact['success'].mean():.0f} %."
    )


def own_methods(table) -> str:  # type: ignore[no-untyped-def]
    asked = select(table, setting=ASKED)
    own = select(asked, name=sorted({*asked["name"]} - {"friction_socp"}))
    failed = own[~own["success"]].groupby(["method", "status"]).size()
    failures = ", ".join(f"{n} of `{name}` ({status})" for (name, status), n in failed.items())
    return (
        "Projection and Newton methods on the same problems keep it in"
        f" {100 * own['success'].mean():.0f} % of {len(own)} runs. Failures:"
        f" {failures or 'none'}."
    )


def times(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, setting="mid")
    select(rows, name="friction_socp")
    mid = time_table(rows, metric="cpu_seconds").sort_values("shifted mean")
    cone = mid[mid["method"].str.startswith("friction_socp")].iloc[0]
    return (
        f"At 1e-6 `{mid.iloc[0]['method']}` has the smallest shifted geometric mean CPU time"
        f" ({1e3 * mid.iloc[0]['shifted mean']:.2g} ms). The best use of a conic backend is"
        f" `{cone['method']}`. It takes {cone['over the least']:.0f} times as long, with"
        " cvxpy's compilation."
    )
