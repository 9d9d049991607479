"""Meshes of parts that were drawn in a CAD program: STEP, IGES and BREP files, by Gmsh's kernel.

Each solid is a body, each of its faces a boundary. (Without solids, each face is a body and each
edge a boundary.) A flat face whose outward normal lies along an axis is called by it, as 'z+', a
second one 'z+2'; all others by their kind and a number within their body, as 'cylinder1'. So bodies
may have boundaries of one name, and 'body:name' is one of them.

Source: Gmsh reference manual, version 4.15, chapters "Gmsh API" and "Mesh size fields".
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from contactopt.checks import check_number, meant
from contactopt.defaults import install
from contactopt.errors import InputError
from contactopt.files.writing import quiet

ENDINGS = (".step", ".stp", ".iges", ".igs", ".brep")
SHARE = 15  # usual number of elements along the diagonal of the smallest body
AROUND = 16  # elements around a full circle, where the size does not make them smaller
GRID = (np.arange(15) + 0.5) / 15  # parameters of a face among which a place on it is looked for
FLAT = 1e-5  # a part is plane if it is thinner than this fraction of its size
SAMPLES = 100  # places on a fine edge from which distances are measured
GROWTH = 0.5  # of the size of elements with the distance from a fine edge or point
POINT = re.compile(r"[-+.\de]+(,[-+.\de]+){1,2}", re.IGNORECASE)
Where = tuple[int, list[int]] | np.ndarray  # dimension and entities, or a point (3,)
ALONG = 1 - 1e-9  # component of a normal that lies along an axis


def mesh_part(
    path: Path,
    out: Path,
    size: float | None = None,
    fine: Mapping[str, float] | None = None,
    names: Mapping[str, Sequence[str]] | None = None,
    order: int = 2,
) -> None:
    """Mesh a part, a file that ends in one of ENDINGS, and write a file of Gmsh, lengths in
    millimetres unless the part has no unit.

    Elements have a size, else what gives SHARE of them along the smallest body; `fine` is place ->
    size there [length]: a boundary, an edge where two meet as 'z-/cylinder1' (in the plane a
    corner), curved boundaries by 'radius=2', or a point as '0,0,5'. `names` is new name ->
    boundaries that are called by it, and order 1 makes straight elements, 2 curved ones. InputError
    without Gmsh, for a file that it cannot read or mesh, and for an unknown place.
    """
    for what, value in [("the size of elements", size), *(fine or {}).items()]:
        if value is not None:
            check_number(what, value, low=0.0)
    if not path.is_file():
        raise InputError(f"part '{path}' does not exist.")
    with _kernel() as gmsh:
        try:
            with quiet():  # OpenCASCADE prints what is wrong, too
                gmsh.model.occ.importShapes(str(path))
            gmsh.model.occ.synchronize()
        except Exception as error:  # the class of Gmsh's errors is Exception
            raise InputError(f"part '{path}' cannot be read: {_reason(error)}.") from error
        if not gmsh.model.getEntities():
            raise InputError(f"part '{path}' holds no shapes.")
        box = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
        plane = np.ptp(box[:, 2]) < FLAT * np.ptp(box, axis=0).max()
        if not plane and not gmsh.model.getEntities(3):  # IGES files hold the faces of a solid
            gmsh.model.occ.healShapes(makeSolids=True)
            gmsh.model.occ.synchronize()
        dim = 2 if plane else 3
        bodies = _bodies(gmsh, dim)
        if not bodies:
            raise InputError(f"part '{path}' holds no solids, nor faces in the plane of x and y.")
        sides = {
            f"{body}:{name}": tag
            for body, own in bodies.items()
            for name, tag in _sides(gmsh, dim, own).items()
        }
        new = {
            name: [tag for old in own for tag in _called(sides, old, path)]
            for name, own in (names or {}).items()
        }
        at = [(_place(gmsh, dim, sides, new, n, path), s) for n, s in (fine or {}).items()]
        _sizes(gmsh, dim, bodies.values(), size, at)
        _groups(gmsh, dim, bodies, sides, new)
        try:
            gmsh.model.mesh.generate(dim)
            if order == 2:
                gmsh.model.mesh.setOrder(2)
                gmsh.model.mesh.optimize("HighOrder")
            gmsh.write(str(out))
        except Exception as error:
            elements = gmsh.model.mesh.getElements
            bare = [name for name, tag in sides.items() if not elements(dim - 1, tag)[1]]
            how = f"No element fits on {', '.join(bare)}: mend it, or try" if bare else "Try"
            raise InputError(
                f"part '{path}' cannot be meshed ({_reason(error)}). {how} smaller elements."
            ) from error


def _reason(error: Exception) -> str:
    """What Gmsh says of a fault, which may be nothing."""
    said = " ".join(str(error).split()).rstrip(".")
    vague = not said or "unknown error" in said.lower() or "last error" in said.lower()
    return "Gmsh gives no reason" if vague else said


@contextmanager
def _kernel() -> Iterator[Any]:
    """Gmsh, silent, with a model of its own."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: a library of the system is missing
        raise InputError(f"this needs Gmsh ({error}); {install('mesh')}.") from error
    begun = not gmsh.isInitialized()
    if begun:
        gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("part")
    try:
        yield gmsh
    finally:
        gmsh.model.remove()
        if begun:
            gmsh.finalize()


