"""Of 500 plausible wrong answers nearly all get a sentence that names the mistake."""

import tomllib
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from test_course import NUMBERS, example

from contactopt import laws, solve
from experiments.course.feedback import Displacements, Forces, Open
from experiments.course.grader import grade, right_answer
from experiments.course.quantities import Numbers, by_hand
from experiments.course.verdict import rounded

DATA = Path(__file__).parent / "data" / "wrong_answers.toml"
VAGUE = {"size", "near", "part"}  # verdicts that name no mistake; of `part` see below


def tried():
    """Number, expression and answer of every entry of the data file."""
    for number, expressions in tomllib.loads(DATA.read_text()).items():
        right, kind = np.asarray(example(number), dtype=float), right_answer(number)
        areas = kind.problem.areas if isinstance(kind, Forces) else None
        for expression in expressions:
            yield number, expression, eval(expression, {"np": np, "right": right, "areas": areas})


def names_a_mistake(verdict):
    if verdict.kind == "part":  # says which numbers are right, and what is wrong with another
        return "Number" in verdict.sentence
    return verdict.kind not in VAGUE


def test_nine_of_ten_wrong_answers_get_a_sentence_that_names_the_mistake():
    named, vague, passed = 0, [], []
    for number, expression, answer in tried():
        verdict = grade(number, answer)
        passed += [(number, expression)] * verdict.right
        named += names_a_mistake(verdict)
        if not names_a_mistake(verdict):
            vague.append((number, expression, verdict.sentence))
    assert not passed, passed
    total = named + len(vague)
    print(f"{named} of {total}")
    assert total >= 300 and named >= 0.9 * total, vague


def test_all_exercises_have_wrong_answers():
    assert set(tomllib.loads(DATA.read_text())) == set(NUMBERS)


def with_digits(answer, digits):
    array = np.asarray(answer, dtype=float)
    return np.array([rounded(x, digits) for x in array.ravel()]).reshape(array.shape)


@pytest.mark.parametrize("number", NUMBERS)
def test_right_answers_with_few_digits_are_not_called_wrong(number):
    if isinstance(right_answer(number), Open):
        return
    three, two = (grade(number, with_digits(example(number), n)) for n in (3, 2))
    assert three.right or getattr(right_answer(number), "counts", False), three
    if not getattr(right_answer(number), "counts", False):
        assert two.right or "three digits" in two.sentence, two


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("factor", [1e-3, 1e3, 1e6])
def test_answers_in_other_units_are_recognised(number, factor):
    right = right_answer(number)
    if isinstance(right, Open) or getattr(right, "counts", False) or not np.any(example(number)):
        return
    verdict = grade(number, factor * np.asarray(example(number), dtype=float))
    assert verdict.kind == "unit" or "metre" in verdict.sentence, verdict


# springs and points that belong to no surface
DISCRETE = {"1.9", "2.1", "2.3", "2.9", "4.7", "6.8"}


@pytest.mark.parametrize("number", NUMBERS)
def test_forces_per_area_are_recognised(number):
    right = right_answer(number)
    if not isinstance(right, Forces) or number in DISCRETE:
        return
    areas = right.problem.areas
    assert not np.allclose(areas, 1), "the areas of the nodes are missing"
    assert grade(number, example(number) / areas[:, None]).kind == "pressure"


def test_every_force_on_a_surface_knows_its_areas():
    on_surfaces = {
        number
        for number in NUMBERS
        if isinstance(right_answer(number), Forces)
        and not isinstance(right_answer(number), Displacements)
        and right_answer(number).problem.contacts > 2
    }
    assert on_surfaces == {"3.3", "4.3", "5.7"} and not on_surfaces & DISCRETE
    assert isinstance(right_answer("4.3").problem.law, laws.Coulomb)


# The answer 2 m / (a - k^2 / 2) for m = 3.7, a = 5.3 and k = 1.3; in the chapter k is 1.9.
@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (7.4 / (5.3 + 0.845), "the sign of `k ** 2 / 2` is wrong"),
        (7.4 / 5.3, "`k ** 2 / 2` is left out"),
        (7.4 / (5.3 - 1.69), "the division by `2` is left out"),
        (7.4 * (5.3 - 0.845), "`a - k ** 2 / 2` stands on the wrong side of a fraction"),
        (1 / 4.455, "the factor `2 * m` is left out"),
        (7.4 / (53 - 0.845), "Perhaps `a` is taken in another unit"),
        (7.4 / (10.6 - 0.845), "Perhaps `a` is taken twice as large"),
        (7.4 / 4.455 / 9.81, "no mass in kg"),
        (7.4 / (5.3 - 0.65), "the exponent `2` of `k` is left out"),
        (4.455, "This is `a - k ** 2 / 2`, a step on the way"),
        (7.4 / (5.3 - 0.5 * 1.9**2), "This has the `k` of the text"),
        (7.4 / (5.3 - 0.5 / 1.3**2), "`k ** 2` stands on the wrong side of a fraction"),
        (7.4 / 4.455 * 1.3, "multiplied once more by `k`"),
        (7.4 / (7.4 + 4.455), "you divide by `2 * m + a - k ** 2 / 2`"),
        (np.degrees(np.arctan(7.4 / 4.455)), "the angle"),
        (3.7 - 7.4 / 4.455, "another quantity"),
        (5.3, "the value of `a`"),
        (5.7 / 4.455, "`2` is added to `m`"),
    ],
)
def test_a_formula_says_what_was_changed(answer, told):
    given = {"m": 3.7, "a": 5.3, "k": 1.3}
    right = by_hand(["2 * m / (a - k ** 2 / 2)"], given, chapter={"k": 1.9})
    assert told in right.verdict(np.array(answer)).sentence
    assert told in right.verdict(np.array(rounded(answer, 5))).sentence


