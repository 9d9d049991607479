"""Mortar coupling: exactness on pure surfaces, equilibrium, curved interfaces, and whole scenes."""

from dataclasses import replace

import numpy as np
import pytest
from mortar_scenes import resultants
from skfem.quadrature import get_quadrature

from contactopt.bodies.elements import FACES, weight_at
from contactopt.coupling.faces import Faces, cross, evaluate
from contactopt.coupling.mortar import mortar

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
    """Row sums, linear fields, forces of uniform pressure."""
    for W, surface in zip(m.weights, (upper, lower)):
        assert np.abs(W.sum(axis=1) - 1).max() < 1e-12
        assert np.abs(W @ surface.points.T - m.points.T).max() < 1e-11
        assert np.abs(m.areas @ W - integrals(surface)).max() < 1e-12 * m.areas.sum()
    assert np.abs(m.gap).max() < 1e-12 and not np.any(m.lever)
    assert np.all(m.areas > 0)


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
    """Contacts beyond the edge of the other surface keep their places."""
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
    """No resultant force or moment, whatever the forces."""
    own = ("upper", "lower")[(degree + (place is dome)) % 2]
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


@pytest.mark.parametrize("weight", [(1.0, False), (2 * np.pi, True)])
def test_finer_contacts_see_no_kinks_of_linear_elements(weight):
    """A parabola that both sides interpolate linearly has only a constant relative displacement."""
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
