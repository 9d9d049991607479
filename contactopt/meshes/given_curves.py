"""The smooth line or surface that a boundary of a mesh stands for."""

from collections.abc import Callable
from typing import Any

import numpy as np
from skfem import Mesh

from contactopt.checks import place_words
from contactopt.errors import InputError

OFF = 2e-2  # how far nodes may be from the curve of their boundary, over the size of the facets
# share of facets that may be further away, where refinement left nodes on edges, and how far
FEW, FAR = 0.25, 0.5


class Curve:
    """A function `place` that moves points (dim, m) [length] onto the line or surface that a
    boundary stands for; messages call it `name`.

    It is `given` where the user gave it, so that it may not be that of the mesh. It is `known` also
    where curved edges of the mesh define it; otherwise it was guessed from the nodes of a polygon,
    and `other` is the other shape that the guess may have, if any.
    """

    other: Callable[[np.ndarray], np.ndarray] | None = None

    def __init__(
        self,
        place: Callable[[np.ndarray], Any],
        known: bool,
        name: str = "the curve",
        given: bool = False,
    ) -> None:
        self.place, self.known, self.name, self.given = place, known, name, given

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Move points (dim, m) to their places (dim, m); InputError where the function fails."""
        try:
            with np.errstate(all="ignore"):
                found = np.asarray(self.place(points), dtype=float)
        except Exception as error:  # whatever a user's function raises
            raise InputError(f"{self.name} failed: {type(error).__name__}: {error}.") from error
        if found.shape != np.shape(points):
            raise InputError(
                f"{self.name} must return an array of the shape of"
                f" its points, {np.shape(points)}; got {found.shape}."
            )
        lost = np.flatnonzero(~np.isfinite(found).all(axis=0))
        if len(lost):
            place = place_words(np.reshape(points, (len(points), -1))[:, lost[0]])
            raise InputError(f"{self.name} gives no numbers for the point ({place}).")
        return found


def check_curve(curve: Curve, mesh: Mesh, boundary: str) -> None:
    """Raise InputError unless a boundary's nodes lie on its curve, to OFF of most facets."""
    corners = mesh.facets[:, mesh.boundaries[boundary]]
    places = mesh.p[:, corners]
    size = np.linalg.norm(np.ptp(places, axis=1), axis=0)
    moved = curve(places.reshape(len(places), -1)).reshape(places.shape)
    off = np.linalg.norm(moved - places, axis=0).max(axis=0)
    if len(size) and (np.mean(off > OFF * size) > FEW or np.any(off > FAR * size)):
        worst = int(np.argmax(off / size))
        at = place_words(places[:, :, worst].mean(axis=1))
        raise InputError(
            f"{curve.name} is not that of the mesh: near ({at}) it is {off[worst]:.3g} away from"
            f" the nodes, where a facet has the size {size[worst]:.3g}; mend its radius, its centre"
            " or the unit of the mesh."
        )
