"""What a law may know of the place of a scene's contacts."""

from dataclasses import dataclass

import numpy as np

from contactopt.defaults import CLOSE
from contactopt.errors import InputError


@dataclass(frozen=True, eq=False)
class Place:
    """Where a scene's contacts are, for laws that depend on it.

    areas      (k,) nodal areas [length^2]
    frames     (k, dim, dim) rows n, t1[, t2] of each contact
    direction  of friction in space (dim,); None where the scene gives none
    """

    areas: np.ndarray
    frames: np.ndarray
    direction: tuple[float, ...] | None = None

    def angles(self) -> np.ndarray:
        """(k,) from t1 to the direction of friction, drawn on the surface [rad]; 0 in the plane."""
        if self.frames.shape[1] == 2:
            return np.zeros(len(self.areas))
        if self.direction is None:
            raise InputError(
                "friction with two coefficients needs the direction of the first one: give the"
                " contact a direction in space, such as that of the grooves."
            )
        if len(self.direction) != self.frames.shape[1]:
            raise InputError(
                f"the direction of friction has {len(self.direction)} components; the scene has"
                f" {self.frames.shape[1]}."
            )
        along = self.frames[:, 1:] @ (np.array(self.direction) / np.linalg.norm(self.direction))
        if np.any(np.linalg.norm(along, axis=1) < CLOSE):
            raise InputError(
                "the direction of friction is normal to the surface at a contact; give one that"
                " lies along the surface."
            )
        return np.arctan2(along[:, 1], along[:, 0])
