"""The mesh of a body in a scene file: from a mesh file, or a block, a ring or a disc."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from skfem import Mesh

from contactopt.files.toml_table import Table

# names of units of length -> metres
LENGTHS = {
    "nm": 1e-9, "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3, "in": 0.0254, "ft": 0.3048,
}  # fmt: skip
SHAPES = ("mesh", "block", "ring", "disc")
# distance from the origin over the size of a body, beyond which rounding deforms its elements
FAR = 1e6
MOST_ELEMENTS = 2_000_000  # elements of a structured body


def make_mesh(body: Table, folder: Path | None, components: tuple[str, ...], length: str) -> Any:
    """Make the mesh of scikit-fem that a body's table describes, moved to its place, with its
    boundaries.

    Names of mesh files are relative to the folder. Without one no mesh is made, and the entries are
    only marked as known. The unit of a mesh file is converted to the scene's unit of length.
    """
    group, move, places = body.take("group", str), body.table("move"), body.table("boundaries")
    unit, shapes = body.take("unit", str), [shape for shape in SHAPES if body.has(shape)]
    body.known.append("rigid")
    if folder is None:
        return None
    if len(shapes) != 1:
        raise body.fail(
            "a body needs exactly one of mesh, block, ring, disc, half_space and rigid; this one"
            " has"
            f" {' and '.join(shapes) or 'none'}."
        )
    if shapes[0] == "mesh":
        mesh = _from_file(body, folder, group, scale_of(body, unit, length))
    elif group or unit:
        raise body.fail("'group' and 'unit' belong to a mesh file.", "group" if group else "unit")
    else:
        shape = body.table(shapes[0])
        if shapes[0] != "block" and len(components) != 2:
            raise shape.fail(f"a {shapes[0]} is plane; in space use a block or a mesh file.")
        mesh = {"block": _block, "ring": _ring, "disc": _disc}[shapes[0]](shape, components)
        shape.close()
    if move is not None:
        step = [move.take(c, float, 0.0) for c in components]
        move.close()
        mesh = replace(mesh, doflocs=mesh.doflocs + np.array(step)[:, None])
        if np.abs(mesh.doflocs).max() > FAR * np.ptp(mesh.doflocs, axis=1).min():
            raise body.fail(
                "the body is moved so far that rounding deforms it; keep it nearer to the origin.",
                "move",
            )
    return mesh if places is None else _named(mesh, places, components)


def scale_of(body: Table, unit: str | None, length: str) -> float:
    """The unit of the file in that of the scene."""
    if unit is None:
        return 1.0
    for name, where in (
        (unit, "this body"),
        (length, "the scene (units = { length = ..., stress = ... })"),
    ):
        if name not in LENGTHS:
            raise body.fail(
                f"the unit of length of {where} is {name!r}; to convert it, it must be one of"
                f" {', '.join(LENGTHS)}.",
                "unit",
            )
    return LENGTHS[unit] / LENGTHS[length]


def _from_file(body: Table, folder: Path, group: str | None, scale: float) -> Any:
    from contactopt.meshes.mesh_files import load_mesh

    name = body.take("mesh", str)
    with body.about("group" if group else "mesh"):
        return load_mesh(folder / name, group, scale)


def grid_of(table: Table, key: str, what: str) -> tuple[float, float]:
    """Two ascending numbers, which must be there; a message calls them `what`."""
    low, high = table.numbers(key, 2, what)
    if low >= high:
        raise table.fail(f"{key!r} must ascend; got {low:g} to {high:g}.", key)
    return low, high


def counts_of(
    table: Table, key: str, names: tuple[str, ...], least: int = 1, most: int = MOST_ELEMENTS
) -> tuple[int, ...]:
    """Whole numbers, one for each name, which must be there."""
    counts = table.numbers(key, len(names), f"the numbers of {key} [{', '.join(names)}]")
    whole = all(isinstance(count, int) and count >= least for count in counts)
    if not whole or np.prod(counts, dtype=float) > most:
        raise table.fail(
            f"{key!r} must be whole numbers of at least {least}, at most {most} {key} in all.", key
        )
    return tuple(int(count) for count in counts)


def _block(table: Table, components: tuple[str, ...]) -> Any:
    from contactopt.meshes.structured import tensor_mesh

    sides = [grid_of(table, c, f"two coordinates, [least {c}, largest {c}]") for c in components]
    counts = counts_of(table, "elements", tuple(f"along {c}" for c in components))
    mesh = tensor_mesh(*(np.linspace(*side, count + 1) for side, count in zip(sides, counts)))
    own = {f"{new}{sign}": f"{old}{sign}" for new, old in zip(components, "xyz") for sign in "-+"}
    boundaries = {new: mesh.boundaries[old] for new, old in own.items()}
    return replace(mesh, _boundaries=boundaries)


def _ring(table: Table, components: tuple[str, ...]) -> Any:
    from contactopt.meshes.polar import ring

    radii = grid_of(table, "radii", "two radii, [inner, outer]")
    first, last = 0.0, 360.0
    if table.has("angles", list):
        first, last = grid_of(table, "angles", "two angles in degrees, [first, last]")
    if radii[0] <= 0 or last - first > 360:
        raise table.fail(
            "the inner radius must be positive, and the angles at most 360 degrees apart."
        )
    across, around = counts_of(table, "elements", ("across", "around"))
    if last - first == 360 and around < 3:
        raise table.fail("a whole ring needs at least 3 elements around.", "elements")
    return ring(np.linspace(*radii, across + 1), np.radians(np.linspace(first, last, around + 1)))


def _disc(table: Table, components: tuple[str, ...]) -> Any:
    from contactopt.meshes.polar import disc

    radius = table.take("radius", float, needed=True, low=0.0)
    if isinstance(table.data.get("elements"), list):
        (around,) = counts_of(table, "elements", ("around",))
    else:
        around = table.take("elements", int, needed=True)
    if around < 8 or around % 8 or around > 10_000:
        raise table.fail(
            "'elements' around a disc must be a multiple of 8, at most 10000.", "elements"
        )
    return disc(radius, around // 8)


def _named(mesh: Mesh, places: Table, components: tuple[str, ...]) -> Any:
    """The mesh with the boundaries that are named by where they are."""
    from contactopt.meshes.mesh_files import name_boundaries

    for name in places.data:
        place = places.table(name)
        limits = {}
        for axis, c in enumerate(components):
            there = place.has(c, float, list)
            if isinstance(place.data.get(c), list):
                limits[axis] = grid_of(place, c, f"one {c}, or two, [least, largest]")
            elif there:
                value = place.take(c, float)
                limits[axis] = (value, value)
        place.close()
        with place.about():
            mesh = name_boundaries(mesh, {name: limits})
    return mesh
