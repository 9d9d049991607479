"""The signed maps of bodies, and q, V, s and the law of all pairs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody
from contactopt.bodies.protocol import Body
from contactopt.coupling.coupling import Coupling, law_of
from contactopt.linear.operators import Interface
from contactopt.problem import InterfaceProblem, Pair
from contactopt.problem.laws import join
from contactopt.scenes.scene import Scene


def signed_map(
    body: AssembledBody,
    sides: Sequence[tuple[AssembledBody, AssembledBody]],
    couplings: Sequence[Coupling],
) -> sp.csr_matrix:
    """B (k dim, n) of a body: the maps of its pairs with their signs, else zeros."""
    blocks = [
        made.upper if body is upper else -made.lower if body is lower else None
        for (upper, lower), made in zip(sides, couplings)
    ]
    n = next(block.shape[1] for block in blocks if block is not None)
    none = [sp.csr_matrix((made.upper.shape[0], n)) for made in couplings]
    return sp.csr_matrix(sp.vstack([b if a is None else a for a, b in zip(blocks, none)]))


def problem_of(
    scene: Scene,
    Q: Interface,
    bodies: Sequence[Body],
    maps: Sequence[sp.csr_matrix],
    couplings: Sequence[Coupling],
) -> InterfaceProblem:
    """The interface problem of a scene whose bodies and couplings are made and whose Q is known."""
    gap = np.concatenate([made.gap for made in couplings])
    q = np.zeros((len(gap), maps[0].shape[0] // max(len(gap), 1)))
    q[:, 0] = gap
    for body, B in zip(bodies, maps):
        q += (B @ body.at_rest).reshape(q.shape)
    V = np.concatenate([B @ body.motions for body, B in zip(bodies, maps)], axis=1)
    s = np.concatenate([body.resultants for body in bodies])
    areas = np.concatenate([made.areas for made in couplings])
    points = np.concatenate([made.positions for made in couplings], axis=1)
    ends = np.cumsum([0, *(len(made.gap) for made in couplings)]).tolist()
    named = list(zip(scene.pairs, couplings, ends, ends[1:]))
    pairs = tuple(Pair(pair.name, first, last, made.chart) for pair, made, first, last in named)
    laws = [(law_of(pair, made), np.arange(first, last)) for pair, made, first, last in named]
    law = laws[0][0] if len(laws) == 1 else join(laws)
    chart = pairs[0].chart if len(pairs) == 1 else None
    # what each multiplier is, for messages
    names = tuple(f"body '{body.name}': {name}" for body in bodies for name in body.motion_names)
    return InterfaceProblem(Q, q, law, V, s, areas, points, chart, pairs, names)
