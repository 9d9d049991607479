"""The result of a run as one page to explore, made from the files of the run.

The page shows the bodies, which can be turned, enlarged and coloured by stress or displacement; their deformation follows a
slider. On the contact surface it shows pressure, traction, gap, slip, and which contacts stick, slip or are open. A click on a
place shows its values with their units. A load path has a slider over its states and the loop of force and displacement.
"""

from __future__ import annotations

import csv
import html
import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.errors import InputError
from contactopt.figures.html import check_installed, packed, write_html

__all__ = ["check_installed", "write_page"]
SHARE = 0.08  # of the bodies' size that the largest displacement is drawn as, at first
APART = 1e-3  # a gap above this fraction of the largest displacement: bodies that were apart would seem to overlap if magnified
REACH = 4.0  # sizes of a small contact surface that the first picture of large bodies shows
TOP = 0.998  # quantile of the von Mises stress where the colours end: singular corners would take them all
CORNERS = {  # corners of a cell's faces, in the numbering of VTU files
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
}
WORDS = {
    "approach": "approach of the bodies",
    "contact_half_width": "half-width of the contact",
    "stick_half_width": "half-width of the stick zone",
}


def write_page(folder: str | Path, file: str | Path) -> Path:
    """Write the page of a run.

    Parameters
    ----------
    folder : what `contactopt run` wrote: summary.json, interface.npz, VTU files, and path.npz with history.csv of a load path
    file : where to write the page, ends in .html

    Returns
    -------
    Path : of the page

    Raises
    ------
    InputError : if plotly is not installed, or if the folder is not that of a run
    """
    check_installed()
    folder = Path(folder)
    try:
        summary = json.loads((folder / "summary.json").read_text())
        data = page_data(folder, summary)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"'{folder}' is not the folder of a finished run ({error}); make one with: contactopt run SCENE --out {folder}"
        ) from error
    return write_html(file, f"contactopt: {summary['scene']}", _body(summary, data), data, ["view.js"])


def page_data(folder: Path, summary: dict[str, Any]) -> dict[str, Any]:
    """What the program of the page reads; arrays are packed."""
    import meshio

    meshes = {path.stem: meshio.read(path) for path in sorted(folder.glob("*.vtu"))}
    bodies = {name: mesh for name, mesh in meshes.items() if "von_mises" in mesh.point_data}
    interface = dict(np.load(folder / "interface.npz"))
    path = dict(np.load(folder / "path.npz")) if (folder / "path.npz").exists() else None
    pairs = {name: meshes[f"contact-{name}"] for name in summary["pairs"]}
    places = np.concatenate([mesh.points for mesh in (*bodies.values(), *pairs.values())])
    low, high = places.min(axis=0), places.max(axis=0)
    near = _near_contact([mesh.points for mesh in pairs.values()], low, high)
    moves = [np.abs(mesh.point_data["displacement"]).max() for mesh in bodies.values()]
    largest = float(max(moves, default=0.0))
    apart = max(float(mesh.point_data["contact_gap"].max()) for mesh in pairs.values()) > APART * largest
    reach = float(np.ptp(near, axis=0).max())
    visible = _round(SHARE * reach / largest) if largest > 0 else 1.0
    contacts, first = [], 0
    for name, mesh in pairs.items():
        own = slice(first, first + len(mesh.points))
        contacts.append({"name": name} | _contact(mesh, bodies, interface, path, own))
        first = own.stop
    stresses = [mesh.point_data["von_mises"] for mesh in bodies.values()]
    axes = {"axisymmetric": ["r", "z"], "plane-strain": ["x", "y"]}.get(summary["kind"], ["x", "y", "z"])
    return {
        "units": summary["units"],
        "dim": len(axes),
        "axes": axes,
        "box": [low.tolist(), high.tolist()],
        "near": near.tolist(),
        "scale": 1.0 if apart else max(1.0, visible),
        "most_scale": 2.0 * max(1.0, visible),
        "top": float(np.quantile(np.concatenate(stresses), TOP)) if stresses else 1.0,
        "bodies": [{"name": name} | _body_arrays(mesh, axes) for name, mesh in bodies.items()],
        "contacts": contacts,
        "states": 1 if path is None else len(path["reactions"]),
        "history": None if path is None else _history(folder / "history.csv"),
    }


