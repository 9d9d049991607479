"""Scenes joined by mortar: patch tests, press fits, rings, and parts of a whole."""

import logging
import re
from dataclasses import replace

import numpy as np
import pytest
import skfem
from conftest import MATERIAL, block, two_blocks
from mortar_scenes import couple, press_fit, resultants, ring

from contactopt import (
    Contact,
    Material,
    Plate,
    Pressure,
    Support,
    Traction,
    reduce,
    reduce_bodies,
    scenes,
    solve,
)
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.readings.resolution import remarks
from contactopt.scenes import round as round_bodies
from contactopt.scenes.common import with_elements
from contactopt.scenes.scene import Part, Scene


@pytest.mark.parametrize("covered", [0.02, 0.3, 0.5, 0.77, 1.0])
@pytest.mark.parametrize("degree", [1, 2])
def test_pressure_where_the_other_surface_ends_within_a_face(degree, covered):
    """The edge of a block presses on a part of the last cell: its pressure is finite, and told."""
    h = 1 / 8 / degree
    top = rename(
        tensor_mesh(np.linspace(-covered * h, 1 + covered * h, 6), [0.0, 0.5, 1.0]),
        top="y+",
        contact="y-",
    )
    base = rename(
        tensor_mesh(np.linspace(-1, 2, 25), np.linspace(-2, 0, 9)), bottom="y-", contact="y+"
    )
    upper = Part("upper", top, MATERIAL, (), (Plate("top", {"y": -1.0}),))
    lower = Part("lower", base, MATERIAL, (Support("bottom"),))
    coupled = couple(Scene("s", upper, lower, 0.0, degree=degree), "lower")
    solution = solve(coupled.problem, tol=1e-10)
    pressure = solution.reactions[:, 0] / coupled.problem.areas
    assert coupled.problem.areas.sum() == pytest.approx(1 + 2 * covered * h, rel=1e-12)
    assert pressure.max() < 5.5  # 1.7 to 2.0 where a node lies below the edge
    assert np.ptp(coupled.mortar.points[0]) < 1 + 2 * covered * h + 1e-12
    assert not remarks(coupled.reduction, solution)  # the answer does not suffer
    told = re.search("ends within the faces of ([24]) contacts", coupled.reduction.coupling.why)
    assert told is not None


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_a_uniform_load_closes_any_gap(dim, seed):
    """Turned, moved, in other units, on meshes of other kinds."""
    rng = np.random.default_rng([dim, seed])
    unit, gap = 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-2, 1)
    turn = np.linalg.qr(rng.normal(size=(dim, dim)))[0] * unit
    turn *= np.sign(np.linalg.det(turn))

    def block(low: float, high: float, cells: int):
        across = [np.linspace(0, 1, n + 1) ** 1.2 for n in (cells, cells + 2)][: dim - 1]
        made = tensor_mesh(*across, np.linspace(low, high, 3))
        if rng.integers(2):
            made = made.to_meshtri() if dim == 2 else made.to_meshtet()
        ends = {"bottom": lambda x: x[-1] < low + 1e-9, "top": lambda x: x[-1] > high - 1e-9}
        sides = made.with_boundaries(ends).boundaries
        return type(made)(turn @ made.p, made.t).with_boundaries(sides)

    names = "xyz"[:dim]
    push = {c: -3.0 * float(f) for c, f in zip(names, turn[:, -1] / unit)}
    soft = Material(5.0, 0.0)
    upper = Part("upper", block(gap, gap + 1, 3), soft, (), (Plate("top", push),), "bottom")
    lower = Part("lower", block(-2, 0, 4), soft, (Support("bottom"),), (), "top")
    kind = "plane-strain" if dim == 2 else "solid"
    for carrier in ("upper", "lower"):
        contact = Contact("upper", "lower", 0.3, coupling="mortar", carrier=carrier)
        problem = reduce_bodies(
            Scene("s", bodies=(upper, lower), contacts=(contact,), kind=kind)
        ).problem
        pressure = solve(problem, tol=1e-12).reactions[:, 0] / problem.areas
        assert np.abs(pressure * unit ** (dim - 1) / 3 - 1).max() < 1e-8


AREA = {"plane-strain": 1.0, "axisymmetric": np.pi, "solid": 1.0}


