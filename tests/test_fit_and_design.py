"""Calibration recovers what made the data and says what it cannot know; design finds the profile of
uniform pressure.
"""

import numpy as np
import pytest

import contactopt
from contactopt import HalfSpace, InputError, Material, Rigid, Scene, follow, plots, scenes
from contactopt.scenes.parameters import parameter

LOADS = (0.0, 20.0, 42.0, 10.0, -20.0, -42.0, 0.0)


@pytest.fixture(scope="module")
def loop():
    scene = scenes.make_scene("cattaneo-2d", elements=5, shear=0.0)
    push = parameter("force:upper:x", scene)
    return [push.put(scene, load) for load in LOADS]


@pytest.fixture(scope="module")
def shift(loop):
    return follow(loop, tol=1e-12).history["shift"]


def test_clean_data_give_back_their_parameters(loop, shift):
    found = contactopt.fit(loop, {"shift": shift}, ("E", "mu"), start={"E": 7.0, "mu": 0.8})
    assert found.values["E"] == pytest.approx(5.0, rel=1e-6) and found.values[
        "mu"
    ] == pytest.approx(0.5, rel=1e-6)
    assert found.converged and all(found.identifiable.values()) and max(found.certificates) <= 1e-10
    assert "E = 5" in found.sentence
    ax = plots.fit(found)
    assert len(ax.lines) >= 1


def test_a_start_where_contacts_stick_does_not_hide_friction(loop, shift):
    found = contactopt.fit(loop, {"shift": shift}, "mu", start={"mu": 30.0})
    assert found.values["mu"] == pytest.approx(0.5, rel=1e-6) and found.identifiable["mu"]
    assert "went on from less of it" in found.message


def test_the_interval_is_that_of_linear_regression_at_the_solution(loop, shift):
    """Against the covariance from a Jacobian by central differences of solved paths."""
    sigma, rng = 0.002, np.random.default_rng(3)
    noisy = shift + sigma * rng.normal(size=len(shift))
    found = contactopt.fit(loop, {"shift": noisy}, ("E", "mu"), noise=sigma)
    columns = []
    for name in ("E", "mu"):
        which, h = parameter(name, loop[0]), 1e-4
        fitted = [parameter(other, s).put(s, found.values[other]) for s in loop for other in ("E",)]
        fitted = [parameter("mu", s).put(s, found.values["mu"]) for s in fitted]
        at = found.values[name]
        ends = [
            follow([which.put(s, at + t) for s in fitted], tol=1e-12).history["shift"]
            for t in (h, -h)
        ]
        columns.append((ends[0] - ends[1]) / (2 * h) / sigma)
    J = np.stack(columns, axis=1)
    assert np.allclose(found.covariance, np.linalg.inv(J.T @ J), rtol=1e-4)
    for i, name in enumerate(("E", "mu")):
        low, high = found.intervals[name]
        assert high - low == pytest.approx(2 * 1.959964 * np.sqrt(found.covariance[i, i]))


def test_friction_cannot_be_identified_where_everything_sticks(loop):
    """A plate that only presses two equal bodies makes them stick: mu is not in the data."""
    row = follow(loop[:1], tol=1e-12).history
    data = {"approach": row["approach"], "energy": row["elastic_energy"], "normal_force": 100.0}
    found = contactopt.fit(loop[0], data, ("E", "mu"), noise=0.01, start={"E": 5.5})
    assert found.values["E"] == pytest.approx(5.0) and found.identifiable == {
        "E": True,
        "mu": False,
    }
    assert found.intervals["mu"] == (-np.inf, np.inf) and np.isfinite(found.intervals["E"]).all()
    assert "mu cannot be identified" in found.sentence


