"""Who is first: times at the accuracy reached, rank intervals, reruns, busy machines."""

import numpy as np
import pytest
from scipy import stats

from contactopt.benchmark.ranking import (
    NOISE,
    SHIFT,
    achieved,
    agreement,
    coverage_table,
    leader_table,
    points,
    ranking,
    reruns,
    wall_over_cpu,
    warning,
)

pd = pytest.importorskip("pandas")


def rows(method, curve, problem="p", repeat=0, wall=1.0, limit=10.0):
    """Runs of a method: `curve` holds (tolerance asked, certificate, CPU seconds)."""
    same = {"problem": problem, "start": "cold", "method": method, "repeat": repeat}
    same |= {"claimed": True, "status": "solved", "time_limit": limit}
    same |= {"peak_mb": 80.0, "base_mb": 70.0}
    return [
        same | {"tolerance": t, "residual": r, "cpu_seconds": s, "call_seconds": wall * s}
        for t, r, s in curve
    ]


def test_a_time_is_read_at_the_certificate_reached_and_not_at_the_tolerance_asked():
    # asked for 1e-6 it reaches 1e-4 only: at 1e-5 it stands midway to its next answer
    found = points(pd.DataFrame(rows("a", [(1e-6, 1e-4, 0.01), (1e-8, 1e-6, 1.0)])))
    assert achieved(found, 1e-5).iloc[0, 0] == pytest.approx(0.1)
    assert achieved(found, 1e-4).iloc[0, 0] == pytest.approx(0.01)
    assert achieved(found, 1e-2).iloc[0, 0] == pytest.approx(0.01)  # nothing cheaper is known
    assert np.isinf(achieved(found, 1e-7).iloc[0, 0])


def test_a_slower_and_less_accurate_point_does_not_count():
    curve = [(1e-3, 1e-3, 5.0), (1e-6, 1e-8, 0.1)]
    assert achieved(points(pd.DataFrame(rows("a", curve))), 1e-3).iloc[0, 0] == pytest.approx(0.1)


def test_the_worst_repeat_and_the_median_time_count_and_late_answers_do_not():
    table = pd.DataFrame(
        [
            *rows("a", [(1e-6, 1e-7, 1.0)]),
            *rows("a", [(1e-6, 1e-5, 3.0)], repeat=1),
            *rows("a", [(1e-6, 1e-7, 2.0)], repeat=2),
            *rows("late", [(1e-6, 1e-7, 20.0)]),
        ]
    )
    found = points(table)
    assert achieved(found, 1e-5)["a"].iloc[0] == 2.0
    assert np.isinf(achieved(found, 1e-6)["a"].iloc[0])
    assert np.isinf(achieved(found, 1e-3)["late"].iloc[0])


def test_nobody_is_first_by_what_a_clock_cannot_tell():
    table = pd.DataFrame(rows("a", [(1e-6, 1e-7, 1e-6)]) + rows("b", [(1e-6, 1e-7, 0.9 * NOISE)]))
    assert list(ranking(points(table), 1e-6)["rank"]) == [1, 1]


def campaign(rng, ratio=10.0, repeats=1, wall=1.0):
    """Thirty problems: `fast` is `ratio` times as fast as `slow`, and both as `fails` on half."""
    made = []
    for number in range(30):
        for repeat in range(repeats):
            base = 0.01 * np.exp(rng.normal())
            for method, factor in (("fast", 1.0), ("slow", ratio)):
                curve = [(1e-6, 1e-7, base * factor)]
                made += rows(method, curve, f"p{number}", repeat, wall)
            reached = 1e-7 if number % 2 else 1.0
            made += rows("fails", [(1e-6, reached, base)], f"p{number}", repeat, wall)
    return pd.DataFrame(made)


def test_leaders_are_ordered_by_shifted_means_in_which_a_failure_is_the_time_limit():
    table = campaign(np.random.default_rng(0))
    found = ranking(points(table), 1e-6).set_index("method")
    assert list(found.index) == ["fast", "slow", "fails"] and list(found["solved"]) == [30, 30, 15]
    fast = table[table["method"] == "fast"]["cpu_seconds"]
    assert found.loc["fast", "mean"] == pytest.approx(np.exp(np.log(fast + SHIFT).mean()) - SHIFT)
    own = table[table["method"] == "fails"]
    times = own["cpu_seconds"].where(own["residual"] < 1e-6, 10.0)
    assert found.loc["fails", "mean"] == pytest.approx(np.exp(np.log(times + SHIFT).mean()) - SHIFT)
    assert (found["memory"] == 10.0).all() and found.loc["fast", "over claim"] == pytest.approx(0.1)


def test_rank_intervals_are_narrow_where_a_difference_is_sure_and_wide_where_it_is_not():
    sure = ranking(points(campaign(np.random.default_rng(0))), 1e-6).set_index("method")
    assert (sure.loc["fast", ["best", "worst"]] == 1).all()
    rng, made = np.random.default_rng(1), []
    for number in range(12):  # two methods that win by chance
        for method in ("a", "b"):
            curve = [(1e-6, 1e-7, 0.01 * np.exp(rng.normal()))]
            made += rows(method, curve, f"p{number}")
    unsure = ranking(points(pd.DataFrame(made)), 1e-6)
    assert (unsure["best"] == 1).all() and (unsure["worst"] == 2).all()


def test_problems_that_nobody_solves_rank_nobody():
    table = pd.DataFrame(rows("a", [(1e-6, 1.0, 0.1)]) + rows("b", [(1e-6, 1e-7, 0.1)], "q"))
    found = ranking(points(table), 1e-6).set_index("method")
    assert list(found["of"]) == [1, 1] and list(found.index) == ["b", "a"]


