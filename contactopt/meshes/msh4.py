"""Gmsh's file formats 4.0 and 4.1 in text.

meshio takes 4.0 for 4.1, and reads neither where some elements belong to no group, as in files that Gmsh writes with the option
Mesh.SaveAll. A file holds sections `$Name ... $EndName`. Entities (points, curves, surfaces, volumes) list the physical groups that
they belong to; nodes and elements come entity by entity.

Source: Gmsh reference manual, versions 4.0 and 4.15, chapter "MSH file format".
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np


def version(path: Path) -> tuple[str | None, bool]:
    """Read the version that a Gmsh file states.

    Parameters
    ----------
    path
        A file of any kind.

    Returns
    -------
    tuple
        The version, such as '4.1', where '4' stands for 4.0, or None if it is no file of Gmsh; and
        whether it is binary.
    """
    with path.open("rb") as file:
        head = file.read(200).decode(errors="replace").split()
    if head[:1] == ["$NOD"]:
        return "1", False
    return (head[1], head[2] != "0") if len(head) > 2 and head[0] == "$MeshFormat" else (None, False)


def read_msh4(path: Path, newer: bool) -> Any:
    """Read a text file of Gmsh of version 4.0 or 4.1.

    Parameters
    ----------
    path
        The file.
    newer
        Whether its version is 4.1.

    Returns
    -------
    meshio.Mesh
        The mesh, with the physical groups as sets of elements by name.

    Raises
    ------
    ValueError, KeyError
        Where the file ends early or does not keep to the format.
    """
    import meshio
    from meshio._common import num_nodes_per_cell
    from meshio.gmsh.common import _gmsh_to_meshio_order, _gmsh_to_meshio_type

    sections = _sections(path)
    groups = _groups(sections.get("Entities", []), _names(sections.get("PhysicalNames", [])), newer)
    tags, points = _nodes(_Numbers(sections["Nodes"]), newer)
    number = {tag: place for place, tag in enumerate(tags)}
    blocks: list[tuple[str, np.ndarray]] = []
    members: list[list[str]] = []
    reader = _Numbers(sections["Elements"])
    for _ in range(reader.head(newer)):
        first, second, kind, count = reader.take(4)
        name = _gmsh_to_meshio_type[kind]
        rows = reader.take(count * (1 + num_nodes_per_cell[name])).reshape(count, -1)[:, 1:]
        nodes = np.array([number[tag] for tag in rows.ravel().tolist()]).reshape(rows.shape)
        blocks.append((name, _gmsh_to_meshio_order(name, nodes)))
        members.append(groups.get((first, second) if newer else (second, first), []))
    sets = {
        group: [np.arange(len(nodes) if group in own else 0) for (_, nodes), own in zip(blocks, members)]
        for group in sorted({group for own in members for group in own})
    }
    return meshio.Mesh(points, blocks, cell_sets=sets)


class _Numbers:
    """The numbers of a section, taken one after the other."""

    def __init__(self, lines: list[str]) -> None:
        self.words, self.place = " ".join(lines).split(), 0

    def words_of(self, count: int) -> list[str]:
        first, self.place = self.place, self.place + count
        if self.place > len(self.words):
            raise ValueError("a section ends early")
        return self.words[first : self.place]

    def take(self, count: int) -> np.ndarray:
        return np.array(self.words_of(count), dtype=float).astype(np.int64)

    def head(self, newer: bool) -> int:
        """The number of entities of a section of nodes or elements; their total, and the range of tags, are passed over."""
        return int(self.take(4 if newer else 2)[0])


def _sections(path: Path) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    name = None
    for line in path.read_text(errors="replace").splitlines():
        if line.startswith("$End"):
            name = None
        elif line.startswith("$"):
            name = line[1:].strip()
            found[name] = []
        elif name is not None:
            found[name].append(line)
    for needed in ("Nodes", "Elements"):
        if needed not in found:
            raise ValueError(f"it has no section ${needed}")
    return found


def _names(lines: list[str]) -> dict[tuple[int, int], str]:
    """(dimension, number) -> name of physical groups."""
    rows = [shlex.split(line) for line in lines[1:] if line.strip()]
    return {(int(dim), int(tag)): name for dim, tag, name in rows}


def _groups(lines: list[str], names: dict[tuple[int, int], str], newer: bool) -> dict[tuple[int, int], list[str]]:
    """(dimension, entity) -> names of the physical groups that it belongs to; a group without a name has its number."""
    found = {}
    if lines:
        reader = _Numbers(lines)
        for dim, count in enumerate(reader.take(4)):
            for _ in range(count):
                entity = int(reader.take(1)[0])
                reader.words_of(3 if newer and dim == 0 else 6)  # its place, or the box around it
                tags = np.abs(reader.take(reader.take(1)[0]))
                found[dim, entity] = [names.get((dim, int(tag)), str(tag)) for tag in tags]
                if dim:
                    reader.words_of(int(reader.take(1)[0]))  # what bounds it
    return found


def _nodes(reader: _Numbers, newer: bool) -> tuple[list[int], np.ndarray]:
    """Numbers of the nodes and their places (n, 3)."""
    tags, points = [], []
    for _ in range(reader.head(newer)):
        first, second, parametric, count = reader.take(4)
        extra = int((first if newer else second) if parametric else 0)  # parameters on the entity
        width = 3 + extra if newer else 4 + extra
        if newer:
            tags += reader.take(count).tolist()
        rows = np.array(reader.words_of(int(count) * width), dtype=float).reshape(count, width)
        if not newer:
            tags += rows[:, 0].astype(np.int64).tolist()
        points.append(rows[:, :3] if newer else rows[:, 1:4])
    return tags, np.concatenate(points) if points else np.zeros((0, 3))
