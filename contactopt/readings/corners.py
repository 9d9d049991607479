"""Corners at which a single mesh knows that a largest value is infinite.

A stress is infinite at a re-entrant corner or edge of a body, where its elements fill more than
half of the angle around it. A pressure is infinite at the rim of a contact surface where the bodies
together do, as two halves of one body would: under the corner of a block on a long face, but not
where two blocks of the same width end. A rigid body is a mirror. Elements do not tell a corner from
a rounding that is smaller than they are, so that the sentences here have an if.

Sources: Williams (1952), Stress singularities resulting from various boundary conditions in angular
corners of plates in extension; Dundurs, Lee (1972), Stress concentration at a sharp edge in contact
problems, Journal of Elasticity 2.
"""

import numpy as np
from skfem import Mesh

from contactopt.bodies.fields import Region
from contactopt.bodies.views import elements_of, stress_map
from contactopt.checks import place_words
from contactopt.coupling.reduction import Reduction
from contactopt.meshes.cells import straight
from contactopt.meshes.curves import CORNER
from contactopt.meshes.structured import simplices
from contactopt.problem import Solution
from contactopt.readings.peaks import Peak, Reading, around, at_rim, nodal_pressure
from contactopt.readings.resultants import pair_view

RISE = 1.1  # by how much the pressure at a corner exceeds that of the contacts next to it, at least
THERE = 0.05  # of the distance of contacts, within which a node is at the place of a contact


def infinite(reduction: Reduction, solution: Solution, reading: Reading) -> str:
    """One sentence if the largest value of a reading is where it is infinite, else nothing."""
    if not reading.peaks or not solution.solved:
        return ""
    peak = reading.peaks[0]
    if peak.body < 0:
        pairs = reduction.problem.pairs if len(peak.contacts) else ()
        own = [i for i, pair in enumerate(pairs) if pair.start <= peak.contacts[0] < pair.stop]
        return under_corner(reduction, solution, own[0]) if own else ""
    if not at_re_entrant(reduction, peak):
        return ""
    place = place_words(peak.place)
    return (
        f"the largest stress is at a re-entrant corner near ({place}): unless that is rounded, it"
        " is infinite, and grows with every refinement."
    )


def corner_remarks(reduction: Reduction, solution: Solution) -> list[str]:
    """One sentence for each pair of surfaces whose largest pressure is infinite."""
    if not solution.solved:
        return []
    pairs = range(len(reduction.problem.pairs))
    return [said for i in pairs if (said := under_corner(reduction, solution, i))]


def at_re_entrant(reduction: Reduction, peak: Peak) -> bool:
    """Whether a peak of the stress lies at a re-entrant corner of its body."""
    read = stress_map(reduction.bodies[peak.body], Region())
    if read is None:
        return False
    mesh = straight(read.mesh)
    return re_entrant(mesh, int(np.argmin(np.linalg.norm(mesh.p - peak.place[:, None], axis=0))))


def under_corner(reduction: Reduction, solution: Solution, number: int) -> str:
    """One sentence if the largest pressure of a pair lies at the rim of its surface, rises towards
    it, and the bodies fill more than half of the angle there, and with those that other pairs join
    to them not all of it; or an empty text.
    """
    scene, (seen, own) = reduction.scene, pair_view(reduction, solution, number)
    pressure, places = nodal_pressure(seen.problem, own), seen.problem.coordinates
    top = int(np.argmax(pressure))
    near = around(seen.problem, top)
    near = near[near != top]
    rises = len(near) > 0 and pressure[top] > max(RISE * np.max(pressure[near]), 0.0)
    if not rises or not at_rim(seen, own):
        return ""
    reach = THERE * np.linalg.norm(places[:, near] - places[:, [top]], axis=0).min()
    reach += abs(seen.coupling.gap[top])
    bodies = set(scene.pairs[number].bodies)
    joined = {name for pair in scene.pairs if bodies & {*pair.bodies} for name in pair.bodies}

    def filling(names: set[str], away: float) -> float:
        known = [elements_of(body) for body in reduction.bodies if body.name in names]
        meshes = [body.basis.mesh for body in known if body is not None]
        return sum(_share(mesh, places[:, top], reach, away) for mesh in meshes)

    images = 2 if bodies - scene.meshed.keys() else 1
    own_share = images * filling(bodies, 0.5)
    most = 1 - CORNER / (2 * np.pi)
    if own_share <= 1.5 - most or own_share + images * filling(joined - bodies, 0.0) >= most:
        return ""
    place = place_words(places[:, top])
    return (
        f"the largest pressure of '{seen.problem.pairs[0].name}' is under a corner near ({place}):"
        " unless that is rounded, it is infinite, and grows with every refinement."
    )


def _share(mesh: Mesh, place: np.ndarray, reach: float, away: float) -> float:
    """The share of the full angle that a body fills around a place: `away` from its vertices."""
    mesh = straight(mesh)
    far = np.linalg.norm(mesh.p - place[:, None], axis=0)
    vertex = int(np.argmin(far))
    if far[vertex] > reach:
        return away
    near = np.flatnonzero(np.any(mesh.t == vertex, axis=0))
    part, number = mesh.restrict(near, return_mapping=True, skip_boundaries=True)
    return filled(simplices(part), int(np.flatnonzero(number == vertex)[0]))


def re_entrant(mesh: Mesh, vertex: int) -> bool:
    """Whether a vertex is within two elements of a re-entrant corner or edge."""
    cells = simplices(mesh)
    near = np.array([vertex])
    for _ in range(2):
        near = np.unique(cells.t[:, np.any(np.isin(cells.t, near), axis=0)])
    outer = np.intersect1d(near, cells.boundary_nodes())
    return any(filled(cells, node) > 0.5 + CORNER / (2 * np.pi) for node in outer)


def filled(cells: Mesh, vertex: int) -> float:
    """The share of the full angle around a vertex that the simplices at it fill [-]."""
    corner, element = np.nonzero(cells.t == vertex)
    others = np.stack([np.delete(cells.t[:, e], c) for c, e in zip(corner, element)], axis=1)
    arms = cells.p[:, others] - cells.p[:, [vertex]][:, :, None]
    arms = arms / np.linalg.norm(arms, axis=0)
    if len(arms) == 2:
        cosines = np.clip(np.sum(arms[:, 0] * arms[:, 1], axis=0), -1, 1)
        return float(np.arccos(cosines).sum() / (2 * np.pi))
    a, b, c = arms[:, 0], arms[:, 1], arms[:, 2]
    volume = np.abs(np.sum(a * np.cross(b, c, axis=0), axis=0))
    # Van Oosterom, Strackee (1983)
    angles = 2 * np.arctan2(volume, 1 + np.sum(a * b + b * c + c * a, axis=0))
    return float(angles.sum() / (4 * np.pi))
