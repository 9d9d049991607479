"""Mortar coupling: exactness on pure surfaces, equilibrium, curved interfaces, and whole scenes."""

import logging
import re
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
import skfem
from conftest import MATERIAL, two_blocks
from mortar_scenes import couple, press_fit, resultants, ring, slab
from skfem.quadrature import get_quadrature

from contactopt import (
    Contact,
    InputError,
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
from contactopt.bodies.elements import FACES, weight_at
from contactopt.checks import said_once
from contactopt.coupling import segments
from contactopt.coupling.faces import Faces, cross, evaluate
from contactopt.coupling.facing import Facets, facing_pairs
from contactopt.coupling.mortar import mortar
from contactopt.meshes.structured import rename, tensor_mesh
from contactopt.readings.resolution import remarks
from contactopt.scenes import round as round_bodies
from contactopt.scenes.common import with_elements
from contactopt.scenes.scene import Part, Scene

KINDS = {  # kind of the elements, nodes of a face in the plane's own coordinates
    ("line", False): "RefQuad",
    ("line", True): "RefTri",
    ("face", False): "RefHex",
    ("face", True): "RefTet",
}


def line(x: np.ndarray, degree: int, up: bool, cut: bool = False, y=None, **more) -> Faces:
    """The curve (x, y(x)) as the upper side of a body (up) or as the lower one."""
    n = len(x)
    p = np.concatenate([x, (x[1:] + x[:-1]) / 2]) if degree == 2 else x
    faces = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    if degree == 2:
        faces = np.column_stack([faces, n + np.arange(n - 1)])
    points = np.stack([p, np.zeros_like(p) if y is None else y(p)])
    return Faces(
        "b", KINDS["line", cut], degree, points, faces, np.full(n - 1, -1.0 if up else 1.0), **more
    )


def face(xs, ys, degree: int, up: bool, cut: bool = False, place=lambda x: x, **more) -> Faces:
    """A grid of rectangles, each cut in two or not, put into space by `place` (2, n) -> (3, n) of
    plane coordinates.
    """
    i, j = np.meshgrid(np.arange(len(xs) - 1), np.arange(len(ys) - 1), indexing="ij")

    def number(a, b):
        return (a * len(ys) + b).ravel()

    square = np.stack(
        [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)], axis=1
    )
    corners = np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]]) if cut else square
    p = np.stack([a.ravel() for a in np.meshgrid(xs, ys, indexing="ij")])
    if degree == 2:
        nodes = [p[:, corners[:, a]] for a in range(corners.shape[1])]
        edges = [(nodes[a] + nodes[(a + 1) % len(nodes)]) / 2 for a in range(len(nodes))]
        if not cut:
            edges.append(sum(nodes) / 4)
        extra = np.concatenate(edges, axis=1)
        p = np.concatenate([p, extra], axis=1)
        _, first, index = np.unique(np.round(p, 9), axis=1, return_index=True, return_inverse=True)
        p, index = p[:, first], index.ravel()
        tail = index[-extra.shape[1] :].reshape(len(edges), -1).T
        corners = np.column_stack([index[corners], tail])
    points = place(np.concatenate([p, np.zeros((1, p.shape[1]))]))
    turn = np.full(len(corners), 1.0 if up else -1.0)
    return Faces("b", KINDS["face", cut], degree, points, corners, turn, **more)


def grid(n: int, low: float = 0.0, high: float = 1.0, power: float = 1.0) -> np.ndarray:
    return low + (high - low) * np.linspace(0, 1, n + 1) ** power


def integrals(surface: Faces) -> np.ndarray:
    """int N_j over the whole surface, by a rule that is exact on straight faces."""
    at, share = get_quadrature(FACES[surface.kind][0], 10)
    count = len(surface.faces)
    which, at = np.repeat(np.arange(count), len(share)), np.tile(at, count)
    x, tangents = surface.locations(which, at)
    measure = (
        np.tile(share, count)
        * np.linalg.norm(cross(tangents), axis=0)
        * weight_at(surface.weight, x)
    )
    out = np.zeros(surface.points.shape[1])
    np.add.at(out, surface.faces[which], (surface.shapes(at) * measure).T)
    return out


