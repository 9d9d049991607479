"""Quantities at a place that the user names: stress at a point or its maximum in a region, pressure
at a point.

    von_mises:BODY                     largest von Mises stress in a body [stress]
    von_mises:BODY:BOUNDARY            on one of its named boundaries, such as a fillet
    von_mises:BODY@X,Y,radius=R        in the circle or ball around a point
    von_mises:BODY@X,Y                 at a point, in space @X,Y,Z
    stress_xx:BODY@X,Y                 a component there: stress_xx, stress_xy, ..., named as in the
                                       VTU files
    pressure@X,Y, pressure:PAIR@X,Y    contact pressure at the place of a surface that is nearest to
                                       the point

Stresses are recovered ones (contactopt.bodies.stress_recovery). The largest one is that at the
vertices of the mesh and, in a circle, at its centre. Near a place a pressure is the linear function
that fits the nearest contacts best, with their areas as weights. Each reading comes with its
slopes, the derivatives by what it was read from.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from contactopt.bodies.fields import Region
from contactopt.bodies.views import stress_map
from contactopt.coupling.reduction import Reduction
from contactopt.errors import InputError
from contactopt.problem import Solution
from contactopt.readings.peaks import Peak, Reading, maxima
from contactopt.readings.state import Functional, Seeds, State
from contactopt.scenes.body_kinds import Support
from contactopt.scenes.parameters import MATERIAL, Parameter
from contactopt.scenes.scene import Part, Scene

if TYPE_CHECKING:
    from contactopt.bodies.stress_recovery import StressMap

LARGEST = "von_mises"
RIVAL = 0.5  # of the largest scatter, which the places need that are to be looked at more closely
AROUND = {2: 9, 3: 17}  # vertices among which a local maximum is the largest, itself among them
NEAREST = {2: 4, 3: 8}  # contacts through which the pressure near a place is fitted
PLACED = (
    "von_mises:BODY",
    "von_mises:BODY:BOUNDARY",
    "von_mises:BODY@X,Y",
    "stress_xx:BODY@X,Y",
    "pressure@X,Y",
)


@dataclass(frozen=True)
class Place:
    """A quantity at a place, by the parts of its name.

    kind  'von_mises', 'pressure', or the component of a stress;   owner  body, or pair of surfaces;
          region  where
    """

    name: str
    kind: str
    owner: str
    region: Region


@dataclass(frozen=True, eq=False)
class StressReading(Reading):
    """A stress, and what it was read from.

    The uncertainty is by how much it may be off because stresses scatter from element to element
    [stress]. The first peak is where it is, with the elements where the stress may be larger than
    the value or is as uncertain as it; of a largest stress the others are its other local maxima.

    body, map, slopes  number of the body among the parts of the scene, and the recovered stress
                       there with the derivatives (m, 4 or 6) by it
    """

    body: int = 0
    map: StressMap = field(kw_only=True, repr=False)
    slopes: np.ndarray = field(kw_only=True, repr=False)


def place_of(name: object, scene: Scene) -> Place | None:
    """The quantity at a place, by its name, or None; InputError for what the scene lacks."""
    if not isinstance(name, str):
        return None
    head, at, where = name.partition("@")
    kind, _, rest = head.partition(":")
    if kind == "pressure" and at:
        pairs = [pair.name for pair in scene.pairs]
        if rest not in pairs and (rest or len(pairs) > 1):
            raise InputError(
                f"quantity {name!r}: name one pair of surfaces, as in 'pressure:{pairs[0]}@...'."
            )
        return Place(name, kind, rest, _around(name, where, scene))
    stress = kind.removeprefix("stress_")
    if kind != LARGEST and stress == kind:
        return None
    body, _, boundary = rest.partition(":")
    check_meshed(name, body, scene)
    if kind != LARGEST and stress not in scene.analysis.stresses:
        names = ", ".join(f"stress_{own}" for own in scene.analysis.stresses)
        raise InputError(
            f"quantity {name!r}: there is no stress {kind!r}; choose from {names} and von_mises."
        )
    region = _around(name, where, scene) if at else Region(boundary)
    if kind != LARGEST and (not at or region.radius is not None):
        raise InputError(
            f"quantity {name!r}: a component of the stress is read at a point, as in"
            f" '{kind}:{body}@1,2'."
        )
    if boundary and at:
        raise InputError(f"quantity {name!r}: give either a boundary or a point.")
    if boundary or at:
        check_there(name, scene.meshed[body], region, scene)
    return Place(name, kind if kind == LARGEST else stress, body, region)


def check_meshed(name: str, body: str, scene: Scene) -> None:
    """InputError unless the body of a quantity has a mesh."""
    if body not in scene.meshed:
        wrong = f"there is no elastic body {body!r} with a mesh" if body else "it needs a body"
        raise InputError(f"quantity {name!r}: {wrong}; choose from {', '.join(scene.meshed)}.")


def check_there(name: str, part: Part, region: Region, scene: Scene, meeting: bool = False) -> None:
    """InputError for a boundary that the body's first mesh lacks, or a point far outside."""
    from contactopt.meshes.cells import straight

    mesh = part.build_mesh(scene.elements, scene.zone)
    known = mesh.boundaries or {}
    faces = Support(region.boundary).faces(known) if meeting else (region.boundary,)
    for face in filter(None, faces if region.boundary else ()):
        if face not in known:
            raise InputError(
                f"quantity {name!r}: body '{part.name}' has no boundary {face!r}; it has"
                f" {', '.join(sorted(known)) or 'none'}."
            )
        if np.any(mesh.f2t[1, np.asarray(known[face])] >= 0):
            raise InputError(
                f"quantity {name!r}: boundary {face!r} of body '{part.name}' has facets inside the"
                " body, which finer meshes do not keep; name one on its surface, or a point."
            )
    if len(faces) > 1:
        nodes = (mesh.facets[:, np.asarray(known[face])].ravel() for face in faces)
        if not len(reduce(np.intersect1d, nodes)):
            raise InputError(
                f"quantity {name!r}: the boundaries of {region.boundary!r} share no node; name"
                " boundaries that meet."
            )
    if region.point:
        corners = straight(mesh).p
        low, high = corners.min(axis=1), corners.max(axis=1)
        slack = 0.05 * (high - low).max() + (region.radius or 0.0)  # of the body's size
        if np.any(region.point < low - slack) or np.any(region.point > high + slack):
            raise InputError(
                f"quantity {name!r}: the point ({_words(region)}) lies outside body"
                f" '{part.name}'; give one inside it or on its surface."
            )


