"""A scene before it is solved, as a page to explore: bodies, boundaries and what they are for,
loads, pairs of surfaces with their normals and initial gaps. The program is that of the page of a
result.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from skfem import Mesh

from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.bodies.elements import FACES, Faces
from contactopt.cards import force_unit
from contactopt.figures.html import filled, packed, remark_list, write_html
from contactopt.figures.page_data import MOST_INSIDE, body_arrays, box_of, whole_box
from contactopt.figures.pieces import CORNERS, pieces, surface, triangles
from contactopt.figures.scene_check import SceneCheck
from contactopt.meshes.cells import elements_of, facet_nodes, facets_at
from contactopt.readings.resultants import mirrors
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.scene import Part, Scene, Support

if TYPE_CHECKING:
    from contactopt.coupling.coupling import Coupling
    from contactopt.scenes.contact import Contact

ROLES = ("no use", "support", "load", "plate", "bolt", "contact")
NORMALS, SYMBOLS = 12, 5  # arrows on a contact surface and symbols on a boundary that stay legible


def write_check_page(check: SceneCheck, file: str | Path) -> Path:
    """Write what is known of a scene before it is solved to an .html file."""
    scene = check.scene
    elastic = [body for body in check.posed.bodies if isinstance(body, AssembledElastic)]
    meshes = {body.name: body.body.basis.mesh for body in elastic}
    posed: Any = SimpleNamespace(scene=scene, planes=check.posed.planes)
    planes = [[scene.components.index(own["axis"]), own["place"]] for own in mirrors(posed)]
    many = NORMALS // 2 ** len(planes)
    pairs = [_pair(*both, many) for both in zip(scene.pairs, check.posed.couplings)]
    symmetric = {(axis, place) for axis, place in map(tuple, planes)}
    items = [
        item
        for body in elastic
        for item in _boundaries(scene, body.part, meshes[body.name], symmetric)
    ]
    items.sort(key=lambda item: item["role"] == 0)
    told = "Nothing has been solved yet. This is what will be solved."
    words = told, check.text, check.notes
    return _write(scene, meshes, (pairs, items), ROLES, planes, words, file)


def write_mesh_page(
    name: str, meshes: Mapping[str, Any], text: str, notes: Sequence[str], file: str | Path
) -> Path:
    """Write the bodies of a mesh file with their boundaries, and words about them, as a page."""
    dim = len(next(iter(meshes.values())).p)
    own: Any = SimpleNamespace(
        name=name, units=("length", "stress"), dim=dim, analysis=KINDS["solid"]
    )
    own.components = KINDS["solid"].components[:dim]
    roles = [
        "none",
        *dict.fromkeys(side for one in meshes.values() for side in one.boundaries or {}),
    ]
    items = [
        item | {"name": f"{body}: {side}", "role": roles.index(side)}
        for body, mesh in meshes.items()
        for side, item in _sides(mesh)
    ]
    told = "This is what the mesh file holds. The list switches each boundary on and off."
    return _write(own, meshes, ([], items), roles, [], (told, f"{name}\n{text}", notes), file)


def _write(
    scene: Any,
    meshes: Mapping[str, Any],
    shown: tuple[list[dict[str, Any]], list[dict[str, Any]]],
    roles: Sequence[str],
    planes: list[Any],
    words: tuple[str, str, Sequence[str]],
    file: str | Path,
) -> Path:
    """The page of bodies (meshes by name), pairs, boundaries with their roles, and words."""
    pairs, items = shown
    what = "what it is for" if roles is ROLES else "boundary"
    units = [*scene.units, force_unit(scene.units)]
    places = [item["places"] for item in (*items, *pairs)]
    box = whole_box(box_of([*places, *(_spatial(mesh.p) for mesh in meshes.values())]), planes)
    near = box_of([item["places"] for item in pairs]) if pairs else box
    wide = 0.2 * float(np.ptp(near, axis=0).max())
    data = {
        "units": units,
        "dim": scene.dim,
        "axes": list(scene.components),
        "ring": scene.analysis.revolved,
        "mirrors": planes,
        "box": box.tolist(),
        "contact": [(near[0] - wide).tolist(), (near[1] + wide).tolist()],
        "scale": 1.0,
        "most_scale": 1.0,
        "words": {"role": [what, ""], "gap": ["initial gap", scene.units[0]]},
        "roles": roles,
        "bodies": _bodies(scene, meshes, planes),
        "contacts": [_packed(item, scene.dim) for item in (*pairs, *items)],
        "states": 1,
        "moving": False,
        "history": None,
        "columns": {},
    }
    lines = words[1].splitlines()[1:]
    body = filled(
        "view.html",
        scene=html.escape(scene.name),
        certificate=f"<p>{words[0]}</p>",
        remarks=remark_list(words[2]),
        move="move" if scene.dim == 2 else "turn",
        followers="",
        arrows="loads, supports, and normals from the lower to the upper body,",
        convention="A negative gap is an overlap. The arrow of a plate or bolt is its total force."
        " A support holds along the axis of its triangles, along all axes if they are full.",
        pairs="",
        cells=_rows(lines if roles is ROLES else [f" {text}" for text in lines]),
    )
    return write_html(file, f"contactopt: {scene.name}", body, data, ["painter.js", "view.js"])


def _rows(lines: Sequence[str]) -> str:
    """HTML of a text: a row for each line 'name: words' with indented ones below; pairs first."""
    rows: list[list[str]] = []
    for text in lines:
        if text.startswith(" ") and rows:
            rows[-1].append(text.strip())
        else:
            rows.append(text.split(": ", 1) if not text.startswith(" ") else ["", text])
    rows.sort(key=lambda row: not row[0].startswith("pair "))
    rows = [list(map(html.escape, row)) for row in rows if row[0] != "note"]  # which are remarks
    return "".join(
        f'<tr><th scope="row">{name}</th><td>{"<br>".join(words)}</td></tr>'
        if name and words
        else f'<tr><td colspan="2">{"<br>".join([name, *words])}</td></tr>'
        for name, *words in rows
    )


def _bodies(scene: Scene, meshes: Mapping[str, Any], planes: list[Any]) -> list[dict[str, Any]]:
    """The bodies with meshes, each coloured by its number."""
    inside = scene.dim == 3 and sum(mesh.p.shape[1] for mesh in meshes.values()) <= MOST_INSIDE
    made = []
    for name, mesh in meshes.items():
        kind, elements = elements_of(mesh)
        block = SimpleNamespace(type=kind, data=elements, dim=scene.dim)
        count = mesh.doflocs.shape[1]
        values = {"move": np.zeros((1, count, scene.dim))}
        drawn = SimpleNamespace(cells=[block], points=_spatial(mesh.doflocs))
        made.append({"name": name} | body_arrays(drawn, values, planes, inside))
    return made


def _spatial(points: np.ndarray) -> np.ndarray:
    """Points (dim, n) as (n, 3)."""
    return np.pad(points, ((0, 3 - len(points)), (0, 0))).T


def _pair(pair: Contact, made: Coupling, many: int) -> dict[str, Any]:
    """The contacts of a pair with their gaps and normals."""
    return {
        "name": pair.name,
        "places": _spatial(made.positions),
        "cells": made.cells.T,
        "role": len(ROLES) - 1,
        "gap": made.gap,
        "vector": _spatial(made.frames[:, 0].T),
        "marked": _spread(_spatial(made.positions), many),
    }


def _spread(places: np.ndarray, many: int) -> np.ndarray:
    """Which (k,) of the marked places, so many at most, lie far apart; a middle one first."""
    marked = np.zeros(len(places), dtype=bool)
    far = -np.linalg.norm(places - places.mean(axis=0), axis=1)
    for _ in range(min(many, len(places))):
        marked[last := int(np.argmax(far))] = True
        away = np.linalg.norm(places - places[last], axis=1)
        far = away if marked.sum() == 1 else np.minimum(far, away)
    return marked


def _boundaries(
    scene: Scene, part: Part, mesh: Mesh, planes: set[tuple[int, float]]
) -> Iterator[dict[str, Any]]:
    """The named boundaries of a body, its loads, and the axes along which supports hold it."""
    held = {support.boundary: support.displacement for support in part.supports}
    centre = _spatial(mesh.p.mean(axis=1, keepdims=True))[0]
    size = float(np.ptp(mesh.p, axis=1).max())
    loads = {load.boundary: load for load in part.loads}
    for name, item in _sides(mesh):
        load = loads.get(name)
        role = (4 if load.shared else 3 if load.level else 2) if load else 1 if name in held else 0
        if role == 0 and name in scene.surfaces_of(part):
            continue  # the pairs show it
        places, vector = item["places"], item["vector"]
        if load:
            x, n = _normals(mesh, mesh.boundaries[name])
            vector[:, : scene.dim] = load.density(x, n).T
        if load and load.total:
            middle = np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1))
            mean = n.mean(axis=1) / np.linalg.norm(n.mean(axis=1))
            vector[middle, : scene.dim] = load.resultant(scene.components, mean)
            item["marked"] = np.arange(len(places)) == middle
        if any(np.ptp(places[:, a]) <= 1e-9 * size >= abs(places[0, a] - x) for a, x in planes):
            item["hidden"] = True
        if role == 1:
            item["held"] = _held(scene, held[name], places, centre, size)
        yield item | {"name": f"{part.name}: {name} ({ROLES[role]})", "role": role}
    for name in held:
        faces = Support(name).faces(mesh.boundaries)
        if len(faces) > 1:
            each = (facet_nodes(mesh, np.asarray(mesh.boundaries[face])) for face in faces)
            places = _spatial(mesh.doflocs[:, reduce(np.intersect1d, each)])
            yield {
                "name": f"{part.name}: {name} ({ROLES[1]})",
                "places": places,
                "cells": np.zeros((0, 3), dtype=int),
                "role": 1,
                "marked": _spread(places, SYMBOLS),
                "vector": np.zeros(places.shape),
                "held": _held(scene, held[name], places, centre, size),
            }
    for load in part.loads:
        if not load.boundary:
            middle = mesh.p.mean(axis=1, keepdims=True)
            yield {
                "name": f"{part.name}: {load.what}",
                "places": _spatial(middle),
                "cells": np.zeros((0, 3), dtype=int),
                "role": 2,
                "vector": _spatial(load.density(middle, middle)),
            }


def _held(
    scene: Scene,
    held: Mapping[str, float] | None,
    places: np.ndarray,
    centre: np.ndarray,
    size: float,
) -> np.ndarray:
    """Symbols (k, 3) of a support at its places (k, 3), outwards along the axes that it holds."""
    axes = np.array([c in (held or scene.components) for c in scene.components])
    if axes.all():  # one symbol, across the boundary
        axes = 2.0 * (np.arange(scene.dim) == np.argmin(np.ptp(places, axis=0)[: scene.dim]))
    outward = np.where(places.mean(axis=0) > centre + 1e-6 * size, 1.0, -1.0)
    return np.tile(outward * np.pad(axes, (0, 3 - scene.dim)), (len(places), 1))


def _normals(mesh: Mesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the nodes of facets, and outward normals there (dim, m), zero within edges."""
    corners = mesh.facets[:, facets]
    places = FACES[mesh.refdom.__name__][2][:, : len(corners)]
    sums = np.zeros(mesh.doflocs.shape)
    for own, n in zip(corners, np.moveaxis(Faces(mesh, facets, places).normals, 2, 0)):
        np.add.at(sums.T, own, n.T)
    nodes = facet_nodes(mesh, facets)
    length = np.linalg.norm(sums[:, nodes], axis=0)
    return mesh.doflocs[:, nodes], sums[:, nodes] / np.where(length > 0, length, 1.0)