RATIOS = [(4, 6), (3, 9), (2, 14), (5, 5)]
SIDES = ["upper", "lower", None]
CUTS = [(False, False), (True, True), (False, True)]  # quadrilaterals, triangles, one on the other


def check_exact(m, upper: Faces, lower: Faces) -> None:
    """Row sums, linear fields, forces of uniform pressure; all on flat surfaces that cover each
    other.
    """
    for W, surface in zip(m.weights, (upper, lower)):
        assert np.abs(W.sum(axis=1) - 1).max() < 1e-12
        assert np.abs(W @ surface.points.T - m.points.T).max() < 1e-11
        assert np.abs(m.areas @ W - integrals(surface)).max() < 1e-12 * m.areas.sum()
    assert np.abs(m.gap).max() < 1e-12 and not np.any(m.lever)
    assert np.all(m.areas > 0)


@pytest.mark.parametrize("weight", [(0.7, False), (2 * np.pi, True)])
@pytest.mark.parametrize("own", SIDES)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("degree,cut", [(1, False), (2, False), (2, True)])
def test_lines_pass_on_linear_fields_and_uniform_pressure(degree, cut, ratio, own, weight):
    upper = line(grid(ratio[0], power=1.3), degree, False, cut, weight=weight)
    lower = line(grid(ratio[1]), degree, True, cut, weight=weight)
    m = mortar(upper, lower, own)
    check_exact(m, upper, lower)
    assert np.allclose(m.normals, [[0], [1]], atol=1e-14)
    if own is None:
        assert m.own == 1  # more contacts, or as many
        assert mortar(replace(lower, turn=-lower.turn), replace(upper, turn=-upper.turn)).own == (
            ratio[0] == ratio[1]
        )


@pytest.mark.parametrize("own", SIDES)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("cuts", CUTS)
@pytest.mark.parametrize("degree", [1, 2])
def test_faces_pass_on_linear_fields_and_uniform_pressure(degree, cuts, ratio, own):
    upper = face(grid(ratio[0]), grid(ratio[0], power=1.2), degree, False, cuts[0])
    lower = face(grid(ratio[1]), grid(ratio[1] - 1), degree, True, cuts[1])
    m = mortar(upper, lower, own)
    check_exact(m, upper, lower)
    assert np.allclose(m.normals.T, [0, 0, 1])


def distorted(surface: Faces, amount: float, seed: int) -> Faces:
    """The flat unit square with its inner corners moved at random, edges straight."""
    points, rng = surface.points.copy(), np.random.default_rng(seed)
    inner = np.all((points[:2] > 1e-9) & (points[:2] < 1 - 1e-9), axis=0)
    corners = np.intersect1d(np.flatnonzero(inner), surface.faces[:, : surface.corners])
    points[:2, corners] += amount * rng.uniform(-1, 1, (2, len(corners)))
    hats = evaluate(FACES[surface.kind][1], surface.places)[0]
    for nodes in surface.faces:
        points[:, nodes] = points[:, nodes[: surface.corners]] @ hats
    return replace(surface, points=points)


@pytest.mark.parametrize("own", ["upper", "lower"])
@pytest.mark.parametrize("cuts", CUTS)
@pytest.mark.parametrize("degree", [1, 2])
def test_distorted_faces_are_exact_to_the_quadrature(degree, cuts, own):
    upper = distorted(face(grid(4), grid(4), degree, False, cuts[0]), 0.06, 0)
    lower = distorted(face(grid(6), grid(6), degree, True, cuts[1]), 0.04, 1)
    m = mortar(upper, lower, own)
    for W, surface in zip(m.weights, (upper, lower)):
        assert np.abs(m.areas @ W - integrals(surface)).max() < 1e-10 * m.areas.mean()
        assert np.abs(W @ surface.points.T - m.points.T).max() < 1e-12