def _words(region: Region) -> str:
    return ", ".join(f"{x:g}" for x in region.point)


def _around(name: str, where: str, scene: Scene) -> Region:
    """The point, or the circle around it, that stands behind the @ of a quantity."""
    texts, radius = where.split(","), None
    try:
        if texts[-1].strip().startswith("radius="):
            radius = float(texts.pop().strip().removeprefix("radius="))
        point = tuple(float(text) for text in texts)
    except ValueError:
        point = ()
    fits = radius is None or 0 < radius < np.inf
    if len(point) != scene.dim or not np.all(np.isfinite(point)) or not fits:
        example = ",".join(scene.components)
        raise InputError(
            f"quantity {name!r}: a place needs {scene.dim} numbers, @{example} or"
            f" @{example},radius=R."
        )
    return Region(point=point, radius=radius)


def read_stress(
    place: Place, reduction: Reduction, displaced: tuple[np.ndarray, ...]
) -> StressReading:
    """Read the stress that a quantity names; InputError for a missing boundary or point."""
    from contactopt.bodies.fields import von_mises, von_mises_slopes

    number, recovered = _map_of(place, reduction)
    U = displaced[number]
    stress = recovered.stress(U)
    if place.kind == LARGEST:
        sizes, slopes = von_mises(stress), von_mises_slopes(stress)
        count = min(AROUND[reduction.scene.dim], len(sizes))
        points = recovered.places.T
        near = cKDTree(points).query(points, k=count)[1].reshape(-1, count)
        tops = maxima(sizes, sizes[near].max(axis=1)).tolist()
    else:
        column = reduction.scene.analysis.stresses.index(place.kind)
        sizes, slopes, tops = stress[:, column], np.zeros(stress.shape), []
        slopes[:, column] = 1.0
    top = int(np.argmax(sizes))
    scatter = 2 * recovered.deviation(U, slopes)  # standard errors hold 95 of 100
    above = sizes + scatter - sizes[top]
    doubtful = (above > 0) & (scatter >= RIVAL * scatter[above > 0].max(initial=0.0))
    slopes[np.arange(len(slopes)) != top] = 0.0
    uncertainty = float(above.max())

    def peak(i: int, doubt: float, vertices: ArrayLike) -> Peak:
        made = Peak(float(sizes[i]), doubt, recovered.places[:, i], recovered.size(i), body=number)
        return replace(made, elements=recovered.elements(np.asarray(vertices)))

    others = [peak(i, float(scatter[i]), [i]) for i in tops if i != top]
    peaks = (peak(top, uncertainty, np.flatnonzero(doubtful)), *others)
    return StressReading(
        float(sizes[top]), uncertainty, peaks, body=number, map=recovered, slopes=slopes
    )


