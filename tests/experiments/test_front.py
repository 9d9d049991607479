"""What accuracy costs: known answers, the rule that is made from them, and penalties."""

from dataclasses import replace

import numpy as np
import pytest

from contactopt import Material, scenes, solve
from contactopt.accuracy.proposal import ContactFacts, power_of, propose, stuck_share
from contactopt.analytic import (
    contact_modulus,
    dundurs,
    flat_punch_axisymmetric_friction,
    flat_punch_line_friction,
)
from contactopt.figures.scene_check import check_scene
from experiments.questions import penalty
from experiments.questions.front.bodies import ellipse, half_space, line, point
from experiments.questions.front.draw import cheapest
from experiments.questions.front.measured import solved
from experiments.questions.front.unseen import (
    Unseen,
    attempt,
    fitted,
    is_steady,
    layer,
    power,
    pressed,
    punch,
)

STEEL = Material(210e3, 0.3)


@pytest.mark.parametrize(
    ("known", "width"),
    [
        (ellipse(0.4), None),
        (ellipse(0.999), 0.999**0.5),
        (power(4, True, STEEL), None),
        (power(4, False, STEEL), None),
        (power(2, False, STEEL), 1.0),
    ],
)
def test_known_answers_are_those_of_a_fine_grid(known, width):
    found = solved(half_space(known), 32, 1e-9, "auto")
    problem, solution = found.reduction.problem, found.solution
    assert solution.reactions[:, 0].sum() == pytest.approx(known.force, rel=1e-6)
    if known.exact.peak is not None:
        peak = (solution.reactions[:, 0] / problem.areas).max()
        assert peak == pytest.approx(known.exact.peak, rel=5e-3)
    if known.exact.approach is not None:
        assert -solution.multipliers[0] == pytest.approx(known.exact.approach, rel=2e-3)
    if width is not None:
        assert known.exact.half_width == pytest.approx(width)


def test_an_ellipse_that_is_round_is_hertz():
    made, round_ = ellipse(0.9999), point(ellipse(0.9999).force, 1 / 0.157, STEEL)
    a = made.profile(np.array([[1.0], [0.0]]))[0], made.profile(np.array([[0.0], [1.0]]))[0]
    assert a[0] == pytest.approx(a[1], rel=1e-3)
    assert made.exact.approach == pytest.approx(2 * a[0], rel=1e-3)
    assert round_.profile(np.array([[1.0], [0.0]]))[0] == pytest.approx(0.157 / 2)


@pytest.mark.parametrize(
    ("asked", "degree", "elements"),
    [
        (("pressure", 0.01, ContactFacts("free")), 0, 20),
        (("pressure", 0.01, ContactFacts("free", solid=True)), 0, 11),  # points cost n^2 there
        (("stick", 0.03, ContactFacts("free", solid=True, friction=True)), 0, 7),
        (("pressure", 0.003, ContactFacts("free", power=4.0, solid=True)), 0, 22),
        (("pressure", 0.01, ContactFacts("free", 5.0)), 1, 9),  # the body is no half-space
        (("approach", 0.001, ContactFacts("free", 1e4), (1, 2)), 2, 22),
        (("stick", 0.003, ContactFacts("corner"), (1, 2)), 1, 58),
        (("approach", 0.01, ContactFacts("corner", solid=True)), 0, 18),
    ],
)
def test_the_rule_takes_the_cheapest_mesh_for_an_accuracy(asked, degree, elements):
    found = propose(*asked)
    assert (found.degree, found.elements) == (degree, elements)
    assert found.tolerance == pytest.approx(asked[1] / 100)


@pytest.mark.parametrize(
    ("quantity", "contact"),
    [
        ("energy", ContactFacts("free")),
        ("pressure", ContactFacts("corner")),  # which is infinite
        ("pressure", ContactFacts("free", power=1.5)),  # which has a cusp
        ("pressure", ContactFacts("free", power=np.nan)),  # of a rough surface
        ("width", ContactFacts("free", power=4.0)),  # whose edge is too steep for a fit
    ],
)
def test_there_is_no_rule_for_what_was_not_measured(quantity, contact):
    assert propose(quantity, 0.01, contact) is None


@pytest.mark.parametrize("m", [1.0, 2.0, 4.0])
def test_the_exponent_of_a_gap_is_found(m):
    x = np.stack([axis.ravel() for axis in np.meshgrid(*[np.linspace(-1, 1, 40)] * 2)])
    gap = (x[0] ** 2 + 6 * x[1] ** 2) ** (m / 2)  # on an ellipse of ratio .4
    assert power_of(x, gap, 1.0) == pytest.approx(m, abs=0.1)
    rough = np.random.default_rng(0).uniform(0, 1, gap.shape)
    assert propose("pressure", 0.01, ContactFacts("free", power=power_of(x, rough, 1.0))) is None


SOFT = Material(50.0, 0.46)  # hardly compressible: linear elements miss changes of volume


