"""Medit files in text (.mesh): vertices, and elements of first order with their references.

The format is free: keywords and numbers may stand on any lines. meshio wants lines of its own, and
skips sections that it does not know. Here a section is passed over where no mesh depends on it, and
refused otherwise. Source: Frey (2001), MEDIT: an interactive mesh visualization software, INRIA
technical report 253; libMeshb, list of keywords.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.errors import Damaged, InputError

KINDS = {
    "edges": ("line", 2), "triangles": ("triangle", 3), "quadrilaterals": ("quad", 4),
    "tetrahedra": ("tetra", 4), "hexahedra": ("hexahedron", 8), "hexaedra": ("hexahedron", 8),
    "prisms": ("wedge", 6), "pyramids": ("pyramid", 5),
}  # fmt: skip
HARMLESS = re.compile(
    r"(meshversionformatted|corners|ridges|required|normal|tangent|anglesofcornerbound|angleofcorner"
    r"|boundingbox|identifier|geometry|subdomain|i?solat|dsolat|hosolat|iterations|time|comments"
    r"|periodic|[id]refgroups|privatetable|fault|(vertex|vertices|edges?|triangles?"
    r"|quadrilaterals?)on|end)"
)
WORD = re.compile(r"(?<![\w.])[A-Za-z]{2,}\w*")  # not the exponent of a number


def read_medit(path: Path) -> Any:
    """The mesh of a file with its references; InputError names a line, else Damaged."""
    import meshio

    text = re.sub(r'#.*|"[^"\n]*"', "", path.read_text("latin-1"))
    words = [*WORD.finditer(text)]
    if not words or words[0][0].lower() != "meshversionformatted":
        raise Damaged("it does not begin with MeshVersionFormatted")
    dim, points = 0, np.zeros((0, 0))
    cells: list[tuple[str, np.ndarray]] = []
    references: list[np.ndarray] = []
    for word, after in zip(words, [*(other.start() for other in words[1:]), len(text)]):
        name, body = word[0].lower(), text[word.end() : after].split()
        if name == "dimension":
            dim = int(_table(word[0], ["1", *body], 1)[0, 0])
        elif name == "vertices":
            if dim not in (2, 3):
                raise Damaged("Dimension 2 or 3 must stand before Vertices")
            points = _table(word[0], body, dim + 1)[:, :-1]
        elif name in KINDS:
            kind, width = KINDS[name]
            rows = _table(word[0], body, width + 1).astype(np.int64)
            cells.append((kind, rows[:, :-1] - 1))
            references.append(rows[:, -1])
        elif not HARMLESS.match(name):
            line = text.count("\n", 0, word.start()) + 1
            said = f"mesh file '{path}', line {line}: {word[0]} are not read from this format"
            raise InputError(f"{said}; save it as .msh or .inp.")
    if not len(points):
        raise Damaged("it has no vertices")
    called = {kind: f"{kind} ({name.title()} of Medit)" for name, (kind, _) in KINDS.items()}
    return meshio.Mesh(points, cells, cell_data={"medit:ref": references}, info=called)


def _table(name: str, body: list[str], width: int) -> np.ndarray:
    """The rows (n, width) of a section, whose first number says how many there are."""
    numbers = np.array(body, dtype=float)
    count = int(numbers[0]) if len(numbers) else 0
    if len(numbers) != 1 + count * width:
        raise Damaged(
            f"{name}: {count} times {width} numbers are announced, and {len(numbers) - 1} are there"
        )
    return numbers[1:].reshape(count, width)