def _bodies(gmsh: ModuleType, dim: int) -> dict[str, int]:
    """Name -> entity of each body. Names are those of the file, if they are fit for one."""
    found: dict[str, int] = {}
    for _, tag in gmsh.model.getEntities(dim):
        label = gmsh.model.getEntityName(dim, tag).rpartition("/")[2]
        name = label if re.fullmatch(r"[A-Za-z][\w-]*", label) else f"body{len(found) + 1}"
        found[name if name not in found else f"{name}-{len(found) + 1}"] = tag
    return found


def _sides(gmsh: ModuleType, dim: int, body: int) -> dict[str, int]:
    """Name -> entity of the faces, or edges, of a body."""
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    for _, tag in gmsh.model.getBoundary([(dim, body)], oriented=False):
        kind = gmsh.model.getType(dim - 1, tag).lower().replace(" ", "-")
        way = _direction(gmsh, dim, body, tag) if kind in ("plane", "line") else ""
        name = way or kind
        counts[name] = counts.get(name, 0) + 1
        found[way if way and counts[way] == 1 else f"{name}{counts[name]}"] = tag
    return found


def _direction(gmsh: ModuleType, dim: int, body: int, tag: int) -> str:
    """The axis along which the outward normal of a flat side lies, as 'z+', or ''."""
    low, high = (np.array(ends) for ends in gmsh.model.getParametrizationBounds(dim - 1, tag))
    grid = np.stack(np.meshgrid(*([GRID] * (dim - 1)))).reshape(dim - 1, -1).T
    places = low + grid * (high - low)
    here = next((p for p in places if gmsh.model.isInside(dim - 1, tag, p, parametric=True)), None)
    if here is None:
        return ""
    x = np.array(gmsh.model.getValue(dim - 1, tag, here))
    if dim == 3:
        normal = np.array(gmsh.model.getNormal(tag, here))
    else:
        normal = np.cross(gmsh.model.getDerivative(1, tag, here), [0.0, 0.0, 1.0])
        normal /= np.linalg.norm(normal)
    axis = int(np.argmax(np.abs(normal)))
    if abs(normal[axis]) < ALONG:
        return ""
    step = 1e-5 * np.ptp(np.reshape(gmsh.model.getBoundingBox(dim, body), (2, 3)), axis=0).max()
    outward = normal[axis] * (-1 if gmsh.model.isInside(dim, body, x + step * normal) else 1)
    return "xyz"[axis] + ("+" if outward > 0 else "-")


def _called(sides: Mapping[str, int], name: str, path: Path) -> list[int]:
    """The entities of a name, with the body's name before it or of all bodies."""
    found = [tag for key, tag in sides.items() if name in (key, key.partition(":")[2])]
    if not found:
        raise InputError(
            f"part '{path}' has no boundary {name!r}; it has {', '.join(sides)}"
            + meant(name, [*sides, *(key.partition(":")[2] for key in sides)])
        )
    return found


