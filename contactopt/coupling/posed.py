"""A scene with assembled bodies and coupled surfaces, before anything is factorised."""

from __future__ import annotations

from typing import NamedTuple

import scipy.sparse as sp

from contactopt.bodies import assemble
from contactopt.bodies.assembled import AssembledBody
from contactopt.checks import check_count, check_number
from contactopt.coupling.coupling import Coupling, couple
from contactopt.coupling.planes_of_symmetry import SymmetryPlane, mirror_planes
from contactopt.coupling.problem_of_bodies import signed_map
from contactopt.errors import InputError
from contactopt.linear.concurrency import each
from contactopt.linear.operators import FORMS
from contactopt.scenes.scene import MOST_ACROSS, Scene


class Posed(NamedTuple):
    """A scene before anything is factorised; the fields are those of a Reduction."""

    bodies: tuple[AssembledBody, ...]
    couplings: tuple[Coupling, ...]
    maps: tuple[sp.csr_matrix, ...]
    planes: tuple[SymmetryPlane, ...]


def posed(
    scene: Scene,
    elements: int | None = None,
    zone: float | None = None,
    Q: str = "auto",
    coupling: str | None = None,
) -> Posed:
    """Assemble the bodies of a scene and couple their surfaces; the arguments are as for reduce(),
    and so are the errors.
    """
    elements, zone = _checked(scene, elements, zone, Q)
    assembled = tuple(each(lambda part: assemble(scene, part, elements, zone), scene.parts))
    named = {body.name: body for body in assembled}
    sides = [(named[pair.bodies[0]], named[pair.bodies[1]]) for pair in scene.pairs]
    pairs = zip(scene.pairs, sides)
    couplings = tuple(couple(scene, pair, *bodies, coupling) for pair, bodies in pairs)
    maps = tuple(signed_map(body, sides, couplings) for body in assembled)
    planes: tuple[SymmetryPlane, ...] = ()
    if scene.copies > 1:
        cutting = [plane for made in couplings for plane in made.planes]
        guides = [own for body in assembled if (own := body.guides()) is not None]
        planes = tuple(mirror_planes(scene, guides, cutting))
    return Posed(assembled, couplings, maps, planes)


def _checked(
    scene: Scene, elements: int | None, zone: float | None, Q: str
) -> tuple[int, float | None]:
    """The number of elements and the half-width of the zone, by default those of the scene."""
    if not isinstance(scene, Scene):
        raise InputError(f"the scene must be a Scene; got {type(scene).__name__}.")
    if not isinstance(Q, str) or Q not in FORMS:
        raise InputError(f"unknown form of Q {Q!r}; choose from {', '.join(FORMS)}.")
    elements = scene.elements if elements is None else elements
    zone = scene.zone if zone is None else zone
    check_count("elements", elements)
    if elements > MOST_ACROSS:
        raise InputError(f"elements must be at most {MOST_ACROSS}; got {elements}.")
    if zone is not None:
        check_number("the contact zone's half-width", zone, low=0.0)
    return elements, zone
