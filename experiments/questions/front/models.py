"""Eight scenes with known answers, and the models in which each is solved.

A model is a scene that differs from the question in dimension, body, symmetry or law. A model
without `wrong` converges to the known answer; of the others `wrong` names what does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from contactopt import HalfSpace, Rigid, Scene, scenes
from contactopt.analytic import contact_modulus
from experiments.questions.accuracy.half_space import MATERIAL, flat
from experiments.questions.classics.bodies import fit
from experiments.questions.front.bodies import (
    Known,
    ellipse,
    flat_model,
    half_space,
    line,
    point,
    rounded,
    solid_model,
)
from experiments.questions.half_spaces.rough import LENGTH, gap_of, pressed

LINEAR, QUADRATIC = (2, 3, 4, 6, 8, 12, 16, 24, 32), (1, 2, 3, 4, 6, 8, 12, 16)
POINTS = (3, 4, 6, 8, 12, 16, 24, 32, 48)  # of a half-space, across the half-width of contact
SOLID, GRID = (2, 3, 4, 6), (48, 64, 96, 128, 192, 256)
FEW = (4, 8, 16)  # meshes of models that are wrong
PLANE, DISC = "plane-strain", "axisymmetric"
SMALL = 4.0  # size of a body that is too small to be a half-space, over the half-width of contact
WAVES, FINEST = 16, 512  # waves and points along a side of the finest rough surface


@dataclass(frozen=True)
class Model:
    """One way to pose a scene: `make` a scene, the meshes on which it is solved, what is wrong."""

    scene: str
    name: str
    make: Callable[[], Scene]
    meshes: tuple[int, ...]
    wrong: str = ""
    method: str = "auto"

    @property
    def first(self) -> Model:
        """The model on its coarsest mesh alone."""
        return replace(self, meshes=self.meshes[:1])


def with_law(made: Callable[[], Scene], law: str, mu: float | None = None) -> Callable[[], Scene]:
    """The same scene with another law."""
    return lambda: replace(made(), law=law, **({} if mu is None else {"mu": mu}))


def hertz(name: str, known: Known) -> list[Model]:
    """Hertz's contacts: a half-space, sections and solids, and what is wrong with some."""
    solid = partial(solid_model, known)
    models = [Model(name, "half-space", partial(half_space, known), POINTS)]
    if len(set(known.axes)) == 1:
        word, plain = "plane" if known.plane else "section", partial(flat_model, known)
        models += [
            Model(name, f"{word}, linear", plain, LINEAR),
            Model(name, f"{word}, quadratic", partial(flat_model, known, 2), QUADRATIC),
            Model(name, f"{word}, uniform", partial(flat_model, known, 1, 20.0, True), (2, 4)),
            Model(name, f"{word}, small body", partial(flat_model, known, 1, SMALL), FEW, "body"),
            Model(name, f"{word}, mu = .3", with_law(plain, "coulomb", 0.3), FEW, "law"),
            Model(name, f"{word}, Gauss-Seidel", plain, FEW, "", "nsgs"),
        ]
    else:
        round_ = partial(flat_model, rounded(known), 2)
        models += [Model(name, "section, quadratic", round_, QUADRATIC[:-1], "dimension")]
        coarse = partial(half_space, rounded(known))
        models += [Model(name, "round half-space", coarse, POINTS[:-1], "dimension")]
    if not known.plane:
        models += [
            Model(name, "solid, linear", solid, SOLID),
            Model(name, "solid, quadratic", partial(solid_model, known, 2), (1, 2, 3)),
            Model(name, "solid, half", partial(solid_model, known, 1, False), (2, 3)),
        ]
    return models


def sheared_plane() -> Scene:
    """Cattaneo's cylinders on half-planes."""
    made, known = scenes.cattaneo(2), scenes.cattaneo(2).reference
    a, mu, material = known.half_width, 0.5, scenes.cattaneo(2).parts[0].material
    force, shear = 100.0 / 400.0, 40.0 / 400.0
    radius = np.pi * a**2 * contact_modulus(material, material) / (4 * force)

    def points(n: int, zone: float | None) -> Any:
        half = int(np.ceil(1.25 * n))
        return (np.arange(-half, half) + 0.5) * a / n

    height = lambda x: -(x[0] ** 2) / (2 * radius)  # noqa: E731
    upper = HalfSpace("cylinder", material, points, height, {"x": shear, "y": -force})
    lower = HalfSpace("flat", material, points)
    return Scene("half-planes", upper, lower, mu, kind=PLANE, reference=made.reference)


def cattaneo() -> list[Model]:
    """two equal cylinders, pressed and then sheared."""
    own = scenes.cattaneo(2, size=1000 * scenes.cattaneo(2).reference.half_width)
    small = scenes.cattaneo(2, size=SMALL * own.reference.half_width)
    plain, name = lambda: own, "Cattaneo"
    return [
        Model(name, "half-space", sheared_plane, POINTS),
        Model(name, "plane, linear", plain, LINEAR[2:]),
        Model(name, "plane, quadratic", lambda: replace(own, degree=2), (3, 4, 6, 8)),
        Model(name, "plane, small body", lambda: small, FEW, "body"),
        Model(name, "plane, associated", with_law(plain, "associated"), FEW, "law"),
        Model(name, "half-space, associated", with_law(sheared_plane, "associated"), FEW, "law"),
    ]


