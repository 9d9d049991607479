"""Stress at a place: the fit is exact for polynomials, better than averages."""

import numpy as np
import pytest
import skfem
from conftest import MATERIAL

import contactopt
from contactopt import InputError, Part, Rigid, Scene, Support, scenes
from contactopt.bodies.element_stress import nodal_stress
from contactopt.bodies.fields import Region, von_mises, von_mises_slopes
from contactopt.bodies.stress_recovery import stress_map
from contactopt.coupling.reduction import reduce_bodies
from contactopt.readings.places import place_of, read_place, read_stress
from contactopt.scenes import make_scene
from contactopt.scenes.kinds import KINDS
from contactopt.solving.solve_scene import solve_scene

TICKS = np.linspace(0, 1, 5) ** 1.3
MESHES = {
    "triangles": skfem.MeshTri.init_tensor(TICKS, TICKS),
    "quadrilaterals": skfem.MeshQuad.init_tensor(TICKS, TICKS),
    "tetrahedra": skfem.MeshTet.init_tensor(TICKS, TICKS, TICKS),
    "hexahedra": skfem.MeshHex.init_tensor(TICKS, TICKS, TICKS),
}


def assembled(mesh, degree=1, kind=None):
    kind = kind or ("plane-strain" if len(mesh.p) == 2 else "solid")
    mesh = mesh.with_boundaries({"contact": lambda x: x[-1] == 0, "top": lambda x: x[-1] == 1})
    block = Part("block", mesh, MATERIAL, supports=(Support("top"),))
    normal = tuple(np.eye(len(mesh.p))[-1])
    scene = Scene("block", block, Rigid("floor", normal), mu=0.3, kind=kind, degree=degree)
    return reduce_bodies(scene).bodies[0].body


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("shape", MESHES)
def test_a_stress_that_the_displacement_can_have_is_recovered_everywhere(shape, degree):
    """A displacement of the degree of the elements has a stress that the patches fit without error,
    also at the surface.
    """
    body = assembled(MESHES[shape], degree)
    x = body.locations
    U = np.zeros(body.basis.N)
    for row, unknowns in enumerate(body.unknowns):
        U[unknowns] = (
            x[row] * (1 + row)
            + 0.3 * x[0]
            + (0.2 * x[0] * x[-1] + x[-1] ** 2 if degree == 2 else 0)
        )
    found = stress_map(body, Region())
    if degree == 1:
        wanted = np.stack(
            [nodal_stress(body, U)[i, j] for i, j in ((0, 0), (1, 1), (2, 2))], axis=1
        )
        assert np.allclose(found.stress(U)[:, :3], wanted[found.sources])
    point = (0.37, 0.61) if len(x) == 2 else (0.37, 0.61, 0.2)
    at = stress_map(body, Region(point=point)).stress(U)[0]
    lam, shear = contactopt.material.lame(body.material)
    slope = np.zeros((3, 3))
    slope[: len(x), : len(x)] = np.diag(1.0 + np.arange(len(x)))
    slope[: len(x), 0] += 0.3
    if degree == 2:
        slope[: len(x), 0] += 0.2 * point[-1]
        slope[: len(x), len(x) - 1] += 0.2 * point[0] + 2 * point[-1]
    strain = (slope + slope.T) / 2
    stress = 2 * shear * strain + lam * np.trace(strain) * np.eye(3)
    assert np.allclose(at[:3], np.diag(stress)) and np.isclose(at[3], stress[0, 1])


