"""Facets that stand for curves: what they change is measured, and said where it matters."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from contactopt import Contact, Material, Part, Rigid, Scene, Support, run, solve
from contactopt.coupling.reduction import reduce_bodies
from contactopt.readings.chords import SHOWN, chord_heights, chord_remarks, pressure_changes

OVERLAP = 0.01  # of a bore of radius 1
SAID = "stand for curves, and leave them"


def shell(low, high, chords, dim, scale=1.0, turn=0.0, layers=3, order=1):
    """A quarter of a ring, or of a tube along z, between two radii."""
    angle = np.linspace(0, np.pi / 2, chords + 1)
    axes = np.linspace(low, high, layers + 1), angle, np.linspace(0, 0.6, 3)
    mesh = (skfem.MeshQuad if dim == 2 else skfem.MeshHex).init_tensor(*axes[:dim])
    names = {"in": lambda x: x[0] == low, "out": lambda x: x[0] == high}
    names |= {"y-": lambda x: x[1] == 0, "x-": lambda x: x[1] == axes[1][-1]}
    names |= {"z-": lambda x: x[2] == 0} if dim == 3 else {}
    mesh = mesh.with_boundaries(names)
    if order == 2:
        made = (skfem.MeshQuad2 if dim == 2 else skfem.MeshHex2).from_mesh(mesh)
        mesh = replace(made, _boundaries=mesh.boundaries)
    r, a, rest = mesh.doflocs[0], mesh.doflocs[1] + turn, mesh.doflocs[2:]
    return replace(mesh, doflocs=scale * np.concatenate([[r * np.cos(a)], [r * np.sin(a)], rest]))


def press_fit(
    chords, degree=1, dim=2, curved=False, overlap=OVERLAP, scale=1.0, stiff=1.0, order=1
):
    """A ring pressed into another one whose mesh has another number of chords."""

    def part(name, mesh, E, contact, radius):
        curve = lambda x: np.concatenate([radius * x[:2] / np.hypot(x[0], x[1]), x[2:]])  # noqa: E731
        held = tuple(Support(f"{c}-", {c: 0.0}) for c in "xyz"[:dim])
        material = Material(stiff * E, 0.3)
        return Part(name, mesh, material, held, contact=contact, curve=curve if curved else None)

    radius = 1 + overlap
    radii = (0.5, radius), (1.0, 2.0)
    meshes = [shell(*ends, n, dim, scale, order=order) for ends, n in zip(radii, chords)]
    inner = part("inner", meshes[0], 100.0, "out", scale * radius)
    outer = part("outer", meshes[1], 50.0, "in", scale)
    kind = "plane-strain" if dim == 2 else "solid"
    contacts = (Contact("inner", "outer", 0.0),)
    return Scene("fit", bodies=(inner, outer), contacts=contacts, degree=degree, kind=kind)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "degree, order, least", [(1, 1, 0.2), (2, 1, 0.2), (1, 2, 0.2), (2, 2, 1e-3)]
)
def test_heights_of_chords_are_what_the_curves_change_of_the_gap(dim, degree, order, least):
    """The coupling itself measures the gap between curves that are given."""
    without, given = (
        reduce_bodies(press_fit((9, 5), degree, dim, curved, order=order))
        for curved in (False, True)
    )
    change = given.gap - without.gap
    heights = chord_heights(without)
    assert np.abs(change).max() > least * OVERLAP
    # in space the facets are cut into triangles here, and not there
    assert np.abs(heights - change).max() < (0.06 if dim == 2 else 0.25) * np.abs(change).max()
    assert not chord_heights(given).any()


def test_changes_of_pressure_are_those_of_a_second_solve():
    scene = press_fit((40, 36), overlap=0.05)
    reduction = reduce_bodies(scene)
    problem = reduction.problem
    before = solve(problem, tol=1e-12)
    d = chord_heights(reduction)
    moved = problem.q.copy()
    moved[:, 0] += 0.1 * d  # so little that all contacts go on touching
    after = solve(problem.altered(q=moved), tol=1e-12)
    exact = (after.reactions - before.reactions)[:, 0] / problem.areas
    assert before.reactions[:, 0].min() > 0 and after.reactions[:, 0].min() > 0
    found = pressure_changes(reduction, before, 0.1 * d)
    assert np.abs(found - exact).max() < 0.2 * np.abs(exact).max()


@pytest.mark.parametrize("dim, degree", [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_polygons_that_press_as_polygons_say_so(dim, degree):
    """Without a curve the pressure is a multiple of the right one, with it within some percent."""
    for scale, stiff in ((1.0, 1.0), (1e-3, 2e9)):
        units = {"dim": dim, "scale": scale, "stiff": stiff}
        plain, curved = (
            run(press_fit((9, 5), degree, curved=c, **units), figures=()) for c in (False, True)
        )
        assert plain.pressure.max() > 2 * curved.pressure.max()
        assert sum(SAID in remark for remark in plain.summary["remarks"]) == 1
        assert not any(SAID in remark for remark in curved.summary["remarks"])


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("chords, overlap, large", [((9, 5), 5e-4, True), ((20, 14), 2e-3, False)])
def test_parabolas_that_press_as_parabolas_say_so(dim, chords, overlap, large):
    """Edges of second order leave their circle too, five in 90 degrees by 1.9e-5 of the radius."""
    plain, curved = (
        run(press_fit(chords, 2, dim, curve, overlap, order=2), figures=())
        for curve in (False, True)
    )
    off = np.abs(plain.pressure - curved.pressure).max() / curved.pressure.max()
    assert (off > SHOWN) == large
    assert sum(SAID in remark for remark in plain.summary["remarks"]) == large
    assert not any(SAID in remark for remark in curved.summary["remarks"])


@pytest.mark.parametrize("degree", [1, 2])
def test_meshes_that_match_or_are_fine_enough_say_nothing(degree):
    for chords, overlap in (((12, 12), OVERLAP), ((150, 60), 0.2)):
        plain, curved = (
            run(press_fit(chords, degree, curved=c, overlap=overlap), figures=())
            for c in (False, True)
        )
        off = np.abs(plain.pressure - curved.pressure).max() / curved.pressure.max()
        said = any(SAID in remark for remark in plain.summary["remarks"])
        assert said == (off > SHOWN)


@pytest.mark.parametrize("chords, large", [(8, True), (16, False)])
def test_edges_of_second_degree_that_match_turn_the_stress(chords, large):
    """Lame's pressure beside that between straight edges at angles, which no gap changes."""
    exact = 0.003 / (lame(1, 2, 50.0, 1, 0, 1) - lame(0.5, 1, 100.0, 0, 1, 1))
    found = run(press_fit((chords, chords), 2, overlap=0.003), figures=())
    assert (np.abs(found.pressure / exact - 1).max() > SHOWN) == large
    assert any("turns the stress" in remark for remark in found.summary["remarks"]) == large


