"""Half-spaces instead of bodies that are large beside their contact.

One coarse solve gives the half-width a of the contact, the total force, and the gap about it, which
a polynomial of the distance continues. Two errors remain for the peak pressure, both measured on
Hertz's contact (contactopt.simplification.constants): that of a body that ends at the distance L
from the contact, FINITE (a / L)^2, and that of a surface that is not flat, STEEP times the square
of its slope at the edge of the contact. The approach is not the same: it depends on the whole
bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.bodies.elements import face_nodes
from contactopt.problem.contact_status import contact_status
from contactopt.scenes.scene import HalfSpace, Part, Rigid, Scene
from contactopt.simplification.constants import ACROSS, FINITE, REACH, STEEP, WORST
from contactopt.simplification.findings import Found, Simplification
from contactopt.simplification.whole import lattice_points, sizes_of
from contactopt.solving.solve_scene import Solved

FLAT = 0.95  # cosine between the contact normals inside the contact and their mean, at least
RINGS = 2.0  # contact half-widths about the middle whose gaps the polynomial follows
FEWEST = 4  # contacts inside the contact for its shape to be known
ROUGH = 0.02  # of the indentation: how well the polynomial must follow the gap
SMALL = 1e-6  # tangential force over the normal one that counts as none
# cosine to the normal of the contact from which on a side belongs to the surface about it
AROUND = 0.5


@dataclass(frozen=True, eq=False)
class Spot:
    """The contact as a coarse solve shows it.

    half_width  of the contact [length]
    force       total normal force
    shear       total tangential forces (dim - 1,) on the upper body, along the tangents
    gap         the initial gap as a function of the distance from the middle (in 2D the place along
                the line)
    size        distance from the contact to the nearest end of an elastic body [length]
    slope       of the gap at the edge of the contact [-]
    misfit      of the gap over the indentation [-]
    """

    half_width: float
    force: float
    shear: np.ndarray
    gap: Callable[[np.ndarray], np.ndarray]
    size: float
    slope: float
    misfit: float

    @property
    def error(self) -> float:
        """Estimated relative error of the peak pressure."""
        return FINITE * (self.half_width / self.size) ** 2 + STEEP * self.slope**2 + self.misfit


def offered_half_spaces(scene: Scene, solved: Solved) -> Found:
    """Half-spaces for the bodies of a scene, as a solution on a coarse mesh shows the contact."""
    # a section costs less than the square of points of a half-space
    if scene.kind == "axisymmetric":
        return [], []
    spot = spot_of(solved)
    if isinstance(spot, str):
        told = [f"Half-spaces are no model of this scene: {spot}."]
        return [], told if len(scene.pairs) == 1 else []
    size = f"{spot.size / spot.half_width:.3g} half-widths from the contact"
    if spot.error > WORST:
        error = f"{spot.error:.0%} in the peak pressure: the bodies end {size}"
        return [], [f"Half-spaces would make an error of about {error}."]
    made = as_half_spaces(scene, spot)
    why = (
        f"The bodies end no nearer than {size}, and the gap rises by at most {spot.slope:.2g} per"
        " length inside it. The error is that of the peak pressure and the half-width; the"
        " approach is another one, because it depends on the whole bodies."
    )
    what = "Half-spaces without a mesh stand for the bodies; their frame is the contact's own."
    sizes = sizes_of(scene), sizes_of(made)
    return [Simplification("half-spaces", what, why, *sizes, made, error=spot.error)], []


def spot_of(solved: Solved) -> Spot | str:
    """The contact of a solved scene, or half a sentence that says why it is none of half-spaces."""
    scene, problem = solved.reduction.scene, solved.reduction.problem
    if len(scene.pairs) != 1 or any(isinstance(part, HalfSpace) for part in scene.parts):
        return "it is offered for one pair of surfaces of bodies with meshes"
    if callable(scene.pairs[0].mu) or np.ndim(scene.pairs[0].mu):
        return "the friction depends on the place"
    if scene.pairs[0].law not in ("coulomb", "frictionless"):
        return f"the law '{scene.pairs[0].law}' binds all of the surface"
    r = solved.solution.reactions
    touching = contact_status(problem, r).touching
    if touching.sum() < FEWEST:
        return "the mesh is too coarse to show the shape of the contact"
    if touching.all() or problem.chart.closed:
        return "the contact fills all of its surface, so that its edge is that of a body"
    mean = problem.areas @ solved.reduction.frames[:, 0]
    if np.any(solved.reduction.frames[touching, 0] @ mean < FLAT * np.linalg.norm(mean)):
        return "the surfaces turn by too much inside the contact"
    places, number = problem.chart.images()
    middle = places @ r[number, 0] / r[number, 0].sum()
    distance = np.linalg.norm(places - middle[:, None], axis=0)
    half_width = float(distance[touching[number]].max())
    if not 0 < half_width < 0.95 * distance.max():
        return "the contact reaches to the end of its surface"
    fitted = _gap(distance, solved.reduction.gap[number], half_width)
    if isinstance(fitted, str):
        return fitted
    gap, slope, misfit = fitted
    # that of mirror images cancels
    shear = np.where(problem.chart.mirrored, 0.0, r[:, 1:].sum(axis=0))
    force, size = float(r[:, 0].sum()), _size(solved, touching)
    return Spot(half_width, force, shear, gap, size, slope, misfit)


def _gap(
    distance: np.ndarray, gap: np.ndarray, a: float
) -> tuple[Callable[[np.ndarray], np.ndarray], float, float] | str:
    """An even polynomial through the gap about a contact, its slope at the edge, its misfit."""
    near = distance <= RINGS * a
    s = distance[near] / a
    if len(np.unique(np.round(s, 6))) < 5:
        return "the mesh is too coarse to show the gap about the contact"
    terms = np.stack([np.ones_like(s), s**2, s**4], axis=1)
    c = np.linalg.lstsq(terms, gap[near], rcond=None)[0]
    if c[1] <= 0:
        return "the gap does not grow from the middle of the contact"
    misfit = float(np.abs(terms @ c - gap[near]).max() / max(2 * (c[1] + c[2]), 1e-300))
    if misfit > ROUGH:
        return "the gap about the contact is no smooth function of the distance from its middle"
    slope = float(2 * c[1] + 4 * c[2]) / a
    return lambda d: np.asarray(c[1] * (d / a) ** 2 + c[2] * (d / a) ** 4), slope, misfit


def _size(solved: Solved, touching: np.ndarray) -> float:
    """Distance from the contact to the nearest side that does not go on from its surface."""
    reduction, scene, least = solved.reduction, solved.reduction.scene, np.inf
    centre = reduction.problem.coordinates[:, touching].mean(axis=1, keepdims=True)
    planes = [plane for coupling in reduction.couplings for plane in coupling.planes]
    for part, made in zip(scene.parts, reduction.bodies):
        if isinstance(part, Part):
            basis, degree = made.body.basis, made.body.degree  # type: ignore[attr-defined]
            mesh = basis.mesh
            surface = np.concatenate([mesh.boundaries[name] for name in scene.surfaces_of(part)])
            facets = np.setdiff1d(mesh.boundary_facets(), surface)
            corners, extent = mesh.p[:, mesh.facets[:, facets]], float(np.ptp(mesh.p, axis=1).max())
            outward, up = (face_nodes(basis, degree, own)[1] for own in (facets, surface))
            around = up.mean(axis=1) @ outward > AROUND
            for plane in planes:
                around |= plane.contains(corners.mean(axis=1), extent)
            if not around.all():
                points = lattice_points(corners[:, :, ~around])
                least = min(least, float(np.linalg.norm(points - centre, axis=0).min()))
    return least


def as_half_spaces(scene: Scene, spot: Spot) -> Scene:
    """The contact between half-spaces of the same materials, in axes of its own."""
    dim = 2 if scene.kind == "plane-strain" else 3
    reach = REACH * spot.half_width

    def points(elements: int, zone: float | None) -> tuple[np.ndarray, ...]:
        count = 2 * int(np.ceil(REACH * elements))
        row = (np.arange(count) + 0.5) * (2 * reach / count) - reach
        return (row,) * (dim - 1)

    def gap(x: np.ndarray) -> np.ndarray:
        return spot.gap(np.linalg.norm(x[: dim - 1], axis=0))

    pair = scene.pairs[0]
    upper, lower = (next(part for part in scene.parts if part.name == name) for name in pair.bodies)
    total = {"xyz"[dim - 1]: -spot.force}
    if np.linalg.norm(spot.shear) > SMALL * spot.force:
        total |= {name: -float(value) for name, value in zip("xyz", spot.shear)}
    top: Any = Rigid(upper.name, gap=gap, force=total)
    bottom: Any = Rigid(lower.name, gap=gap)
    if isinstance(lower, Part):
        bottom = HalfSpace(lower.name, lower.material, points)
    if isinstance(upper, Part):  # a rigid body below has the gap itself
        height = (lambda x: -gap(x)) if isinstance(lower, Part) else None
        top = HalfSpace(upper.name, upper.material, points, height=height, force=total)
    return Scene(
        f"{scene.name} as half-spaces",
        top,
        bottom,
        pair.mu,
        kind="plane-strain" if dim == 2 else "solid",
        thickness=scene.thickness,
        law=pair.law,
        elements=ACROSS[dim],
        units=scene.units,
        reference=scene.reference,
    )
