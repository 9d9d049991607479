"""The search through all kinds of simplification, the exact ones first."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from contactopt.analysis.simplest import joints, large_bodies
from contactopt.analysis.simplest.clipping import crosses, is_mirrored
from contactopt.analysis.simplest.constants import SHARE, WORST
from contactopt.analysis.simplest.cutting import half_of, matches, roller, side_of
from contactopt.analysis.simplest.images import Images, images_under
from contactopt.analysis.simplest.mirrors import Mirror, find_mirrors
from contactopt.analysis.simplest.planes import Plane
from contactopt.analysis.simplest.prisms import plane_strain, prism
from contactopt.analysis.simplest.report import PARTS, Simplification, Simplified
from contactopt.analysis.simplest.revolution import axisymmetric, revolution
from contactopt.analysis.simplest.shapes import Shapes, shapes_of, sizes_of
from contactopt.analysis.simplest.turning import turned
from contactopt.analysis.solve_scene import Solved
from contactopt.errors import InputError
from contactopt.scenes.scene import Scene

UNIQUE = "Exact wherever the solution is unique."


def simplify(scene: Scene, solve: bool = True) -> Simplified:
    """Say what may be left out of a scene before it is solved, why, and with which error.

    Parameters
    ----------
    scene
        Of elastic and rigid bodies. Scenes of half-spaces are returned as they are.
    solve
        Whether to solve the scene once on a coarse mesh, which shows contacts that neither open nor slip, contacts whose
        friction hardly acts, and contacts that are small beside their bodies. Without it only exact simplifications are
        looked for. A mesh that is given is not made coarser.

    Returns
    -------
    Simplified
        A report that prints as text, with the simplified scenes.

    Raises
    ------
    InputError
        For something else than a scene, and for a scene that cannot be modelled.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"the scene must be a Scene; got {type(scene).__name__}.")
    shapes = shapes_of(scene)
    if shapes is None:
        return Simplified(scene, scene, (), ("Half-spaces have no mesh, and nothing that could be left out.",))
    found: list[Simplification] = []
    notes: list[str] = []
    simple, told = _section(shapes)
    found, notes = [*found, *simple], [*notes, *told]
    shapes = _shapes(simple, shapes)
    simple, told = _mirrored(shapes)
    found, notes = [*found, *simple], [*notes, *told]
    shapes = _shapes(simple, shapes)
    if solve:
        simple, told = _solved(shapes.scene)
        found, notes = [*found, *simple], [*notes, *told]
    return Simplified(scene, shapes.scene, tuple(found), tuple(notes))


def _shapes(found: list[Simplification], before: Shapes) -> Shapes:
    """The shapes of the last scene that was made."""
    scenes = [each.scene for each in found if each.scene is not None]
    made = shapes_of(scenes[-1]) if scenes else before
    assert made is not None
    return made


def _section(shapes: Shapes) -> tuple[list[Simplification], list[str]]:
    """Plane strain or axisymmetry instead of a solid."""
    before = sizes_of(shapes.scene)
    round_about = revolution(shapes)
    if round_about is not None:
        point, axis, reason = round_about
        where = f"the line through {_place(point)} along {_place(axis)}"
        if reason:
            return [], [f"The bodies are of revolution about {where}, but {reason}."]
        what = "The section on one side of the axis stands for the bodies."
        why = f"Bodies, supports, loads and laws fit themselves after any turn about {where}. {UNIQUE}"
        return [_tried("axisymmetry", what, why, before, lambda: axisymmetric(shapes, point, axis))], []
    straight = prism(shapes)
    if straight is None:
        return [], []
    axis, reason = straight
    where = _direction(axis, shapes.scene.components)
    if reason:
        return [], [
            f"The bodies are prisms along {where}, but {reason}; plane strain is no more than an approximation."
        ]
    what = "A section in plane strain stands for the bodies."
    why = f"The bodies are prisms along {where}, their ends are held along it, and nothing changes or acts along it. {UNIQUE}"
    return [_tried("plane strain", what, why, before, lambda: plane_strain(shapes, axis))], []


def _tried(name: str, what: str, why: str, before: tuple[int, int], make: Callable[[], Scene]) -> Simplification:
    """An exact simplification with its scene, or without one and the reason why it cannot be made."""
    try:
        scene = make()
    except InputError as error:
        return Simplification(name, what, f"{why} It cannot be applied here: {error}", True, None, before)
    return Simplification(name, what, why, True, None, before, sizes_of(scene), scene)


