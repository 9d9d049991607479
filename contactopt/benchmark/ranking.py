"""Who is first: methods compared at the accuracy that they reach, not at the one asked for.

The runs of a method on a problem are points: median time and worst
certificate of the repeats, one for each tolerance. The time to an accuracy is read off their
front, straight in logarithms; what does not reach it counts as its time limit, and times below
NOISE count as NOISE. A problem that a method refuses at every tolerance is not applicable to it: no
failure, and nobody is ranked there. A ranking compares on the problems that all entrants take.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from contactopt.cards import count

if TYPE_CHECKING:
    import pandas as pd

SHIFT = 1e-3  # s, of shifted geometric means
# s: the CPU clock read twice without work between differs by 0.3 us, once in a thousand by 6 us
NOISE = 1e-6
BUSY = 1.2  # wall over CPU time above which a machine is too busy for a ranking
LEAST = 1e-17  # drawn and compared in place of a certificate of 0
RESAMPLES, BATCH, SEED = 2000, 100, 0
LIKELY = 2.5, 97.5  # percentiles of the ranks that bound an interval
POINT = ["problem", "method", "tolerance"]
REFUSED = "refused"  # status
# what is known of a point: (of the table's column, how the repeats are joined)
JOINED = {
    "cpu": ("cpu_seconds", "median"),
    "wall": ("call_seconds", "median"),
    "residual": ("residual", "max"),
    "claimed": ("claimed", "all"),
    "status": ("status", "last"),
    "refused": ("_refused", "all"),
    "limit": ("time_limit", "max"),
    "repeats": ("repeat", "count"),
}


def factors(table: pd.DataFrame) -> dict[str, tuple[float, str]]:
    """The factor by which the times of each other machine are divided, to compare them with those
    of the machine that has most rows, and how it was measured; nan where it is unknown.

    Runs that were made on both give the factor, a geometric mean. Without such runs it is the ratio
    of the calibrations, if the same methods ran on both.
    """
    if "machine" not in table or table["machine"].nunique() < 2:
        return {}
    first = str(table["machine"].value_counts(sort=True).index[0])
    of = {str(name): rows for name, rows in table.groupby("machine") if name}
    runs = {name: _times_of_runs(rows) for name, rows in of.items()}
    made = {}
    for name in (name for name in of if name != first):
        logs = np.log(runs[name] / runs[first]).dropna()
        speeds = [_calibration(of[one]) for one in (name, first)]
        if len(logs):
            by = np.exp(logs.groupby("name").mean())
            words = f"{count(len(logs), 'run')} made on both"
            words += f" ({by.min():.2f} to {by.max():.2f} by method)"
            made[name] = float(np.exp(logs.mean())), words
        elif set(of[name]["method"]) == set(of[first]["method"]):
            made[name] = speeds[0] / speeds[1], "the calibrations, since no run was made on both"
        else:
            made[name] = np.nan, ""
    return made


def _times_of_runs(table: pd.DataFrame) -> pd.Series[float]:
    """The median CPU time of each run that succeeded; of none where the table does not say."""
    import pandas as pd

    keys = ["problem", "name", "settings", "tolerance"]
    if not {*keys, "success", "cpu_seconds"} <= {*table}:
        return pd.Series(dtype=float, index=pd.MultiIndex.from_arrays([[]] * 4, names=keys))
    return table[table["success"]].groupby(keys)["cpu_seconds"].median().clip(lower=NOISE)


def _calibration(table: pd.DataFrame) -> float:
    return float(table["calibration"].median()) if "calibration" in table else np.nan


def machines_said(table: pd.DataFrame) -> list[str]:
    """A sentence about each machine whose times were made comparable, or not."""
    return [
        f"Times on {name} are divided by {factor:.3g}, measured by {words}."
        if np.isfinite(factor)
        else f"No factor is known between {name} and the machine of most rows, since neither a run"
        " nor all methods are common to both: nothing is ranked."
        for name, (factor, words) in factors(table).items()
    ]


def unranked(table: pd.DataFrame) -> str:
    """Why nothing is ranked; '' where something is."""
    unknown = any(np.isnan(factor) for factor, _ in factors(table).values())
    said = machines_said(table) if unknown else []
    return " ".join([*filter(None, [warning(wall_over_cpu(table))]), *said])


def points(table: pd.DataFrame) -> pd.DataFrame:
    """A row per problem, method and tolerance: times [s] as on the machine of most rows, worst
    certificate, memory.

    `counted` is CPU time, or wall time where that is above BUSY times CPU time: the method slept,
    or let somebody else compute.
    """
    if known := {name: by for name, (by, _) in factors(table).items() if np.isfinite(by)}:
        by = table["machine"].map(known).fillna(1.0)
        table = table.assign(**{t: table[t] / by for t in ("cpu_seconds", "call_seconds")})
    memory = table["peak_mb"] - table["base_mb"] if "base_mb" in table else table["peak_mb"]
    joined = JOINED | {"memory": ("_memory", "max")}
    refused = table["status"] == REFUSED
    groups = table.assign(_memory=memory, _refused=refused).groupby(POINT, sort=False)
    times = groups["cpu_seconds"]
    found = groups.agg(**joined)
    found["bridge"] = groups["bridge_seconds"].median() if "bridge_seconds" in table else np.nan
    found = found.assign(low=times.quantile(0.25), high=times.quantile(0.75))
    elsewhere = (found["wall"] > np.maximum(BUSY * found["cpu"], NOISE)) & ~found["refused"]
    found["counted"] = found["cpu"].where(~elsewhere, found["wall"])
    return found.reset_index()


def taken(points: pd.DataFrame) -> pd.DataFrame:
    """Whether a method takes a problem (problem, method): False where it refused every run."""
    refused = points.groupby(["problem", "method"], sort=False)["refused"].all()
    return ~refused.unstack("method", fill_value=False).astype(bool)


def comparable(points: pd.DataFrame) -> pd.DataFrame:
    """The points of the entrants on the problems that all take; a missing row is a failure."""
    takes = taken(points)
    takes = takes.loc[:, takes.any()]
    common = takes.index[takes.all(axis=1)]
    return points[points["problem"].isin(common) & points["method"].isin(takes.columns)]


def achieved(points: pd.DataFrame, accuracy: float, time: str = "cpu") -> pd.DataFrame:
    """Seconds to a certificate of `accuracy` (problem, method), inf if not reached."""
    import pandas as pd

    if points.empty:
        return pd.DataFrame(dtype=float)
    column = "counted" if time == "cpu" else time
    fronts = points.groupby(["problem", "method"], sort=False)[[column, "residual", "limit"]]
    seconds = fronts.apply(lambda rows: _seconds_to(accuracy, *rows.to_numpy(float).T))
    return seconds.unstack("method").fillna(np.inf)


def _seconds_to(
    accuracy: float, seconds: np.ndarray, residuals: np.ndarray, limit: np.ndarray
) -> float:
    """The time to an accuracy on the front of points that no other point dominates."""
    kept = (seconds <= limit) & np.isfinite(residuals)
    t, e = np.maximum(seconds[kept], NOISE), np.maximum(residuals[kept], LEAST)
    order = np.lexsort((t, e))
    t, e = t[order], e[order]
    best = np.concatenate([[np.inf], np.minimum.accumulate(t)])[:-1]
    t, e = t[t < best], e[t < best]  # from the most accurate and slowest on
    if not len(e) or e[0] > accuracy:
        return np.inf
    return float(np.exp(np.interp(np.log(accuracy), np.log(e), np.log(t))))


def ranking(points: pd.DataFrame, accuracy: float) -> pd.DataFrame:
    """The leader table at an accuracy: a row for each method that takes a problem, best first.

    Compared are the problems that all these methods take. `mean` and `wall mean` are shifted
    geometric means (1 ms) of CPU and wall time [s] over those of them that somebody solved, a
    failure counted at its limit. `bridge` is the median of the time [s] that the call of an
    external solver takes besides the solver's own. `rank` is that of `mean`; `best` and `worst`
    bound it in 95 % of the bootstrap samples of the problems. `taken` problems out of `problems`
    are not refused by the method. `over claim` is the median of the certificate over the tolerance
    of claimed successes.
    """
    import pandas as pd

    takes, shared = taken(points), comparable(points)
    methods = takes.columns[takes.any()]
    logs, solved = (made.reindex(columns=methods) for made in _logs(shared, accuracy))
    low, high = _rank_interval(logs.to_numpy(float))
    claims = shared[shared["claimed"] & np.isfinite(shared["residual"])]
    means, wall = (mean_times(points, accuracy, time).reindex(methods) for time in ("cpu", "wall"))
    columns = {
        "solved": solved.sum().astype(int),
        "of": len(logs),
        "taken": takes[methods].sum(),
        "problems": len(takes),
        "mean": means,
        "over the least": means / means.min(),
        "wall mean": wall,
        "bridge": shared.groupby("method")["bridge"].median().reindex(methods),
        "memory": shared.groupby("method")["memory"].max().reindex(methods),
        "over claim": (claims["residual"] / claims["tolerance"]).groupby(claims["method"]).median(),
        "rank": means.rank(method="min", na_option="bottom").astype(int),
        "best": low,
        "worst": high,
    }
    made = pd.DataFrame(columns, index=methods).rename_axis("method").reset_index()
    return made.sort_values(["rank", "method"], ignore_index=True)


def leader_table(table: pd.DataFrame, accuracy: float = 1e-6) -> pd.DataFrame:
    """The leader table at a certificate; by names alone where machines were busy or differ."""
    found = ranking(points(table), accuracy)
    shown = {
        "method": found["method"],
        "solved": [f"{n} of {all_}" for n, all_ in zip(found["solved"], found["of"])],
        "takes": [f"{n} of {all_}" for n, all_ in zip(found["taken"], found["problems"])],
        "CPU [s]": found["mean"],
        "wall [s]": found["wall mean"],
        "bridge [s]": [f"{s:.3g}" if np.isfinite(s) else "" for s in found["bridge"]],
        "memory [MB]": found["memory"],
        "certificate / asked": found["over claim"],
    }
    if found["bridge"].isna().all():
        del shown["bridge [s]"]
    if unranked(table):
        return found.assign(**shown)[list(shown)].sort_values("method", ignore_index=True)
    bounds = zip(found["rank"], found["best"], found["worst"])
    rank = {"rank (95 %)": [f"{n} ({low} to {high})" for n, low, high in bounds]}
    shown = rank | shown | {"over the least": found["over the least"]}
    return found.assign(**shown)[list(shown)]


def coverage_table(table: pd.DataFrame, accuracy: float = 1e-6) -> pd.DataFrame:
    """Which problems a method takes, how many it solves, and what it says of the others most."""
    import pandas as pd

    found = points(table)
    takes = taken(found)
    solved = np.isfinite(achieved(found, accuracy)).reindex_like(takes)
    refused = table[table["status"] == REFUSED]
    why = refused.fillna({"message": ""}).groupby("method")["message"].agg(lambda m: m.mode()[0])
    made = pd.DataFrame({"taken": takes.sum(), "reached": solved.sum()}).sort_values(
        ["taken", "reached"], ascending=False, kind="stable"
    )
    shown = {
        "method": made.index,
        "takes": [f"{n} of {len(takes)}" for n in made["taken"]],
        "solved of these": [f"{n} of {all_}" for n, all_ in zip(made["reached"], made["taken"])],
        "says of the others": why.where(~takes.all()).reindex(made.index).fillna(""),
    }
    return pd.DataFrame(shown).reset_index(drop=True)


def mean_times(points: pd.DataFrame, accuracy: float, time: str = "cpu") -> pd.Series[float]:
    """Shifted geometric mean [s] of each method's time to an accuracy, as in `ranking`."""
    return np.exp(_logs(comparable(points), accuracy, time)[0].mean()) - SHIFT


