"""What the rooms of the museum say is true at every position of their sliders."""

import itertools
import json
import re

import numpy as np
import pytest
from browser import Browser
from scipy.optimize import linprog
from test_museum import ROOMS, browser_needed, coupled, museum, string, two_nodes  # noqa: F401

POSITIONS, MINUS = 160, "\u2212"
# where a room's theorem holds with equality, or a load is zero: values of its sliders
EDGES = {
    "one_node": [
        {"mu": mu, "coupling": side * c, "q_n": q_n, "q_t": q_t}
        for mu, c in ((1.25, 0.8), (2, 0.5), (1.6, 0.625), (2.5, 0.4))
        for side, q_n, q_t in itertools.product((1, -1), (0, 0.3, -0.3), (0.7, 0, -0.7))
    ],
    "cobweb": [
        {"mu": mu, "coupling": side * c, "q_tt": 1, "q_n": q_n, "q_t": q_t, "start": start}
        for mu, c in ((2, 0.5), (1.6, 0.625), (3, 0.75))
        for side, q_n in itertools.product((1, -1), (0, 0.3, -0.3))
        for q_t, start in ((1, 0.5), (-1, 2), (0, 1))
    ],
    "dragged_plate": [
        {"mu": mu, "s": s, "q_n": q_n, "coupling": c}
        for mu, s in ((0.3, 0), (0, 0), (0.5, 0.5), (0.5, -0.5), (0, 0.5))
        for q_n, c in itertools.product((-1, 0, 1), (0, 0.5, -0.95))
    ],
    "stick_zone": [
        {"T": side * mu * P, "mu": mu, "P": P, "R": 40, "E": 1000}
        for mu, P in ((0.5, 60), (0.3, 50), (0.07, 100), (0.55, 20))
        for side in (1, -1, 0)
    ],
    "two_nodes": [
        {"mu": mu, "own": own, "cross": 0, "q_n": q_n, "q_t1": q_t, "q_t2": q_t}
        for mu, own in ((2.5, 0.4), (4, 0.25), (0, 0))
        for q_n, q_t in itertools.product((0, 0.1, -0.1), (0, 1, -1))
    ],
    "penalty": [
        {"log": log, "corrections": n, "press": press, "gap": gap}
        for log, n in ((0, 0), (7, 12), (1.5, 4))
        for press, gap in ((0.196, 0.048), (0.1, 0.2), (3, 0))
    ],
    "non_monotone": [{"r_1": 5, "r_2": 5, "u_1": 1, "u_2": 1, "mu": 0.5}],
}


@pytest.fixture
def said(museum, tmp_path):  # noqa: F811
    """Positions of a room's sliders, its answers and its verdicts there."""
    museum.write(tmp_path)

    def ask(name):
        rng = np.random.default_rng(11)
        with Browser(tmp_path / f"{name}.html", 1280, 800) as page:
            page.wait("window.sliders")
            sliders = page.ask("window.sliders")
            values = {}
            for key, (_, low, high, step, start) in sliders.items():
                ends = {low, high, start, *(x for x in (0, 1, -1) if low <= x <= high)}
                near = low + step * rng.integers(round((high - low) / step) + 1, size=3)
                values[key] = sorted({float(x) for x in (*ends, *np.round(near, 9))})
            positions = [
                {key: float(rng.choice(some)) for key, some in values.items()}
                for _ in range(POSITIONS)
            ]
            positions += EDGES.get(name, [])
            start = {key: slider[4] for key, slider in sliders.items()}
            positions += [start | chosen for _, chosen in page.ask("room.breaks")]
            answers = page.ask(f"{json.dumps(positions)}.map(window.answers)")
            verdicts = page.ask(f"{json.dumps(positions)}.map(window.verdict)")
            assert not page.faults
        return list(zip(positions, answers, verdicts, strict=True))

    return ask