def _mirrored(shapes: Shapes) -> tuple[list[Simplification], list[str]]:
    """One half after the other, across planes of symmetry that are normal to each other."""
    mirrors, notes = find_mirrors(shapes)
    if mirrors and shapes.scene.copies == 1 and (name := roller(shapes)):
        return [], [
            *notes,
            f"The scene is symmetric across the plane {mirrors[0].plane.words(shapes.scene.components)}, but is not cut: in a part of "
            f"the bodies {name}, which holds a contact along one axis, would count as a plane of symmetry, too.",
        ]
    mirrors, R, told = _orthogonal(shapes, mirrors)
    notes += told
    if not mirrors:
        return [], notes
    components = shapes.scene.components
    normals = [R @ mirror.plane.normal for mirror in mirrors]
    places = [mirror.plane.offset for mirror in mirrors]
    if np.any(np.eye(len(R)) != R):
        seen = shapes_of(turned(shapes.scene, R))
        assert seen is not None
        shapes = seen
    found: list[Simplification] = []
    for mirror, normal, place in zip(mirrors, normals, places):
        plane = Plane(np.round(normal, 12), place)
        again = images_under(shapes, plane)
        if not isinstance(again, Images):
            continue
        before = sizes_of(shapes.scene)
        made = half_of(shapes, plane, again)
        copies = 2 ** (len(found) + 1)
        what = f"The {PARTS[copies]} on one side of the plane {mirror.plane.words(components)} stands for the whole."
        if np.any(np.eye(len(R)) != R):
            what = f"{what[:-1]}, turned so that the plane is {plane.words(components)}."
        after = sizes_of(made)
        why, error = _why_mirror(shapes, plane, again)
        found.append(Simplification("mirror symmetry", what, why, True, error, before, after, made))
        seen = shapes_of(made)
        assert seen is not None
        shapes = seen
    return found, notes


def _why_mirror(shapes: Shapes, plane: Plane, images: Images) -> tuple[str, float | None]:
    """Why one half is enough, how well the boundaries fit, and what the numbers of the half stand for; the error on the mesh."""
    own = [name for name, image in images.bodies.items() if name in shapes.meshes and name == image]
    text = "Bodies, supports, loads and laws are their own mirror images"
    worst, error = images.apart / shapes.size, None
    text += f", to {worst:.0e} of the size." if worst > 1e-9 else "."
    text += f" {UNIQUE}"
    if any(crosses(shapes.meshes[name], side_of(plane)) for name in own):
        text += " The mesh is clipped at the plane."
    elif not all(is_mirrored(mesh, shapes.meshes[images.bodies[name]], plane) for name, mesh in shapes.meshes.items()):
        text += " The mesh is not symmetric."
    elif not matches(shapes):
        text += " Nodes of surfaces do not lie on each other, and linear elements may be coupled a little differently at the plane."
    else:
        error = 0.0
    text += " Forces and areas stay those of the whole"
    doubled = any(name != image for name, image in images.pairs.items())
    return text + (
        "; a contact that stands for itself and its image carries the forces of both." if doubled else "."
    ), error


def _orthogonal(shapes: Shapes, mirrors: list[Mirror]) -> tuple[list[Mirror], np.ndarray, list[str]]:
    """As many mirrors as are normal to each other and can be seen from common axes, and the rotation to these axes."""
    dim = shapes.scene.dim
    best: tuple[list[Mirror], np.ndarray] = ([], np.eye(dim))
    told: list[str] = []
    for first in mirrors:
        group = [first]
        for other in mirrors:
            if all(abs(other.plane.normal @ one.plane.normal) < 1e-6 for one in group):
                group.append(other)
        if len(group) <= len(best[0]):
            continue
        R = _rotation_to_axes([mirror.plane.normal for mirror in group], dim)
        try:
            turned(shapes.scene, R)
        except InputError as error:
            where = first.plane.words(shapes.scene.components)
            told.append(
                f"The scene is symmetric across the plane {where}, but cannot be turned so that the plane is "
                f"normal to an axis: {error}"
            )
            continue
        best = (group, R)
    return *best, told if not best[0] else []


