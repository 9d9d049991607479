"""From the bodies to the interface: u = Q r + V lambda + q by domain decomposition (paper, eqs
(13)-(14)).

Every body b moves by U_b = at_rest + C_b F + motions lambda under nodal forces F
(contactopt.bodies.protocol). The coupling of a pair of surfaces gives the maps T of its two bodies,
from their displacements to local contact frames (n, t1[, t2]). The contacts of all pairs follow
each other. The signed map B_b of a body holds, in the rows of each pair that it takes part in, T if
it is the upper body there and -T if it is the lower one,

    u = sum B_b U_b + gap n,   F_b = B_b' r   ==>   Q = sum B_b C_b B_b',   V = [B_b motions_b],   q
                               = sum B_b at_rest_b + gap n.

The free motions of all bodies are the multipliers of the problem, and their resultants make s. Q is
an array (explicit) or an operator (implicit) whose product is one product with each body. Both cost
no more than the pairs that each body takes part in.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from types import FunctionType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from contactopt.bodies import assemble
from contactopt.bodies.protocol import AssembledBody, Body
from contactopt.bodies.solvers import factors_of
from contactopt.cards import card, count, line
from contactopt.checks import check_count, check_number
from contactopt.coupling.charts import SymmetryPlane
from contactopt.coupling.costs import MOST_EXPLICIT, form_of
from contactopt.coupling.coupling import Coupling, couple
from contactopt.coupling.equilibrium import coupled_form
from contactopt.coupling.planes_of_symmetry import mirror_planes
from contactopt.errors import InputError
from contactopt.linear.concurrency import each, one_blas_thread
from contactopt.linear.convolution import Convolution
from contactopt.linear.operators import (
    FORMS,
    NOISE,
    Interface,
    InterfaceOperator,
    Product,
    check_dense,
    dense,
    diagonal,
    estimate_diagonal,
)
from contactopt.problem import InterfaceProblem, Law, Pair, Solution
from contactopt.problem.chart import nodal_weights
from contactopt.problem.laws import make_law
from contactopt.problem.laws.mixed import join
from contactopt.scenes.contact import Contact
from contactopt.scenes.scene import MOST_ACROSS, Part, Scene

log = logging.getLogger(__name__)
# share of the entries of Q that may be other than zero for it to be kept by sparse rows
SPARSE = 0.25


@dataclass(frozen=True, eq=False)
class Reduction:
    """An InterfaceProblem with what is needed to go back to the bodies.

    bodies     the bodies of the scene, in the order of its parts
    maps       the signed map B (k dim, n) of each body, from its displacements to u
    couplings  contacts, frames, initial gap, areas, chart of each pair of surfaces
    seconds    phase -> time
    planes     of symmetry beyond which mirror images make the bodies whole
    on_ground  whether a ground holds thin bodies (contactopt.bodies.thin)
    """

    scene: Scene
    problem: InterfaceProblem
    bodies: tuple[Body, ...]
    maps: tuple[sp.csr_matrix, ...]
    couplings: tuple[Coupling, ...]
    seconds: dict[str, float]
    planes: tuple[SymmetryPlane, ...] = ()
    on_ground: bool = False
    _known: WeakKeyDictionary[Solution, tuple[Any, ...]] = field(
        default_factory=WeakKeyDictionary, init=False, repr=False
    )

    def __repr__(self) -> str:
        unknowns, pairs = (
            count(self.dofs, "unknown"),
            count(len(self.couplings), "pair of surfaces", "pairs of surfaces"),
        )
        return line(
            "Reduction", self.scene.name, unknowns, count(self.problem.contacts, "contact"), pairs
        )

    def _repr_html_(self) -> str:
        rows: dict[str, object] = {"scene": self.scene.name, "kind": self.scene.kind}
        for body in self.bodies:
            rows[f"body {body.name}"] = count(body.unknowns, "unknown")
        for pair, coupling in zip(self.problem.pairs, self.couplings):
            rows[f"surfaces {pair.name}"] = (
                f"{count(len(coupling.gap), 'contact')}, coupled by {coupling.kind}"
            )
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
        """(k,) initial gap of all contacts [length]."""
        return np.concatenate([made.gap for made in self.couplings])

    @property
    def frames(self) -> np.ndarray:
        """(k, dim, dim) rows n, t1[, t2] of all contacts."""
        return np.concatenate([made.frames for made in self.couplings])

    @property
    def operator(self) -> InterfaceOperator:
        """Q by its products, whatever the form of problem.Q."""
        if isinstance(self.problem.Q, InterfaceOperator):
            return self.problem.Q
        return _operator(self.bodies, self.maps, self.couplings)

    @property
    def iterative(self) -> bool:
        """Whether products with Q cost iterations, so that a lower accuracy makes them cheaper."""
        return any(body.iterative for body in self.bodies)

    @property
    def dofs(self) -> int:
        """Free displacement unknowns of all bodies."""
        return sum(body.unknowns for body in self.bodies)

    def own_multipliers(self, multipliers: np.ndarray) -> tuple[np.ndarray, ...]:
        """Split the multipliers of the problem body by body.

        Parameters
        ----------
        multipliers : (p,) multipliers of the problem.

        Returns
        -------
        The multipliers (p_b,) of each body.
        """
        ends = np.cumsum([len(body.resultants) for body in self.bodies])
        return tuple(np.split(multipliers, ends[:-1]))

    def displaced(self, solution: Solution) -> tuple[np.ndarray, ...]:
        """Compute the displacements of every body of a solution.

        They are computed once. Bodies whose displacements came with the contact forces are not
        solved at all.

        Parameters
        ----------
        solution : A solution of the problem.

        Returns
        -------
        U (n_b,) of each body [length].
        """
        if solution in self._known:
            return self._known[solution]
        known = [] if solution.displacements is None else list(solution.displacements.parts)
        free = [
            known.pop(0) if known and body.equilibrium is not None else None for body in self.bodies
        ]
        parts = zip(self.bodies, self.maps, self.own_multipliers(solution.multipliers), free)

        def displaced(part: tuple[Body, sp.csr_matrix, np.ndarray, Any]) -> np.ndarray:
            body, B, own, X = part
            return body.displacement(B.T @ solution.reactions.ravel(), own, X)

        self._known[solution] = each(displaced, parts, [body.parallel for body in self.bodies])
        return self._known[solution]

    def grounded(self) -> Reduction | None:
        """Put thin bodies on a soft ground (contactopt.bodies.thin).

        Returns
        -------
        The reduction with these bodies, whose answer is right where it no longer pulls them; None
        without thin bodies.
        """
        if self.on_ground:
            return self
        bodies = _on_ground(self.scene, self.bodies)
        if all(new is old for new, old in zip(bodies, self.bodies)):
            return None
        implicit = isinstance(self.problem.Q, InterfaceOperator)
        Q = (
            _operator(bodies, self.maps, self.couplings)
            if implicit
            else _entries(bodies, self.maps)
        )
        return replace(self._with(bodies, Q), on_ground=True)

    def pulled(self, solution: Solution) -> Reduction:
        """Let the ground of each body pull it towards its displacement, from which those of the
        contacts are taken anew.

        Parameters
        ----------
        solution : A solution of the problem.

        Returns
        -------
        With other displacements at rest.
        """
        displaced = self.displaced(solution)
        made = self._with(
            tuple(body.pulled(U) for body, U in zip(self.bodies, displaced)), self.problem.Q
        )
        # What rounding in Q and q makes of the displacements of the contacts, beside those of the
        # bodies.
        missing = self.seen(displaced) - self.problem.displacements(
            solution.reactions, solution.multipliers
        )
        return replace(made, problem=replace(made.problem, q=made.problem.q + missing))

    def seen(self, displaced: Sequence[Any]) -> np.ndarray:
        """Compute the displacements u of the contacts from those of the bodies.

        Parameters
        ----------
        displaced : (n_b,) displacement of each body [length].

        Returns
        -------
        (k, dim), with the initial gap [length].
        """
        u = sum(
            (body.seen(B, U) for body, B, U in zip(self.bodies, self.maps, displaced)),
            0 * self.problem.q.ravel(),
        )
        return (
            np.asarray(u).reshape(self.problem.q.shape)
            + self.gap[:, None] * np.eye(self.problem.dim)[0]
        )

    def _with(self, bodies: tuple[Body, ...], Q: Interface) -> Reduction:
        """With bodies that rest elsewhere.

        What was added to q, the slip of earlier states, stays.
        """
        problem = _problem(self.scene, Q, bodies, self.maps, self.couplings)
        old = _problem(self.scene, Q, self.bodies, self.maps, self.couplings)
        return replace(
            self, bodies=bodies, problem=replace(problem, q=self.problem.q + problem.q - old.q)
        )

    def loaded(self, scene: Scene) -> Reduction:
        """Put the loads of another scene of the same structure on the same bodies, coupling and Q.

        Values of tractions, body forces, plate forces and support displacements may differ, and mu;
        nothing else may differ.

        Parameters
        ----------
        scene : The other scene.

        Returns
        -------
        The reduction of that scene.

        Raises
        ------
        InputError : If meshes, materials or other parts differ, or if supports or plates hold other
            unknowns.
        """
        _check_same(self.scene, scene)
        start = time.perf_counter()
        pairs = zip(self.bodies, scene.parts)
        bodies = each(
            lambda pair: pair[0].loaded(scene, pair[1]),
            pairs,
            [body.parallel for body in self.bodies],
        )
        problem = _problem(scene, self.problem.Q, bodies, self.maps, self.couplings)
        seconds = {"load": time.perf_counter() - start}
        return replace(self, scene=scene, problem=problem, bodies=bodies, seconds=seconds)


def _check_same(one: Scene, other: Scene) -> None:
    """Raise InputError unless both scenes have the same bodies, but for their loads."""
    if not isinstance(other, Scene):
        raise InputError(f"a state of a path must be a Scene; got {type(other).__name__}.")
    if (one.kind, one.degree, len(one.parts)) != (other.kind, other.degree, len(other.parts)):
        raise InputError(
            f"the states '{one.name}' and '{other.name}' of a path are not those of one scene."
        )
    for a, b in zip(one.parts, other.parts):
        if type(a) is not type(b) or a.name != b.name:
            raise InputError(
                f"the states of a path must have the same bodies; '{a.name}' became '{b.name}'."
            )
        if isinstance(a, Part) and isinstance(b, Part) and a.material != b.material:
            raise InputError(
                f"body '{a.name}' changes its material along the path; only loads may change."
            )
        if isinstance(a, Part) and isinstance(b, Part) and not _same_mesh(a.mesh, b.mesh):
            raise InputError(
                f"body '{a.name}' changes its mesh along the path; only loads may change."
            )


def _same_mesh(one: Any, other: Any) -> bool:
    """Whether two meshes have the same nodes and elements; functions that make them are compared by
    what they enclose.
    """
    if callable(one) or callable(other):
        return callable(one) and callable(other) and not _differ(one, other)
    return one is other or (np.array_equal(one.p, other.p) and np.array_equal(one.t, other.t))


def _differ(one: Any, other: Any) -> bool:
    """Whether two values are known to be different: numbers, texts, arrays, and functions of one
    code that enclose such.
    """
    if isinstance(one, (int, float, str, np.ndarray)) and isinstance(
        other, (int, float, str, np.ndarray)
    ):
        return not np.array_equal(one, other)
    if isinstance(one, (tuple, list)) and isinstance(other, (tuple, list)):
        return len(one) != len(other) or any(map(_differ, one, other))
    if (
        isinstance(one, FunctionType)
        and isinstance(other, FunctionType)
        and one.__code__ is other.__code__
    ):
        enclosed = [[cell.cell_contents for cell in f.__closure__ or ()] for f in (one, other)]
        return _differ(enclosed[0], enclosed[1])
    return False


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
) -> Reduction:
    """Reduce a scene to its interface problem and keep the bodies, from which fields are recovered.

    Where the solvers of the bodies allow it, the bodies are factorised at the same time.

    Parameters
    ----------
    scene, elements, zone, Q, solver, coupling : As for reduce().

    Returns
    -------
    The interface problem with the bodies, the coupling and the seconds that each phase took.

    Raises
    ------
    InputError : As reduce().
    """
    if not isinstance(scene, Scene):
        raise InputError(f"the scene must be a Scene; got {type(scene).__name__}.")
    if not isinstance(Q, str) or Q not in FORMS:
        raise InputError(f"unknown form of Q {Q!r}; choose from {', '.join(FORMS)}.")
    elements = scene.elements if elements is None else elements
    zone = scene.zone if zone is None else zone
    check_count("elements", elements)
    if elements > MOST_ACROSS:
        raise InputError(f"elements must be at most {MOST_ACROSS}; got {elements}.")
    if zone is not None:
        check_number("the contact zone's half-width", zone, low=0.0)
    seconds: dict[str, float] = {}
    start = time.perf_counter()
    assembled = each(lambda part: assemble(scene, part, elements, zone), scene.parts)
    named = {body.name: body for body in assembled}
    sides = [(named[pair.bodies[0]], named[pair.bodies[1]]) for pair in scene.pairs]
    coupled = tuple(
        couple(scene, pair, *bodies, coupling) for pair, bodies in zip(scene.pairs, sides)
    )
    maps = tuple(_map_of(body, sides, coupled) for body in assembled)
    planes = (
        mirror_planes(scene, [body.guides() for body in assembled], coupled)
        if scene.copies > 1
        else ()
    )
    seconds["assemble"] = time.perf_counter() - start

    start = time.perf_counter()
    n = maps[0].shape[0]
    if Q == "auto":
        contact, largest = (
            max(getattr(b, size) for b in assembled) for size in ("interface_unknowns", "unknowns")
        )
        if _filling(maps) ** 0.5 > MOST_EXPLICIT:
            contact = MOST_EXPLICIT + 1
        Q = form_of(
            contact,
            largest,
            scene.dim,
            any(b.iterates(solver) for b in assembled),
            factors_of(solver, scene.dim),
        )
    log.info("scene '%s': %s Q of %d unknowns", scene.name, Q, n)
    if Q == "explicit":
        check_dense(round(_filling(maps) ** 0.5))
    iterate = any(body.iterates(solver) for body in assembled)
    with one_blas_thread() if iterate else nullcontext():
        bodies = each(lambda body: body.prepare(solver, Q == "explicit"), assembled)
    seconds["factorise"] = time.perf_counter() - start

    start = time.perf_counter()
    made = _operator(bodies, maps, coupled) if Q == "implicit" else _entries(bodies, maps)
    on_ground = not np.min(diagonal(made), initial=0.0) >= -NOISE * np.max(
        diagonal(made), initial=0.0
    )
    if on_ground:  # nothing is left of the compliance of a thin body but rounding, or no number
        bodies = _on_ground(scene, bodies)
        made = _operator(bodies, maps, coupled) if Q == "implicit" else _entries(bodies, maps)
    problem = _problem(scene, made, bodies, maps, coupled)
    seconds["compliance"] = time.perf_counter() - start
    return Reduction(scene, problem, bodies, maps, coupled, seconds, planes, on_ground)


def _on_ground(scene: Scene, bodies: Sequence[Body]) -> tuple[Body, ...]:
    """The bodies of a scene, thin ones among them on a soft ground."""
    modulus = min(part.material.E for part in scene.parts if hasattr(part, "material"))
    made = each(lambda body: body.grounded(modulus), bodies, [body.parallel for body in bodies])
    for new, old in zip(made, bodies):
        if new is not old:
            log.info("body '%s' is thin: a soft ground holds it until the contact does", new.name)
    return made


def _map_of(
    body: AssembledBody,
    sides: Sequence[tuple[AssembledBody, AssembledBody]],
    couplings: Sequence[Coupling],
) -> sp.csr_matrix:
    """B (k dim, n) of a body: the maps of the pairs that it takes part in, with their signs, and
    zeros elsewhere.
    """
    ends = np.cumsum([0, *(made.frames.shape[0] * made.frames.shape[1] for made in couplings)])
    blocks = [
        (first, made.upper if body is upper else -made.lower)
        for first, (upper, lower), made in zip(ends, sides, couplings)
        if body is upper or body is lower
    ]
    width = blocks[0][1].shape[1]
    entries = [(first, sp.coo_matrix(block)) for first, block in blocks]
    rows = np.concatenate([first + block.row for first, block in entries])
    columns = np.concatenate([block.col for _, block in entries])
    values = np.concatenate([block.data for _, block in entries])
    return sp.csr_matrix((values, (rows, columns)), (int(ends[-1]), width))


def _pairs(scene: Scene, couplings: Sequence[Coupling]) -> tuple[Pair, ...]:
    ends = np.cumsum([0, *(len(made.gap) for made in couplings)])
    named = zip(scene.pairs, couplings, ends[:-1], ends[1:])
    return tuple(
        Pair(pair.name, int(first), int(last), made.chart) for pair, made, first, last in named
    )


def _law(pairs: Sequence[Contact], couplings: Sequence[Coupling]) -> Law:
    """One law for all contacts, from those of the pairs."""
    laws = [
        make_law(pair.law, pair.mu, made.areas, made.positions)
        for pair, made in zip(pairs, couplings)
    ]
    if len(laws) == 1:
        return laws[0]
    ends = np.cumsum([0, *(law.contacts for law in laws)])
    return join(
        [(law, np.arange(first, last)) for law, first, last in zip(laws, ends[:-1], ends[1:])]
    )


def _names(bodies: Sequence[Body]) -> tuple[str, ...]:
    """What each multiplier is, for messages."""
    return tuple(f"body '{body.name}': {name}" for body in bodies for name in body.motion_names)


def _rows(B: sp.csr_matrix) -> np.ndarray:
    """The rows of a map that are not empty; all of them where most are not, so that nothing needs
    to be picked out.
    """
    filled = np.flatnonzero(np.diff(B.indptr))
    return filled if 4 * len(filled) < 3 * B.shape[0] else np.arange(B.shape[0])


def _operator(
    bodies: Sequence[Body], maps: Sequence[sp.csr_matrix], couplings: Sequence[Coupling]
) -> InterfaceOperator:
    """Q by its products: a convolution where every body has one.

    Else its diagonal is an estimate, which takes one product.
    """
    kernels = [body.convolution(B) for body, B in zip(bodies, maps) if body.moved(B).any()]
    if kernels and all(kernel is not None for kernel in kernels):
        known = [kernel for kernel in kernels if kernel is not None]
        if len({kernel.padded for kernel in known}) > 1:
            raise InputError(
                "one half-space repeats itself periodically and the other does not; make both"
                " periodic or none."
            )
        return Convolution(sum(known[1:], known[0]))
    moved = [body.moved(B) for body, B in zip(bodies, maps)]
    moving = [(body, B, _rows(B)) for body, B, moves in zip(bodies, maps, moved) if moves.any()]
    parallel = [body.parallel for body, *_ in moving]
    acts = each(lambda term: term[0].product(term[1][term[2]]), moving, parallel)
    terms = [(act, rows) for act, (*_, rows) in zip(acts, moving)]

    def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
        def moves(term: tuple[Product, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
            """The columns that load a body at all, and what they make of it."""
            act, rows = term
            load = X[rows]
            columns = (
                np.flatnonzero(load.any(axis=0)) if len(couplings) > 1 else np.arange(X.shape[1])
            )
            return columns, act(load[:, columns], accuracy) if len(columns) else load[:, columns]

        out = np.zeros(X.shape)
        for (_, rows), (columns, own) in zip(terms, each(moves, terms, parallel)):
            out[np.ix_(rows, columns)] += own
        return out

    weights = [nodal_weights(made.chart, made.areas) for made in couplings]
    diagonal = estimate_diagonal(product, weights, np.any(moved, axis=0))
    complete, iterative = (
        all(body.complete for body in bodies),
        any(body.iterative for body in bodies),
    )
    entries = (lambda: dense(_entries(bodies, maps))) if complete else None
    coupled = coupled_form(bodies, maps) if iterative else None
    return InterfaceOperator(product, diagonal, entries, None, iterative, coupled)


def _filling(maps: Sequence[sp.csr_matrix]) -> int:
    """Number of the entries of Q between contacts that share a body."""
    return min(sum(len(_rows(B)) ** 2 for B in maps), maps[0].shape[0] ** 2)


def _entries(bodies: Sequence[Body], maps: Sequence[sp.csr_matrix]) -> np.ndarray | sp.csr_array:
    """Q by its entries, symmetric to the last digit: an array, or sparse rows where most pairs
    share no body.
    """
    n = maps[0].shape[0]
    moving = [(body, B, _rows(B)) for body, B in zip(bodies, maps) if body.moved(B).any()]
    parallel = [body.parallel for body, *_ in moving]
    made = each(lambda term: term[0].compliance(term[1][term[2]]), moving, parallel)
    parts = [(rows, own) for (*_, rows), own in zip(moving, made)]
    if _filling(maps) < SPARSE * n**2:
        rows = np.concatenate([np.repeat(rows, len(rows)) for rows, _ in parts])
        columns = np.concatenate([np.tile(rows, len(rows)) for rows, _ in parts])
        return sp.csr_array(
            (np.concatenate([own.ravel() for _, own in parts]), (rows, columns)), (n, n)
        )
    Q = np.zeros((n, n))
    for rows, own in parts:
        if len(rows) == n:
            Q += own
        else:
            Q[np.ix_(rows, rows)] += own
    return Q


def _problem(
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
    pairs = _pairs(scene, couplings)
    chart = pairs[0].chart if len(pairs) == 1 else None
    return InterfaceProblem(
        Q, q, _law(scene.pairs, couplings), V, s, areas, points, chart, pairs, _names(bodies)
    )