@pytest.mark.parametrize(
    ("data", "names", "settings", "sentence"),
    [
        ({"shift": np.zeros(3)}, "E", {}, "one value per state"),
        ({"shift": np.full(7, np.nan)}, "E", {}, "cannot determine"),
        ({"shift": np.zeros(7)}, "gap", {}, "one number per contact"),
        ({"shift": np.zeros(7)}, "force:upper:x", {}, "differs from state to state"),
        ({"shift": np.zeros(7)}, "E", {"start": {"mu": 1.0}}, "not fitted"),
        ({"shift": np.zeros(7)}, "E", {"noise": -1.0}, "standard deviation"),
        ({"shift": np.zeros(7)}, "mu", {"bounds": {"mu": (0.6, 0.9)}}, "between its bounds"),
        ([1.0], "E", {}, "must be a mapping"),
    ],
)
def test_bad_input_of_fit_is_refused_in_one_sentence(loop, data, names, settings, sentence):
    with pytest.raises(InputError, match=sentence):
        contactopt.fit(loop, data, names, **settings)


HALF, MATERIAL, FORCE = 10.0, Material(5.0, 0.3), 100.0


def punch(cells=24, mu=0.0, **changes):
    """A rigid punch of half-width HALF on a half-plane: all of its face are candidate contacts."""
    h = 2 * HALF / cells
    x = -HALF + h * (np.arange(cells) + 0.5)
    return Scene(
        "punch",
        Rigid("punch", normal=(0, 1), force={"y": -FORCE}),
        HalfSpace("flat", MATERIAL, x, **changes),
        mu,
    )


def test_the_designed_profile_is_the_exact_one_of_uniform_pressure():
    """Johnson (1985), eq (2.27): displacement under a uniform pressure on a strip."""
    found = contactopt.design(punch(), lambda places: np.eye(places.shape[1]))
    assert found.converged and found.unevenness == pytest.approx(1.0, abs=1e-6)
    x = found.reduction.problem.chart.places[0] / HALF
    modulus = MATERIAL.E / (1 - MATERIAL.nu**2)
    exact = (1 + x) * np.log((1 + x) ** 2) + (1 - x) * np.log((1 - x) ** 2)
    exact *= FORCE / (2 * HALF) / (np.pi * modulus) * HALF
    assert np.abs((found.gap - found.gap.mean()) - (exact - exact.mean())).max() < 1e-6 * np.ptp(
        exact
    )
    assert all(visit.certificate <= 1e-9 for visit in found.visits)
    assert found.visits[0].peak > 2 * found.peak
    assert len(plots.design(found).lines) >= 1


def test_bounds_and_convex_constraints_are_kept():
    def shapes(places):
        return np.stack([(places[0] / HALF) ** power for power in (2, 4, 6)], axis=1)

    free = contactopt.design(punch(mu=0.2), shapes)
    limit = 0.5 * np.abs(free.profile).max()
    boxed = contactopt.design(punch(mu=0.2), shapes, bounds=(-limit, limit))
    assert np.abs(boxed.profile).max() <= limit * (1 + 1e-6) and boxed.peak > free.peak
    tied = contactopt.design(punch(mu=0.2), shapes, constraints=lambda c: [c[0] + c[1] + c[2] == 0])
    assert abs(tied.profile.sum()) < 1e-6 * np.abs(
        tied.profile
    ).max() and tied.peak >= free.peak * (1 - 1e-4)


def test_a_free_load_goes_to_its_bound():
    found = contactopt.design(
        punch(), free="force:punch:y", bounds={"force:punch:y": (-120.0, -80.0)}
    )
    assert found.values["force:punch:y"] == pytest.approx(-80.0, rel=1e-6)


@pytest.mark.parametrize(
    ("shapes", "settings", "sentence"),
    [
        (None, {}, "nothing is free"),
        (np.eye(3), {}, "one row per contact"),
        (None, {"free": "force:punch:y"}, "needs bounds"),
        (None, {"free": "mu"}, "needs bounds"),
        (lambda places: np.ones((24, 1)), {}, "does not change the pressure"),
        (lambda places: np.eye(24), {"bounds": {"mu": (0.0, 1.0)}}, "not free"),
        (lambda places: np.eye(24), {"constraints": lambda c: [c[0] >= 1e9]}, "no room"),
    ],
)
def test_bad_input_of_design_is_refused_in_one_sentence(shapes, settings, sentence):
    with pytest.raises(InputError, match=sentence):
        contactopt.design(punch(), shapes, **settings)
