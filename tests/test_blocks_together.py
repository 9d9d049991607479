"""Blocks that fill a box and meet at edges and corners bear a uniform pressure without a remark."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from test_crosspoints import MATERIAL, box
from turned import turn_about

from contactopt import Contact, Material, Part, Pressure, Scene, Support, run


def blocks(*each, laws=("tied",), degree=1):
    """Blocks (low, high, cells, kind) that fill a box, on rollers and under a pressure of one."""
    low = np.min([one[0] for one in each], axis=0)
    high = np.max([one[1] for one in each], axis=0)
    axes, parts, contacts = "xyz"[: len(low)], [], []
    for i, (start, end, cells, kind) in enumerate(each):
        held = tuple(Support(f"{a}-", {a: 0.0}) for a, x, y in zip(axes, start, low) if x == y)
        loads = tuple(Pressure(f"{a}+", 1.0) for a, x, y in zip(axes, end, high) if x == y)
        mesh = box(start, end, cells, kind)
        parts.append(Part(f"B{i}", mesh, MATERIAL, held, loads, contact="x-"))
    for (i, one), (j, other) in permutations(enumerate(each), 2):
        overlap = np.minimum(one[1], other[1]) - np.maximum(one[0], other[0])
        for a, axis in enumerate(axes):
            if one[0][a] == other[1][a] and np.all(np.delete(overlap, a) > 0):
                law = laws[len(contacts) % len(laws)]
                mu = 0.3 if law == "coulomb" else 0.0
                contacts.append(Contact(f"B{i}:{axis}-", f"B{j}:{axis}+", mu, law))
    kind = "solid" if len(axes) == 3 else "plane-strain"
    return Scene("4", bodies=tuple(parts), contacts=tuple(contacts), kind=kind, degree=degree)


def slanted(scene, A):
    """The scene with every point x at A x, under a pressure of one on all sides, and pinned."""
    parts, pins = [], (Support("x-/y-/z-"), Support("x+/y-/z-", {"y": 0, "z": 0}))
    pins = (*pins, Support("x-/y+/z-", {"z": 0}))
    if len(A) == 2:
        pins = Support("x-/y-"), Support("x+/y-", {"x": 0})
    for part in scene.bodies:
        loads = (*part.loads, *(Pressure(held.boundary, 1.0) for held in part.supports))
        mesh = replace(part.mesh, doflocs=A @ part.mesh.p)
        held = () if parts else pins
        parts.append(replace(part, mesh=mesh, supports=held, loads=loads))
    return replace(scene, bodies=tuple(parts))


def stiff(scene):
    return replace(
        scene, bodies=tuple(replace(part, material=Material(1e4, 0.3)) for part in scene.bodies)
    )


PLATE = ((0, 0, 0), (2, 2, 0.4), (3, 3, 1), "tri")
CASES = {
    "a contact moves off the node that a roller holds": blocks(
        ((0, 0), (2, 0.4), (4, 1), "tri"),
        ((0, 0.4), (0.25, 0.9), (1, 1), "quad"),
        ((0.25, 0.4), (2, 0.9), (4, 1), "tri"),
        degree=2,
    ),
    "it moves along the roller": blocks(
        ((0, 1.03, 0), (0.75, 2, 1), (3, 2, 2), "quad"),
        ((0.75, 0, 0), (1.5, 1.22, 1), (2, 3, 2), "quad"),
        ((0.75, 1.22, 0), (1.5, 2, 1), (3, 3, 3), "tri"),
        ((0, 0, 0), (0.75, 1.03, 1), (2, 3, 3), "quad"),
        degree=2,
    ),
    "it moves out of the other surface": blocks(
        PLATE,
        ((0, 1, 0.4), (1.06, 2, 0.9), (2, 2, 1), "tri"),
        ((1.06, 1, 0.4), (2, 2, 0.9), (2, 2, 1), "tri"),
        ((0, 0, 0.4), (2, 1, 0.9), (2, 2, 1), "tri"),
        laws=("tied", "frictionless"),
        degree=2,
    ),
    "what is left of a tie covers faces in part": blocks(
        ((0, 0), (2, 0.4), (6, 2), "tri"),
        ((0, 0.4), (0.5, 0.9), (2, 2), "quad"),
        ((0.5, 0.4), (2, 0.9), (6, 2), "tri"),
        ((0, 0.9), (2, 1.3), (6, 2), "quad"),
        degree=2,
    ),
    "a contact stands for a weak one, too": blocks(
        ((0, 0, 0), (1, 0.3, 2), (4, 1, 4), "quad"),
        ((0, 0.3, 0), (1, 1, 2 / 3), (2, 2, 1), "tri"),
        ((0, 0.3, 2 / 3), (1, 1, 2), (2, 1, 2), "tri"),
        laws=("frictionless",),
    ),
    "an edge in space exchanges forces": blocks(
        ((0, 0, 0), (0.5, 1, 1), (1, 1, 1), "tri"),
        ((0.5, 0, 0), (1, 1, 0.33), (1, 1, 1), "quad"),
        ((0.5, 0, 0.33), (1, 1, 0.67), (1, 1, 1), "quad"),
        ((0.5, 0, 0.67), (1, 1, 1), (1, 1, 1), "quad"),
        ((1, 0, 0), (1.5, 1, 1), (1, 1, 1), "tri"),
        laws=("coulomb", "tied", "coulomb", "frictionless", "tied"),
        degree=2,
    ),
    "ties that meet at a line are of few elements": blocks(
        ((0, 0, 0), (0.5, 1, 0.5), (2, 1, 1), "quad"),
        ((0, 0, 0.5), (0.5, 1, 1), (2, 1, 2), "quad"),
        ((0.5, 0, 0), (1, 0.5, 1), (2, 1, 1), "quad"),
        ((0.5, 0.5, 0), (1, 1, 1), (3, 3, 1), "tri"),
        laws=("coulomb", "tied", "coulomb", "tied", "tied", "tied"),
    ),
    "two surfaces share a face of slanted blocks": slanted(
        blocks(
            ((0, 0, 0.5), (1, 1, 1), (3, 1, 1), "quad"),
            ((0, 0, 0), (1, 0.3, 0.5), (2, 1, 2), "quad"),
            ((0, 0.3, 0), (1, 1, 0.5), (1, 1, 3), "quad"),
            laws=("coulomb", "tied", "tied"),
        ),
        turn_about((1, 2, 3), 40) @ [[1, 0.3, -0.2], [0, 1, 0.4], [0, 0, 1]],
    ),
    "forces that are hardly felt are exchanged": slanted(
        blocks(
            ((0, 0), (1, 2 / 3), (1, 5), "tri"),
            ((0.25, 2 / 3), (1, 1), (4, 4), "quad"),
            ((0, 2 / 3), (0.25, 5 / 6), (3, 5), "quad"),
            ((0, 5 / 6), (0.25, 1), (5, 3), "tri"),
            laws=("coulomb",),
            degree=2,
        ),
        np.array([[1.0, 1.94], [-1.81, 0.32]]),
    ),
    "pins that let a body turn easily": slanted(
        stiff(blocks(((0, 0), (1, 1), (2, 2), "quad"), ((1, 0), (2, 1), (3, 3), "tri"), degree=2)),
        turn_about((0, 0, 1), 0.5)[:2, :2],
    ),
    "a thin body between two others sees all of their contacts": blocks(
        ((0, 1 / 3, 0), (1, 1, 1 / 3), (2, 2, 1), "quad"),
        ((0, 0, 0), (1, 2 / 9, 1 / 3), (1, 2, 2), "tri"),
        ((0, 2 / 9, 0), (1, 1 / 3, 1 / 3), (1, 2, 2), "quad"),
        degree=2,
    ),
    "ties of one element": blocks(
        ((0, 0), (2, 0.4), (6, 1), "quad"),
        ((0, 0.4), (0.5, 0.9), (1, 1), "quad"),
        ((0.5, 0.4), (1.5, 0.9), (3, 1), "quad"),
        ((1.5, 0.4), (1.75, 0.9), (1, 1), "quad"),
        ((1.75, 0.4), (2, 0.9), (1, 1), "quad"),
        laws=("tied", "tied", "coulomb"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_uniform_pressure_is_exact_and_no_remark_is_made(case):
    result = run(CASES[case], figures=(), tol=1e-11)
    exact = [-1, -1, -0.6, 0] if result.problem.dim == 2 else [-1, -1, -1, 0, 0, 0]
    assert np.abs(result.pressure - 1).max() < 1e-7
    assert max(np.abs(body.stress - exact).max() for body in result.fields) < 1e-7
    assert not result.summary["remarks"]
