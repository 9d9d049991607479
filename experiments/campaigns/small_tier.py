"""Findings of the report, computed from its table."""

from __future__ import annotations

import numpy as np

from contactopt.benchmark.ranking import (
    SHIFT,
    achieved,
    agreement,
    points,
    ranking,
    reruns,
    unranked,
)
from contactopt.benchmark.tables import select, told
from contactopt.errors import InputError

ACCURACY = 1e-6
PEERS = ("siconos", "pinocchio")


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    count = f"The table holds the runs on {table['problem'].nunique()} problems of the set."
    why = unranked(table)
    found = told(table, leaders, repeats, others)
    return [count, *found[:-1], *([why] if why else []), found[-1]]


def leaders(table) -> str:  # type: ignore[no-untyped-def]
    select(table, method="auto")
    leaders = ranking(points(table), ACCURACY).set_index("method")
    if "auto" not in leaders.index or not leaders.loc["auto", "of"] > 0:
        return "No solver reached the certificate 1e-6 on a problem that all of them take."
    auto = leaders.loc["auto"]
    least = f"{auto['over the least']:.2g}"
    return (
        f"`auto` reaches the certificate 1e-6 on {int(auto['solved'])} of the {int(auto['of'])}"
        f" problems that all {len(leaders)} solvers take and some solver solves."
    ) + ("" if unranked(table) else f" Its mean CPU time over them is {least} times the least.")


def repeats(table) -> str:  # type: ignore[no-untyped-def]
    tau = agreement(*map(points, reruns(table)), ACCURACY)
    if not np.isfinite(tau):
        raise InputError("an order needs two solvers, each with even and odd repeats.")
    return f"Kendall's tau between the orders of the even and of the odd repeats is {tau:.2f}."


def others(table) -> str:  # type: ignore[no-untyped-def]
    free = select(table, plates=0)
    select(free, method="auto")
    found = points(free)
    seconds = achieved(found, ACCURACY)
    best = seconds[[name for name in seconds if name.startswith(PEERS)]].min(axis=1)
    both = seconds[np.isfinite(best)]
    if not len(both):
        return "No solver of others was there, or none solved a problem."
    own, best = both["auto"].clip(upper=float(found["limit"].max())), best[both.index]
    ratio = np.exp(np.log(own + SHIFT).mean()) / np.exp(np.log(best + SHIFT).mean())
    within = float((own <= best).mean())
    return (
        f"On the {len(seconds)} problems without plates, Siconos and Pinocchio together reach 1e-6"
        f" on {len(both)} and `auto` on {int(np.isfinite(seconds['auto']).sum())}. On these"
        f" {len(both)}, the shifted geometric mean of the CPU time of `auto` is {ratio:.2g} times"
        " that of the best solver of others for each problem. `auto` is at least as fast as this"
        f" solver on {100 * within:.0f} %, and at most {float((own / best).max()):.0f} times as"
        " slow."
    )