@pytest.mark.parametrize("own", ["upper", "lower"])
@pytest.mark.parametrize("degree", [1, 2])
def test_partial_overlap_integrates_over_the_common_part(degree, own):
    """Contacts beyond the edge of the other surface keep their places; those that face nothing are
    left out.
    """
    for upper, lower, content in (
        (line(grid(5, 0.13, 0.77), degree, False), line(grid(10), degree, True), 0.64),
        (line(grid(5, 0.43, 1.77), degree, False), line(grid(10), degree, True), 0.57),
        (
            face(grid(4, 0.13, 0.77), grid(3, 0.52, 1.4), degree, False, True),
            face(grid(10), grid(8), degree, True),
            0.64 * 0.48,
        ),
    ):
        m = mortar(upper, lower, own)
        assert m.areas.sum() == pytest.approx(content, rel=1e-12) and np.all(m.areas > 0)
        for W, surface in zip(m.weights, (upper, lower)):
            assert np.abs(W.sum(axis=1) - 1).max() < 1e-12
            assert np.abs(W @ surface.points.T - m.points.T).max() < 1e-10
        low, high = np.max([s.points.min(axis=1) for s in (upper, lower)], axis=0), 1 / 10
        assert np.all(m.points >= low[:, None] - (0.5 if own == "upper" else high))
    small, large = line(grid(5, 0.13, 0.77), degree, False), line(grid(10), degree, True)
    m = mortar(small, large, "lower")
    assert np.abs(m.areas @ m.weights[0] - integrals(small)).max() < 1e-14


@pytest.mark.parametrize("power", range(1, 14))
def test_slivers_do_no_harm(power):
    """An edge 10^-power beyond a node: weights stay bounded, areas and row sums exact."""
    beyond = 0.1 * 10.0**-power
    ends = 0.2 - beyond, 0.6 + beyond
    for upper, lower in (
        (line(grid(7, *ends), 1, False), line(grid(10), 1, True)),
        (face(grid(7, *ends), grid(7, *ends), 1, False), face(grid(10), grid(10), 1, True)),
    ):
        m = mortar(upper, lower, "lower")
        assert m.areas.sum() == pytest.approx(
            (ends[1] - ends[0]) ** (m.points.shape[0] - 1), rel=2e-8
        )
        for W, surface in zip(m.weights, (upper, lower)):
            assert np.abs(W.sum(axis=1) - 1).max() < 1e-13
            assert np.abs(W @ surface.points.T - m.points.T).max() < 1e-6
            assert np.abs(W).sum(axis=1).max() < 30


def random_forces(upper: Faces, lower: Faces, m) -> tuple[np.ndarray, np.ndarray]:
    """Resultant force and moment of random contact forces on both bodies, over the sum of their
    sizes.
    """
    r = np.random.default_rng(3).normal(size=m.points.shape)
    forces = []
    for i, sign in enumerate((1.0, -1.0)):
        G = m.components(i, np.zeros(r.shape, dtype=bool))
        forces.append(
            np.stack([sign * sum(G[c][d].T @ r[c] for c in range(len(r))) for d in range(len(r))])
        )
    force, moment = resultants(forces, [upper.points, lower.points])
    return force / np.abs(r).sum(), moment / np.abs(r).sum()


def dome(x: np.ndarray) -> np.ndarray:
    return np.stack([x[0], x[1], np.sqrt(4 - x[0] ** 2 - x[1] ** 2)])


def roof(x: np.ndarray) -> np.ndarray:
    return np.stack([2 * np.sin(x[0]), x[1], 2 * np.cos(x[0])])


