"""A scene with assembled bodies and coupled surfaces, before anything is factorised, and its
interface problem once Q is known.
"""

import time
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from contactopt.bodies import assemble
from contactopt.bodies.assembled import AssembledBody
from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.bodies.motions import kernel, whole_motions, work
from contactopt.bodies.protocol import Body, FreeMotions
from contactopt.checks import check_count, check_number
from contactopt.coupling.bolts import check_bolts
from contactopt.coupling.coupling import Coupling, couple, law_of, tested
from contactopt.coupling.crosspoints import independent
from contactopt.coupling.joined_once import check_once
from contactopt.coupling.planes_of_symmetry import SymmetryPlane, mirror_planes
from contactopt.errors import InputError
from contactopt.linear.concurrency import each
from contactopt.linear.operators import FORMS, Interface
from contactopt.problem import InterfaceProblem, Pair
from contactopt.problem.laws import join
from contactopt.scenes.scene import MOST_ACROSS, Scene


class Posed(NamedTuple):
    """A scene before anything is factorised; the fields are those of a Reduction."""

    bodies: tuple[AssembledBody, ...]
    couplings: tuple[Coupling, ...]
    maps: tuple[sp.csr_matrix, ...]
    planes: tuple[SymmetryPlane, ...]
    seconds: float = 0.0  # that this took


def posed(
    scene: Scene,
    elements: int | None = None,
    zone: float | None = None,
    Q: str = "auto",
    coupling: str | None = None,
) -> Posed:
    """Assemble the bodies of a scene and couple their surfaces, as reduce() does."""
    begin = time.perf_counter()
    elements, zone = _checked(scene, elements, zone, Q)
    assembled = tuple(each(lambda part: assemble(scene, part, elements, zone), scene.parts))
    check_bolts(scene, assembled)
    named = {body.name: body for body in assembled}
    sides = [(named[pair.bodies[0]], named[pair.bodies[1]]) for pair in scene.pairs]
    check_once(scene.pairs, sides)
    named_sides = list(zip(scene.pairs, sides))
    made = [couple(scene, pair, *bodies, coupling) for pair, bodies in named_sides]
    couplings = tuple(
        own if own is old else tested(own, *asked)
        for own, old, asked in zip(independent(scene.pairs, made, assembled), made, named_sides)
    )
    maps = tuple(_signed_map(body, sides, couplings) for body in assembled)
    planes: tuple[SymmetryPlane, ...] = ()
    if scene.copies > 1:
        cutting = [plane for made in couplings for plane in made.planes]
        guides = [own for body in assembled if (own := body.guides()) is not None]
        planes = tuple(mirror_planes(scene, guides, cutting))
    return Posed(assembled, couplings, maps, planes, time.perf_counter() - begin)


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


def _signed_map(
    body: AssembledBody,
    sides: Sequence[tuple[AssembledBody, AssembledBody]],
    couplings: Sequence[Coupling],
) -> sp.csr_matrix:
    """B (k dim, n) of a body: the maps of its pairs with their signs, else zeros."""
    blocks = [
        made.upper if body is upper else -made.lower if body is lower else None
        for (upper, lower), made in zip(sides, couplings)
    ]
    if len(blocks) == 1 and blocks[0] is not None:
        return blocks[0]
    n = next(block.shape[1] for block in blocks if block is not None)
    none = [sp.csr_matrix((made.upper.shape[0], n)) for made in couplings]
    return sp.csr_matrix(sp.vstack([b if a is None else a for a, b in zip(blocks, none)]))


def problem_of(
    scene: Scene,
    Q: Interface,
    bodies: Sequence[Body],
    maps: Sequence[sp.csr_matrix],
    couplings: Sequence[Coupling],
) -> InterfaceProblem:
    """The interface problem of a scene whose bodies and couplings are made and whose Q is known."""
    gap = np.concatenate([made.gap for made in couplings])
    q = np.zeros((len(gap), maps[0].shape[0] // max(len(gap), 1)))
    q[:, 0] = gap
    for body, B in zip(bodies, maps):
        q += (B @ body.at_rest).reshape(q.shape)
    V = np.concatenate([B @ body.motions.fields for body, B in zip(bodies, maps)], axis=1)
    s = np.concatenate([body.motions.resultants for body in bodies])
    areas = np.concatenate([made.areas for made in couplings])
    points = np.concatenate([made.positions for made in couplings], axis=1)
    ends = np.cumsum([0, *(len(made.gap) for made in couplings)]).tolist()
    named = list(zip(scene.pairs, couplings, ends, ends[1:]))
    pairs = tuple(Pair(pair.name, first, last, made.chart) for pair, made, first, last in named)
    laws = [(law_of(pair, made), np.arange(first, last)) for pair, made, first, last in named]
    law = laws[0][0] if len(laws) == 1 else join(laws)
    chart = pairs[0].chart if len(pairs) == 1 else None
    # what each multiplier is, for messages
    names = tuple(f"body '{body.name}': {name}" for body in bodies for name in body.motions.names)
    return InterfaceProblem(Q, q, law, V, s, areas, points, chart, pairs, names)


def free_problem(scene: Scene, made: Posed) -> InterfaceProblem:
    """The rigid motions of all bodies that supports and plates leave free; Q means
    nothing."""
    bodies: list[Any] = [
        _free_body(scene, body) if isinstance(body, AssembledElastic) else body
        for body in made.bodies
    ]
    Q = sp.identity(made.maps[0].shape[0], format="csr")
    return problem_of(scene, Q, bodies, made.maps, made.couplings)


def _free_body(scene: Scene, assembled: AssembledElastic) -> Any:
    """The rigid motions (n, m) that supports and level plates leave, and resultants (m,) there."""
    body = assembled.body
    R, labels = whole_motions(scene.analysis, body.basis)
    mean = body.motion.T / np.maximum(body.motion.sum(axis=0), 1.0)[:, None]
    held = np.ones(len(R), dtype=bool)
    held[body.free] = False
    combined, names = kernel((R - body.motion @ (mean @ R))[held], labels)
    Z = R @ combined
    return SimpleNamespace(
        name=body.name,
        at_rest=np.zeros(len(R)),
        motions=FreeMotions(Z, tuple(names), work(Z, body.load) + (mean @ Z).T @ body.plate_forces),
    )