@pytest.mark.parametrize("degree", [1, 2])
def test_the_recovered_stress_converges_faster_than_averages(degree):
    """At the surface, where averages look from one side."""
    errors = {"fit": [], "average": []}
    for count in (6, 12):
        ticks = np.linspace(0, 1, count + 1)
        body = assembled(skfem.MeshTri.init_tensor(ticks, ticks), degree)
        x, y = body.locations
        U = np.zeros(body.basis.N)
        U[body.unknowns] = np.array([np.sin(2 * x + y), np.cos(x - y)])
        lam, shear = contactopt.material.lame(body.material)
        vx, vy = body.basis.mesh.p
        xx, yy = 2 * np.cos(2 * vx + vy), np.sin(vx - vy)
        wanted = 2 * shear * xx + lam * (xx + yy)
        found = stress_map(body, Region())
        errors["fit"].append(np.abs(found.stress(U)[:, 0] - wanted[found.sources]).max())
        errors["average"].append(
            np.abs(nodal_stress(body, U, everywhere=False)[0, 0] - wanted).max()
        )
    assert errors["fit"][1] < 0.6 * errors["average"][1]
    assert errors["fit"][0] / errors["fit"][1] > 1.8 * degree


@pytest.mark.parametrize("kind", KINDS)
def test_the_load_is_the_transpose_of_the_recovery(kind):
    random = np.random.default_rng(1)
    body = assembled(MESHES["tetrahedra" if kind == "solid" else "triangles"], 1, kind)
    found = stress_map(body, Region("top"))
    U = random.standard_normal(body.basis.N)
    slopes = random.standard_normal((len(found.sources), len(KINDS[kind].stresses)))
    assert np.sum(found.stress(U) * slopes) == pytest.approx(found.transposed(slopes) @ U)
    stress = random.standard_normal((5, len(KINDS[kind].stresses)))
    change = random.standard_normal(stress.shape)
    difference = (von_mises(stress + 1e-6 * change) - von_mises(stress - 1e-6 * change)) / 2e-6
    assert np.allclose(np.sum(von_mises_slopes(stress) * change, axis=1), difference, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("von_mises:piston", "no elastic body 'piston'"),
        ("von_mises:punch:brim", "no boundary 'brim'"),
        ("von_mises:punch@1", "needs 2 numbers"),
        ("von_mises:punch@0,0,radius=-1", "radius=R"),
        ("von_mises:punch@900,0", "outside body 'punch'"),
        ("stress_rr:punch@0,1", "no stress 'stress_rr'"),
        ("stress_xx:punch", "read at a point"),
        ("von_mises:punch:top@0,1", "either a boundary or a point"),
        ("pressure:brim@0,0", "name one pair"),
    ],
)
def test_bad_places_are_refused_in_one_sentence(name, words):
    solved = solve_scene(scenes.flat_punch(2, elements=4))
    with pytest.raises(InputError, match=words):
        read_place(place_of(name, solved.reduction.scene), solved.reduction, solved.solution)


def test_names_of_other_quantities_are_not_places():
    scene = scenes.flat_punch(2, elements=4)
    assert [
        place_of(name, scene) for name in ("energy", "pressure", "pressure:3", "width", None)
    ] == 5 * [None]
    assert place_of("von_mises:punch@0,1,radius=2", scene).region == Region(
        point=(0.0, 1.0), radius=2.0
    )


def test_the_pressure_under_a_flat_punch_is_read_between_its_nodes():
    """Against the exact pressure of a rigid flat punch without friction on a half-plane."""
    scene = scenes.flat_punch(
        2, mu=0.0, elements=32, rigid="punch", foundation_width=1600.0, foundation_height=800.0
    )
    solved = solve_scene(scene)
    a, force = scene.reference.half_width, 100.0 / 40.0
    for place in (0.013 * a, 0.31 * a, 0.62 * a):
        found = read_place(
            place_of(f"pressure@{place},0", scene), solved.reduction, solved.solution
        ).value
        assert found == pytest.approx(force / (np.pi * np.sqrt(a**2 - place**2)), rel=0.02)


