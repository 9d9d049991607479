"""Exodus II files (.e, .exo, .ex2): element blocks, node sets and side sets, by their names.

meshio needs netCDF4, and loses side sets and the names of blocks. The files are netCDF: of the
classic kind, which scipy reads, or HDF5, which h5py reads. Side k of an element is a face of
contactopt.meshes.inp_elements.FACES, counted from another first one.

Source: L. Schoof and V. Yarberry, EXODUS II: a finite element data model, SAND92-2137.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.errors import Damaged, InputError
from contactopt.meshes.inp_elements import CORNERS, FACES, FACET

# type without its number of nodes -> that number -> type in meshio
TYPES = {
    "TRI": {3: "triangle", 6: "triangle6"},
    "QUA": {4: "quad", 8: "quad8", 9: "quad9"},
    "TET": {4: "tetra", 10: "tetra10"},
    "HEX": {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"},
    "SHE": {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"},
    "WED": {6: "wedge", 15: "wedge"}, "PYR": {5: "pyramid", 13: "pyramid"},
    **{name: {2: "line", 3: "line3"} for name in ("BAR", "BEA", "TRU", "EDG")},
    "SPH": {1: "vertex"}, "CIR": {1: "vertex"},
}  # fmt: skip
# place in FACES of the first side
FIRST = {"tetra": 1, "hexahedron": 2, "wedge": 2, "pyramid": 1}
# nodes of Exodus in the order of meshio: edges along the third axis come last, then faces, centre
HEXAHEDRON = [*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 23, 24, 25, 26, 21, 22, 20]


def read_exodus(path: Path) -> Any:
    """The mesh of a file, with blocks and side sets as sets of elements.

    InputError for elements that are not known; Damaged, KeyError, IndexError or OSError where the
    file does not keep to the format.
    """
    head = path.read_bytes()[:4]
    if head == b"CDF\5":
        raise Damaged("it is of netCDF's fifth format; convert it: nccopy -k nc4 OLD NEW")
    if head[:3] == b"CDF":
        from scipy.io import netcdf_file

        with netcdf_file(path, mmap=False) as file:
            return _mesh(path, file.variables, lambda variable: variable.elem_type)
    try:
        import h5py
    except ImportError as error:
        raise Damaged("it is of HDF5; pip install h5py") from error
    with h5py.File(path) as file:
        return _mesh(path, file, lambda variable: variable.attrs["elem_type"])


def _mesh(path: Path, variables: Mapping[str, Any], type_of: Callable[[Any], bytes | str]) -> Any:
    import meshio

    if "coord" in variables:
        points = np.array(variables["coord"][:], dtype=float).T
    else:
        axes = [f"coord{axis}" for axis in "xyz" if f"coord{axis}" in variables]
        points = np.stack([np.array(variables[axis][:], dtype=float) for axis in axes], axis=1)
    cells: list[tuple[str, np.ndarray]] = []
    sets: dict[str, dict[int, np.ndarray]] = {}
    starts, end, shells, words = [], 0, set[int](), dict[str, str]()
    for name, number in _named(variables, "eb", "connect", "block"):
        variable = variables[f"connect{number}"]
        nodes, text = np.array(variable[:], dtype=np.int64) - 1, type_of(variable)
        text = text if isinstance(text, str) else text.decode(errors="replace")
        kinds = TYPES.get(text[:3].upper(), {})
        starts.append(end)
        end += len(nodes)
        kind = kinds.get(nodes.shape[1], "")
        if not kind:
            word = f"of type {text} with {nodes.shape[1]} nodes"
            raise InputError(f"mesh file '{path}': elements {word}, block {name!r}, are not known.")
        words.setdefault(kind, f"{text} (block {name!r})")
        if kind.startswith("hexahedron"):
            nodes = nodes[:, HEXAHEDRON[: nodes.shape[1]]]
        cells.append((kind, nodes[:, : CORNERS.get(kind)]))
        in_space = kind.startswith("triangle") and points.shape[1] == 3
        shells |= {len(cells) - 1} if in_space or TYPES["SHE"] is kinds else set()
        sets.setdefault(name, {})[len(cells) - 1] = np.arange(len(nodes))
    for name, number in _named(variables, "ss", "elem_ss", "side"):
        elements = np.array(variables[f"elem_ss{number}"][:], dtype=np.int64) - 1
        sides = np.array(variables[f"side_ss{number}"][:], dtype=np.int64) - 1
        own_sets, known = sets.setdefault(name, {}), 0
        for block, start in enumerate(starts):
            kind, nodes = cells[block]
            faces = _sides(kind.rstrip("0123456789"), block in shells)
            own = (elements >= start) & (elements < start + len(nodes))
            for side, corners in enumerate(faces if own.any() else ()):
                facets = nodes[elements[own & (sides == side)] - start][:, list(corners)]
                own_sets[len(cells)] = np.arange(len(facets))
                cells.append((FACET[facets.shape[1]], facets))
                known += len(facets)
        if known < len(elements):
            raise Damaged(f"side set {name!r} names an element or a side that is not known")
    of_cells = {
        name: [own.get(i, np.zeros(0, dtype=int)) for i in range(len(cells))]
        for name, own in sets.items()
    }
    of_points: dict[str, np.ndarray] = {}
    for name, number in _named(variables, "ns", "node_ns", "nodes"):
        own_nodes = np.array(variables[f"node_ns{number}"][:], dtype=np.int64) - 1
        of_points[name] = np.union1d(of_points.get(name, own_nodes), own_nodes)
    return meshio.Mesh(points, cells, cell_sets=of_cells, point_sets=of_points, info=words)


def _sides(kind: str, shell: bool) -> tuple[tuple[int, ...], ...]:
    """The corners of the sides of an element; the first two of a shell are the shell itself."""
    faces = FACES.get(kind, ())
    first = FIRST.get(kind, 0)
    itself = (tuple(range(len(faces))),) * 2
    return (*itself, *faces) if shell else (*faces[first:], *faces[:first])


def _named(variables: Mapping[str, Any], kind: str, key: str, word: str) -> list[tuple[str, int]]:
    """Name and number, from 1, of each block or set; without a name its word and own number."""
    ids = {"eb": "eb_prop1", "ss": "ss_prop1", "ns": "ns_prop1"}[kind]
    found = []
    count = len(variables[ids][:]) if ids in variables else 0
    for number in range(1, count + 1):
        name = ""
        if f"{kind}_names" in variables:
            letters = np.asarray(variables[f"{kind}_names"][number - 1]).astype("S1")
            name = b"".join(letters.tolist()).split(b"\0")[0].decode(errors="replace").strip()
        if f"{key}{number}" in variables:
            found.append((name or f"{word} {variables[ids][number - 1]}", number))
    return found
