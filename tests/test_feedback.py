"""Of 500 plausible wrong answers nearly all get a sentence that names the mistake; right answers
with two digits are not called wrong; answers in other units are recognised.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from test_course import NUMBERS, example

from contactopt import laws
from experiments.course.feedback import Displacements, Forces, Open
from experiments.course.grader import grade, right_answer
from experiments.course.mistakes import wrong_values
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


def test_a_formula_says_what_was_changed():
    told = dict(wrong_values("(F - k * g) / 2", {"F": 5.0, "k": 2.0, "g": 1.0}))
    assert "the sign of `k * g` is wrong" in told[3.5]
    assert "`k * g` is left out" in told[2.5]
    assert "multiply by `2`" in told[6.0]
    assert "division by `2`" in told[3.0]


def test_a_value_that_a_mistake_cannot_give_is_told_by_its_bounds_or_its_size():
    right = by_hand(["2 * a"], {"a": 1.7}, least=(0.0, "This is positive."))
    assert right.verdict(np.array(-7.77)).sentence.endswith("This is positive.")
    assert right.verdict(np.array(7.77)).kind == "size"
    assert Numbers(3.0).verdict(np.array(3.05)).kind == "near"
