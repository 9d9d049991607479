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
    wall_over_cpu,
    warning,
)

ACCURACY = 1e-6
PEERS = ("siconos", "pinocchio")


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    found = points(table)
    leaders = ranking(found, ACCURACY).set_index("method")
    auto = leaders.loc["auto"]
    told = [f"The table holds the runs on {table['problem'].nunique()} problems of the set."]
    if not auto["of"] > 0:
        return [*told, "No solver reached the certificate 1e-6 on any of them."]
    told += [
        f"`auto` reaches the certificate 1e-6 on {int(auto['solved'])} of the {int(auto['of'])}"
        f" problems that all {len(leaders)} solvers take and some solver solves. Its mean CPU time"
        f" over them is {auto['over the least']:.2g} times the least of them.",
        "Kendall's tau between the orders of the even and of the odd repeats is"
        f" {agreement(*map(points, reruns(table)), ACCURACY):.2f}.",
    ]
    told += [text for text in [warning(wall_over_cpu(table))] if text]
    free = found[found["problem"].isin(table.loc[table["plates"] == 0, "problem"])]
    seconds = achieved(free, ACCURACY)
    others = seconds[[name for name in seconds if name.startswith(PEERS)]]
    best = others.min(axis=1)
    both = seconds[np.isfinite(best)]
    if not len(both):
        return [*told, "No solver of others was there, or none solved a problem."]
    limit = float(free["limit"].max())
    own, best = both["auto"].clip(upper=limit), best[both.index]
    ratio = np.exp(np.log(own + SHIFT).mean()) / np.exp(np.log(best + SHIFT).mean())
    within = float((own <= best).mean())
    return [
        *told,
        f"On the {len(seconds)} problems without plates, Siconos and Pinocchio together reach 1e-6"
        f" on {len(both)} and `auto` on {int(np.isfinite(seconds['auto']).sum())}. On these"
        f" {len(both)}, the shifted geometric mean of the CPU time of `auto` is {ratio:.2g} times"
        " that of the best solver of others for each problem. `auto` is at least as fast as this"
        f" solver on {100 * within:.0f} %, and at most {float((own / best).max()):.0f} times as"
        " slow.",
    ]
