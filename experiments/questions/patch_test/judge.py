"""Whether a pair transmits a constant pressure, by means that share nothing with the check."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from contactopt import InputError, run
from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.coupling.coupling import Coupling
from contactopt.coupling.posed import posed
from experiments.questions.patch_test.pairs import Pair

EXACT = 1e-9


class Verdict(NamedTuple):
    """What is found of one pair.

    forces, pressure  largest relative errors of nodal forces and of the solution's pressure
    said              remarks on the coupling, or the sentence of a refusal
    coupling          its kind, or 'refused'
    wrong             whether it is off by more than EXACT without a word
    """

    seed: int
    kind: str
    forces: float
    pressure: float
    said: tuple[str, ...]
    coupling: str
    wrong: bool


def judge(seed: int, pair: Pair) -> Verdict:
    """Couple the pair, and solve it where the answer is known."""
    try:
        made = posed(pair.scene)
    except InputError as error:
        return Verdict(seed, pair.kind, 0.0, 0.0, (str(error),), "refused", False)
    coupled, forces, pressure = made.couplings[0], 0.0, 0.0
    if pair.covered is not None:
        for number, name in enumerate(pair.scene.pairs[0].bodies):
            body = next(one for one in made.bodies if one.name == name)
            if isinstance(body, AssembledElastic):
                forces = max(forces, _moments(pair, coupled, body, number))
    if pair.pressure is not None:
        found = run(pair.scene, tol=1e-12, figures=()).pressure
        pressure = float(np.abs(found / pair.pressure - 1).max())
    # on a curve the areas of facets that differ never agree
    curved = pair.covered is None
    by_nodes = curved and pair.differ and coupled.kind == "matching"
    wrong = (max(forces, pressure) > EXACT or by_nodes) and not coupled.remarks
    return Verdict(seed, pair.kind, forces, pressure, coupled.remarks, coupled.kind, wrong)


def _moments(pair: Pair, made: Coupling, body: AssembledElastic, number: int) -> float:
    """The largest error of the integrals over the covered part of the polynomials that the elements
    represent: 1, x, y, and at degree 2 their products. The nodal forces of a constant pressure give
    each as the sum over nodes of force times value. The force has no component along the surface.
    """
    axes, low, high = pair.axes, pair.covered[:-1, 0], pair.covered[:-1, 1]
    T, normal = (made.upper, made.lower)[number], made.frames[0, 0]
    pressed = (made.areas[:, None] * np.eye(len(axes))[0]).ravel()
    force = (T.T @ pressed)[body.body.unknowns]  # (dim, nodes)
    y = ((axes.T @ body.body.locations)[:-1] - low[:, None]) / (high - low)[:, None]
    revolved = pair.scene.kind == "axisymmetric"
    content = float(np.prod(high - low)) * (2 * np.pi if revolved else 1.0)
    along = normal @ force
    worst = float(np.abs(force - np.outer(normal, along)).max())
    for power in _powers(len(y), body.body.degree):
        exact = content * _integral(power, low, high, revolved)
        found = along @ np.prod(y ** np.array(power)[:, None], axis=0)
        worst = max(worst, float(abs(found - exact)))
    return worst / content


def _powers(flat: int, degree: int) -> list[tuple[int, ...]]:
    if flat == 1:
        return [(i,) for i in range(degree + 1)]
    return [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]


def _integral(power: tuple[int, ...], low: np.ndarray, high: np.ndarray, revolved: bool) -> float:
    """The integral of a product of powers of coordinates from 0 to 1, times the radius or not."""
    plain = float(np.prod([1 / (i + 1) for i in power]))
    if not revolved:
        return plain
    return float(low[0] * plain + (high[0] - low[0]) / (power[0] + 2))
