"""Reflections and rotations, under which a scene may lie on itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.analysis.simplest.regions import NEAR


@dataclass(frozen=True, eq=False)
class Plane:
    """The points x with normal' x = offset."""

    normal: np.ndarray
    offset: float

    @property
    def key(self) -> bytes:
        """What tells this plane from others."""
        return bytes(self.normal.tobytes() + np.float64(self.offset).tobytes())

    @property
    def reflection(self) -> np.ndarray:
        """H (dim, dim)."""
        return np.eye(len(self.normal)) - 2 * np.outer(self.normal, self.normal)

    def image(self, points: np.ndarray) -> np.ndarray:
        """The mirror images of points (dim, k)."""
        return np.asarray(points - 2 * self.normal[:, None] * (self.normal @ points - self.offset))

    back = image

    def words(self, components: tuple[str, ...]) -> str:
        """'x = 0', or '0.866 x + 0.5 y = 3'."""
        terms = [(value, component) for value, component in zip(self.normal, components) if abs(value) > NEAR]
        if len(terms) == 1:
            return f"{terms[0][1]} = {_rounded(self.offset * np.sign(terms[0][0])):g}"
        sign = np.sign(terms[0][0])
        text = " + ".join(f"{sign * value:.4g} {component}" for value, component in terms).replace("+ -", "- ")
        return f"{text} = {_rounded(sign * self.offset):.4g}"


@dataclass(frozen=True, eq=False)
class Turn:
    """The rotation R (dim, dim) about a line through a point; a body that any angle maps to itself is one of revolution."""

    reflection: np.ndarray
    point: np.ndarray

    @property
    def key(self) -> bytes:
        """What tells this rotation from others."""
        return bytes(self.reflection.tobytes() + self.point.tobytes())

    def image(self, points: np.ndarray) -> np.ndarray:
        """Points (dim, k) after the rotation."""
        return np.asarray(self.reflection @ (points - self.point[:, None]) + self.point[:, None])

    def back(self, points: np.ndarray) -> np.ndarray:
        """Points (dim, k) before the rotation."""
        return np.asarray(self.reflection.T @ (points - self.point[:, None]) + self.point[:, None])


def _rounded(offset: float) -> float:
    """Without the rounding errors of a zero."""
    return 0.0 if abs(offset) < 1e-12 else float(offset)
