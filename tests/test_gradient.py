"""Gradients of quantities of scenes by the parameters of the scenes."""

from dataclasses import replace

import numpy as np
import pytest

import contactopt
from contactopt import InputError, follow, scenes
from contactopt.coupling.reduction import reduce_bodies
from contactopt.derivatives.states import chain_of
from contactopt.methods.driver import solve
from contactopt.readings.quantities import Functional, seeds_of
from contactopt.scenes.parameters import parameter, parameters
from contactopt.solving.solve_scene import Solved

CASES = {
    "plane strain": (
        lambda: scenes.flat_punch(2, elements=8),
        ("mu", "E:punch", "nu:foundation", "force:punch:y"),
        (
            "approach",
            "energy",
            "pressure:3",
            "pressure",
            "von_mises:punch@0.1,0.2",
            "stress_xy:foundation@0.3,-0.4",
            "pressure@0.3,0",
            "displacement:punch:contact:x",
            "displacement:foundation:x+",
            "reaction:foundation:bottom/x+:y",
        ),
    ),
    "axisymmetric": (
        lambda: scenes.make_scene("sphere", elements=6),
        ("E", "nu", "force:sphere:z"),
        ("approach", "width", "von_mises:sphere", "displacement:foundation:contact:z"),
    ),
    "solid": (
        lambda: scenes.flat_punch(3, elements=3),
        ("nu:punch", "mu"),
        ("approach", "energy", "von_mises:foundation@0.1,0.2,-0.3", "pressure@0.3,0.1,0"),
    ),
    "half-spaces": (
        lambda: scenes.make_scene("cattaneo-half-space", elements=4),
        ("nu", "mu", "force:sphere:x"),
        ("shift", "energy"),
    ),
    "several bodies": (
        lambda: scenes.make_scene("stack"),
        ("E", "nu"),
        ("energy", "pressure:block-2-block-1.top"),
    ),
}


def solved(scene, start=None):
    reduction = reduce_bodies(scene)
    return Solved(reduction, solve(reduction.problem, tol=1e-13, start=start))


def value(quantity, result):
    return seeds_of(quantity, chain_of(result).steps[-1]).value


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_what_central_differences_of_solved_scenes_say(case):
    make, names, quantities = CASES[case]
    scene = make()
    base = solved(scene)
    found = {quantity: contactopt.gradient(base, quantity, names) for quantity in quantities}
    assert all(one.differentiable for one in found.values())
    for which in parameters(names, scene):
        at = which.read(scene)
        h = 2e-5 * (abs(at) or 1.0)
        up, down = (solved(which.put(scene, at + t), base.solution) for t in (h, -h))
        for quantity, one in found.items():
            wanted = (value(quantity, up) - value(quantity, down)) / (2 * h)
            size = max(abs(wanted), 1e-2 * abs(one.value / (at or 1.0)))
            assert abs(one.by[which.name] - wanted) < 1e-6 * size, (quantity, which.name)
            assert abs(one.onesided({which.name: 1.0}) - one.by[which.name]) < 1e-9 * size


def test_the_gradient_by_the_gap_and_the_friction_of_every_contact():
    scene = scenes.make_scene("cattaneo-2d", elements=6)
    base = solved(scene)
    one = contactopt.gradient(base, "shift", ("gap", "friction"))
    rng, problem = np.random.default_rng(0), base.reduction.problem
    gap, friction = rng.normal(size=(2, problem.contacts))
    h = 1e-6
    for direction, name in ((gap, "gap"), (friction, "friction")):
        ends = []
        for t in (h, -h):
            q = problem.q + t * (name == "gap") * np.stack([gap, 0 * gap], axis=1)
            law = problem.law.shifted(t * friction) if name == "friction" else problem.law
            there = replace(problem, q=q, law=law)
            ends.append(replace(base.reduction, problem=there))
        values = [
            value("shift", Solved(end, solve(end.problem, tol=1e-13, start=base.solution)))
            for end in ends
        ]
        wanted = (values[0] - values[1]) / (2 * h)
        assert abs(one.by[name] @ direction - wanted) < 1e-6 * abs(wanted)
        assert abs(one.onesided({name: direction}) - wanted) < 1e-6 * abs(wanted)


def loop():
    """Pressed, pushed forth, and half-way back: slip, stick and slip the other way."""
    scene = scenes.make_scene("cattaneo-2d", elements=5, shear=0.0)
    push = parameter("force:upper:x", scene)
    return [push.put(scene, shear) for shear in (0.0, 40.0, -25.0)]


@pytest.mark.slow
def test_gradients_along_a_load_path_forward_and_adjoint():
    states, h = loop(), 1e-5
    result = follow(states, tol=1e-13)
    names = ("E:lower", "mu")
    read = {
        "shift": lambda history: history["shift"][-1],
        "energy": lambda history: history["elastic_energy"][-1],
        "stick": lambda history: (history["stick_half_width"] / history["contact_half_width"])[-1],
    }
    found = {quantity: contactopt.gradient(result, quantity, names) for quantity in read}
    for name in names:
        which = parameter(name, states[0])
        ends = [
            follow([which.put(s, which.read(s) + t) for s in states], tol=1e-13).history
            for t in (h, -h)
        ]
        for quantity, one in found.items():
            assert one.value == pytest.approx(read[quantity](result.history), rel=1e-9)
            wanted = (read[quantity](ends[0]) - read[quantity](ends[1])) / (2 * h)
            size = max(abs(wanted), 0.1 * abs(one.value))
            assert abs(one.by[name] - wanted) < 1e-6 * size, (quantity, name)
    shift = found["shift"]
    assert shift.onesided({"mu": 1.0}) == pytest.approx(shift.by["mu"], rel=1e-9)
    assert contactopt.gradient(result, "shift", "mu", state=1).value == pytest.approx(
        result.history["shift"][1]
    )


def test_resultants_and_functionals():
    base = solved(scenes.flat_punch(2, elements=6))
    pair = base.reduction.problem.pairs[0].name
    one = contactopt.gradient(base, f"resultant:{pair}:y", "force:punch:y")
    assert one.value == pytest.approx(100.0) and one.by["force:punch:y"] == pytest.approx(-1.0)
    weights = np.zeros(base.reduction.problem.q.shape)
    weights[:, 0] = 1.0
    assert contactopt.gradient(base, Functional(weights), "E").value == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("quantity", "names", "sentence"),
    [
        ("approach", "E:piston", "has no body 'piston'"),
        ("approach", "speed", "unknown parameter 'speed'"),
        ("approach", "force:punch:z", "no component 'z'"),
        ("approach", "traction:punch:top:y", "no such traction"),
        ("approach", ("mu", "mu"), "each of them once"),
        ("colour", "mu", "unknown quantity 'colour'"),
        ("pressure:1000", "mu", "needs the number of a contact"),
    ],
)
def test_bad_names_are_refused_in_one_sentence(quantity, names, sentence):
    base = solved(scenes.flat_punch(2, elements=4))
    with pytest.raises(InputError, match=sentence):
        contactopt.gradient(base, quantity, names)


def test_what_is_not_solved_has_no_gradient():
    reduction = reduce_bodies(scenes.flat_punch(2, elements=4))
    rough = Solved(reduction, solve(reduction.problem, "nsgs", tol=1e-14, max_iterations=1))
    with pytest.raises(InputError, match="only a certified solution"):
        contactopt.gradient(rough, "approach", "mu")
    with pytest.raises(InputError, match="needs a solved scene"):
        contactopt.gradient(reduction.scene, "approach", "mu")