def _near_contact(surfaces: list[np.ndarray], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Least and largest coordinates (2, 3) of the first picture: all bodies, or the contact if it is small on them."""
    points = np.concatenate(surfaces)
    least, most = points.min(axis=0), points.max(axis=0)
    half = REACH * float((most - least).max()) / 2
    if half <= 0 or half > float((high - low).max()) / 4:
        return np.array([low, high])
    centre = (least + most) / 2
    return np.array([np.maximum(low, centre - half), np.minimum(high, centre + half)])


def _round(value: float) -> float:
    """The next number below that is 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(m for m in (1, 2, 5) if m * power <= value * (1 + 1e-12)))


def _body_arrays(mesh: Any, axes: list[str]) -> dict[str, Any]:
    """The surface of a body, in 2D all of it, with its values at the nodes that are drawn."""
    (block,) = mesh.cells
    faces = (
        np.concatenate([block.data[:, list(face)] for face in CORNERS[block.type]]) if block.dim == 3 else block.data
    )
    if block.dim == 3:
        faces = _once(faces)
    nodes, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 4 if block.type in ("quad", "hexahedron") else 3)
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    edges = _once(sides) if block.dim == 2 else np.unique(np.sort(sides, axis=1), axis=0)
    data, move = mesh.point_data, mesh.point_data["displacement"][nodes]
    values = {"von_mises": data["von_mises"][nodes], "size": np.linalg.norm(move, axis=1)}
    values |= {f"move_{name}": move[:, i] for i, name in enumerate(axes)}
    values |= {name: value[nodes] for name, value in data.items() if name.startswith("stress_")}
    return {
        "points": packed(mesh.points[nodes]),
        "move": packed(move),
        "cells": packed(_triangles(faces)),
        "edges": packed(edges),
        "values": {name: packed(value) for name, value in values.items()},
    }