def _sides(mesh: Mesh) -> Iterator[tuple[str, dict[str, Any]]]:
    """The nodes of each named boundary, in space the triangles between them, and no arrows."""
    kind, faces = surface(*elements_of(mesh), _spatial(mesh.doflocs))
    for name, side in (mesh.boundaries or {}).items():
        facets = np.asarray(side)
        nodes, place = facet_nodes(mesh, facets), np.zeros(mesh.doflocs.shape[1], dtype=int)
        place[nodes] = np.arange(len(nodes))
        cells = np.zeros((0, 3), dtype=int)
        if len(mesh.p) == 3:
            shown = np.isin(facets_at(mesh, faces[:, : CORNERS[kind]].T), facets)
            cells = place[triangles(pieces(kind, faces[shown]))]
        places = _spatial(mesh.doflocs[:, nodes])
        marked, vector = _spread(places, SYMBOLS), np.zeros(places.shape)
        yield name, {"places": places, "cells": cells, "vector": vector, "marked": marked}


def _packed(item: dict[str, Any], dim: int) -> dict[str, Any]:
    """An item for the program of the page; a line of contacts in the plane is drawn as dots."""
    k, cells = len(item["places"]), np.asarray(item["cells"])
    flat = cells if dim == 3 and len(cells) else np.zeros((0, 3), dtype=int)
    states = {
        "role": np.full(k, item["role"]),
        "gap": item.get("gap", np.full(k, np.nan)),
        "status": item.get("marked", np.ones(k)) * 1.0,
        "vector": item["vector"],
    } | ({"held": item["held"]} if "held" in item else {})
    return {
        "name": item["name"],
        "hidden": item["role"] == 0 or item.get("hidden", False),
        "points": packed(item["places"]),
        "move": packed(np.zeros((1, k, dim))),
        "cells": packed(triangles(flat)),
        "states": {name: packed(values) for name, values in states.items()},
    }
