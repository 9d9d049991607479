"""One mesh knows where a largest value is infinite: at corners, not where an edge goes on."""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from test_crosspoints import box as rectangle

from contactopt import Contact, Material, Part, Pressure, Rigid, Scene, Support, run

STEEL = Material(2e5, 0.3)
SAID = "unless that is rounded, it is infinite"


def box(low, high, cells=8):
    axes = [np.linspace(a, b, round(cells * (b - a)) + 1) for a, b in zip(low, high)]
    make = skfem.MeshQuad if len(low) == 2 else skfem.MeshHex
    last = len(low) - 1
    return make.init_tensor(*axes).with_boundaries({
        "low": lambda x: x[last] == low[last], "high": lambda x: x[last] == high[last]
    })  # fmt: skip


def pressed(upper, lower):
    """Two meshes, or one on a rigid plane, pressed together."""
    dim = len(upper.p)
    axes = "xyz"[:dim]
    down = (Support("high", dict.fromkeys(axes, 0.0) | {axes[-1]: -1e-3}),)
    top = Part("top", upper, STEEL, down, contact="low")
    if lower is None:
        rest = Rigid("rest", (0.0,) * (dim - 1) + (1.0,), lambda x: x[-1])
    else:
        rest = Part("rest", lower, STEEL, (Support("low"),), contact="high")
    kind = "plane-strain" if dim == 2 else "solid"
    return Scene("pressed", bodies=(top, rest), contacts=(Contact("top", "rest", 0.0),), kind=kind)


PLANE = [
    (box((0, 0), (2, 1)), box((-1, -1), (3, 0)), True),  # a punch
    (box((-1, 0), (3, 1)), box((0, -1), (2, 0)), True),  # the same upside down
    (box((0, 0), (2, 1)), box((0, -1), (2, 0)), False),  # two halves of one block
    (box((0, 0), (2, 1)), None, False),  # half of a block twice as high
    (box((0, 0), (2, 1)), box((0, -1), (3, 0)), True),  # a step on one side
]
SOLID = [
    (box((0, 0, 0), (1, 1, 1), 4), box((-1, -1, -1), (2, 2, 0), 4), True),
    (box((0, 0, 0), (1, 1, 1), 4), box((0, 0, -1), (1, 1, 0), 4), False),
]


@pytest.mark.parametrize("upper, lower, infinite", PLANE + SOLID)
def test_pressure_under_a_corner(upper, lower, infinite):
    found = run(pressed(upper, lower), read=("pressure",), figures=()).summary
    reading = found["quantities"]["pressure"]
    assert sum("under a corner" in remark for remark in found["remarks"]) == infinite
    assert (SAID in reading.get("message", "")) == infinite
    assert reading["error"] is None if infinite else reading["error"] is not None


@pytest.mark.parametrize("kind", ["quad", "tri"])
def test_no_pressure_is_infinite_where_other_bodies_go_on(kind):
    """A sleeve in two parts that are tied to each other, around a tube under pressure inside."""
    parts = []
    for name, low, high, cells in (("in", (1, 0), (2, 2), (6, 7)), ("a", (2, 0), (3, 1), (5, 4)),
                                   ("b", (2, 1), (3, 2), (5, 3))):  # fmt: skip
        held = tuple(Support(f"y{s}", {"z": 0.0}) for s, z in (("-", low), ("+", high))
                     if z[1] in (0, 2))  # fmt: skip
        loads = (Pressure("x-", 1.0),) if name == "in" else ()
        mesh = rectangle(low, high, cells, kind)
        parts.append(Part(name, mesh, STEEL, held, loads, contact="x-"))
    pairs = [Contact("b:y-", "a:y+", 0.0, "tied")]
    pairs += [Contact("in:x+", f"{name}:x-", 0.0) for name in "ab"]
    scene = Scene("sleeve", bodies=tuple(parts), contacts=tuple(pairs), kind="axisymmetric")
    for degree in (1, 2):
        assert not run(replace(scene, degree=degree), figures=()).summary["remarks"]


@pytest.mark.parametrize("quantity", ["energy", "pressure"])  # whose estimate says so itself
def test_refined_meshes_say_so_once(quantity):
    scene = pressed(box((0, 0), (2, 1), 4), box((-1, -1), (3, 0), 4))
    result = run(scene, accuracy=0.3, quantity=quantity, adaptive=True, figures=())
    said = "; ".join([*result.summary["remarks"], result.estimate.message])
    assert said.count("under a corner") == 1


@pytest.mark.parametrize("shoulder", [True, False])
def test_stress_at_a_re_entrant_corner(shoulder):
    mesh = box((0, 0), (2, 2))
    mesh = mesh.restrict(lambda x: (x[0] < 1) | (x[1] < 1)) if shoulder else mesh
    mesh = mesh.with_boundaries({
        "low": lambda x: x[1] == 0, "high": lambda x: x[1] == 2, "left": lambda x: x[0] == 0
    })  # fmt: skip
    held = (Support("high", {"y": -1e-3}), Support("left", {"x": 0.0}))
    part = Part("block", mesh, STEEL, held, contact="low")
    scene = Scene("shoulder", part, Rigid("floor", (0.0, 1.0), lambda x: x[1]), 0.0)
    reading = run(scene, read=("von_mises:block",), figures=()).summary["quantities"]
    assert (SAID in reading["von_mises:block"].get("message", "")) == shoulder
