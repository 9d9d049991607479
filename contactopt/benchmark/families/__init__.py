"""Families of problems with generators: one file each, one line here.

A family is a function whose arguments are numbers and texts, with a seed where it draws random
numbers, and which returns an InterfaceProblem. `[[problems]] family = NAME` of an experiment file
and of a test set makes its problems.
"""

from __future__ import annotations

from collections.abc import Callable

from contactopt.benchmark.families.half_planes import half_plane
from contactopt.benchmark.families.of_scenes import (
    in_units,
    reduced,
    redundant,
    scene,
    tangential,
)
from contactopt.benchmark.families.packings import packing
from contactopt.benchmark.families.random_frames import rigid_bodies
from contactopt.problem import InterfaceProblem

__all__ = ["FAMILIES", "reduced", "scene"]

FAMILIES: dict[str, Callable[..., InterfaceProblem]] = {
    make.__name__: make
    for make in (rigid_bodies, packing, half_plane, tangential, redundant, in_units)
}