def test_a_table_without_any_success_is_a_table_all_the_same():
    table = pd.DataFrame([*rows("a", [(1e-6, 1.0, 0.1)]), *rows("b", [(1e-6, 2.0, 0.2)])])
    found = leader_table(table)
    assert list(found["solved"]) == ["0 of 0", "0 of 0"]


def test_two_reruns_agree_as_kendall_says():
    halves = reruns(campaign(np.random.default_rng(2), repeats=4))
    assert all(set(half["repeat"] % 2) == {n} for n, half in enumerate(halves))
    assert agreement(*map(points, halves), 1e-6) == 1.0
    one, other = halves
    swapped = other.replace({"method": {"fast": "fails", "fails": "fast"}})
    assert agreement(points(one), points(swapped), 1e-6) == pytest.approx(-1.0)


@pytest.mark.parametrize("seed", range(5))
def test_ties_count_as_in_tau_b_and_ranks_as_those_of_scipy(seed):
    """Times of which several are equal, beside kendalltau and rankdata of SciPy."""
    rng = np.random.default_rng(seed)
    drawn = rng.integers(1, 5, size=(2, 8))
    runs = [
        [row for n, t in enumerate(own) for row in rows(f"m{n}", [(1e-6, 1e-7, 0.01 * t)])]
        for own in drawn
    ]
    found = [points(pd.DataFrame(own)) for own in runs]
    expected = stats.kendalltau(*drawn, variant="b").statistic
    assert agreement(*found, 1e-6) == pytest.approx(expected, abs=1e-12)
    one = ranking(found[0], 1e-6).set_index("method").sort_index()
    own = stats.rankdata(drawn[0], method="min")
    for column in ("rank", "best", "worst"):  # one problem: each sample is the same
        assert one[column].tolist() == own.tolist()


def test_a_busy_machine_ranks_nobody_and_says_so():
    quiet, busy = (campaign(np.random.default_rng(3), wall=wall) for wall in (1.1, 1.5))
    assert wall_over_cpu(busy) == pytest.approx(1.5) and "nothing is ranked" in warning(1.5)
    assert warning(wall_over_cpu(quiet)) == ""
    assert "rank (95 %)" in leader_table(quiet) and "rank (95 %)" not in leader_table(busy)


def refusals(method, problems):
    """Runs that a method refused: no time, no answer."""
    made = [row for name in problems for row in rows(method, [(1e-6, np.inf, 0.0)], name)]
    return [row | {"status": "refused", "claimed": False, "message": "no plates"} for row in made]


def test_what_a_method_cannot_express_is_no_failure_and_ranks_nobody():
    plain, plates = [f"p{n}" for n in range(5)], [f"v{n}" for n in range(7)]
    table = [row for name in plain for row in rows("peer", [(1e-6, 1e-7, 0.01)], name)]
    table += [row for name in plain for row in rows("ours", [(1e-6, 1e-7, 0.02)], name)]
    table += [row for name in plates for row in rows("ours", [(1e-6, 1e-7, 1.0)], name)]
    table += refusals("peer", plates)
    found = ranking(points(pd.DataFrame(table)), 1e-6).set_index("method")
    assert list(found.index) == ["peer", "ours"] and list(found["rank"]) == [1, 2]
    assert list(found["of"]) == [5, 5] and list(found["solved"]) == [5, 5]
    assert found["mean"].to_dict() == pytest.approx({"peer": 0.01, "ours": 0.02})
    assert found["taken"].to_dict() == {"peer": 5, "ours": 12} and (found["problems"] == 12).all()
    shown = leader_table(pd.DataFrame(table))
    assert list(shown["takes"]) == ["5 of 12", "12 of 12"]
    covered = coverage_table(pd.DataFrame(table)).set_index("method")
    assert list(covered["takes"]) == ["12 of 12", "5 of 12"]
    assert list(covered["solved of these"]) == ["12 of 12", "5 of 5"]
    assert list(covered["says of the others"]) == ["", "no plates"]


def test_a_method_that_takes_no_problem_of_a_table_hinders_no_ranking_there():
    made = rows("a", [(1e-6, 1e-7, 0.1)]) + rows("b", [(1e-6, 1e-7, 0.2)])
    table = pd.DataFrame([*made, *refusals("never", ["p"])])
    assert list(ranking(points(table), 1e-6)["method"]) == ["a", "b"]
    assert list(coverage_table(table)["takes"]) == ["1 of 1", "1 of 1", "0 of 1"]
    alone = pd.DataFrame(refusals("never", ["p"]))
    assert leader_table(alone).empty and len(coverage_table(alone)) == 1


def test_a_problem_refused_at_one_tolerance_and_tried_at_another_is_a_failure():
    tried = rows("coy", [(1e-3, 1e-2, 0.1)]) + refusals("coy", ["p"])
    table = pd.DataFrame(tried + rows("a", [(1e-3, 1e-4, 0.1), (1e-6, 1e-7, 0.1)]))
    found = ranking(points(table), 1e-6).set_index("method")
    assert found.loc["coy", ["solved", "of", "taken"]].tolist() == [0, 1, 1]


def test_methods_without_a_common_problem_are_not_compared():
    made = rows("plane", [(1e-6, 1e-7, 0.1)], "2d") + refusals("plane", ["3d"])
    made += rows("space", [(1e-6, 1e-7, 0.1)], "3d") + refusals("space", ["2d"])
    shown = leader_table(pd.DataFrame(made))
    assert list(shown["solved"]) == ["0 of 0", "0 of 0"]
    assert list(shown["takes"]) == ["1 of 2", "1 of 2"]
    assert len(coverage_table(pd.DataFrame(made))) == 2
