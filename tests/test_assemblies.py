"""Bodies that others hold: Persson's pin, Lame's press fit, and statics."""

import numpy as np
import pytest
import skfem

import contactopt
from contactopt import InputError, Material, analytic, scenes
from contactopt.meshes.polar import disc, right_half_disc, ring


def shape_error(modulus, radius, clearance, exact):
    """How far the pin's pressure is from keeping both surfaces together in its contact, and apart
    beyond.

    Sums of modes cos(n phi) of the pressure on the rims of a disc and of a hole, each solved by
    Airy's function (Michell): the radial displacements of modes n >= 2 add up to (R / E*) 2 n /
    (n^2 - 1) p_n, and to (R / E*) p_0 of the mean; n = 1 is the approach.
    """
    count = 2**17
    phi = np.arange(count) * 2 * np.pi / count
    signed = np.minimum(phi, 2 * np.pi - phi)
    p = np.fft.rfft(exact.pressure(radius * signed)) / count
    n = np.arange(len(p))
    compliance = np.where(n > 1, 2 * n / np.maximum(n**2 - 1, 1), 0.0)
    compliance[0] = 1.0
    apart = clearance + radius / modulus * np.fft.irfft(compliance * p, count) * count
    inside = signed < 0.98 * exact.half_width / radius
    approach = np.linalg.lstsq(np.cos(phi[inside])[:, None], apart[inside], rcond=None)[0][0]
    gap = apart - approach * np.cos(phi)
    return np.abs(gap[inside]).max() / clearance, gap[
        signed > 1.02 * exact.half_width / radius
    ].min() / clearance


@pytest.mark.parametrize("load", [0.02, 0.5, 2.0, 20.0])
def test_pin_fulfils_the_equations_of_disc_and_hole(load):
    radius, clearance, modulus = 3.0, 0.01, 50.0
    exact = analytic.pin_in_hole(load, radius, clearance, modulus)
    closed, least = shape_error(modulus, radius, clearance, exact)
    assert closed < 2e-4 * max(1, load) and least > 0
    # the load is the resultant: substitute away the root at the edge
    s = np.linspace(-1, 1, 4001)[1:-1]
    angle = exact.half_width / radius * np.sin(np.pi / 2 * s)
    weight = np.gradient(angle)
    assert np.sum(
        exact.pressure(radius * angle) * np.cos(angle) * radius * weight
    ) == pytest.approx(load, rel=1e-5)


def test_pin_becomes_hertz_and_fills_the_hole():
    small = analytic.pin_in_hole(1e-6, 3.0, 0.01, 50.0)
    hertz = analytic.hertz_line(1e-6, 3.0**2 / 0.01, 50.0)
    assert small.half_width == pytest.approx(hertz.half_width, rel=1e-5)
    assert small.peak == pytest.approx(hertz.peak, rel=1e-5)
    large = analytic.pin_in_hole(1e9, 3.0, 0.01, 50.0)
    assert np.degrees(large.half_width / 3.0) == pytest.approx(
        84.9, abs=0.1
    )  # half the contact angle without clearance
    with pytest.raises(InputError, match="clearance"):
        analytic.pin_in_hole(1.0, 3.0, 0.0, 50.0)


def test_press_fit_is_lames_ring_integrated():
    """From the differential equation r u'' + u' - u / r = 0, solved for both rings."""
    shaft, hub = Material(200.0, 0.3), Material(70.0, 0.2)
    exact = analytic.press_fit(0.02, 10.0, 20.0, 45.0, shaft, hub)

    def push(material, free, loaded):
        """Outward displacement of the loaded side under unit pressure; u = c1 r + c2 / r fulfils
        the equation.
        """
        lam, G = contactopt.material.lame(material)
        stress = [[2 * (lam + G), -2 * G / r**2] for r in (free, loaded)]
        c1, c2 = np.linalg.solve(stress, [0.0, -1.0])
        return c1 * loaded + c2 / loaded

    assert exact.peak * (push(hub, 45.0, 20.0) - push(shaft, 10.0, 20.0)) == pytest.approx(
        0.02, rel=1e-12
    )
    with pytest.raises(InputError, match="radii must grow"):
        analytic.press_fit(0.02, 10.0, 50.0, 45.0, shaft, hub)


def errors(scene, **changes):
    """Relative L2 error of the pressure, and the result."""
    result = contactopt.run(scene, **changes)
    assert result.solution.solved
    areas, x = result.problem.areas, result.problem.pairs[0].chart.places[0]
    exact = scene.reference.pressure(x - x.min() if scene.name == "pin-in-bush" else x)
    return np.sqrt(
        np.sum(areas * (result.pressure - exact) ** 2) / np.sum(areas * exact**2)
    ), result


