"""One place solves a scene (solve_scene); zone, load path and several meshes are loops."""

from collections.abc import Sequence

from contactopt.errors import Unbalanced
from contactopt.scenes.scene import Scene
from contactopt.solving.follow import follow_path
from contactopt.solving.solve_scene import Options, Solved
from contactopt.solving.zone import solve_zone


def solve_states(
    states: Sequence[Scene],
    elements: int | None = None,
    options: Options | None = None,
    start: Solved | None = None,
) -> Solved:
    """Solve a scene on fitted meshes from `start`, or follow a load path on one mesh."""
    if len(states) == 1:
        return solve_zone(states[0], elements, options, start)
    own = options or Options()
    try:
        path = follow_path(states, elements, None, own)
    except Unbalanced as error:
        if error.path is None:
            raise
        path = error.path  # what the states before it have found is an answer, too
    return Solved(path.reduction, path.solution, path=path)
