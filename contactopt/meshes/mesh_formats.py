"""What a mesh file holds: nodes, elements, and the names of their groups, whatever its format.

meshio reads the file. Formats keep groups in different ways: names of physical groups with a number
for every element (Gmsh), sets of elements and of nodes by name (Abaqus), numbers alone (VTK, Medit,
SU2, Nastran). Here all are names; a group without a name has its number as name.
"""

import contextlib
import io
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.errors import Damaged, InputError
from contactopt.meshes.bulk_data import is_bulk_data, read_bulk_data
from contactopt.meshes.cad import ENDINGS
from contactopt.meshes.exodus import read_exodus
from contactopt.meshes.inp import read_inp
from contactopt.meshes.med import read_med
from contactopt.meshes.medit import read_medit
from contactopt.meshes.msh import read_msh2, read_msh4, version
from contactopt.meshes.su2 import read_su2

MOST_BYTES = 4_000_000_000  # bytes: a larger file holds more than can be solved
# arrays of integers per element whose numbers are groups; those of others are named 'array=number'
TAGS = (
    *("gmsh:physical", "medit:ref", "nastran:ref"),
    *("avsucd:material", "flac3d:group", "netgen:index"),
)
# formats whose readers end on damaged text; others may not
SAFE = ("gmsh", "vtu", "vtk", "abaqus", "xdmf", "medit", "nastran", "med", "netgen", "avsucd")
# formats of which meshio loses names or sets -> our reader
OWN: dict[str, Callable[[Path], Any]] = {
    "abaqus": read_inp,
    "exodus": read_exodus,
    "med": read_med,
    "medit": read_medit,
    "nastran": read_bulk_data,
    "su2": read_su2,
}
PATIENCE = 30.0, 1e-4  # seconds that any other reader gets, and more per byte
WORK = 4.0, 1e-5  # seconds of the processor that it gets: some never end on a file that ends early
MEMORY = 4_000_000_000, 50  # bytes that such a reader gets, and more per byte
CHILD = """import contextlib, pickle, sys, meshio
with contextlib.suppress(ImportError):  # not on Windows
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]), int(sys.argv[3])))
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[4]), int(sys.argv[4]) + 1))
with contextlib.redirect_stdout(sys.stderr):
    mesh = meshio.read(sys.argv[1], file_format=sys.argv[2])
pickle.dump(mesh, sys.stdout.buffer)"""


@dataclass(frozen=True, eq=False)
class FileGroups:
    """The contents of a mesh file.

    points      (n, 2 or 3) coordinates in the unit of the file
    blocks      (type in meshio, nodes (e, v), dimension) of each block of elements
    members     (name, dimension) -> for each block the numbers of those elements that belong to the
                group
    point_sets  name -> nodes
    words       type in meshio -> what the file calls it, and where, if that is known
    """

    points: np.ndarray
    blocks: tuple[tuple[str, np.ndarray, int], ...]
    members: Mapping[tuple[str, int], Mapping[int, np.ndarray]]
    point_sets: Mapping[str, np.ndarray]
    words: Mapping[str, str]

    def names(self, dim: int) -> list[str]:
        """Names of the groups of elements of a dimension."""
        return [name for name, dims in self.members if dims == dim]


def read_groups(path: Path) -> FileGroups:
    """Nodes, elements by their kind, and the groups of elements and of nodes by their names, of a
    file in any format that meshio reads. InputError in one sentence, whatever is wrong with it.
    """
    mesh = _read(path)
    blocks = tuple((block.type, np.asarray(block.data), int(block.dim)) for block in mesh.cells)
    if not any(len(nodes) for _, nodes, _ in blocks) or np.ndim(mesh.points) != 2:
        raise InputError(f"mesh file '{path}': it holds no elements, or no nodes.")
    for kind, nodes, _ in blocks:
        if nodes.size and (nodes.min() < 0 or nodes.max() >= len(mesh.points)):
            raise InputError(f"mesh file '{path}': a {kind} names a node that is not there.")
    members: dict[tuple[str, int], dict[int, np.ndarray]] = {}

    def add(name: str, i: int, elements: np.ndarray) -> None:
        group = members.setdefault((name, blocks[i][2]), {})
        group[i] = np.union1d(group.get(i, elements), elements)

    for name, sets in mesh.cell_sets.items():
        for i, found in enumerate(() if name.startswith("gmsh:") else sets):
            if found is not None and len(found):
                found = np.asarray(found)
                add(name, i, np.flatnonzero(found) if found.dtype == bool else found.astype(int))
    # names of physical groups with their numbers and dimensions; other data are passed over
    numbered = {k: value for k, value in mesh.field_data.items() if np.shape(value) == (2,)}
    named = {(int(tag), int(dim)): name for name, (tag, dim) in numbered.items()}
    for key, arrays in mesh.cell_data.items():
        for i, array in enumerate(arrays):
            values = np.asarray(array)
            values = values[:, 0] if values.shape[1:] == (1,) else values
            if key == "gmsh:geometrical" or values.dtype.kind not in "iu" or values.ndim != 1:
                continue
            for tag in np.unique(values):
                own = [f"{tag}" if key in TAGS else f"{key}={tag}"]
                if key == "gmsh:physical":
                    own = [named.get((int(tag), blocks[i][2]), own[0])]
                for name in own if tag != 0 or key not in TAGS else ():
                    add(name, i, np.flatnonzero(values == tag))
    sets = {name: np.asarray(nodes, dtype=int) for name, nodes in mesh.point_sets.items()}
    named_by = [(name, found, "a node", len(mesh.points)) for name, found in sets.items()]
    for (name, _), parts in members.items():
        named_by += [(name, own, "an element", len(blocks[i][1])) for i, own in parts.items()]
    for name, found, what, size in named_by:
        if found.size and (found.min() < 0 or found.max() >= size):
            raise InputError(
                f"mesh file '{path}': the set {name!r} names {what} that is not there."
            )
    return FileGroups(np.asarray(mesh.points), blocks, members, sets, mesh.info or {})


