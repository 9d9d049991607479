"""What the page of a run shows, read from its files, for the program in pages/view.js."""

import csv
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree
from skfem import Mesh

from contactopt.cards import force_unit
from contactopt.defaults import EQUAL, ROUNDED
from contactopt.figures.closing import closing, gap_vectors
from contactopt.figures.html import packed, packed_short
from contactopt.figures.output import SERIES, SINGLE
from contactopt.figures.pieces import (
    mesh_lines,
    outline,
    pieces,
    segments,
    sharp_edges,
    solids,
    surface,
    triangles,
)
from contactopt.figures.style import highest_colour, magnification
from contactopt.scenes.kinds import KINDS

NEAREST = 16  # how many times as large as the picture of a contact the bodies may be
# cosine of the angle between two faces from which on their edge is drawn
SHARP = np.cos(np.deg2rad(30))
# nodes of all bodies in space, up to which the page holds their inside, so that it can be cut: such
# a page has at most 4 MB
MOST_INSIDE = 25_000


def page_data(folder: Path, summary: dict[str, Any]) -> dict[str, Any]:
    """What the program of the page reads, from the files of a run; arrays are packed."""
    import meshio

    files = [path for path in sorted(folder.glob("*.vtu")) if not SINGLE.search(path.name)]
    meshes = {path.stem: meshio.read(path) for path in files}
    bodies = {name: mesh for name, mesh in meshes.items() if "von_mises" in mesh.point_data}
    interface = _arrays(folder / "interface.npz")
    path = _arrays(folder / "path.npz") if (folder / "path.npz").exists() else None
    moving = path is not None and (folder / SERIES).exists()
    pairs = {name: meshes[f"contact-{name}"] for name in summary["pairs"]}
    kind = KINDS[summary["kind"]]
    axes = list(kind.components)
    mirrors = [[axes.index(plane["axis"]), plane["place"]] for plane in summary["mirrors"]]
    fields = {name: _body_values(mesh.point_data, len(axes)) for name, mesh in bodies.items()}
    if path is not None and moving:
        for name, values in fields.items():
            values |= _at_all_states(folder, name, len(path["reactions"]), len(axes))
    box = whole_box(box_of([mesh.points for mesh in (*bodies.values(), *pairs.values())]), mirrors)
    largest = max((float(np.abs(values["move"]).max()) for values in fields.values()), default=0.0)
    gaps = [mesh.point_data["contact_initial_gap"] for mesh in pairs.values()]
    boxes = _boxes(pairs, box, mirrors, len(axes))
    _close(bodies, fields, pairs, summary, mirrors)
    # a small contact on large bodies is looked at from near, so that less is seen of motions
    reach = min(float(np.ptp(box, axis=0).max()), 4 * max(np.ptp(b, axis=0).max() for b in boxes))
    stresses = [values["von_mises"].ravel() for values in fields.values()]
    inside = len(axes) == 3 and sum(len(mesh.points) for mesh in bodies.values()) <= MOST_INSIDE
    contacts: list[dict[str, Any]] = []
    first = 0
    for name, mesh in pairs.items():
        own = slice(first, first + len(mesh.points))
        motion = _motion(bodies, fields, mesh.points, len(axes))
        names, near = summary["pairs"][name]["bodies"], boxes[len(contacts)].tolist()
        told = {"name": name, "bodies": names, "box": near}
        contacts.append(told | _contact(mesh, motion, interface, path, own))
        first = own.stop
    return {
        "units": [*summary["units"], force_unit(summary["units"])],
        "dim": len(axes),
        "axes": axes,
        "ring": kind.revolved,
        "mirrors": mirrors,
        "box": box.tolist(),
        "scale": magnification(reach, largest, gaps),
        "most_scale": 2.0 * magnification(reach, largest),
        "top": highest_colour(stresses) if stresses else 1.0,
        "bodies": [
            {"name": name} | body_arrays(mesh, fields[name], mirrors, inside)
            for name, mesh in bodies.items()
        ],
        "contacts": contacts,
        "states": 1 if path is None else len(path["reactions"]),
        "moving": moving,
        "history": None if path is None else (history := _history(folder / "history.csv")),
        "columns": {} if path is None else {name: _column(name, summary) for name in history},
        "first": int(np.argmax([own["peak"] for own in contacts])),
    }


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file by name."""
    with path.open("rb") as file:  # NumPy leaves a damaged file open that it was given by its path
        return dict(np.load(file))


def box_of(places: list[np.ndarray]) -> np.ndarray:
    """Least and largest coordinates (2, 3) of points (n, 3)."""
    points = np.concatenate(places)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def whole_box(box: np.ndarray, mirrors: list[list[Any]]) -> np.ndarray:
    """The box (2, 3) with its mirror images."""
    for axis, place in mirrors:
        image = box.copy()
        image[:, axis] = 2 * place - box[::-1, axis]
        box = np.stack([np.minimum(box[0], image[0]), np.maximum(box[1], image[1])])
    return box


def _boxes(
    pairs: dict[str, Any], box: np.ndarray, mirrors: list[list[Any]], dim: int
) -> list[np.ndarray]:
    """For each pair the box (2, 3) of the picture of its contact, with mirror images."""
    found, least = [], float(np.ptp(box, axis=0).max()) / NEAREST
    for mesh in pairs.values():
        pressure = mesh.point_data["contact_pressure"]
        touching = mesh.points[pressure > 0.01 * max(pressure.max(initial=0.0), 0.0)]
        found.append(box_of([touching if len(touching) else mesh.points]))
    if dim == 2:
        found = [box_of(found)] * len(found)
    boxes = []
    for own in found:
        low, high = whole_box(own, mirrors)
        half = max(0.65 * float((high - low).max()), least / 2)
        ends = (low + high) / 2 + np.array([[-half], [half]])
        boxes.append(np.stack([np.maximum(box[0], ends[0]), np.minimum(box[1], ends[1])]))
    return boxes


def _close(
    bodies: dict[str, Any],
    fields: dict[str, dict[str, np.ndarray]],
    pairs: dict[str, Any],
    summary: dict[str, Any],
    mirrors: list[list[Any]],
) -> None:
    """Give the bodies the field that closes initial gaps as `lift` (1, n, dim)."""
    for name, mesh in bodies.items():
        dim, surfaces = fields[name]["move"].shape[2], []
        for pair, own in pairs.items():
            upper, *_ = names = summary["pairs"][pair]["bodies"]
            gap, normals = (own.point_data[f"contact_{key}"] for key in ("initial_gap", "normal"))
            if name in names:
                vectors = gap_vectors(gap, normals[:, :dim], name == upper)
                surfaces.append((own.points[:, :dim], vectors))
        d = closing(mesh.points[:, :dim], surfaces, [(axis, place) for axis, place in mirrors])
        fields[name]["lift"] = d[None]


def _body_values(data: dict[str, np.ndarray], dim: int) -> dict[str, np.ndarray]:
    """`move` (1, n, dim), von_mises (1, n) and stresses (1, n) of a body at the last state."""
    values = {key: data[key][None] for key in data if key.startswith(("von_mises", "stress_"))}
    return values | {"move": data["displacement"][None, :, :dim]}


def _at_all_states(folder: Path, name: str, states: int, dim: int) -> dict[str, np.ndarray]:
    """`move` (s, n, dim) and von_mises (s, n) of a body, from the series of its files."""
    import meshio

    files = [folder / f"{name}-state{step + 1:04d}.vtu" for step in range(states)]
    found = [_body_values(meshio.read(file).point_data, dim) for file in files]
    return {key: np.concatenate([own[key] for own in found]) for key in ("move", "von_mises")}


def body_arrays(
    mesh: Mesh, values: dict[str, np.ndarray], mirrors: list[list[Any]], inside: bool
) -> dict[str, Any]:
    """What is drawn of a body: its surface, in 2D all of it, and with `inside` its elements; values
    at their nodes. What lies in a plane of symmetry is apart.
    """
    (block,) = mesh.cells
    kind, faces = surface(block.type, block.data, mesh.points)
    sharp = outline(kind, faces) if block.dim == 2 else sharp_edges(kind, faces, mesh.points, SHARP)
    drawn = {"lines": segments(mesh_lines(kind, faces))}
    drawn["cells"], drawn["cut_cells"] = _apart(
        triangles(pieces(kind, faces)), mesh.points, mirrors
    )
    drawn["edges"], drawn["cut_edges"] = _apart(segments(sharp), mesh.points, mirrors)
    drawn["inside"] = solids(block.type, block.data) if inside else np.zeros((0, 4), dtype=int)
    nodes = np.arange(len(mesh.points)) if inside else np.unique(faces)
    place = np.zeros(len(mesh.points), dtype=int)
    place[nodes] = np.arange(len(nodes))
    shown = {
        name: (packed_short if name.startswith(("lift", "stress_")) else _packed)(value[:, nodes])
        for name, value in values.items()
    }
    return {
        "points": packed(mesh.points[nodes]),
        "move": shown.pop("move"),
        "lift": shown.pop("lift", None),
        "values": shown,
        **{name: packed(place[numbers]) for name, numbers in drawn.items()},
    }


def _packed(values: np.ndarray) -> dict[str, Any]:
    """Values (s, ...), those of several states in two bytes each."""
    return packed(values) if len(values) == 1 else packed_short(values)


def _apart(
    items: np.ndarray, points: np.ndarray, mirrors: list[list[Any]]
) -> tuple[np.ndarray, np.ndarray]:
    """The items (m, c) of nodes outside all planes of symmetry, and those within one."""
    size = float(np.ptp(points, axis=0).max())
    within = np.zeros(len(items), dtype=bool)
    for axis, place in mirrors:
        within |= np.all(np.abs(points[items, axis] - place) <= EQUAL * size, axis=1)
    return items[~within], items[within]


def _motion(
    bodies: dict[str, Any], fields: dict[str, dict[str, np.ndarray]], points: np.ndarray, dim: int
) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (s, k, dim) of places (k, 3) from the nearest node, and what closes gaps."""
    if not bodies:
        return np.zeros((1, len(points), dim)), np.zeros((1, len(points), dim))
    nearest = KDTree(np.concatenate([mesh.points for mesh in bodies.values()])).query(points)[1]
    move, lift = (
        np.concatenate([fields[name][key] for name in bodies], axis=1)[:, nearest]
        for key in ("move", "lift")
    )
    return move, lift