def punch(name: str, mu: float) -> list[Model]:
    """A rigid flat punch on a disc, with friction (Spence) and without."""
    made = flat(DISC, mu, 1e4)

    def grid() -> Scene:
        def points(n: int, zone: float | None) -> Any:
            ticks = (np.arange(-n, n) + 0.5) / n
            return ticks, ticks

        deep = lambda x: np.where(np.hypot(x[0], x[1]) < 1, 0.0, 1e3)  # noqa: E731
        tool, body = (
            Rigid("punch", (0.0, 0.0, 1.0), deep, {"z": -1.0}),
            HalfSpace("half-space", MATERIAL, points),
        )
        law = "coulomb" if mu else "frictionless"
        return Scene("grid", tool, body, mu, kind="solid", law=law, reference=made.reference)

    plain = lambda: made  # noqa: E731
    models = [
        Model(name, "half-space", grid, POINTS[1:]),
        Model(name, "section, linear", plain, LINEAR[2:]),
        Model(name, "section, quadratic", lambda: replace(made, degree=2), QUADRATIC[2:-1]),
        Model(name, "section, small body", lambda: flat(DISC, mu, SMALL), FEW, "body"),
        Model(name, "section, tied", with_law(plain, "tied", 0.0), FEW, "law"),
    ]
    if mu:
        models += [
            Model(name, "section, associated", with_law(plain, "associated"), FEW, "law"),
            Model(name, "section, frictionless", with_law(plain, "frictionless", 0.0), FEW, "law"),
            Model(name, "section, Gauss-Seidel", plain, FEW, "", "nsgs"),
        ]
    else:
        models += [Model(name, "section, mu = .3", with_law(plain, "coulomb", 0.3), FEW, "law")]
    return models


def press_fit() -> list[Model]:
    """Lame's press fit: a quarter of the section, or a slice along the axis."""
    name, many = "press fit", (2, 3, 4, 6, 8, 12, 16)
    quarter, ring = partial(fit, PLANE, 8), partial(fit, DISC, 8)
    return [
        Model(name, "plane, linear", quarter, many),
        Model(name, "plane, quadratic", lambda: replace(quarter(), degree=2), many[:-1]),
        Model(name, "section, linear", ring, (*many, 24, 32)),
        Model(name, "section, quadratic", lambda: replace(ring(), degree=2), many[:-1]),
        Model(name, "plane, mu = .3", with_law(quarter, "coulomb", 0.3), FEW, "law"),
        Model(
            name, "plane stress", lambda: replace(quarter(), kind="plane-stress"), FEW, "dimension"
        ),
    ]


def rough_scene(waves: int, law: str = "frictionless") -> Scene:
    """A rough surface of up to WAVES a side, of which those above `waves` are left out."""
    wanted = pressed("wavy", FINEST, law)
    gap = gap_of("wavy", FINEST)

    def points(n: int, zone: float | None) -> Any:
        ticks = (np.arange(n) + 0.5) * LENGTH / n - LENGTH / 2
        return ticks, ticks

    # the surface is periodic with the side, so that its waves are known exactly between the points
    waved = np.fft.fft2(gap)
    order = np.abs(np.fft.fftfreq(FINEST, 1 / FINEST))
    kept = np.maximum(order[:, None], order[None, :]) <= waves
    waved, half = np.where(kept, waved, 0.0), 0.5 * LENGTH / FINEST

    def shape(x: np.ndarray) -> np.ndarray:
        n = round(np.sqrt(x.shape[1]))
        fold = np.zeros((n, n), dtype=complex)
        shift = 0.5 * LENGTH / n - half  # of the first point
        turn = np.exp(2j * np.pi * np.fft.fftfreq(FINEST, 1 / FINEST) * shift / LENGTH)
        where = np.fft.fftfreq(FINEST, 1 / FINEST).astype(int) % n
        np.add.at(fold, (where[:, None], where[None, :]), waved * np.outer(turn, turn))
        heights = np.fft.ifft2(fold).real * (n / FINEST) ** 2
        return np.asarray((heights - heights.min()).ravel())

    tool = replace(wanted.upper, gap=shape)
    body = replace(wanted.lower, points=points)
    return replace(wanted, upper=tool, lower=body, reference=None, elements=128)


def rough() -> list[Model]:
    """A rough surface; its answer is that on the finest grid."""
    name = "rough surface"
    return [
        Model(name, "half-space", partial(rough_scene, WAVES), GRID),
        Model(
            name, "half-space, half the waves", partial(rough_scene, WAVES // 2), GRID[1::2], "body"
        ),
        Model(name, "half-space, mu = .3", partial(rough_scene, WAVES, "coulomb"), (96,), "law"),
    ]


def all_models() -> list[Model]:
    """All scenes, in the order of the report."""
    return [
        *hertz("Hertz, line", line()),
        *hertz("Hertz, point", point()),
        *hertz("Hertz, ellipse", ellipse()),
        *cattaneo(),
        *punch("Spence, disc", 0.3),
        *punch("flat punch, disc", 0.0),
        *press_fit(),
        *rough(),
    ]
