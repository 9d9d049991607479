"""Every problem of the atlas still defeats its method, and thresholds are predicted."""

from dataclasses import replace

import numpy as np
import pytest

from contactopt import InputError, solve
from contactopt.methods import METHODS
from contactopt.problem import natural_map_residual
from experiments.questions.atlas import draw
from experiments.questions.atlas import search as searching
from experiments.questions.atlas.__main__ import WORDS, failures, report
from experiments.questions.atlas.frontiers import MULTIPLIERS, crawl_ratio, nearly
from experiments.questions.atlas.problems import FAILED, Case, run
from experiments.questions.atlas.problems import draw as drawn
from experiments.questions.atlas.radii import AROUND, fails, fresh, newton_load, pair, penalty_error
from experiments.questions.atlas.search import CURES, KNOWN, definite, rounded, search, smaller

OURS = {row["method"]: row for row in failures() if " " not in row["method"]}
FAILING = [name for name, row in OURS.items() if "case" in row]
# nothing smaller is known for `auto`, which takes some ten seconds on its problem
ONE_BY_ONE = [pytest.param(n, marks=[pytest.mark.slow] * (n == "auto")) for n in FAILING]


def test_every_method_of_ours_is_in_the_atlas():
    assert set(OURS) == set(METHODS) - {"relaxation"} == {n for n in WORDS if " " not in n}
    assert list(OURS) == FAILING


@pytest.mark.parametrize("name", ONE_BY_ONE)
def test_the_method_still_fails_on_its_smallest_problem_and_the_proof_holds(name):
    """If this fails because the method solves it now: search again, and change the page."""
    case, words = Case.of(OURS[name]["case"]), WORDS[name]
    end = run(name, case)
    assert end.failed, f"{name} solves its problem now: {end.status}, {end.residual}"
    # how the last stage of `auto` wanders depends on the last digits of Q; that it fails does not
    assert name == "auto" or end.what == OURS[name]["what"]
    settings = words.get("settings", {})
    cured = case if settings else CURES[words["cure"]](case)
    assert not run(name, cured, **settings).failed
    for i in range(len(case.q) if len(case.q) > 1 else 0):
        assert not run(name, case.without(i)).failed
    assert len(case.q) <= (5 if name == "auto" else 3)


@pytest.mark.parametrize("name", FAILING)
def test_the_problem_has_a_solution_that_another_method_finds(name):
    case = Case.of(OURS[name]["case"])
    problem = case.problem()
    if name == "auto":  # the solution through which the problem was drawn
        assert natural_map_residual(problem, case.r) <= 1e-9
    elif name != "lemke":  # it slips 1e12 times as far as forces move it
        assert solve(problem).solved


@pytest.mark.parametrize(
    ("name", "seed"),
    [("nsgs", 101), ("nsgs", 103), ("alternating", 101), ("tresca", 102), ("acary_cadoux", 101)],
)
def test_a_fixed_point_fails_where_its_radius_passes_one(name, seed):
    case, star = fresh(name, seed)
    assert not fails(name, case, star / AROUND)
    assert fails(name, case, star * AROUND)


@pytest.mark.parametrize("b", [0.3, -0.6, 0.95])
def test_newton_cycles_on_one_contact_from_the_loss_of_uniqueness_on(b):
    assert not run("newton", newton_load(b, 0.99 / abs(b))).failed
    assert run("newton", newton_load(b, 1.01 / abs(b))).what == "cycles (2)"


def test_the_error_of_the_penalty_method_is_predicted():
    for seed in range(4):
        case = drawn(np.random.default_rng(seed), 2, 2, set())
        assert run("penalty", case).residual == pytest.approx(penalty_error(case, 1e6), rel=0.05)


def test_one_penalty_for_all_contacts_crawls_where_it_is_predicted():
    star = crawl_ratio(0.4)
    assert not run(MULTIPLIERS, nearly(pair(AROUND / star, 0.4))).failed
    assert run(MULTIPLIERS, nearly(pair(1 / (AROUND * star), 0.4))).failed


def test_problems_are_drawn_through_their_solution():
    random = np.random.default_rng(5)
    for kind in ({"plate"}, {"unsymmetric"}, {"redundant"}, set()):
        case = drawn(random, 3, 3, kind, always=True)
        problem = case.problem()
        moved = problem.displacements(case.r, np.zeros(len(case.s)))
        assert np.allclose(moved, case.u) and np.allclose(problem.V.T @ case.r.ravel(), -case.s)
        assert np.all(np.linalg.norm(case.r[:, 1:], axis=1) <= case.mu * case.r[:, 0] * (1 + 1e-12))


def test_the_search_finds_and_shrinks():
    found = search("nsgs", seed=3, most=60, seconds=20.0)
    assert sum(found["failed"].values()) > 0 and len(found["case"]["q"]) <= 2
    again = smaller("nsgs", KNOWN["nsgs"])
    assert len(again.q) == 2 and run("nsgs", again).residual > FAILED


def test_shorter_numbers_do_not_make_a_singular_compliance_indefinite(monkeypatch):
    flat = np.array([1.0, 7.0**0.5])
    case = KNOWN["newton"].loaded(Q=np.outer(flat, flat))
    assert definite(rounded(case, 3)) < -1e-4
    end = run("newton", KNOWN["newton"])
    monkeypatch.setattr(searching, "run", lambda *given: end)  # which fails
    assert definite(smaller("newton", case)) > -1e-14


def test_no_method_is_blamed_for_a_compliance_that_creates_energy():
    for row in failures():
        if "case" in row:
            assert definite(Case.of(row["case"])) > -1e-12, row["method"]


def test_what_is_refused_is_no_failure():
    case = KNOWN["nsgs"]
    odd = replace(case, Q=case.Q + np.triu(np.ones((4, 4)), 1))
    with pytest.raises(InputError):
        solve(odd.problem(), "tresca")
    assert run("tresca", odd).status == "refused" and not run("tresca", odd).failed


def test_report_and_figures_are_made_from_the_tables():
    rows = failures()
    text = report(rows, [{"method": "nsgs", "predicted": 1.0, "observed": 1.01}])
    assert all(f"### {row['method']}" in text for row in rows) and "{" not in text.split("##")[0]
    figure = draw.overview(rows)
    assert figure.axes[0].get_yticklabels()[0].get_text() == rows[0]["method"]
