"""The second of NAFEMS' advanced benchmarks: a steel punch of diameter 100 mm and height 100 mm,
whose edge is rounded by a fillet of 10 mm, on an aluminium block of diameter 200 mm and height
200 mm, under 100 MPa on its top (Konter 2006, Advanced Finite Element Contact Benchmarks, NAFEMS).

Here it is without friction, and rests on a base without friction. Contact ends a little beyond the
flat, and the pressure is largest next to there: the lengths of elements grow from there on.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from contactopt.meshes.structured import graded, patch, rename, tensor_mesh
from contactopt.scenes.scene import Part, Scene, Support, Traction
from experiments.questions.classics.bodies import ALUMINIUM, STEEL

RADIUS, FILLET, HEIGHT, PRESSURE = 50.0, 10.0, 100.0, 100.0
FLAT = RADIUS - FILLET
BLOCK = 100.0, 200.0  # radius and height


def rounded_punch(zone: float, growth: float) -> Scene:
    """The scene with a first guess of the radius of contact and a ratio of neighbouring elements;
    `elements` counts those between the end of the flat and that of contact.
    """
    axis = Support("axis", {"r": 0.0})
    punch = Part(
        "punch",
        partial(_punch, growth),
        STEEL,
        (axis,),
        (Traction("top", (0.0, -PRESSURE)),),
        curve={"contact": _raised, "fillet": _round},
    )
    block = Part("block", partial(_block, growth), ALUMINIUM, (axis, Support("bottom", {"z": 0.0})))
    return Scene("rounded punch", punch, block, 0.0, kind="axisymmetric", zone=zone)


def _near(growth: float, elements: int, zone: float | None) -> tuple[np.ndarray, float]:
    """Places from the axis to twice as far beyond the flat as contact reaches, and the length of
    the shortest element.
    """
    assert zone is not None
    h = (zone - FLAT) / elements
    inside, beyond = FLAT - graded(FLAT, h, growth)[::-1], FLAT + h * np.arange(1, 2 * elements + 1)
    return np.append(inside, beyond), h


def _block(growth: float, elements: int, zone: float | None) -> Any:
    near, h = _near(growth, elements, zone)
    across = np.append(near, near[-1] + graded(BLOCK[0] - near[-1], h, growth)[1:])
    mesh = tensor_mesh(across, -graded(BLOCK[1], h, growth)[::-1])
    return patch(rename(mesh, axis="x-", bottom="y-", top="y+"), "top", "contact", [near[-1]])


def _punch(growth: float, elements: int, zone: float | None) -> Any:
    near, h = _near(growth, elements, zone)
    begin = np.arcsin((near[-1] - FLAT) / FILLET)
    angles = begin + graded(np.pi / 2 - begin, h / FILLET, growth)[1:]
    across = np.concatenate([near, FLAT + FILLET * np.sin(angles)])
    mesh = tensor_mesh(across, graded(HEIGHT, h, growth))
    mesh = mesh.morphed(None, lambda x: x[1] + _rise(x[0]) * (1 - x[1] / HEIGHT))
    mesh = patch(rename(mesh, axis="x-", top="y+", under="y-"), "y-", "contact", [near[-1]])
    fillet = np.setdiff1d(mesh.boundaries["under"], mesh.boundaries["contact"])
    return mesh.with_boundaries({"fillet": fillet})


def _rise(r: np.ndarray) -> np.ndarray:
    """Height of the lower side of the punch."""
    beyond = np.clip(r - FLAT, 0.0, FILLET)
    return np.asarray(FILLET - np.sqrt(FILLET**2 - beyond**2))


def _raised(x: np.ndarray) -> np.ndarray:
    return np.stack([x[0], _rise(x[0])])


def _round(x: np.ndarray) -> np.ndarray:
    centre = np.array([[FLAT], [FILLET]])
    return np.asarray(centre + FILLET * (x - centre) / np.linalg.norm(x - centre, axis=0))