@pytest.mark.parametrize("cells", [(2, 3), (2, 6), (1, 7)])
@pytest.mark.parametrize(("cut", "own"), [(False, "upper"), (True, "lower")])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", AREA)
def test_patch_test_uniform_pressure_is_exact(kind, degree, cut, cells, own):
    a, b = cells
    if kind == "solid" and degree == 2:
        b = {3: 3, 6: 4, 7: 5}[b]
    scene = two_blocks(kind, force=3.0)
    upper = replace(scene.upper, mesh=block(kind, 0, 1, a, layers=3))
    lower = replace(scene.lower, mesh=block(kind, -2, 0, b, layers=3, power=1.0))
    coupled = couple(with_elements(replace(scene, upper=upper, lower=lower), degree, cut), own)
    solution = solve(coupled.problem, tol=1e-12)
    pressure = solution.reactions[:, 0] / coupled.problem.areas
    assert np.abs(pressure * AREA[kind] / 3 - 1).max() < 1e-10
    modulus = 5 / (1 - 0.3**2) if kind == "plane-strain" else 5
    assert -solution.multipliers[0] == pytest.approx(9 / AREA[kind] / modulus, rel=1e-10)


def error(coupled, exact: float) -> tuple[float, float]:
    """Root mean square and largest error of the pressure."""
    solution, areas = solve(coupled.problem), coupled.problem.areas
    off = solution.reactions[:, 0] / areas / exact - 1
    return float(np.sqrt(off**2 @ areas / areas.sum())), float(np.abs(off).max())