def test_the_largest_stress_under_a_line_contact_is_where_it_should_be():
    """Without friction: .558 of the peak pressure, .704 half-widths deep, for nu = .3."""
    scene = make_scene("cylinder-2d", mu=0.0, elements=16)
    solved = solve_scene(scene)
    body = scene.parts[-1].name
    found = read_stress(
        place_of(f"von_mises:{body}", scene),
        solved.reduction,
        solved.reduction.displaced(solved.solution),
    )
    a, peak = scene.reference.half_width, scene.reference.peak
    assert found.value == pytest.approx(0.558 * peak, rel=0.02)
    assert abs(found.peaks[0].place[0]) < 0.1 * a
    assert abs(found.peaks[0].place[1]) == pytest.approx(0.704 * a, rel=0.15)


def test_the_scatter_of_the_elements_is_the_uncertainty_of_the_fit():
    """The fits of noise of known size deviate by as much as they say, on average."""
    random = np.random.default_rng(2)
    body = assembled(skfem.MeshTri.init_tensor(np.linspace(0, 1, 13), np.linspace(0, 1, 13)))
    found = stress_map(body, Region())
    U = np.zeros(body.basis.N)
    U[body.unknowns] = np.array([0.1 * body.locations[0], -0.3 * body.locations[1]])
    slopes = np.tile([1.0, 0.0, 0.0, 0.0], (len(found.sources), 1))
    assert found.deviation(U, slopes).max() < 1e-12
    noise = random.standard_normal((40, found.basis.nelems * len(found.basis.W)))
    off = np.sqrt(np.mean((found.weights @ noise.T) ** 2))
    said = np.sqrt(np.mean([found.fit.deviation(one) ** 2 for one in noise]))
    assert said == pytest.approx(off, rel=0.05)


def test_the_peak_at_a_hole_is_not_flattened():
    """Kirsch's plate in tension 1 with a hole of radius 1: along a quarter of the hole, of six
    elements, the hoop stress 1 - 2 cos 2t is found with a mean error of 0.1 (its peak is 3).
    """
    step = np.pi / 12
    mesh = skfem.MeshTri.init_tensor((1 + step) ** np.arange(6), np.linspace(0, np.pi / 2, 7))
    mesh = skfem.MeshTri2.from_mesh(mesh)
    r, t = mesh.doflocs
    mesh = skfem.MeshTri2(np.array([r * np.cos(t), r * np.sin(t)]), mesh.t)
    r = np.hypot(*mesh.p[:, mesh.facets]).mean(axis=0)
    sides = {"hole": np.flatnonzero(r < 1.01), "far": np.flatnonzero(r > 0.99 * r.max())}
    plate = Part("plate", mesh.with_boundaries(sides), MATERIAL, (Support("far"),), contact="hole")
    body = reduce_bodies(Scene("plate", plate, Rigid("pin"), mu=0.3, degree=2)).bodies[0].body
    k, shear = 3 - 4 * MATERIAL.nu, MATERIAL.E / (2 + 2 * MATERIAL.nu)
    x, y = body.locations
    r, t = np.hypot(x, y), np.arctan2(y, x)
    twice = 2 / r * (1 + (k + 1) * np.cos(2 * t)) - 2 / r**3 * np.cos(2 * t)
    out = (r * (k - 1 + 2 * np.cos(2 * t)) + twice) / (8 * shear)
    along = -(r + (k - 1) / r + 1 / r**3) * np.sin(2 * t) / (4 * shear)
    U = np.zeros(body.basis.N)
    U[body.unknowns] = [out * np.cos(t) - along * np.sin(t), out * np.sin(t) + along * np.cos(t)]
    found = stress_map(body, Region("hole"))
    t = np.arctan2(*found.places[::-1])
    xx, yy, _, xy = found.stress(U).T
    hoop = xx * np.sin(t) ** 2 + yy * np.cos(t) ** 2 - 2 * xy * np.sin(t) * np.cos(t)
    assert np.sqrt(np.mean((hoop - 1 + 2 * np.cos(2 * t)) ** 2)) < 0.1
