"""Mortar coupling: exactness on pure surfaces, equilibrium, curved interfaces, and whole scenes."""

import numpy as np
import pytest

from contactopt import InputError
from contactopt.interface.mortar import mortar
from contactopt.interface.faces import Faces

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
    return Faces("b", KINDS["line", cut], degree, points, faces, np.full(n - 1, -1.0 if up else 1.0), **more)


def face(xs, ys, degree: int, up: bool, cut: bool = False, place=lambda x: x, straight: bool = True, **more) -> Faces:
    """A grid of rectangles, each cut in two or not, put into space by `place` (2, n) -> (3, n) of plane coordinates."""
    i, j = np.meshgrid(np.arange(len(xs) - 1), np.arange(len(ys) - 1), indexing="ij")

    def number(a, b):
        return (a * len(ys) + b).ravel()

    square = np.stack([number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)], axis=1)
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
    from skfem.quadrature import get_quadrature

    from contactopt.bodies.elements import FACES, weight_at
    from contactopt.interface.faces import cross

    at, share = get_quadrature(FACES[surface.kind][0], 10)
    count = len(surface.faces)
    which, at = np.repeat(np.arange(count), len(share)), np.tile(at, count)
    x, tangents = surface.locations(which, at)
    measure = np.tile(share, count) * np.linalg.norm(cross(tangents), axis=0) * weight_at(surface.weight, x)
    out = np.zeros(surface.points.shape[1])
    np.add.at(out, surface.faces[which], (surface.shapes(at) * measure).T)
    return out


RATIOS = [(4, 6), (3, 9), (2, 14), (5, 5)]
SIDES = ["upper", "lower", None]


def check_exact(m, upper: Faces, lower: Faces, areas: bool = True) -> None:
    """Row sums, linear fields, forces of uniform pressure; all on flat surfaces that cover each other."""
    for W, surface in zip(m.weights, (upper, lower)):
        assert np.abs(W.sum(axis=1) - 1).max() < 1e-12
        assert np.abs(W @ surface.points.T - m.points.T).max() < 1e-11
        if areas:
            assert np.abs(m.areas @ W - integrals(surface)).max() < 1e-12 * m.areas.sum()
    assert np.abs(m.gap).max() < 1e-12 and not np.any(m.lever)
    assert np.all(m.areas > 0)


@pytest.mark.parametrize("weight", [(0.7, False), (2 * np.pi, True)])
@pytest.mark.parametrize("own", SIDES)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("degree,cut", [(1, False), (2, False), (2, True)])
def test_lines(degree, cut, ratio, own, weight):
    upper = line(grid(ratio[0], power=1.3), degree, False, cut, weight=weight)
    lower = line(grid(ratio[1]), degree, True, cut, weight=weight)
    m = mortar(upper, lower, own)
    check_exact(m, upper, lower)
    assert np.allclose(m.normals, [[0], [1]], atol=1e-14)
    if own is None and ratio != (5, 5):
        assert m.own == 1


@pytest.mark.parametrize("own", SIDES)
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("cuts", [(False, False), (True, True), (False, True)])
@pytest.mark.parametrize("degree", [1, 2])
def test_faces(degree, cuts, ratio, own):
    upper = face(grid(ratio[0]), grid(ratio[0], power=1.2), degree, False, cuts[0])
    lower = face(grid(ratio[1]), grid(ratio[1] - 1), degree, True, cuts[1])
    m = mortar(upper, lower, own)
    check_exact(m, upper, lower)
    assert np.allclose(m.normals.T, [0, 0, 1])
