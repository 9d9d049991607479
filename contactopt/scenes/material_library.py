"""Materials by their names: the library materials.toml, and files of the same form that users
write.
"""

from pathlib import Path
from typing import NamedTuple

from contactopt.checks import meant
from contactopt.files.toml_table import Table, read_table
from contactopt.material import Material

LIBRARY = Path(__file__).with_name("materials.toml")
# names of units of stress -> pascals
STRESSES = {
    "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5,
    "psi": 6894.757293, "ksi": 6894757.293,
}  # fmt: skip


class Named(NamedTuple):
    """A material with a name. Its modulus E is in a unit of stress, or, if this is None, in that of
    the scene.
    """

    E: float
    nu: float
    stress: str | None
    source: str


def read_materials(table: Table) -> dict[str, Named]:
    """The materials of a table: [NAME] E, nu and source, and `stress`, the unit of all E."""
    stress = table.take("stress", str, among=STRESSES)
    found = {}
    for name in table.data:
        if name == "stress":
            continue
        own = table.table(name)
        E, nu = (own.take(key, float, needed=True) for key in ("E", "nu"))
        found[name] = Named(E, nu, stress, own.take("source", str, ""))
        own.close()
        with own.about():
            Material(E, nu)
    table.close()
    return found


def library() -> dict[str, Named]:
    """The materials that have a name without being given one."""
    return read_materials(read_table(LIBRARY, "material file"))


def material_of(body: Table, own: dict[str, Named], stress: str) -> Material:
    """The material of a body's table: E and nu, or a name; E in the scene's unit of stress."""
    if not isinstance(body.data.get("material"), str):
        given = body.table("material")
        if given is None:
            raise body.fail(
                f"body '{body.place[-1]}' has no material; add material = {{ E = ..., nu = ... }},"
                f" or the name of one: {', '.join(own)}."
            )
        with given.about():
            made = Material(*(given.take(key, float, needed=True) for key in ("E", "nu")))
        given.close()
        return made
    name = body.take("material", str)
    if name not in own:
        known = f"there is no material {name!r}; the names are {', '.join(own)}"
        raise body.fail(known + meant(name, own), "material")
    E, nu, unit, _ = own[name]
    if unit is None:
        return Material(E, nu)
    if stress not in STRESSES:
        raise body.fail(
            f"E of {name!r} is in {unit}, but the scene's unit of stress is {stress!r}; give"
            f" units = {{ length = ..., stress = ... }} with one of {', '.join(STRESSES)}.",
            "material",
        )
    return Material(float(f"{E * STRESSES[unit] / STRESSES[stress]:.12g}"), nu)