def _place(
    gmsh: ModuleType,
    dim: int,
    sides: Mapping[str, int],
    new: Mapping[str, list[int]],
    name: str,
    path: Path,
) -> Where:
    """The dimension and the entities of a place where elements shall be fine, or a point (3,)."""
    if POINT.fullmatch(name):
        try:
            x = np.array([*map(float, name.split(",")), 0.0][:3])
        except ValueError as error:
            raise InputError(f"a point is given as X,Y,Z, as in 0,0,5; got {name!r}.") from error
        low, high = np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3))
        if np.any((x < low) | (x > high)):
            raise InputError(f"the point {name} lies outside of part '{path}'.")
        return x
    kind, sign, asked = name.partition("=")
    if kind == "radius" and sign:
        radii = {tag: radius for tag in sides.values() if (radius := _radius(gmsh, dim, tag))}
        found = [tag for tag, own in radii.items() if f"{own:.3g}" == f"{_number(asked):.3g}"]
        if not found:
            there = ", ".join(sorted({f"{own:.3g}" for own in radii.values()}, key=float))
            raise InputError(
                f"part '{path}' has no boundary of radius {asked}; its radii are {there or 'none'}."
            )
        return dim - 1, found
    both = [new.get(own) or _called(sides, own, path) for own in name.split("/")]
    if len(both) == 1:
        return dim - 1, both[0]
    rims = [
        {
            tag
            for side in own
            for _, tag in gmsh.model.getBoundary([(dim - 1, side)], oriented=False)
        }
        for own in both
    ]
    if not (shared := sorted(set.intersection(*rims))):
        raise InputError(f"the boundaries {' and '.join(name.split('/'))} do not meet.")
    return dim - 2, shared


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"a radius is a number, as in radius=2; got {text!r}.") from error


def _radius(gmsh: ModuleType, dim: int, tag: int) -> float:
    """The smallest radius of curvature in the middle of a side, 0 where it is flat."""
    low, high = gmsh.model.getParametrizationBounds(dim - 1, tag)
    curvature = abs(gmsh.model.getCurvature(dim - 1, tag, (np.array(low) + high) / 2)[0])
    return 1 / curvature if curvature > 0 else 0.0


def _sizes(
    gmsh: ModuleType,
    dim: int,
    bodies: Iterable[int],
    size: float | None,
    fine: Iterable[tuple[Where, float]],
) -> None:
    """Sizes of elements; they grow from fine places into the bodies."""
    boxes = [np.reshape(gmsh.model.getBoundingBox(dim, tag), (2, 3)) for tag in bodies]
    usual = min(float(np.linalg.norm(high - low)) for low, high in boxes) / SHARE
    gmsh.option.setNumber("Mesh.MeshSizeMax", usual if size is None else size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", AROUND)
    field, found = gmsh.model.mesh.field, []
    for place, value in fine:
        law = field.add("MathEval")
        found.append(law)
        if isinstance(place, np.ndarray):
            away = "+".join(f"({c}-({x:.12g}))^2" for c, x in zip("xyz", place))
            field.setString(law, "F", f"{value:.12g}+{GROWTH}*Sqrt({away})")
            continue
        below, tags = place
        inside = field.add("Restrict" if below == dim - 1 else "Distance")
        field.setNumbers(inside, ("PointsList", "CurvesList", "SurfacesList")[below], tags)
        if below == dim - 1:
            field.setString(law, "F", f"{value:.12g}")
            field.setNumber(inside, "InField", law)
            found[-1] = inside
        else:
            field.setNumber(inside, "Sampling", SAMPLES)
            field.setString(law, "F", f"{value:.12g}+{GROWTH}*F{inside}")
    if found:
        least = field.add("Min")
        field.setNumbers(least, "FieldsList", found)
        field.setAsBackgroundMesh(least)


def _groups(
    gmsh: ModuleType,
    dim: int,
    bodies: Mapping[str, int],
    sides: Mapping[str, int],
    names: Mapping[str, list[int]],
) -> None:
    """Physical groups: bodies, and sides by their new names or their own."""
    for name, tag in bodies.items():
        gmsh.model.addPhysicalGroup(dim, [tag], name=name)
    called: dict[str, list[int]] = {new: list(dict.fromkeys(own)) for new, own in names.items()}
    renamed = {tag for own in called.values() for tag in own}
    for key, tag in sides.items():
        if tag not in renamed:
            called.setdefault(key.partition(":")[2], []).append(tag)
    for name, tags in called.items():
        gmsh.model.addPhysicalGroup(dim - 1, tags, name=name)