def solution_count(problem):
    """How many forces solve a plane problem: a linear program for every combination of states."""
    Q, q, V, s = problem.Q, problem.q.ravel(), problem.V, problem.s
    mu, k, n = problem.law.coefficient, problem.contacts, problem.q.size
    whole, points = np.hstack([Q, V]), []
    own = np.hstack([np.eye(n), np.zeros((n, V.shape[1]))])
    for states in itertools.product("osfb", repeat=k):
        equal, right = [*np.hstack([V.T, np.zeros((V.shape[1],) * 2)])], [*-s]
        less, most = [], []
        for i, state in enumerate(states):
            a, b = 2 * i, 2 * i + 1
            if state == "o":
                equal += [own[a], own[b]]
                right += [0, 0]
                less.append(-whole[a])
                most.append(q[a])
                continue
            equal.append(whole[a])
            right.append(-q[a])
            less.append(-own[a])
            most.append(0)
            if state == "s":
                equal.append(whole[b])
                right.append(-q[b])
                less += [own[b] - mu[i] * own[a], -own[b] - mu[i] * own[a]]
                most += [0, 0]
            else:
                side = 1 if state == "f" else -1
                equal.append(own[b] + side * mu[i] * own[a])
                right.append(0)
                less.append(-side * whole[b])
                most.append(side * q[b])
        program = {"A_eq": equal, "b_eq": right, "A_ub": less, "b_ub": most, "bounds": (None, None)}
        ends = []
        for way in (np.arange(1.0, n + 1), -np.arange(1.0, n + 1), *np.eye(n)):
            found = linprog(np.concatenate([way, np.zeros(V.shape[1])]), **program)
            if found.status == 2:
                break
            ends.append(found.x[:n])
        if ends and np.ptp(ends, axis=0).max() > 1e-6:
            return np.inf
        if ends and not any(np.allclose(ends[0], one, atol=1e-6) for one in points):
            points.append(ends[0])
    return len(points)


def count_said(verdict):
    found = re.match(r"(\d+|No|Infinitely many) solutions?\b", verdict)
    assert found, verdict
    return (
        {"No": 0, "Infinitely many": np.inf}.get(found[1]) if found[1][0] > "9" else int(found[1])
    )


def node(p, tangential=1.0, **plate):
    from contactopt import InterfaceProblem

    q_t = p.get("q_t", 0.0)
    return InterfaceProblem(coupled(p, tangential), [[p["q_n"], q_t]], p["mu"], **plate)


@pytest.mark.slow
@browser_needed
def test_one_node(said):
    counts = []
    for p, _, verdict in said("one_node"):
        counts.append(solution_count(node(p)))
        assert count_said(verdict) == counts[-1], (p, verdict, counts[-1])
        holds = p["mu"] * abs(p["coupling"]) < 1 - 1e-12
        assert ("hypothesis holds" in verdict) == holds, (p, verdict)
        assert not holds or counts[-1] == 1
    assert {1, 2, 3, np.inf} <= set(counts)


@pytest.mark.slow
@browser_needed
def test_two_nodes(said):
    counts = set()
    for p, a, verdict in said("two_nodes"):
        exact = solution_count(two_nodes(p))
        assert count_said(verdict) == exact, (p, verdict, exact)
        if a["threshold"] is None or p["mu"] < a["threshold"] * (1 - 1e-9):
            assert exact == 1 and "is below" in verdict, (p, verdict)
        elif p["mu"] > a["threshold"] * (1 + 1e-9):
            assert "is above" in verdict, (p, verdict)
        counts.add(exact)
    assert {1, 3} <= counts


@browser_needed
def test_dragged_plate(said):
    counts = []
    for p, a, verdict in said("dragged_plate"):
        counts.append(solution_count(node(p, V=[[0.0], [1.0]], s=[p["s"]])))
        assert count_said(verdict) == counts[-1], (p, verdict, counts[-1])
        assert (a["forces"] is None) == (counts[-1] == 0)
    assert set(counts) == {0, 1}


