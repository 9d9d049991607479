"""From the bodies to the interface: u = Q r + V lambda + q by domain decomposition (paper, eqs (13)-(14)).

Every body b moves by U_b = at_rest + C_b F + motions lambda under nodal forces F (contactopt.bodies.protocol). The
coupling gives the map T of each body, from its displacements to local contact frames (n, t1[, t2]). With the signed map
B_b = T of the upper body, B_b = -T of the lower one,

    u = sum B_b U_b + gap n,   F_b = B_b' r   ==>   Q = sum B_b C_b B_b',   V = [B_b motions_b],   q = sum B_b at_rest_b + gap n.

The free motions of all bodies are the multipliers of the problem, and their resultants make s. Q is an array (explicit) or
an operator (implicit) whose product is one product with each body.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from contactopt.bodies import assemble
from contactopt.bodies.concurrency import each
from contactopt.bodies.protocol import Body
from contactopt.errors import InputError
from contactopt.interface.costs import form_of
from contactopt.interface.coupling import Coupling, couple
from contactopt.interface.equilibrium import coupled_form
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws import make_law
from contactopt.problem.operators import FORMS, InterfaceOperator, check_dense, estimate_diagonal, nodal_weights
from contactopt.scenes.scene import Scene

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Reduction:
    """An InterfaceProblem with what is needed to go back to the bodies.

    bodies    the bodies of the scene, upper first
    maps      the signed map B (k dim, n) of each body, from its displacements to u
    coupling  contacts, frames, initial gap, areas, chart
    seconds   phase -> time
    """

    scene: Scene
    problem: InterfaceProblem
    bodies: tuple[Body, ...]
    maps: tuple[sp.csr_matrix, ...]
    coupling: Coupling
    seconds: dict[str, float]

    @property
    def operator(self) -> InterfaceOperator:
        """Q by its products, whatever the form of problem.Q."""
        if isinstance(self.problem.Q, InterfaceOperator):
            return self.problem.Q
        return _operator(self.bodies, self.maps, self.coupling)

    @property
    def iterative(self) -> bool:
        """Whether products with Q cost iterations, so that a lower accuracy makes them cheaper."""
        return any(body.iterative for body in self.bodies)

    @property
    def dofs(self) -> int:
        """Free displacement unknowns of all bodies."""
        return sum(body.unknowns for body in self.bodies)

    def own_multipliers(self, multipliers: np.ndarray) -> tuple[np.ndarray, ...]:
        """The multipliers (p,) of the problem, body by body."""
        ends = np.cumsum([len(body.resultants) for body in self.bodies])
        return tuple(np.split(multipliers, ends[:-1]))

    def displaced(self, reactions: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, ...]:
        """The displacements U (n,) of every body under reactions (k, dim) and multipliers (p,)."""
        parts = zip(self.bodies, self.maps, self.own_multipliers(multipliers))
        return tuple(body.displacement(B.T @ reactions.ravel(), own) for body, B, own in parts)

    def loaded(self, scene: Scene) -> Reduction:
        """The same bodies, coupling and Q under the loads of another scene of the same structure.

        Values of tractions, body forces, plate forces and support displacements may differ, and mu; nothing else is
        looked at. Raises InputError if supports or plates hold other unknowns than here.
        """
        start = time.perf_counter()
        bodies = tuple(old.loaded(scene, part) for old, part in zip(self.bodies, scene.parts))
        q, V, s = _linear_terms(bodies, self.maps, self.coupling)
        law = make_law(scene.law, scene.mu, self.coupling.areas, self.coupling.positions)
        problem = replace(self.problem, q=q, V=V, s=s, law=law)
        seconds = {"load": time.perf_counter() - start}
        return replace(self, scene=scene, problem=problem, bodies=bodies, seconds=seconds)


def reduce(
    scene: Scene, elements: int | None = None, zone: float | None = None, Q: str = "auto", solver: str = "auto"
) -> InterfaceProblem:
    """The interface problem of a scene.

    Parameters
    ----------
    scene
        What to model.
    elements
        Number of elements across the contact half-width; by default the scene's.
    zone
        Half-width that the meshes resolve [length]; by default the scene's.
    Q
        'explicit' for an array, 'implicit' for an InterfaceOperator that solves with the bodies at each product, 'auto' for
        the cheaper one (contactopt.interface.costs).
    solver
        Of the bodies' linear systems: 'auto' or a name in contactopt.bodies.solvers.SOLVERS.

    Raises
    ------
    InputError
        On input that cannot be modelled: unknown boundaries, a body that is free to move, nodes that do not match.
    """
    return reduce_bodies(scene, elements, zone, Q, solver).problem


def reduce_bodies(
    scene: Scene,
    elements: int | None = None,
    zone: float | None = None,
    Q: str = "auto",
    solver: str = "auto",
    coupling: str = "matching",
) -> Reduction:
    """As reduce(), keeping the bodies for recovery.

    The bodies are made solvable at the same time. `coupling` is a name in contactopt.interface.coupling.COUPLINGS.
    """
    if Q not in FORMS:
        raise InputError(f"unknown form of Q {Q!r}; choose from {', '.join(FORMS)}.")
    elements = scene.elements if elements is None else elements
    zone = scene.zone if zone is None else zone
    seconds: dict[str, float] = {}
    start = time.perf_counter()
    assembled = [assemble(scene, part, elements, zone) for part in scene.parts]
    coupled = couple(scene, assembled[0], assembled[1], coupling)
    maps = (coupled.upper, -coupled.lower)
    seconds["assemble"] = time.perf_counter() - start

    start = time.perf_counter()
    if Q == "auto":
        contact, largest = (max(getattr(b, size) for b in assembled) for size in ("interface_unknowns", "unknowns"))
        Q = form_of(contact, largest, scene.dim, any(b.iterates(solver) for b in assembled))
    log.info("scene '%s': %s Q of %d unknowns", scene.name, Q, maps[0].shape[0])
    if Q == "explicit":
        check_dense(maps[0].shape[0])
    bodies = each(lambda body: body.prepare(solver, Q == "explicit"), assembled)
    seconds["factorise"] = time.perf_counter() - start

    start = time.perf_counter()
    q, V, s = _linear_terms(bodies, maps, coupled)
    made = _operator(bodies, maps, coupled) if Q == "implicit" else _array(bodies, maps)
    areas, points = coupled.areas, coupled.positions
    law = make_law(scene.law, scene.mu, areas, points)
    problem = InterfaceProblem(made, q, law, V, s, areas, points, chart=coupled.chart)
    seconds["compliance"] = time.perf_counter() - start
    return Reduction(scene, problem, bodies, maps, coupled, seconds)


def _operator(bodies: Sequence[Body], maps: Sequence[sp.csr_matrix], coupling: Coupling) -> InterfaceOperator:
    """Q by its products. Its diagonal is an estimate, which takes one product."""
    moved = [body.moved(B) for body, B in zip(bodies, maps)]
    terms = [(body.product(B), body.parallel) for body, B, moves in zip(bodies, maps, moved) if moves.any()]
    parallel = [marked for _, marked in terms]

    def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
        return np.asarray(sum(each(lambda term: term[0](X, accuracy), terms, parallel), np.zeros(X.shape)))

    weights = nodal_weights(coupling.chart, coupling.areas)
    diagonal = estimate_diagonal(product, weights, np.any(moved, axis=0))
    complete, iterative = all(body.complete for body in bodies), any(body.iterative for body in bodies)
    entries = (lambda: _array(bodies, maps)) if complete else None
    coupled = coupled_form(bodies, maps) if iterative else None
    return InterfaceOperator(product, diagonal, entries, None, iterative, coupled)


def _array(bodies: Sequence[Body], maps: Sequence[sp.csr_matrix]) -> np.ndarray:
    """Q as an array, symmetric to the last digit."""
    n = maps[0].shape[0]
    terms = (body.compliance(B) for body, B in zip(bodies, maps) if body.moved(B).any())
    Q = next(terms, np.zeros((n, n)))
    for term in terms:
        Q += term
    return Q


def _linear_terms(
    bodies: Sequence[Body], maps: Sequence[sp.csr_matrix], coupling: Coupling
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q (k, dim), V (k dim, p) and s (p,)."""
    q = np.zeros(coupling.frames.shape[:2])
    q[:, 0] = coupling.gap
    for body, B in zip(bodies, maps):
        q += (B @ body.at_rest).reshape(q.shape)
    V = np.concatenate([B @ body.motions for body, B in zip(bodies, maps)], axis=1)
    return q, V, np.concatenate([body.resultants for body in bodies])
