"""Families of problems with generators: one file each, one line here.

A family is a function whose arguments are numbers and texts, with a seed where it draws random
numbers, and which returns an InterfaceProblem. `[[problems]] family = NAME` of an experiment file
and of a test set makes its problems.
"""

from __future__ import annotations

from collections.abc import Callable

from contactopt.benchmark.families.half_planes import half_plane
from contactopt.benchmark.families.meshed_blocks import meshed_blocks
from contactopt.benchmark.families.of_scenes import (
    by_products,
    in_units,
    reduced,
    redundant,
    scene,
    skewed,
    tangential,
)
from contactopt.benchmark.families.packings import packing
from contactopt.benchmark.families.random_frames import rigid_bodies
from contactopt.benchmark.families.rigid_blocks import rigid_blocks
from contactopt.benchmark.families.springs import springs
from contactopt.benchmark.families.unsolvable import dragged, squeezed, toppled
from contactopt.problem import InterfaceProblem

__all__ = ["FAMILIES", "reduced", "scene"]

_RIGID = (rigid_bodies, packing, rigid_blocks)
_ELASTIC = (half_plane, meshed_blocks, springs)
_OF_SCENES = (by_products, tangential, redundant, in_units, skewed)
_UNSOLVABLE = (dragged, toppled, squeezed)
FAMILIES: dict[str, Callable[..., InterfaceProblem]] = {
    make.__name__: make for make in (*_RIGID, *_ELASTIC, *_OF_SCENES, *_UNSOLVABLE)
}