def _logs(
    points: pd.DataFrame, accuracy: float, time: str = "cpu"
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """log(t + SHIFT) of the instances that somebody solved, and which methods solved them."""
    seconds = achieved(points, accuracy, time)
    limits = points.groupby("problem", sort=False)["limit"].max()
    solved = np.isfinite(seconds)
    kept = solved.any(axis=1)
    shown = seconds.where(solved, limits.reindex(seconds.index), axis=0)[kept]
    return np.log(shown + SHIFT), solved[kept]


def _rank_interval(logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest rank of each method that resampling the problems leaves likely."""
    import pandas as pd

    rng, ranks = np.random.default_rng(SEED), [np.ones((1, logs.shape[1]))]
    if len(logs):
        drawn = (
            rng.integers(len(logs), size=(BATCH, len(logs))) for _ in range(RESAMPLES // BATCH)
        )
        means = (pd.DataFrame(logs[index].mean(axis=1)) for index in drawn)
        ranks = [mean.rank(axis=1, method="min").to_numpy() for mean in means]
    low, high = np.nan_to_num(np.percentile(np.concatenate(ranks), LIKELY, axis=0))
    return np.floor(low).astype(int), np.ceil(high).astype(int)


def agreement(one: pd.DataFrame, other: pd.DataFrame, accuracy: float) -> float:
    """Kendall's tau-b of the ranks in two reruns; nan with fewer than two methods."""
    ranks = [ranking(points, accuracy).set_index("method")["mean"] for points in (one, other)]
    common = ranks[0].index.intersection(ranks[1].index)
    if len(common) < 2:
        return np.nan
    values = [r[common].to_numpy() for r in ranks]  # SciPy's statistics take a second to import
    one_sign, other_sign = (np.sign(np.subtract.outer(r, r)) for r in values)
    size = np.sqrt(np.sum(one_sign**2) * np.sum(other_sign**2))
    return float(np.sum(one_sign * other_sign) / size) if size > 0 else np.nan


def reruns(table: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The even and the odd repeats of repeated problems, as two tables; a single run is in both."""
    table = table[table["problem"].isin(table.loc[table["repeat"] > 0, "problem"])]
    single = table.groupby(POINT)["repeat"].transform("size") == 1
    even = table["repeat"] % 2 == 0
    return table[even | single], table[~even | single]


def wall_over_cpu(table: pd.DataFrame) -> float:
    """Wall time over CPU time of the calls, the lower median over the methods' medians."""
    timed = table[table["cpu_seconds"] > NOISE]
    ratios = (timed["call_seconds"] / timed["cpu_seconds"]).groupby(timed["method"]).median()
    return float(ratios.quantile(0.5, interpolation="lower")) if len(ratios) else np.nan


def warning(ratio: float) -> str:
    """Say that nothing is ranked where the machine was busy; '' where it was not."""
    if not ratio > BUSY:
        return ""
    return (
        f"Wall time over CPU time is {ratio:.2f}, a median over the methods, above {BUSY:g}: the"
        " machine was busy, so nothing is ranked."
    )