def _once(cells: np.ndarray) -> np.ndarray:
    """The faces or sides (m, c) that belong to one cell only, with the order of their corners."""
    _, first, count = np.unique(np.sort(cells, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(cells[first[count == 1]])


def _triangles(faces: np.ndarray) -> np.ndarray:
    return np.concatenate([faces[:, :3], faces[:, [0, 2, 3]]]) if faces.shape[1] == 4 else faces


def _contact(
    mesh: Any, bodies: dict[str, Any], interface: dict[str, np.ndarray], path: dict[str, np.ndarray] | None, own: slice
) -> dict[str, Any]:
    """One pair of surfaces: places, displacements as those of the nearest node of a body, and values of every state."""
    (block,) = mesh.cells
    points, data = mesh.points, mesh.point_data
    move = np.zeros(points.shape)
    if bodies:
        nodes = np.concatenate([body.points for body in bodies.values()])
        moved = np.concatenate([body.point_data["displacement"] for body in bodies.values()])
        move = moved[KDTree(nodes).query(points)[1]]
    traction = interface["traction"][own]
    states = {
        "pressure": data["contact_pressure"],
        "traction": np.abs(traction) if traction.ndim == 1 else np.linalg.norm(traction, axis=1),
        "along": traction if traction.ndim == 1 else traction[:, 0],
        "bound": interface["bound"][own],
        "status": interface["status"][own],
    }
    if path is not None:
        areas, r = path["areas"][own], path["reactions"][:, own]
        share = np.divide(1.0, areas, out=np.zeros_like(areas), where=areas > 0)
        states = {
            "pressure": r[:, :, 0] * share,
            "traction": np.linalg.norm(r[:, :, 1:], axis=2) * share,
            "along": r[:, :, 1] * share,
            "bound": path["bounds"][:, own] * share,
            "status": path["status"][:, own],
        }
    states |= {"gap": data["contact_gap"], "slip": np.linalg.norm(data["contact_slip"], axis=1)}
    states["vector"] = data["contact_traction"]
    return {
        "points": packed(points),
        "move": packed(move),
        "cells": packed(_triangles(block.data) if block.type != "line" else np.zeros((0, 3), dtype=int)),
        "place": packed(interface["x"][own].T),
        "states": {name: packed(np.nan_to_num(value)) for name, value in states.items()},
    }


def _history(file: Path) -> dict[str, list[float]]:
    with open(file, newline="") as table:
        rows = list(csv.DictReader(table))
    keys = ("approach", "shift", "normal_force", "shear_force", "stick_nodes", "slip_nodes")
    return {key: [float(row[key]) for row in rows] for key in keys}


def certificate_words(summary: dict[str, Any]) -> str:
    """What the certificate says, for people who meet it for the first time."""
    residual = summary["residual"]
    if summary["status"] == "infeasible":
        return "No forces solve this problem: a proof of that was found. What is shown is the last iterate."
    size = "" if residual is None or not np.isfinite(residual) else f"{residual:.1e}"
    said = (
        f"The certificate is {size}. It was recomputed from the problem alone, and says how well the forces fulfil the laws of "
        "contact and friction: penetration, tension, friction beyond its bound and the direction of slip are each at most about "
        "this fraction of a typical force or length of the problem."
    )
    if summary["status"] == "solved":
        return f"These forces are a solution. {said}"
    return f"This is not a solution, only the last iterate ({summary.get('message') or summary['status']}). {said}"


def _body(summary: dict[str, Any], data: dict[str, Any]) -> str:
    """The HTML of the page, all names in it escaped."""
    length, stress = summary["units"]
    rows = {
        "status": summary["status"],
        "unknowns of the bodies": summary["dofs"],
        "contacts": summary["contact_nodes"],
        "friction coefficient": f"{summary['mu']:g}",
        "method": f"{summary['method']}, {summary['outer_iterations']} iterations",
        "total normal force": f"{summary['normal_force']:.5g} {stress} {length}^2",
        "largest pressure": f"{summary['max_pressure']:.5g} {stress}",
    }
    rows |= {words: f"{summary[key]:.5g} {length}" for key, words in WORDS.items() if summary.get(key) is not None}
    cells = "".join(
        f'<tr><th scope="row">{html.escape(str(name))}</th><td>{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    turn = "Use the mouse, a finger, the buttons, or the arrow keys and + and - when the picture has the focus."
    what = "move" if data["dim"] == 2 else "turn"
    buttons = "".join(
        f'<button id="{name}" type="button" aria-label="{words}">{sign}</button>'
        for name, sign, words in (
            ("left", "&larr;", f"{what} left"), ("right", "&rarr;", f"{what} right"), ("up", "&uarr;", f"{what} up"),
            ("down", "&darr;", f"{what} down"), ("closer", "+", "closer"), ("farther", "&minus;", "farther away"),
            ("home", "all", "show all of the bodies"), ("near", "contact", "show the contact"),
        )
    )  # fmt: skip
    return f"""<header><h1>{html.escape(summary["scene"])}</h1>
<p>{html.escape(certificate_words(summary))}</p></header>
<main><div class="columns"><section aria-label="bodies and contact surface">
<div id="view" class="scene" tabindex="0" role="application" aria-label="picture of the bodies; arrow keys {what} it"></div>
<p class="note">{turn} {buttons}</p></section>
<section aria-label="what is shown"><div id="body-controls"><fieldset><legend>Bodies</legend>
<label>coloured by <select id="field"></select></label>
<label><span id="scale-words"></span><input type="range" id="scale" min="0"></label><div id="bodies"></div>
<label><input type="checkbox" id="clear"> see through them</label><label><input type="checkbox" id="edges"> edges</label>
</fieldset></div>
<fieldset><legend>Contact</legend><label>coloured by <select id="contact"></select></label><div id="pairs"></div>
<label><input type="checkbox" id="arrows"> forces on the upper body as arrows</label></fieldset>
<fieldset><legend>Values at a place</legend><p class="note">Click on a place, or go to the
<button id="largest" type="button">largest colour value</button> or the <button id="peak" type="button">largest pressure</button>.</p>
<table aria-live="polite"><tbody id="values"></tbody></table></fieldset></section></div>
<section id="path"><h2>Load path</h2><label><span id="state-words"></span><input type="range" id="state" min="0" step="1"></label>
<p class="note">Pressure, traction and status follow the slider. The bodies, gaps, slips and arrows are those of the last state.</p>
<div id="path-chart" class="chart"></div></section>
<h2>Along the contact surface</h2><label class="inline">surfaces <select id="pair"></select></label>
<div id="contact-chart" class="chart"></div>
<h2>Summary</h2><table><tbody>{cells}</tbody></table>
<p class="note">Sign convention: the pressure is positive in compression; tractions are those on the upper body.</p></main>"""
