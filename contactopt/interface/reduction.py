"""From two bodies to the interface: u = Q r + V lambda + q by domain decomposition (paper, eqs (13)-(14)).

With C = A_ff^-1 the compliance of a body, T the map from displacements to local contact frames (n, t1[, t2]) and
sigma = +1 for the upper, -1 for the lower body,

    A U = f + sigma T' r   on the free unknowns,   U = lift + M lambda_plate on the others,
    u = sum sigma T U + gap n   ==>   Q = sum T C T',   q = sum sigma T U(r=0, lambda=0) + gap n.

Q is an array (explicit), from the factors of A_ff with the contact unknowns eliminated last, or an operator (implicit)
whose product is one solve with each body.

Plate motions Z that no support resists become the multipliers of the problem, V = sigma T Z and
s = thrust + Z' (f - A lift); the others are condensed into Q and q (contactopt.interface.condensation).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.body import build_body, reload_body
from contactopt.bodies.solvers import choose
from contactopt.errors import InputError
from contactopt.interface.charts import surface_chart
from contactopt.interface.condensation import ReducedBody, loaded_body, reduce_body
from contactopt.interface.matching import match_bodies, positions
from contactopt.problem import InterfaceProblem
from contactopt.problem.operators import FORMS, InterfaceOperator, estimate_diagonal, nodal_weights
from contactopt.scenes.scene import Part, Scene

PRODUCTS = 60  # with Q, of a solve from cold
SOLVE = {2: 1.2, 3: 0.4}  # time of an operation of a product over one of the elimination, by dimension: measured
DENSE = 10  # speed of dense linear algebra over that of a sparse factorisation
LARGEST = 8000  # interface unknowns of an explicit Q: half a gigabyte


@dataclass(frozen=True, eq=False)
class Reduction:
    """An InterfaceProblem with what is needed to go back to the bodies.

    bodies    ReducedBody of the upper and the lower body, None where rigid
    nodes     contact nodes (k,) of each, in the order of the problem
    frames    (k, dim, dim) rows n, t1[, t2] at each contact
    gap       (k,) initial gap [length]
    plates    number of multipliers of each body
    seconds   phase -> time
    """

    scene: Scene
    problem: InterfaceProblem
    bodies: tuple[ReducedBody | None, ReducedBody | None]
    nodes: tuple[np.ndarray, np.ndarray]
    frames: np.ndarray
    gap: np.ndarray
    plates: tuple[int, int]
    seconds: dict[str, float]

    @property
    def operator(self) -> InterfaceOperator:
        """Q by its products, whatever the form of problem.Q."""
        problem = self.problem
        if isinstance(problem.Q, InterfaceOperator):
            return problem.Q
        weights = nodal_weights(problem.chart, problem.areas)
        return _operator(self.bodies, _maps(self.bodies, self.nodes, self.frames), weights)

    @property
    def iterative(self) -> bool:
        """Whether a body's linear system is solved by iteration."""
        return any(b is not None and b.solver.name == "multigrid" for b in self.bodies)

    @property
    def dofs(self) -> int:
        """Free displacement unknowns of both bodies."""
        return sum(len(b.body.free) for b in self.bodies if b is not None)

    def loaded(self, scene: Scene) -> Reduction:
        """The same bodies, solvers and Q under the loads of another scene of the same structure.

        Values of tractions, body forces, plate forces and support displacements may differ, and mu; nothing else is
        looked at. Raises InputError if supports or plates hold other unknowns than here.
        """
        start = time.perf_counter()
        parts = (scene.upper, scene.lower)
        bodies = [
            None if old is None else loaded_body(old, reload_body(old.body, scene, part))  # type: ignore[arg-type]
            for old, part in zip(self.bodies, parts)
        ]
        maps = _maps(self.bodies, self.nodes, self.frames)
        q, V, s, plates = _linear_terms(scene, bodies, maps, self.frames, self.gap)
        problem = replace(self.problem, q=q, V=V, s=s, mu=np.full(len(q), float(scene.mu)), bilateral=scene.bilateral)
        seconds = {"load": time.perf_counter() - start}
        return replace(
            self, scene=scene, problem=problem, bodies=(bodies[0], bodies[1]), plates=plates, seconds=seconds
        )