def test_two_terms_that_are_multiplied_one_by_one_and_exponents_outside_a_bracket_are_told():
    given = {"a": 7.3, "b": 2.1, "c": 5.9, "d": 1.7}
    one_by_one = by_hand(["(a - b) * (c - d)"], given).verdict(np.array(7.3 * 5.9 - 2.1 * 1.7))
    assert "multiplied term by term" in one_by_one.sentence
    outside = by_hand(["a / (1 - d**2)"], given).verdict(np.array(7.3 / 0.7**2))
    assert "outside a bracket" in outside.sentence
    halves = by_hand(["a / 2 * b**2 + c / 2 * d**2"], given)
    assert "all exponents" in halves.verdict(np.array(3.65 * 2.1 + 2.95 * 1.7)).sentence


def test_forces_that_belong_to_another_coefficient_order_or_quantity_are_told():
    right = right_answer("5.7")
    forces, moved = right.solved
    other = solve(replace(right.problem, law=laws.Coulomb(0.25))).reactions
    assert "friction coefficient 0.25" in grade("5.7", other).sentence
    assert "displacements" in grade("5.7", moved).sentence
    assert grade("5.7", forces / 2).kind == "half" and grade("4.7", (3.394, 3.606)).kind == "order"
    assert "forces are asked" not in grade("6.8", right_answer("6.8").solved[0]).sentence


@pytest.mark.parametrize("form", [Fraction, Decimal, np.float32, lambda x: [x]])
def test_numbers_of_every_type_are_numbers_and_digits_that_are_cut_off_are_nearly_right(form):
    assert grade("2.6", form(1.625)).right
    assert "three digits" in grade("2.8", -0.430).sentence  # -0.43077
    assert "three digits" in grade("5.10", 0.28).sentence  # 0.275


@pytest.mark.parametrize(
    ("number", "answer", "told"),
    [
        ("1.1", (3.86, 0.0), "wrong order"),
        ("1.2", -2.6, "the sign is not"),
        ("1.3", 4.3e-7, "the units"),  # of two digits
        ("1.8", 1 / 2.2, "1 / (1 - x)"),
        ("1.8", 10**-1.2, "base is 10"),
        ("2.2", 5.3 / 6.2, "`Q_nt` is left out"),
        ("2.2", 13.7 / 8.4, "the matrix `Q` is confused with its inverse"),
        ("2.4", (0, 0.26, 0.26), "Number 3: This is the right number 2"),
        ("3.5", (1, 1, 1), "less than half as large"),
        ("5.5", (2.5, -1.0), "you added rho u_n"),  # (2.53, -1.01) has the same two digits
        ("7.8", 0.04, "the distance from the cone"),
        ("5.5", (2.2, -0.88), "`rho` is left out everywhere"),
        ("5.9", (3, 0, 1.8, -1.6), "Numbers 1 and 3 and 4: This comes out if `mu * Q_nt` is left"),
        ("6.6", 0.0333, "the value of `p / E`"),
        ("7.2", (0.13, 0.2, 0.68), "Number 1: This comes out if the matrix `K` is left out"),
        ("7.4", (-2, -1), "This has the `g` of the text"),
        ("7.5", 0.83, "This is `g`"),
        ("7.7", 0.43, "The size is plausible"),  # 5.5 percent are not near
        ("2.8", -0.28, "Perhaps `Q_tt` takes the place of `Q_nn`"),
        ("3.6", 40 * 8 / 0.0003, "once more by `N`"),
        ("3.7", 4.0, "the `d` of the text"),
        ("4.1", (1640, 84), "Number 2: This comes out if `columns` is one too many"),
        ("4.1", (1600, 82), "Of your 2 numbers these are right: [2]"),
        ("4.5", 0.54, "factor of two"),
        ("4.5", np.sqrt(5.1), "the value of `sqrt(k_1 * k_2)`"),
        ("5.1", 23 / 107, "you divide by `load - pull`"),
        ("5.2", np.hypot(4.92, 9.45), "the sides of a right angle"),
        ("5.2", 18.9, "The runner on ice holds something as well. Besides, it is twice as large"),
        ("5.4", 0.2445, "A square is missing"),
        ("6.5", 5.5 / (1 - 0.84), "taken for a factor"),
        ("3.7", 3.489, "is not subtracted from `1`"),
        ("6.1", (2 * 9600) ** 2 * 8e-9, "two components, as in the plane"),
        ("6.7", 220, "a count is exact"),
        ("7.9", 0.6, "the value of `g_1 * g_2`"),
        ("7.3", 2.1 - 0.84, "`K_nn * apart ** 2 / 2` is left out"),
        ("7.3", 1.76, "`apart` is left out, or if the division by `2` is left out"),
    ],
)
def test_the_mistake_itself_is_told(number, answer, told):
    assert told in grade(number, answer).sentence


def test_a_value_that_a_mistake_cannot_give_is_told_by_its_bounds_or_its_size():
    right = by_hand(["2 * a"], {"a": 1.7}, least=(0.0, "This is positive."))
    assert right.verdict(np.array(-7.77)).sentence.endswith("This is positive.")
    assert right.verdict(np.array(7.77)).kind == "size"
    assert Numbers(3.0).verdict(np.array(3.05)).kind == "near"
