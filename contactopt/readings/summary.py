"""What is known of an answer, as the numbers and remarks of summary.json."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from contactopt.coupling.reduction import Reduction
from contactopt.linear.operators import has_entries
from contactopt.problem import Solution
from contactopt.readings.node_sets import bears
from contactopt.readings.peaks import pressure_reading
from contactopt.readings.plate_motions import approach
from contactopt.readings.plausibility import doubts
from contactopt.readings.resolution import remarks, smoothed
from contactopt.readings.resultants import mirrors, tables
from contactopt.readings.state import State
from contactopt.readings.validity import validity
from contactopt.scenes.scene import Scene

WIDTHS = "contact_half_width", "stick_half_width"


def summary_of(
    reduction: Reduction, solution: Solution, names: tuple[str, ...], states: Sequence[Scene] = ()
) -> dict[str, Any]:
    """What is known of the answer on one mesh at one state, of those of a load path."""
    problem, scene = reduction.problem, reduction.scene
    found = tables(reduction, solution)
    single, first = len(problem.pairs) == 1, next(iter(found["pairs"].values()))
    largest = max(pair["max_pressure"] for pair in found["pairs"].values())
    peak = pressure_reading(reduction, solution) if single else None
    more = [] if peak is None or not solution.solved else smoothed(peak, largest)
    limits, beyond = validity(reduction, solution)
    force = partial(bears, State(reduction, solution))
    known = doubts(scene, reduction.couplings, reduction.planes, states, force)
    said = [*known, *remarks(reduction, solution), *beyond]
    return {
        "scene": scene.name,
        "kind": scene.kind,
        "units": list(scene.units),
        "thickness": None if scene.dim == 3 or scene.analysis.revolved else scene.thickness,
        "mirrors": mirrors(reduction),
        "dofs": reduction.dofs,
        "contact_nodes": problem.contacts,
        "mu": float(problem.mu.max(initial=0.0)),
        **dict(zip(("method", "normal_backend", "tangential_backend"), names)),
        "status": solution.status.label,
        "message": solution.message,
        "residual": float(solution.residual),
        "outer_iterations": solution.iterations,
        "normal_force": first["normal_force"] if single else None,
        "approach": approach(reduction, solution),
        **{key: first[key] if single else None for key in WIDTHS},
        "max_pressure": largest,
        "pressure": None if peak is None else peak.value,
        "q": "implicit" if not has_entries(problem.Q) else "explicit",
        "products": solution.products,
        "remarks": [*said, *more],
        **found,
        "limits": limits,
    }