def reduce(
    scene: Scene, elements: int | None = None, zone: float | None = None, Q: str = "auto", solver: str = "auto"
) -> InterfaceProblem:
    """The interface problem of a scene.

    elements  across the contact half-width (default: the scene's);  zone  half-width the meshes resolve [length]
    Q         'explicit': an array;  'implicit': an InterfaceOperator that solves with the bodies at each product;
              'auto': the cheaper one (see form_of)
    solver    of the bodies' linear systems: 'auto' or a name in contactopt.bodies.solvers.SOLVERS
    Raises InputError on input that cannot be modelled: unknown boundaries, a body free to move,
    nodes that do not match.
    """
    return reduce_bodies(scene, elements, zone, Q, solver).problem


def reduce_bodies(
    scene: Scene, elements: int | None = None, zone: float | None = None, Q: str = "auto", solver: str = "auto"
) -> Reduction:
    """As reduce(), keeping the bodies for recovery. Both bodies are processed concurrently."""
    if Q not in FORMS:
        raise InputError(f"unknown form of Q {Q!r}; choose from {', '.join(FORMS)}.")
    elements = scene.elements if elements is None else elements
    zone = scene.zone if zone is None else zone
    seconds: dict[str, float] = {}
    start = time.perf_counter()
    parts = (scene.upper, scene.lower)
    bodies = [build_body(scene, part, elements, zone) if isinstance(part, Part) else None for part in parts]
    nodes, frames, gap, areas = match_bodies(scene, *bodies)
    seconds["assemble"] = time.perf_counter() - start

    start = time.perf_counter()
    largest = max(len(b.free) for b in bodies if b is not None)
    if Q == "auto":
        iterative = solver == "multigrid" or (solver == "auto" and choose(largest, scene.dim) == "multigrid")
        Q = form_of(max(b.contact_dofs.size for b in bodies if b is not None), largest, scene.dim, iterative)
    first, second = both(lambda b: None if b is None else reduce_body(b, solver, Q == "explicit"), bodies)
    seconds["factorise"] = time.perf_counter() - start

    start = time.perf_counter()
    reduced = (first, second)
    maps = _maps(reduced, nodes, frames)
    points = positions(bodies, nodes)
    chart = surface_chart(scene, points, frames, list(zip(bodies, nodes)))
    operator = _operator(reduced, maps, nodal_weights(chart, areas))
    q, V, s, plates = _linear_terms(scene, reduced, maps, frames, gap)
    problem = InterfaceProblem(
        operator if Q == "implicit" else operator.to_dense(),
        q,
        np.full(len(gap), float(scene.mu)),
        V,
        s,
        areas,
        points,
        scene.bilateral,
        chart,
    )
    seconds["compliance"] = time.perf_counter() - start
    return Reduction(scene, problem, reduced, nodes, frames, gap, plates, seconds)


def form_of(m: int, n: int, dim: int, iterative: bool) -> str:
    """The cheaper form of Q: 'explicit' or 'implicit', from counts of operations.

    m unknowns on the contact boundary, n unknowns of the larger body, `iterative` if it has no factors.
    Explicit: m^3 / 3 to eliminate the contact unknowns last, at the speed of a sparse factorisation, and about 3 m^3 for the
    inverse and Newton's steps at DENSE times that speed. Implicit: PRODUCTS solves of 4 operations, at the price SOLVE, per
    entry of the factors, of which nested dissection leaves 4 n log2 n in 2D and 17 n^(4/3) in 3D (fitted to our bodies).
    Bodies without factors would need m solves for an explicit Q, which never pays, nor does an array larger than LARGEST.
    """
    explicit = m**3 / 3 + 3 * m**3 / DENSE
    entries = 4 * n * np.log2(n) if dim == 2 else 17 * n ** (4 / 3)
    return "implicit" if iterative or m > LARGEST or explicit > 4 * PRODUCTS * SOLVE[dim] * entries else "explicit"


