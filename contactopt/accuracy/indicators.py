"""The estimated error of a quantity, by body and element, and which elements it marks."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.accuracy.estimate import read
from contactopt.accuracy.marking import spread
from contactopt.bodies.protocol import Body
from contactopt.bodies.views import added_work, recovery_errors
from contactopt.coupling.reduction import Reduction
from contactopt.derivatives.states import duals_of
from contactopt.errors import InputError
from contactopt.readings.corners import infinite
from contactopt.readings.quantities import Quantity, elastic_energy, find_quantity
from contactopt.readings.state import State
from contactopt.solving.solve_scene import Solved

if TYPE_CHECKING:
    from contactopt.scenes.scene import Part

log = logging.getLogger(__name__)
ENERGY = "energy"
EDGES = "width", "stick"  # read from so many forces that their slopes cost more than a finer mesh


@dataclass(frozen=True, eq=False)
class ElementErrors:
    """What each element adds to the error of a quantity.

    value      of the quantity [its unit]
    bodies     for each body what its elements add (elements,), signed [unit of the quantity]; (0,)
               for a body without a mesh
    between    what of it comes from the pressure between contacts [unit of the quantity]
    energy     estimated error of the displacement in the energy norm, over the norm of the
               displacement [-]
    unsigned   whether there was no adjoint, so that the shares are those of the energy of the error
    """

    value: float
    bodies: tuple[np.ndarray, ...]
    energy: float
    between: float = 0.0
    unsigned: bool = False

    @property
    def total(self) -> float:
        """The estimated error J - J_h [unit of the quantity]."""
        return float(sum(part.sum() for part in self.bodies))

    @property
    def size(self) -> float:
        """The estimated error of stress in the elements and of pressure at contacts together."""
        return abs(self.total - self.between) + abs(self.between)

    def marked(self, share: float) -> tuple[np.ndarray, ...]:
        """For each body the fewest elements with this share of all absolute errors (Doerfler)."""
        sizes = np.abs(np.concatenate(self.bodies))
        order = np.argsort(-sizes, kind="stable")
        count = int(np.searchsorted(np.cumsum(sizes[order]), share * sizes.sum())) + 1
        chosen = np.zeros(len(sizes), dtype=bool)
        chosen[order[:count]] = True
        first = np.cumsum([0, *(len(part) for part in self.bodies)])
        return tuple(np.flatnonzero(chosen[a:b]) for a, b in pairwise(first))


def misfit(found: Sequence[ElementErrors]) -> float:
    """By how much the last two refinements changed the sum of the value and its estimated error
    [its unit]. Exact estimates would not change it. `found` belong to the last three meshes. The
    earlier change counts less, as the estimated error has fallen since.
    """
    changes = np.abs(np.diff([errors.value + errors.total for errors in found]))
    if len(changes) > 1:
        changes[0] *= min(1.0, found[-1].size / (found[-2].size or 1.0))
    return float(np.max(changes, initial=0.0))


def element_errors(
    solved: Solved, quantity: Quantity | None, value: float, volumes: Sequence[np.ndarray] = ()
) -> ElementErrors:
    """What each element adds to the error of a quantity with this value, as in contactopt.accuracy.

    The energy J(U) = a(U, U) / 2 is quadratic. With the error e = U - U_h and its slope at U_h,

        J - J_h = a(U_h, e) + a(e, e) / 2 = a(U, e) - a(e, e) / 2,

    and a(U, e) is a(W - W_h, e) with the adjoint W: U under loads alone, zero where displacements
    or an interference are given. `volumes` (elements,) of each body lie between straight facets and
    their curves [length^dim].

    For edges, for no quantity, and where the adjoint has no solution, the energy of the error
    guides the marking alone, without a sign.
    """
    state = State(solved.reduction, solved.solution)
    bodies, displaced, found = solved.reduction.bodies, state.displaced, None
    if quantity is not None and not quantity.name.startswith(EDGES):
        try:
            seeds = quantity.slopes(state)
            found = duals_of(state, seeds).fields
            if seeds.lifts:
                lifts = zip(found, seeds.lifts)
                found = tuple(W if own is None else W - own for W, own in lifts)
        except InputError as error:
            log.info("%s: no adjoint, %s", quantity.name, error)
    fields = displaced if found is None else found
    shares = [recovery_errors(body, U, U, W) for body, U, W in zip(bodies, displaced, fields)]
    energy = elastic_energy(solved.reduction, solved.solution)
    missing = sum(own.sum() for own, _ in shares) / 2
    norm = float(np.sqrt(missing / energy)) if energy > 0 else 0.0
    if quantity is None or found is None:
        return ElementErrors(value, tuple(own / 2 for own, _ in shares), norm, unsigned=True)
    curved = 0.5 if quantity.name == ENERGY else 0.0
    errors, between = tuple(product - curved * own for own, product in shares), 0.0
    # what is read at a place has an adjoint that is infinite there: this would be no error
    if volumes and (curved or quantity.reader is None):
        parts = zip(errors, solved.reduction.scene.parts, bodies, volumes, displaced, fields)
        errors = tuple(
            one + _of_shape(part, body, volume, U, W, curved)
            for one, part, body, volume, U, W in parts
        )
    if seeds.reactions is not None and not seeds.bodies:
        added = between_contacts(solved, seeds.reactions[:, 0])
        errors = tuple(inside + share for inside, share in zip(errors, added))
        between = float(sum(share.sum() for share in added))
    return ElementErrors(value, errors, norm, between)


def _of_shape(
    part: Part,
    body: Body,
    volume: np.ndarray,
    U: np.ndarray,
    W: np.ndarray,
    curved: float,
) -> np.ndarray:
    """What volumes (elements,) between facets and their curves add to the error."""
    if not np.any(volume):
        return np.zeros(len(volume))

    def force(x: np.ndarray) -> np.ndarray:
        return sum((own.density(x, x) for own in part.loads if not own.boundary), np.zeros_like(x))

    (work,) = added_work(body, volume, force, U, W)
    (energy,) = added_work(body, volume, np.zeros_like, U, U)
    return np.asarray(work - curved * energy)


def read_once(solved: Solved, name: str) -> dict[str, Any]:
    """Read a quantity from one solution: its "value", its relative "error", None where one mesh
    says nothing, and a "message" where it is infinite or missing. A load path counts by its last
    state.
    """
    quantity = find_quantity(name, solved.reduction.scene)
    size, last = np.inf, solved if solved.path is None else _state(solved, -1)
    reading = read(quantity, replace(solved, solution=last.solution))
    elastic = [part for part in solved.reduction.scene.parts if part.elastic]
    if all(part.meshed for part in elastic):
        errors = element_errors(last, quantity, reading.value)
        size = np.inf if errors.unsigned else errors.size
    size += reading.uncertainty
    message = reading.missing or infinite(last.reduction, last.solution, reading)
    known = np.isfinite(size) and reading.value != 0 and not message
    error = size / abs(reading.value) if known else None
    return {"value": reading.value, "error": error} | ({"message": message} if message else {})


def along_path(
    solved: Solved, quantity: Quantity, value: float, volumes: Sequence[np.ndarray] = ()
) -> ElementErrors:
    """As element_errors; for a load path by the largest energy of the error of all states."""
    if solved.path is None:
        return element_errors(solved, quantity, value, volumes)
    count = len(solved.path.states)
    found = [element_errors(_state(solved, number), None, value) for number in range(count)]
    bodies = tuple(np.max(own, axis=0) for own in zip(*(each.bodies for each in found)))
    worst = max(each.energy for each in found)
    return ElementErrors(value, bodies, worst, unsigned=True)


def _state(solved: Solved, number: int) -> Solved:
    """One state of a load path as a scene of its own, after the slip of the states before it."""
    assert solved.path is not None
    reduction, solution = solved.path.at(number)
    return replace(solved, reduction=reduction, solution=solution, path=None)


def between_contacts(solved: Solved, weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """What elements at the contact add to the error because pressure varies between contacts."""
    reduction, problem = solved.reduction, solved.reduction.problem
    added = weights * problem.areas * pressure_errors(reduction, solved.solution.reactions[:, 0])
    shares = spread(reduction, np.pad(added[:, None], ((0, 0), (0, problem.dim - 1))))
    total = sum(share.sum() for share in shares)
    factor = added.sum() / total if total != 0 else 0.0
    return tuple(factor * share for share in shares)


def pressure_errors(reduction: Reduction, forces: np.ndarray) -> np.ndarray:
    """By how much the pressure at each contact exceeds the force over the area there, (k,)
    [stress].

    The force is the integral with a hat function. At a distance h on a line its mean is p + h^2 p''
    / 12, and that of the piecewise linear function through the contacts p + h^2 p'' / 6 as its
    second differences are h^2 p'': half of what this differs from the value is the error, taken on
    surfaces and for varying distances as well.
    """
    problem = reduction.problem
    errors, areas = np.zeros(len(forces)), problem.areas
    pressure = np.divide(forces, areas, out=np.zeros(len(forces)), where=areas > 0)
    for pair, coupling in zip(problem.pairs, reduction.couplings):
        cells = coupling.cells.T
        if cells.shape[1] != problem.dim:
            continue
        own, points = pressure[pair.contacts], problem.coordinates[:, pair.contacts]
        edges = points[:, cells[:, 1:]] - points[:, cells[:, :1]]
        size = np.sqrt(np.linalg.det(np.einsum("dfa,dfb->fab", edges, edges)))[:, None]
        ring = reduction.scene.analysis.revolved
        p, r = own[cells], points[0][cells] if ring else np.ones(cells.shape)
        (sum_p, sum_r), corner = (x.sum(axis=1, keepdims=True) for x in (p, r)), cells.ravel()
        both = np.sum(p * r, axis=1, keepdims=True)
        # integrals of phi_a phi_b phi_c r_c p_b over a simplex, in units of its smallest one
        mean = sum_p * sum_r + p * sum_r + r * sum_p + both + 2 * p * r
        smooth = np.bincount(corner, (size * mean).ravel(), len(own))
        whole = (problem.dim + 2) * np.bincount(corner, (size * (sum_r + r)).ravel(), len(own))
        mean = np.divide(smooth, whole, out=own.copy(), where=whole > 0)
        errors[pair.contacts] = (own - mean) / 2
    return errors
