"""Writes the JSON schema of scene files, for editors that complete and check them:

    python -m experiments.site.scene_schema

It is made by the reader itself: scenes that have every table are read, and the table notes what
it is asked for. A test compares the file with what the reader asks now.
"""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contactopt.checks import short
from contactopt.cli.completion import NAMES
from contactopt.coupling.coupling import COUPLINGS
from contactopt.errors import InputError
from contactopt.files.toml_table import Place, Table
from contactopt.problem.laws import LAWS, find_law
from contactopt.run_options import OPTIONS
from contactopt.scenes.body_shapes import LENGTHS
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.material_library import STRESSES, library
from contactopt.scenes.scene_files import read_scenes

ROOT = Path(__file__).parents[2]
NAMED = ("bodies", "boundaries", "materials")  # tables whose keys are names that users choose
TYPES: dict[type, str] = {
    str: "string", float: "number", int: "integer", bool: "boolean", dict: "object", list: "array",
}  # fmt: skip


class Asked(NamedTuple):
    """What a reader asked a table for: an entry of a type."""

    key: str
    kind: type
    needed: bool = False
    default: Any = None
    what: str = ""
    among: tuple[str, ...] = ()
    low: float = -np.inf


class Noting(Table):
    """A table that notes what it is asked for, below its place."""

    def __init__(self, data: dict[str, Any], asked: dict[Place, list[Asked]]):
        super().__init__("", {}, data)
        self.asked = asked

    def note(self, *more: Any) -> None:
        self.asked.setdefault(self.place, []).append(Asked(*more))

    def has(self, key: str, *kinds: type) -> bool:
        for kind in kinds:
            self.note(key, kind)
        return super().has(key, *kinds)

    def take(self, key, kind, default=None, needed=False, what="", among=(), **limits) -> Any:
        low = limits.get("low", -np.inf)
        self.note(key, kind, needed, default, what, tuple(among), low)
        return super().take(key, kind, default, needed, what, among, **limits)


def schema() -> dict[str, Any]:
    """The schema of a scene file as a dictionary."""
    asked: dict[Place, list[Asked]] = {}
    for kind in KINDS:
        for scene in _scenes(kind):
            with suppress(InputError):  # files that are not there
                read_scenes(partial(Noting, scene, asked), Path("scene.toml"))
    found: dict[tuple[str, ...], list[Asked]] = {}
    for place, entries in asked.items():
        found.setdefault(_general(place), []).extend(entries)
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "scene of contactopt",
    }
    return head | _object((), found)


def _scenes(kind: str) -> list[dict[str, Any]]:
    """Scenes that have every table between them."""
    axes = KINDS[kind].components
    along, both, path = (
        dict.fromkeys(axes, 1.0),
        {a: [0, 1] for a in axes},
        {a: [0.0, 1.0] for a in axes},
    )
    material = {"E": 1.0, "nu": 0.3}
    shapes: dict[str, Any] = {
        "block": {"block": both | {"elements": [1] * len(axes)}},
        "ring": {"ring": {"radii": [1, 2], "elements": [1, 3]}},
        "disc": {"disc": {"radius": 1, "elements": 8}},
        "mesh": {"mesh": ""},
    }
    rigid = {"normal": along, "gap": "0", "force": path, "displacement": {}}
    points = {a: [0, 1] for a in axes[:-1]} | {"points": [4] * (len(axes) - 1)}
    surfaces: list[Any] = ["0", {"seed": 1}, {"file": ""}]
    pair = {"upper": "a", "lower": "b", "mu": 0.1}
    solve = {"solve": {}, "units": {"length": "mm", "stress": "MPa"}, "kind": kind}
    made: list[dict[str, Any]] = []
    for shape in shapes.values():
        body = shape | {
            "material": material,
            "move": along,
            "boundaries": {"c": both},
            "contact": "c",
        }
        body["supports"] = [{"boundary": "c"} | along, {"boundary": "c"} | path]
        body["tractions"] = [{"boundary": "c"} | path]
        body["pressures"] = [{"boundary": "c", "pressure": [0.0, 1.0]}]
        body["plates"] = [{"boundary": "c", "force": along}]
        body |= {"body_force": path, "curve": {"radius": 1, "centre": along}}
        own = {"materials": {"soft": material}, "steps": [{"name": "press"}, {"name": "push"}]}
        pairs = [pair, pair | {"law": "orthotropic", "mu": [0.1, 0.2], "direction": along}]
        made.append(solve | own | {"bodies": {"a": body, "b": {"rigid": rigid}}, "contacts": pairs})
    block: dict[str, Any] = {"material": material, **shapes["block"]}
    bolt = {"between": ["a.x-", "b.x-"], "force": [0.0, 1.0], "direction": along}
    blocks = {"contacts": "auto", "mu": 0.1, "bodies": {"a": block, "b": block}}
    made += [blocks, blocks | {"bolts": [bolt]}]
    for height in surfaces:
        half = points | {"height": height, "force": path, "displacement": along}
        bodies = {"b": {"rigid": {}}, "a": {"material": "steel", "half_space": half}}
        own = {"materials": "", "steps": ["press", "push"]}
        made += [solve | {"bodies": bodies, "contacts": [pair]} | more for more in ({}, own)]
    return made


