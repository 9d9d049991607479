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

from contactopt.errors import InputError
from contactopt.files.toml_table import Table, read_table
from contactopt.material import Material
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

# texts, as for contactopt.run
SOLVE = ("method", "normal", "tangential", "preconditioner", "Q", "solver", "quantity")

BOUNDS = ("tol", "accuracy", "time_limit", "max_memory")  # positive numbers, as for contactopt.run


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
        """Tell where in the file a mistake is.

        Parameters
        ----------
        error : An error that may name a body or contact.

        Returns
        -------
        The error with the name of the file, and with the line of the body or contact that it names.
        """
        for name, line in self.lines.items():
            if f"'{name}'" in str(error):
                return InputError(f"{self.name}, line {line}: {error}")
        return InputError(f"{self.name}: {error}")


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
    """Read a scene file.

    Parameters
    ----------
    path : A TOML file. The names of mesh files in it are relative to its folder.

    Returns
    -------
    The states of the scene, one unless it is a load path, and how they are solved.

    Raises
    ------
    InputError : With the line of the first mistake and what to write instead.
    """
    path = Path(path)
    table = read_table(path)
    first, solve, reading = _scene(path, table, None)
    count = max((length for length, _, _ in reading.lengths), default=1)
    for length, at, key in reading.lengths:
        if length not in (1, count):
            raise at.fail(
                f"{key!r} has values for {length} states of the load path, other numbers for"
                f" {count}.",
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
    kind = top.text("kind", "plane-strain")
    if kind not in COMPONENTS:
        raise top.fail(f"there is no kind {kind!r}; choose from {', '.join(COMPONENTS)}.", "kind")
    units = top.table("units")
    length, stress = (
        (units.text(key, needed=True) for key in ("length", "stress"))
        if units
        else ("length", "stress")
    )
    if units:
        units.close()
    reading = reading or _Reading(path.parent, kind, length)
    bodies = top.table("bodies")
    if bodies is None or not bodies.data:
        raise top.fail("there are no bodies; add a table [bodies.NAME] for each.")
    parts = [_body(bodies, name, reading) for name in bodies.data]
    pairs = top.tables("contacts")
    if not pairs:
        raise top.fail(
            "there are no contacts; add a table [[contacts]] for each pair of surfaces that may"
            " touch."
        )
    contacts = tuple(_contact(pair, parts, reading) for pair in pairs)
    curved = any(
        isinstance(part, Part) and part.mesh.p.shape[1] != part.mesh.nvertices for part in parts
    )
    changes = {
        "thickness": top.number("thickness", 1.0, low=0.0),
        "name": top.text("name", path.stem),
    }
    for key, usual in (("copies", 1), ("degree", 2 if curved else 1)):
        changes[key] = top.take(key, int, "a whole number", usual)
        if not 1 <= changes[key] <= (2 if key == "degree" else 1000):
            raise top.fail(
                f"{key} must be {'1 or 2' if key == 'degree' else 'at least 1'}; got"
                f" {changes[key]}.",
                key,
            )
    changes["mirror"] = top.text("mirror", "") or None
    solve = _solve(top.table("solve"))
    top.close()
    with top.about():
        scene = Scene(
            kind=kind, units=(length, stress), bodies=tuple(parts), contacts=contacts, **changes
        )
    return scene, solve, reading


def _body(bodies: Table, name: str, reading: _Reading) -> Part | Rigid:
    body = bodies.table(name)
    assert body is not None
    rigid = body.table("rigid")
    if rigid is not None:
        body.close()
        with rigid.about():
            return _rigid(name, rigid, reading)
    if name not in reading.meshes:
        reading.meshes[name] = make_mesh(body, reading.folder, reading.components, reading.length)
    else:
        make_mesh(body, None, reading.components, reading.length)
    mesh = reading.meshes[name]
    material = body.table("material")
    if material is None:
        raise body.fail(f"body '{name}' has no material; add material = {{ E = ..., nu = ... }}.")
    with material.about():
        made = Material(material.number("E", needed=True), material.number("nu", needed=True))
    material.close()
    supports = tuple(_support(table, mesh, reading) for table in body.tables("supports"))
    loads: list[Any] = [_traction(table, mesh, reading) for table in body.tables("tractions")]
    loads += [_plate(table, mesh, reading) for table in body.tables("plates")]
    force = body.table("body_force")
    if force is not None:
        values = _components(force, reading)
        force.close()
        loads.append(BodyForce(tuple(values.get(c, 0.0) for c in reading.components)))
    contact = body.text("contact", "contact")
    if body.has("contact"):
        _boundary(body, "contact", mesh)
    curve = _curve(body.table("curve"), reading)
    body.close()
    with body.about():
        return Part(name, mesh, made, supports, tuple(loads), contact, curve)


def _rigid(name: str, table: Table, reading: _Reading) -> Rigid:
    normal, force = table.table("normal"), table.table("force")
    values = None if normal is None else _components(normal, reading)
    if values is not None and not any(values.values()):
        raise table.fail(
            "the normal is zero; give the direction that points out of the rigid body.", "normal"
        )
    gap = _function(table, "gap", reading)
    table.close()
    return Rigid(
        name,
        None if values is None else tuple(values.get(c, 0.0) for c in reading.components),
        (lambda x: np.full(x.shape[1], gap)) if isinstance(gap, (int, float)) else gap,
        None if force is None else _components(force, reading, whole=True),
    )


def _support(table: Table, mesh: Any, reading: _Reading) -> Support:
    boundary = _boundary(table, "boundary", mesh)
    values = _components(table, reading)
    table.close()
    return Support(boundary, values or None)


def _traction(table: Table, mesh: Any, reading: _Reading) -> Traction:
    boundary = _boundary(table, "boundary", mesh)
    values = _components(table, reading)
    if not values:
        raise table.fail(
            f"a traction needs a value for at least one of {', '.join(reading.components)}."
        )
    table.close()
    return Traction(boundary, tuple(values.get(c, 0.0) for c in reading.components))


def _plate(table: Table, mesh: Any, reading: _Reading) -> Plate:
    boundary = _boundary(table, "boundary", mesh)
    force = table.table("force")
    if force is None:
        raise table.fail(
            f"a plate needs force = {{ {reading.components[-1]} = ... }}: the total force on the"
            " whole body."
        )
    glued = table.take("glued", bool, "true or false", True)
    table.close()
    return Plate(boundary, _components(force, reading, whole=True), glued)


def _components(table: Table, reading: _Reading, whole: bool = False) -> dict[str, float]:
    """The numbers that a table holds for components, each of the present state; `whole`: it holds
    nothing else.
    """
    found = {}
    for key in reading.components:
        if isinstance(table.data.get(key), list):
            values = table.numbers(
                key, None, "a number, or an array of the numbers in the states of a load path"
            )
            if not values:
                raise table.fail(
                    f"{key!r} is an empty array; give a number for every state of the load path.",
                    key,
                )
            if reading.state == 0:
                reading.lengths.append((len(values), table, key))
            found[key] = values[min(reading.state, len(values) - 1)]
        elif table.has(key):
            found[key] = table.number(key)
    if whole:
        table.close()
    return found


def _boundary(table: Table, key: str, mesh: Any) -> str:
    name = table.text(key, needed=True)
    known = mesh.boundaries or {}
    if name not in known:
        raise table.fail(
            f"the body has no boundary {name!r}; it has {', '.join(sorted(known)) or 'none'}.", key
        )
    return str(name)


def _curve(table: Table | None, reading: _Reading) -> Callable[[np.ndarray], np.ndarray] | None:
    """Projection on the circle or sphere around a centre, or, with fewer components, on a cylinder."""
    if table is None:
        return None
    radius, place = table.number("radius", needed=True, low=0.0), table.table("centre")
    centre = (
        dict.fromkeys(reading.components, 0.0)
        if place is None
        else _components(place, reading, whole=True)
    )
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
    value = table.take(
        key, (int, float, str), 'a number, or a text like "0.3 + 0.1 * x"', needed=needed
    )
    if isinstance(value, str):
        with table.about(key):
            return Expression(value, reading.components)
    return table.number(key)


def _contact(table: Table, parts: list[Part | Rigid], reading: _Reading) -> Contact:
    named = {part.name: part for part in parts}
    for side in ("upper", "lower"):
        body, _, surface = table.text(side, needed=True).partition(":")
        if body not in named:
            raise table.fail(f"there is no body '{body}'; the bodies are {', '.join(named)}.", side)
        part = named[body]
        if isinstance(part, Part):
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
    texts = {key: table.text(key) for key in ("law", "coupling", "carrier")}
    given: dict[str, Any] = {key: value for key, value in texts.items() if value is not None}
    way = table.table("direction")
    if way is not None:
        values = _components(way, reading, whole=True)
        given["direction"] = tuple(values.get(c, 0.0) for c in reading.components)
    with table.about():
        made = Contact(table.text("upper"), table.text("lower"), mu, **given)
    table.close()
    return made


def _solve(table: Table | None) -> dict[str, Any]:
    if table is None:
        return {}
    found = {key: table.text(key) for key in SOLVE} | {
        key: table.number(key, low=0.0) for key in BOUNDS
    }
    found["max_unknowns"] = table.take("max_unknowns", int, "a whole number")
    found["adaptive"] = table.take("adaptive", bool, "true or false")
    if (found["accuracy"] is None) != (found["quantity"] is None):
        raise table.fail(
            "'accuracy' and 'quantity' belong together: the bound, and the name of what it bounds."
        )
    table.close()
    return {key: value for key, value in found.items() if value is not None}


def with_degree(file: SceneFile, changes: dict[str, Any]) -> tuple[Scene, ...]:
    """Give the states of a scene file another degree of the displacement.

    Parameters
    ----------
    file : The scene file.
    changes : {'degree': 1 or 2}, or nothing.

    Returns
    -------
    The states with the changes.

    Raises
    ------
    InputError : For any other change: a scene file says everything itself.
    """
    for key in changes:
        if key != "degree":
            raise InputError(
                f"a scene file says everything itself; change {key!r} there, or give the degree"
                " alone."
            )
    return tuple(replace(state, **changes) for state in file.states)