@pytest.mark.parametrize("place", [dome, roof])
@pytest.mark.parametrize("cuts", CUTS)
@pytest.mark.parametrize("degree", [1, 2])
def test_curved_surfaces_are_in_equilibrium_and_close_with_the_mesh(degree, cuts, place):
    """No resultant force or moment, whatever the forces; gaps and levers of the order of the
    geometry.
    """
    for own in ("upper", "lower"):
        gaps = []
        for n in (4, 8) if degree == 1 else (3, 6):
            upper = face(grid(n), grid(n), degree, False, cuts[0], place)
            lower = face(grid(3 * n // 2), grid(3 * n // 2), degree, True, cuts[1], place)
            m = mortar(upper, lower, own)
            force, moment = random_forces(upper, lower, m)
            assert np.abs(force).max() < 1e-13 and np.abs(moment).max() < 1e-13
            assert np.any(m.lever)
            gaps.append(np.sqrt(np.mean(m.gap**2)))
        assert np.log2(gaps[0] / gaps[1]) > (1.6 if degree == 1 else 2.2)


def test_levers_are_what_keeps_the_moments():
    upper = face(grid(4), grid(4), 1, False, place=dome)
    lower = face(grid(6), grid(6), 1, True, place=dome)
    m = mortar(upper, lower)
    moment = random_forces(upper, lower, replace(m, carried=[]))[1]
    assert np.abs(moment).max() > 1e-6


def test_a_gap_of_the_geometry_stays_a_lever():
    """Friction at a large gap acts where the surfaces are; the gap closes before it arises."""
    upper, lower = line(grid(4), 1, False, y=lambda x: 0.5 + 0 * x), line(grid(6), 1, True)
    m = mortar(upper, lower)
    assert np.allclose(m.gap, 0.5) and np.abs(m.lever).max() == pytest.approx(1 / 6 / 8)


@pytest.mark.parametrize("degree", [1, 2])
def test_the_true_gap_of_curved_surfaces(degree):
    """With its curve, a polygon of chords has the gap of the parabola that it stands for, up to
    what a linear fit misses.
    """
    parabola = lambda x: np.stack([x[0], x[0] ** 2 / 4])  # noqa: E731
    upper = line(
        grid(6, -1, 1),
        degree,
        False,
        y=lambda x: np.interp(x, grid(6, -1, 1), grid(6, -1, 1) ** 2 / 4),
    )
    lower = line(grid(12, -1, 1), degree, True)
    rough, true = (mortar(replace(upper, curve=c), lower) for c in (None, parabola))
    exact = true.points[0] ** 2 / 4
    h = 2 / 12 / degree
    # of h^2 times the second derivative over 2: 1/12 to 1/6
    assert np.abs(true.gap - exact).max() < h**2 / 4 / 5
    assert np.abs(rough.gap - exact).max() > 2 * np.abs(true.gap - exact).max()


def test_initial_overlap_is_reported_with_its_size(caplog):
    upper = line(grid(4), 1, False, y=lambda x: -0.02 * x)
    with caplog.at_level(logging.WARNING):
        m = mortar(upper, line(grid(6), 1, True))
    assert "overlap initially, by up to 0.019" in caplog.text
    assert m.gap.min() == pytest.approx(-0.02, rel=1e-3)
    caplog.clear()
    mortar(line(grid(4), 1, False), line(grid(6), 1, True))
    assert not caplog.text


def test_an_overlap_is_told_once_for_all_meshes_of_a_run(caplog):
    def overlaps(*sizes):
        caplog.clear()
        for size in sizes:
            upper = line(grid(size), 1, False, y=lambda x: -0.02 * x)
            mortar(upper, line(grid(size + 2), 1, True))
        return caplog.text.count("overlap initially")

    with said_once():
        assert overlaps(4, 5, 8) == 1
    assert overlaps(4, 5) == 2


def test_turned_mirrored_moved_and_in_other_units():
    """Weights do not change with the place, the orientation or the unit of length."""
    upper = face(grid(3), grid(3), 2, False, True, dome)
    lower = face(grid(4), grid(5), 2, True, False, dome)
    m = mortar(upper, lower, "lower")
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    for scale, shift in ((1e-6, 0.0), (1e6, 0.0), (1.0, 100.0)):
        sign = np.sign(np.linalg.det(turn))
        moved = [
            replace(s, points=scale * (turn @ s.points + shift), turn=sign * s.turn)
            for s in (upper, lower)
        ]
        other = mortar(*moved, "lower")
        assert np.array_equal(m.nodes, other.nodes)
        assert np.allclose(other.areas, m.areas * scale**2, rtol=1e-9)
        assert np.allclose(other.normals, turn @ m.normals, atol=1e-9)
        assert np.allclose(other.gap, m.gap * scale, atol=1e-10 * scale)
        for W, V in zip(m.weights, other.weights):
            assert np.abs(W - V).max() < 1e-8


def test_surfaces_that_face_each_other_nowhere_or_twice_are_refused():
    lower = line(grid(4), 1, True)
    with pytest.raises(InputError, match="face each other nowhere"):
        mortar(line(grid(4, 2, 3), 1, False), lower)
    with pytest.raises(InputError, match="face each other nowhere"):
        mortar(line(grid(4), 1, True), lower)  # the same side
    with pytest.raises(InputError, match="'upper', 'lower' or None"):
        mortar(line(grid(4), 1, False), lower, "left")
    two = line(grid(4), 1, False)
    points = np.concatenate([two.points, two.points + np.array([[0], [0.1]])], axis=1)
    folded = replace(
        two,
        points=points,
        faces=np.concatenate([two.faces, two.faces + 5]),
        turn=np.tile(two.turn, 2),
    )
    with pytest.raises(InputError, match="two layers"):
        mortar(folded, lower, "lower")


def random_facets(rng: np.random.Generator, dim: int, n: int, shift: float) -> Facets:
    axis = rng.normal(size=(dim, n))
    sizes = 10 ** rng.uniform(-4, -1, n), 10 ** rng.uniform(-4, -0.5, n) * rng.integers(0, 2)
    return Facets(
        rng.uniform(size=(dim, n)) + shift, sizes[0], axis / np.linalg.norm(axis, axis=0), sizes[1]
    )


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("shift", [0.0, 1.0, 30.0])
def test_every_facet_that_a_normal_meets_is_found(dim, shift):
    rng = np.random.default_rng(int(shift))
    own, other = random_facets(rng, dim, 90, 0.0), random_facets(rng, dim, 700, shift)
    found = set(zip(*facing_pairs(own, other, -0.1)))
    # Lines from within each own ball, along directions within its cone, both ways: the balls that
    # they pass through.
    for _ in range(20):
        inside, off = rng.normal(size=(2, dim, 90))
        p = own.centre + own.radius * inside / np.linalg.norm(inside, axis=0)
        off = off - np.sum(off * own.axis, axis=0) * own.axis
        n = own.axis * np.cos(own.angle) + np.sin(own.angle) * off / np.linalg.norm(off, axis=0)
        v = other.centre[:, None] - p[:, :, None]
        away = np.linalg.norm(v - np.sum(v * n[:, :, None], axis=0) * n[:, :, None], axis=0)
        met = (away < other.radius) & (own.axis.T @ other.axis < -0.1)
        assert set(zip(*np.nonzero(met))) <= found
    assert len(found) < 0.2 * 90 * 700


@pytest.mark.parametrize("gap", [0.0, 0.001, 1.0, 100.0])
def test_the_search_costs_the_same_at_any_gap(gap):
    upper, lower = line(grid(2000), 1, False, y=lambda x: gap + 0 * x), line(grid(2001), 1, True)
    with patch.object(segments, "facing_pairs", wraps=facing_pairs) as search:
        seen = []
        search.side_effect = lambda *a: seen.append(facing_pairs(*a)) or seen[-1]
        m = mortar(upper, lower)
    assert len(seen) == 1 and len(seen[0][0]) < 5000  # 4001 overlap
    assert np.abs(m.areas - integrals(lower)).max() < 1e-15


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cells", [3, 5, 7, 12])
def test_contacts_below_the_steep_side_of_a_roller_stay_open(degree, cells):
    """The cell in which the roller ends: its gap and its normals are not continued to the node
    beyond.
    """
    angle = np.linspace(-np.pi / 2, np.pi / 2, 41)
    roller = line(np.sin(angle), degree, False, y=lambda x: 1 - np.sqrt(np.maximum(0.0, 1 - x**2)))
    m = mortar(roller, line(grid(cells, -1.37, 1.21), degree, True), "lower")
    assert (
        np.allclose(m.normals, [[0], [1]])
        and m.gap.min() > -0.1
        and np.abs(m.points[0]).max() < 1 + 1e-12
    )
    assert m.gap[np.abs(m.points[0]) > 0.8].min() > 0.3
    # the last facets are steeper than those that face anything
    assert m.areas.sum() == pytest.approx(2.0, rel=4e-3)


@pytest.mark.parametrize("gap", [0.02, 3.0])
def test_a_layer_far_behind_the_nearest_one_is_none_of_a_fold(gap):
    near, lower = line(grid(5), 1, False, y=lambda x: gap + 0 * x), line(grid(8), 1, True)
    points = np.concatenate([near.points, near.points + np.array([[0.1], [20.0]])], axis=1)
    both = replace(
        near,
        points=points,
        faces=np.concatenate([near.faces, near.faces + 6]),
        turn=np.tile(near.turn, 2),
    )
    assert np.allclose(mortar(both, lower, "lower").gap, gap)
    below = replace(both, points=np.where(points > 10, points - 40, points))
    assert np.allclose(mortar(below, lower, "lower").gap, gap)


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
    """Turned, moved, in other units, on meshes of other kinds: without lateral contraction the
    pressure is uniform.
    """
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
    upper = replace(scene.upper, mesh=slab(kind, 0, 1, a))
    lower = replace(scene.lower, mesh=slab(kind, -2, 0, b, power=1.0))
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
    """Polygons of 24 and 36 edges in each other, any forces: no resultant force and no resultant
    moment.
    """
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
    """Peak and width within .2 % on at most 10,000 unknowns; no larger error of the pressure than
    on matching meshes.
    """
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
    """The component that symmetry holds is taken at the node and at the place facing it alone, and
    the rounding of kinks sees the mirror image.
    """
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
    """On curved surfaces, with friction: at planes of symmetry nothing slips while the rings press
    each other.
    """
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
    """Contacts of the larger, finer surface reach beyond the block's edge: the approach converges
    to that of matching meshes.
    """
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


@pytest.mark.parametrize("weight", [(1.0, False), (2 * np.pi, True)])
def test_finer_contacts_see_no_kinks_of_linear_elements(weight):
    """A parabola that both sides interpolate linearly has no relative displacement but a constant,
    away from uneven cells.
    """
    upper, lower = line(grid(8), 1, False, weight=weight), line(grid(24), 1, True, weight=weight)
    m = mortar(upper, lower)
    inner = (m.points[0] > 0.2) & (m.points[0] < 0.8)
    seen = [W @ s.points[0] ** 2 for W, s in zip(m.weights, (upper, lower))]
    apart = (seen[0] - seen[1])[inner]
    assert np.ptp(apart) < 1e-3 / 8**2
    # what interpolation adds on either side
    assert apart.mean() == pytest.approx((1 / 8**2 - 1 / 24**2) / 6, rel=1e-3)


@pytest.mark.parametrize("cuts", CUTS)
def test_finer_contacts_see_no_kinks_in_space(cuts):
    upper = face(grid(6), grid(6), 1, False, cuts[0])
    lower = face(grid(18), grid(18), 1, True, cuts[1])
    m = mortar(upper, lower)
    inner = np.all((m.points[:2] > 0.3) & (m.points[:2] < 0.7), axis=0)
    for field in (lambda x: x[0] ** 2, lambda x: x[0] * x[1], lambda x: x[1] ** 2 - x[0] * x[1]):
        seen = [W @ field(s.points) for W, s in zip(m.weights, (upper, lower))]
        assert np.ptp((seen[0] - seen[1])[inner]) < 0.15 / 6**2  # linear interpolation: 1/4 of it


def test_frames_do_not_depend_on_the_side_that_carries():
    """Normals are those of the lower body, seen from the contacts."""
    upper = line(grid(24, -1, 1), 1, False, y=lambda x: x**2 / 8)
    lower = line(grid(16, -1, 1), 1, True, y=lambda x: x**2 / 40)
    for own in ("upper", "lower"):
        m = mortar(upper, lower, own)
        slope = m.points[0] / 20
        exact = np.stack([-slope, np.ones_like(slope)]) / np.hypot(1, slope)
        assert np.abs(m.normals - exact)[:, 1:-1].max() < 1e-3


def test_normals_at_the_ends_of_curved_elements_are_of_second_order():
    errors = []
    for n in (4, 8):
        x = grid(n, -0.5, 0.5)
        m = mortar(line(x, 2, False, y=np.cos), line(x, 2, True, y=np.cos))
        slope = np.sin(m.points[0])
        exact = np.stack([slope, np.ones_like(slope)]) / np.hypot(1, slope)
        errors.append(np.abs(m.normals - exact).max())
    assert np.log2(errors[0] / errors[1]) > 1.8


def test_mortar_is_chosen_where_nodes_do_not_match(caplog):
    scene = two_blocks("plane-strain", force=3.0)
    finer = replace(scene, lower=replace(scene.lower, mesh=slab("plane-strain", -2, 0, 7)))
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
    """A plate that is clamped at its edge, and finer than the other one: carried by its own nodes,
    pressures on that edge alternate.
    """

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
