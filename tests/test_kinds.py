"""Kinds of analysis: plane stress against plane strain of another material, and exact stresses."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

import contactopt
from contactopt import Material, Part, Plate, Rigid, Scene, Support
from contactopt.scenes import make_scene
from contactopt.scenes.kinds import KINDS

STEEL = Material(E=210e3, nu=0.3)


def in_strain(material: Material) -> Material:
    """The material whose plane strain is the plane stress of this one, in the plane."""
    E, nu = material.E, material.nu
    return Material(E * (1 + 2 * nu) / (1 + nu) ** 2, nu / (1 + nu))


def with_kind(scene: Scene, kind: str, change=lambda material: material) -> Scene:
    moved = scene.with_parts(
        lambda part: replace(part, material=change(part.material)) if part.elastic else part
    )
    return replace(moved, kind=kind)


@pytest.mark.parametrize("name", ["punch-2d", "cattaneo-2d", "press-fit"])
@pytest.mark.parametrize("degree", [1, 2])
def test_plane_stress_is_plane_strain_of_another_material(name, degree):
    scene = replace(make_scene(name), degree=degree, elements=8)
    sheet = contactopt.run(with_kind(scene, "plane-stress"), figures=())
    other = contactopt.run(with_kind(scene, "plane-strain", in_strain), figures=())
    scale = np.abs(other.solution.reactions).max()
    assert np.allclose(sheet.solution.reactions, other.solution.reactions, atol=1e-7 * scale)
    for one, two in zip(sheet.fields, other.fields):
        size = np.abs(two.displacement).max()
        assert np.allclose(one.displacement, two.displacement, atol=1e-6 * size)
        across = one.names.index("zz")
        assert np.all(one.stress[:, across] == 0)
        inside = [i for i in range(4) if i != across]
        size = np.abs(two.stress).max()
        assert np.allclose(one.stress[:, inside], two.stress[:, inside], atol=1e-6 * size)
        assert np.abs(two.stress[:, across]).max() > 0.01 * size  # plane strain has it


def block(kind: str, mesh: skfem.Mesh) -> Scene:
    """A block on a frictionless floor under 100 MPa; what is free to strain across may."""
    up = KINDS[kind].components[-1]
    area = 0.5 if kind == "solid" else 5.0  # of the top, one thickness wide in space
    sides = {"left": "x"} | ({"front": "y"} if kind == "solid" else {})
    part = Part(
        "block",
        mesh,
        STEEL,
        tuple(Support(name, {axis: 0.0}) for name, axis in sides.items()),
        (Plate("top", {up: -100.0 * area}, glued=False),),
        contact="bottom",
    )
    thickness = 5.0 if kind == "plane-stress" else 1.0
    floor = Rigid("floor")
    return Scene("block", part, floor, 0.0, kind, thickness=thickness, law="frictionless")


def test_a_sheet_strains_as_a_body_in_space_does():
    """Uniaxial stress: -100 MPa, 100 / E along it and 100 nu / E across, exact for any element."""
    flat = skfem.MeshQuad.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 2, 5)).with_boundaries(
        {"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2, "left": lambda x: x[0] == 0}
    )
    solid = skfem.MeshHex.init_tensor(
        np.linspace(0, 1, 3), np.linspace(0, 0.5, 2), np.linspace(0, 2, 4)
    ).with_boundaries(
        {
            "bottom": lambda x: x[2] == 0,
            "top": lambda x: x[2] == 2,
            "left": lambda x: x[0] == 0,
            "front": lambda x: x[1] == 0,
        }
    )
    for kind, mesh in (("plane-stress", flat), ("solid", solid)):
        result = contactopt.run(block(kind, mesh), figures=())
        (own,) = result.fields
        assert result.summary["approach"] == pytest.approx(2 * 100.0 / STEEL.E, rel=1e-9)
        assert np.ptp(own.displacement[0]) == pytest.approx(0.3 * 100.0 / STEEL.E, rel=1e-9)
        assert np.allclose(own.von_mises, 100.0, rtol=1e-9)


def test_a_rings_pressure_is_that_of_thin_rings():
    """Lame's press fit of thin discs of one material: p = E d (..) / (..), Timoshenko, Goodier."""
    scene = replace(make_scene("press-fit", bore=10.0, radius=20.0, outside=40.0), elements=24)
    result = contactopt.run(with_kind(replace(scene, reference=None), "plane-stress"), figures=())
    a, b, c = 10.0, 20.0, 40.0
    exact = 210e3 * 0.01 / b * (b**2 - a**2) * (c**2 - b**2) / (2 * b**2 * (c**2 - a**2))
    problem = result.reduction.problem
    pressure = result.solution.reactions[:, 0].sum() / problem.areas.sum()
    assert pressure == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("kind", ["plane-stress", "plane-strain"])
@pytest.mark.parametrize("name", ["nu", "E"])
def test_derivatives_by_the_material(kind, name):
    scene = with_kind(replace(make_scene("punch-2d"), elements=6), kind)
    which = f"{name}:{scene.parts[0].name}"
    slope = contactopt.gradient(contactopt.run(scene, tol=1e-12, figures=()), "approach", [which])
    step = 1e-4 * getattr(scene.parts[0].material, name)

    def approach(change):
        def moved(part):
            own = part.material
            changed = replace(own, **{name: getattr(own, name) + change})
            return replace(part, material=changed) if part.name == scene.parts[0].name else part

        return contactopt.run(scene.with_parts(moved), tol=1e-12, figures=()).summary["approach"]

    difference = (approach(step) - approach(-step)) / (2 * step)
    assert slope.by[which] == pytest.approx(difference, rel=1e-4)


def test_what_a_sheet_has_not_is_refused():
    scene = make_scene("punch-2d")
    found = contactopt.run(
        replace(with_kind(scene, "plane-stress"), elements=6),
        accuracy=0.1,
        quantity="approach",
        bound=True,
        figures=(),
    )
    assert "does not know the kind 'plane-stress'" in found.estimate.guarantee.missing