def _read(path: Path) -> Any:
    """The mesh of meshio."""
    import meshio

    if not path.is_file():
        what = "is no file that can be read" if path.exists() else "does not exist"
        raise InputError(f"mesh file '{path}' {'is a folder' if path.is_dir() else what}.")
    size = path.stat().st_size
    if not 0 < size < MOST_BYTES:
        raise InputError(
            f"mesh file '{path}' has {size} bytes; a mesh"
            f" that can be solved has 1 to {MOST_BYTES:.0e}."
        )
    endings = ["".join(path.suffixes[-n:]).lower() for n in range(len(path.suffixes), 0, -1)]
    formats = [name for ending in endings for name in meshio.extension_to_filetypes.get(ending, ())]
    if path.suffix.lower() == ".dat" and is_bulk_data(path):
        formats = ["nastran"]
    if not formats:
        what = "it is a part of a CAD program, of which `contactopt mesh` makes a mesh"
        if path.suffix.lower() not in ENDINGS:
            what = "its ending names no format of meshio; use .msh, .vtu or .inp, for example"
        raise InputError(f"mesh file '{path}': {what}.")
    said = ""
    for reader in _readers(path, formats, size):
        printed = io.StringIO()
        try:  # on a damaged file readers raise anything, print what is wrong, and end the process
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(io.StringIO()):
                return reader()
        except InputError:  # it names what it does not read
            raise
        except (Exception, SystemExit) as error:
            said = said or _words(error, printed.getvalue())
    advice = "; save Gmsh files as text in version 4.1 or 2.2" if "gmsh" in formats else ""
    raise InputError(
        f"mesh file '{path}' cannot be read as {' or '.join(formats)} ({said}); it is damaged or of"
        f" another format{advice}."
    )


def _words(error: BaseException, printed: str) -> str:
    """What a reader found, without the words of Python."""
    import meshio

    text = ""
    if isinstance(error, Damaged | meshio.ReadError):
        text = str(error).partition("Error: Couldn't read file")[0]
    elif isinstance(error, SystemExit):
        text = printed
    elif isinstance(error, KeyError):
        text = f"{error} in it is not known"
    return " ".join(text.split())[:200] or "a number or a word is not where it belongs"


def _readers(path: Path, formats: list[str], size: int) -> Iterator[Callable[[], Any]]:
    """The reader of each attempt."""
    import meshio

    stated = version(path)[0] if "gmsh" in formats else None
    if stated is not None:
        if stated != "4.1" and stated.partition(".")[0] != "2":
            raise InputError(
                f"mesh file '{path}' is of version {stated} of"
                " Gmsh's format; save it in version 4.1 or 2.2."
            )
        yield partial(read_msh4 if stated == "4.1" else read_msh2, path)
        return
    for name in sorted(formats, key=lambda name: name not in SAFE):
        if name in OWN and path.suffix != ".meshb":
            yield partial(OWN[name], path)
        elif name in SAFE:
            yield partial(meshio.read, path, file_format=name)
        else:
            yield partial(_read_apart, path, name, size)


def _read_apart(path: Path, name: str, size: int) -> Any:
    """The mesh, read by a process that is stopped if it takes too long."""
    memory, patience, work = (first + more * size for first, more in (MEMORY, PATIENCE, WORK))
    limits = str(int(memory)), str(int(work))
    command = [sys.executable, "-c", CHILD, str(path), name, *limits]
    try:
        done = subprocess.run(command, capture_output=True, timeout=patience, check=False)
    except subprocess.TimeoutExpired as error:
        raise Damaged(f"no end after {patience:.0f} s") from error
    if done.returncode < 0:  # stopped by the system
        raise Damaged(f"no end after {work:.0f} s")
    if done.returncode:
        _, found, said = done.stderr.decode(errors="replace").rpartition("ReadError: ")
        raise Damaged(said if found else "")  # without it there are words of Python only
    return pickle.loads(done.stdout)
