"""Gmsh's file formats 2 and 4.1.

meshio does not read them where some elements belong to no group, as in files of format 4.1 that
Gmsh writes with the option Mesh.SaveAll, or have no tags. From damaged binary files it takes counts
as they are and asks for memory without bound; here no count reaches beyond its section. A file
holds sections `$Name ... $EndName`. In format 4.1 entities (points, curves, surfaces, volumes) list
the physical groups that they belong to, and nodes and elements come entity by entity. In format 2
each element has tags, the first of which is its physical group. Results are passed over.

Source: Gmsh reference manual, version 4.15, chapter "MSH file format".
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contactopt.errors import Damaged

HEAD = 2**16  # bytes at the beginning of a file in which comments end and the version stands


def version(path: Path) -> tuple[str | None, bool]:
    """The version that a file of Gmsh states, such as '4.1', or None; whether it is binary."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.split(maxsplit=1)[:1] == [b"$NOD"]:
        return "1", False
    stated = head.partition(b"$MeshFormat")[2][:99].decode(errors="replace").split()
    return (stated[0], stated[1] != "0") if len(stated) > 1 else (None, False)


def read_msh4(path: Path) -> Any:
    """The mesh of a file with physical groups; Damaged or KeyError for a broken format."""
    sections = _sections(path)
    names = _names(sections)
    groups = _groups(sections.get("Entities"), names)
    tags, points = _nodes(sections["Nodes"])
    reader = sections["Elements"]
    blocks: list[tuple[int, np.ndarray]] = []
    members: list[list[str]] = []
    for _ in range(reader.head()):
        dim, entity, kind = reader.take(3).tolist()
        count = reader.count()
        width = 1 + _size_of(kind)[0]
        rows = reader.take(count * width, "u8").reshape(count, width)
        blocks.append((kind, rows[:, 1:]))
        members.append(groups.get((dim, entity), []))
    reader.end()
    sets = {}
    for group in sorted({group for own in members for group in own}):
        sizes = (len(nodes) if group in own else 0 for (_, nodes), own in zip(blocks, members))
        sets[group] = [np.arange(size) for size in sizes]
    return _mesh(points, tags, blocks, sets)


def read_msh2(path: Path) -> Any:
    """The mesh of a file of format 2 in the same way. In text its nodes may have parameters on
    their entities, as the option Mesh.SaveParametric writes them.
    """
    sections = _sections(path)
    names = _names(sections)
    if "Nodes" in sections:
        tags, points = sections["Nodes"].nodes(sections["Nodes"].line())
        sections["Nodes"].end()
    else:
        tags, points = _parametric(sections["ParametricNodes"])
    found: dict[int, list[np.ndarray]] = {}  # the group of each element and its nodes, by kind
    reader = sections["Elements"]
    count = reader.line()
    for kind, own, rows in reader.elements(count):
        group = rows[:, :1] if own else np.zeros((len(rows), 1), dtype=np.int64)
        found.setdefault(kind, []).append(np.hstack([np.abs(group), rows[:, own:]]))
        count -= len(rows)
    if count:
        raise Damaged("a section ends early")
    reader.end()
    table = {kind: np.concatenate(own) for kind, own in found.items()}
    sets: dict[str, list[np.ndarray]] = {}
    for i, (kind, rows) in enumerate(table.items()):
        for tag in np.unique(rows[rows[:, 0] > 0, 0]).tolist():
            name = names.get((_size_of(kind)[1], tag), str(tag))
            none = [np.arange(0) for _ in table]
            parts = sets.setdefault(name, none)  # groups may share a name
            parts[i] = np.append(parts[i], np.flatnonzero(rows[:, 0] == tag))
    return _mesh(points, tags, [(kind, rows[:, 1:]) for kind, rows in table.items()], sets)


