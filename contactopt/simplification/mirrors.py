"""Planes across which a whole scene is its own mirror image, and the parts that they leave. Those
of a scene that is cut already are found in contactopt.coupling.planes_of_symmetry.

The plane lies in the middle between the outermost nodes, across an axis of space or across a
principal axis of the nodes.
"""

from collections.abc import Iterator

import numpy as np

from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.simplification.findings import PARTS, Simplification
from contactopt.simplification.halves import half_of, roller
from contactopt.simplification.images import Images, Plane, images_under
from contactopt.simplification.whole import Whole, whole_of

UNIQUE = "Exact wherever the solution is unique."
NONE = (
    "No plane makes the meshes their own mirror images. To use a symmetry of the bodies, mesh one"
    " half of them, hold it in the plane along its normal, and set copies = 2."
)


def mirrored(whole: Whole) -> tuple[list[Simplification], list[str]]:
    """One half after the other, across planes of symmetry, and what is in the way."""
    planes, notes = find_planes(whole)
    components = whole.scene.components
    uncut = whole.scene.copies == 1
    if planes and uncut and (name := roller(whole)):
        told = (
            f"The scene is symmetric across the plane {planes[0].words(components)}, but is not"
            f" cut: in a part of the bodies {name}, which holds a contact along one axis, would"
            " count as a plane of symmetry, too."
        )
        return [], [*notes, told]
    if not planes and not notes and uncut and not whole.scene.analysis.revolved:
        notes.append(NONE)
    found: list[Simplification] = []
    for plane in planes:
        images, where = images_under(whole, plane), plane.words(components)
        if not isinstance(images, Images):
            continue
        told = f"The scene is symmetric across the plane {where}"
        if np.count_nonzero(plane.normal) > 1:
            if not found and uncut:
                notes.append(f"{told}; turn it so that this is across an axis.")
            continue
        try:
            scene, fold = half_of(whole, plane, images)
            made = whole_of(scene)
        except InputError as error:
            notes.append(f"{told}, but is not cut: {error}")
            continue
        part = PARTS[2 ** (len(found) + 1)]
        what = f"The {part} on one side of the plane {where} stands for the whole."
        sizes = whole.sizes, made.sizes
        found.append(Simplification("mirror symmetry", what, _why(images), *sizes, scene, (fold,)))
        whole = made
    return found, notes


def _why(images: Images) -> str:
    """Why one half is enough, and what the numbers of the half stand for."""
    text = (
        f"Meshes, supports, loads, gaps and laws are their own mirror images. {UNIQUE} Forces and"
        " areas stay those of the whole scene"
    )
    if any(name != image for name, image in images.pairs.items()):
        return f"{text}; a contact that stands for itself and its image carries the forces of both."
    return f"{text}."


def find_planes(whole: Whole) -> tuple[list[Plane], list[str]]:
    """All planes of symmetry, and sentences about those that something other than meshes spoils."""
    found: list[Plane] = []
    spoilt: dict[str, Plane] = {}  # by the reason
    for plane in _candidates(whole):
        made = images_under(whole, plane)
        if isinstance(made, Images):
            found.append(plane)
        elif made is not None:
            spoilt.setdefault(made, plane)
    words = whole.scene.components
    return found, [
        f"The bodies are symmetric across the plane {plane.words(words)}, but {reason}."
        for reason, plane in spoilt.items()
    ]


def _candidates(whole: Whole) -> Iterator[Plane]:
    """Planes that could be planes of symmetry; those across the axes of space come first."""
    points, dim = whole.points, whole.scene.dim
    axes = np.eye(dim)
    revolved = whole.scene.analysis.revolved
    known = [axes[1]] if revolved else [*axes]
    if not revolved:
        principal = np.linalg.eigh(np.cov(points))[1].T
        known += [axis for axis in principal if np.all(np.abs(np.abs(axes @ axis) - 1) > CLOSE**2)]
    for normal in known:
        along = normal @ points
        yield Plane(normal, float(along.min() + along.max()) / 2)
