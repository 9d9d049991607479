"""Gaps and overlaps of surfaces joined by mortar, and the search for who faces whom."""

import logging
from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest

from contactopt import InputError
from contactopt.checks import said_once
from contactopt.coupling import segments
from contactopt.coupling.facing import Facets, facing_pairs
from contactopt.coupling.mortar import mortar
from tests.test_mortar import grid, integrals, line


def test_a_gap_of_the_geometry_stays_a_lever():
    """Friction at a large gap acts where the surfaces are; the gap closes before it arises."""
    upper, lower = line(grid(4), 1, False, y=lambda x: 0.5 + 0 * x), line(grid(6), 1, True)
    m = mortar(upper, lower)
    assert np.allclose(m.gap, 0.5) and np.abs(m.lever).max() == pytest.approx(1 / 6 / 8)


@pytest.mark.parametrize("degree", [1, 2])
def test_the_true_gap_of_curved_surfaces(degree):
    """With its curve, a polygon of chords has the gap of the parabola that it stands for."""
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
    mortar(line(grid(4), 1, False, y=lambda x: -1e-7 * x), line(grid(6), 1, True))  # as files round
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
    """Gap and normals are not continued beyond the cell in which the roller ends."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 41)
    roller = line(np.sin(angle), degree, False, y=lambda x: 1 - np.sqrt(np.maximum(0.0, 1 - x**2)))
    m = mortar(roller, line(grid(cells, -1.37, 1.21), degree, True), "lower")
    assert np.allclose(m.normals, [[0], [1]]) and m.gap.min() > -0.1
    assert np.abs(m.points[0]).max() < 1 + 1e-12
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
