"""Half-spaces: kernels against quadrature and equilibrium, solutions against exact ones."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import dblquad, quad

import contactopt
from contactopt import HalfSpace, InputError, Material, Rigid, Scene, natural_map_residual, scenes
from contactopt.bodies.half_space import HalfSpaceBody
from contactopt.bodies.influence import half_plane_influence, half_space_influence
from contactopt.coupling.reduction import reduce_bodies
from contactopt.linear.convolution import Convolution
from contactopt.methods.nested import Nested
from contactopt.readings import peaks
from contactopt.readings.peaks import largest_around, maxima
from contactopt.scenes.rough_surfaces import self_affine

STEEL, SOFT = Material(5.0, 0.3), Material(2.0, 0.45)

E_STAR = STEEL.E / (1 - STEEL.nu**2)

LAWS = ("frictionless", "coulomb", "tresca", "bilateral", "associated")


def ticks(n, length=10.0):
    return (np.arange(n) + 0.5) * length / n - length / 2


def ball(n=20, law="coulomb", mu=0.3, shear=0.4, m=None, lower=STEEL, upper=None, **changes):
    """A paraboloid pressed on a square of n x m points and sheared."""
    mu = 0.0 if law == "frictionless" else mu
    points = (ticks(n), ticks(m or n, 10.0 * (m or n) / n))
    force = {"z": -3.0} | ({"x": shear} if shear else {})
    above = Rigid("ball", gap=lambda x: np.sum(x[:2] ** 2, axis=0) / 20, force=force)
    if upper is not None:
        above = HalfSpace(
            "ball", upper, points, height=lambda x: -np.sum(x**2, axis=0) / 20, force=force
        )
    return Scene(
        "ball", above, HalfSpace("base", lower, points, **changes), mu, kind="solid", law=law
    )


@pytest.mark.parametrize(
    "dim,periodic,lower", [(2, False, True), (2, True, False), (3, False, False), (3, True, True)]
)
def test_the_height_counts_beside_a_flat_rigid_body(dim, periodic, lower):
    """It gives the answer of the same shape as a gap, whichever body it is on."""
    points, axis = (ticks(12),) * (dim - 1), "xyz"[dim - 1]
    force = {axis: -3.0}

    def height(x):
        return 0.02 * np.cos(x[0]) - np.sum(x**2, axis=0) / 20

    def largest(rigid, **shape):
        own = HalfSpace(
            "base", STEEL, points, periodic=periodic, force=None if lower else force, **shape
        )
        bodies = (rigid, own) if lower else (own, rigid)
        scene = Scene("s", *bodies, 0.3, kind="plane-strain" if dim == 2 else "solid")
        return contactopt.run(scene, figures=()).summary["max_pressure"]

    held = {"force": force if lower else None}
    by_gap = largest(Rigid("top", gap=lambda x: -height(x[:-1]), **held))
    assert largest(Rigid("top", **held), height=height) == pytest.approx(by_gap, rel=1e-9)
    stiff = HalfSpace("top", Material(1e9, 0.3), points, periodic=periodic, **held)
    assert largest(stiff, height=height) == pytest.approx(by_gap, rel=1e-5)
    with pytest.raises(InputError, match="give one of them"):
        largest(Rigid("top", gap=lambda x: -height(x[:-1]), **held), height=height)


PLACES = [
    ((1.0, 0.7), place)
    for place in [(0, 0), (1, 0), (0, 1), (3, 2), (12, 5), (13, 13), (40, 2), (70, 66)]
]


@pytest.mark.parametrize("cell,place", [*PLACES, ((1.0, 50.0), (13, 0)), ((50.0, 1.0), (0, 65))])
def test_coefficients_are_integrals_of_point_forces(cell, place):
    """Boussinesq's and Cerruti's displacements."""
    (hx, hy), nu = cell, STEEL.nu
    G = STEEL.E / 2.6
    made = half_space_influence(STEEL, (hx, hy), tuple(np.array([p]) for p in place))
    exact = {
        (0, 0): lambda x, y: (1 - nu) / np.hypot(x, y) + nu * x**2 / np.hypot(x, y) ** 3,
        (1, 1): lambda x, y: (1 - nu) / np.hypot(x, y) + nu * y**2 / np.hypot(x, y) ** 3,
        (2, 2): lambda x, y: (1 - nu) / np.hypot(x, y),
        (0, 1): lambda x, y: nu * x * y / np.hypot(x, y) ** 3,
        (0, 2): lambda x, y: (0.5 - nu) * x / (x**2 + y**2),
        (1, 2): lambda x, y: (0.5 - nu) * y / (x**2 + y**2),
    }
    x, y = hx * place[0], hy * place[1]
    for pair, value in exact.items():
        if any(at == 0 and (axis in pair) and pair[0] != pair[1] for axis, at in enumerate(place)):
            assert abs(made[pair][0, 0]) < 1e-15  # odd
            continue
        total = sum(
            dblquad(
                lambda s, r, value=value: value(r, s),
                *((a - hx / 2, a) if left else (a, a + hx / 2)),
                *((b - hy / 2, b) if low else (b, b + hy / 2)),
                epsabs=1e-13,
                epsrel=1e-12,
            )[0]
            for left in (True, False)
            for low in (True, False)
            for a, b in [(x, y)]
        )
        assert made[pair][0, 0] == pytest.approx(total / (hx * hy) / (2 * np.pi * G), rel=1e-10)


@pytest.mark.parametrize("place", [0, 1, 12, 13, 500])
def test_coefficients_of_strips(place):
    h, depth, nu, G = 0.5, 30.0, STEEL.nu, STEEL.E / 2.6
    made = half_plane_influence(STEEL, h, np.array([place]), depth)
    x = h * place
    logs = (
        quad(lambda s: np.log(abs(s)), x - h / 2, x, epsabs=1e-14)[0]
        + quad(lambda s: np.log(abs(s)), x, x + h / 2, epsabs=1e-14)[0]
    )
    for pair, sign in (((0, 0), 1), ((1, 1), -1)):
        exact = (1 - nu) / (np.pi * G) * (np.log(depth) - logs / h + sign / (2 * (1 - nu)))
        assert made[pair][0] == pytest.approx(exact, rel=1e-10)
    assert made[0, 1][0] == pytest.approx((1 - 2 * nu) / (4 * G) * np.sign(place))


def test_flamants_reference_point_is_johnsons():
    """Hertz's line contact: the surface sinks against a point at depth d by P (1 - nu^2)/(pi E) (2
    ln(2 d/a) - nu/(1 - nu)).
    """
    a, n, depth, P = 1.0, 2000, 500.0, 1.0
    x = (np.arange(n) + 0.5) * 2 * a / n - a
    made = half_plane_influence(STEEL, 2 * a / n, np.arange(n), depth)[1, 1]
    force = 2 * P / (np.pi * a) * np.sqrt(1 - x**2) * (2 * a / n)
    middle = np.sum(made[np.abs(np.arange(n) - n // 2)] * force)
    exact = (
        P
        * (1 - STEEL.nu**2)
        / (np.pi * STEEL.E)
        * (2 * np.log(2 * depth / a) - STEEL.nu / (1 - STEEL.nu))
    )
    assert middle == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize(
    "changes", [{}, {"upper": SOFT}, {"upper": STEEL}, {"m": 12}, {"periodic": True}]
)
def test_operator_is_symmetric_positive_and_equal_to_its_entries(changes):
    reduction = reduce_bodies(ball(16, **changes))
    Q = reduction.problem.Q
    assert isinstance(Q, Convolution)
    entries, x = Q.to_dense(), np.random.default_rng(0).normal(size=Q.shape[0])
    np.testing.assert_allclose(Q @ x, entries @ x, atol=1e-13)
    np.testing.assert_allclose(entries, entries.T, atol=1e-15)
    np.testing.assert_allclose(np.diag(entries), Q.diagonal, rtol=1e-12)
    assert np.linalg.eigvalsh(entries).min() > -1e-13
    np.testing.assert_allclose(Q.loosened(1e-3) @ x, entries @ x, atol=1e-5)
    by_bodies = sum(
        B @ body.displacement(B.T @ x, 0 * body.motions.resultants)
        for B, body in zip(reduction.maps, reduction.bodies)
    )
    np.testing.assert_allclose(by_bodies, entries @ x, atol=1e-12)
    np.testing.assert_allclose(
        contactopt.reduce(ball(16, **changes), Q="explicit").Q, entries, atol=1e-14
    )


def test_equal_materials_do_not_couple_normal_and_tangential_forces():
    Q = reduce_bodies(ball(8, upper=STEEL)).problem.Q.to_dense()
    normal = np.arange(0, len(Q), 3)
    assert np.abs(Q[np.ix_(normal, normal + 1)]).max() < 1e-15 * np.abs(Q).max() * 10
    alone = reduce_bodies(ball(8)).problem.Q.to_dense()
    assert np.abs(alone[np.ix_(normal, normal + 1)]).max() > 0.03 * np.abs(alone).max()
    np.testing.assert_allclose(
        Q[np.ix_(normal, normal)], 2 * alone[np.ix_(normal, normal)], rtol=1e-12
    )


@pytest.mark.parametrize("law", LAWS)
def test_nested_grids_give_the_answer_of_the_dense_method(law):
    mu = 0.01 if law == "tresca" else 0.3
    problem = contactopt.reduce(
        ball(
            26 if law == "tresca" else 20,
            law=law,
            mu=mu,
            shear=0.0 if law == "frictionless" else 0.4,
        )
    )
    nested = contactopt.solve(problem, Nested(), tol=1e-9)
    dense = contactopt.solve(problem.explicit(), tol=1e-9)
    assert nested.solved and dense.solved and nested.products > 0
    assert natural_map_residual(problem.explicit(), nested.reactions, nested.multipliers) < 1e-9
    np.testing.assert_allclose(
        nested.reactions, dense.reactions, atol=1e-6 * np.abs(dense.reactions).max()
    )


def test_odd_grids_and_strips():
    for problem in (contactopt.reduce(ball(27, m=41)), contactopt.reduce(ball(50, m=4))):
        assert contactopt.solve(problem).solved


def test_the_products_of_a_rough_surface_with_friction_do_not_grow_with_its_grid():
    found = []
    for n in (64, 256):
        heights = self_affine((n, n), (10.0, 10.0), longest=2.5, shortest=0.625, slope=0.1)
        above = Rigid("body", gap=heights.max() - heights, force={"z": -2.5, "x": 0.375})
        below = HalfSpace("base", STEEL, (ticks(n), ticks(n)))
        solution = contactopt.solve(
            contactopt.reduce(Scene("rough", above, below, 0.3, kind="solid"))
        )
        assert solution.solved
        found.append(solution.products)
    assert max(found) <= 40  # 43 and 51 where GMRES measured preconditioned residuals


def test_self_affine_surface():
    lengths = (10.0, 10.0)
    made = self_affine((64, 64), lengths, shortest=1.0, slope=0.2, seed=3)
    spectrum = np.abs(np.fft.fft2(made) / made.size) ** 2
    waves = np.meshgrid(*[2 * np.pi * np.fft.fftfreq(64, 10 / 64)] * 2)
    assert np.sum((waves[0] ** 2 + waves[1] ** 2) * spectrum) == pytest.approx(0.2**2, rel=1e-12)
    finer = self_affine((128, 256), lengths, shortest=1.0, slope=0.2, seed=3)
    np.testing.assert_allclose(finer[::2, ::4], made, atol=1e-14)  # the same waves on every grid
    power = (
        np.abs(np.fft.fft2(self_affine((256, 256), lengths, shortest=0.2, hurst=0.6, seed=1))) ** 2
    )
    k = np.hypot(*np.meshgrid(*[np.fft.fftfreq(256, 1 / 256)] * 2, indexing="ij"))
    rings = np.geomspace(2, 48, 8)
    mean = [power[(k >= low) & (k < high)].mean() for low, high in pairwise(rings)]
    falling = np.polyfit(np.log(np.sqrt(rings[1:] * rings[:-1])), np.log(mean), 1)[0]
    assert falling == pytest.approx(-2 * (1 + 0.6), abs=0.25)
    assert power[(k > 51) | (k < 0.5)].max() < 1e-20 * power.max()
    assert not np.allclose(made, self_affine((64, 64), lengths, shortest=1.0, slope=0.2, seed=4))


def posed(points=None, rigid=None, scene=None, **changes):
    """A rigid body on a half-space, reduced."""
    base = HalfSpace("h", STEEL, ticks(8) if points is None else points, **changes)
    made = Scene("s", rigid or Rigid("r"), base, 0.3, **(scene or {}))
    return contactopt.reduce(made)


NINE = HalfSpace("a", STEEL, ticks(9))
PUSHED = {"force": {"y": -1.0}, "displacement": {"y": 1.0}}


@pytest.mark.parametrize(
    "make,message",
    [
        (lambda: HalfSpace("h", 5.0, ticks(8)), "must be a Material"),
        (lambda: posed(scene={"kind": "solid"}), "need 2 rows"),
        (lambda: posed([0.0, 1, 2, 4]), "evenly spaced"),
        (lambda: posed(scene={"copies": 2}), "no symmetry"),
        (lambda: posed(depth=2.0), "its depth"),
        (lambda: contactopt.reduce(ball(8, height=np.zeros((3, 3)))), "its? height|height of"),
        (lambda: posed(rigid=Rigid("r", **PUSHED)), "not both"),
        (lambda: posed(force={"z": -1.0}), "no component 'z'"),
        (lambda: self_affine((16, 16), (1.0, 1.0), shortest=0.01), "wavelengths must grow"),
        (lambda: self_affine((16, 16), (1.0, 1.0), hurst=1.5), "Hurst"),
        (lambda: self_affine((16, 16), (1.0, 1.0), seed=-1), "seed must be"),
        (lambda: self_affine(16, (1.0, 1.0)), "two numbers, along x and y"),
        (lambda: contactopt.reduce(ball(8, upper=SOFT, periodic=True)), "repeats itself"),
        (lambda: ball(8, periodic="yes"), "periodic must be"),
        (lambda: contactopt.reduce(Scene("s", Rigid("r"), HalfSpace("h", STEEL, None), 0.3)),
         "one row of places per axis"),
        (lambda: posed(rigid=Rigid("r", gap=np.full(8, np.nan))), "not finite"),
        (lambda: posed(rigid=NINE), "those of the other surface"),
        (lambda: scenes.rough(pressure=-1.0), "pressure"),
        (lambda: scenes.cattaneo_half_space(shear=50.0), "slide off"),
        (lambda: contactopt.solve(contactopt.reduce(scenes.flat_punch(2, elements=4)), Nested()),
         "needs half-spaces"),
    ],
)  # fmt: skip
def test_bad_input_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_local_maxima_on_a_grid_are_those_among_the_nearest_contacts():
    problem = contactopt.reduce(ball(15))
    pressure = np.random.default_rng(0).random(problem.contacts)
    around = np.pad(pressure.reshape(15, 15), 1)
    window = [around[i : i + 15, j : j + 15] for i in range(3) for j in range(3)]
    tops = np.flatnonzero(pressure >= np.max(window, axis=0).ravel())
    best = tops[np.argsort(-pressure[tops])][:8]
    np.testing.assert_array_equal(maxima(pressure, largest_around(problem, pressure)), best)


@pytest.mark.parametrize("width", [1, 2, 5])  # windows that are too small, among them
def test_a_fit_in_a_window_of_the_grid_is_that_among_all_contacts(width, monkeypatch):
    reduction = reduce_bodies(ball(31, law="frictionless", shear=0))
    solution = contactopt.solve(reduction.problem)
    found, near = [], []
    for window in (width, 31):
        monkeypatch.setattr(peaks, "WINDOW", window)
        found.append(peaks.pressure_reading(reduction, solution))
        near.append([peaks.around(reduction.problem, contact) for contact in (0, 17, 480)])
    np.testing.assert_array_equal(*near)
    assert (found[0].value, found[0].uncertainty) == (found[1].value, found[1].uncertainty)
    for one, other in zip(*(reading.peaks for reading in found)):
        np.testing.assert_array_equal(one.sources, other.sources)


def test_the_surface_is_made_once(monkeypatch):
    made, make = [], HalfSpaceBody.surface
    monkeypatch.setattr(HalfSpaceBody, "surface", lambda *given: made.append(0) or make(*given))
    contactopt.reduce(ball(12))
    assert len(made) == 1


def test_the_phases_of_a_run_sum_to_its_total(tmp_path):
    seconds = dict(contactopt.run(ball(60), out=tmp_path, figures=()).summary["seconds"])
    total = seconds.pop("total")
    assert 0.9 * total < sum(seconds.values()) <= total