def _contact(
    mesh: Mesh,
    motion: tuple[np.ndarray, np.ndarray],
    interface: dict[str, np.ndarray],
    path: dict[str, np.ndarray] | None,
    own: slice,
) -> dict[str, Any]:
    """One pair of surfaces: places, motion, values of every state, and the mean normal if flat."""
    (block,) = mesh.cells
    line = block.type == "line"
    flat = np.zeros((0, 3), dtype=int) if line else triangles(block.data)
    pressure, normals = (mesh.point_data[f"contact_{key}"] for key in ("pressure", "normal"))
    weights = pressure.clip(0) if np.any(pressure > 0) else np.ones(len(pressure))
    mean = np.average(normals, axis=0, weights=weights)
    size, extent = float(np.linalg.norm(mean)), float(np.ptp(mesh.points, axis=0).max())
    states = _last_state(mesh, interface, own) if path is None else _contact_states(path, own)
    return {
        "points": packed(mesh.points),
        "move": _packed(motion[0]),
        "lift": packed_short(motion[1]),
        "cells": packed(flat),
        "lines": packed(block.data if line else np.zeros((0, 2), dtype=int)),
        "normal": (mean / size).tolist() if size > 0.5 else None,  # not around something
        "peak": float(pressure.max(initial=0.0)),
        "place": packed(interface["x"][own].T),
        "states": {
            name: packed(
                _rounded(value, extent) if name in ("gap", "slip") else np.nan_to_num(value)
            )
            for name, value in states.items()
        },
    }


