"""No facet is joined to one body twice, under whatever names: the pairs would share one force."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from contactopt.bodies.assembled import AssembledBody
from contactopt.checks import place_words
from contactopt.errors import InputError
from contactopt.scenes.contact import Contact

Sides = tuple[AssembledBody, AssembledBody]


def check_once(pairs: Sequence[Contact], sides: Sequence[Sides]) -> None:
    """Raise InputError where two pairs of the same two bodies share facets of both."""
    for (first, bodies), (second, _) in combinations(zip(pairs, sides), 2):
        if set(first.bodies) != set(second.bodies):
            continue
        shared = []
        for body, name in zip(bodies, first.surfaces):
            other = second.surfaces[second.bodies.index(body.name)]
            if body.meshed:
                shared.append(_cells(body, name) & _cells(body, other))
        if all(shared):
            near = np.mean(min(shared[0]), axis=0)
            where = place_words(near)
            raise InputError(
                f"contacts '{first.name}' and '{second.name}' share facets of both bodies near"
                f" ({where}), and each would carry a part of their force; keep each facet in one of"
                " these contacts."
            )


def _cells(body: AssembledBody, name: str | None) -> set[tuple[tuple[float, ...], ...]]:
    """The cells of a surface, each by the sorted places of its corners."""
    surface = body.surface(name)
    corners = surface.points[:, surface.cells].T.tolist()
    return {tuple(sorted(map(tuple, cell))) for cell in corners}
