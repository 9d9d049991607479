"""Types of elements of CalculiX and Abaqus: their shape, their nodes, and their numbered sides.

The nodes of solids and of plane elements come in the order of meshio. Wedges and pyramids, of which
no body can be, keep their corners alone. Sources: CalculiX CrunchiX user's manual, version 2.22,
chapters "Element types" and "*SURFACE"; Abaqus user's manual, "Element library".
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from contactopt.meshes.cells import alone
from contactopt.meshes.inp_text import LARGEST, Block, set_of

if TYPE_CHECKING:
    from contactopt.meshes.inp import Scope

PLANE = {
    "3": ("triangle", 3), "6": ("triangle6", 6),
    "4": ("quad", 4), "8": ("quad8", 8), "9": ("quad9", 9),
}  # fmt: skip
SOLID = {
    "4": ("tetra", 4), "10": ("tetra10", 10), "8": ("hexahedron", 8), "20": ("hexahedron20", 20),
    "27": ("hexahedron27", 27),
    "6": ("wedge", 6), "15": ("wedge", 15), "5": ("pyramid", 5), "13": ("pyramid", 13),
}  # fmt: skip
CORNERS = {"wedge": 6, "pyramid": 5}
LINE, LINE3 = ("line", 2), ("line3", 3)
POINT = {"": ("", 0)}
# pattern of a type with its number of nodes -> family, and shape by that number
FAMILIES = (
    (r"D?C3D(\d+)(?!V|\d)", "solid", SOLID),
    (r"(?:SC|CSS)(\d)", "solid", SOLID),
    (r"(?:CPEG|CPE|CPS|CGAX|CAX|DC2D|DCAX)(\d)", "plane", PLANE),
    (r"(?:M3D|R3D|SFM3D|STRI|DS|S)(\d)", "shell", PLANE),
    (r"(?:T[23]D|R2D|RAX)(\d)", "line", {"2": LINE, "3": LINE3}),
    (r"(?:SAX|MAX|PIPE[23]|B[23])([123])", "line", {"1": LINE, "2": LINE3, "3": LINE}),
    (
        r"()(?:SPRING|DASHPOT|MASS|ROTARYI|HEATCAP|GAP|CONN|DCOUP|DISTRIBUTING|JOINT|ITS|DRAG"
        r"|RB[23]D|D$)",
        "point",
        POINT,
    ),
)
# corners of the numbered sides, by the shape of the element up to its order
FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "hexahedron": (
        *((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1)),
        *((1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    ),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
}
FACET = {2: "line", 3: "triangle", 4: "quad"}


def _fit(named: str) -> tuple[str, str, int]:
    """Family, shape in meshio and number of nodes. ValueError for a type that is not known."""
    for pattern, family, shapes in FAMILIES:
        found = re.match(pattern, named)
        if found and found[1] in shapes:
            return family, *shapes[found[1]]
    raise ValueError(f"elements of type {named[:40]} are not known")


def kind_of(named: str) -> tuple[str, int]:
    """Shape in meshio and number of nodes of a type; '' of one without an extent."""
    return _fit(named)[1:]


def dimension(named: str) -> int:
    """Dimension of the elements of a type."""
    return {"solid": 3, "plane": 2, "shell": 2, "line": 1, "point": 0}[_fit(named)[0]]


def words_of(scope: Scope) -> dict[str, str]:
    """Shape in meshio -> the type of its first elements in the file, and their line."""
    found: dict[str, str] = {}
    for place, (kind, _, _, where) in enumerate(scope.blocks):
        if where:
            block, line = where[0]
            at = block.source.named(line)[1]
            found.setdefault(kind, f"{scope.types[place]} (line {at})")
    return found


def side_of(named: str, label: str, dim: int) -> tuple[tuple[int, ...], ...] | None:
    """The corners of the facets that a label means, in a file whose bodies have a dimension. None
    where it means none. Without a label it means all sides of an element of a body. What is thinner
    than the surface of a body has none of its facets.
    """
    family, kind, _ = _fit(named)
    faces = FACES.get(kind.rstrip("0123456789"), ())
    itself = (tuple(range(len(faces))) if family != "line" else (0, 1),)
    if dimension(named) < dim - 1:
        return ()
    if dimension(named) == dim - 1:  # a skin of a body
        both = ("S1", "S2") if family == "shell" else ("SP", "SN")
        return itself if label in ("", "SPOS", "SNEG", *both) else None
    if not label:
        return faces
    number = re.fullmatch(r"[SE](\d)", label)
    if number is None or (label[0] == "E" and family != "shell"):
        return None
    first = int(number[1]) - 1 - 2 * (family == "shell" and label[0] == "S")
    return faces[first : first + 1] or None if first >= 0 else None


def facets(scope: Scope) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Blocks of facets that stand for the surfaces, whose numbers are new."""
    made = []
    most = max(dimension(named) for named in scope.types.values())
    new = 1 + max(scope.elements)
    for name, rows in scope.surfaces.items():
        for members, label, block, line in rows:
            for number in members:
                if number not in scope.elements:
                    word = f"element {number % LARGEST}"
                    raise block.fail(f"surface '{name}' names {word}, which is not there", line)
            sides = _sides(scope, members, label, block, line, most)
            for corners in sides if label else _free(sides):
                ids = new + np.arange(len(corners))
                made.append((FACET[corners.shape[1]], corners, ids))
                set_of(scope.element_sets, name).update(dict.fromkeys(ids.tolist()))
                new += len(corners)
    return made


def _sides(
    scope: Scope, members: Iterable[int], label: str, block: Block, line: int, dim: int
) -> list[np.ndarray]:
    """Corners of the sides of elements that a row of a surface means."""
    found = []
    for place, (_, nodes, ids, _) in enumerate(scope.blocks):
        own = nodes[np.flatnonzero(np.isin(ids, np.fromiter(members, np.int64)))]
        sides = side_of(scope.types[place], label, dim) if len(own) else ()
        if sides is None:
            what = label or "that could be meant"
            raise block.fail(f"an element {scope.types[place]} has no side {what}", line)
        found += [own[:, list(side)] for side in sides]
    return found


def _free(sides: list[np.ndarray]) -> list[np.ndarray]:
    """Those sides that belong to one element alone, by their number of corners."""
    made = []
    for width in {own.shape[1] for own in sides}:
        corners = np.concatenate([own for own in sides if own.shape[1] == width])
        made.append(corners[alone(corners)])
    return made
