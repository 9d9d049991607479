"""Scenes from files in TOML: bodies, materials, supports, loads, contacts, and how to solve them.

`contactopt new FILE` writes a commented example (contactopt.scenes.example). A number that
supports, loads and plates prescribe may be an array: its values are those in the states of a load
path, one after the other. Every mistake is named with its line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.checks import meant
from contactopt.errors import InputError
from contactopt.files.toml_table import Table, read_table
from contactopt.material import Material
from contactopt.run_options import IN_FILES, OPTIONS, TOGETHER
from contactopt.scenes.body_shapes import make_mesh
from contactopt.scenes.contact import Contact
from contactopt.scenes.expressions import Expression
from contactopt.scenes.scene import (
    COMPONENTS,
    BodyForce,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
)


@dataclass(frozen=True)
class SceneFile:
    """What a scene file says.

    states  the scene, or the states of its load path, which differ in their loads alone
    solve   arguments of contactopt.run: method, tol, accuracy, ...
    name    of the file
    lines   of bodies and contacts by their names
    """

    states: tuple[Scene, ...]
    solve: dict[str, Any]
    name: str
    lines: dict[str, int]

    def located(self, error: InputError) -> InputError:
        """The mistake with the name of the file, and the line of the body or contact in it."""
        for name, line in self.lines.items():
            if f"'{name}'" in str(error):
                return InputError(f"{self.name}, line {line}: {error}")
        return InputError(f"{self.name}: {error}")

    def changed(self, changes: dict[str, Any]) -> tuple[Scene, ...]:
        """Give the states another degree of the displacement, {'degree': 1 or 2}. InputError for
        any other change: a scene file says everything itself.
        """
        for key in changes:
            if key != "degree":
                raise InputError(
                    f"a scene file says everything itself; change {key!r} there, or give the"
                    f" degree alone{meant(key, OPTIONS)}"
                )
        return tuple(replace(state, **changes) for state in self.states)


@dataclass
class _Reading:
    """What readers of the parts of a file share.

    state    of the load path whose numbers are taken
    lengths  of the arrays of such numbers that were found, with the place of each
    meshes   by the name of the body: read once for all states
    """

    folder: Path
    kind: str
    length: str
    state: int = 0
    lengths: list[tuple[int, Table, str]] = field(default_factory=list)
    meshes: dict[str, Any] = field(default_factory=dict)

    @property
    def components(self) -> tuple[str, ...]:
        return COMPONENTS[self.kind]


def read_scene_file(path: str | Path) -> SceneFile:
    """Read a scene file in TOML: the states of the scene, one unless it is a load path, and how
    they are solved. Names of mesh files in it are relative to its folder. InputError with the line
    of the first mistake and what to write instead.
    """
    path = Path(path)
    table = read_table(path)
    first, solve, reading = _scene(path, table, None)
    count = max((length for length, _, _ in reading.lengths), default=1)
    for length, at, key in reading.lengths:
        if length not in (1, count):
            raise at.fail(
                f"{key!r} has values for {length} states of"
                f" the load path, other numbers for {count}.",
                key,
            )
    states = [first]
    for state in range(1, count):
        reading.state = state
        states.append(_scene(path, read_table(path), reading)[0])
    if count > 1 and "accuracy" in solve:
        raise table.fail(
            "an accuracy can be asked for only without a load path.", "solve", "accuracy"
        )
    lines = {pair.name: table.lines["contacts", i] for i, pair in enumerate(first.contacts)}
    lines |= {part.name: table.lines["bodies", part.name] for part in first.bodies}
    return SceneFile(tuple(states), solve, path.name, lines)


def _scene(
    path: Path, top: Table, reading: _Reading | None
) -> tuple[Scene, dict[str, Any], _Reading]:
    kind = top.take("kind", str, "plane-strain")
    if kind not in COMPONENTS:
        raise top.fail(f"there is no kind {kind!r}; choose from {', '.join(COMPONENTS)}.", "kind")
    units = top.table("units")
    length, stress = "length", "stress"
    if units:
        length, stress = (units.take(key, str, needed=True) for key in ("length", "stress"))
        units.close()
    reading = reading or _Reading(path.parent, kind, length)
    bodies = top.table("bodies")
    if bodies is None or not bodies.data:
        raise top.fail("there are no bodies; add a table [bodies.NAME] for each.")
    parts = [_body(bodies, name, reading) for name in bodies.data]
    pairs = top.tables("contacts")
    if not pairs:
        raise top.fail(
            "there are no contacts; add a table [[contacts]]"
            " for each pair of surfaces that may touch."
        )
    meshes = reading.meshes.values()
    curved = any(mesh.p.shape[1] != mesh.nvertices for mesh in meshes)
    changes = {
        "contacts": tuple(_contact(pair, parts, reading) for pair in pairs),
        "thickness": top.take("thickness", float, 1.0, low=0.0),
        "name": top.take("name", str, path.stem),
        "mirror": top.take("mirror", str, "") or None,
    }
    for key, usual, most, valid in (
        ("copies", 1, 1000, "at least 1"),
        ("degree", 2 if curved else 1, 2, "1 or 2"),
    ):
        changes[key] = top.take(key, int, usual)
        if not 1 <= changes[key] <= most:
            raise top.fail(f"{key} must be {valid}; got {changes[key]}.", key)
    solve = _solve(top.table("solve"))
    top.close()
    with top.about():
        scene = Scene(kind=kind, units=(length, stress), bodies=tuple(parts), **changes)
    return scene, solve, reading


def _body(bodies: Table, name: str, reading: _Reading) -> Part | Rigid:
    body = bodies.table(name)
    rigid = body.table("rigid")
    if rigid is not None:
        body.close()
        with rigid.about():
            return _rigid(name, rigid, reading)
    folder = None if name in reading.meshes else reading.folder
    made_mesh = make_mesh(body, folder, reading.components, reading.length)
    mesh = reading.meshes.setdefault(name, made_mesh)
    material = body.table("material")
    if material is None:
        raise body.fail(f"body '{name}' has no material; add material = {{ E = ..., nu = ... }}.")
    with material.about():
        made = Material(*(material.take(key, float, needed=True) for key in ("E", "nu")))
    material.close()
    supports = tuple(_support(table, mesh, reading) for table in body.tables("supports"))
    loads: list[Any] = [_traction(table, mesh, reading) for table in body.tables("tractions")]
    loads += [_plate(table, mesh, reading) for table in body.tables("plates")]
    force = body.table("body_force")
    if force is not None:
        loads.append(BodyForce(_vector(_components(force, reading, whole=True), reading)))
    contact = body.take("contact", str, "contact")
    if body.has("contact"):
        _boundary(body, "contact", mesh)
    curve = _curve(body.table("curve"), reading)
    body.close()
    with body.about():
        return Part(name, mesh, made, supports, tuple(loads), contact, curve)


def _rigid(name: str, table: Table, reading: _Reading) -> Rigid:
    normal, force = table.table("normal"), table.table("force")
    values = None if normal is None else _components(normal, reading, whole=True)
    if values is not None and not any(values.values()):
        raise table.fail(
            "the normal is zero; give the direction that points out of the rigid body.", "normal"
        )
    gap = _function(table, "gap", reading)
    table.close()
    return Rigid(
        name,
        None if values is None else _vector(values, reading),
        (lambda x: np.full(x.shape[1], gap)) if isinstance(gap, (int, float)) else gap,
        None if force is None else _components(force, reading, whole=True),
    )


def _support(table: Table, mesh: Any, reading: _Reading) -> Support:
    boundary, values = _boundary(table, "boundary", mesh), _components(table, reading)
    table.close()
    return Support(boundary, values or None)


def _traction(table: Table, mesh: Any, reading: _Reading) -> Traction:
    boundary, values = _boundary(table, "boundary", mesh), _components(table, reading)
    if not values:
        raise table.fail(
            f"a traction needs a value for at least one of {', '.join(reading.components)}."
        )
    table.close()
    return Traction(boundary, _vector(values, reading))


def _plate(table: Table, mesh: Any, reading: _Reading) -> Plate:
    boundary, force = _boundary(table, "boundary", mesh), table.table("force")
    if force is None:
        raise table.fail(
            f"a plate needs force = {{ {reading.components[-1]} = ... }}: the total force on the"
            " whole body."
        )
    glued = table.take("glued", bool, True)
    table.close()
    return Plate(boundary, _components(force, reading, whole=True), glued)


def _vector(values: dict[str, float], reading: _Reading) -> tuple[float, ...]:
    return tuple(values.get(c, 0.0) for c in reading.components)


def _components(table: Table, reading: _Reading, whole: bool = False) -> dict[str, float]:
    """The numbers of components in a table, of the present state; `whole`: it holds no others."""
    found = {}
    for key in reading.components:
        if isinstance(table.data.get(key), list):
            what = "a number, or an array of the numbers in the states of a load path"
            values = table.numbers(key, None, what)
            if not values:
                raise table.fail(
                    f"{key!r} is an empty array; give a number for every state of the load path.",
                    key,
                )
            if reading.state == 0:
                reading.lengths.append((len(values), table, key))
            found[key] = values[min(reading.state, len(values) - 1)]
        elif table.has(key):
            found[key] = table.take(key, float)
    if whole:
        table.close()
    return found


def _boundary(table: Table, key: str, mesh: Any) -> str:
    name = table.take(key, str, needed=True)
    known = mesh.boundaries or {}
    if name not in known:
        raise table.fail(
            f"the body has no boundary {name!r}; it has {', '.join(sorted(known)) or 'none'}.", key
        )
    return str(name)


def _curve(table: Table | None, reading: _Reading) -> Callable[[np.ndarray], np.ndarray] | None:
    """Projection on the circle or sphere around a centre; with fewer components, on a cylinder."""
    if table is None:
        return None
    radius, place = table.take("radius", float, needed=True, low=0.0), table.table("centre")
    centre = dict.fromkeys(reading.components, 0.0)
    if place is not None:
        centre = _components(place, reading, whole=True)
    table.close()
    axes = [reading.components.index(c) for c in centre]
    middle = np.array(list(centre.values()))[:, None]

    def project(x: np.ndarray) -> np.ndarray:
        out = np.array(x, dtype=float)
        away = out[axes] - middle
        out[axes] = middle + radius * away / np.linalg.norm(away, axis=0)
        return out

    return project


def _function(table: Table, key: str, reading: _Reading, needed: bool = False) -> Any:
    """A number, or a function of the place from an expression; None if there is none."""
    what = 'a number, or a text like "0.3 + 0.1 * x"'
    if isinstance(table.data.get(key), str):
        with table.about(key):
            return Expression(table.take(key, str), reading.components)
    return table.take(key, float, needed=needed, what=what)


def _contact(table: Table, parts: list[Part | Rigid], reading: _Reading) -> Contact:
    named = {part.name: part for part in parts}
    for side in ("upper", "lower"):
        body, _, surface = table.take(side, str, needed=True).partition(":")
        if body not in named:
            raise table.fail(f"there is no body '{body}'; the bodies are {', '.join(named)}.", side)
        part: Any = named[body]
        if part.meshed:
            boundaries = part.mesh.boundaries or {}
            if (surface or part.contact) not in boundaries:
                raise table.fail(
                    f"body '{body}' has no boundary {surface or part.contact!r}; name its surface"
                    f" as '{body}:NAME', one of {', '.join(sorted(boundaries)) or 'none'}.",
                    side,
                )
    if isinstance(table.data.get("mu"), list):
        mu: Any = tuple(table.numbers("mu", 2, "a number, or two: along and across a direction"))
    else:
        mu = _function(table, "mu", reading, needed=True)
    texts = {key: table.take(key, str) for key in ("law", "coupling", "carrier")}
    given: dict[str, Any] = {key: value for key, value in texts.items() if value is not None}
    way = table.table("direction")
    if way is not None:
        values = _components(way, reading, whole=True)
        given["direction"] = tuple(values.get(c, 0.0) for c in reading.components)
    with table.about():
        made = Contact(table.take("upper", str), table.take("lower", str), mu, **given)
    table.close()
    return made


def _solve(table: Table | None) -> dict[str, Any]:
    """The options of a run that the file gives."""
    found: dict[str, Any] = {}
    if table is None:
        return found
    for key in IN_FILES:
        kind = OPTIONS[key].metadata["kind"]
        limits: dict[str, Any] = {"low": 0.0} if kind is float else {}
        if table.has(key):
            found[key] = table.take(key, kind, **limits)
    table.close()
    if ("accuracy" in found) != ("quantity" in found):  # the other options may stand alone here
        raise table.fail(TOGETHER)
    return found
