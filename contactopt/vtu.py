"""VTU files, the format of ParaView for unstructured meshes: XML whose arrays are compressed and written in base64.

meshio writes such files, too, but to import it takes longer than to write the files of a small scene.

Source: VTK User's Guide, file formats; every array is one compressed block.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np

# numbers of VTK for the cells that meshio calls so
CELLS = {
    "line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12,
    "triangle6": 22, "tetra10": 24, "quad9": 28, "hexahedron27": 29,
}  # fmt: skip
TYPES = {"float64": "Float64", "int64": "Int64", "int32": "Int32", "uint8": "UInt8"}
HEAD = '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">'


def write_vtu(file: Path, points: np.ndarray, kind: str, cells: np.ndarray, data: Mapping[str, np.ndarray]) -> None:
    """Write a mesh of one kind of cells with values at its points.

    Parameters
    ----------
    file : to write
    points : (n, 2 or 3) places; in the plane the third coordinate is zero
    kind, cells : a key of CELLS, and the points (m, v) of every cell in the order of VTK
    data : name -> (n,) or (n, 3) values at the points
    """
    places = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    count, corners = cells.shape
    grid = {
        "connectivity": cells.ravel(),
        "offsets": corners * np.arange(1, count + 1),
        "types": np.full(count, CELLS[kind], dtype=np.uint8),
    }
    parts = [
        f'<?xml version="1.0"?>\n{HEAD}<UnstructuredGrid><Piece NumberOfPoints="{len(points)}" NumberOfCells="{count}">',
        f"<Points>{_array('Points', places)}</Points>",
        f"<Cells>{''.join(_array(name, values) for name, values in grid.items())}</Cells>",
        f"<PointData>{''.join(_array(name, values) for name, values in data.items())}</PointData>",
        "</Piece></UnstructuredGrid></VTKFile>\n",
    ]
    file.write_text("\n".join(parts), encoding="utf-8")


def _array(name: str, values: np.ndarray) -> str:
    """One array as an element of the file: length of the block, length once compressed, and the block."""
    raw = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
    block = zlib.compress(raw)
    head = np.array([1, len(raw), 0, len(block)] if raw else [0, 0, 0], dtype="<u4").tobytes()
    text = base64.b64encode(head).decode() + (base64.b64encode(block).decode() if raw else "")
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return (
        f'<DataArray type="{TYPES[values.dtype.name]}" Name="{escape(name)}"{width} format="binary">{text}</DataArray>'
    )