def _rotation_to_axes(normals: list[np.ndarray], dim: int) -> np.ndarray:
    """A rotation after which every normal lies along an axis; the identity if they do already."""
    rows: list[np.ndarray | None] = [None] * dim
    for normal in normals:
        free = [axis for axis in range(dim) if rows[axis] is None]
        axis = max(free, key=lambda number: abs(normal[number]))
        rows[axis] = normal * np.sign(normal[axis] or 1.0)
    for axis in range(dim):
        if rows[axis] is None:
            row = np.eye(dim)[axis]
            for other in (known for known in rows if known is not None):
                row = row - (row @ other) * other
            if np.linalg.norm(row) < 0.1:
                row = np.linalg.svd(np.array([known for known in rows if known is not None]))[2][-1]
            rows[axis] = row / np.linalg.norm(row)
    R = np.array(rows)
    if np.abs(np.abs(R) - np.round(np.abs(R))).max() < 1e-12 and np.allclose(np.abs(R), np.eye(dim), atol=1e-12):
        return np.eye(dim)
    if np.linalg.det(R) < 0:
        R[-1] = -R[-1]
    return R


def _solved(scene: Scene) -> tuple[list[Simplification], list[str]]:
    """What one solve on a coarse mesh shows."""
    solved = joints.coarse(scene)
    if not solved.solution.solved:
        return [], [
            f"The scene was not solved on a coarse mesh ({solved.solution.message}); contacts were not looked at."
        ]
    before = sizes_of(scene)
    found = [*_joints(scene, solved, before)]
    if scene.kind == "axisymmetric":
        return found, []  # a section costs less than the square of points of a half-space
    spot = large_bodies.spot_of(solved)
    if isinstance(spot, str):
        return found, [f"Half-spaces are no model of this scene: {spot}."] if len(scene.pairs) == 1 else []
    if spot.error > WORST:
        size = f"{spot.size / spot.half_width:.3g} half-widths"
        return found, [
            f"Half-spaces would make an error of about {spot.error:.0%} in the peak pressure: the bodies end {size} from the contact."
        ]
    made = large_bodies.as_half_spaces(scene, spot)
    why = (
        f"The bodies end no nearer than {spot.size / spot.half_width:.3g} half-widths from the contact, and the gap rises by at most "
        f"{spot.slope:.2g} per length inside it. The error is that of the peak pressure and the half-width; the approach is "
        "another one, because it depends on the whole bodies."
    )
    what = "Half-spaces without a mesh stand for the bodies; their frame is the contact's own."
    return [*found, Simplification("half-spaces", what, why, False, spot.error, before, sizes_of(made), made)], []


def _joints(scene: Scene, solved: Solved, before: tuple[int, int]) -> list[Simplification]:
    tied, smooth = joints.joints(solved)
    if len(tied) == len(scene.pairs) == 1:
        tied = ()
    found = []
    friction: dict[str, Any] = {pair.name: pair.mu for pair in scene.pairs}
    for names, law, name in ((tied, "tied", "tied contacts"), (smooth, "frictionless", "frictionless contacts")):
        if not names:
            continue
        made = joints.with_law(scene, names, law)
        other = joints.coarse(made)
        if not other.solution.solved:
            continue
        error = joints.change(solved, other)
        listed = ", ".join(f"'{each}'" for each in names)
        if law == "tied":
            what = f"The {'contact' if len(names) == 1 else 'contacts'} {listed} can be tied."
            why = f"On a coarse mesh they stay closed and use no more than {SHARE:.0%} of their friction bound at any node."
            check = joints.verdict_on_ties(names, friction)
        else:
            what = f"Friction can be left out at the {'contact' if len(names) == 1 else 'contacts'} {listed}."
            why = "On a coarse mesh no tangential traction is more than a hundredth of the largest pressure."
            check = joints.verdict_on_smooth(names)
        why += " The error is the largest change of energy, contact forces and largest pressures on that mesh."
        found.append(Simplification(name, what, why, False, error, before, sizes_of(made), made, check))
    return found


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{0.0 if abs(value) < 1e-9 else value:.4g}" for value in point) + ")"


def _direction(axis: np.ndarray, components: tuple[str, ...]) -> str:
    """'z', or the direction by its components."""
    number = int(np.argmax(np.abs(axis)))
    return components[number] if abs(axis[number]) > 1 - 1e-9 else _place(axis)
