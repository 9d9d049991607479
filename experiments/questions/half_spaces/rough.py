"""Products, CPU seconds and memory as the grid of a rough surface grows."""

from __future__ import annotations

import numpy as np

from contactopt import HalfSpace, Material, Rigid, Scene
from contactopt.analytic import contact_modulus
from contactopt.scenes.rough_surfaces import self_affine
from experiments.questions.half_spaces.measured import Row, apart, solved

LENGTH, MATERIAL, MU = 10.0, Material(5.0, 0.3), 0.3


def ticks(n: int) -> np.ndarray:
    return (np.arange(n) + 0.5) * LENGTH / n - LENGTH / 2


def gap_of(kind: str, n: int) -> np.ndarray:
    """Gap (n, n) of a surface with up to 64 waves a side, or of a 'wavy' one with 16."""
    heights = self_affine(
        (n, n),
        (LENGTH, LENGTH),
        longest=LENGTH / 4,
        shortest=LENGTH / (16 if kind == "wavy" else 64),
        slope=0.1,
    )
    return np.asarray(heights.max() - heights)


def pressed(kind: str, n: int, law: str, shear: float = 0.0) -> Scene:
    """A rigid rough surface pressed on a half-space; sheared by a share of mu P."""
    force = 0.005 * contact_modulus(MATERIAL) * LENGTH**2
    load = {"z": -force} | ({"x": shear * MU * force} if shear else {})
    lower = HalfSpace("half-space", MATERIAL, (ticks(n), ticks(n)))
    mu = 0.0 if law == "frictionless" else MU
    return Scene(
        kind, Rigid("body", gap=gap_of(kind, n), force=load), lower, mu, kind="solid", law=law
    )


def one(kind: str, n: int, law: str) -> Row:
    return solved(pressed(kind, n, law, 0.0 if law == "frictionless" else 0.5))


def growth(kind: str, sizes: tuple[int, ...], frictional: tuple[int, ...]) -> list[Row]:
    """Every size in a process of its own; those with friction are sheared to half of mu P."""
    rows = [apart(one, kind, n, "frictionless") for n in sizes]
    return rows + [apart(one, kind, n, "coulomb") for n in frictional]


def wavy_rows() -> list[Row]:
    return growth("wavy", (64, 128, 256, 512, 1024), (64, 128, 256, 512, 1024))


def rough_rows() -> list[Row]:
    return growth("rough", (512, 1024, 2048), ())


def friction_rows() -> list[Row]:
    return growth("rough", (), (512, 1024))
