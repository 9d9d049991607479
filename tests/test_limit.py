"""The factor on a load that friction holds, against statics by hand and Janssen's equation."""

import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from skfem import MeshHex, MeshQuad

from contactopt import (
    BodyForce,
    Contact,
    InputError,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    cli,
    limit,
    run,
)  # fmt: skip
from contactopt.holding import limit_of

STIFF = Material(E=200.0, nu=0.3)


def quadrilateral(corners, names, cells=(8, 4)):
    """A mesh between four corners, from the lower left one on, and the names of its sides."""
    mesh = MeshQuad.init_tensor(*(np.linspace(0, 1, n + 1) for n in cells))
    x, y = mesh.p
    sides = ("bottom", y == 0), ("right", x == 1), ("top", y == 1), ("left", x == 0)
    ends = {name: mesh.facets[:, mesh.boundary_facets()] for name, _ in sides}
    found = {
        names.get(name, name): mesh.boundary_facets()[on[ends[name]].all(axis=0)]
        for name, on in sides
    }
    weights = (1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y
    p = sum(np.outer(corner, weight) for corner, weight in zip(corners, weights))
    return replace(mesh, doflocs=p, _boundaries=found)


def slope(angle=0.0, mu=0.3, support=()):
    """A block, 2 wide and 1 high, of weight 2, on a plane that falls to the right; pushed along."""
    mesh = quadrilateral([(0, 0), (2, 0), (2, 1), (0, 1)], {})
    weight = BodyForce((math.sin(math.radians(angle)), -math.cos(math.radians(angle))))
    loads = (weight, Traction("left", (1.0, 0.0)))
    block = Part("block", mesh, STIFF, support, loads, contact="bottom")
    return Scene("slope", block, Rigid("plane"), mu)


def pressed():
    """The block under a load within the cone of friction and nothing else."""
    part = replace(slope().upper, loads=(Traction("top", (0.1, -1.0)),))
    return replace(slope(), upper=part)


def beneath(push):
    """The block, without weight, pushed along by `push` under a load of 2 that presses it down:
    friction holds it from push / 0.6 times that load on.
    """
    loads = Traction("top", (0.0, -1.0)), Traction("left", (push, 0.0))
    return replace(slope(), upper=replace(slope().upper, loads=loads))


def wedge(mu=0.2, angle=10.0):
    """A wedge that is driven under a block of weight W = 2 beside a wall: W tan(angle + 2 phi)."""
    high = 0.5 + 2 * math.tan(math.radians(angle))
    low = quadrilateral([(0, 0), (2, 0), (2, 0.5), (0, high)], {})
    top = quadrilateral([(0, high), (2, 0.5), (2, 3), (0, 3)], {})
    bodies = (
        Part("wedge", low, STIFF, (), (Plate("left", {"x": 1.0}, glued=False),), "top"),
        Part("block", top, STIFF, (), (Traction("top", (0.0, -1.0)),), "bottom"),
        Rigid("floor"),
        Rigid("wall"),
    )
    pairs = (
        Contact("block:bottom", "wedge:top", mu),
        Contact("wedge:bottom", "floor", mu),
        Contact("block:right", "wall", mu),
    )
    return Scene("wedge", bodies=bodies, contacts=pairs)


W, RISE, RUN, PERSON = (
    0.05,
    3.0,
    2.0,
    0.75,
)  # of the ladder: width, height, reach, the person's place


def ladder(mu=0.35):
    """A ladder of weight G against a wall, and a person on it."""
    foot, head = [(-W, 0), (W, 0)], [(RUN, RISE - W), (RUN, RISE + W)]
    mesh = quadrilateral([*foot, *head], {"bottom": "foot", "top": "head"}, (4, 48))
    step = mesh.facets[:, mesh.boundaries["left"]]
    middle = mesh.p[:, step].mean(axis=1)
    on = np.abs(middle[0] - PERSON * RUN) < 0.1
    mesh = mesh.with_boundaries({"step": mesh.boundaries["left"][on]})
    loads = (BodyForce((0.0, -1.0)), Traction("step", (0.0, -1.0)))
    part = Part("ladder", mesh, STIFF, (), loads, "foot")
    pairs = Contact("ladder:foot", "floor", mu), Contact("ladder:head", "wall", mu)
    bodies = part, Rigid("floor"), Rigid("wall")
    return Scene("ladder", bodies=bodies, contacts=pairs)


def ladder_by_hand(scene, mu=0.35):
    """The person P that friction holds, by forces and moments about the foot: floor N, mu N, wall
    mu N, mu^2 N, both at the corners that hold most.
    """
    mesh = scene.parts[0].mesh
    x, y = np.array([(-W, 0), (W, 0), (RUN, RISE - W), (RUN, RISE + W)]).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    G, own = cross.sum() / 2, (cross * (x + np.roll(x, -1))).sum() / (3 * cross.sum())
    ends = mesh.p[:, mesh.facets[:, mesh.boundaries["step"]]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    P, place = lengths.sum(), (lengths * ends[0].mean(axis=0)).sum() / lengths.sum()
    # with the share w = mu / (1 + mu^2) of G + f P at the wall
    arm = mu / (1 + mu**2) * (RISE + W + mu * (RUN - W))
    return G * (arm + W - own) / (P * (place - W - arm))


MU, NU, THICK, LONG = 0.1, 0.3, 0.01, 10.0


def shaft(cells=5):
    """A shaft of radius 1 in a rigid bore that is narrower by THICK, pushed at its top."""
    mesh = quadrilateral([(0, 0), (1, 0), (1, LONG), (0, LONG)], {}, (cells, 10 * cells))
    loads = (Plate("top", {"z": -1.0}, glued=False),)
    part = Part("shaft", mesh, Material(E=200.0, nu=NU), (), loads, "right")
    bore = Rigid("bore", gap=lambda x: np.full(x.shape[1], -THICK))
    return Scene("shaft", part, bore, MU, kind="axisymmetric")


def janssen():
    """The push grows along the shaft with its own widening: with p (1 - nu) = E thick / a + nu q,
    q' = 2 mu p / a and q = 0 at the free end.
    """
    rate = 2 * MU * NU / (1 - NU)
    return math.pi * 200.0 * THICK / NU * math.expm1(rate * LONG)


def clamped(force=2.0, washers=10.0):
    """Two plates pressed together by washers; the upper one is pulled, and the lower one held."""

    def plate(name, y, side, load, support, contact):
        mesh = quadrilateral([(0, y), (8, y), (8, y + 1), (0, y + 1)], {}, (16, 3))
        mesh = mesh.with_boundaries({"washer": mesh.boundaries[side][4:12]})
        press = Plate("washer", {"y": -washers if side == "top" else washers}, glued=False)
        return Part(name, mesh, STIFF, support, (press, *load), contact)

    pull = (Plate("right", {"x": force}, glued=False),)
    up = plate("up", 0, "top", pull, (), "bottom")
    low = plate("low", -1, "bottom", (), (Support("left"),), "top")
    return Scene("clamp", up, low, 0.3)


SIN10, COS10 = math.sin(math.radians(10.0)), math.cos(math.radians(10.0))
CASES = {
    "plane": (slope, "block:left", 0.6, "statics"),
    "falling": (partial(slope, 10.0), "block:left:x", 2 * (0.3 * COS10 - SIN10), "statics"),
    "too steep": (partial(slope, 10.0, 0.1), "block:left", 2 * (0.1 * COS10 - SIN10), "statics"),
    "rising": (partial(slope, -20.0, 0.3), "block:left",
               2 * (0.3 * math.cos(math.radians(20)) + math.sin(math.radians(20))), "statics"),
    "tips over": (partial(slope, 0.0, 3.0), "block:left", 4.0, "statics"),
    "no friction": (partial(slope, 0.0, 0.0), "block:left", 0.0, "statics"),
    "wedge": (wedge, "wedge:left:x",
              2 * math.tan(math.radians(10.0) + 2 * math.atan(0.2)), "statics"),
    "ladder": (ladder, "ladder:step", ladder_by_hand(ladder()), "statics"),
    "clamp": (clamped, "up:right", 1.5, "statics"),
    "shaft": (shaft, "shaft:top", janssen(), "push"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_limit_is_that_of_statics_or_of_janssen(name):
    make, load, exact, way = CASES[name]
    found = limit(make(), load)
    assert found.factor == pytest.approx(exact, rel=0.01, abs=1e-6), found
    assert found.way == way
    if way == "statics":
        assert found.factor == pytest.approx(exact, rel=1e-5, abs=1e-6), found


@pytest.mark.parametrize("angle", [0.0, 35.0])
def test_in_space_friction_is_a_cone(angle):
    """mu W = 0.6 in every direction, of a block of weight 2 and of 4 x 4 x 2 elements."""
    ticks = (np.linspace(0, 2, 5), np.linspace(0, 2, 5), np.linspace(0, 0.5, 3))
    mesh = MeshHex.init_tensor(*ticks).with_boundaries({"bottom": lambda x: x[2] == 0})
    turn = math.radians(angle)
    push = BodyForce((0.5 * math.cos(turn), 0.5 * math.sin(turn), 0.0))
    loads = (BodyForce((0.0, 0.0, -1.0)), push)
    block = Part("block", mesh, STIFF, (), loads, "bottom")
    scene = Scene("block", block, Rigid("floor"), 0.3, kind="solid")
    lone = replace(scene, upper=replace(block, loads=loads[:1]))
    found = limit_of((replace(lone, state="weight"), replace(scene, state="push")))
    assert found.factor == pytest.approx(0.6, rel=1e-4) and found.way == "statics", found


def test_a_run_solves_below_the_limit_and_points_at_it_above():
    """Equilibrium alone decides here: a run shares neither the push nor the cone program."""
    found = limit(shaft(), "shaft:top")
    load = Plate("top", {"z": -0.98 * found.factor}, glued=False)
    assert run(replace(shaft(), upper=replace(shaft().upper, loads=(load,)))).solution.solved
    with pytest.raises(InputError, match="contactopt limit finds the load"):
        part = slope().upper
        run(
            replace(slope(), upper=replace(part, loads=(part.loads[0], Traction("left", (0.7, 0)))))
        )


def test_the_last_step_of_a_path_is_the_load():
    states = [replace(clamped(force), state=name) for force, name in ((0, "press"), (2, "pull"))]

    found = limit_of(tuple(states))
    assert found.factor == pytest.approx(1.5, rel=1e-5) and "(3 " in found.sentence
    assert found.interval == pytest.approx((-1.5, 1.5), rel=1e-5)


@pytest.mark.parametrize(("scene", "load", "factor", "said"), [
    (slope(0.0, 0.0), "block:left", 0.0, "any amount of block:left"),
    (slope(support=(Support("right", {"x": 0.0}),)), "block:left", np.inf, "supports bear"),
    (pressed(), "block:top", np.inf, "below 0 times block:top, and at no larger"),
    (beneath(0.5), "block:top", np.inf,
     "below 0.83333 times block:top, and at no larger ... load as given, friction can"),
    (beneath(0.65), "block:top", np.inf,
     "below 1.0833 times block:top, and at no larger ... load as given, they do"),
    (slope(0.0, 3.0), "block:left", 4.0, "slide away, tip over or lift off above 4 times"),
    pytest.param(*(slope(), "block:body_force", np.inf, "friction grows with the load"),
     marks=pytest.mark.slow),
    (slope(30.0, 0.1), "block:body_force", 0.0, "whatever the factor on block"),
    (slope(10.0, 0.1), "block:left:x", -0.15033, "At 1, the load as given, they do."),
    (slope(-30.0, 0.1), "block:left:x", 1.1732,
     "below 0.82679 times it. At 1, the load as given, friction can"),
])  # fmt: skip
def test_zero_infinity_and_what_lies_between_are_said_in_words(scene, load, factor, said):
    found = limit(scene, load)
    assert found.factor == pytest.approx(factor, rel=1e-4), found
    assert all(words in str(found) for words in said.split(" ... ")), found


@pytest.mark.slow
def test_a_wedge_that_locks_itself_rests_only_where_its_forces_arise():
    """Forces in the cones balance any pull on it."""
    mesh = quadrilateral([(-0.5, 0), (0.5, 0), (1, 1), (-1, 1)], {}, (4, 2))
    loads = Traction("top", (0.0, -0.5)), BodyForce((0.0, 0.1))
    body = Part("wedge", mesh, Material(1000.0, 0.3), loads=loads)
    pairs = Contact("wedge:left", "a", 0.7), Contact("wedge:right", "b", 0.7)
    scene = Scene("locked", bodies=(body, Rigid("a"), Rigid("b")), contacts=pairs)
    found = limit(scene, "wedge:top:y")
    assert found.factor == np.inf and 0.13 < found.interval[0] <= 0.15
    assert "found by solving" in str(found)


def test_contacts_that_are_open_may_stop_a_body_that_slides():
    mesh = quadrilateral([(0, 0), (2, 0), (2, 1), (0, 1)], {}, (4, 2))
    loads = BodyForce((0.0, -1.0)), Traction("left", (1.0, 0.0))
    body = Part("block", mesh, Material(1000.0, 0.3), loads=loads)
    wall = Rigid("wall", gap=lambda x: 0.01 + 0 * x[0])
    pairs = Contact("block:bottom", "floor", 0.3), Contact("block:right", "wall", 0.0)
    found = limit(Scene("stop", bodies=(body, Rigid("floor"), wall), contacts=pairs), "block:left")
    assert found.factor == pytest.approx(0.6, rel=1e-4)
    assert "unless contacts that are open now stop them" in str(found)


def test_associated_friction_holds_more_than_that_of_coulomb():
    """A block between two walls: it jams where slip dilates, and slides where it does not."""
    mesh = quadrilateral([(0, 0), (2, 0), (2, 1), (0, 1)], {})
    tight = Rigid("roof", normal=(0.0, -1.0), gap=lambda x: np.full(x.shape[1], -0.01))
    part = Part("block", mesh, STIFF, (), (Traction("left", (1.0, 0.0)),), contact="bottom")
    found = {}
    for law in ("coulomb", "associated"):
        pairs = Contact("block:bottom", "floor", 0.3, law), Contact("block:top", "roof", 0.3, law)
        scene = Scene("jam", bodies=(part, Rigid("floor"), tight), contacts=pairs)
        found[law] = limit(scene, "block:left").factor
    assert 0 < found["coulomb"] < np.inf == found["associated"]


def test_loads_that_are_not_there_are_refused_and_the_command_says_the_answer(capsys, tmp_path):
    with pytest.raises(
        InputError, match="name the load that grows; its loads are block:body_force:y"
    ):
        limit(slope())
    with pytest.raises(InputError, match=r"no load .block:right.; its loads are .*block:left:x"):
        limit(slope(), "block:right")
    assert cli.main(["limit", "stack", "--load", "nothing", "-q"]) == 2
    assert "has no load 'nothing'" in capsys.readouterr().err
    named = ["limit", "punch-2d", "--set", "elements=4", "-q", "--load", "punch:top:y"]
    code = cli.main(named)
    assert "punch" in capsys.readouterr().out and code in (0, 1)


def test_an_open_corner_that_closes_after_a_turn_is_not_counted():
    """A bar leans at 60 degrees, touched at one corner of each end."""
    length, width, lean, mu = 4.0, 0.2, math.pi / 3, 0.5
    cosine, sine = math.cos(lean), math.sin(lean)
    turned = np.array([[cosine, -sine], [sine, cosine]]) @ [
        [0, length, length, 0],
        [0, 0, width, width],
    ]
    names = {"left": "foot", "right": "head"}
    mesh = quadrilateral(turned.T, names, (8, 1))
    loads = (BodyForce((0, -1.0)), Traction("foot", (-1.0, 0.0)))
    bar = Part("bar", mesh, STIFF, (), loads)
    floor = Rigid("floor", normal=(0.0, 1.0), gap=lambda x: x[1])
    wall = Rigid("wall", normal=(-1.0, 0.0), gap=lambda x: length * cosine - x[0])
    pairs = (Contact("bar:foot", "floor", mu), Contact("bar:head", "wall", 0.0))
    found = limit(Scene("ladder", bodies=(bar, floor, wall), contacts=pairs), "bar:foot:x")
    weight, head = length * width, turned[:, 1]
    middle, foot = turned.mean(axis=1), (turned[:, 0] + turned[:, 3]) / 2
    # moments about the lower corner of the foot, with N = weight and H = mu N - f width at the wall
    f = (mu * weight * head[1] - weight * middle[0]) / (width * (head[1] - foot[1]))
    assert found.factor == pytest.approx(f, rel=1e-4)
    assert "after a motion that is not small" in found.sentence


def test_the_progress_has_no_rounding_for_zero_and_counts_in_the_singular():
    notes = []
    for scene in (pressed(), slope(support=(Support("left", {"x": 0.0}),))):
        limit_of(
            (scene,),
            f"{scene.upper.name}:{scene.upper.loads[0].boundary or 'body_force'}",
            notes.append,
        )
    assert "push 1: 0 times the load" in notes
    assert not [text for text in notes if re.search(r"\de-1\d|\b1 \w+s\b", text)], notes
