"""The estimated error of a quantity, by body and element."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from contactopt.analysis.places import StressReading
from contactopt.analysis.solve_scene import Solved
from contactopt.derivatives.outputs import seeds_of
from contactopt.derivatives.states import Duals, Step

ENERGY = "energy"


@dataclass(frozen=True, eq=False)
class ElementErrors:
    """What each element adds to the error of a quantity.

    value      of the quantity [its unit]
    bodies     for each body what its elements add (elements,), signed [unit of the quantity]; (0,) for a body without a mesh
    energy     estimated error of the displacement in the energy norm, over the norm of the displacement [-]
    stress     where the quantity is a stress: the reading of it
    """

    value: float
    bodies: tuple[np.ndarray, ...]
    energy: float
    stress: StressReading | None = None

    @property
    def total(self) -> float:
        """The estimated error J - J_h [unit of the quantity]."""
        return float(sum(part.sum() for part in self.bodies))

    def marked(self, share: float) -> tuple[np.ndarray, ...]:
        """For each body the fewest elements that together make this share of the sum of absolute errors (Doerfler)."""
        sizes = np.abs(np.concatenate(self.bodies))
        order = np.argsort(-sizes, kind="stable")
        count = int(np.searchsorted(np.cumsum(sizes[order]), share * sizes.sum())) + 1
        chosen = np.zeros(len(sizes), dtype=bool)
        chosen[order[:count]] = True
        first = np.cumsum([0, *(len(part) for part in self.bodies)])
        return tuple(np.flatnonzero(chosen[a:b]) for a, b in pairwise(first))


def element_errors(solved: Solved, quantity: str) -> ElementErrors:
    """What each element adds to the error of a quantity, estimated as in contactopt.adaptivity.

    Parameters
    ----------
    solved : a scene that was reduced and solved
    quantity : a name of contactopt.derivatives.outputs. For "energy" no adjoint is needed: the energy of the error itself
        is taken, without a sign

    Returns
    -------
    ElementErrors : signed shares of the error J - J_h

    Raises
    ------
    InputError : for a quantity that the scene does not have
    """
    step = Step(solved.reduction, solved.reduction.problem, solved.solution)
    seeds = seeds_of(quantity, step)
    own = tuple(body.recovery_error(U, U) for body, U in zip(solved.reduction.bodies, step.displaced))
    energy = sum(body.energy(U) for body, U in zip(solved.reduction.bodies, step.displaced))
    missing = sum(part.sum() for part in own) / 2
    norm = float(np.sqrt(missing / energy)) if energy > 0 else 0.0
    if quantity == ENERGY:
        return ElementErrors(seeds.value, tuple(part / 2 for part in own), norm)
    dual = step.sensitivity.adjoint(
        reactions=seeds.reactions, multipliers=seeds.multipliers, displacements=seeds.displacements
    )
    bodies = zip(solved.reduction.bodies, step.displaced, Duals(step, dual, seeds.bodies).fields)
    errors = tuple(body.recovery_error(U, W) for body, U, W in bodies)
    return ElementErrors(seeds.value, errors, norm, seeds.stress)
