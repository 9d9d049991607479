"""The result of a run as one page to explore, made from the files of the run.

The page shows the bodies, which can be turned, enlarged, cut and coloured by stress or
displacement; their deformation follows a slider. Half and quarter models are shown whole. On the
contact surface it shows pressure, traction, gap, slip, and which contacts stick, slip or are open.
A click on a place shows its values with their units. A load path has a slider over its states and
the loop of force and displacement. The bodies move with it where the run wrote all of their states,
which it does for a page if they are small enough (MOST_NUMBERS in contactopt.figures.output).
"""

from __future__ import annotations

import csv
import html
import io
import json
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from contactopt.checks import short
from contactopt.errors import InputError
from contactopt.figures.html import check_installed, packed, packed_short, write_html
from contactopt.figures.output import STATES
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
from contactopt.readings.resultants import resultant_words

__all__ = ["check_installed", "write_page"]
SHARE = 0.08  # of the bodies' size that the largest displacement is drawn as, at first
# a gap above this fraction of the largest displacement: bodies that were apart would seem to
# overlap if magnified
APART = 1e-3
REACH = 4.0  # sizes of a small contact surface that the first picture of large bodies shows
# quantile of the von Mises stress where the colours end: singular corners would take them all
TOP = 0.998
# cosine of the angle between two faces from which on their edge is drawn
SHARP = np.cos(np.deg2rad(30))
ON_PLANE = 1e-9  # of the size of a body, within which a node lies in a plane of symmetry
# nodes of all bodies in space, up to which the page holds their inside, so that it can be cut
MOST_INSIDE = 40_000
WORDS = {
    "approach": "approach of the bodies",
    "contact_half_width": "half-width of the contact",
    "stick_half_width": "half-width of the stick zone",
}


def write_page(folder: str | Path, file: str | Path) -> Path:
    """Write the page of a run.

    Parameters
    ----------
    folder : what `contactopt run` wrote: summary.json, interface.npz, VTU files, and path.npz with
        history.csv of a load path
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
        silent = io.StringIO()
        with (
            warnings.catch_warnings(action="ignore"),
            redirect_stderr(silent),
            redirect_stdout(silent),
        ):
            summary = json.loads((folder / "summary.json").read_text())
            data = page_data(folder, summary)
            title, body = f"contactopt: {summary['scene']}", _body(summary, data)
            json.dumps(data, allow_nan=False)
    # a damaged file breaks its reader in any way; that of meshio exits
    except (Exception, SystemExit) as error:
        how = short(" ".join(str(error).split()) or type(error).__name__, 200).strip("'\"")
        raise InputError(
            f"'{folder}' is not the folder of a finished run ({how}); make one with: contactopt run"
            f" SCENE --out {folder}"
        ) from error
    return write_html(file, title, body, data, ["view.js"])


def page_data(folder: Path, summary: dict[str, Any]) -> dict[str, Any]:
    """What the program of the page reads; arrays are packed."""
    import meshio

    meshes = {path.stem: meshio.read(path) for path in sorted(folder.glob("*.vtu"))}
    bodies = {name: mesh for name, mesh in meshes.items() if "von_mises" in mesh.point_data}
    interface = _arrays(folder / "interface.npz")
    path = _arrays(folder / "path.npz") if (folder / "path.npz").exists() else None
    moving = _arrays(folder / STATES) if path is not None and (folder / STATES).exists() else None
    pairs = {name: meshes[f"contact-{name}"] for name in summary["pairs"]}
    axes = {"axisymmetric": ["r", "z"], "plane-strain": ["x", "y"]}.get(
        summary["kind"], ["x", "y", "z"]
    )
    mirrors = [[axes.index(plane["axis"]), plane["place"]] for plane in summary["mirrors"]]
    fields = {name: _body_values(name, mesh, len(axes), moving) for name, mesh in bodies.items()}
    box = _whole(_box([mesh.points for mesh in (*bodies.values(), *pairs.values())]), mirrors)
    near = _near_contact(_whole(_box([mesh.points for mesh in pairs.values()]), mirrors), box)
    largest = max((float(np.abs(values["move"]).max()) for values in fields.values()), default=0.0)
    apart = (
        max(float(mesh.point_data["contact_gap"].max()) for mesh in pairs.values())
        > APART * largest
    )
    reach = float(np.ptp(near, axis=0).max())
    visible = _round(SHARE * reach / largest) if largest > 0 else 1.0
    inside = len(axes) == 3 and sum(len(mesh.points) for mesh in bodies.values()) <= MOST_INSIDE
    contacts, first = [], 0
    for name, mesh in pairs.items():
        own = slice(first, first + len(mesh.points))
        move = _motion(bodies, fields, mesh.points, len(axes))
        contacts.append({"name": name} | _contact(mesh, move, interface, path, own))
        first = own.stop
    stresses = [values["von_mises"].ravel() for values in fields.values()]
    return {
        "units": summary["units"],
        "dim": len(axes),
        "axes": axes,
        "ring": summary["kind"] == "axisymmetric",
        "mirrors": mirrors,
        "box": box.tolist(),
        "near": near.tolist(),
        "scale": 1.0 if apart else max(1.0, visible),
        "most_scale": 2.0 * max(1.0, visible),
        "top": float(np.quantile(np.concatenate(stresses), TOP)) if stresses else 1.0,
        "bodies": [
            {"name": name} | _body_arrays(mesh, fields[name], mirrors, inside)
            for name, mesh in bodies.items()
        ],
        "contacts": contacts,
        "states": 1 if path is None else len(path["reactions"]),
        "moving": moving is not None,
        "history": None if path is None else _history(folder / "history.csv"),
    }


def _arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file by name.

    NumPy leaves a damaged file open that it was given by its path.
    """
    with path.open("rb") as file:
        return dict(np.load(file))


