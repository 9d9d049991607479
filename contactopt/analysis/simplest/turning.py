"""A scene seen from turned axes: the same bodies at R x, with all vectors, fields and functions turned along.

Supports and plates speak of components. One that holds or frees only some of them is a statement about the axes of space, and
can be turned only where R takes these axes to axes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.analysis.simplest.images import held_space
from contactopt.errors import InputError
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import Plate, Rigid, Scene, Support

STRAIGHT = 1e-9  # a turned component beside one counts as zero


def turned(scene: Scene, R: np.ndarray) -> Scene:
    """The scene with every point x at R x.

    Parameters
    ----------
    scene
        Of elastic and rigid bodies.
    R
        Rotation (dim, dim).

    Returns
    -------
    Scene
        With the same answers, turned.

    Raises
    ------
    InputError
        If a support or a plate names components that the rotation mixes with others.
    """
    made = scene.with_parts(lambda part: _part(scene, part, R))
    pairs = tuple(replace(pair, mu=_turned_back(pair.mu, R)) for pair in scene.pairs)
    return with_pairs(made, pairs)


def with_pairs(scene: Scene, pairs: tuple[Contact, ...]) -> Scene:
    """The scene with other pairs of surfaces; it keeps its short form if it has one and the new pair fits into it."""
    if scene.contacts or len(pairs) != 1:
        return replace(scene, upper=None, lower=None, mu=None, law="coulomb", bodies=scene.parts, contacts=pairs)
    return replace(scene, mu=pairs[0].mu, law=pairs[0].law)


def _part(scene: Scene, part: Any, R: np.ndarray) -> Any:
    components = scene.components
    if isinstance(part, Rigid):
        return replace(
            part,
            normal=None if part.normal is None else tuple(float(v) for v in R @ np.array(part.normal, float)),
            gap=_turned_back(part.gap, R),
            force=_turned_free(components, part.force, R, f"the force on rigid body '{part.name}'"),
            displacement=_turned_free(
                components, part.displacement, R, f"the displacement of rigid body '{part.name}'"
            ),
        )

    def load(old: Any) -> Any:
        if isinstance(old, Plate):
            force = _turned_values(components, old.force, R, f"the plate on {old.boundary!r} of body '{part.name}'")
            return replace(old, force=force or {})
        return replace(old, value=tuple(float(v) for v in R @ np.array(old.value, float)))

    def support(old: Support) -> Support:
        name = f"the support on {old.boundary!r} of body '{part.name}'"
        return replace(old, displacement=_turned_values(components, old.displacement, R, name))

    curves = {name: part.curve_of(name) for name in scene.surfaces_of(part)}
    turned_curves = {name: _turned_curve(curve, R) for name, curve in curves.items() if curve is not None}
    return replace(
        part,
        mesh=of_mesh(part.mesh, lambda mesh: replace(mesh, doflocs=np.ascontiguousarray(R @ mesh.doflocs))),
        loads=tuple(load(old) for old in part.loads),
        supports=tuple(support(old) for old in part.supports),
        curve=turned_curves or None,
    )


def of_mesh(mesh: Any, change: Callable[[Any], Any]) -> Any:
    """A changed mesh, or the function that makes it where the mesh is made for a number of elements."""
    if callable(mesh):
        return lambda elements, zone: change(mesh(elements, zone))
    return change(mesh)


def _turned_back(function: Any, R: np.ndarray) -> Any:
    return (lambda x: function(R.T @ x)) if callable(function) else function


def _turned_curve(curve: Callable[[np.ndarray], np.ndarray], R: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda x: R @ curve(R.T @ x)


def _turned_values(
    components: tuple[str, ...], values: Mapping[str, float] | None, R: np.ndarray, what: str
) -> dict[str, float] | None:
    """Values of components after the turn, by their new names."""
    if values is None:
        return None
    P, v = held_space(components, values)
    Q, w = R @ P @ R.T, R @ v
    mask = np.diag(Q) > 0.5
    if np.abs(Q - np.diag(mask.astype(float))).max() > STRAIGHT:
        raise InputError(f"{what} holds components that no longer are components after the turn.")
    w[np.abs(w) <= STRAIGHT * np.abs(v).max()] = 0.0
    return {component: float(value) for component, value, own in zip(components, w, mask) if own}


def _turned_free(components: tuple[str, ...], values: Mapping[str, float] | None, R: np.ndarray, what: str) -> Any:
    return _turned_values(components, values, R, what) if values else values
