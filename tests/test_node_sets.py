"""Displacements and reactions by the name of a boundary, against uniform uniaxial stress."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MATERIAL, two_blocks

import contactopt
from contactopt import InputError
from contactopt.readings.quantities import find_quantity, unit_of

FORCE, E, NU = 3.0, MATERIAL.E, MATERIAL.nu
# area under FORCE, axial and lateral compliance times E, mean of the first coordinate on the top
EXACT = {
    "plane-strain": (1.0, 1 - NU**2, NU * (1 + NU), 1 / 2),
    "axisymmetric": (np.pi, 1.0, NU, 2 / 3),
    "solid": (1.0, 1.0, NU, 1 / 2),
}


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", EXACT)
def test_mean_largest_and_reaction_are_those_of_uniaxial_stress(kind, degree):
    area, axial, lateral, mean = EXACT[kind]
    scene = replace(two_blocks(kind, FORCE), degree=degree)
    first, up = scene.components[0], scene.components[-1]
    strain = FORCE / area / E
    sides = len(scene.components) - 1
    edge = {"plane-strain": "top/x+", "axisymmetric": "top/x+", "solid": "top/x+/y+"}[kind]
    wanted = {
        f"displacement:upper:top:{up}": -3 * axial * strain,
        f"displacement:lower:side0:{up}": -1 * axial * strain,  # linear from 0 to -2
        f"displacement:upper:top:{first}": lateral * strain * mean,
        f"displacement:upper:{edge}:{first}": lateral * strain,
        "displacement:upper:top": strain * np.hypot(3 * axial, np.sqrt(sides) * lateral),
        f"displacement:lower:top/side0:{up}": -2 * axial * strain,
        f"reaction:lower:bottom:{up}": FORCE,
        f"reaction:upper:top:{up}": -FORCE,
    }
    wanted["displacement:upper"] = wanted["displacement:upper:top"]
    found = contactopt.run(scene, read=tuple(wanted)).summary["quantities"]
    for name, value in wanted.items():
        assert found[name]["value"] == pytest.approx(value, rel=1e-7), name
        assert found[name]["error"] < 1e-6 and unit_of(name, ("mm", "MPa")) in ("mm", "N"), name


def test_what_nothing_holds_has_no_reaction():
    found = contactopt.run(two_blocks("solid"), read=("reaction:lower:x+:x",))
    assert "acts along x" in found.summary["quantities"]["reaction:lower:x+:x"]["message"]


@pytest.mark.parametrize(
    "name, words",
    [
        ("displacement:wheel:top:y", "no elastic body 'wheel'.*upper, lower"),
        ("displacement:upper:rim:y", "no boundary 'rim'; it has .*top"),
        ("displacement:upper:top/bottom", "share no node"),
        ("displacement:upper:top:z", "no component 'z'; use x, y"),
        ("reaction:upper:top", "needs a body, a boundary and a component"),
        ("reaction", "it needs a body"),
    ],
)
def test_an_unknown_name_is_said_before_anything_is_solved(name, words):
    with pytest.raises(InputError, match=words):
        find_quantity(name, two_blocks("plane-strain"))


def test_facets_inside_a_body_are_no_place_to_read():
    """Refined meshes forget them: the reading was not a number, without a word."""
    scene = two_blocks("plane-strain")
    upper = scene.upper
    mesh = upper.build_mesh(scene.elements, scene.zone)
    inside = np.flatnonzero(mesh.f2t[1] >= 0)[:2]
    named = mesh.with_boundaries({**mesh.boundaries, "inner": inside})
    scene = replace(scene, upper=replace(upper, mesh=named))
    with pytest.raises(InputError, match=r"boundary 'inner' .* has facets inside the body"):
        find_quantity(f"displacement:{upper.name}:inner:y", scene)
