"""What the page of a run shows, read from the files of the run: bodies, contact surfaces and load
path, for the program in pages/view.js.
"""

from __future__ import annotations

import csv
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.cards import force_unit
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

REACH = 4.0  # sizes of a small contact surface that the first picture of large bodies shows
# cosine of the angle between two faces from which on their edge is drawn
SHARP = np.cos(np.deg2rad(30))
ON_PLANE = 1e-9  # of the size of a body, within which a node lies in a plane of symmetry
# nodes of all bodies in space, up to which the page holds their inside, so that it can be cut
MOST_INSIDE = 40_000


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
    near = _near_contact(whole_box(box_of([mesh.points for mesh in pairs.values()]), mirrors), box)
    largest = max((float(np.abs(values["move"]).max()) for values in fields.values()), default=0.0)
    gap = max(float(mesh.point_data["contact_gap"].max()) for mesh in pairs.values())
    reach = float(np.ptp(near, axis=0).max())
    stresses = [values["von_mises"].ravel() for values in fields.values()]
    inside = len(axes) == 3 and sum(len(mesh.points) for mesh in bodies.values()) <= MOST_INSIDE
    contacts, first = [], 0
    for name, mesh in pairs.items():
        own = slice(first, first + len(mesh.points))
        move = _motion(bodies, fields, mesh.points, len(axes))
        contacts.append({"name": name} | _contact(mesh, move, interface, path, own))
        first = own.stop
    return {
        "units": [*summary["units"], force_unit(summary["units"])],
        "dim": len(axes),
        "axes": axes,
        "ring": kind.revolved,
        "mirrors": mirrors,
        "box": box.tolist(),
        "near": near.tolist(),
        "contact": _touching(pairs, box).tolist(),
        "scale": magnification(reach, largest, gap),
        "most_scale": 2.0 * magnification(reach, largest, 0.0),
        "top": highest_colour(stresses) if stresses else 1.0,
        "bodies": [
            {"name": name} | body_arrays(mesh, fields[name], mirrors, inside)
            for name, mesh in bodies.items()
        ],
        "contacts": contacts,
        "states": 1 if path is None else len(path["reactions"]),
        "moving": moving,
        "history": None if path is None else _history(folder / "history.csv"),
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


def _near_contact(contact: np.ndarray, box: np.ndarray) -> np.ndarray:
    """The box (2, 3) of the first picture: of all bodies, or about a small contact on them."""
    half = REACH * float(np.ptp(contact, axis=0).max()) / 2
    if half <= 0 or half > float(np.ptp(box, axis=0).max()) / 4:
        return box
    centre = contact.mean(axis=0)
    return np.stack([np.maximum(box[0], centre - half), np.minimum(box[1], centre + half)])


def _touching(pairs: dict[str, Any], box: np.ndarray) -> np.ndarray:
    """The box (2, 3) about the contacts that touch; about the largest pressure, where they reach
    across half of all bodies.
    """
    points = np.concatenate([mesh.points for mesh in pairs.values()])
    pressure = np.concatenate([mesh.point_data["contact_pressure"] for mesh in pairs.values()])
    touching = points[pressure > 0] if np.any(pressure > 0) else points
    size, half = float(np.ptp(box, axis=0).max()), 0.7 * float(np.ptp(touching, axis=0).max())
    centre = (touching.min(axis=0) + touching.max(axis=0)) / 2
    if half > size / 4:
        centre, half = points[np.argmax(pressure)], size / 4
    half = half or size / 20
    return np.stack([np.maximum(box[0], centre - half), np.minimum(box[1], centre + half)])


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
    mesh: Any, values: dict[str, np.ndarray], mirrors: list[list[Any]], inside: bool
) -> dict[str, Any]:
    """What is drawn of a body: its surface, in 2D all of it, and with `inside` its elements; values
    at their nodes.

    What lies in a plane of symmetry is apart, because it belongs to no surface and no edge of the
    whole body.
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
    shown = {name: _packed(value[:, nodes]) for name, value in values.items()}
    return {
        "points": packed(mesh.points[nodes]),
        "move": shown.pop("move"),
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
        within |= np.all(np.abs(points[items, axis] - place) <= ON_PLANE * size, axis=1)
    return items[~within], items[within]


def _motion(
    bodies: dict[str, Any], fields: dict[str, dict[str, np.ndarray]], points: np.ndarray, dim: int
) -> np.ndarray:
    """Displacements (s, k, dim) of places (k, 3), from the nearest node; none without bodies."""
    if not bodies:
        return np.zeros((1, len(points), dim))
    nearest = KDTree(np.concatenate([mesh.points for mesh in bodies.values()])).query(points)[1]
    return np.asarray(np.concatenate([fields[name]["move"] for name in bodies], axis=1)[:, nearest])


def _contact(
    mesh: Any,
    move: np.ndarray,
    interface: dict[str, np.ndarray],
    path: dict[str, np.ndarray] | None,
    own: slice,
) -> dict[str, Any]:
    """One pair of surfaces: places, displacements (s, k, dim), and values of every state."""
    (block,) = mesh.cells
    flat = np.zeros((0, 3), dtype=int) if block.type == "line" else triangles(block.data)
    states = _last_state(mesh, interface, own) if path is None else _contact_states(path, own)
    return {
        "points": packed(mesh.points),
        "move": _packed(move),
        "cells": packed(flat),
        "place": packed(interface["x"][own].T),
        "states": {name: packed(np.nan_to_num(value)) for name, value in states.items()},
    }


def _last_state(mesh: Any, interface: dict[str, np.ndarray], own: slice) -> dict[str, np.ndarray]:
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


def _numbers(texts: list[str]) -> list[float]:
    """The numbers of a column; none where one of them is none or not finite."""
    with suppress(ValueError):
        values = [float(text) for text in texts]
        return values if np.all(np.isfinite(values)) else []
    return []
