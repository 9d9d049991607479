"""Two ways to one answer: the search finds what is wrong, and nothing where nothing is."""

from dataclasses import replace

import numpy as np
import pytest

from contactopt import Contact, HalfSpace, InputError, InterfaceProblem, Material, Scene, run, solve
from experiments.questions.search_for_wrong_answers.__main__ import verdict
from experiments.questions.search_for_wrong_answers.compare import judge
from experiments.questions.search_for_wrong_answers.round_bodies import pressed

MATERIAL, ROW = Material(5.0, 0.3), np.linspace(-3, 3, 31)


def ball(**force: float) -> HalfSpace:
    return HalfSpace("ball", MATERIAL, (ROW,), height=lambda x: -(x[0] ** 2) / 40, **force)


@pytest.mark.slow
def test_twelve_scenes_of_six_kinds_have_one_answer_by_two_ways():
    found = [verdict(seed) for seed in range(12)]
    assert len({one.family for one in found}) == 6
    assert not [(one.seed, one.wrong) for one in found if one.wrong]


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["roller", "ball", "pin"])
def test_an_answer_that_is_two_percent_wrong_is_found(shape):
    case = pressed(np.random.default_rng(1), shape)
    known, way = case.ways
    wrong = replace(case, ways=(known | {"peak 0": 1.02 * known["peak 0"]}, way))
    assert "peak 0" in judge(1, wrong).wrong[0]


def test_an_upper_half_space_lies_above_in_scenes_of_many_bodies_too():
    pressed, flat = ball(force={"y": -0.05}), HalfSpace("flat", MATERIAL, (ROW,))
    short = run(Scene("short", pressed, flat, 0.0), figures=())
    long = run(
        Scene("long", bodies=(pressed, flat), contacts=(Contact("ball", "flat", 0.0),)), figures=()
    )
    assert np.allclose(long.pressure, short.pressure, atol=1e-9)
    assert long.pressure[len(ROW) // 2] == long.pressure.max()


def test_a_half_space_on_both_sides_is_refused():
    third = HalfSpace("third", MATERIAL, (ROW,))
    pairs = (Contact("ball", "flat", 0.0), Contact("third", "ball", 0.0))
    scene = Scene(
        "three", bodies=(ball(), HalfSpace("flat", MATERIAL, (ROW,)), third), contacts=pairs
    )
    with pytest.raises(InputError, match="upper body of one contact"):
        run(scene, figures=())


def test_rounding_in_the_normals_does_not_hold_a_body_without_friction():
    """The motion along the surface would be 1e28, and the forces those of another problem."""
    rng, k = np.random.default_rng(0), 12
    A = rng.normal(size=(2 * k, 2 * k))
    V = np.zeros((k, 2, 2))
    V[:, 0, 0] = V[:, 1, 1] = 1.0
    plain = solve(
        InterfaceProblem(
            A @ A.T / k + np.eye(2 * k), np.zeros((k, 2)), 0.0, V.reshape(-1, 2), [-1.0, 0.0]
        )
    )
    V[:, 0, 1] = 1e-30 * rng.normal(size=k)
    rounded = solve(
        InterfaceProblem(
            A @ A.T / k + np.eye(2 * k), np.zeros((k, 2)), 0.0, V.reshape(-1, 2), [-1.0, 0.0]
        )
    )
    assert rounded.solved and np.allclose(rounded.multipliers, plain.multipliers, atol=1e-8)
