"""Thresholds predicted and observed: on problems of fresh seeds, and on one or two contacts."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

from contactopt.methods.augmented_lagrangian import AugmentedLagrangian
from contactopt.problem.certificate import yardsticks
from experiments.questions.atlas.problems import FAILED, Case, blocks, run
from experiments.questions.atlas.radii import (
    BEGUN,
    ITERATIONS,
    ITERATIONS_OF,
    fails,
    fresh,
    newton_load,
    observed,
    one_contact,
    pair,
    penalty_error,
    threshold,
)

SEEDS = 10  # problems of each method with a radius
COUPLINGS = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97)  # of the directions, for one contact
SHARES = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # of the coupling between two contacts
CRAWLING = (0.0, 0.2, 0.4, 0.6, 0.8)
MULTIPLIERS = "augmented_lagrangian"
FACTORS = (1e3, 1e4, 1e5, 1e6, 1e7, 1e8)  # of the penalty
Row = dict[str, Any]


def fresh_rows(name: str, seeds: range = range(SEEDS)) -> list[Row]:
    rows = []
    for seed in seeds:
        case, star = fresh(name, seed)
        seen = observed(partial(fails, name, case), star)
        rows.append(_row(name, "seed", seed, star, seen))
    return rows


def frontier_rows(name: str, two: Case | None = None) -> list[Row]:
    """Where a method begins to fail, cold, over the coupling of one contact's directions, or over
    that between the two contacts of a problem: the worst of the directions of slip."""
    rows = []
    if name == "newton":
        for b in COUPLINGS[1:]:
            test = lambda mu, b=b: run(name, newton_load(b, mu)).failed  # noqa: E731
            rows.append(_row(name, "coupling", b, 1 / b, observed(test, 1 / b)))
        return rows
    for x in SHARES if two else COUPLINGS:
        cases = [one_contact(x, 1.0, e) for e in (1.0, -1.0)]
        if two:
            Q = blocks(two) + x * (two.Q - blocks(two))
            cases = [two.loaded(Q=Q)]
        stars = [(star, case) for case in cases if (star := threshold(name, case, cold=True))]
        if stars:
            star, case = min(stars, key=lambda pair: pair[0])
            seen = observed(lambda mu, case=case: fails(name, case, mu, cold=True), star)
            rows.append(_row(name, "between" if two else "coupling", x, star, seen))
    return rows


def penalty_rows() -> list[Row]:
    """The certificate of the penalty method over its factor, predicted and observed."""
    case = one_contact(0.5, 1.0, 1.0)
    return [
        _row("penalty", "factor", factor, penalty_error(case, factor),
             run("penalty", case, factor=factor).residual)
        for factor in FACTORS
    ]  # fmt: skip


def crawl_rows() -> list[Row]:
    """The ratio of compliances below which the method of multipliers crawls, mu = 1/2: the error of
    the stiff contact's forces falls by 1 + rho a (1 - mu b) / (mean compliance) in each iteration,
    from that of the start; a is the ratio.
    """
    rows = []
    for b in CRAWLING:
        star = crawl_ratio(b)
        test = lambda x, b=b: run(MULTIPLIERS, nearly(pair(1 / x, b))).failed  # noqa: E731
        seen = observed(test, star)
        rows.append(_row(MULTIPLIERS, "coupling", b, star, seen))
    return rows


def crawl_ratio(b: float) -> float:
    """From which ratio on it does."""
    return float(brentq(lambda x: np.log(_left(1 / x, b) / FAILED), 1e2, 1e6))


def nearly(case: Case) -> Case:
    """Begun with forces that are too large by BEGUN."""
    return replace(case, start=(1 + BEGUN) * case.r)


def _left(ratio: float, b: float) -> float:
    """The certificate that the stiff contact has after all iterations."""
    case, mu = pair(ratio, b), 0.5
    yard = yardsticks(case.problem(), case.r, case.u - case.q, case.q)
    stiff, mean = ratio * (1 - mu * b), (1 + ratio) / 2
    error = yard.rho[1] * stiff * np.hypot(1, mu) * BEGUN * case.r[1, 0] / yard.force
    return float(error * (1 + AugmentedLagrangian().rho * stiff / mean) ** -ITERATIONS)


def _row(name: str, axis: str, x: float, predicted: float, seen: float) -> Row:
    return {"method": name, "axis": axis, "x": x, "predicted": round(predicted, 12),
            "observed": round(seen, 12)}  # fmt: skip


def measured(two: dict[str, Case]) -> tuple[list[Row], list[Row]]:
    """Both tables. `two` are the problems of two contacts for Gauss-Seidel."""
    seeds = [row for name in ITERATIONS_OF for row in fresh_rows(name)]
    pairs = [*ITERATIONS_OF, "newton"]
    plane = [row for name in pairs for row in frontier_rows(name, two.get(name))]
    return seeds, plane + crawl_rows() + penalty_rows()
