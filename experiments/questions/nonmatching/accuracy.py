"""Errors on meshes that do not match over those on meshes that do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from contactopt import reduce_bodies, scenes, solve
from contactopt.scenes.sliding import _sheared
from contactopt.solving.follow import follow
from experiments.questions.accuracy.sheared import error
from experiments.questions.nonmatching.bodies import apart, carried, press_fit

SHEARS = (10.0, 30.0, 45.0)
OTHERS = (5.0, 15.0, 25.0, 35.0)


def press_fits() -> list[dict[str, Any]]:
    rows = []
    for degree, mu in ((2, 0.0), (1, 0.0), (2, 0.15), (1, 0.15)):
        for carrier in ("lower", "upper"):
            last = None
            for n in (8, 16, 32):
                scene, exact = press_fit((n, 3 * n // 2), degree, carrier, mu)
                problem = reduce_bodies(scene).problem
                reactions = solve(problem).reactions
                p, q = (reactions / problem.areas[:, None]).T
                off = (
                    error(p, np.full(len(p), exact), problem.areas),
                    float(np.abs(p / exact - 1).max()),
                )
                row: dict[str, Any] = {"degree": degree, "mu": mu}
                row |= {"contacts on": "fine side" if carrier == "lower" else "coarse side"}
                row |= {"elements": f"{n}:{3 * n // 2}", "p in L2": off[0], "p, largest": off[1]}
                orders = (
                    ("", "")
                    if last is None
                    else tuple(float(np.log2(a / b)) for a, b in zip(last, off))
                )
                row |= {"order in L2": orders[0], "order of the largest": orders[1]}
                rows.append(row | {"friction, largest": float(np.abs(q).max() / exact)})
                last = off
    return rows


def sheared(
    sizes: tuple[int, int],
    degree: int,
    shear: float,
    carrier: str | None,
    made: float | None = None,
) -> tuple[float, float, bool]:
    """Cattaneo and Mindlin's cylinders pressed, then sheared: L2 errors of pressure and traction.

    made  the shear for which the meshes have nodes at the edges of stick; None: the same
    """
    scene = scenes.cattaneo(2, shear=shear)
    if made is not None:
        other = scenes.cattaneo(2, shear=made)
        parts = {
            side: replace(getattr(scene, side), mesh=getattr(other, side).mesh)
            for side in ("upper", "lower")
        }
        scene = replace(scene, **parts)
    scene = apart(scene, *sizes, degree)
    states = [_sheared(scene, share) for share in (0.0, 1.0)]
    path = follow(states if carrier is None else [carried(state, carrier) for state in states])
    problem, r = path.reduction.problem, path.solution.reactions
    x, exact = np.abs(problem.coordinates[0]), scene.reference
    p = error(r[:, 0] / problem.areas, exact.pressure(x), problem.areas)
    return p, error(-r[:, 1] / problem.areas, exact.shear(x), problem.areas), path.solved


def cattaneo() -> list[dict[str, Any]]:
    """Root mean squares of both errors over several shears, on meshes for them and for others."""
    rows = []
    for made, shears in ((None, SHEARS), (45.0, OTHERS)):
        for degree in (1, 2):
            base: np.ndarray | None = None
            for sizes in ((20, 20), (16, 24), (24, 16)):
                carriers: tuple[str | None, ...] = (
                    (None,) if sizes[0] == sizes[1] else ("upper", "lower")
                )
                for carrier in carriers:
                    found = [sheared(sizes, degree, shear, carrier, made) for shear in shears]
                    rms = np.sqrt(_squares(found))
                    base = rms if base is None else base
                    own, other = sizes if carrier == "upper" else sizes[::-1]
                    on = (
                        "matching nodes"
                        if own == other
                        else "fine side"
                        if own > other
                        else "coarse side"
                    )
                    nodes = "at the edges of stick" if made is None else "anywhere"
                    row: dict[str, Any] = {
                        "nodes": nodes,
                        "degree": degree,
                        "elements": f"{sizes[0]}:{sizes[1]}",
                    }
                    row |= {"contacts on": on, "p in L2": float(rms[0]), "q in L2": float(rms[1])}
                    row |= {
                        "p over 20:20": float(rms[0] / base[0]),
                        "q over 20:20": float(rms[1] / base[1]),
                    }
                    rows.append(row | {"solved": all(f[2] for f in found)})
    return rows


def _squares(found: list[tuple[float, float, bool]]) -> np.ndarray:
    """Mean squares (2,) of the errors of pressure and traction."""
    return np.asarray(np.mean(np.array([f[:2] for f in found]) ** 2, axis=0))
