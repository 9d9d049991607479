"""The loop that remeshes a scene until its contact zone ends at a node (paper, 3 and 4.2)."""

from collections import Counter
from dataclasses import replace

from contactopt.errors import InputError
from contactopt.problem import Status
from contactopt.problem.contact_status import contact_status
from contactopt.readings.constants import AGREE, LOOPS
from contactopt.readings.edges import contact_edge
from contactopt.scenes.scene import Scene
from contactopt.solving.solve_scene import Options, Solved, solve_scene


def solve_zone(
    scene: Scene,
    elements: int | None = None,
    options: Options | None = None,
    start: Solved | None = None,
) -> Solved:
    """Solve a scene; where it has a contact zone, remesh until its edge is a node of the mesh.
    InputError if fewer than two nodes are in contact.

    Each round starts from the one before, the first from `start` or `scene.zone`, and ends when two
    zones agree to AGREE of an element, when a solve fails, or after LOOPS rounds. A scene without a
    zone, or with several pairs, is solved once.
    """
    elements = scene.elements if elements is None else elements
    if scene.zone is None or len(scene.pairs) > 1:
        return solve_scene(scene, elements, scene.zone, options, start)
    restart = None if options is None else options.restart
    known = restart.known.zone if restart is not None and restart.known is not None else 0.0
    zones = [start.zones[-1] if start is not None and start.zones else known or scene.zone]
    seconds: Counter[str] = Counter()
    while True:
        start = solve_scene(scene, elements, zones[-1], options, start)
        problem, solution = start.reduction.problem, start.solution
        seconds.update(solution.seconds)
        if contact_status(problem, solution.reactions).touching.sum() < 2:
            raise InputError(
                f"scene '{scene.name}': fewer than two nodes are in contact; take more elements."
            )
        zones.append(contact_edge(scene, problem, solution.reactions))
        if restart is not None:
            restart.zone = zones[-1]
        agreed = abs(zones[-1] - zones[-2]) <= AGREE * zones[-2] / elements
        if agreed or solution.status not in (Status.SOLVED, Status.SETTLED) or len(zones) > LOOPS:
            return Solved(start.reduction, replace(solution, seconds=dict(seconds)), tuple(zones))
