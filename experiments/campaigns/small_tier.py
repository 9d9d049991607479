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
PEERS = ("siconos", "pinocchio", "cone")
FEW = 3  # sequences below which a method's two starts are not compared


def findings(table) -> list[str]:  # type: ignore[no-untyped-def]
    alone, along = table[table["states"] == 1], table[table["states"] > 1]
    found = [
        f"The table holds runs of {table['method'].nunique()} solvers on"
        f" {alone['problem'].nunique()} problems and on {along['problem'].nunique()} runs along"
        " sequences."
    ]
    found += told(alone, leaders, repeats)
    found += [why] if (why := unranked(table)) else []
    found += told(alone[alone["plates"] == 0], plane, space)
    return found + told(along, starts) + told(table, bridges)


def leaders(table) -> str:  # type: ignore[no-untyped-def]
    select(table, method="auto")
    leaders = ranking(points(table), ACCURACY).set_index("method")
    if "auto" not in leaders.index or not leaders.loc["auto", "solved"] > 0:
        return "`auto` reached the certificate 1e-6 on no problem that all solvers take."
    auto = leaders.loc["auto"]
    over = auto["over the least"]
    least = f"{over:.2g} times the smallest" if over > 1 else "the smallest of all"
    return (
        f"`auto` reaches the certificate 1e-6 on {int(auto['solved'])} of the {int(auto['of'])}"
        f" problems that all {len(leaders)} solvers take and some solver solves."
    ) + ("" if unranked(table) else f" Its mean CPU time over them is {least}.")


def repeats(table) -> str:  # type: ignore[no-untyped-def]
    part, other = reruns(table)
    tau = agreement(points(part), points(other), ACCURACY) if len(part) else np.nan
    if not np.isfinite(tau):
        raise InputError("an order needs two solvers, each with even and odd repeats.")
    return (
        f"{part['problem'].nunique()} problems were run twice. Kendall's tau between the orders of"
        f" the first and of the second run is {tau:.2f}."
    )


def plane(table) -> str:  # type: ignore[no-untyped-def]
    return others(select(table, dim=2), "in the plane")


def space(table) -> str:  # type: ignore[no-untyped-def]
    return others(select(table, dim=3), "in space")


def others(table, where: str) -> str:  # type: ignore[no-untyped-def]
    select(table, method="auto")
    found = points(table)
    seconds = achieved(found, ACCURACY)
    peers = seconds[[name for name in seconds if name.startswith(PEERS)]]
    if peers.empty or not np.isfinite(peers).any(axis=None):
        return f"No external solver was there, or none solved a problem {where}."
    both = seconds[np.isfinite(peers.min(axis=1))]
    own = both["auto"].clip(upper=float(found["limit"].max()))
    solved = np.isfinite(peers).sum()
    one = str(solved.index[np.lexsort((mean_of(peers, found), -solved))[0]])
    best, alone = peers.min(axis=1)[both.index], both[one].clip(upper=float(found["limit"].max()))
    return (
        f"On the {len(seconds)} problems {where} without plates, the external solvers together"
        f" reach 1e-6 on {len(both)}, `{one}` alone on {int(solved[one])}, and `auto` on"
        f" {int(np.isfinite(seconds['auto']).sum())}. On these {len(both)}, the shifted geometric"
        f" mean of the CPU time of `auto` is {ratio(own, best, SHIFT):.2g} times that of the best"
        f" external solver of each problem (the geometric mean {ratio(own, best, 0.0):.2g} times),"
        f" and {ratio(own, alone, SHIFT):.2g} times that of `{one}`. `auto` is at most 1.2 times as"
        f" slow as the best of them on {100 * float((own <= 1.2 * best).mean()):.0f} %, and at"
        f" most {float((own / best).max()):.0f} times as slow."
    )


def mean_of(seconds, found):  # type: ignore[no-untyped-def]
    return np.log(seconds.clip(upper=float(found["limit"].max())) + SHIFT).mean()


def ratio(one, other, shift: float) -> float:  # type: ignore[no-untyped-def]
    return float(np.exp((np.log(one + shift) - np.log(other + shift)).mean()))


def starts(table) -> list[str]:  # type: ignore[no-untyped-def]
    """How the time of a sequence changes if each state starts from the last answer."""
    found = achieved(points(select(table)), ACCURACY)
    warm = found.index.str.contains("warm=True")
    hot, cold = found[warm], found[~warm]
    cold.index = cold.index.str.replace("warm=False", "warm=True")
    hot, cold = hot.align(cold, join="inner")
    if hot.empty:
        raise InputError("no sequence was run from both.")
    both = np.isfinite(hot) & np.isfinite(cold)
    ratios = {
        m: ratio(hot.loc[both[m], m], cold.loc[both[m], m], 0.0)
        for m in hot
        if both[m].sum() >= FEW
    }
    solved = {m: (int(np.isfinite(cold[m]).sum()), int(np.isfinite(hot[m]).sum())) for m in hot}
    first = sorted(ratios, key=lambda m: (-sum(solved[m]), ratios[m]))[:8]
    said = ", ".join(
        f"`{m}` {solved[m][0]} and {solved[m][1]}, {ratios[m]:.2f} times" for m in first
    )
    return [
        f"{len(hot)} sequences were run from cold and from the last answers. Solvers by the number"
        " of sequences whose states all reach 1e-6, from cold and from the last answers, and the"
        f" time from the last answers over that from cold, a geometric mean: {said}."
    ]


def bridges(table) -> str:  # type: ignore[no-untyped-def]
    rows = table[table["bridge_seconds"].notna() & (table["states"] == 1)]
    if rows.empty:
        raise InputError("no external solver was there.")
    share = (rows["bridge_seconds"] / rows["call_seconds"]).median()
    middle = 1e3 * rows["bridge_seconds"].median()
    return (
        f"To bring a problem to an external solver and its answer back takes {middle:.2g} ms in the"
        f" median, {share:.2g} times the time of the solver. This is not counted."
    )
