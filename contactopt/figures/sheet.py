"""What a scene is, as a text: sketch, bodies with their sizes and loads, arguments, source, and
what is known exactly.
"""

from importlib import import_module
from inspect import Parameter, getdoc, signature
from typing import Any

import numpy as np
from skfem import Mesh

from contactopt.cards import count
from contactopt.figures.pieces import pieces, surface, triangles
from contactopt.figures.solids import nearest
from contactopt.meshes.cells import elements_of
from contactopt.scenes import PATHS, SCENES, make_path, make_scene
from contactopt.scenes.loads.load import number_words
from contactopt.scenes.scene import Scene

COLUMNS, ROWS = 60, 24  # of the sketch, at most
ASPECT = 2.0  # height of a character over its width
MARKS = "#*o+x%@&"


def describe(name: str, changes: dict[str, Any]) -> str:
    """Write the sheet of a named scene or scene file; InputError for what is unknown or wrong."""
    if name.endswith(".toml"):
        from contactopt.scenes.scene_files import read_scene_file

        states = read_scene_file(name, changes).states
        head, arguments = [name], []
    else:
        states = make_path(name, **changes) if name in PATHS else (make_scene(name, **changes),)
        head, arguments = [f"{name}: {SCENES[name][2]}"], _argument_lines(name)
    scene = states[-1]
    length, stress = scene.units
    kind = f"kind {scene.kind}, lengths in {length}, stresses in {stress}; {scene.friction}"
    lines = [*head, kind, ""]
    meshes = {
        name: part.build_mesh(min(scene.elements, 8), scene.zone)
        for name, part in scene.meshed.items()
    }
    if meshes:
        legend = "  ".join(f"{mark} {part}" for mark, part in zip(MARKS, meshes))
        lines += [*sketch(list(meshes.values())), "", legend + _section(scene), ""]
    for part in scene.parts:
        lines += part_lines(scene, part, meshes.get(part.name))
    images = f"; {scene.copies} mirror images make the whole" if scene.copies > 1 else ""
    names = ", ".join(pair.name for pair in scene.pairs)
    lines.append(f"{count(len(scene.pairs), 'pair')} of surfaces: {names}{images}")
    if len(states) > 1:
        lines.append(f"load path of {len(states)} states")
    exact = "nothing is known exactly"
    if scene.reference is not None:
        exact = f"known exactly: {scene.reference.label}"
    return "\n".join([*lines, exact, *arguments])


def _argument_lines(name: str) -> list[str]:
    """The docstring of the scene's function, its arguments and those of its load path."""
    module = SCENES[name][0]
    fixed = SCENES[name][-1] if isinstance(SCENES[name][-1], dict) else {}
    makers = [
        getattr(import_module(f"contactopt.scenes.{table[name][0]}"), table[name][1])
        for table in (PATHS, SCENES)
        if name in table
    ]
    lines = [
        "",
        *(getdoc(makers[-1]) or "").splitlines(),
        "",
        "arguments, to be changed by --set NAME=VALUE:",
    ]
    found = {
        argument: value
        for make in reversed(makers)
        for argument, value in signature(make).parameters.items()
    }
    for argument, parameter in found.items():
        if argument not in fixed and parameter.kind is not Parameter.VAR_KEYWORD:
            value = "" if parameter.default is Parameter.empty else f" = {parameter.default!r}"
            lines.append(f"  {argument}{value}")
    return [*lines, f"source: contactopt/scenes/{module}.py"]


def _section(scene: Scene) -> str:
    if scene.analysis.revolved:
        return "  (one half of the section)"
    return "" if scene.copies == 1 else "  (the part that is modelled)"


def part_lines(scene: Scene, part: Any, mesh: Mesh) -> list[str]:
    length, stress = scene.units
    lines = [f"body '{part.name}'"]
    material = getattr(part, "material", None)
    if material is not None:
        lines[0] += f": E = {material.E:g} {stress}, nu = {material.nu:g}"
    if mesh is not None:
        size = " x ".join(f"{extent:g}" for extent in np.ptp(mesh.p, axis=1))
        lines[0] += f"; {size} {length}"
        for support in part.supports:
            held = support.displacement
            what = "clamped" if held is None else number_words(held)
            lines.append(f"  support '{support.boundary}': {what}")
        lines += [f"  {load.words(scene.components)}" for load in part.loads]
    elif not part.elastic:
        lines[0] += ": rigid"
    if getattr(part, "force", None):
        lines.append(f"  total force: {number_words(part.force)}")
    return lines


def sketch(meshes: list[Any]) -> list[str]:
    """Lines of characters, one mark per body; of a solid, the section across the second axis."""
    axes = [0, -1]
    low, high = _window([mesh.p[axes] for mesh in meshes])
    size = np.maximum(high - low, 1e-300)
    step = max(size[0] / COLUMNS, size[1] / (ROWS * ASPECT))  # of a column
    columns, rows = max(1, round(size[0] / step)), max(1, round(size[1] / (step * ASPECT)))
    scale = np.array([columns, rows]) / size
    picture = np.full((rows, columns), " ")
    for mark, mesh in zip(MARKS * len(meshes), meshes):
        kind, elements = elements_of(mesh)
        if len(mesh.p) == 3:  # the cells that the section through the least second coordinate meets
            second = mesh.p[1][elements]
            met = second.min(axis=1) <= second.min() + 1e-9 * np.ptp(mesh.p[1])
            elements = elements[met]
        kind, faces = surface(kind, elements, mesh.p.T)
        corners = mesh.p.T[triangles(pieces(kind, faces))]
        flat = np.zeros((len(corners), 3, 3))
        flat[..., :2] = (corners[..., axes] - low) * scale
        picture[nearest(flat, (rows, columns)) >= 0] = mark
    return ["".join(row).rstrip() for row in picture[::-1]]


def _window(places: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest coordinates (2,) of the picture: of all bodies, or about a small one."""
    ends = np.array([[x.min(axis=1), x.max(axis=1)] for x in places])  # (bodies, 2, 2)
    low, high = ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
    extent = (ends[:, 1] - ends[:, 0]).max(axis=1)
    small = int(np.argmin(extent))
    if extent[small] > 0.2 * extent.max():  # smaller bodies are drawn near
        return low, high
    centre = ends[small].mean(axis=0)
    return np.maximum(low, centre - extent[small]), np.minimum(high, centre + extent[small])