def _rounded(lengths: np.ndarray, extent: float) -> np.ndarray:
    """Lengths without what rounding leaves of zero."""
    return np.where(np.abs(np.nan_to_num(lengths)) > ROUNDED * extent, lengths, 0.0)


def _last_state(mesh: Mesh, interface: dict[str, np.ndarray], own: slice) -> dict[str, np.ndarray]:
    """Values (k,) of the contacts of one pair; `vector` (k, 3) is the whole traction in space."""
    data, traction = mesh.point_data, interface["traction"][own]
    traction = traction.reshape(len(traction), -1)
    return {
        "pressure": data["contact_pressure"],
        "traction": np.linalg.norm(traction, axis=1),
        "along": traction[:, 0],
        "bound": interface["bound"][own],
        "status": interface["status"][own],
        "gap": data["contact_gap"],
        "slip": np.linalg.norm(data["contact_slip"], axis=1),
        "vector": data["contact_traction"],
    }


def _contact_states(path: dict[str, np.ndarray], own: slice) -> dict[str, np.ndarray]:
    """As _last_state, of n states (n, k); the slip is that since the state before."""
    areas, r, u = path["areas"][own], path["reactions"][:, own], path["displacements"][:, own]
    share = np.divide(1.0, areas, out=np.zeros_like(areas), where=areas > 0)
    vector = np.einsum("kad,ska->skd", path["frames"][own], r) * share[:, None]
    return {
        "pressure": r[:, :, 0] * share,
        "traction": np.linalg.norm(r[:, :, 1:], axis=2) * share,
        "along": r[:, :, 1] * share,
        "bound": path["bounds"][:, own] * share,
        "status": path["status"][:, own],
        "gap": u[:, :, 0],
        "slip": np.linalg.norm(np.diff(u[:, :, 1:], axis=0, prepend=0.0), axis=2),
        "vector": np.pad(vector, ((0, 0), (0, 0), (0, 3 - vector.shape[2]))),
    }


def _history(file: Path) -> dict[str, list[float]]:
    with open(file, newline="") as table:
        rows = list(csv.DictReader(table))
    return {key: found for key in rows[0] if (found := _numbers([row[key] for row in rows]))}


def _column(name: str, summary: dict[str, Any]) -> str:
    """The name of a column of the history, with its unit."""
    length, force = summary["units"][0], force_unit(summary["units"])
    units = {"seconds": "s"} | {f"{side}_force": force for side in ("normal", "shear")}
    units |= dict.fromkeys(("approach", "shift", "contact_half_width", "stick_half_width"), length)
    unit = units.get(name.partition(":")[0], "")
    unit = f"{force} {length}" if name.endswith(("energy", "work")) else unit
    return name.replace("_", " ") + (f" [{unit}]" if unit and "[" not in name else "")


def _numbers(texts: list[str]) -> list[float]:
    """The numbers of a column; none where one of them is none or not finite."""
    with suppress(ValueError):
        values = [float(text) for text in texts]
        return values if np.all(np.isfinite(values)) else []
    return []
