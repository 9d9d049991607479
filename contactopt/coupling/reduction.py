"""From the bodies to the interface: u = Q r + V lambda + q by domain decomposition (paper, eqs
(13)-(14)).

Every body b moves by U_b = at_rest + C_b F + motions lambda under nodal forces F
(contactopt.bodies.protocol). The coupling of a pair of surfaces gives the maps T of its two bodies,
from their displacements to local contact frames (n, t1[, t2]). The contacts of all pairs follow
each other. The signed map B_b of a body holds, in the rows of each pair that it takes part in, T if
it is the upper body there and -T if it is the lower one,

    u = sum B_b U_b + gap n,   F_b = B_b' r
    ==>   Q = sum B_b C_b B_b',   V = [B_b motions_b],   q = sum B_b at_rest_b + gap n.

The free motions of all bodies are the multipliers of the problem, and their resultants make s. Q is
an array (explicit) or an operator (implicit) whose product is one product with each body; both cost
no more than the pairs that each body takes part in (contactopt.coupling.compliance).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody
from contactopt.bodies.elastic import on_soft_ground, pulled
from contactopt.bodies.protocol import Body
from contactopt.bodies.solvers import solvers_there
from contactopt.cards import card, count, line
from contactopt.coupling.compliance import compliance, filling, operator
from contactopt.coupling.costs import FORM_OF, estimates, next_best
from contactopt.coupling.coupling import Coupling
from contactopt.coupling.planes_of_symmetry import SymmetryPlane
from contactopt.coupling.posed import Posed, posed, problem_of
from contactopt.coupling.same_scene import check_same
from contactopt.errors import InputError
from contactopt.linear.budget import fill
from contactopt.linear.concurrency import each, give_back, one_blas_thread
from contactopt.linear.operators import (
    NOISE,
    Interface,
    InterfaceOperator,
    check_dense,
    diagonal,
    has_entries,
)
from contactopt.problem import InterfaceProblem, Solution
from contactopt.scenes.scene import Scene

log = logging.getLogger(__name__)
LONG = 2.0  # expected seconds from which the reduction says what it does


@dataclass(frozen=True, eq=False)
class Reduction:
    """An InterfaceProblem with what is needed to go back to the bodies.

    bodies     the bodies of the scene, in the order of its parts
    maps       the signed map B (k dim, n) of each body, from its displacements to u
    couplings  contacts, frames, initial gap, areas, chart of each pair of surfaces
    seconds    phase -> time
    planes     of symmetry beyond which mirror images make the bodies whole
    on_ground  whether a ground holds thin bodies (contactopt.bodies.thin)
    slipped    (k, dim - 1) tangential displacement from which the problem measures slip [length]
    """

    scene: Scene
    problem: InterfaceProblem
    bodies: tuple[Body, ...]
    maps: tuple[sp.csr_matrix, ...]
    couplings: tuple[Coupling, ...]
    seconds: dict[str, float]
    planes: tuple[SymmetryPlane, ...] = ()
    on_ground: bool = False
    slipped: np.ndarray | float = 0.0
    _known: WeakKeyDictionary[Solution, tuple[Any, ...]] = field(
        default_factory=WeakKeyDictionary, init=False, repr=False
    )

    def __repr__(self) -> str:
        unknowns, contacts = count(self.dofs, "unknown"), count(self.problem.contacts, "contact")
        pairs = count(len(self.couplings), "pair of surfaces", "pairs of surfaces")
        return line("Reduction", self.scene.name, unknowns, contacts, pairs)

    def _repr_html_(self) -> str:
        rows: dict[str, object] = {"scene": self.scene.name, "kind": self.scene.kind}
        for body in self.bodies:
            rows[f"body {body.name}"] = count(body.unknowns, "unknown")
        for pair, made in zip(self.problem.pairs, self.couplings):
            contacts = count(len(made.gap), "contact")
            rows[f"surfaces {pair.name}"] = f"{contacts}, coupled by {made.kind}"
        return card("Reduction", rows)

    @property
    def coupling(self) -> Coupling:
        """That of a scene with one pair of surfaces; InputError if there are several."""
        if len(self.couplings) > 1:
            raise InputError(
                f"scene '{self.scene.name}' has {len(self.couplings)} pairs of surfaces; take"
                " couplings."
            )
        return self.couplings[0]

    @property
    def gap(self) -> np.ndarray:
        """The initial gap (k,) of all contacts [length]."""
        return np.concatenate([made.gap for made in self.couplings])

    @property
    def frames(self) -> np.ndarray:
        """The directions n, t1[, t2] of all contacts as rows (k, dim, dim)."""
        parts = [made.frames for made in self.couplings]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    @property
    def operator(self) -> InterfaceOperator:
        """Q by its products, whatever the form of problem.Q."""
        if not has_entries(self.problem.Q):
            return self.problem.Q
        return operator(self.bodies, self.maps, self.couplings)

    @property
    def iterative(self) -> bool:
        """Whether products with Q cost iterations, so that a lower accuracy makes them cheaper."""
        return any(body.way.iterative for body in self.bodies)

    @property
    def dofs(self) -> int:
        """Free displacement unknowns of all bodies."""
        return sum(body.unknowns for body in self.bodies)

    def own_multipliers(self, multipliers: np.ndarray) -> tuple[np.ndarray, ...]:
        """The multipliers (p_b,) of each body, out of those of the problem."""
        ends = np.cumsum([len(body.motions.resultants) for body in self.bodies])
        return tuple(np.split(multipliers, ends[:-1]))

    def displaced(self, solution: Solution) -> tuple[np.ndarray, ...]:
        """The displacements U (n_b,) of each body [length], computed once per solution."""
        if solution in self._known:
            return self._known[solution]
        given = [] if solution.displacements is None else list(solution.displacements.parts)
        free = [given.pop(0) if given and body.way.iterative else None for body in self.bodies]
        parts = zip(self.bodies, self.maps, self.own_multipliers(solution.multipliers), free)

        def displaced(part: tuple[Body, sp.csr_matrix, np.ndarray, Any]) -> np.ndarray:
            body, B, own, X = part
            return body.displacement(B.T @ solution.reactions.ravel(), own, X)

        self._known[solution] = each(displaced, parts, _parallel(self.bodies))
        return self._known[solution]

    def keep(self, solution: Solution, displaced: tuple[np.ndarray, ...]) -> None:
        """Take these displacements of the bodies for those of a solution."""
        self._known[solution] = displaced

    def seen(self, displaced: Sequence[Any]) -> np.ndarray:
        """Displacements u (k, dim) of the contacts with the gap, from those of the bodies."""
        q = self.problem.q
        parts = (B @ U for B, U in zip(self.maps, displaced))
        u = np.asarray(sum(parts, 0 * q.ravel())).reshape(q.shape)
        return u + self.gap[:, None] * np.eye(self.problem.dim)[0]

    def moved(self, solution: Solution) -> np.ndarray:
        """The relative displacements u (k, dim) of the contacts, as the problem measures them:
        from those of the bodies where these are known and a product with Q costs more.
        """
        if has_entries(self.problem.Q) or solution not in self._known:
            return self.problem.displacements(solution.reactions, solution.multipliers)
        u = self.seen(self._known[solution])
        u[:, 1:] -= self.slipped
        return u

    def grounded(self) -> Reduction | None:
        """With thin bodies on a soft ground (contactopt.bodies.thin); None without any."""
        if self.on_ground:
            return self
        bodies = _on_ground(self.scene, self.bodies)
        if all(new is old for new, old in zip(bodies, self.bodies)):
            return None
        implicit = not has_entries(self.problem.Q)
        Q = compliance(bodies, self.maps, self.couplings, implicit)
        return replace(self._with(bodies, Q), on_ground=True)

    def pulled(self, solution: Solution) -> Reduction:
        """With the ground pulling each body towards its displacement in a solution."""
        displaced = self.displaced(solution)
        bodies = tuple(pulled(body, U) for body, U in zip(self.bodies, displaced))
        made = self._with(bodies, self.problem.Q)
        # what rounding in Q and q makes of the displacements of the contacts, beside the bodies'
        missing = self.seen(displaced) - self.problem.displacements(
            solution.reactions, solution.multipliers
        )
        missing[:, 1:] -= self.slipped
        return replace(made, problem=replace(made.problem, q=made.problem.q + missing))

    def _with(self, bodies: tuple[Body, ...], Q: Interface) -> Reduction:
        """With bodies that rest elsewhere. The slip of earlier states, added to q, stays."""
        problem = problem_of(self.scene, Q, bodies, self.maps, self.couplings)
        old = problem_of(self.scene, Q, self.bodies, self.maps, self.couplings)
        problem = replace(problem, q=self.problem.q + problem.q - old.q)
        return replace(self, bodies=bodies, problem=problem)

    def loaded(self, scene: Scene) -> Reduction:
        """Put the loads of another scene on the same bodies, coupling and Q: tractions, body and
        plate forces, support displacements and mu. InputError if anything else differs.
        """
        check_same(self.scene, scene)
        start = time.perf_counter()
        pairs = zip(self.bodies, scene.parts)
        bodies = each(lambda pair: pair[0].loaded(scene, pair[1]), pairs, _parallel(self.bodies))
        problem = problem_of(scene, self.problem.Q, bodies, self.maps, self.couplings)
        seconds = {"load": time.perf_counter() - start}
        made = replace(self, scene=scene, problem=problem, bodies=bodies, seconds=seconds)
        return replace(made, slipped=0.0)

    def after(self, slipped: np.ndarray) -> Reduction:
        """The step of a path after a state: slip counts from its displacements (k, dim - 1)."""
        q = self.problem.q.copy()
        q[:, 1:] -= slipped
        return replace(self, problem=replace(self.problem, q=q), slipped=slipped)


def reduce(
    scene: Scene,
    elements: int | None = None,
    zone: float | None = None,
    Q: str = "auto",
    solver: str = "auto",
    coupling: str | None = None,
) -> InterfaceProblem:
    """The interface problem of a scene.

    Parameters
    ----------
    scene : What to model.
    elements : Number of elements across the contact half-width; by default the scene's.
    zone : Half-width that the meshes resolve [length]; by default the scene's.
    Q : 'explicit' for an array, 'implicit' for an InterfaceOperator that solves with the bodies at
        each product, 'auto' for the cheaper one (contactopt.coupling.costs).
    solver : Of the bodies' linear systems: 'auto' or a name in contactopt.bodies.solvers.SOLVERS.
    coupling : 'auto' or a name in contactopt.coupling.coupling.COUPLINGS for all pairs of surfaces;
        by default each has its own, which is 'auto' unless its Contact says otherwise: matching
        nodes where they match, mortar where they do not.

    Returns
    -------
    Its compliance, gaps, motions and resultants, with the law of the scene.

    Raises
    ------
    InputError : On input that cannot be modelled: unknown boundaries, surfaces that face each other
        nowhere.
    """
    return reduce_bodies(scene, elements, zone, Q, solver, coupling).problem


def reduce_bodies(
    scene: Scene,
    elements: int | None = None,
    zone: float | None = None,
    Q: str = "auto",
    solver: str = "auto",
    coupling: str | None = None,
    once: bool = True,
    made: Posed | None = None,
    note: Callable[[str], None] | None = None,
) -> Reduction:
    """Reduce a scene to its interface problem and keep the bodies, from which fields are recovered.

    Where the solvers of the bodies allow it, the bodies are factorised at the same time.

    Parameters
    ----------
    scene, elements, zone, Q, solver, coupling : As for reduce(), which raises the same errors.
    once : Whether only one problem is solved, by Newton's method. If not, factors of the bodies are
        used again, and multigrid is taken only where it costs much less.
    made : The scene before anything is factorised, where it is known.
    note : Receives a sentence about what is expected to take long.

    Returns
    -------
    The interface problem with the bodies, the coupling and the seconds that each phase took.

    Raises
    ------
    TooDear : If this takes more work than an open budget allows (contactopt.linear.budget).
    """
    made = made or posed(scene, elements, zone, Q, coupling)
    assembled, couplings, maps, planes, spent = made
    times = [time.perf_counter()]

    Q, solver = _way(scene, assembled, maps, (Q, solver), once, note)
    iterate = any(body.iterates(solver) for body in assembled)
    implicit = Q == "implicit"
    log.info("scene '%s': %s Q of %d unknowns", scene.name, Q, maps[0].shape[0])
    if not implicit:
        check_dense(round(filling(maps) ** 0.5))
    with one_blas_thread() if iterate else nullcontext():
        bodies = each(lambda body: body.prepare(solver, not implicit), assembled)
        if any(body.work.stiffness for body in assembled):
            give_back()
    times.append(time.perf_counter())

    form = compliance(bodies, maps, couplings, implicit)
    size = diagonal(form)
    on_ground = not np.min(size, initial=0.0) >= -NOISE * np.max(size, initial=0.0)
    if on_ground:  # nothing is left of the compliance of a thin body but rounding, or no number
        bodies = _on_ground(scene, bodies)
        form = compliance(bodies, maps, couplings, implicit)
    problem = problem_of(scene, form, bodies, maps, couplings)
    times.append(time.perf_counter())
    seconds = dict(zip(("assemble", "factorise", "compliance"), [spent, *np.diff(times).tolist()]))
    return Reduction(scene, problem, bodies, maps, couplings, seconds, planes, on_ground)


def _way(
    scene: Scene,
    assembled: Sequence[AssembledBody],
    maps: Sequence[sp.csr_matrix],
    asked: tuple[str, str],
    once: bool,
    note: Callable[[str], None] | None,
) -> tuple[str, str]:
    """The form of Q and the solver of the bodies that were asked for; for `auto`, those of
    the cheapest way. Where that takes many steps, the budget that is open gets its limit.
    """
    Q, solver = asked
    if any(body.iterates(solver) for body in assembled if not body.work.stiffness):
        return ("implicit" if Q == "auto" else Q), solver
    solvers = solvers_there() if solver == "auto" else (solver,)
    unknowns = round(filling(maps) ** 0.5)
    costs = estimates([body.work for body in assembled], unknowns, scene.dim, solvers, Q, once)
    if not costs:  # an external solver, whose costs nobody knows
        iterative = any(body.iterates(solver) for body in assembled)
        return ("implicit" if iterative else "explicit") if Q == "auto" else Q, solver
    way, solver = min(costs, key=lambda own: costs[own])
    told = ", ".join(f"{name} {by} {cost:.2g} s" for (name, by), cost in costs.items())
    log.info("scene '%s': the way is %s by %s, of %s", scene.name, way, solver, told)
    if note and costs[way, solver] > LONG:
        size = sum(body.unknowns for body in assembled)
        note(f"an {FORM_OF[way]} Q by {solver}, {size} unknowns: about {costs[way, solver]:.2g} s")
    fill(next_best(costs, sum(body.unknowns for body in assembled), once))
    return FORM_OF[way], solver


def _on_ground(scene: Scene, bodies: Sequence[Body]) -> tuple[Body, ...]:
    """The bodies of a scene, thin ones among them on a soft ground."""
    moduli = [part.material.E for part in scene.parts if hasattr(part, "material")]
    modulus = min(moduli, default=0.0)
    made = each(lambda body: on_soft_ground(body, modulus), bodies, _parallel(bodies))
    for new, old in zip(made, bodies):
        if new is not old:
            log.info("body '%s' is thin: a soft ground holds it until the contact does", new.name)
    return made


def _parallel(bodies: Sequence[Body]) -> list[bool]:
    return [body.way.parallel for body in bodies]