@pytest.mark.parametrize(
    ("case", "degrees"),
    [
        (pressed("ball", "pressure", point(20.0, 30.0, STEEL), 0.01), (0, 1, 2)),
        (pressed("roller", "pressure", line(10.0, 50.0, SOFT), 0.003), (1,)),
        (pressed("ball", "approach", point(10.0, 50.0, SOFT), 0.03), (1,)),
        (layer("width", False, 1.4, 0.03), (0, 1, 2)),  # which is no half-space
        (layer("pressure", True, 1.5, 0.003), (0, 1, 2)),
        (fitted("axisymmetric", (4.0, 13.0, 21.0), STEEL, 0.01), (1, 2)),
        (fitted("plane-strain", (15.0, 24.0, 70.0), SOFT, 0.003), (1, 2)),
        (punch("plane-strain", "stick", 0.25, 0.2, 0.03), (1, 2)),  # which sticks on .29
    ],
)
def test_the_rule_meets_its_accuracy(case, degrees):
    rule = propose(case.quantity, case.accuracy, case.contact, degrees)
    error = attempt(case, rule.degree, rule.elements, rule.tolerance)[1]
    assert abs(error) <= case.accuracy


@pytest.mark.parametrize(("mu", "nu"), [(0.2, 0.16), (0.35, 0.3), (0.5, 0.06)])
def test_the_share_of_stick_is_nearly_that_of_spence(mu, nu):
    beta, modulus = dundurs(None, Material(1.0, nu))[1], contact_modulus(Material(1.0, nu))
    line = flat_punch_line_friction(1.0, 1.0, mu, beta).stick_half_width
    disc = flat_punch_axisymmetric_friction(1.0, 1.0, modulus, mu, beta).stick_half_width
    assert stuck_share(mu, nu, True) == pytest.approx(line, rel=0.2)
    assert stuck_share(mu, nu, False) == pytest.approx(disc, rel=0.2)


def test_errors_of_points_under_a_disc_fall_like_their_distance():
    friction = ContactFacts("corner", solid=True, friction=True)
    for quantity in ("approach", "stick"):
        few, many = (friction.elements(quantity, 0, accuracy) for accuracy in (0.03, 0.003))
        assert many == pytest.approx(10 * few, rel=0.05)
    mostly = replace(friction, stuck=0.5)
    assert mostly.elements("stick", 0, 0.01) is None
    case = punch("axisymmetric", "approach", 0.0, 0.3, 0.01)
    errors = {n: attempt(case, 0, n, 1e-5)[1] for n in (6, 12, 24)}  # areas of points within 1 %
    assert all(0.1 <= n * error <= 0.2 for n, error in errors.items())


def test_a_mesh_is_lucky_if_a_finer_one_is_worse(monkeypatch):
    errors = {16: 0.003, 17: -0.001, 18: 0.014, 24: 0.009, 32: 0.002}
    case = Unseen("", "stick", 0.01, 1.0, ContactFacts("corner"), {})
    known = lambda case, way, mesh, tol: (0.1, errors.get(mesh, 0.0))  # noqa: E731
    monkeypatch.setattr("experiments.questions.front.unseen.attempt", known)
    rows = [{"way": 1, "mesh": n, "tolerance": 1e-4, "accuracy": 0.01} for n in (16, 24)]
    assert [is_steady(case, row) for row in rows] == [False, True]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("sphere", "8 elements across the half-width of contact (here 32)"),
        ("press-fit", "9 elements along the surface of contact (here 14)"),
        ("hertz-half-space", "11 points across the half-width of contact (here 48)"),
        ("rigid-punch-2d", "for 1 % of the stick width"),
        ("punch-2d", ""),  # two elastic bodies with corners
        ("arch", ""),
    ],
)
def test_check_says_what_one_percent_takes(name, words):
    text = check_scene((scenes.make_scene(name),)).text
    lines = [line for line in text.splitlines() if line.startswith("for 1 %")]
    assert (words in lines[0]) if words else not lines


def test_the_cheapest_run_has_the_accuracy_and_not_by_luck():
    runs = [("half-space", 8, 0.02, 1.0), ("plane", 4, -1e-4, 0.5), ("plane", 8, 0.02, 2.0),
            ("plane", 16, -0.005, 3.0)]  # fmt: skip
    keys = {"scene": "Cattaneo", "tolerance": 1e-9, "reading": "fitted"}
    names = ("model", "mesh", "stick", "cpu")
    rows = [keys | dict(zip(names, run)) for run in runs]
    assert cheapest(rows, "Cattaneo", 0.01)["cpu"] == 3.0  # not the lucky mesh of 4
    assert cheapest(rows, "Cattaneo", 0.03)["cpu"] == 0.5
    assert cheapest(rows[:1] + rows[2:], "Cattaneo", 0.03)["cpu"] == 1.0
    assert cheapest(rows[:1] + rows[2:], "Cattaneo", 0.03, meshed=True)["cpu"] == 2.0
    assert cheapest(rows, "Cattaneo", 1e-3) is None


def test_forces_of_the_true_problem_are_a_fixed_point_of_the_augmented_lagrangian():
    _, exact, unit = penalty.scene_of(8)
    problem = penalty.scene_of(8)[0].problem
    for factor in (0.1, 10.0):
        made = penalty.softened(problem, factor * unit, exact.reactions)
        again = solve(made, tol=1e-12).reactions
        np.testing.assert_allclose(again, exact.reactions, atol=1e-8 * np.abs(again).max())
        first = solve(penalty.softened(problem, factor * unit), tol=1e-12)
        u = penalty.gaps(problem, first)[:, 0]  # a penalty carries what overlaps
        np.testing.assert_allclose(
            first.reactions[:, 0],
            factor * unit * np.maximum(-u, 0),
            atol=1e-7 * np.abs(again).max(),
        )
