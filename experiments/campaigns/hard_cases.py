"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np

from contactopt.benchmark.tables import select, told


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    return told(table, units, copies, compressibility)


def units(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, family="in_units")
    counts = rows.groupby("method")["iterations"].nunique()
    force, length = (
        round(np.log10(rows[name].max() / rows[name].min()))
        for name in ("problem.force", "problem.length")
    )
    varying = counts[counts > 1].index.tolist()
    return (
        f"Units: {_share(rows)} runs are certified over {force} decades of force and"
        f" {length} of length. The number of iterations is the same in all of them for"
        f" {len(counts) - len(varying)} of {len(counts)} methods"
        + (f" (not for {', '.join(f'`{m}`' for m in varying)})." if varying else ".")
    )


def copies(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, family="redundant")
    return (
        f"Redundant contacts: {_share(rows)} runs are certified, up to"
        f" {rows['problem.copies'].max():.0f} copies. Failures: {_failures(rows)}."
    )


def compressibility(table) -> str:  # type: ignore[no-untyped-def]
    rows = select(table, family="punch-2d")
    return (
        f"Towards incompressibility {_share(rows)} runs are certified, and the largest Poisson's"
        f" ratio is {rows['problem.upper_nu'].max():g}. Failures: {_failures(rows)}."
    )


def _share(rows) -> str:  # type: ignore[no-untyped-def]
    return f"{int(rows['success'].sum())} of {len(rows)}"


def _failures(rows) -> str:  # type: ignore[no-untyped-def]
    failed = rows[~rows["success"]].groupby(["method", "status"]).size()
    return (
        ", ".join(f"{n} of `{name}` ({status})" for (name, status), n in failed.items()) or "none"
    )
