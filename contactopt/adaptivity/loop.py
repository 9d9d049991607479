"""Solve, estimate, mark, refine: the loop of local refinement."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactopt.adaptivity.estimate import ElementErrors, element_errors
from contactopt.analysis.quantities import at_rim
from contactopt.analysis.solve_scene import Options, Solved, solve_scene
from contactopt.bodies.elements import is_curved
from contactopt.bodies.local_refinement import Curve, boundary_curve, divide, simplices
from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.scenes.scene import Part, Scene

log = logging.getLogger(__name__)
SHARE = 0.6  # of the estimated error that the marked elements make; Doerfler's marking allows anything between 0 and 1
TRIED = 3  # meshes before a largest pressure at the rim is taken for that of a corner
FIRST = 4  # elements across the contact half-width of a first mesh that the scene itself makes
MOST_LEVELS = 60
MOST_UNKNOWNS = 2_000_000


@dataclass(frozen=True)
class AdaptedLevel:
    """What one solve of the loop gave.

    unknowns  of the displacement;   contacts  of the interface problem
    value     of the quantity [its unit];   error  estimated, over the value [-]
    seconds   wall time since the loop began [s]
    """

    unknowns: int
    contacts: int
    value: float
    error: float
    seconds: float

    @property
    def mesh(self) -> str:
        """What the mesh is, in words."""
        return f"{self.contacts} contacts"


@dataclass(frozen=True)
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


def refine_locally(
    scene: Scene,
    quantity: str,
    accuracy: float,
    options: Options | None = None,
    max_unknowns: int = MOST_UNKNOWNS,
    time_limit: float = np.inf,
) -> tuple[Solved, AdaptedEstimate]:
    """Solve a scene on a mesh that is refined where one quantity needs it, as in the head of contactopt.adaptivity.

    Each body is refined by itself; a mortar coupling joins what no longer matches. Quadrilaterals become triangles. Nodes on a
    curved contact boundary move to the `curve` of its part, or to the smooth line through the nodes of the first mesh.

    Parameters
    ----------
    scene : of bodies in the plane, axisymmetric or solid; parts whose mesh is a function begin with a coarse mesh
    quantity : a name of contactopt.derivatives.outputs: 'energy', 'approach', 'pressure', 'width', 'normal_force:PAIR', ...
    accuracy : bound on the estimated relative error of the quantity, between 0 and 1
    options : how each mesh is solved
    max_unknowns : no further mesh is made once a mesh has more unknowns
    time_limit : no further mesh is made after so many seconds

    Returns
    -------
    The scene solved on the last mesh, which is the best answer where a bound ended the loop, and the estimate.

    Raises
    ------
    InputError : for a quantity that the scene does not have, and for meshes that cannot be refined locally
    """
    check_number("the accuracy", accuracy, low=0.0, high=1.0)
    check_number("max_unknowns", max_unknowns, low=1.0)
    options, began = options or Options(), time.perf_counter()
    scene, curves = _simplicial(scene)
    levels: list[AdaptedLevel] = []
    solved: Solved | None = None
    while True:
        previous, solved = solved, solve_scene(scene, options=options, start=solved)
        if not solved.solution.solved:
            message = f"the mesh of {solved.reduction.dofs} unknowns was not solved: {solved.solution.message}"
            if not levels:
                raise InputError(f"scene '{scene.name}': {message}; begin with another mesh or load.")
            solved = previous or solved
            break
        errors = element_errors(solved, quantity)
        levels.append(_level(solved, errors, levels, began))
        options.note(f"{quantity} {errors.value:.6g}, estimated error {levels[-1].error:.1e}")
        message = _end(solved, quantity, accuracy, levels, max_unknowns, time_limit)
        if message:
            break
        scene = _finer(scene, errors.marked(SHARE), curves)
    last = levels[-1]
    reached = last.error <= accuracy and not _at_a_corner(solved, quantity, levels)
    extrapolated = last.value + errors.total
    return solved, AdaptedEstimate(
        quantity, accuracy, last.value, extrapolated, last.error, reached, message, tuple(levels)
    )


def _level(solved: Solved, errors: ElementErrors, before: list[AdaptedLevel], began: float) -> AdaptedLevel:
    change = abs(errors.value - before[-1].value) if before else 0.0
    scale = abs(errors.value) or 1.0
    error = max(abs(errors.total), change) / scale
    contacts = solved.reduction.problem.contacts
    return AdaptedLevel(solved.reduction.dofs, contacts, errors.value, error, time.perf_counter() - began)


def _end(
    solved: Solved, quantity: str, accuracy: float, levels: list[AdaptedLevel], most: int, time_limit: float
) -> str:
    """One sentence that says why the loop ends here, or an empty text."""
    last = levels[-1]
    if _at_a_corner(solved, quantity, levels):
        return "the largest pressure is at the edge of the contact surface, a corner, where no mesh bounds it"
    if len(levels) > 1 and last.error <= accuracy:
        return f"the estimated error of the {quantity} is below the target"
    if last.unknowns > most:
        return f"the mesh has {last.unknowns:,} unknowns, more than the {most:,} at which refinement ends"
    if last.seconds > time_limit:
        return f"the time limit of {time_limit:g} s has passed"
    if len(levels) >= MOST_LEVELS:
        return f"{MOST_LEVELS} meshes did not reach the target"
    return ""


def _at_a_corner(solved: Solved, quantity: str, levels: list[AdaptedLevel]) -> bool:
    """Whether the largest pressure stays at the rim of the contact surface, which the first coarse meshes cannot tell."""
    return quantity == "pressure" and len(levels) > TRIED and at_rim(solved.reduction, solved.solution)


Curves = dict[str, dict[str, Curve]]  # name of the body -> name of the boundary -> curve


def _simplicial(scene: Scene) -> tuple[Scene, Curves]:
    """The scene on meshes of triangles or tetrahedra, and for every body the curves of its contact boundaries."""
    curves: Curves = {}

    def prepared(part: Any) -> Any:
        if not isinstance(part, Part):
            return part
        given = part.build_mesh(FIRST, scene.zone)
        surfaces = scene.surfaces_of(part)
        bent = given.boundaries or {} if is_curved(given) else {}
        lines = {name: part.curve_of(name) or boundary_curve(given, name) for name in {*surfaces, *bent}}
        if bent and scene.kind == "solid" and not all(lines[name] for name in surfaces):
            raise InputError(
                f"body '{part.name}': a solid of second order can be refined locally only with a `curve` for each of its contact "
                "boundaries."
            )
        mesh = simplices(given)
        curves[part.name] = {name: line for name, line in lines.items() if line is not None}
        return replace(part, mesh=mesh)

    return scene.with_parts(prepared), curves


def _finer(scene: Scene, marked: tuple[np.ndarray, ...], curves: Curves) -> Scene:
    numbers = iter(marked)

    def divided(part: Any) -> Any:
        elements = next(numbers)
        if not isinstance(part, Part) or not len(elements):
            return part
        return replace(part, mesh=divide(part.mesh, elements, curves[part.name]))

    return scene.with_parts(divided)
