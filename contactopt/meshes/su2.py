"""SU2 files (.su2): nodes, elements of first order, and markers as boundaries by their names.

meshio numbers the names of markers, and may give two of them one number. What is not known is
refused with its line. Source: SU2, documentation of version 8, "Mesh file".
"""

from pathlib import Path
from typing import Any

import numpy as np

from contactopt.cards import count as said
from contactopt.errors import Damaged, InputError
from contactopt.meshes.inp_text import text_of

KINDS = {3: ("line", 2), 5: ("triangle", 3), 9: ("quad", 4), 10: ("tetra", 4)}
KINDS |= {12: ("hexahedron", 8), 13: ("wedge", 6), 14: ("pyramid", 5)}


def read_su2(path: Path) -> Any:
    """The mesh of a file with its markers; InputError names a line, else Damaged."""
    import meshio

    text = (line.split("%")[0].strip() for line in text_of(path).splitlines())
    lines = [(number, line) for number, line in enumerate(text, 1) if line][::-1]
    rows: dict[str, list[list[int]]] = {kind: [] for kind, _ in KINDS.values()}
    sets: dict[str, dict[str, list[int]]] = {}
    dim, points, name = 0, np.zeros((0, 3)), ""
    while lines:
        number, line = lines.pop()
        key, sign, value = (word.strip() for word in line.partition("="))
        if not sign:
            raise Damaged(f"line {number} has no '='")
        if key == "MARKER_TAG":
            name = value
        elif key in ("NDIME", "NZONE", "NELEM", "MARKER_ELEMS", "NPOIN"):
            count = int(value.split()[0])
            if key in ("NDIME", "NZONE"):
                if (key == "NZONE" and count > 1) or (key == "NDIME" and dim):
                    raise InputError(f"mesh file '{path}', line {number}: it has several zones.")
                dim = count if key == "NDIME" else dim
                continue
            block = [lines.pop() for _ in range(min(count, len(lines)))]
            if len(block) < count:
                raise Damaged(f"it ends before row {count} of {key}")
            if key == "NPOIN":
                points = np.array([row.split()[:dim] for _, row in block], dtype=float)
                continue
            for at, row in block:
                own, *nodes = map(int, row.split())
                kind, width = KINDS.get(own, ("", 0))
                if not kind or len(nodes) not in (width, width + 1):
                    raise InputError(
                        f"mesh file '{path}', line {at}: elements of type {own} with"
                        f" {said(len(nodes), 'number')} are not read; save it as .msh or .inp."
                    )
                if key == "MARKER_ELEMS":
                    sets.setdefault(name, {}).setdefault(kind, []).append(len(rows[kind]))
                rows[kind].append(nodes[:width])
    cells = [(kind, np.array(own)) for kind, own in rows.items() if own]
    groups = {n: [np.array(own.get(k, ()), dtype=int) for k, _ in cells] for n, own in sets.items()}
    words = {kind: f"{kind} (number {own} of SU2)" for own, (kind, _) in KINDS.items()}
    return meshio.Mesh(points, cells, cell_sets=groups, info=words)