def _box(places: list[np.ndarray]) -> np.ndarray:
    """Least and largest coordinates (2, 3) of points (n, 3)."""
    points = np.concatenate(places)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _whole(box: np.ndarray, mirrors: list[list[Any]]) -> np.ndarray:
    """The box (2, 3) with its mirror images."""
    for axis, place in mirrors:
        image = box.copy()
        image[:, axis] = 2 * place - box[::-1, axis]
        box = np.stack([np.minimum(box[0], image[0]), np.maximum(box[1], image[1])])
    return box


def _near_contact(contact: np.ndarray, box: np.ndarray) -> np.ndarray:
    """The box (2, 3) of the first picture: that of all bodies, or about the contact if it is small
    on them.
    """
    half = REACH * float(np.ptp(contact, axis=0).max()) / 2
    if half <= 0 or half > float(np.ptp(box, axis=0).max()) / 4:
        return box
    centre = contact.mean(axis=0)
    return np.stack([np.maximum(box[0], centre - half), np.minimum(box[1], centre + half)])


def _round(value: float) -> float:
    """The next number below that is 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(m for m in (1, 2, 5) if m * power <= value * (1 + 1e-12)))


def _body_values(
    name: str, mesh: Any, dim: int, moving: dict[str, np.ndarray] | None
) -> dict[str, np.ndarray]:
    """Displacement `move` (s, n, dim), von Mises stress (s, n) and stresses (1, n) of a body, at
    the last or at all s states.
    """
    data = mesh.point_data
    values = {
        key: data[key][None] for key in data if key == "von_mises" or key.startswith("stress_")
    }
    if moving is None:
        return {"move": data["displacement"][None, :, :dim]} | values
    return values | {
        "move": moving[f"displacement/{name}"],
        "von_mises": moving[f"von_mises/{name}"],
    }


def _body_arrays(
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
    return {
        "points": packed(mesh.points[nodes]),
        "values": {
            name: _packed(value[:, nodes]) for name, value in values.items() if name != "move"
        },
        "move": _packed(values["move"][:, nodes]),
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
    """Displacements (s, k, dim) of places (k, 3): those of the nearest node of a body, none without
    bodies.
    """
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
    return {
        "points": packed(mesh.points),
        "move": _packed(move),
        "cells": packed(
            triangles(block.data) if block.type != "line" else np.zeros((0, 3), dtype=int)
        ),
        "place": packed(interface["x"][own].T),
        "states": {
            name: packed(np.nan_to_num(value))
            for name, value in (
                _last_state(mesh, interface, own) if path is None else _contact_states(path, own)
            ).items()
        },
    }


def _last_state(mesh: Any, interface: dict[str, np.ndarray], own: slice) -> dict[str, np.ndarray]:
    """Values (k,) of the contacts of one pair; `vector` (k, 3) is the whole traction in space."""
    data, traction = mesh.point_data, interface["traction"][own]
    return {
        "pressure": data["contact_pressure"],
        "traction": np.abs(traction) if traction.ndim == 1 else np.linalg.norm(traction, axis=1),
        "along": traction if traction.ndim == 1 else traction[:, 0],
        "bound": interface["bound"][own],
        "status": interface["status"][own],
        "gap": data["contact_gap"],
        "slip": np.linalg.norm(data["contact_slip"], axis=1),
        "vector": data["contact_traction"],
    }


def _contact_states(path: dict[str, np.ndarray], own: slice) -> dict[str, np.ndarray]:
    """As _last_state, for the n states of a load path (n, k); the slip is that since the state
    before.
    """
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
    keys = ("approach", "shift", "normal_force", "shear_force", "stick_nodes", "slip_nodes")
    return {key: [float(row[key]) for row in rows] for key in keys}


def certificate_words(summary: dict[str, Any]) -> str:
    """What the certificate says, for people who meet it for the first time."""
    residual = summary["residual"]
    if summary["status"] == "infeasible":
        return (
            "No forces solve this problem: a proof of that was found. What is shown is the last"
            " iterate."
        )
    size = "" if residual is None or not np.isfinite(residual) else f"{residual:.1e}"
    said = (
        f"The certificate is {size}. It was recomputed from the problem alone, and says how well"
        " the forces fulfil the laws of contact and friction: penetration, tension, friction"
        " beyond its bound and the direction of slip are each at most about this fraction of a"
        " typical force or length of the problem."
    )
    if summary["status"] == "solved":
        return f"These forces are a solution. {said}"
    return (
        "This is not a solution, only the last iterate"
        f" ({summary.get('message') or summary['status']}). {said}"
    )


def _followers(data: dict[str, Any]) -> str:
    """Which parts of the page follow the slider over the states."""
    if data["moving"] or not data["bodies"]:
        return (
            "The page follows the slider; single stresses inside the bodies are those of the last"
            " state. The slip is that since the state before."
        )
    return (
        "The contact follows the slider: pressure, traction, status, gap, slip since the state"
        " before, and arrows. The bodies are those of the last state: the run kept no others,"
        " because it made no page, or because they are too large for one."
    )


def _body(summary: dict[str, Any], data: dict[str, Any]) -> str:
    """The HTML of the page, all names in it escaped."""
    length, stress = summary["units"]
    rows = {
        "status": summary["status"],
        "unknowns of the bodies": summary["dofs"],
        "contacts": summary["contact_nodes"],
        "friction coefficient": f"{summary['mu']:g}",
        "method": f"{summary['method']}, {summary['outer_iterations']} iterations",
        "sum of the normal forces": f"{summary['normal_force']:.5g} {stress} {length}^2",
        "largest pressure": f"{summary['max_pressure']:.5g} {stress}",
    }
    for name, force in resultant_words(summary).items():
        rows[f"force on the upper body of {name}"] = f"{force} {stress} {length}^2"
    rows |= {
        words: f"{summary[key]:.5g} {length}"
        for key, words in WORDS.items()
        if summary.get(key) is not None
    }
    if found := summary.get("accuracy"):
        error = "unknown" if found["error"] is None else f"{found['error']:.1e}"
        rows[f"accuracy of the {found['quantity']}"] = (
            f"{error}, asked for {found['target']:g}: {found['message']}"
        )
        rows["unknowns of the meshes"] = ", ".join(
            str(level["unknowns"]) for level in found["levels"]
        )
    cells = "".join(
        f'<tr><th scope="row">{html.escape(str(name))}</th><td>{html.escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    remarks = "".join(
        f"<p><strong>{html.escape(text)}</strong></p>" for text in summary.get("remarks", ())
    )
    turn = (
        "Use the mouse, a finger, the buttons, or the arrow keys and + and - when the picture has"
        " the focus."
    )
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
<p>{html.escape(certificate_words(summary))}</p>{remarks}</header>
<main><div class="columns"><section aria-label="bodies and contact surface">
<div id="view" class="scene" tabindex="0" role="application" aria-label="picture of the bodies; arrow keys {what} it"></div>
<p class="note">{turn} {buttons}</p></section>
<section aria-label="what is shown"><div id="body-controls"><fieldset><legend>Bodies</legend>
<label>coloured by <select id="field"></select></label>
<label><span id="scale-words"></span><input type="range" id="scale" min="0"></label><div id="bodies"></div>
<label class="inline"><input type="checkbox" id="edges"> edges</label>
<label class="inline"><input type="checkbox" id="lines"> mesh lines</label>
<label class="inline"><input type="checkbox" id="clear"> see through them</label>
<label id="whole-control"><input type="checkbox" id="whole"> mirror images, which make them whole</label>
<div id="cut-control"><label>cut across <select id="cut"></select></label>
<label><span id="cut-words"></span><input type="range" id="cut-place" min="0" max="1" step="0.01"></label></div>
</fieldset></div>
<fieldset><legend>Contact</legend><label>coloured by <select id="contact"></select></label><div id="pairs"></div>
<label><input type="checkbox" id="arrows"> forces on the upper body as arrows</label></fieldset>
<fieldset><legend>Values at a place</legend><p class="note">Click on a place, or go to the
<button id="largest" type="button">largest colour value</button> or the <button id="peak" type="button">largest pressure</button>.</p>
<table aria-live="polite"><tbody id="values"></tbody></table></fieldset></section></div>
<section id="path"><h2>Load path</h2><label><span id="state-words"></span><input type="range" id="state" min="0" step="1"></label>
<p class="note">{_followers(data)}</p>
<div id="path-chart" class="chart"></div></section>
<h2>Along the contact surface</h2><label class="inline">surfaces <select id="pair"></select></label>
<div id="contact-chart" class="chart"></div>
<h2>Summary</h2><table><tbody>{cells}</tbody></table>
<p class="note">Sign convention: the pressure is positive in compression; tractions are those on the upper body.</p></main>"""
