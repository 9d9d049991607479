"""Rigid indenters on blocks, for which all lengths are of order one.

The block rests without friction on a rigid base and has free sides: neither a clamped corner nor a
size that stands for infinity spoils the order of convergence. E = 1 and nu = .3. The scenes of this
module differ between the two ways in the growth of their elements away from contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from contactopt.material import Material
from contactopt.meshes.structured import graded, patch, rename, tensor_mesh
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Part, Rigid, Scene, Support, Traction

UNIT = Material(1.0, 0.3)
MARGIN = 1.25
EDGE = 1e-4  # first element at the edge of a flat punch, over its half-width
Profile = Callable[[np.ndarray], np.ndarray]


def indented(
    name: str,
    kind: str,
    profile: Profile,
    force: float,
    zone: float,
    size: tuple[float, float],
    growth: float,
    kink: float = 0.0,
) -> Scene:
    """A rigid profile x -> height over its lowest point, pressed by a force per length, or on the
    ring by the whole force, on a block of half-width size[0] and height size[1].

    zone    first guess of the half-width of contact
    growth  ratio of neighbouring elements on the first mesh, away from contact
    kink    where the profile has one, which becomes a node
    """

    def mesh(elements: int, zone: float | None) -> Any:
        assert zone is not None
        across, last = _across(kink, zone, elements, size[0], growth)
        return _block(across, graded(size[1], zone / elements, growth), last)

    indenter = Rigid(name, (0.0, 1.0), lambda x: profile(x[0]), {_up(kind): -force})
    return _on_base(name, kind, indenter, mesh, 0.0, zone)


def bonded(scene: Scene) -> Scene:
    """The scene of a block whose base is clamped."""
    held = Support("axis", {"x": 0.0}), Support("bottom")
    return scene.with_parts(lambda part: replace(part, supports=held) if part.meshed else part)


def coated(scene: Scene, height: float, material: Material, growth: float) -> Scene:
    """The plane scene of a block that is bonded to one of another material and a height below it,
    which rests on the base in its place.
    """
    indenter, layer = scene.parts

    def mesh(elements: int, zone: float | None) -> Any:
        top = layer.build_mesh(elements, zone)
        across, up = (np.unique(places) for places in top.p)
        down = -graded(height, growth * (up[1] - up[0]), growth)[::-1]
        return rename(tensor_mesh(across, up[0] + down), axis="x-", bottom="y-", contact="y+")

    core = Part("core", mesh, material, layer.supports)
    coat = replace(layer, supports=layer.supports[:1])
    pressed = Contact(indenter.name, coat.name, 0.0, "frictionless")
    tied = Contact(f"{coat.name}:bottom", core.name, 0.0, "tied")
    bodies = indenter, coat, core
    return Scene("coated", copies=2, zone=scene.zone, bodies=bodies, contacts=(pressed, tied))


def _across(
    kink: float, zone: float, elements: int, size: float, growth: float
) -> tuple[np.ndarray, float]:
    """Places of nodes from 0 to a size, and the last of them that may touch; `kink` and `zone` are
    among them.
    """
    h = zone / elements
    near = np.linspace(0.0, kink, max(1, round(kink / h)) + 1)[:-1] if kink else np.empty(0)
    between = np.linspace(kink, zone, max(1, round((zone - kink) / h)) + 1)
    beyond = zone + h * np.arange(1, int(np.ceil((MARGIN - 1) * elements)) + 1)
    far = beyond[-1] + graded(size - beyond[-1], h, growth)[1:]
    return np.concatenate([near, between, beyond, far]), float(beyond[-1])


def flat(name: str, kind: str, mu: float, size: tuple[float, float], ratio: float) -> Scene:
    """A rigid flat punch of half-width 1 under a unit force on a block, whose elements shrink to
    EDGE towards the edge of the punch by the ratio of neighbours.
    """

    def mesh(elements: int, zone: float | None) -> Any:
        inner = _capped(1.0, 1 / elements, ratio)
        across = np.concatenate([1 - inner[:0:-1], 1 + graded(size[0] - 1, EDGE, ratio)])
        return _block(across, _capped(size[1], size[1] / 4, ratio), 1.0)

    punch = Rigid(name, force={_up(kind): -1.0})
    return _on_base(name, kind, punch, mesh, mu, None)


def _capped(length: float, largest: float, ratio: float) -> np.ndarray:
    """A grid from 0 to a length whose elements grow from EDGE to the largest."""
    sizes = np.minimum(EDGE * ratio ** np.arange(200), largest)
    grid = np.append(0.0, np.cumsum(sizes))
    cells = max(1, int(np.searchsorted(grid, length)))
    return np.asarray(grid[: cells + 1] * (length / grid[cells]))


def _block(across: np.ndarray, depth: np.ndarray, contact: float) -> Any:
    block = rename(tensor_mesh(across, -depth[::-1]), axis="x-", bottom="y-", top="y+")
    return patch(block, "top", "contact", [contact])


def _on_base(
    name: str, kind: str, indenter: Rigid, mesh: Any, mu: float, zone: float | None
) -> Scene:
    across, up = "x" if kind == "plane-strain" else "r", _up(kind)
    supports = (Support("axis", {across: 0.0}), Support("bottom", {up: 0.0}))
    block = Part("block", partial(mesh), UNIT, supports)
    copies = 2 if kind == "plane-strain" else 1
    return Scene(name, indenter, block, mu, kind=kind, copies=copies, zone=zone)


def _up(kind: str) -> str:
    return "y" if kind == "plane-strain" else "z"


def receding(loaded: float, size: float, zone: float, growth: float) -> Scene:
    """A layer of height 1 without weight on a rigid base without friction, pressed by a unit force
    on |x| < loaded, which is one element on the first mesh; it lifts off beyond its contact.
    """

    def mesh(elements: int, zone: float | None) -> Any:
        assert zone is not None
        across, last = _across(loaded, zone, elements, size, growth)
        up = np.linspace(0, 1, round(elements / zone) + 1)
        layer = patch(rename(tensor_mesh(across, up), axis="x-"), "y-", "contact", [last])
        return patch(layer, "y+", "loaded", [loaded])

    load = Traction("loaded", (0.0, -0.5 / loaded))
    layer = Part("layer", mesh, UNIT, (Support("axis", {"x": 0.0}),), (load,))
    return Scene("receding", layer, Rigid("base"), 0.0, copies=2, zone=zone)
