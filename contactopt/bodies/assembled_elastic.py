"""An elastic body whose surfaces are known, before it is condensed (contactopt.bodies.elastic)."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import AssembledBody, Guides, Mesh, Surface, Work
from contactopt.bodies.assembly import Assembly, Matrices
from contactopt.bodies.body import build_body
from contactopt.bodies.corners import smooth_tilts
from contactopt.bodies.elastic import ElasticBody, condense
from contactopt.bodies.elements import Trace, mean_normals
from contactopt.bodies.solvers import solver_type
from contactopt.bodies.solvers.ordering import elimination_work
from contactopt.bodies.thickness import thin_facets
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.meshes.given_curves import Curve, check_curve
from contactopt.scenes.matrix_part import MatrixPart
from contactopt.scenes.scene import Part, Scene


@dataclass(frozen=True, eq=False)
class AssembledMatrices(AssembledBody):
    """A body with a linear system, and its part of the scene."""

    body: Matrices
    part: Part | MatrixPart
    if TYPE_CHECKING:

        @property
        def surfaces(self) -> Mapping[str, Surface]: ...

    @cached_property
    def name(self) -> str:
        return self.body.name

    @cached_property
    def unknowns(self) -> int:
        return len(self.body.free)

    @cached_property
    def held(self) -> np.ndarray:
        return np.setdiff1d(np.arange(len(self.body.load)), self.body.free)

    def iterates(self, solver: str) -> bool:
        return solver_type(solver, self.unknowns, len(self.body.unknowns)).iterative

    def surface(self, name: str | None = None) -> Surface:
        name = name or self.part.contact
        if name not in self.surfaces:
            raise InputError(
                f"body '{self.name}' has no contact surface {name!r}; it has"
                f" {', '.join(sorted(self.surfaces))}."
            )
        return self.surfaces[name]


@dataclass(frozen=True, eq=False)
class AssembledElastic(AssembledMatrices):
    """An Assembly with its part of the scene."""

    body: Assembly
    part: Part

    @cached_property
    def work(self) -> Work:
        """From the graph of all nodes, of which supports hold few."""
        body, dim = self.body, len(self.body.unknowns)
        first = body.unknowns[0]  # unknown of the first component of each node; others follow it
        graph = body.A[first][:, first]
        kept = body.surface_nodes
        return Work(
            body.A.nnz,
            len(kept) * dim,
            elimination_work(graph, body.locations, kept[:0]),
            elimination_work(graph, body.locations, kept),
        )

    @cached_property
    def surfaces(self) -> dict[str, Surface]:
        """All contact surfaces, made once, with nodes on the curves that the part gives."""
        return {name: self._surface(name) for name in self.body.traces}

    def _surface(self, name: str) -> Surface:
        body = self.body
        trace, unknowns = body.traces[name], body.unknowns
        nodes = np.unique(trace.weights.indices)
        places = body.locations[:, nodes]
        curve = self.part.curve_of(name)
        if curve is not None:
            if curve.given:
                check_curve(curve, body.basis.mesh, name)
            places = curve(places)
        held = np.ones(len(body.load), dtype=bool)
        held[body.free] = False
        tilts = smooth_tilts(trace.normals, trace.cells)
        return Surface(
            body.name,
            body.locations[:, trace.nodes],
            trace.normals,
            trace.areas,
            trace.weights[:, nodes],
            places,
            tuple(
                trace_of(trace.weights, trace.nodes, row, held, along)
                for row, along in zip(unknowns, np.abs(trace.normals) <= tilts)
            ),
            held[unknowns[:, trace.nodes]],
            trace.cells,
            alone_of(trace, unknowns, held),
            self._mesh(name, held, curve),
        )

    def _mesh(self, name: str, held: np.ndarray, curve: Curve | None) -> Mesh:
        body, facets = self.body, np.asarray(self.body.basis.mesh.boundaries[name])
        trace = body.traces[name]
        outward, nodes = mean_normals(body.basis, body.degree, facets), trace.copies
        unknowns, count = body.unknowns[:, nodes], np.arange(len(nodes) + 1)
        picked = (
            sp.csr_matrix((np.ones(len(nodes)), row, count), (len(nodes), len(held)))
            for row in unknowns
        )
        kind = body.basis.mesh.refdom.__name__
        places = body.locations[:, nodes], held[unknowns], tuple(picked)
        thin = thin_facets(body.basis.mesh, facets)
        return Mesh(kind, body.degree, trace.faces, outward, body.weight, *places, curve, thin)

    def guides(self) -> Guides:
        """Coordinate planes, the body on one side, that supports hold along the axis alone."""
        body, mesh = self.body, self.body.basis.mesh
        x = body.locations
        extent = np.stack([x.min(axis=1), x.max(axis=1)], axis=1)
        near = EQUAL * float(np.ptp(extent, axis=1).max())
        planes = []
        for support in self.part.supports:
            given = support.displacement or {}
            if list(given.values()) != [0.0] or support.boundary not in mesh.boundaries:
                continue
            axis = body.kind.components.index(next(iter(given)))
            nodes = mesh.facets[:, np.asarray(mesh.boundaries[support.boundary])]
            low, high = extent[axis]
            for place, sign in ((low, 1.0), (high, -1.0)):
                if np.all(np.abs(mesh.p[axis, nodes] - place) <= near):
                    planes.append((axis, float(place), sign))
        return Guides(extent, tuple(planes))

    def prepare(self, solver: str, entries: bool) -> ElasticBody:
        return condense(self.body, solver, entries)


def alone_of(
    trace: Trace, unknowns: np.ndarray, held: np.ndarray
) -> tuple[sp.csr_matrix, ...] | None:
    """The displacement of nodes at contacts alone; None where it is that of the contacts."""
    k, W = len(trace.nodes), trace.weights
    own = sp.csr_matrix((np.ones(k), (np.arange(k), trace.nodes)), W.shape)
    if not abs(W - own).max():
        return None
    every = np.ones(k, dtype=bool)
    return tuple(trace_of(own, trace.nodes, row, held, every) for row in unknowns)


def trace_of(
    weights: sp.csr_matrix,
    nodes: np.ndarray,
    unknowns: np.ndarray,
    held: np.ndarray,
    along: np.ndarray,
) -> sp.csr_matrix:
    """One component of the displacement of the contacts (k,) in terms of all unknowns (n,), by
    their rows of the weights. Where it is prescribed at the contact node, and `along` the surface
    (k,), it is that of the node alone: the weights of a neighbour and of its mirror image cancel
    each other there. Pressure needs the whole of a component across the surface.
    """
    k = len(nodes)
    alone = sp.csr_matrix((np.ones(k), (np.arange(k), nodes)), weights.shape)
    prescribed = sp.diags((held[unknowns[nodes]] & along).astype(float))
    part = sp.coo_matrix(weights - prescribed @ (weights - alone))
    trace = sp.csr_matrix((part.data, (part.row, unknowns[part.col])), (k, len(held)))
    trace.eliminate_zeros()
    return trace


def assemble_elastic(
    scene: Scene, part: Part, elements: int, zone: float | None
) -> AssembledElastic:
    """The body of an elastic part, as contactopt.bodies.assemble says."""
    return AssembledElastic(build_body(scene, part, elements, zone), part)