def test_remarks_are_those_of_the_turned_mesh():
    known = None
    for turn in (0.0, 0.4):
        meshes = shell(0.5, 1.01, 9, 2, turn=turn), shell(1.0, 2.0, 5, 2, turn=turn)
        parts = [
            Part(name, mesh, Material(100.0, 0.3), (Support(held),), contact=contact)
            for name, mesh, held, contact in zip("ab", meshes, ("in", "out"), ("out", "in"))
        ]
        reduction = reduce_bodies(Scene("fit", *parts, mu=0.0))
        heights = chord_heights(reduction)
        known = heights if known is None else known
        assert np.abs(np.sort(heights) - np.sort(known)).max() < 1e-9
        assert len(chord_remarks(reduction, solve(reduction.problem))) == 1


def test_middle_nodes_of_chords_on_a_rigid_plane_say_so():
    """A straight-edged roller of second degree touches a plane between its nodes."""
    floor = Rigid("floor", (0.0, 1.0), lambda x: x[1] + 1)
    for chords, layers, large in ((12, 4, True), (80, 30, False)):
        mesh = shell(0.5, 1.0, chords, 2, turn=-np.pi / 2, layers=layers)
        made = []
        for curve in (None, lambda x: x / np.hypot(*x)):
            held = (Support("in", {"x": 0.0, "y": -0.05}),)
            part = Part("roller", mesh, Material(100.0, 0.3), held, contact="out", curve=curve)
            made.append(run(Scene("roller", part, floor, 0.0, degree=2), figures=()))
        plain, curved = made
        off = np.abs(plain.pressure - curved.pressure).max() / curved.pressure.max()
        assert (off > SHOWN) == large
        assert any(SAID in remark for remark in plain.summary["remarks"]) == large


def lame(low, high, E, inside, outside, at, nu=0.3):
    """Radial displacement of a ring in plane strain under pressures inside and outside."""
    mean = (inside * low**2 - outside * high**2) / (high**2 - low**2)
    rest = (inside - outside) * low**2 * high**2 / (high**2 - low**2)
    return (1 + nu) / E * ((1 - 2 * nu) * mean * at + rest / at)


@pytest.mark.parametrize("adaptive", [False, True])
@pytest.mark.parametrize("degree", [1, 2])
def test_searches_claim_what_an_overlap_leaves_open(degree, adaptive):
    """Lame's pressure for rings that differ in their radii by nothing, and for those as drawn."""
    give = lame(1, 2, 50.0, 1, 0, 1) - lame(0.5, 1, 100.0, 0, 1, 1)
    exact = OVERLAP / give
    scene = press_fit((8, 5), degree)
    found = run(scene, accuracy=0.02, quantity="pressure", adaptive=adaptive, figures=()).estimate
    assert abs(found.value / exact - 1) < found.error < 0.03
    assert found.geometry_error == pytest.approx(OVERLAP, rel=0.1)
    assert "overlap as they are drawn" in found.message


def test_an_estimate_that_no_further_mesh_confirms_says_so():
    aim = {"accuracy": 0.1, "quantity": "pressure", "max_unknowns": 1500, "figures": ()}
    found = run(press_fit((8, 6), 2, order=2), **aim).estimate
    assert found.error < 0.1 and not found.reached
    assert found.message.startswith("the estimate is below the target, but no further mesh")