def test_pin_in_bush_is_perssons():
    scene = scenes.pin_in_bush(elements=12)
    coarse, result = errors(scene, degree=2)
    fine, finer = errors(scenes.pin_in_bush(elements=24), degree=2)
    assert coarse < 0.012 and fine < 0.002
    for found, off in ((result, 6e-3), (finer, 1e-3)):
        half_width = found.summary["contact_half_width"]
        assert half_width == pytest.approx(scene.reference.half_width, rel=off)
    assert result.summary["max_pressure"] == pytest.approx(scene.reference.peak, rel=3e-3)
    _, linear = errors(scene)
    np.testing.assert_allclose(
        linear.summary["pairs"]["pin-bush"]["force"], [0, 100], atol=1e-8
    )  # statics, not the sum of normals
    assert linear.summary["normal_force"] > 110


@pytest.mark.parametrize(
    "kind,degree,order",
    [
        ("plane-strain", 1, 1.6),
        ("plane-strain", 2, 1.9),
        ("axisymmetric", 1, 1.8),
        ("axisymmetric", 2, 3.3),
    ],
)
def test_press_fit_converges_to_lame(kind, degree, order):
    found = [
        errors(scenes.press_fit(kind, interference=1e-7, elements=e), degree=degree)[0]
        for e in (4, 8, 16)
    ]
    assert np.log2(found[0] / found[-1]) / 2 > order and found[-1] < 0.006


def test_press_fit_of_two_materials():
    scene = scenes.press_fit(shaft=Material(70e3, 0.33), hub=Material(110e3, 0.35), elements=24)
    assert errors(scene, degree=2)[0] < 2e-3


def test_press_fit_is_the_same_all_around():
    """Nothing tells one node from another, nor the ends at the planes of symmetry."""
    scene = scenes.press_fit(interference=1e-5, elements=6)
    _, result = errors(scene)
    np.testing.assert_allclose(result.pressure, result.pressure[0], rtol=1e-5)
    np.testing.assert_allclose(result.traction, 0.0, atol=1e-6 * scene.reference.peak)
    np.testing.assert_allclose(result.reduction.frames[[0, -1], 0], [[-1, 0], [0, -1]], atol=1e-15)


@pytest.mark.parametrize("tilt", [0.0, 5.0, -12.0])
def test_stack_is_in_equilibrium(tilt):
    result = contactopt.run(scenes.stack(blocks=3, tilt=tilt, elements=4))
    assert result.solution.solved
    across, along = 100 * np.cos(np.radians(tilt)), 100 * np.sin(np.radians(tilt))
    for level, pair in enumerate(result.summary["pairs"].values()):
        above = 3 - level
        np.testing.assert_allclose(pair["force"], [-above * along, above * across], atol=1e-7)
        middle = (level + 3) / 2 * 100  # height of the centre of gravity of what is above
        np.testing.assert_allclose(pair["moment"], [above * along * middle], atol=1e-5)
    for wrong in ({"tilt": 35.0}, {"tilt": 10.0, "mu": 0.1}, {"tilt": 20.0, "blocks": 6}):
        with pytest.raises(InputError, match="slides or falls"):
            scenes.stack(**wrong)
    with pytest.raises(InputError, match="take mu above 0"):
        scenes.stack(tilt=0.0, mu=0.0)


def test_arch_is_in_equilibrium_and_symmetric():
    scene = scenes.arch(stones=5, elements=4)
    result = contactopt.run(scene)
    assert result.solution.solved
    forces = np.array([pair["force"] for pair in result.summary["pairs"].values()])
    ground = forces[[0, -1]]
    np.testing.assert_allclose(ground[:, 1], 500, rtol=1e-3)  # each side half of the weight
    assert ground[0, 0] == pytest.approx(-ground[1, 0], rel=1e-6) and ground[0, 0] < 0
    # each joint bears one stone less
    np.testing.assert_allclose(np.diff(forces[:-1, 1]), -1000 / 5, rtol=2e-3)
    # the thrust is the same all along
    np.testing.assert_allclose(forces[:-1, 0], forces[0, 0], rtol=1e-6)
    with pytest.raises(InputError, match="cannot stand"):
        scenes.arch(thickness=100.0)


def test_shapes_are_closed_and_round():
    whole = ring(np.array([1.0, 1.5, 2.0]), np.linspace(0.3, 0.3 + 2 * np.pi, 13))
    assert whole.nelements == 24
    for mesh, area, rims in (
        (whole, 3 * np.pi, {"inner": 1.0, "outer": 2.0}),
        (disc(2.0, 2), 4 * np.pi, {"rim": 2.0}),
        (right_half_disc(2.0, 3), 2 * np.pi, {}),
    ):
        assert skfem.Basis(mesh, mesh.elem(), intorder=6).dx.sum() == pytest.approx(area, rel=2e-3)
        for name, radius in rims.items():
            nodes = mesh.p[:, np.unique(mesh.facets[:, mesh.boundaries[name]])]
            np.testing.assert_allclose(np.linalg.norm(nodes, axis=0), radius)
        assert sum(len(facets) for facets in mesh.boundaries.values()) == len(
            mesh.boundary_facets()
        )
