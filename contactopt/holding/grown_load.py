"""The load that grows: its names, the states without it, and its force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from contactopt.errors import InputError
from contactopt.scenes.loads import Load, load_classes
from contactopt.scenes.scene import Part, Scene

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart


def load_rows(scene: Scene) -> dict[str, tuple[float, bool]]:
    """The loads of a scene by BODY:BOUNDARY:COMPONENT: value, and whether it is a total force."""
    found: dict[str, tuple[float, bool]] = {}
    for part in scene.parts:
        for load in getattr(part, "loads", ()):
            own, place = load.values(scene.components), _place(part, load)
            found |= {f"{place}:{c}".rstrip(":"): (own[c], load.total) for c in own}
        whole = getattr(part, "force", None) or {}
        found |= {f"{part.name}:force:{c}": (whole[c], True) for c in whole}
    return found


def _place(part: AnyPart, load: Load) -> str:
    """What stands before the component in the name of a load."""
    if load.shared:
        return ":".join(("bolt", *load.address(part.name)))
    tables = {kind: table for table, kind in load_classes().items()}
    return f"{part.name}:{load.boundary or tables.get(type(load), load.what)}"


def _belongs(name: str, load: str) -> bool:
    return f"{name}:".startswith(f"{load}:")


def held_states(states: tuple[Scene, ...], load: str | None) -> tuple[Scene, ...]:
    """The states that are followed before the load grows, which has no share in them."""
    last = states[-1]
    rows = [name for name, (value, _) in load_rows(last).items() if value]
    listed = f"its loads are {', '.join(rows) or 'none'}"
    if load is None:
        before = [i for i, own in enumerate(states) if own.state != last.state]
        if len(states) < 2:
            raise InputError(f"scene '{last.name}': name the load that grows; {listed}.")
        return states[: (before[-1] if before else 0) + 1]
    if not any(_belongs(name, load) for name in rows):
        raise InputError(f"scene '{last.name}' has no load '{load}'; {listed}.")
    return tuple(_without(scene, load) for scene in states)


def _without(scene: Scene, load: str) -> Scene:
    """The scene with zero in place of a load."""

    def left(name: str, own: Mapping[str, float]) -> dict[str, float]:
        return {c: 0.0 if _belongs(f"{name}:{c}", load) else own[c] for c in own}

    def eased(name: str, own: Load) -> Load:
        return own.with_values(left(name, own.values(scene.components)))

    def changed(part: Any) -> Any:
        if isinstance(part, Part):
            loads = (eased(_place(part, own), own) for own in part.loads)
            return replace(part, loads=tuple(loads))
        return replace(part, force=part.force and left(f"{part.name}:force", part.force))

    return scene.with_parts(changed)


def force_of(held: Scene, last: Scene) -> float | None:
    """The force that the factor 1 stands for, where one total force is all of the load."""
    before = load_rows(held)
    found = [
        (v - before.get(name, (0.0,))[0], total) for name, (v, total) in load_rows(last).items()
    ]
    changed = [(value, total) for value, total in found if value]
    return changed[0][0] if len(changed) == 1 and changed[0][1] else None
