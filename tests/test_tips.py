"""Side walls, tips and places without a normal: what bears there, and what is refused."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import skfem
from test_corners import KINDS, NU, E, box, seated

from contactopt import Contact, Material, Part, Rigid, Scene, Support, Traction, reduce, run, solve
from contactopt.errors import InputError


def walled(outline: np.ndarray, kind: str, dim: int, layers: int = 2):
    """A wall between an outline (2, n), around the origin, and the same at half its size."""
    grids = [np.array([0.0, 1.0]), np.arange(outline.shape[1]), np.linspace(0, 1, layers + 1)]
    mesh = KINDS["quad", dim].init_tensor(*grids[:dim])
    if kind == "tri":
        mesh = mesh.to_meshtri() if dim == 2 else mesh.to_meshtet()
    on = {
        name: mesh.facets_satisfying(partial(lambda x, at: abs(x[0] - at) < 1e-9, at=at), True)
        for name, at in (("inner", 0.0), ("outer", 1.0))
    }
    p = mesh.p.copy()
    p[:2] = (1 + mesh.p[0]) / 2 * outline[:, np.rint(mesh.p[1]).astype(int)]
    return type(mesh)(p, mesh.t).with_boundaries(on)


def bent(angle: float, chords: int = 2, shift: float = 1.0) -> np.ndarray:
    """Two straight lines that turn by an angle [degrees] above the origin."""
    a = np.deg2rad(angle / 2)
    s = np.linspace(1.0, 0.0, chords + 1)
    left = np.array([s * np.cos(a), shift - s * np.sin(a)])
    return np.concatenate([left, left[:, -2::-1] * [[-1], [1]]], axis=1)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_side_wall_bears_nothing_on_a_floor(degree):
    block = box(0.0, 1.0, 4, "quad", 2)
    load = Traction("high1", (0.0, -1.0))
    part = Part(
        "block", block, Material(E, NU), (Support("low0", {"x": 0.0}),), (load,), contact="seat"
    )
    floor = Rigid("floor", normal=(0.0, 1.0), gap=lambda x: x[1])
    problem = reduce(Scene("s", part, floor, mu=0.0, degree=degree))
    pressure = solve(problem).reactions[:, 0] / problem.areas
    below = problem.coordinates[1] < 1e-9
    assert below.sum() == (5 if degree == 1 else 9)
    assert np.allclose(pressure[below], 1.0, rtol=1e-7)


@pytest.mark.parametrize("names", [("tip", "floor"), ("floor", "tip")])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_tip_on_an_elastic_floor_has_one_contact_for_each_normal(degree, names):
    outline = bent(60.0, 3)
    tip = walled(outline, "quad", 2)
    tip = replace(tip, doflocs=tip.p * [[1.0], [-1.0]] + [[0.0], [1.0]])
    floor = box(-1.0, 1.0, 5, "quad", 2)
    floor = replace(floor, doflocs=floor.p - [[0.0], [1.0]])
    material = Material(E, NU)
    load, guide = Traction("inner", (0.0, -1.0)), Support("inner", {"x": 0.0})
    parts = (
        Part("tip", tip, material, (guide,), (load,), contact="outer"),
        Part("floor", floor, material, (Support("low1"),), contact="high1"),
    )
    result = run(Scene("tip", bodies=parts, contacts=(Contact(*names, 0.0),), degree=degree))
    assert result.solution.solved
    at = np.linalg.norm(result.problem.coordinates, axis=0) < 1e-9
    assert at.sum() == (1 if names[1] == "floor" else 2)


def test_the_peak_of_the_pressure_is_read_on_its_own_side():
    scene = seated((4, 4), ("quad", "quad"), 2, 1, (Contact("block", "seat", 0.0),))
    found = run(scene, figures=(), accuracy=0.01, quantity="pressure")
    assert found.estimate.reached and found.estimate.value == pytest.approx(1.0, abs=1e-8)
    assert not any("largest pressure" in text for text in found.summary["remarks"])


def lips():
    """A square with a slit from its left side to its middle."""
    grid = np.linspace(0, 2, 5)
    parts = skfem.MeshQuad.init_tensor(grid, grid[:3]), skfem.MeshQuad.init_tensor(grid, grid[2:])
    p, t = np.hstack([own.p for own in parts]), np.hstack([parts[0].t, parts[1].t + 15])
    same = np.argmax(np.all(p[:, :, None] == p[:, None], axis=0), axis=1)
    shared = np.where(p[0] >= 1, same, np.arange(p.shape[1]))
    used, number = np.unique(shared[t], return_inverse=True)
    return skfem.MeshQuad(p[:, used], number.reshape(t.shape)), lambda x: (x[1] == 1) & (x[0] < 1)


def holes():
    """A square with two square holes that meet in a corner."""
    mesh = skfem.MeshQuad.init_tensor(*[np.arange(5.0)] * 2)
    x, y = mesh.p[:, mesh.t].mean(axis=1) - 2
    mesh = mesh.restrict(np.flatnonzero((np.maximum(abs(x), abs(y)) > 1) | (x * y < 0)))
    return mesh, lambda x: np.abs(x - 2).max(axis=0) < 1.2


@pytest.mark.parametrize("make, normal, place", [(lips, (1, 0), "0, 1"), (holes, (0, 1), "2, 2")])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_place_without_a_normal_is_refused(make, normal, place, degree):
    """Facets that face opposite ways share a contact."""
    mesh, side = make()
    mesh = mesh.with_boundaries({"inside": side, "foot": lambda x: x[1] == 0})
    body = Part("block", mesh, Material(1.0, 0.3), (Support("foot"),), contact="inside")
    scene = Scene("s", body, Rigid("wall", normal, lambda x: 0 * x[0]), 0.0, degree=degree)
    with pytest.raises(InputError, match=rf"'block'.* face opposite ways at \({place}\)"):
        reduce(scene)