@pytest.mark.slow
@browser_needed
def test_cobweb(said):
    calm = {}
    for p, a, verdict in said("cobweb"):
        problem = node(p, p["q_tt"])
        assert count_said(verdict) == solution_count(problem), (p, verdict)
        for name, slope in (("Tresca", a["slopeTresca"]), ("Acary and Cadoux", a["slopeCone"])):
            converges = f"{name}'s iteration converges" in verdict
            rest = re.search(rf"{name}'s iteration (converges|does not converge)", verdict)
            assert rest, verdict
            calm.setdefault(name, set()).add(converges)
            # next to a solution that slips, and the only one, the slope decides
            if count_said(verdict) == 1 and slope is not None and abs(abs(slope) - 1) > 0.01:
                assert converges or abs(slope) > 1, (p, verdict)
        if a["slopeCone"] is not None and a["slopeTresca"] < 0:
            assert 0 <= a["slopeCone"] < 1, p  # what the page says of b < 0
        if a["slopeCone"] is not None:
            assert (a["slopeCone"] < 1 - 1e-9) == (a["slopeTresca"] < 1 - 1e-9), p
    assert calm == {"Tresca": {True, False}, "Acary and Cadoux": {True, False}}


@browser_needed
def test_stick_zone(said):
    for p, a, verdict in said("stick_zone"):
        share = abs(p["T"]) / (p["mu"] * p["P"])
        if share > 1 + 1e-12:
            assert verdict.startswith("No solution") and a["c"] is None
        elif share >= 1 - 1e-12:
            assert "nothing sticks" in verdict.lower(), (p, verdict)
        elif p["T"] == 0:
            assert verdict.startswith("Everything sticks"), (p, verdict)
        else:
            assert verdict.startswith("The middle sticks") and 0 < a["c"] < a["a"], (p, verdict)


@pytest.mark.slow
@browser_needed
def test_penalty(said):
    x = string(6)[1]
    for p, a, verdict in said("penalty"):
        touched = max(a["exact"]) > 0
        assert ("no contact force" in verdict) == (not touched), (p, verdict)
        if touched:
            told = float(
                re.search(r"penalty overlaps by ([\d.]+(?:·10)?)", verdict)[1].split("·")[0]
            )
            assert told > 0, (p, verdict)
        else:
            assert (p["gap"] - p["press"] * x * (1 - x)).min() > -1e-12


@browser_needed
def test_dual_gap(said):
    for p, a, verdict in said("dual_gap"):
        assert ("hypothesis holds" in verdict) == (p["step"] < 2)
        assert MINUS not in verdict.split("against")[0], (p, verdict)  # "It is never negative."
        small = a["last"] <= 1e-3 * max(abs(a["best"]), 1e-12)
        assert ("not small" in verdict) == (not small)


@browser_needed
def test_certified_and_wrong(said):
    for p, a, verdict in said("certified_and_wrong"):
        assert ("accepted" in verdict) == (a["certificate"] <= 1e-8)
        error = abs(p["r_n"] - 1)
        told = re.search(r"normal force is (\S+) percent", verdict)[1]
        number = float(told.split("·")[0])
        assert np.isclose(number, 100 * error, rtol=0.01) or "·" in told, (p, verdict)


@browser_needed
def test_seminorm(said):
    for p, a, verdict in said("seminorm"):
        m = 2 ** round(np.log2(p["m"])) if "power" in p else int(p["m"])
        power = m & (m - 1) == 0
        assert ("power of two" in verdict) == power, (p, verdict)
        assert power == (abs(a["rowSum"]) < 1e-9)


@browser_needed
def test_non_monotone(said):
    for p, a, verdict in said("non_monotone"):
        u = np.array([[0, p["u_1"]], [0, p["u_2"]]])
        normal = np.array([p["r_1"], p["r_2"]])
        r = np.column_stack([normal, -p["mu"] * normal * np.sign(u[:, 1])])
        product = (r[0] - r[1]) @ (u[0] - u[1])
        assert np.isclose(a["product"], product, atol=1e-12)
        assert ("breaks" in verdict) == (product > 1e-12), (p, verdict)


def test_every_room_is_walked():
    assert all(f"test_{name}" in globals() for name in ROOMS)