def _general(place: Place) -> tuple[str, ...]:
    """The place of a table, with [] for numbers of entries and * for names that users choose."""
    made: list[str] = []
    for part in place:
        named = bool(made) and made[-1] in NAMED
        made.append("[]" if isinstance(part, int) else "*" if named else part)
    return tuple(made)


def _object(place: tuple[str, ...], found: dict[tuple[str, ...], list[Asked]]) -> dict[str, Any]:
    """The schema of a table."""
    asked: dict[str, list[Asked]] = {}
    for one in found.get(place, ()):
        if (*place, "*") not in found or one.key == "stress":
            asked.setdefault(one.key, []).append(one)
    made: dict[str, Any] = {"type": "object", "additionalProperties": False}
    if (*place, "*") in found:
        made["additionalProperties"] = _object((*place, "*"), found)
    if asked:
        made["properties"] = {key: _entry(place, key, own, found) for key, own in asked.items()}
    given = {key for key, own in asked.items() if all(one.needed for one in own)} - {"mu"}
    needed = sorted(given - {axis for own in KINDS.values() for axis in own.components})
    if {"law", "mu"} <= set(asked):
        smooth = {"law": {"enum": [law for law in LAWS if not find_law(law).frictional]}}
        made["anyOf"] = [{"required": ["mu"]}, {"required": ["law"], "properties": smooth}]
    return made | ({"required": needed} if needed else {})


def _entry(
    place: tuple[str, ...], key: str, asked: list[Asked], found: dict[tuple[str, ...], list[Asked]]
) -> dict[str, Any]:
    """The schema of an entry of a table, from all that was asked of it."""
    kinds = list(dict.fromkeys(one.kind for one in asked))
    ways: list[dict[str, Any]] = []
    for kind in kinds:
        way: dict[str, Any] = {"type": TYPES[kind]}
        if kind is dict:
            way = _object((*place, key), found)
        elif kind is list and (*place, key, "[]") in found:
            items = _object((*place, key, "[]"), found)
            way["items"] = {"anyOf": [{"type": "string"}, items]} if key == "steps" else items
        lows = {one.low for one in asked if one.kind is kind}
        if kind is float and min(lows) > -1e300:
            way["exclusiveMinimum"] = min(lows)
        names = _names(place, key, [name for one in asked for name in one.among])
        if kind is str and names:  # a name that this program does not know may be right, too
            way = (
                {"anyOf": [{"enum": names}, way]}
                if key not in ("kind", "law", "carrier")
                else {"enum": names}
            )
        ways.append(way)
    made: dict[str, Any] = ways[0] if len(ways) == 1 else {"anyOf": ways} if ways else {}
    if place == ("solve",):
        made["description"] = OPTIONS[key].what
    usual = next((one.default for one in asked if one.default not in (None, "", [], "scene")), None)
    what = next((one.what for one in asked if one.what), "")
    made |= {"default": usual} if usual is not None else {}
    return made | (
        {"description": short(what, 200)[1:-1]} if what and "description" not in made else {}
    )


def _names(place: tuple[str, ...], key: str, among: list[str]) -> list[str]:
    """The names that an entry takes."""
    known: dict[str, Any] = {
        "material": library(),
        "length": LENGTHS,
        "unit": LENGTHS,
        "stress": STRESSES,
        "coupling": ("auto", *COUPLINGS),
    }
    if place == ("solve",):
        known = {name: NAMES[name] for name in NAMES if name != "scene"}
    return list(dict.fromkeys([*among, *known.get(key, ())]))


FILE = ROOT / "contactopt" / "scenes" / "scene_schema.json"

if __name__ == "__main__":
    FILE.write_text(json.dumps(schema(), indent=1) + "\n")