def both(act: Callable[[Any], Any], bodies: Sequence[Any]) -> tuple[Any, Any]:
    """`act` on the upper and on the lower body at the same time."""
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(act, bodies)
    return first, second


def _maps(
    bodies: Sequence[ReducedBody | None], nodes: Sequence[np.ndarray], frames: np.ndarray
) -> tuple[sp.csr_matrix | None, ...]:
    """T (k dim, n) of each body: its displacements -> components in the contact frames; None where rigid."""
    return tuple(None if body is None else body.contact_map(own, frames) for body, own in zip(bodies, nodes))


def _operator(
    bodies: Sequence[ReducedBody | None], maps: Sequence[sp.csr_matrix | None], weights: np.ndarray
) -> InterfaceOperator:
    """Q = sum T (C + soft soft') T' by its products."""
    pairs = list(zip(bodies, maps))

    threads = not any(body is not None and body.solver.name == "superlu" for body in bodies)  # it keeps Python's lock

    def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
        def moved(pair: tuple[ReducedBody | None, sp.csr_matrix | None]) -> np.ndarray | float:
            body, T = pair
            return 0.0 if body is None or T is None else T @ body.contact_motion(T.T @ X, accuracy)

        first, second = both(moved, pairs) if threads else map(moved, pairs)
        return np.asarray(first + second)

    def entries() -> np.ndarray:
        terms = [_compliance(T, body) for body, T in pairs if body is not None and T is not None]
        return terms[0] if len(terms) == 1 else terms[0] + terms[1]

    moves = np.any([_moves(T, body) for body, T in pairs if body is not None and T is not None], axis=0)
    complete = all(body is None or body.solver.last is not None for body in bodies)
    iterative = any(body is not None and body.solver.name == "multigrid" for body in bodies)
    diagonal = estimate_diagonal(product, weights, moves)
    return InterfaceOperator(product, diagonal, entries if complete else None, None, iterative)


def _moves(T: sp.csr_matrix, body: ReducedBody) -> np.ndarray:
    """(k dim,) mask of the components that the body's elasticity moves."""
    return np.asarray(abs(T[:, body.interface]).sum(axis=1)).ravel() + np.abs(T @ body.soft).sum(axis=1) > 0


def _compliance(T: sp.csr_matrix, body: ReducedBody) -> np.ndarray:
    """T (C + soft soft') T', symmetric to the last digit."""
    local = T[:, body.interface]
    product = local @ (local @ body.compliance).T
    soft = T @ body.soft
    return np.asarray((product + product.T) / 2 + soft @ soft.T)


def _linear_terms(
    scene: Scene,
    bodies: Sequence[ReducedBody | None],
    maps: Sequence[sp.csr_matrix | None],
    frames: np.ndarray,
    gap: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[int, int]]:
    """q (k, dim), V (k dim, p), s (p,) and the number of multipliers of each body."""
    q = np.zeros(frames.shape[:2])
    q[:, 0] = gap
    columns, resultants = [], []
    for part, body, T, sign in zip((scene.upper, scene.lower), bodies, maps, (1.0, -1.0)):
        if body is None:
            V, s = _rigid_motions(part, scene, frames, sign)
        else:
            q += sign * (T @ body.at_rest).reshape(q.shape)
            V, s = sign * (T @ body.motions), body.resultants
        columns.append(V)
        resultants.append(s)
    plates = len(resultants[0]), len(resultants[1])
    return q, np.concatenate(columns, axis=1), np.concatenate(resultants), plates


def _rigid_motions(rigid: Any, scene: Scene, frames: np.ndarray, sign: float) -> tuple[np.ndarray, np.ndarray]:
    """V (k dim, p) and s (p,) of a rigid body under a total force."""
    force = rigid.force or {}
    k = len(frames)
    columns = [frames[:, :, scene.components.index(name)].reshape(k * scene.dim) for name in force]
    V = sign * np.stack(columns, axis=1) if columns else np.zeros((k * scene.dim, 0))
    return V, np.array(list(force.values()), dtype=float)
