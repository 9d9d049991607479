"""The preconditioner of any contact mesh, against dense formulas."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
from scipy.sparse.linalg import cg
from skfem import MeshQuad, MeshTri
from turned import renumbered

from contactopt import InputError, InterfaceProblem, Material, Part, Scene, Support, reduce
from contactopt.meshes.structured import graded
from contactopt.methods.preconditioners import deflated, preconditioner, smooth_motions
from contactopt.methods.preconditioners.surface import laplacian, surface_matrices
from contactopt.problem.chart import Chart

POISSON = 0.3


def disc(size):
    mesh = MeshTri.init_circle(size)
    return mesh.p, mesh.t


def graded_corner(size):
    """Triangles that are twenty times finer at one corner than far from it."""
    mesh = MeshTri.init_tensor(*[np.linspace(0, 1, 2 * size - 1)] * 2)
    for ring in range(5):
        mesh = mesh.refined(
            np.flatnonzero(np.linalg.norm(mesh.p[:, mesh.t].mean(axis=1), axis=0) < 0.5**ring)
        )
    return mesh.p, mesh.t


def l_shape(size):
    mesh = MeshTri.init_lshaped().refined(size - 1)
    inner = np.setdiff1d(np.arange(mesh.p.shape[1]), mesh.boundary_nodes())
    p = mesh.p.copy()
    p[:, inner] += (
        0.15 * 2.0 ** (1 - size) * np.random.default_rng(0).uniform(-1, 1, (2, len(inner)))
    )
    return p, mesh.t


def annulus(size):
    n = 6 * 2 ** (size - 1)
    radii = np.linspace(0.5, 1.0, n // 6 + 1)
    angle = 2 * np.pi * np.arange(n) / n
    p = np.concatenate([r * np.stack([np.cos(angle), np.sin(angle)]) for r in radii], axis=1)
    i = np.arange(n)
    cells = []
    for ring in range(len(radii) - 1):
        a, b = ring * n + i, ring * n + (i + 1) % n
        cells += [np.stack([a, b, a + n]), np.stack([b, b + n, a + n])]
    return p, np.concatenate(cells, axis=1)


def half_space(points, cells):
    """Boussinesq's and Cerruti's kernels for forces spread over three points of each triangle, Q
    dense.
    """
    k, c = points.shape[1], cells.shape[1]
    hats = np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6
    x = points[:, cells]
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    area = np.abs(a[0] * b[1] - a[1] * b[0]) / 2
    at = np.concatenate([np.einsum("v,dvc->dc", hat, x) for hat in hats], axis=1)
    W = np.zeros((k, 3 * c))
    for j, hat in enumerate(hats):
        for corner, share in zip(cells, hat):
            np.add.at(W, (corner, j * c + np.arange(c)), share * area / 3)
    mass = W.sum(axis=1)
    W /= mass[:, None]
    apart = at[:, :, None] - at[:, None]
    r = np.hypot(*apart)
    own = np.eye(len(r), dtype=bool)
    r[own] = np.sqrt(np.tile(area / 3, 3) / np.pi) / 2  # mean over a disc of that area
    cosine = [np.where(own, 0.5**0.5, d / r) for d in apart]
    Q = np.zeros((k, 3, k, 3))
    Q[:, 0, :, 0] = (1 - POISSON) * W @ (1 / r) @ W.T
    for i in range(2):
        Q[:, 1 + i, :, 1 + i] = W @ ((1 - POISSON + POISSON * cosine[i] ** 2) / r) @ W.T
    cross = W @ np.where(own, 0.0, cosine[0] * cosine[1] * POISSON / r) @ W.T
    Q[:, 1, :, 2], Q[:, 2, :, 1] = cross, cross.T
    Q = Q.reshape(3 * k, 3 * k)
    space = np.concatenate([points, np.zeros((1, k))])
    chart = Chart(points, (False, False), None, cells)
    return InterfaceProblem(
        (Q + Q.T) / 2, np.zeros((k, 3)), 0.5, areas=mass, coordinates=space, chart=chart
    )


def condition(P, Q):
    values = la.eigvalsh(la.cholesky(Q) @ (P @ np.eye(len(Q))) @ la.cholesky(Q).T)
    return values[-1] / values[0]


def iterations(P, Q):
    count = [0]
    right = np.random.default_rng(0).normal(size=len(Q))
    cg(Q, right, rtol=1e-8, M=P, callback=lambda x: count.__setitem__(0, count[0] + 1))
    return count[0]


@pytest.mark.parametrize(
    ("shape", "size"), [(disc, 3), (annulus, 3), (l_shape, 4), (graded_corner, 3)]
)
def test_it_fits_half_spaces_under_any_surface(shape, size):
    problem = half_space(*shape(size))
    P = preconditioner(problem, "laplacian")
    assert condition(P, problem.Q) < 10
    assert iterations(P, problem.Q) <= 30
    assert iterations(None, problem.Q) > 1.3 * iterations(P, problem.Q)


def test_products_are_those_of_the_dense_root():
    problem = half_space(*disc(2))
    K, mass, shift, share = surface_matrices(problem.chart.places, problem.chart.cells)
    full = mass / share
    L = K.toarray() / np.sqrt(np.outer(full, full)) + np.diag(shift)
    weight = np.sqrt(full) * share**0.2
    dense = weight[:, None] * la.sqrtm(L).real * weight
    P = preconditioner(problem, "laplacian")
    found = (P @ np.eye(3 * len(mass)))[::3, ::3]
    assert np.allclose(
        found / found[0, 0], dense / dense[0, 0], atol=1e-3 * np.abs(dense / dense[0, 0]).max()
    )
    back = P.model @ (P @ problem.Q[0])
    assert np.allclose(back, problem.Q[0], atol=2e-3 * np.abs(problem.Q[0]).max())


def test_numbering_and_units_do_not_matter():
    problem = half_space(*l_shape(3))
    k = problem.contacts
    order = np.random.default_rng(0).permutation(k)
    rows = (3 * order[:, None] + np.arange(3)).ravel()
    mixed = renumbered(problem, order, unit=1e3)
    P = preconditioner(problem, "laplacian") @ np.eye(3 * k)
    R = preconditioner(mixed, "laplacian") @ np.eye(3 * k)
    assert np.allclose(R / np.trace(R), P[np.ix_(rows, rows)] / np.trace(P), atol=1e-9)


def pin_in_bush(n, ratio):
    """A closed contact line of n nodes in the plane, the pin held inside and the bush outside."""
    angle, rise = 2 * np.pi * np.arange(n) / n, graded(1.0, 2 * np.pi / n, 1.3)

    def part(name, radii, material, far):
        p = np.concatenate([r * np.stack([np.cos(angle), np.sin(angle)]) for r in radii], axis=1)
        i = np.arange(n)
        cells = [
            np.stack([i, i + n, (i + 1) % n + n, (i + 1) % n]) + ring * n
            for ring in range(len(radii) - 1)
        ]
        mesh = MeshQuad(p, np.concatenate(cells, axis=1))
        middle = np.cos(np.pi / n)
        mesh = mesh.with_boundaries(
            {
                "contact": lambda x: np.abs(np.hypot(*x) - middle) < 1e-6,
                "far": lambda x: np.abs(np.hypot(*x) - far * middle) < 1e-6,
            }
        )
        return Part(name, mesh, material, (Support("far"),))

    pin = part("pin", 1 - 0.8 * rise[::-1], Material(1.0, POISSON), 0.2)
    bush = part("bush", 1 + rise, Material(ratio, POISSON), 2.0)
    return reduce(Scene("bush", pin, bush, 0.5), Q="explicit")


@pytest.mark.parametrize("ratio", [1e-4, 1.0, 1e4])
def test_a_pin_in_a_bush(ratio):
    """The rigid motions of the pin against the bush are deflated."""
    problem = pin_in_bush(64, ratio)
    P = deflated(preconditioner(problem, "laplacian"), problem.Q, smooth_motions(problem))
    assert condition(P, problem.Q) < 5


@pytest.mark.parametrize("name", ["p21", "p22", "neumann", "laplacian"])
def test_on_a_closed_curve_the_circulant_is_exact(name):
    """Q of a pin in a bush is a circulant of 2 x 2 blocks, P is one too: they have the same
    eigenvectors, none is extended.

    Matrices of the normal components commute, and the condition number does not grow with the
    number of nodes.
    """
    found = []
    for n in (32, 64):
        problem = pin_in_bush(n, 3.0)
        order = problem.chart.order()
        at = (2 * order[:, None] + np.arange(2)).ravel()
        P = (preconditioner(problem, name) @ np.eye(2 * n))[np.ix_(at, at)]
        Q = problem.Q[np.ix_(at, at)]
        for M, limit in ((Q, 1e-7), (P, 1e-6)):
            around = np.roll(M, (2, 2), axis=(0, 1))
            assert np.abs(around - M).max() < limit * np.abs(M).max()
        both = P[::2, ::2] @ Q[::2, ::2]
        assert np.abs(both - both.T).max() < 1e-6 * np.abs(both).max()
        # the eigenvalues of P Q, wave by wave
        waves = np.fft.fft(P[::2, 0]).real * np.fft.fft(Q[::2, 0]).real
        found.append(waves[2:-1].max() / waves[2:-1].min())  # rigid motions are left out
    assert found[1] < 1.2 * found[0] < 10


def test_a_surface_without_cells_is_refused():
    with pytest.raises(InputError, match="needs the cells of the contact surface"):
        preconditioner(InterfaceProblem(np.eye(9), np.zeros((3, 3)), 0.1), "laplacian")


def test_eigenvectors_and_poles_are_the_same_root(monkeypatch):
    points, cells = disc(2)
    k = points.shape[1]
    problem = InterfaceProblem(np.eye(3 * k), np.zeros((k, 3)), 0.3, coordinates=points)
    problem = replace(problem, chart=replace(problem.chart, cells=cells))
    held = np.zeros((k, 3), dtype=bool)
    X = np.random.default_rng(0).normal(size=(k, 3))
    dense = [act(X) for act in laplacian(problem, held)]
    monkeypatch.setattr("contactopt.methods.preconditioners.surface.EIGENVECTORS", 0)
    for act, product in zip(laplacian(problem, held), dense):
        assert np.abs(act(X) - product).max() <= 1e-3 * np.abs(product).max()
