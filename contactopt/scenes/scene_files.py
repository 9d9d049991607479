"""Scenes from files in TOML: bodies, materials, supports, loads, contacts, and how to solve them.

`contactopt new FILE` writes a commented example (contactopt.scenes.example). A number that
supports, loads and plates prescribe may be an array: its values are those in the states of a load
path, one after the other. Every mistake is named with its line.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.files.toml_table import Table, at_line, change, read_table
from contactopt.problem.laws import LAWS, find_law
from contactopt.run_options import IN_FILES, OPTIONS, TOGETHER
from contactopt.scenes.contact import SIDES, Contact, unread
from contactopt.scenes.facing_boundaries import as_toml, facing_boundaries, usual_distance
from contactopt.scenes.file_bodies import FileContext, bolted, function_of, read_body
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.material_library import Named, library, read_materials
from contactopt.scenes.scene import Scene, check_units

if TYPE_CHECKING:
    from skfem import Mesh

    from contactopt.scenes.body_kinds import Part, Support
    from contactopt.scenes.loads import Load

MOST_STATES = 10_000  # of a step of a load path
AUTO = "auto"  # in place of the contacts: they are found
log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SceneFile:
    """What a scene file says.

    states  the scene, or the states of its load path, which differ in their loads alone
    solve   arguments of contactopt.run: method, tol, accuracy, ...
    name    of the file
    lines   of bodies and contacts by their names, and of what is chosen in [solve] by its value
    """

    states: tuple[Scene, ...]
    solve: dict[str, Any]
    name: str
    lines: dict[str, int | str]

    def located(self, error: InputError) -> InputError:
        """The mistake with the name of the file, and the line of what it names in quotes."""
        line = next((own for name, own in self.lines.items() if f"'{name}'" in str(error)), "")
        return InputError(f"{self.name}{at_line(line)}: {error}")


def read_scene_file(path: str | Path, changes: Mapping[str, Any] | None = None) -> SceneFile:
    """Read a scene file in TOML: the states of the scene, one unless it is a load path, and how
    they are solved. Names of mesh files in it are relative to its folder. InputError with the line
    of the first mistake and what to write instead.

    `changes` are other values of entries by their names, as in contactopt.files.toml_table.change;
    `mu` alone is that of all contacts.
    """
    path = Path(path)

    def table() -> Table:
        read, all_changes = read_table(path), dict(changes or {})
        if "mu" in all_changes and isinstance(read.data.get("contacts"), list):
            mu = all_changes.pop("mu")
            contacts = read.data["contacts"]
            rough = [i for i, own in enumerate(contacts, 1) if _rubs(own)]
            numbers = rough or range(1, len(contacts) + 1)  # where none rubs, the first one says so
            all_changes = {f"contacts.{i}.mu": mu for i in numbers} | all_changes
        return change(read, all_changes)

    states, solve, lines = read_scenes(table, path)
    return SceneFile(states, solve, path.name, lines)


def read_scenes(
    table: Callable[[], Table], path: Path
) -> tuple[tuple[Scene, ...], dict[str, Any], dict[str, int | str]]:
    """As read_scene_file(), from a function that makes the table again: states, options, lines."""
    top = table()
    first, solve, reading = _scene(path, top, None)
    longest = max((length for length, _, _ in reading.lengths), default=1)
    wanted = len(reading.steps) or longest
    for length, at, key in reading.lengths:
        if length not in (1, wanted):
            what = "step" if reading.steps else "state"
            rest = f"the file has {wanted}" if reading.steps else f"other numbers for {wanted}"
            said = f"{key!r} has values for {count(length, what)}, {rest}."
            raise at.fail(said, key)
    total = sum(states for _, states in reading.steps) or longest
    states = [first]
    for state in range(1, total):
        reading.state = state
        states.append(_scene(path, table(), reading)[0])
    where = top.lines.get(("contacts",), "")  # of those that are found
    named = [(one, key) for key, own in solve.items() for one in (own if key == "read" else [own])]
    lines = {one: top.lines.get(("solve", key), where) for one, key in named}
    pairs = enumerate(first.contacts)
    lines |= {pair.name: top.lines.get(("contacts", i), where) for i, pair in pairs}
    known = [own.name for own in first.bodies if ("bodies", own.name) in top.lines]
    lines |= {name: top.lines["bodies", name] for name in known}
    return tuple(states), solve, lines


def _scene(
    path: Path, top: Table, reading: FileContext | None
) -> tuple[Scene, dict[str, Any], FileContext]:
    kind = top.take("kind", str, "plane-strain", among=KINDS)
    units = top.table("units")
    length, stress = "length", "stress"
    if units:
        length, stress = (units.take(key, str, needed=True) for key in ("length", "stress"))
        units.close()
        with units.about():
            check_units((length, stress))
    materials, steps = _materials(top, path.parent), _steps(top)
    reading = reading or FileContext(path.parent, kind, length, stress, steps=steps)
    reading.materials = materials
    bodies = top.table("bodies")
    if bodies is None or not bodies.data:
        raise top.fail("there are no bodies; add a table [bodies.NAME] for each.")
    parts = [read_body(bodies, name, reading) for name in bodies.data]
    parts = bolted(top, parts, reading)
    if isinstance(top.data.get("contacts"), str):
        pairs = _found(top, parts, reading)
    else:
        pairs = top.tables("contacts")
    if not pairs:
        raise top.fail(
            "there are no contacts; add a table [[contacts]]"
            " for each pair of surfaces that may touch."
        )
    changes = {
        "contacts": tuple(_contact(pair, parts, reading) for pair in pairs),
        "thickness": top.take("thickness", float, 1.0, low=0.0),
        "name": top.take("name", str, path.stem),
        "mirror": top.take("mirror", str, "") or None,
        "state": reading.step if steps else "",
    }
    for key, most, valid in (("copies", 1000, "at least 1"), ("degree", 2, "1 or 2")):
        value = top.take(key, int)
        if value is not None and not 1 <= value <= most:
            raise top.fail(f"{key} must be {valid}; got {value}.", key)
        changes |= {} if value is None else {key: value}
    solve = _solve(top.table("solve"))
    top.close(OPTIONS)
    with top.about():
        scene = Scene(kind=kind, units=(length, stress), bodies=tuple(parts), **changes)
    return scene, solve, reading


def _materials(top: Table, folder: Path) -> dict[str, Named]:
    """The library, and the materials of a file or of a table of the scene file."""
    own: Table | None
    if isinstance(top.data.get("materials"), str):
        name = top.take("materials", str)
        with top.about("materials"):
            own = read_table(folder / name, "material file")
    else:
        own = top.table("materials")
    return library() | ({} if own is None else read_materials(own))


def _steps(top: Table) -> tuple[tuple[str, int], ...]:
    """Names and numbers of states of the steps of a load path."""
    given = top.data.get("steps", [])
    if not isinstance(given, list) or all(isinstance(name, str) for name in given):
        found = [(name, 1) for name in top.take("steps", list, [])]
    else:
        found = []
        for step in top.tables("steps"):
            found.append((step.take("name", str, needed=True), step.take("states", int, 1)))
            step.close()
    for i, (name, states) in enumerate(found):
        if not name.strip() or name in [other for other, _ in found[:i]]:
            raise top.fail(f"each step needs a name of its own; got {name!r}.", "steps", i)
        if not 1 <= states <= MOST_STATES:
            valid = f"from 1 to {MOST_STATES}"
            raise top.fail(
                f"the states of step '{name}' must be {valid}; got {states}.", "steps", i
            )
    return tuple(found)


def _found(top: Table, parts: list[Any], reading: FileContext) -> list[Table]:
    """Tables of the pairs of boundaries that face each other, which the log shows as TOML."""
    top.take("contacts", str, among=(AUTO,))
    distance = top.take("distance", float, low=0.0)
    function_of(top, "mu", reading, needed=True)
    for part in parts:
        if not part.meshed:
            raise top.fail(
                f"pairs are found between bodies with meshes alone; '{part.name}' has none, so name"
                " its pairs as tables [[contacts]].",
                "contacts",
            )
    if reading.found is None:
        meshes = {part.name: _free(part) for part in parts}
        reach = usual_distance(meshes) if distance is None else distance
        reading.found = facing_boundaries(meshes, reach)
        within = f"face each other within {reach:.3g} {reading.length}"
        if not reading.found:
            raise top.fail(
                "no boundaries of two bodies, but for those with supports or loads and whole"
                f" surfaces, {within}; give a larger distance, or name the boundaries that may"
                " touch.",
                "contacts",
            )
        toml = as_toml(reading.found, top.data["mu"], reading.length)
        log.warning("pairs that %s; paste those that are right in place of auto\n%s", within, toml)
    pairs = [dict(zip(SIDES, map(":".join, pair.sides))) for pair in reading.found]
    mu = {"mu": top.data["mu"]}
    return [Table(top.file, top.lines, own | mu, ("contacts",)) for own in pairs]


def _free(part: Part) -> Mesh:
    """The mesh with those boundaries that share no facet with those of supports and loads."""
    named = {name: np.asarray(own) for name, own in (part.mesh.boundaries or {}).items()}
    holders: tuple[Support | Load, ...] = (*part.supports, *part.loads)
    used = [named[own.boundary] for own in holders if own.boundary in named]
    taken = np.concatenate([np.zeros(0, dtype=int), *used])
    whole = len(part.mesh.boundary_facets())
    free = {name: own for name, own in named.items() if not np.isin(own, taken).any()}
    parts = {name: own for name, own in free.items() if len(np.unique(own)) < whole}
    return replace(part.mesh, _boundaries=parts or free)


def _contact(table: Table, parts: list[Any], reading: FileContext) -> Contact:
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
        mu = function_of(table, "mu", reading, needed=_rubs(table.data))
    if not _rubs(table.data) and (said := unread(mu, table.data["law"])):
        raise table.fail(said, "mu")
    names: dict[str, Any] = {"law": LAWS, "coupling": (), "carrier": SIDES}
    texts = {key: table.take(key, str, among=known) for key, known in names.items()}
    given: dict[str, Any] = {key: value for key, value in texts.items() if value is not None}
    way = table.table("direction")
    if way is not None:
        given["direction"] = reading.vector(reading.numbers(way, whole=True))
    with table.about():
        upper, lower = (table.take(side, str, needed=True) for side in SIDES)
        made = Contact(upper, lower, mu, **given)
    table.close()
    return made


def _rubs(contact: object) -> bool:
    """Whether the law of a contact needs a coefficient; what is no contact or law is told later."""
    law = contact.get("law") if isinstance(contact, dict) else None
    return not isinstance(law, str) or law not in LAWS or find_law(law).frictional


def _solve(table: Table | None) -> dict[str, Any]:
    """The options of a run that the file gives."""
    found: dict[str, Any] = {}
    if table is None:
        return found
    for key in IN_FILES:
        kind = OPTIONS[key].kind
        limits: dict[str, Any] = {"low": 0.0} if kind is float else {}
        if table.has(key, list if kind is tuple else kind):
            found[key] = table.names(key) if kind is tuple else table.take(key, kind, **limits)
    table.close()
    if ("accuracy" in found) != ("quantity" in found):  # the other options may stand alone here
        raise table.fail(TOGETHER)
    return found
