"""Solve, estimate, mark, refine: the loop of local refinement."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactopt.adaptivity.corners import unbounded
from contactopt.adaptivity.estimate import ElementErrors, element_errors
from contactopt.analysis.limits import Limits
from contactopt.analysis.progress import resident_memory
from contactopt.analysis.solve_scene import Options, Solved, solve_scene
from contactopt.bodies.elements import is_curved
from contactopt.bodies.local_refinement import Curve, bent, boundary_curve, divide, simplices
from contactopt.cards import count, line
from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.scenes.scene import Part, Scene

log = logging.getLogger(__name__)
SHARE = 0.6  # of the estimated error that the marked elements make; Doerfler's marking allows anything between 0 and 1
TRIED = 3  # meshes before a largest value at a corner is taken for infinite
FIRST = 4  # elements across the contact half-width of a first mesh that the scene itself makes
MOST_LEVELS = 60
MOST_UNKNOWNS = 2_000_000


@dataclass(frozen=True)
class AdaptedLevel:
    """What one solve of the loop gave.

    unknowns      of the displacement;   contacts  of the interface problem
    value         of the quantity [its unit];   error  estimated, over the value [-]
    energy_error  estimated error of the displacement in the energy norm, over its norm [-]
    seconds       wall time since the loop began [s]
    place, size   of a stress: where it was read (dim,), and the size of the elements there [length]; empty and 0 of others
    """

    unknowns: int
    contacts: int
    value: float
    error: float
    energy_error: float
    seconds: float
    place: tuple[float, ...] = ()
    size: float = 0.0

    @property
    def mesh(self) -> str:
        """What the mesh is, in words."""
        return f"{self.contacts} contacts, estimated error {self.error:.1e}"


@dataclass(frozen=True, repr=False)
class AdaptedEstimate:
    """What is known of a quantity after the last solve.

    value    on the last mesh [unit of the quantity];   extrapolated  with the estimated error added
    error    estimated, over the value [-]: the sum over the elements, or the last change of the value if that is more
    reached  whether the error is at most the target;   message  one sentence that says how the loop ended
    levels   all solves, in their order
    """

    quantity: str
    target: float
    value: float
    extrapolated: float
    error: float
    reached: bool
    message: str
    levels: tuple[AdaptedLevel, ...]

    def __repr__(self) -> str:
        first, last = self.levels[0], self.levels[-1]
        size = f"{first.unknowns} to {last.unknowns} unknowns on {count(len(self.levels), 'mesh', 'meshes')}"
        found = f"{self.quantity} {self.value:.6g}"
        return line(
            "AdaptedEstimate", found, f"error {self.error:.1e} of {self.target:g}", size, f"{last.seconds:.1f} s"
        )


def refine_locally(
    scene: Scene,
    quantity: str,
    accuracy: float,
    options: Options | None = None,
    limits: Limits | None = None,
) -> tuple[Solved, AdaptedEstimate]:
    """Solve a scene on a mesh that is refined where one quantity needs it, as in the head of contactopt.adaptivity.

    Each body is refined by itself; a mortar coupling joins what no longer matches. Quadrilaterals become triangles. Nodes on a
    curved boundary move to the `curve` of its part, on a contact boundary without one to the smooth line through the nodes of
    the first mesh, on other boundaries to the circle on which these nodes lie. Each solve begins with the last answer.

    Parameters
    ----------
    scene : of bodies in the plane, axisymmetric or solid; parts whose mesh is a function begin with a coarse mesh
    quantity : a name of contactopt.derivatives.outputs: 'energy', 'approach', 'pressure', 'von_mises:BODY', 'pressure@X,Y', ...
    accuracy : bound on the estimated relative error of the quantity, between 0 and 1
    options : how each mesh is solved
    limits : no further mesh is solved that would pass one of them, by the time and memory that the last one took

    Returns
    -------
    The scene solved on the last mesh, which is the best answer where a bound ended the loop, and the estimate.

    Raises
    ------
    InputError : for a quantity that the scene does not have, and for meshes that cannot be refined locally
    """
    check_number("the accuracy", accuracy, low=0.0, high=1.0)
    options, limits = options or Options(), limits or Limits()
    began, before = time.perf_counter(), resident_memory()
    scene, curves = simplicial(scene)
    levels: list[AdaptedLevel] = []
    solved: Solved | None = None
    infinite = ""
    while True:
        start = time.perf_counter()
        previous, solved = solved, solve_scene(with_bent_edges(scene, curves), options=options, start=solved)
        if not solved.solution.solved:
            message = f"the mesh of {solved.reduction.dofs} unknowns was not solved: {solved.solution.message}"
            if not levels:
                raise InputError(f"scene '{scene.name}': {message}; begin with another mesh or load.")
            solved = previous or solved
            break
        errors = element_errors(solved, quantity)
        levels.append(_level(solved, errors, levels, began))
        last = levels[-1]
        options.note(f"{quantity} {last.value:.6g}, estimated error {last.error:.1e}")
        infinite = unbounded(solved, quantity, errors.stress, levels) if len(levels) > TRIED else ""
        message = infinite or _end(quantity, accuracy, levels)
        if message:
            break
        scene = _finer(scene, errors.marked(SHARE), curves)
        growth = _unknowns(scene) / last.unknowns
        now = time.perf_counter()
        held = (resident_memory() - before) * (1 + growth)
        message = limits.refusal(_unknowns(scene), MOST_UNKNOWNS, 2 * now - start - began, held)
        if message:
            break
    last = levels[-1]
    reached = last.error <= accuracy and len(levels) > 1 and not infinite
    extrapolated = last.value + errors.total
    return solved, AdaptedEstimate(
        quantity, accuracy, last.value, extrapolated, last.error, reached, message, tuple(levels)
    )


def _level(solved: Solved, errors: ElementErrors, before: list[AdaptedLevel], began: float) -> AdaptedLevel:
    change = abs(errors.value - before[-1].value) if before else 0.0
    scale = abs(errors.value) or 1.0
    found = errors.stress
    error = max(errors.size, change, 0.0 if found is None else found.uncertainty) / scale
    size = solved.reduction.dofs, solved.reduction.problem.contacts
    at = () if found is None else (tuple(found.place.tolist()), found.size)
    return AdaptedLevel(*size, errors.value, error, errors.energy, time.perf_counter() - began, *at)


def _end(quantity: str, accuracy: float, levels: list[AdaptedLevel]) -> str:
    """One sentence that says that the target is reached or out of reach, or an empty text."""
    if len(levels) > 1 and levels[-1].error <= accuracy:
        return f"the estimated error of the {quantity} is below the target"
    if len(levels) >= MOST_LEVELS:
        return f"{MOST_LEVELS} meshes did not reach the target"
    return ""


def _unknowns(scene: Scene) -> int:
    """The displacement components of all nodes of the meshes, at least as many as a mesh has unknowns."""
    total = 0
    for part in scene.parts:
        if isinstance(part, Part):
            mesh = part.mesh
            inner = (mesh.nfacets if scene.dim == 2 else mesh.nedges) if scene.degree == 2 else 0
            total += scene.dim * int(mesh.nvertices + inner)
    return total


Curves = dict[str, dict[str, Curve]]  # name of the body -> name of the boundary -> curve


def simplicial(scene: Scene) -> tuple[Scene, Curves]:
    """The scene on meshes of triangles or tetrahedra, and for every body the curves of its contact boundaries."""
    curves: Curves = {}

    def prepared(part: Any) -> Any:
        if not isinstance(part, Part):
            return part
        given = part.build_mesh(FIRST, scene.zone)
        surfaces = scene.surfaces_of(part)
        bent = given.boundaries or {} if is_curved(given) else {}
        known = given.boundaries or {}
        lines = {
            name: part.curve_of(name) or boundary_curve(given, name, arcs=name not in {*surfaces, *bent})
            for name in known
        }
        if bent and scene.kind == "solid" and not all(lines[name] for name in surfaces):
            raise InputError(
                f"body '{part.name}': a solid of second order can be refined locally only with a `curve` for each of its contact "
                "boundaries."
            )
        found = curves[part.name] = {name: line for name, line in lines.items() if line is not None}
        return replace(
            part, mesh=simplices(given), curve={name: found[name] for name in surfaces if name in found} or None
        )

    return scene.with_parts(prepared), curves


def with_bent_edges(scene: Scene, curves: Curves) -> Scene:
    """The scene as it is solved: with quadratic displacements the edges follow the curved boundaries."""
    if scene.degree == 1:
        return scene
    return scene.with_parts(
        lambda part: replace(part, mesh=bent(part.mesh, curves[part.name])) if isinstance(part, Part) else part
    )


def _finer(scene: Scene, marked: tuple[np.ndarray, ...], curves: Curves) -> Scene:
    numbers = iter(marked)

    def divided(part: Any) -> Any:
        elements = next(numbers)
        if not isinstance(part, Part) or not len(elements):
            return part
        return replace(part, mesh=divide(part.mesh, elements, curves[part.name]))

    return scene.with_parts(divided)
