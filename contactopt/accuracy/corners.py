"""Places where the quantity asked for is infinite, so that no mesh bounds it: pressure at a rim,
stress at a corner.

A stress is infinite at a re-entrant corner or edge of a body. There the elements at a vertex fill
clearly more than half of the angle around it, on every mesh; along a fillet they fill half of it as
soon as the mesh resolves the fillet. A stress can be infinite at other places as well: at the end
of a support, under the corner of another body. There it grows like h^-alpha with the size h of the
elements, alpha up to 1/2, so that every halving of h adds between once and 1.4 times as much as the
one before. Under a concentrated load each adds twice as much or more, which is what a contact looks
like that is smaller than the elements, and is no reason to stop.

Source: Williams (1952), Stress singularities resulting from various boundary conditions in angular
corners of plates in extension.
"""

from collections.abc import Sequence

import numpy as np

from contactopt.accuracy.estimate import Level
from contactopt.checks import place_words
from contactopt.readings.corners import at_re_entrant
from contactopt.readings.peaks import Peak, Reading, at_rim
from contactopt.readings.resultants import pair_view
from contactopt.solving.solve_scene import Solved

HALVED = 1.8  # by how much smaller elements must be for a level to count as the next one
TRIED = 3  # meshes before a largest stress at a corner is taken for infinite
RISE = 1.1  # by how much a stress at a corner has grown since the coarsest elements there
STEADY = 0.8, 1.7  # share of the growth before that the next growth of a singular stress is
# one after the other, that are steady; a sharp rounding looks like a corner before it is resolved
GROWTHS = 4
AT_EDGE = 2  # at a corner of the contact surface


def unbounded(solved: Solved, reading: Reading, levels: Sequence[Level]) -> str:
    """One sentence that says why no mesh bounds the quantity, or an empty text."""
    if not levels[-1].place:
        return ""
    values, pressure = _kept(levels), reading.peaks[0].body < 0
    rises = len(levels) > TRIED and len(values) > 1 and values[0] > RISE * values[-1]
    place = "(" + place_words(levels[-1].place) + ")"
    what = f"the largest {'pressure' if pressure else 'stress'}"
    if pressure and grows(values, AT_EDGE) and _singular(solved, reading.peaks[0]):
        where = "is at the edge of the contact surface, a corner, where"
    elif not pressure and rises and _singular(solved, reading.peaks[0]):
        where = f"is at the re-entrant corner near {place}, where it is infinite;"
    elif grows(values, GROWTHS):
        what, where = f"{what}, at {place},", "grows with every refinement like an infinite one;"
    else:
        return ""
    return f"{what} {where} no mesh bounds it"


def _singular(solved: Solved, peak: Peak) -> bool:
    """Whether a peak is at a re-entrant corner (stress) or at the edge of a surface (pressure)."""
    if peak.body < 0:
        pairs, first = solved.reduction.problem.pairs, peak.contacts[0]
        number = next(i for i, pair in enumerate(pairs) if pair.start <= first < pair.stop)
        return at_rim(*pair_view(solved.reduction, solved.solution, number))
    return at_re_entrant(solved.reduction, peak)


def _kept(levels: Sequence[Level]) -> list[float]:
    """The values of the levels at the place of the last one, each for clearly larger elements."""
    last = levels[-1]
    kept: list[Level] = []
    for level in reversed(levels):
        if np.linalg.norm(np.subtract(level.place, last.place)) > 2 * level.size:
            break
        if not kept or level.size >= HALVED * kept[-1].size:
            kept.append(level)
    return [level.value for level in kept]


def grows(values: Sequence[float], count: int) -> bool:
    """Whether the last values, or every second of them, grow steadily as the elements at the corner
    shrink.
    """
    for step in (1, 2):
        growths = -np.diff(values[::step][: count + 1])
        if len(growths) == count and np.all(growths > 0):
            ratios = growths[:-1] / growths[1:]
            if np.all((ratios >= STEADY[0]) & (ratios <= STEADY[1])):
                return True
    return False
