"""What is read of a body beside its displacements: functions of the view of its matrices and mesh.

A body of which no matrices are known, as a rigid one, has no supports, plates or nodes; one of
which the matrices are known and the elements are not has no stress either.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from contactopt.bodies import element_stress, stress_recovery
from contactopt.bodies.assembly import Assembly, Matrices
from contactopt.bodies.fields import Fields, Region, Validity
from contactopt.bodies.protocol import Body
from contactopt.bodies.stress_recovery import StressMap

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart
    from contactopt.scenes.scene import Scene


def elements_of(body: Body) -> Assembly | None:
    """The finite elements of which a body is made; None where they are not known."""
    return body.view if isinstance(body.view, Assembly) else None


def plates(body: Body, U: np.ndarray) -> dict[str, float]:
    """How far each plate moves [length], by names as in the free motions."""
    if body.view is None:
        return {}
    columns = zip(body.view.driven, body.view.motion.T)
    return {name: float(column @ U / column.sum()) for name, column in columns}


def acting(view: Matrices, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The positions (dim, m) of the nodes where forces (n,) act, and the forces (dim, m)."""
    nodal = force[view.unknowns]
    nodes = np.flatnonzero(nodal.any(axis=0))
    return view.locations[:, nodes], nodal[:, nodes]


def held_by(
    body: Body, U: np.ndarray, force: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """With which forces each support and each plate acts on a body that has the displacements U
    (n,) under contact forces (n,): for its name positions and forces as in `acting`.
    """
    if body.view is None:
        return {}
    F, found = body.internal_forces(U, force) - body.view.load - force, {}
    for name, unknowns in body.view.holders.items():
        own = np.zeros(len(F))
        own[unknowns] = F[unknowns]
        found[name] = acting(body.view, own)
    return found


def energy(body: Body, U: np.ndarray, force: np.ndarray) -> float:
    """The elastic energy [force length] under contact forces (n,)."""
    return float(U @ body.internal_forces(U, force)) / 2


def energy_change(body: Body, constant: str, U: np.ndarray, force: np.ndarray) -> float:
    """The derivative of the elastic energy by a constant of the material, beside what it is by the
    displacement that the constant changes: U' dA U / 2 = -(A U)' dU / 2 at fixed forces.
    """
    elements = elements_of(body)
    if elements is not None:
        return float(U @ elements.stiffness_change(constant, U)) / 2
    change, _ = body.material_change(constant, U, force)
    return -float(body.internal_forces(U, force) @ change) / 2


def material_work(
    body: Body, constant: str, U: np.ndarray, force: np.ndarray, dual: np.ndarray, W: np.ndarray
) -> float:
    """The sum of both derivatives of Body.material_change times the weights of the displacement,
    `dual` (n,), and of the balance, without a solve where the elements are known: W (n,) is the
    displacement under the forces `dual`, with the weights of the balance as multipliers.
    """
    elements = elements_of(body)
    if elements is not None:
        return -float(W @ elements.stiffness_change(constant, U))
    return float(dual @ body.material_change(constant, U, force)[0])


def fields(body: Body, U: np.ndarray) -> Fields | None:
    """Displacement and stress inside a body; None for a body without any."""
    elements = elements_of(body)
    return None if elements is None else element_stress.fields_of(elements, U)


def limits(body: Body, U: np.ndarray, force: np.ndarray, least: float = 0.0) -> Validity:
    """How far a body is from equilibrium, strained and turned; zeros without elements."""
    elements = elements_of(body)
    return Validity() if elements is None else element_stress.limits_of(elements, U, force, least)


def recovery_errors(body: Body, U: np.ndarray, *others: np.ndarray) -> tuple[np.ndarray, ...]:
    """As element_stress.recovery_errors; (0,) for a body without elements."""
    elements = elements_of(body)
    if elements is None:
        return (np.zeros(0),) * len(others)
    return element_stress.recovery_errors(elements, U, *others)


def added_work(
    body: Body, volumes: np.ndarray, force: element_stress.Force, U: np.ndarray, *others: np.ndarray
) -> tuple[np.ndarray, ...]:
    """As element_stress.added_work; (0,) for a body without elements."""
    elements = elements_of(body)
    if elements is None:
        return (np.zeros(0),) * len(others)
    return element_stress.added_work(elements, volumes, force, U, *others)


def on_elements(body: Body, values: np.ndarray) -> np.ndarray:
    """Values (n,) of the unknowns, dealt out evenly to the elements (elements,) that have each."""
    elements = elements_of(body)
    if elements is None:
        return np.zeros(0)
    dofs = elements.basis.element_dofs
    count = np.maximum(np.bincount(dofs.ravel(), minlength=len(values)), 1)
    return np.asarray((values / count)[dofs].sum(axis=0))


def stress_map(body: Body, region: Region, by_poisson: bool = False) -> StressMap | None:
    """The recovered stress in a region as a linear map of the displacements
    (contactopt.bodies.stress_recovery), or its derivative by Poisson's ratio; None where the stress
    cannot be read.
    """
    elements = elements_of(body)
    return None if elements is None else stress_recovery.stress_map(elements, region, by_poisson)


def load_work(
    body: Body, scene: Scene, part: AnyPart, dual: np.ndarray, weights: np.ndarray, W: np.ndarray
) -> float:
    """What the loads of another scene change in `at_rest` and in the resultants, times the weights
    `dual` (n,) and `weights` (p,), without a solve where the matrices are known; W as in
    `material_work`.
    """
    old = body.view
    if old is None:
        new = body.loaded(scene, part)
        balance = new.motions.resultants - body.motions.resultants
        return float(dual @ (new.at_rest - body.at_rest) + weights @ balance)
    other = old.reload(old, scene, part)
    prescribed, pressed = other.prescribed - old.prescribed, other.plate_forces - old.plate_forces
    loads, moved = other.load - old.load - old.A @ prescribed, list(plates(body, W).values())
    return float(dual @ prescribed + W @ loads + np.dot(moved, pressed))
