"""Whether two states of a load path are those of one scene, so that bodies and Q can be kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.errors import InputError
from contactopt.scenes.scene import Scene

if TYPE_CHECKING:
    from skfem import Mesh


def check_same(one: Scene, other: Scene) -> None:
    """Raise InputError unless both scenes have the same bodies, but for their loads."""
    if not isinstance(other, Scene):
        raise InputError(f"a state of a path must be a Scene; got {type(other).__name__}.")
    if (one.kind, one.degree, len(one.parts)) != (other.kind, other.degree, len(other.parts)):
        raise InputError(
            f"the states '{one.name}' and '{other.name}' of a path are not those of one scene."
        )
    a: Any
    b: Any
    for a, b in zip(one.parts, other.parts):
        if type(a) is not type(b) or a.name != b.name:
            raise InputError(
                f"the states of a path must have the same bodies; '{a.name}' became '{b.name}'."
            )
        if hasattr(a, "mesh"):
            changes = {"material": a.material != b.material, "mesh": not _same_mesh(a.mesh, b.mesh)}
            for what in (what for what, differs in changes.items() if differs):
                raise InputError(
                    f"body '{a.name}' changes its {what} along the path; only loads may change."
                )


def _same_mesh(one: Mesh | Callable[..., Mesh], other: Mesh | Callable[..., Mesh]) -> bool:
    """Whether two meshes, or what the functions that make them enclose, are the same."""
    if callable(one) or callable(other):
        return callable(one) and callable(other) and not _differ(one, other)
    return one is other or (np.array_equal(one.p, other.p) and np.array_equal(one.t, other.t))


def _differ(one: Any, other: Any) -> bool:
    """Whether numbers, texts, arrays, or functions that enclose such, surely differ."""

    def both(*kinds: type) -> bool:
        return isinstance(one, kinds) and isinstance(other, kinds)

    if both(int, float, str, np.ndarray):
        return not np.array_equal(one, other)
    if both(tuple, list):
        return len(one) != len(other) or any(map(_differ, one, other))
    if both(FunctionType) and one.__code__ is other.__code__:
        enclosed = [[cell.cell_contents for cell in f.__closure__ or ()] for f in (one, other)]
        return _differ(*enclosed)
    if both(partial):
        return _differ(*((f.func, f.args, tuple(f.keywords.items())) for f in (one, other)))
    return False
