"""Blocks that rest on each other: scenes of bodies whose forces statics alone determines."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from contactopt import BodyForce, Contact, Material, Part, Rigid, Scene
from contactopt.meshes.structured import rename, tensor_mesh


def block(low, high, cells):
    """A box with boundaries bottom, top, left, right."""
    mesh = tensor_mesh(*(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells)))
    up = "xyz"[len(low) - 1]
    return rename(mesh, bottom=f"{up}-", top=f"{up}+", left="x-", right="x+")


def stack(
    count=2,
    dim=2,
    side=0.0,
    weight=1.0,
    width=1.0,
    cells=(4, 4, 4),
    mu=0.5,
    kind=None,
    order=None,
    material=None,
    **more,
):
    """`count` blocks of height one on a rigid floor.

    `side` and `weight` are forces per volume, along x and downwards.

    cells[i] is the number of elements along each side of block i, order a permutation of the
    bodies.
    """
    kind = kind or ("plane-strain" if dim == 2 else "solid")
    force = [0.0] * dim
    force[0], force[-1] = side, -weight
    up = (0.0,) * (dim - 1) + (1.0,)
    bodies, contacts = [Rigid("floor", normal=up)], []
    for i in range(count):
        low, high = [0.0] * (dim - 1) + [float(i)], [width] * (dim - 1) + [i + 1.0]
        mesh = block(low, high, [cells[i % len(cells)]] * dim)
        made = material or Material(1000.0, 0.3)
        bodies.append(
            Part(f"block{i}", mesh, made, loads=(BodyForce(tuple(force)),), contact="bottom")
        )
        contacts.append(Contact(f"block{i}", f"block{i - 1}:top" if i else "floor", mu))
    chosen = bodies if order is None else [bodies[i] for i in order]
    return Scene("stack", bodies=tuple(chosen), contacts=tuple(contacts), kind=kind, **more)


def layered(scene, count):
    """A flat punch whose foundation is cut into `count` layers, tied to each other."""
    whole = scene.lower.build_mesh(scene.elements, scene.zone)
    up = whole.dim() - 1
    at = whole.p[up, whole.t].mean(axis=0)
    planes = np.unique(whole.p[up].round(9))
    ends = planes[np.linspace(0, len(planes) - 1, count + 1).round().astype(int)]
    layers, pairs = [], [Contact("punch", f"layer {count}:contact", scene.pairs[0].mu)]
    for i, (low, high) in enumerate(pairwise(ends), 1):
        mesh = whole.restrict(np.flatnonzero((at > low) & (at < high)))
        mesh = mesh.with_boundaries(
            {
                f"side {side}": lambda x, end=end: np.abs(x[up] - end) < 1e-6
                for side, end in (("low", low), ("high", high))
            }
        )
        held = tuple(own for own in scene.lower.supports if len(mesh.boundaries[own.boundary]))
        face = "contact" if i == count else "side high"
        layers.append(
            replace(scene.lower, name=f"layer {i}", mesh=mesh, supports=held, contact=face)
        )
        if i > 1:
            tied = Contact(f"layer {i}:side low", f"layer {i - 1}:side high", 0.0, "tied")
            pairs.append(replace(tied, coupling="matching"))
    bodies = {"bodies": (scene.upper, *layers), "contacts": tuple(pairs)}
    return replace(scene, upper=None, lower=None, mu=None, law="coulomb", **bodies)
