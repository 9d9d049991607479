"""MED files (.med) of Salome and Code_Aster: nodes, elements, and their groups by name.

meshio refuses files in which a type of element has no families, and knows no elements of 27 nodes.
The files are HDF5. A family is a number that nodes or elements share, with the names of the groups
that it belongs to; 0 is none. Solids are numbered the other way round than in meshio.

Source: MED file format, EDF and CEA, version 4.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from skfem import Mesh

from contactopt.errors import Damaged, InputError
from contactopt.meshes.cells import mirrored
from contactopt.meshes.mesh_repair import in_order

if TYPE_CHECKING:
    import h5py
    import meshio


def read_med(path: Path) -> Any:
    """The mesh of a file with its groups; Damaged, KeyError or OSError for another format."""
    try:
        import h5py
    except ImportError as error:
        raise Damaged("it is of HDF5; pip install h5py") from error
    with h5py.File(path) as file:
        (name,) = _one(file["ENS_MAA"], "meshes")
        mesh = file["ENS_MAA"][name]
        if "NOE" not in mesh:
            (step,) = _one(mesh, "steps of a mesh")
            mesh = mesh[step]
        return _mesh(path, mesh, file["ENS_MAA"][name].attrs["ESP"], file.get(f"FAS/{name}", {}))


def _one(group: Collection[str], what: str) -> list[str]:
    if len(group) != 1:
        raise Damaged(f"it holds {len(group)} {what}, not one")
    return list(group)


def _mesh(path: Path, mesh: Mesh, dim: int, families: h5py.Group) -> meshio.Mesh:
    import meshio
    from meshio.med._med import med_to_meshio_type

    places, nodes_of = mesh["NOE/COO"][()].reshape(dim, -1).T, {}
    kinds = {"QU9": "quad9", "H27": "hexahedron27"} | med_to_meshio_type
    cells, tags = [], []
    for med, own in mesh["MAI"].items():
        if med not in kinds:
            raise InputError(f"mesh file '{path}': elements of type {med} are not known here.")
        nodes = own["NOD"][()].reshape(-1, int(own["NOD"].attrs["NBR"])) - 1
        kind = kinds[med]
        nodes = mirrored(kind, nodes) if kind.startswith(("tetra", "hexahedron")) else nodes
        rows = in_order(places, nodes.T) if kind == "hexahedron27" else nodes.T
        cells.append((kind, rows))
        tags.append(own["FAM"][()] if "FAM" in own else np.zeros(nodes.shape[1], dtype=int))
    for name, numbers in _groups(families, "NOEUD").items():
        known = mesh["NOE/FAM"][()] if "FAM" in mesh["NOE"] else np.zeros(len(places), dtype=int)
        nodes_of[name] = np.flatnonzero(np.isin(known, numbers))
    sets = {
        name: [np.flatnonzero(np.isin(own, numbers)) for own in tags]
        for name, numbers in _groups(families, "ELEME").items()
    }
    words = {kinds[med]: f"{kinds[med]} ({med} of MED)" for med in mesh["MAI"]}
    return meshio.Mesh(places, cells, cell_sets=sets, point_sets=nodes_of, info=words)


def _groups(families: h5py.Group, kind: str) -> dict[str, list[int]]:
    """Name of each group -> numbers of its families."""
    found: dict[str, list[int]] = {}
    for family in families[kind].values() if kind in families else ():
        if "GRO" not in family:
            continue
        for letters in family["GRO/NOM"][()]:
            text = np.asarray(letters).astype(np.uint8).tobytes().split(b"\0")[0]
            name = text.decode("utf-8", "replace").strip()
            found.setdefault(name, []).append(int(family.attrs["NUM"]))
    return found
