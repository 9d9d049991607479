"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    units, copies, nu = (
        table[table["family"] == name] for name in ("in_units", "redundant", "punch-2d")
    )
    counts = units.groupby("method")["iterations"].nunique()
    decades = [
        round(np.log10(units[c].max() / units[c].min()))
        for c in ("problem.force", "problem.length")
    ]
    varying = counts[counts > 1].index.tolist()
    return [
        f"Units: {_share(units)} runs are certified over {decades[0]} decades of force and"
        f" {decades[1]} of length. The number of iterations is the same in all of them for"
        f" {len(counts) - len(varying)} of {len(counts)} methods"
        + (f" (not for {', '.join(f'`{m}`' for m in varying)})." if varying else "."),
        (
            f"Redundant contacts: {_share(copies)} runs are certified, up to"
            f" {copies['problem.copies'].max():.0f} copies. Failures: {_failures(copies)}."
        ),
        (
            f"Towards incompressibility {_share(nu)} runs are certified, and the largest Poisson's"
            f" ratio is {nu['problem.upper_nu'].max():g}. Failures: {_failures(nu)}."
        ),
    ]


def _share(rows) -> str:  # type: ignore[no-untyped-def]
    return f"{int(rows['success'].sum())} of {len(rows)}"


def _failures(rows) -> str:  # type: ignore[no-untyped-def]
    failed = rows[~rows["success"]].groupby(["method", "status"]).size()
    return (
        ", ".join(f"{n} of `{name}` ({status})" for (name, status), n in failed.items()) or "none"
    )
