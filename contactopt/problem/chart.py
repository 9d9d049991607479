"""The contact surface's own coordinates, whatever way the bodies are turned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.defaults import EQUAL
from contactopt.errors import InputError


@dataclass(frozen=True, eq=False)
class Chart:
    """Places of the k contacts on their surface, in coordinates that turn with it.

    In 2D the one coordinate is the arc length along the contact line. In 3D the two coordinates are
    those of a tangent plane. The origin is the centre of the surface: where a symmetry plane or an
    axis cuts it, the cut; otherwise the middle.

    places    (dim - 1, k) coordinates [length]
    mirrored  (dim - 1,) whether the surface goes on beyond x_i = 0 as its own mirror image (a
              symmetry plane or an axis)
    period    length of a contact line that is closed [length]; None where it has ends, and in 3D
    cells     (v, c) contacts at the corners of the lines, triangles or quadrilaterals that cover
              the surface; None where they are not known
    grid      numbers of contacts along each direction, where they are known to stand on a regular
              grid in the order of C arrays of that shape
    Raises InputError on shapes that do not fit and on numbers that are not finite.
    """

    places: np.ndarray
    mirrored: tuple[bool, ...]
    period: float | None = None
    cells: np.ndarray | None = None
    grid: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        places = np.array(self.places, dtype=float)
        if places.ndim != 2 or len(places) != len(self.mirrored):
            raise InputError(
                f"a chart needs one row of places per direction; got shape {places.shape} for"
                f" {len(self.mirrored)}."
            )
        if not np.all(np.isfinite(places)):
            raise InputError("a chart holds a number that is not finite.")
        places.setflags(write=False)
        object.__setattr__(self, "places", places)

    @classmethod
    def of_points(cls, coordinates: np.ndarray, dim: int) -> Chart:
        """A chart of points (d, k): as they are if d = dim - 1, else along principal directions."""
        count = dim - 1
        if len(coordinates) <= count:
            missing = np.zeros((count - len(coordinates), coordinates.shape[1]))
            return cls(np.concatenate([coordinates, missing]), (False,) * count)
        centred = coordinates - (coordinates.max(axis=1) + coordinates.min(axis=1))[:, None] / 2
        axes = np.linalg.svd(centred, full_matrices=False)[0][:, :count]
        axes = np.pad(axes, ((0, 0), (0, count - axes.shape[1])))
        largest = axes[np.argmax(np.abs(axes), axis=0), np.arange(count)]
        return cls((axes * np.where(largest < 0, -1.0, 1.0)).T @ centred, (False,) * count)

    @property
    def closed(self) -> bool:
        """Whether the surface is a contact line that returns to its start."""
        return self.period is not None

    def order(self) -> np.ndarray:
        """The numbers (k,) of the contacts, sorted along the first direction of the surface."""
        return np.argsort(self.places[0], kind="stable")

    def images(self) -> tuple[np.ndarray, np.ndarray]:
        """Places (dim - 1, m) with all mirror images, and the contact (m,) of each."""
        x, contact = self.places, np.arange(self.places.shape[1])
        near = EQUAL * np.abs(x).max(initial=0.0)
        for axis in np.flatnonzero(self.mirrored):
            other = np.abs(x[axis]) > near
            image = x[:, other] * np.where(np.arange(len(x)) == axis, -1.0, 1.0)[:, None]
            x, contact = np.hstack([x, image]), np.append(contact, contact[other])
        return x, contact

    def spacing(self) -> np.ndarray:
        """Distances (k,) between the two neighbours on a line, at an end to the only one."""
        order = self.order()
        steps, spacing = np.diff(self.places[0, order]), np.empty(len(order))
        if self.period is not None:
            steps = np.append(steps, self.period - steps.sum())
            spacing[order] = steps + np.roll(steps, 1)
        elif len(steps):
            spacing[order] = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
        else:
            spacing[order] = 1.0
        return spacing


UNNAMED = "contact"  # the one pair of a problem whose surfaces are not known


@dataclass(frozen=True, eq=False)
class Pair:
    """Consecutive contacts of an interface problem that belong to one pair of surfaces.

    name          of the pair, for messages, tables and files; UNNAMED where none is given
    start, stop   numbers of its first contact and of the first one after it
    chart         places of its contacts on their surface
    """

    name: str
    start: int
    stop: int
    chart: Chart

    @property
    def contacts(self) -> slice:
        """Its rows in arrays with one row per contact."""
        return slice(self.start, self.stop)


def nodal_weights(chart: Chart, areas: np.ndarray) -> np.ndarray:
    """Positive w (k,) with diag(Q) about proportional to 1 / w^2 and mean w^2 = 1: a force spread
    over a node displaces like 1 / length (2D), 1 / sqrt(area) (3D).
    """
    if len(chart.places) == 2:
        square = np.sqrt(areas)
    else:
        spacing = chart.spacing()
        square = areas / np.where(spacing > 0, spacing, 1.0)
    positive = square[square > 0]
    # The node on an axis has no area; it gets a hundredth of the mean instead of an infinite
    # diagonal.
    square = np.maximum(square, 1e-2 * np.mean(positive) if len(positive) else 1.0)
    return np.sqrt(square / np.mean(square))