def _map_of(place: Place, reduction: Reduction, by_poisson: bool = False) -> tuple[int, StressMap]:
    """The body's number, and its recovered stress as a map of U, or that derived by nu."""
    number = [part.name for part in reduction.scene.parts].index(place.owner)
    recovered = stress_map(reduction.bodies[number], place.region, by_poisson)
    if recovered is None:
        raise InputError(
            f"quantity {place.name!r}: the stress inside body '{place.owner}' cannot be read here."
        )
    return number, recovered


def place_seeds(place: Place, state: State) -> Seeds:
    """The slopes of a quantity at a place; a largest stress is differentiated where it is."""
    if place.kind == "pressure":
        return Functional(pressure_weights(place, state.reduction))(state)
    found = read_stress(place, state.reduction, state.displaced)
    number = found.body
    own = found.map.transposed(found.slopes)

    def explicit(which: Parameter) -> float:
        part: Any = state.reduction.scene.parts[number]
        if which.kind not in MATERIAL or not which.concerns(part):
            return 0.0
        if which.kind == "E":
            return found.value / part.material.E
        by_poisson = _map_of(place, state.reduction, by_poisson=True)[1]
        return float(np.sum(found.slopes * by_poisson.stress(state.displaced[number])))

    bodies = tuple(own if i == number else None for i in range(len(state.displaced)))
    return Seeds(found.value, state.following(number, own), bodies=bodies, explicit=explicit)


def pressure_weights(place: Place, reduction: Reduction) -> np.ndarray:
    """(k, dim) what the force at each contact contributes to a place's pressure [1 / length^2]."""
    problem = reduction.problem
    pairs = {pair.name: pair for pair in problem.pairs}
    own = np.zeros(problem.contacts, dtype=bool)
    own[pairs[place.owner].contacts if place.owner else slice(None)] = True
    own &= problem.areas > 0
    chosen = np.flatnonzero(own)
    offset = problem.coordinates[:, chosen] - np.asarray(place.region.point)[:, None]
    order = np.argsort(np.linalg.norm(offset, axis=0), kind="stable")[: NEAREST[problem.dim]]
    near, areas = chosen[order], problem.areas[chosen[order]]
    along = reduction.frames[near[0], 1:] @ offset[:, order]
    terms = np.concatenate([np.ones((1, len(near))), along / (np.abs(along).max() or 1.0)])
    root = np.sqrt(areas)
    weights = np.zeros(problem.q.shape)
    weights[near, 0] = np.linalg.pinv((terms * root).T)[0] * root / areas
    return weights


def read_place(place: Place, reduction: Reduction, solution: Solution) -> Reading:
    """Read a quantity at a place, and its uncertainty [stress]: of pressure the scatter."""
    if place.kind != "pressure":
        return read_stress(place, reduction, reduction.displaced(solution))
    weights, problem, r = pressure_weights(place, reduction), reduction.problem, solution.reactions
    near = np.flatnonzero(weights[:, 0])
    value, areas = float(np.sum(weights * r)), problem.areas[near]
    apart = reduction.moved(solution)[near, 0].min()
    missing = (
        f"there is no contact at ({_words(place.region)}): the surfaces are {apart:.3g} apart there"
        if not problem.law.pressed(r)[near].any()
        else ""
    )
    pressure, share, points = r[near, 0] / areas, weights[near, 0] * areas, problem.coordinates
    scatter = float(np.abs(pressure - value) @ np.abs(share))
    if len(near) > 2:
        terms = np.vstack([np.ones(len(near)), points[:, near]]).T
        left = pressure - terms @ np.linalg.lstsq(terms, pressure, rcond=None)[0]
        scatter = float(np.linalg.norm(left) * np.linalg.norm(share))
    noise = solution.residual * float(np.linalg.norm(r) / areas.min())
    size = float(np.ptp(points[:, near], axis=1).max())
    peak = Peak(value, scatter, points[:, near[0]], size, near)
    return Reading(value, scatter + noise, (peak,), missing)
