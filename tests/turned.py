"""Scenes that are not symmetric to the axes, and the same turned or mirrored."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import skfem

from contactopt import (
    InterfaceProblem,
    Material,
    Part,
    Plate,
    Rigid,
    Scene,
    Support,
    Traction,
    scenes,
)
from contactopt.meshes.structured import graded, patch, rename, tensor_mesh

SOFT, STIFF = Material(5.0, 0.3), Material(20.0, 0.2)


def turn(degrees: float) -> np.ndarray:
    """Rotation of the plane (2, 2)."""
    a = np.deg2rad(degrees)
    return np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])


def turn_about(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    """Rotation of space (3, 3) about an axis, by Rodrigues' formula."""
    a, (x, y, z) = np.deg2rad(degrees), np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * (K @ K)


def mirror(dim: int, axis: int = 0) -> np.ndarray:
    """Reflection (dim, dim) that turns one axis round."""
    R = np.eye(dim)
    R[axis, axis] = -1.0
    return R


def moved(scene: Scene, R: np.ndarray) -> Scene:
    """The whole scene with every point x at R x: meshes, loads, curves, gaps."""

    def mesh(part: Part) -> Callable:
        def build(elements, zone):
            made = part.build_mesh(elements, zone)
            return replace(made, doflocs=R @ made.p)

        return build

    def vector(values: dict[str, float] | None) -> dict[str, float] | None:
        if values is None:
            return None
        names, moved = scene.components, R @ [values.get(name, 0.0) for name in scene.components]
        if set(values) == set(names):
            return dict(zip(names, moved))
        there = np.abs(R) @ [name in values for name in names]
        assert np.allclose(there, np.round(there), atol=1e-9), (
            "give all components, or turn axes onto axes"
        )
        return {name: value for name, value, own in zip(names, moved, there) if own > 0.5}

    def load(old):
        if isinstance(old, Plate):
            return replace(old, force=vector(old.force))
        return replace(old, value=tuple(R @ np.array(old.value)))

    def curve(part: Part):
        return None if part.curve is None else lambda x: R @ part.curve(R.T @ x)

    def part_of(part: Part | Rigid):
        if isinstance(part, Rigid):
            return replace(
                part,
                normal=None if part.normal is None else tuple(R @ np.array(part.normal)),
                gap=None if part.gap is None else lambda x: part.gap(R.T @ x),
                force=vector(part.force),
            )
        supports = tuple(replace(s, displacement=vector(s.displacement)) for s in part.supports)
        loads = tuple(load(old) for old in part.loads)
        mine = {"mesh": mesh(part), "curve": curve(part), "supports": supports, "loads": loads}
        return replace(part, **mine)

    return replace(scene, upper=part_of(scene.upper), lower=part_of(scene.lower))


def renumbered(problem: InterfaceProblem, order: np.ndarray, unit: float = 1.0) -> InterfaceProblem:
    """The same contacts in another order, and their places in another unit of length."""
    rows = (problem.dim * order[:, None] + np.arange(problem.dim)).ravel()
    own = problem.chart
    cells = None if own.cells is None else np.argsort(order)[own.cells]
    return replace(
        problem,
        Q=problem.explicit().Q[np.ix_(rows, rows)],
        q=problem.q[order],
        law=problem.law.select(order),
        V=problem.V[rows],
        areas=unit**2 * problem.areas[order],
        coordinates=unit * problem.coordinates[:, order],
        chart=replace(own, places=unit * own.places[:, order], cells=cells),
    )


def _even(half: float, length: float, elements: int, growth: float = 1.5) -> np.ndarray:
    """Symmetric grid, even on (-half, half), then growing to +-length."""
    grid, h = list(np.linspace(0, half, elements + 1)), half / elements
    while grid[-1] < length - 1e-9:
        h *= growth
        grid.append(length if grid[-1] + 1.5 * h > length else grid[-1] + h)
    return np.concatenate([-np.array(grid[:0:-1]), grid])


