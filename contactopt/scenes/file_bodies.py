"""The bodies of a scene file: what each is made of, what holds and loads it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh

from contactopt.files.toml_table import Table
from contactopt.scenes.body_shapes import make_mesh
from contactopt.scenes.expressions import Expression
from contactopt.scenes.facing_boundaries import Facing
from contactopt.scenes.file_surfaces import half_space_shape
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.loads import load_classes
from contactopt.scenes.loads.bolt import Bolt, with_bolts
from contactopt.scenes.loads.load import Given
from contactopt.scenes.material_library import Named, material_of
from contactopt.scenes.scene import HalfSpace, Part, Rigid, Support


@dataclass
class FileContext:
    """What readers of the parts of a file share.

    stress     name of the unit of stress
    state      of the load path whose numbers are taken
    lengths    of the arrays of such numbers that were found, with the place of each
    meshes     by the name of the body, and points of half-spaces: read once for all states
    steps      of the load path by name, with the number of states of each; none: every number of an
               array is that of a state
    materials  by name
    found      pairs of boundaries that face each other, looked for once for all states
    """

    folder: Path
    kind: str
    length: str
    stress: str
    state: int = 0
    lengths: list[tuple[int, Table, str]] = field(default_factory=list)
    meshes: dict[str, Any] = field(default_factory=dict)
    steps: tuple[tuple[str, int], ...] = ()
    materials: dict[str, Named] = field(default_factory=dict)
    found: list[Facing] | None = None

    def at_state(self, values: list[float]) -> float:
        """The number of the present state, grown from that at the end of the last step."""
        if not self.steps or len(values) == 1:
            return values[min(self.state, len(values) - 1)]
        left = self.state
        for before, value, (_, states) in zip([0.0, *values], values, self.steps):
            if left < states:
                return before + (value - before) * (left + 1) / states
            left -= states
        return values[-1]

    @property
    def step(self) -> str:
        """The name of the step of the present state."""
        return [name for name, states in self.steps for _ in range(states)][self.state]

    @property
    def components(self) -> tuple[str, ...]:
        return KINDS[self.kind].components

    def vector(self, values: dict[str, float]) -> tuple[float, ...]:
        """Numbers of components with zeros for the others."""
        return tuple(values.get(c, 0.0) for c in self.components)

    def numbers(
        self, table: Table, whole: bool = False, keys: tuple[str, ...] = ()
    ) -> dict[str, float]:
        """The present numbers of `keys` in a table; `whole`: it holds no others."""
        found = {}
        for key in keys or self.components:
            there = table.has(key, float, list)
            if isinstance(table.data.get(key), list):
                what = "a number, or an array of the numbers in the states of a load path"
                values = table.numbers(key, None, what)
                if not values:
                    raise table.fail(
                        f"{key!r} is an empty array; give a number for every state of the load"
                        " path.",
                        key,
                    )
                if self.state == 0:
                    self.lengths.append((len(values), table, key))
                found[key] = self.at_state(values)
            elif there:
                found[key] = table.take(key, float)
        if whole:
            table.close()
        return found


def read_body(bodies: Table, name: str, reading: FileContext) -> Part | Rigid | HalfSpace:
    """The body of a name in the table of bodies, in the present state."""
    body = bodies.table(name)
    rigid = body.table("rigid")
    if rigid is not None:
        body.close()
        with rigid.about():
            return _rigid(name, rigid, reading)
    if body.has("half_space", dict):
        return _half_space(name, body, reading)
    folder = None if name in reading.meshes else reading.folder
    made_mesh = make_mesh(body, folder, reading.components, reading.length)
    mesh = reading.meshes.setdefault(name, made_mesh)
    made = material_of(body, reading.materials, reading.stress)
    supports = tuple(_support(table, mesh, reading) for table in body.tables("supports"))
    loads = []
    for key, kind in load_classes().items():
        for table in filter(None, [body.table(key)]) if kind.single else body.tables(key):
            boundary = "" if kind.single else _boundary(table, "boundary", mesh)
            loads.append(kind.read(Given(table, boundary, reading)))
            table.close()
    contact = body.take("contact", str, "contact")
    if body.has("contact"):
        _boundary(body, "contact", mesh)
    curve = _curve(body.table("curve"), reading)
    body.close()
    with body.about():
        return Part(name, mesh, made, supports, tuple(loads), contact, curve)


def bolted(top: Table, parts: list[Any], reading: FileContext) -> list[Any]:
    """The bodies with the bolts of the file."""
    bolts: list[Bolt] = []
    for table in top.tables("bolts"):
        what = 'two faces, as in ["upper.top", "lower.bottom"]'
        between = table.take("between", list, needed=True, what=what)
        force, way = reading.numbers(table, keys=("force",)), table.table("direction")
        if not force:
            raise table.fail("a bolt needs its force, as in force = 20e3.")
        name, tilting = table.take("name", str, ""), table.take("tilting", bool, True)
        axis = None if way is None else reading.vector(reading.numbers(way, whole=True))
        table.close()
        with table.about():
            bolts.append(Bolt(tuple(between), force["force"], name, tilting, axis))
            meshes = {part.name: part.mesh for part in parts if part.meshed}
            for body, end in bolts[-1].ends(parts, f"bolt{len(bolts)}"):
                _named(table, "between", end.boundary, meshes[body], f"body '{body}'")
    return list(with_bolts(parts, bolts)) if bolts else parts


def _half_space(name: str, body: Table, reading: FileContext) -> HalfSpace:
    made = material_of(body, reading.materials, reading.stress)
    table = body.table("half_space")
    body.close()
    axes = reading.components[:-1]
    if name not in reading.meshes:
        reading.meshes[name] = half_space_shape(table, reading.folder, axes, reading.length)
    table.known += ["points", "height", "periodic", "depth", *axes]
    motions = _motions(table, reading)
    table.close()
    with body.about():
        return HalfSpace(name, made, **reading.meshes[name], **motions)


def _motions(table: Table, reading: FileContext) -> dict[str, Any]:
    """The total force and the displacement of a body that moves as a whole."""
    given = {key: table.table(key) for key in ("force", "displacement")}
    return {
        key: None if own is None else reading.numbers(own, whole=True) for key, own in given.items()
    }


def _rigid(name: str, table: Table, reading: FileContext) -> Rigid:
    normal, motions = table.table("normal"), _motions(table, reading)
    values = None if normal is None else reading.numbers(normal, whole=True)
    if values is not None and not any(values.values()):
        raise table.fail(
            "the normal is zero; give the direction that points out of the rigid body.", "normal"
        )
    gap = function_of(table, "gap", reading)
    table.close()
    return Rigid(
        name,
        None if values is None else reading.vector(values),
        (lambda x: np.full(x.shape[1], gap)) if isinstance(gap, (int, float)) else gap,
        **motions,
    )


def _support(table: Table, mesh: Mesh, reading: FileContext) -> Support:
    what = 'a boundary, or those that meet in an edge or a point, as in "a/b"'
    name = table.take("boundary", str, needed=True, what=what)
    made = Support(name, reading.numbers(table) or None)
    table.close()
    for face in made.faces(mesh.boundaries or {}):
        _named(table, "boundary", face, mesh, "the body")
    return made


def _boundary(table: Table, key: str, mesh: Mesh) -> str:
    return _named(table, key, table.take(key, str, needed=True), mesh, "the body")


def _named(table: Table, key: str, name: str, mesh: Mesh, body: str) -> str:
    """The name of a boundary of a mesh."""
    known = mesh.boundaries or {}
    if name not in known:
        raise table.fail(
            f"{body} has no boundary {name!r}; it has {', '.join(sorted(known)) or 'none'}.", key
        )
    return name


def _curve(table: Table | None, reading: FileContext) -> Callable[[np.ndarray], np.ndarray] | None:
    """Projection on the circle or sphere around a centre; with fewer components, on a cylinder."""
    if table is None:
        return None
    radius, place = table.take("radius", float, needed=True, low=0.0), table.table("centre")
    centre = dict.fromkeys(reading.components, 0.0)
    if place is not None:
        centre = reading.numbers(place, whole=True)
    table.close()
    axes = [reading.components.index(c) for c in centre]
    middle = np.array(list(centre.values()))[:, None]

    def project(x: np.ndarray) -> np.ndarray:
        out = np.array(x, dtype=float)
        away = out[axes] - middle
        out[axes] = middle + radius * away / np.linalg.norm(away, axis=0)
        return out

    return project


def function_of(table: Table, key: str, reading: FileContext, needed: bool = False) -> Any:
    """A number, or a function of the place from an expression; None if there is none."""
    what = 'a number, or a text like "0.3 + 0.1 * x"'
    table.has(key, float, str)
    if isinstance(table.data.get(key), str):
        with table.about(key):
            return Expression(table.take(key, str, needed=needed), reading.components)
    return table.take(key, float, needed=needed, what=what)