@pytest.mark.parametrize("own", ["upper", "lower"])
def test_a_press_fit_is_of_second_order(own):
    """Isoparametric quadratic elements, circles kept: Lame's pressure."""
    errors = []
    for n in (4, 8):
        scene, exact = press_fit((n, 3 * n // 2), 2, 0.01, kept=True, curved=True)
        errors.append(error(couple(scene, own), exact))
    for first, second in zip(*errors):
        assert np.log2(first / second) > 1.7
        assert second < 3e-3


@pytest.mark.parametrize("interference", [0.0, 0.005])
@pytest.mark.parametrize("cut", [False, True])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_closed_ring_is_in_equilibrium(degree, cut, interference):
    """Polygons of 24 and 36 edges in each other, any forces."""
    outer = Part(
        "outer", ring(2, 3, 2, 24, 2 * np.pi), MATERIAL, (Support("outer"),), contact="inner"
    )
    inner = Part(
        "inner",
        ring(1, 2 + interference, 2, 36, 2 * np.pi),
        MATERIAL,
        (Support("inner"),),
        contact="outer",
    )
    for own in ("upper", "lower"):
        coupled = couple(
            with_elements(Scene("s", outer, inner, 0.3, degree=degree), degree, cut), own
        )
        places = [b.body.locations for b in coupled.bodies]
        assert np.any(coupled.mortar.lever)
        size = len(coupled.problem.areas), 2
        assert coupled.problem.areas.sum() == pytest.approx(2 * np.pi * 2, rel=0.02)
        for r in (np.random.default_rng(0).normal(size=size), np.tile([1.0, 0.3], (size[0], 1))):
            force, moment = resultants(coupled.forces(r), places)
            assert np.abs(force).max() < 1e-12 * np.abs(r).sum()
            assert np.abs(moment).max() < 1e-12 * 2 * np.abs(r).sum()


@pytest.mark.parametrize("name", ["cylinder", "sphere"])
def test_hertz_on_meshes_two_to_three(name, monkeypatch):
    """Peak and width within .2 % on at most 10,000 unknowns."""
    monkeypatch.setitem(round_bodies.GROWTH, 2, 1.5)  # coarse away from the contact
    scene = getattr(scenes, name)(mu=0.0, force=30.0 if name == "cylinder" else 1.0)
    scene = with_elements(scene, 2)
    exact, (a, b) = scene.reference, (8, 12)
    top, base = scene.upper, scene.lower
    apart = replace(
        scene,
        upper=replace(top, mesh=lambda _, zone: top.mesh(a, zone)),
        lower=replace(base, mesh=lambda _, zone: base.mesh(b, zone)),
    )
    coupled = couple(apart, elements=b, zone=exact.half_width)
    assert coupled.unknowns < 10_000 and coupled.mortar.own == 1
    errors = []
    for problem in (coupled.problem, reduce(scene, b, exact.half_width)):
        x, pressure = problem.coordinates[0], solve(problem).reactions[:, 0] / problem.areas
        off = pressure - exact.peak * np.sqrt(np.maximum(0, 1 - (x / exact.half_width) ** 2))
        errors.append(np.sqrt(problem.areas @ off**2))
        inner = (x > 0.3 * exact.half_width) & (x < 0.9 * exact.half_width)
        slope, value = np.polyfit(x[inner] ** 2, pressure[inner] ** 2, 1)
        assert np.sqrt(-value / slope) == pytest.approx(exact.half_width, rel=2e-3)
        assert pressure.max() == pytest.approx(exact.peak, rel=2e-3)
    assert errors[0] < 1.3 * errors[1]


@pytest.mark.parametrize("degree", [1, 2])
def test_a_half_model_is_half_of_the_whole(degree):
    """The component that symmetry holds is taken at the node and at the place facing it alone."""
    results = []
    for copies in (1, 2):
        parts = []
        for cells, heights, load in ((3, (0, 1), True), (5, (-1, 0), False)):
            x = np.linspace(0, 1, cells + 1) ** 1.2
            x = x if copies == 2 else np.concatenate([-x[:0:-1], x])
            mesh = rename(
                tensor_mesh(x, np.linspace(*heights, 4)), top="y+", bottom="y-", axis="x-"
            )
            hold = (Support("axis", {"x": 0.0}),) if copies == 2 else ()
            loads = (Plate("top", {"y": -1.0}),) if load else ()
            hold = hold if load else (*hold, Support("bottom"))
            parts.append(
                Part(
                    "upper" if load else "lower",
                    mesh,
                    MATERIAL,
                    hold,
                    loads,
                    contact="bottom" if load else "top",
                )
            )
        coupled = couple(Scene("s", *parts, 0.2, degree=degree, copies=copies))
        problem, solution = coupled.problem, solve(coupled.problem, tol=1e-12)
        x = problem.coordinates[0]
        right = np.flatnonzero(x > 1e-9)
        results.append((solution.reactions[right[np.argsort(x[right])]], solution.multipliers))
    (whole, down), (half, same) = results
    assert np.allclose(2 * whole, half, atol=1e-9) and np.allclose(down, same, rtol=1e-9)


@pytest.mark.parametrize("carrier", ["upper", "lower"])
def test_a_quarter_of_plates_in_space_is_a_quarter_of_the_whole(carrier):
    """Linear hexahedra, one surface curved, with friction."""
    results = []
    for cut in (False, True):
        parts = []
        for name, cells, heights in (("upper", 2, (0, 0.5, 1)), ("lower", 3, (-1, -0.5, 0))):
            x = np.linspace(0, 2, cells + 1)
            x = x if cut else np.concatenate([-x[:0:-1], x])
            mesh = rename(tensor_mesh(x, x, heights), top="z+", bottom="z-")
            pressed = {"pressed": lambda p: (p[2] > 0.9) & (abs(p[0]) < 1) & (abs(p[1]) < 1)}
            mesh = mesh.with_boundaries(pressed)
            hold = (Support("x-", {"x": 0.0}), Support("y-", {"y": 0.0})) if cut else ()
            if name == "lower":
                hold = (*hold, Support("bottom"))
                parts.append(Part(name, mesh, MATERIAL, hold, contact="top"))
                continue
            bent = 0.02 * (mesh.p[0] ** 2 + mesh.p[1] ** 2 / 2)
            mesh = replace(mesh, doflocs=mesh.p + np.outer([0, 0, 1], bent))
            load = (Traction("pressed", (0.0, 0.0, -1.0)),)
            parts.append(Part(name, mesh, MATERIAL, hold, load, contact="bottom"))
        pair = Contact("upper", "lower", 0.3, coupling="mortar", carrier=carrier)
        scene = Scene("plates", bodies=tuple(parts), contacts=(pair,), kind="solid", degree=1)
        problem = reduce(replace(scene, copies=4 if cut else 1))
        r = solve(problem, tol=1e-12).reactions / problem.areas[:, None]
        at = np.round(problem.coordinates, 9) + 0.0
        kept = np.flatnonzero(np.all(at[:2] >= 0, axis=0))
        order = kept[np.lexsort(at[:2, kept])]
        results.append(np.stack([r[order, 0], np.linalg.norm(r[order, 1:], axis=1)]))
    whole, quarter = results
    assert np.allclose(whole, quarter, atol=1e-9 * whole.max())


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("carrier", ["upper", "lower"])
def test_a_quarter_of_a_press_fit_is_half_of_a_half(degree, carrier):
    """With friction on curved surfaces: at planes of symmetry nothing slips."""
    results = []
    for quarters in (1, 2):
        parts = []
        for name, radii, sectors in (("outer", (1.9, 3.0), 4), ("inner", (1.0, 2.1), 6)):
            mesh = ring(*radii, 2, quarters * sectors, quarters * np.pi / 2)
            axes = ("y", "x") if quarters == 1 else ("y", "y")
            hold = tuple(Support(side, {axis: 0.0}) for side, axis in zip(("start", "end"), axes))
            parts.append(
                Part(name, mesh, MATERIAL, hold, contact="inner" if name == "outer" else "outer")
            )
        pair = Contact("outer", "inner", 0.15, coupling="mortar", carrier=carrier)
        problem = reduce_bodies(
            Scene("rings", bodies=tuple(parts), contacts=(pair,), degree=degree)
        ).problem
        solution = solve(problem, tol=1e-12)
        x, y = problem.coordinates
        # the middle of the half has two of the quarter's ends
        first = np.flatnonzero(x > 1e-9 * x.max())
        order = first[np.argsort(np.arctan2(y[first], x[first]))]
        results.append(solution.reactions[order] / problem.areas[order, None])
        assert solution.reactions[order[0], 0] > 0 and solution.reactions[order[0], 1] == 0
    quarter, half = results
    assert np.allclose(quarter, half, atol=1e-9 * np.abs(half).max())


def test_a_small_block_on_a_large_one():
    """Contacts of the larger, finer surface reach beyond the block's edge."""
    x = np.linspace(-1, 2, 49)
    results = []
    for cells, own in ((16, None), (5, "lower"), (11, "lower")):
        top = rename(
            tensor_mesh(np.linspace(0, 1, cells + 1), np.linspace(0, 1, 9)), top="y+", contact="y-"
        )
        base = rename(tensor_mesh(x, np.linspace(-2, 0, 17)), bottom="y-", contact="y+")
        upper = Part("upper", top, MATERIAL, (), (Plate("top", {"y": -1.0}),))
        scene = Scene(
            "s", upper, Part("lower", base, MATERIAL, (Support("bottom"),)), 0.0, degree=2
        )
        coupled = couple(scene, own)
        solution = solve(coupled.problem)
        assert solution.reactions[:, 0].sum() == pytest.approx(1.0, rel=1e-8)
        results.append(solution.multipliers[0])
    assert results[1:] == pytest.approx([results[0]] * 2, rel=0.01)


def test_mortar_is_chosen_where_nodes_do_not_match(caplog):
    scene = two_blocks("plane-strain", force=3.0)
    finer = replace(
        scene, lower=replace(scene.lower, mesh=block("plane-strain", -2, 0, 7, layers=3))
    )
    with caplog.at_level(logging.INFO, logger="contactopt.coupling"):
        same, other = reduce_bodies(scene), reduce_bodies(finer)
    assert (same.coupling.kind, other.coupling.kind, other.coupling.carrier) == (
        "matching",
        "mortar",
        "lower",
    )
    assert "is coupled by mortar" in caplog.text
    problem = reduce(finer)
    assert np.allclose(solve(problem, tol=1e-12).reactions[:, 0] / problem.areas, 3.0, rtol=1e-10)
    coarse = replace(finer.pairs[0], carrier="upper")
    long = replace(finer, upper=None, lower=None, mu=None, bodies=finer.parts, contacts=(coarse,))
    assert reduce_bodies(long).coupling.carrier == "upper"
    assert reduce(long).contacts < problem.contacts


@pytest.mark.parametrize("carrier", [None, "lower"])
def test_contacts_on_a_held_edge_are_no_more_than_the_other_side_can_tell_apart(carrier):
    """Carried by its own nodes, pressures on a clamped edge of the finer plate alternate."""

    def plate(x, y, z):
        mesh = skfem.MeshHex.init_tensor(*(np.array(v, float) for v in (x, y, z)))
        return mesh.with_boundaries(
            {
                "x-": lambda p: p[0] == x[0],
                "z-": lambda p: p[2] == z[0],
                "z+": lambda p: p[2] == z[-1],
            }
        )

    steel = Material(200.0, 0.3)
    upper = plate(np.linspace(0, 4, 5), np.linspace(-2, 2, 5), [0, 0.5, 1])
    lower = plate(np.linspace(0, 4, 4), np.linspace(-2, 2, 7), [-1, -0.5, 0])
    held = Support("x-"), Support("z-", {"z": 0.0})
    parts = (
        Part("upper", upper, steel, loads=(Pressure("z+", 0.5),), contact="z-"),
        Part("lower", lower, steel, held, contact="z+"),
    )
    pair = Contact("upper", "lower", 0.0, law="frictionless", carrier=carrier)
    scene = Scene("plates", bodies=parts, contacts=(pair,), kind="solid", degree=1)
    made = reduce_bodies(scene)
    solution = solve(made.problem)
    p = solution.reactions[:, 0] / made.problem.areas
    assert solution.solved
    assert (np.ptp(p[np.isclose(made.problem.coordinates[0], 0)]) < 0.02) == (carrier is None)
    said = " ".join(remarks(made, solution))
    assert ("may alternate" in said) == (carrier == "lower")