def punch(dim: int = 2, elements: int = 6, mu: float = 0.3) -> Scene:
    """The whole of a flat punch on a foundation that is clamped below, pressed and dragged by a
    plate glued to its top.
    """
    wide = 20.0 if dim == 2 else 15.0
    force = {"x": 4.0, "y": -100.0} if dim == 2 else {"x": 4.0, "y": 2.0, "z": -100.0}
    up = "xyz"[dim - 1]

    def upper(elements, zone):
        across = [_even(20.0, 20.0, elements), _even(wide, wide, elements)][: dim - 1]
        return rename(
            tensor_mesh(*across, np.linspace(0, 40, elements + 1)), contact=f"{up}-", top=f"{up}+"
        )

    def lower(elements, zone):
        across = [_even(20.0, 80.0, elements), _even(wide, 70.0, elements)][: dim - 1]
        mesh = rename(
            tensor_mesh(*across, -graded(80.0, 20.0 / elements, 1.5)[::-1]),
            bottom=f"{up}-",
            top=f"{up}+",
        )
        corner = np.array([20.0, wide, 0.0] if dim == 3 else [20.0, 0.0])
        shifted = replace(mesh, doflocs=mesh.p + corner[:, None])
        cut = patch(shifted, "top", "contact", [40.0, 2 * wide][: dim - 1])
        inside = (
            cut.p[:, cut.facets[:, cut.boundaries["contact"]]].mean(axis=1)[: dim - 1].min(axis=0)
            > 0
        )
        return mesh.with_boundaries({"contact": cut.boundaries["contact"][inside]})

    return Scene(
        f"full punch {dim}d",
        Part("punch", upper, SOFT, (), (Plate("top", force),)),
        Part("foundation", lower, STIFF, (Support("bottom"),)),
        mu,
        kind="plane-strain" if dim == 2 else "solid",
        elements=elements,
    )


def cylinder(elements: int = 8) -> Scene:
    """A whole cylinder pressed on a flat body and pushed sideways."""
    return scenes.cattaneo(2, elements=elements, shear=20.0)


def ring(inner: float, outer: float, layers: int, sectors: int) -> skfem.MeshQuad:
    """A whole annulus of quadrilaterals, unevenly divided along the circle."""
    angle = 2 * np.pi * np.arange(sectors) / sectors
    angle = angle + 0.15 * np.sin(angle) + 0.05 * np.cos(3 * angle)
    radius = np.linspace(inner, outer, layers + 1)
    p = (
        (radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)]))
        .transpose(1, 0, 2)
        .reshape(2, -1)
    )
    node = np.arange(p.shape[1]).reshape(layers + 1, sectors)
    after = np.roll(node, -1, axis=1)
    t = np.stack([node[:-1], node[1:], after[1:], after[:-1]]).reshape(4, -1)
    middle = (inner + outer) / 2
    return skfem.MeshQuad(p, t).with_boundaries(
        {
            "inside": lambda x: np.linalg.norm(x, axis=0) < middle,
            "outside": lambda x: np.linalg.norm(x, axis=0) > middle,
        }
    )


def pin_in_bush(
    clearance: float = 0.5, sectors: int = 40, mu: float = 0.2, radius: float = 20.0
) -> Scene:
    """A pin with a hole, loaded in the hole through a glued plate."""
    pin = Part(
        "pin",
        ring(radius / 2, radius - clearance, 3, sectors),
        STIFF,
        (),
        (Plate("inside", {"x": 10.0, "y": -100.0}),),
        "outside",
    )
    bush = Part(
        "bush", ring(radius, 2 * radius, 4, sectors), SOFT, (Support("outside"),), (), "inside"
    )
    return Scene("pin in a bush", pin, bush, mu)


def pulled_block(elements: int = 4) -> Scene:
    """A block with a rigid floor of its own normal, pressed by a traction and held by nothing but a
    plate's rest.
    """
    mesh = rename(
        tensor_mesh(np.linspace(0, 3, elements + 1) ** 1.1, np.linspace(0, 1, elements + 1)),
        contact="y-",
        top="y+",
    )
    load = (Traction("top", (0.1, -0.5)), Plate("top", {"x": 0.2, "y": -1.0}))
    return Scene(
        "block on a floor", Part("block", mesh, SOFT, (), load), Rigid("floor", (0.0, 1.0)), 0.3
    )