def _parametric(reader: _Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Tags (n,) and places (n, 3) of nodes with parameters."""
    if isinstance(reader, _Bytes):
        raise Damaged("it has parametric nodes in binary; save it without Mesh.SaveParametric")
    rows = []
    for _ in range(reader.line()):
        rows.append(reader.take(4, "f8"))
        dim = int(reader.take(2)[0])
        reader.take(dim % 3, "f8")  # none within a volume
    table = np.array(rows).reshape(-1, 4)
    return table[:, 0].astype(np.int64), table[:, 1:]


def _size_of(kind: int) -> tuple[int, int]:
    """Number of nodes and dimension of an element of a kind of Gmsh."""
    from meshio._common import num_nodes_per_cell
    from meshio._mesh import topological_dimension
    from meshio.gmsh.common import _gmsh_to_meshio_type

    name = _gmsh_to_meshio_type[kind]
    return int(num_nodes_per_cell[name]), int(topological_dimension[name])


def _mesh(points: np.ndarray, tags: np.ndarray, blocks: list, sets: dict) -> Any:
    """The mesh of blocks of (kind of Gmsh, tags of the nodes of each element)."""
    import meshio
    from meshio.gmsh.common import _gmsh_to_meshio_order, _gmsh_to_meshio_type

    order = np.argsort(tags, kind="stable")
    twice = np.flatnonzero(np.diff(tags[order]) == 0)
    if (points[order[twice]] != points[order[twice + 1]]).any():
        raise Damaged(f"node {tags[order[twice[0]]]} is there twice")
    cells, words = [], {}
    for kind, rows in blocks:
        place = np.searchsorted(tags, rows, sorter=order)
        if rows.size and (place.max() == len(tags) or (tags[order[place]] != rows).any()):
            raise Damaged("an element names a node that is not there")
        name = _gmsh_to_meshio_type[kind]
        words[name] = f"{name} (number {kind} of Gmsh)"
        cells.append((name, _gmsh_to_meshio_order(name, order[place])))
    return meshio.Mesh(points, cells, cell_sets=sets, info=words)


class _Numbers:
    """The numbers of a section in text, taken one after the other."""

    def __init__(self, data: bytes) -> None:
        self.data, self.words, self.place = data, data.split(), 0

    def take(self, count: int, kind: str = "i4") -> np.ndarray:
        """As many numbers of a kind, integers of 64 or 'f8' of 64 bits."""
        first, self.place = self.place, self.place + count
        if count < 0 or self.place > len(self.words):
            raise Damaged("a section ends early")
        values = np.array(self.words[first : self.place], dtype=float)
        return values if kind == "f8" else values.astype(np.int64)

    def count(self) -> int:
        return int(self.take(1, "u8")[0])

    def line(self) -> int:
        """The number on a line of its own, which is text in binary files, too."""
        return self.count()

    def end(self) -> None:
        """Raise Damaged if numbers are left, which a wrong count passes over."""
        if self.place < len(self.words):
            raise Damaged("a section holds more than it counts")

    def nodes(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Tags (n,) and places (n, 3) of nodes of format 2."""
        rows = self.take(4 * count, "f8").reshape(count, 4)
        return rows[:, 0].astype(np.int64), rows[:, 1:]

    def elements(self, count: int) -> Iterator[tuple[int, int, np.ndarray]]:
        """Kind, number of tags, and the tags and nodes of elements of format 2 that are alike."""
        first = self.place
        flat, size = self.take(len(self.words) - first), 1
        self.place = first
        while count and len(flat) > 2:
            kind, tags = flat[1:3].tolist()
            width = 3 + tags + _size_of(kind)[0]
            rows = flat[: min(count, size, len(flat) // width) * width].reshape(-1, width)
            alike = (rows[:, 1] == kind) & (rows[:, 2] == tags)
            own = len(rows) if alike.all() else int(np.argmin(alike))
            if not own:
                return
            self.place += own * width
            yield kind, tags, rows[:own, 3:]
            flat, count = flat[own * width :], count - own
            size = 2 * size if own == size else 1  # most rows are like the one above

    def head(self) -> int:
        """The number of entities of a section; their total and range of tags are passed over."""
        return int(self.take(4, "u8")[0])


class _Bytes(_Numbers):
    """The same of a section in binary."""

    def __init__(self, data: bytes, order: str) -> None:
        self.data, self.order, self.place = data, order, 0

    def take(self, count: int, kind: str = "i4") -> np.ndarray:
        values = self._of(np.dtype(self.order + kind), count)
        return values.astype(float if kind == "f8" else np.int64)

    def _of(self, dtype: np.dtype, count: int) -> np.ndarray:
        first, self.place = self.place, self.place + count * dtype.itemsize
        if count < 0 or self.place > len(self.data):
            raise Damaged("a section ends early")
        return np.frombuffer(self.data, dtype, count, first)

    def end(self) -> None:
        if self.data[self.place :].strip():
            raise Damaged("a section holds more than it counts")

    def line(self) -> int:
        first, self.place = self.place, self.data.index(b"\n", self.place) + 1
        return int(self.data[first : self.place])

    def nodes(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        dtype = np.dtype([("tag", f"{self.order}i4"), ("place", f"{self.order}f8", 3)])
        rows = self._of(dtype, count)
        return rows["tag"].astype(np.int64), rows["place"].astype(float)

    def elements(self, count: int) -> Iterator[tuple[int, int, np.ndarray]]:
        while count > 0:
            kind, own, tags = self.take(3).tolist()
            width = 1 + tags + _size_of(kind)[0]
            if min(own, tags + 1) < 1:
                return
            yield kind, tags, self.take(own * width).reshape(own, width)[:, 1:]
            count -= own


def _sections(path: Path) -> dict[str, _Numbers]:
    """The sections, from which numbers can be taken."""
    data, binary = path.read_bytes(), version(path)[1]
    data = data[data.index(b"$MeshFormat") :]
    found: dict[str, _Numbers] = {}
    one = data[data.index(b"\n", 12) + 1 :][:4]
    order = ">" if one == b"\0\0\0\1" else "<"
    if binary and data.split(maxsplit=4)[3] != b"8":
        raise Damaged("its numbers are not of eight bytes")
    if b"$PartitionedEntities" in data:
        raise Damaged("it is a partitioned mesh; save it in one piece")
    for name in ("PhysicalNames", "Entities", "ParametricNodes", "Nodes", "Elements"):
        key = f"\n${name}".encode()
        start = data.find(key)
        if start >= 0:
            if data.find(key, start + 1) >= 0:
                raise Damaged(f"it has two sections ${name}")
            start = data.index(b"\n", start + 1) + 1
            end = data.find(f"$End{name}".encode(), start)
            part = data[start : end if end >= 0 else None]
            in_text = name == "PhysicalNames" or not binary
            found[name] = _Numbers(part) if in_text else _Bytes(part, order)
        elif name == "Elements" or (name == "Nodes" and "ParametricNodes" not in found):
            raise Damaged(f"it has no section ${name}")
    return found


def _names(sections: dict[str, _Numbers]) -> dict[tuple[int, int], str]:
    """(dimension, number) -> name of physical groups."""
    data = sections["PhysicalNames"].data if "PhysicalNames" in sections else b""
    lines = data.decode(errors="replace").splitlines()
    rows = [line.split(maxsplit=2) for line in lines[1:] if line.strip()]
    ends = slice(1, -1)  # within quotation marks; others belong to the name
    return {(int(dim), int(tag)): name.strip()[ends] for dim, tag, name in rows}


def _groups(reader: _Numbers | None, names: dict) -> dict[tuple[int, int], list[str]]:
    """(dimension, entity) -> names of its physical groups, or numbers of those without a name."""
    found = {}
    if reader is not None:
        for dim, count in enumerate(reader.take(4, "u8").tolist()):
            for _ in range(count):
                entity = int(reader.take(1)[0])
                reader.take(6 if dim else 3, "f8")  # its place, or the box around it
                tags = np.abs(reader.take(reader.count()))
                found[dim, entity] = [names.get((dim, int(tag)), str(tag)) for tag in tags]
                if dim:
                    reader.take(reader.count())  # what bounds it
    return found


def _nodes(reader: _Numbers) -> tuple[np.ndarray, np.ndarray]:
    """Tags of the nodes (n,) and their places (n, 3)."""
    tags, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _ in range(reader.head()):
        dim, _, parametric = reader.take(3).tolist()
        width = 3 + (dim if parametric else 0)  # parameters on the entity
        count = reader.count()
        tags.append(reader.take(count, "u8"))
        points.append(reader.take(count * width, "f8").reshape(count, width)[:, :3])
    reader.end()
    return np.concatenate(tags), np.concatenate(points)
