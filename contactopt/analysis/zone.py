"""The contact zone: its size read from the reactions, and the loop that remeshes to it (paper, 3 and 4.2)."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.errors import InputError
from contactopt.interface.reduction import Reduction, reduce_bodies
from contactopt.problem import InterfaceProblem, Solution, Status
from contactopt.problem.operators import InterfaceOperator
from contactopt.problem.transfer import transfer
from contactopt.scenes.scene import Scene
from contactopt.solving.driver import solve

FIT = 4  # nodes next to the edge through which p^2 is extrapolated
AGREE = 0.05  # two zones agree when they differ by less than this fraction of an element
LOOPS = 10
COARSEST = 4  # elements across the contact half-width of the first of nested meshes
FACTOR = {2: 8, 3: 4}  # coarser than the next of them, where bodies are factorised: a 64th of the unknowns
ROUGH = 1e-6  # certificate asked of a coarse mesh: its own error is larger

Note = Callable[[str], None]


def pressed(reactions: np.ndarray) -> np.ndarray:
    """Mask (k,) of the nodes in contact: normal reaction beyond rounding."""
    return np.asarray(np.abs(reactions[:, 0]) > 1e-10 * np.abs(reactions[:, 0]).max(initial=0.0))


def stuck(reactions: np.ndarray, mu: np.ndarray) -> np.ndarray:
    """Mask (k,) of the nodes in contact whose tangential reaction is below the friction bound."""
    bound = mu * np.abs(reactions[:, 0])
    return pressed(reactions) & (np.linalg.norm(reactions[:, 1:], axis=1) < (1 - 1e-6) * bound)


def equivalent_half_width(scene: Scene, area: float) -> float:
    """Half-width of the strip, radius of the disc or half side of the square of that area [length]."""
    if scene.kind == "plane-strain":
        return area / (2 * scene.thickness)
    return float(np.sqrt(area / np.pi) if scene.kind == "axisymmetric" else np.sqrt(area) / 2)


def contact_area(scene: Scene, half_width: float) -> float:
    """The inverse of equivalent_half_width."""
    if scene.kind == "plane-strain":
        return 2 * half_width * scene.thickness
    return float(np.pi * half_width**2 if scene.kind == "axisymmetric" else 4 * half_width**2)


def contact_half_width(scene: Scene, problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """Half-width of the contact zone [length], below the element size where the zone has a smooth edge.

    p^2 is smooth in x^2 next to an edge where contact ends by itself: a line through its last inner nodes gives the
    edge. That needs a scene with a zone about x = 0; otherwise the half-width of the area of the nodes in contact.
    """
    active = pressed(reactions)
    if scene.zone is not None and not active.all() and active.sum() > FIT + 1:
        x = np.abs(problem.coordinates[0])
        inner = np.argsort(np.where(active, x, -1.0))[-1 - FIT : -1]
        slope, value = np.polyfit(x[inner] ** 2, (reactions[inner, 0] / problem.areas[inner]) ** 2, 1)
        if slope < 0:
            return float(np.sqrt(-value / slope))
    return equivalent_half_width(scene, float(problem.areas[active].sum()))


def stick_half_width(scene: Scene, problem: InterfaceProblem, reactions: np.ndarray) -> float:
    """Half-width of the area of the sticking nodes [length]; 0 without any."""
    return equivalent_half_width(scene, float(problem.areas[stuck(reactions, problem.mu)].sum()))


def solve_zone(
    scene: Scene,
    elements: int | None = None,
    note: Note = lambda text: None,
    Q: str = "auto",
    solver: str = "auto",
    **settings: Any,
) -> tuple[Reduction, Solution, list[float]]:
    """Reduce and solve; where the scene has a contact zone, remesh until its edge is a node of both meshes.

    Each round solves on meshes with a node at the present zone's edge and reads the new edge from the reactions; two
    zones agree when they differ by a twentieth of an element. Returns the last reduction and solution with the zones
    tried, the last of them the result, none if there is no loop; `seconds` are summed over the rounds, each of which starts
    from the one before. Q and solver go to reduce(), settings to solve(). Where Q is known by its products, the first start
    is the solution on coarser meshes, if the bodies can make them.
    """
    elements = scene.elements if elements is None else elements
    seconds: Counter[str] = Counter()
    previous: tuple[InterfaceProblem, Solution] | None = None
    zones = [scene.zone] if scene.zone is not None else []
    while True:
        note(f"reducing {scene.name}" + (f", zone {zones[-1]:.6g}" if zones else ""))
        reduction = reduce_bodies(scene, elements, zones[-1] if zones else None, Q, solver)
        coarser = elements // (2 if reduction.iterative else FACTOR[scene.dim])
        implicit = isinstance(reduction.problem.Q, InterfaceOperator)
        if previous is None and implicit and not scene.given and coarser >= COARSEST:
            previous = _coarse(scene, coarser, note, settings, seconds)
        note(f"solving {reduction.problem.contacts} contacts")
        start = None if previous is None else transfer(*previous, reduction.problem)
        solution = solve(reduction.problem, start=start, **settings)
        previous = reduction.problem, solution
        seconds.update(reduction.seconds)
        seconds.update(solution.seconds)
        solution = replace(solution, seconds=dict(seconds))
        if not zones:
            return reduction, solution, []
        width = contact_half_width(scene, reduction.problem, solution.reactions)
        if pressed(solution.reactions).sum() < 2:
            raise InputError(f"scene '{scene.name}': fewer than two nodes are in contact; take more elements.")
        agreed = abs(width - zones[-1]) <= AGREE * zones[-1] / elements
        zones.append(width)
        if agreed or solution.status not in (Status.SOLVED, Status.SETTLED) or len(zones) > LOOPS:
            return reduction, solution, zones


def _coarse(
    scene: Scene, elements: int, note: Note, settings: dict[str, Any], seconds: Counter[str]
) -> tuple[InterfaceProblem, Solution]:
    """The problem on coarser meshes and its solution, itself started from a coarser one where Q is known by its products."""
    rough = settings | {"tol": max(ROUGH, settings.get("tol", 0.0))}
    begin = time.perf_counter()
    reduction, solution, _ = solve_zone(replace(scene, zone=None), elements, note, **rough)
    seconds.update({"coarse": time.perf_counter() - begin})
    return reduction.problem, solution
