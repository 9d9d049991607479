"""A body given by its matrices (contactopt.scenes.matrix_part, which has the signs): its unknowns,
what holds them, and its contact surfaces.

The n unknowns U are those of the points in the caller's own numbering, and after them those of K
that are none of a point. With constraints the points move by u = D U; an unknown of a point that
follows others is held here and has no part in D. Without any, u = U.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import Guides, Mesh, Surface, Work
from contactopt.bodies.assembled_elastic import AssembledMatrices, alone_of, trace_of
from contactopt.bodies.bare_facets import bare_surface, ordered, turned_outwards
from contactopt.bodies.body import Constraints
from contactopt.bodies.corners import smooth_tilts
from contactopt.bodies.elastic import ElasticBody, condense
from contactopt.bodies.given_matrices import GivenMatrices
from contactopt.bodies.matrix_checks import (
    check_definite,
    check_isolated,
    free_motions_of,
    indefinite,
    numbered,
    without_stiffness,
)
from contactopt.bodies.solvers.ordering import elimination_work
from contactopt.bodies.solvers.system import INDEFINITE
from contactopt.cards import count
from contactopt.checks import place_words, real_array
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.problem.laws import find_law
from contactopt.scenes.matrix_part import MatrixPart
from contactopt.scenes.scene import Scene


class _SolvedBody(ElasticBody):
    """A body whose stiffness is known by its solves alone: it resists what acts on it."""

    def internal_forces(self, U: np.ndarray, force: np.ndarray) -> np.ndarray:
        return np.asarray(self.body.load + force)


@dataclass(frozen=True, eq=False)
class MatrixBody(AssembledMatrices):
    """The assembled matrices of a body that a MatrixPart gives."""

    body: GivenMatrices
    part: MatrixPart

    @property
    def surfaces(self) -> Mapping[str, Surface]:
        return self.body.surfaces

    def iterates(self, solver: str) -> bool:
        return self.body.solves is None and super().iterates(solver)

    @cached_property
    def work(self) -> Work:
        """From the graph of all points, of which few are held."""
        body, first = self.body, self.body.unknowns[0]
        if body.solves is not None:
            return Work()
        # points that constraints leave out of K are points of the graph, too
        graph = sp.csr_matrix(abs(body.A[first][:, first]) + sp.identity(len(first)))
        x = body.locations
        kept = np.flatnonzero(np.isin(body.unknowns, body.contact_dofs).any(axis=0))
        sizes = (elimination_work(graph, x, own) for own in (kept[:0], kept))
        return Work(body.A.nnz, len(body.contact_dofs), *sizes)

    def guides(self) -> Guides:
        """Coordinate planes beside the body, whose points are held along the axis alone."""
        body, x = self.body, self.body.locations
        extent = np.stack([x.min(axis=1), x.max(axis=1)], axis=1)
        near = EQUAL * float(np.ptp(extent, axis=1).max())
        still = np.ones(len(body.load), dtype=bool)
        still[body.free] = False
        still, planes = (still & (body.prescribed == 0))[body.unknowns], []
        for axis, ends in enumerate(extent):
            for place, sign in zip(ends, (1.0, -1.0)):
                on = still[:, np.abs(x[axis] - place) <= near]
                if on[axis].all() and not on.all():
                    planes.append((axis, float(place), sign))
        return Guides(extent, tuple(planes))

    def prepare(self, solver: str, entries: bool) -> ElasticBody:
        try:
            made = condense(self.body, solver, entries)
            check_definite(self.body, made, self.body.solves is None)
        except RuntimeError as error:  # of solvers, which say what is wrong
            if INDEFINITE in str(error):
                raise indefinite(self.body) from error
            if "singular" not in str(error):
                raise
            raise without_stiffness(self.body) from error
        if self.body.solves is None:
            return made
        return _SolvedBody(**{each.name: getattr(made, each.name) for each in fields(made)})


def assemble_matrices(
    scene: Scene, part: MatrixPart, elements: int, zone: float | None
) -> MatrixBody:
    """The body of a MatrixPart, as contactopt.bodies.assemble says."""
    x = part.coordinates(scene.dim)
    K, f, D = _matrices(part, x)
    way = numbered(scene.analysis, part, K, D, x)
    holding = _held(scene, part, way.numbers, len(f), D)
    held = holding.held
    if part.solves is None:
        check_isolated(part.name, K, held)
    coupled = None if part.solves is not None else _coupled(K, way.numbers)
    fixed = held[: x.size] & ~_follows(D)[: x.size]
    surfaces = {
        name: _surface(scene, part, name, _Points(x, way.numbers, D, fixed), coupled)
        for name in scene.surfaces_of(part)
    }
    body = GivenMatrices(
        part.name,
        K,
        f,
        holding.prescribed,
        np.flatnonzero(~held),
        holding.motion,
        np.array(holding.plate_forces, dtype=float),
        free_motions_of(part, K, held, way, scene.components),
        tuple(holding.driven),
        holding.holders,
        _reload,
        way.numbers,
        x,
        surfaces,
        D,
        part.solves,
        {name: np.asarray(own, dtype=int) for name, own in part.facets.items()},
        partial(part.stresses, scene.kind),
        scene.analysis.stresses,
    )
    return MatrixBody(body, part)


def _reload(body: GivenMatrices, scene: Scene, part: MatrixPart) -> GivenMatrices:
    """The body with other loads f and other values of the same fixed unknowns and plates."""
    K, f, D = _matrices(part, part.coordinates(scene.dim))
    same = K is body.A or (K.shape == body.A.shape and abs(K - body.A).max() == 0)
    made = _held(scene, part, body.unknowns, len(f), D) if same else None
    if made is None or not (
        np.array_equal(np.flatnonzero(~made.held), body.free)
        and np.array_equal(made.motion, body.motion)
    ):
        raise InputError(
            f"body '{part.name}': its K changed, or other unknowns are held than before; only f and"
            " the values of what is fixed may change along a path."
        )
    forces = np.array(made.plate_forces, dtype=float)
    return replace(body, load=f, prescribed=made.prescribed, plate_forces=forces)


def _matrices(part: MatrixPart, x: np.ndarray) -> tuple[sp.csr_matrix, np.ndarray, sp.csr_matrix]:
    """K and f on all unknowns U (n,), and D (dim N, n), as at the top of this module."""
    n, K, f, T = x.size, part.K, part.f, part.constraints
    if T is None:
        if K.shape[0] != n:
            raise InputError(
                f"body '{part.name}': K has {count(K.shape[0], 'row')}, but {n}"
                " unknowns belong to the points; where unknowns are left out or follow others,"
                f" give constraints, the sparse matrix ({n}, {K.shape[0]}) that takes the"
                " unknowns of K to all of them."
            )
        return K, f, sp.identity(n, format="csr")
    m = T.shape[1]
    if T.shape[0] != n or K.shape[0] not in T.shape:
        raise InputError(
            f"body '{part.name}': its constraints need a row for each of the {n} unknowns of the"
            f" points and a column for each of K; got the shape {T.shape}, and K {K.shape}."
        )
    if K.shape[0] == n != m:
        K, f = T.T @ K @ T, T.T @ f
    T.eliminate_zeros()
    alone = np.flatnonzero(np.diff(T.indptr) == 1)
    alone = alone[T.data[T.indptr[alone]] == 1.0]
    columns, first = np.unique(T.indices[T.indptr[alone]], return_index=True)
    place = n + np.cumsum(~np.isin(np.arange(m), columns)) - 1
    place[columns] = alone[first]
    P = sp.csr_matrix((np.ones(m), (place, np.arange(m))), (n + m - len(columns), m))
    return sp.csr_matrix(P @ K @ P.T), P @ f, sp.csr_matrix(T @ P.T)


def _follows(D: sp.csr_matrix) -> np.ndarray:
    """(n,) whether an unknown has no part in D, because it follows others."""
    return np.bincount(D.indices, minlength=D.shape[1]) == 0


def _held(
    scene: Scene, part: MatrixPart, numbers: np.ndarray, n: int, D: sp.csr_matrix
) -> Constraints:
    """What holds the n unknowns: `fixed`, supports, plates, and others that they follow."""
    none = np.zeros(n), np.zeros(n, dtype=bool)
    made = Constraints(scene, part, numbers, part.facets, _nodes_of(part), *none)
    follows, fixed = _follows(D), {} if part.fixed is None else part.fixed
    if not isinstance(fixed, Mapping):
        if np.asarray(fixed).dtype == bool:
            raise InputError(
                f"body '{part.name}': fixed names unknowns by their numbers; of a mask give"
                " numpy.flatnonzero(mask)."
            )
        fixed = dict.fromkeys(np.ravel(fixed).tolist(), 0.0)
    where = real_array(f"the fixed unknowns of body '{part.name}'", list(fixed))
    values = real_array(f"the fixed displacements of body '{part.name}'", list(fixed.values()))
    wrong = (where < 0) | (where >= D.shape[0]) | (where != np.round(where))
    if wrong.any():
        raise InputError(
            f"body '{part.name}': fixed names unknowns by whole numbers from 0 to {D.shape[0] - 1};"
            f" got {where[wrong][0]:g}."
        )
    if part.solves is not None and values.any():
        raise InputError(
            f"body '{part.name}': a function that solves holds its fixed unknowns at 0; give K"
            " itself for other displacements."
        )
    if len(where):
        made.prescribed[where.astype(int)] = values
        made.hold("support 'fixed'", where.astype(int))
    made.add_all()
    if (twice := np.flatnonzero(made.held & follows)).size:
        raise InputError(
            f"body '{part.name}': unknown {twice[0]} is held, and its constraints let it follow"
            " others; keep one of them."
        )
    made.held[follows] = True
    if made.held.all():
        raise InputError(f"body '{part.name}' is held at all its unknowns; nothing of it deforms.")
    return made


def _nodes_of(part: MatrixPart) -> Callable[[str], np.ndarray]:
    return lambda name: np.asarray(part.facets[name], dtype=int).ravel()


def _coupled(K: sp.csr_matrix, numbers: np.ndarray) -> sp.csr_matrix:
    """(N, N) ones where K couples two points."""
    count = numbers.shape[1]
    node = np.full(K.shape[0], count)
    node[numbers] = np.arange(count)
    entries = sp.coo_matrix(K)
    pairs = node[entries.row], node[entries.col]
    size = (count + 1, count + 1)
    made = sp.csr_matrix((np.ones(entries.nnz) * (entries.data != 0), pairs), size)
    made = made[:count, :count]
    made.eliminate_zeros()
    made.data[:] = 1.0
    return made


@dataclass(frozen=True, eq=False)
class _Points:
    """Points x (dim, N) whose unknowns have rows `numbers` of u = D U, and may be `fixed`."""

    x: np.ndarray
    numbers: np.ndarray
    D: sp.csr_matrix
    fixed: np.ndarray

    def with_centres(self, facets: np.ndarray) -> tuple[_Points, np.ndarray]:
        """Facets of 8 points with a centre: -1/4 of the corners and 1/2 of the middles."""
        share, (many, count) = np.repeat([-0.25, 0.5], 4), (len(facets), self.x.shape[1])
        rows, values = np.repeat(np.arange(many), 8), np.tile(share, many)
        added = [
            sp.csr_matrix((values, (rows, own[facets].ravel())), (many, self.D.shape[0])) @ self.D
            for own in self.numbers
        ]
        numbers = self.D.shape[0] + np.arange(many * len(added)).reshape(len(added), many)
        points = _Points(
            np.concatenate([self.x, np.tensordot(self.x[:, facets], share, 1)], axis=1),
            np.concatenate([self.numbers, numbers], axis=1),
            sp.csr_matrix(sp.vstack([self.D, *added])),
            np.concatenate([self.fixed, np.zeros(numbers.size, dtype=bool)]),
        )
        centres = count + np.arange(many)[:, None]
        return points, np.concatenate([facets, centres], axis=1)


def _surface(
    scene: Scene, part: MatrixPart, name: str, at: _Points, coupled: sp.csr_matrix | None
) -> Surface:
    if name not in part.facets:
        raise InputError(
            f"body '{part.name}' has no facets {name!r}; it has {', '.join(part.facets)}."
        )
    what = f"body '{part.name}', facets {name!r}"
    facets = ordered(at.x, np.asarray(part.facets[name], dtype=int), what)
    outward = turned_outwards(at.x, facets, coupled, what)
    own = np.unique(facets)
    if (still := own[at.fixed[at.numbers[:, own]].all(axis=0)]).size:
        raise InputError(
            f"{what}: the node at ({place_words(at.x[:, still[0]])}) is held in all its components,"
            " so that no contact force can move it; take it out of the facets, or do not hold it."
        )
    if facets.shape[1] == 8:
        at, facets = at.with_centres(facets)
    laws = [find_law(law) for law in scene.laws_of(part, name)]
    tied = bool(laws) and not any(law.bounded for law in laws)
    weight = (scene.analysis.measure(scene.thickness) * scene.copies, scene.analysis.revolved)
    try:
        made = bare_surface(at.x, facets, outward, weight, tied, coupled)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
    trace, point = made.trace, made.nodes
    nodes, own = np.unique(trace.weights.indices), point[trace.copies]
    unknowns = at.numbers[:, np.maximum(point, 0)]  # of the nodes of the elements behind
    mesh = Mesh(
        made.kind,
        made.degree,
        trace.faces,
        made.outward,
        weight,
        at.x[:, own],
        at.fixed[at.numbers[:, own]],
        tuple(at.D[row] for row in at.numbers[:, own]),
        None,
        np.zeros(len(facets), dtype=bool),
    )
    along = np.abs(trace.normals) <= smooth_tilts(trace.normals, trace.cells)
    alone = alone_of(trace, unknowns, at.fixed)
    return Surface(
        part.name,
        at.x[:, point[trace.nodes]],
        trace.normals,
        trace.areas,
        trace.weights[:, nodes],
        at.x[:, point[nodes]],
        tuple(
            sp.csr_matrix(trace_of(trace.weights, trace.nodes, row, at.fixed, own) @ at.D)
            for row, own in zip(unknowns, along)
        ),
        at.fixed[unknowns[:, trace.nodes]],
        trace.cells,
        alone and tuple(sp.csr_matrix(each @ at.D) for each in alone),
        mesh,
    )
