"""Turning or mirroring a whole scene turns or mirrors the answer, and nothing else."""

import numpy as np
import pytest
import turned
from scipy.spatial import KDTree

from contactopt import reduce_bodies

SCENES = {
    "punch": turned.punch,
    "cylinder": turned.cylinder,
    "pin": turned.pin_in_bush,
    "wide pin": lambda: turned.pin_in_bush(clearance=4.0),
    "floor": turned.pulled_block,
    "cube": lambda: turned.punch(3, elements=3),
}
OBLIQUE = turned.turn_about((1.0, 2.0, -0.5), 67.0)
MOVES = [
    *(
        (name, f"{degrees}", turned.turn(degrees))
        for name in list(SCENES)[:5]
        for degrees in (30, 90, 137, 180)
    ),
    *((name, "mirrored", turned.mirror(2)) for name in list(SCENES)[:5]),
    ("cube", "oblique", OBLIQUE),
    ("cube", "on its side", turned.turn_about((1.0, 0.0, 0.0), 90.0)),
    ("cube", "mirrored", OBLIQUE @ turned.mirror(3)),
]


@pytest.fixture(scope="module")
def plain():
    return {name: reduce_bodies(make()) for name, make in SCENES.items()}


@pytest.mark.parametrize("name,_,R", MOVES, ids=[f"{name}-{how}" for name, how, _ in MOVES])
def test_a_turned_scene_has_the_same_interface_problem(plain, name, _, R):
    """Q, q, V, s and the chart in local frames; multipliers are vectors that turn with space."""
    a, b = plain[name], reduce_bodies(turned.moved(SCENES[name](), R))
    p, k, dim = a.problem, *a.problem.q.shape
    distance, own = KDTree(b.problem.coordinates.T).query((R @ p.coordinates).T)
    assert distance.max() < 1e-9 * np.ptp(p.coordinates) and len(set(own)) == k
    # each frame is the image of the other, up to the sense of tangents where the scene was mirrored
    sense = np.einsum("kac,dc,kbd->kab", a.coupling.frames, R, b.coupling.frames[own])
    signs = np.einsum("kaa->ka", sense)
    assert np.abs(sense - signs[:, :, None] * np.eye(dim)).max() < 1e-9
    assert np.allclose(np.abs(signs), 1, atol=1e-9)
    if np.linalg.det(R) > 0:
        assert np.allclose(signs, 1)
    flip, rows = np.sign(signs).ravel(), (dim * own[:, None] + np.arange(dim)).ravel()
    Q = flip[:, None] * b.problem.Q[np.ix_(rows, rows)] * flip
    assert np.abs(Q - p.Q).max() < 1e-9 * np.abs(p.Q).max()
    length = np.abs(p.Q).max() * np.abs(p.s).max()
    assert np.abs(flip * b.problem.q[own].ravel() - p.q.ravel()).max() < 1e-9 * length
    columns = np.eye(len(p.s)) if len(p.s) != dim else R
    assert np.abs(flip[:, None] * b.problem.V[rows] @ columns - p.V).max() < 1e-9
    assert np.abs(b.problem.s - columns @ p.s).max() < 1e-9 * np.abs(p.s).max()
    assert np.allclose(b.problem.areas[own], p.areas, rtol=1e-9)
    chart, other = p.chart.places, b.problem.chart.places[:, own]
    assert b.problem.chart.period == (
        None if p.chart.period is None else pytest.approx(p.chart.period, rel=1e-9)
    )
    if np.linalg.det(R) < 0 and p.chart.period is None:
        chart, other = np.abs(chart), np.abs(other)
    elif np.linalg.det(R) < 0:
        chart = np.minimum(chart, p.chart.period - chart)
        other = np.minimum(other, p.chart.period - other)
    assert np.abs(chart - other).max() < 1e-9 * np.abs(chart).max()
    if np.linalg.det(R) > 0:
        # contacts are numbered along the surface, whatever way it lies
        assert np.array_equal(own, np.arange(k))


@pytest.mark.parametrize("clearance", [0.0, 0.5, 4.0])
def test_a_pin_in_a_bush_is_coupled_along_the_radius(clearance):
    """Concentric circles: the gap is the clearance, every partner lies on the same radius."""
    scene = turned.pin_in_bush(clearance=clearance)
    reduction = reduce_bodies(scene)
    assert np.allclose(reduction.coupling.gap, clearance, rtol=0.02, atol=1e-12)
    x = reduction.coupling.positions
    n = reduction.coupling.frames[:, 0]
    # outward normal of the bush, towards the pin
    assert np.all(np.sum(n * x.T, axis=1) < -0.95 * 20)
    period = reduction.coupling.chart.period
    angle = np.sort(np.arctan2(x[1], x[0]))
    chords = 40 * np.sin(np.diff(np.append(angle, angle[0] + 2 * np.pi)) / 2)
    assert period == pytest.approx(chords.sum(), rel=1e-3)
    # A unit turn of the pin as a rigid whole slides every contact by its radius and opens none: so
    # partners are right.
    body = reduction.bodies[0].body
    U = np.zeros(len(body.load))
    U[body.unknowns[0]], U[body.unknowns[1]] = -body.locations[1], body.locations[0]
    u = (reduction.maps[0] @ U).reshape(-1, 2)
    assert np.allclose(np.abs(u[:, 1]), 20 - clearance, rtol=1e-3)
    assert np.abs(u[:, 0]).max() < 0.05 * 20
    assert len(np.unique(np.sign(u[:, 1]))) == 1
