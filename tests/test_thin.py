"""Thin layers that contact and one support hold, down to 1e-4 of the width."""

import numpy as np
import pytest

from contactopt import (
    Contact,
    Material,
    Part,
    Rigid,
    Scene,
    Support,
    Traction,
    follow,
    gradient,
    natural_map_residual,
    run,
)
from contactopt.coupling.reduction import reduce_bodies
from contactopt.meshes.structured import rename, tensor_mesh

E, NU = 1000.0, 0.3
SOFT = Material(E, NU)


def shim(dim, thickness, degree, elements, **held):
    """A layer on a block of other elements, pressed by a uniform traction: both are in a uniform
    state.
    """
    up, axes = "xyz"[dim - 1], "xyz"[: dim - 1]
    sides = tuple(Support(f"{axis}-", {axis: 0.0}) for axis in axes)

    def box(n, *heights):
        return tensor_mesh(*[np.linspace(0, 1, n + 1)] * (dim - 1), np.array(heights))

    top = rename(box(elements, 0.0, thickness / 2, thickness), contact=f"{up}-")
    base = rename(box(elements - 3, -0.5, -0.25, 0.0), contact=f"{up}+")
    pressure = Traction(f"{up}+", (0.0,) * (dim - 1) + (-1.0,))
    layer = Part("shim", top, SOFT, held.get("supports", sides), (pressure,))
    block = Part("block", base, SOFT, (Support(f"{up}-", {up: 0.0}), *sides))
    kind = "plane-strain" if dim == 2 else "solid"
    return Scene("shim", layer, block, held.get("mu", 0.0), kind=kind, degree=degree)


@pytest.mark.parametrize(
    "dim,degree,elements,thickness",
    [
        (2, 1, 16, 1e-3),
        (2, 1, 16, 1e-4),
        (2, 2, 16, 1e-3),
        (2, 2, 16, 1e-4),
        (3, 1, 5, 1e-4),
        (3, 2, 4, 1e-4),
    ],
)
def test_a_layer_in_a_uniform_state(dim, degree, elements, thickness):
    made = run(shim(dim, thickness, degree, elements), figures=())
    modulus, mises = (E / (1 - NU**2), np.sqrt(1 - NU + NU**2)) if dim == 2 else (E, 1.0)
    assert made.solution.solved and made.summary["remarks"] == []
    assert all(body["imbalance"] < 1e-6 for body in made.summary["limits"]["bodies"].values())
    layer = made.fields[0]
    assert layer.displacement[-1].min() == pytest.approx(-(0.5 + thickness) / modulus, rel=1e-4)
    assert np.allclose(layer.von_mises, mises, rtol=1e-3)
    assert made.summary["max_pressure"] == pytest.approx(1.0, rel=1e-5)


def test_a_layer_that_friction_alone_holds():
    made = run(shim(2, 1e-4, 2, 12, supports=(), mu=0.3), figures=())
    assert made.solution.solved and made.summary["remarks"] == []
    assert made.summary["max_pressure"] == pytest.approx(1.0, rel=1e-3)


def test_a_coating_between_two_contacts_is_reduced_and_does_not_matter():
    """A coating of the block's material passes the pressure of the punch on."""
    layer, block = shim(2, 1e-4, 2, 15).parts
    coat = Part("coat", layer.mesh, SOFT, (Support("x-", {"x": 0.0}),))
    punch = Rigid("punch", normal=(0, 1), gap=lambda x: x[0] ** 2 / 8, force={"y": -1.0})
    pairs = (Contact("punch", "coat:y+", 0.2), Contact("coat", "block", 0.2))
    scene = Scene("coated", bodies=(punch, coat, block), contacts=pairs, degree=2)
    made = run(scene, figures=())
    assert made.solution.solved and np.all(np.isfinite(made.problem.Q))
    assert max(body["imbalance"] for body in made.summary["limits"]["bodies"].values()) < 1e-4
    assert np.isclose(made.summary["pairs"]["coat-block"]["force"][1], 1.0, rtol=1e-6)


def test_compact_bodies_have_no_ground():
    reduction = reduce_bodies(shim(2, 0.2, 2, 8))
    assert reduction.grounded() is None


def test_a_strip_that_friction_holds_remembers_its_slip():
    """A strip on a rigid floor under an even pressure p, pulled at its end by F per depth and
    pushed back. Friction q = mu p holds it beyond l = F / q, where the strip of stiffness k = E h
    has slipped by q (l - x)^2 / 2 k. The work of friction is D = F^3 / 6 k q at first; each
    reversal works over the same length with twice the force at twice the stretch, and costs 2 D.
    """
    length, h, p, mu, pull = 12.0, 0.1, 2.0, 0.5, 8.0
    ticks = np.linspace(0, length, 97), np.linspace(0, h, 3)
    mesh = tensor_mesh(*ticks)

    def state(force):
        loads = Traction("y+", (0.0, -p)), Traction("x-", (-force / h, 0.0))
        strip = Part("strip", mesh, Material(E, 0.0), loads=loads, contact="y-")
        return Scene("strip", strip, Rigid("floor"), mu)

    path = follow([state(force) for force in (0.0, pull, -pull, pull)])
    assert path.solved and path.reduction.on_ground
    exact = pull**3 / (6 * E * h * mu * p)
    work = np.diff(path.history["friction_work"]) / exact
    assert work == pytest.approx([1.0, 2.0, 2.0], rel=0.01)
    for step, known in enumerate(path.states):
        assert natural_map_residual(path.problem(step), known.solution.reactions) < 1e-7
    assert "a soft ground holds a thin body" in gradient(path, "energy", ["E:strip"]).sentence
