"""Families of problems with generators, one file each, named by FAMILIES: functions of numbers and
texts, with a seed where random numbers are drawn, that return an InterfaceProblem.
"""

from collections.abc import Callable
from typing import Any

from contactopt.benchmark.families.half_planes import half_plane
from contactopt.benchmark.families.meshed_blocks import meshed_blocks
from contactopt.benchmark.families.of_scenes import (
    by_products,
    held,
    in_units,
    redundant,
    skewed,
    tangential,
)
from contactopt.benchmark.families.packings import packing, rigid_bodies
from contactopt.benchmark.families.rigid_blocks import rigid_blocks
from contactopt.benchmark.families.sequences import growing_friction, load_path, settling
from contactopt.benchmark.families.springs import springs
from contactopt.benchmark.families.unsolvable import dragged, squeezed, toppled

# families by name, one line for each kind
_RIGID = (rigid_bodies, packing, rigid_blocks)
_ELASTIC = (half_plane, meshed_blocks, springs)
_OF_SCENES = (by_products, held, tangential, redundant, in_units, skewed)
_SEQUENCES = (load_path, growing_friction, settling)
_UNSOLVABLE = (dragged, toppled, squeezed)
FAMILIES: dict[str, Callable[..., Any]] = {
    make.__name__: make for make in (*_RIGID, *_ELASTIC, *_OF_SCENES, *_SEQUENCES, *_UNSOLVABLE)
}
