"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np

from contactopt.benchmark.report_figures import fitted_exponent
from contactopt.benchmark.tables import groups, select, time_table, told
from contactopt.errors import InputError

ASKED = ["low", "mid", "high"]


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    return told(table, claims, crossover, times)


def claims(table) -> str:  # type: ignore[no-untyped-def]
    raw = select(table, **{"method.exact": False})
    default, raw = select(raw, setting="default"), select(raw, setting=ASKED)
    shares = raw.groupby("method.backend").agg(
        claimed=("claimed", "mean"), kept=("success", "mean")
    )
    liars = shares[shares["claimed"] - shares["kept"] > 0.05]
    return (
        f"A backend's word is not enough. Of {len(raw)} answers taken as they come at settings"
        f" 1e-3 to 1e-9, {100 * raw['success'].mean():.0f} % reach the tolerance that was asked"
        f" for. {len(liars)} of {len(shares)} backends claim more than the certificate confirms"
        f" ({', '.join(sorted(liars.index)) or 'none'}). At default settings the median"
        f" residual over all backends is {default['residual'].median():.0e}."
    )


def crossover(table) -> str:  # type: ignore[no-untyped-def]
    asked = select(table, setting=ASKED)
    raw, exact = (select(asked, **{"method.exact": value}) for value in (False, True))
    cost = (
        _medians(select(exact, success=True)) / _medians(select(raw, claimed=True))
    ).dropna()  # fmt: skip
    if not len(cost):
        raise InputError("no problem is solved both as it comes and with active-set steps.")
    return (
        f"A crossover mends this. With active-set steps {100 * exact['success'].mean():.0f} %"
        f" of {len(exact)} runs reach the tolerance, and the median residual is"
        f" {exact['residual'].median():.0e}. This changes the CPU time by"
        f" {100 * (cost.median() - 1):+.0f} % (median over sizes, all backends together)."
    )


def _medians(rows):  # type: ignore[no-untyped-def]
    return rows.groupby("problem")["cpu_seconds"].median()


def times(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, setting="mid")
    mid = time_table(rows, metric="cpu_seconds").sort_values("shifted mean")
    fastest, others, own = mid.iloc[0], mid[mid["method"] != "auto"], mid[mid["method"] == "auto"]
    sentences = [
        f"At 1e-6 the smallest shifted geometric mean CPU time is that of `{fastest['method']}`"
        f" ({1e3 * fastest['shifted mean']:.2g} ms)."
    ]
    if len(others) and others.iloc[0]["method"] != fastest["method"]:
        sentences.append(
            f"The best backend, `{others.iloc[0]['method']}`, takes"
            f" {others.iloc[0]['over the least']:.1f} times as long."
        )
    elif len(own):
        sentences.append(f"`auto` takes {own.iloc[0]['over the least']:.1f} times as long.")
    solved = groups(rows[rows["success"]], "method")
    powers = [p for _, found in solved if np.isfinite(p := _power(found))]
    if powers:
        sentences.append(
            f"Times grow with a power of the size between {min(powers):.1f} and"
            f" {max(powers):.1f} (larger half of the sizes)."
        )
    return " ".join(sentences)


def _power(rows) -> float:  # type: ignore[no-untyped-def]
    medians = rows.groupby("contacts")["cpu_seconds"].median()
    return fitted_exponent(medians.index.to_numpy(float), medians.to_numpy())
