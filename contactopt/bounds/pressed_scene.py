"""A solved scene as a guaranteed bound (contactopt.bounds.bound) sees it: tractions that the law
allows and that balance the bodies, and displacements that the contact allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.rigid import RigidBody
from contactopt.bodies.views import elements_of
from contactopt.bounds.displaced_stress import Halves, halved
from contactopt.bounds.equilibrium_elements import EquilibriumElements
from contactopt.bounds.facing_facets import (
    FacingFacets,
    control_points,
    facet_nodes,
    quadratic_shapes,
)
from contactopt.bounds.nearest_tractions import ForceResponse
from contactopt.bounds.simplices import Simplices
from contactopt.bounds.tetrahedra import Tetrahedra
from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.meshes.cells import is_curved, measures
from contactopt.scenes.loads.load import Uniform
from contactopt.solving.solve_scene import Solved

if TYPE_CHECKING:
    from contactopt.bodies.protocol import Body

THIN = 3e4  # length over height: half as much again is past what rounding permits


class PressedScene:
    """A solved scene of bodies of simplices with flat contact surfaces.

    cells       the elements of every body, None for a rigid one
    pairs       of facets;   factor  of all integrals (thickness, mirror images)
    loads       for each body the matrix (n, k dim) from tractions at the contacts, linear between
                them, to its nodal forces
    tractions   (k, dim) at the contacts, in their frames, that the law allows and that balance all
                free motions;   limit  (k,) the friction bound [stress]. For bodies of revolution
                both are those times r, and linear between contacts as such.
    share       (k,) tractions by forces at the contacts;   pressed  (k,) 1 where there is pressure,
                else 0
    Raises InputError for what a bound does not know.
    """

    def __init__(self, solved: Solved):
        self.reduction, self.solution = solved.reduction, solved.solution
        self.problem, scene = solved.reduction.problem, solved.reduction.scene
        if solved.path is not None or self.reduction.on_ground:
            raise InputError("a bound is of one state of bodies that need no ground to hold them.")
        self.bodies: list[Any] = list(self.reduction.bodies)
        self.revolved = scene.analysis.revolved
        self.cells: list[Any] = [
            self._elements(number, body) for number, body in enumerate(self.bodies)
        ]
        if scene.analysis.stretches:
            raise InputError(f"a bound does not know the kind '{scene.kind}'.")
        self.factor = scene.copies * scene.analysis.measure(scene.thickness)
        count = range(len(scene.pairs))
        self.pairs = [FacingFacets(solved, number, self.cells) for number in count]
        self.loads = [self._load(number, body) for number, body in enumerate(self.bodies)]
        areas, r = self.problem.areas, np.ones(len(self.problem.q))
        if self.revolved:
            r = np.concatenate([own.positions[0] for own in self.reduction.couplings])
        self.share = np.divide(r, areas, out=np.zeros(len(areas)), where=areas > 0)
        t = self.share[:, None] * self.solution.reactions
        t[:, 0] = np.maximum(t[:, 0], 0.0)
        bound, size = self.limit_of(t), np.linalg.norm(t[:, 1:], axis=1)
        over = size > bound
        t[over, 1:] *= (bound[over] / size[over])[:, None]
        given = [body.motions.resultants for body in self.bodies]
        self.tractions = self.balanced(t, np.concatenate(given))
        self.limit = self.limit_of(self.tractions)
        on_axis = (self.share == 0) & (self.solution.reactions[:, 0] > 0)
        self.pressed = np.where(on_axis, 1.0, self.tractions[:, 0] > 0)
        for pair in self.pairs:
            if pair.joined and np.any(self.tractions[pair.alone, 0] > 0):
                raise InputError("a surface is pressed beyond the end of the other: no bound.")

    def _elements(self, number: int, body: Body) -> Simplices | None:
        """The elements of an elastic body, None for a rigid one."""
        if isinstance(body, RigidBody):
            return None
        elements = elements_of(body)
        if elements is None:
            raise InputError(f"body '{body.name}' has no elements, which a bound needs.")
        mesh, degree, name = elements.basis.mesh, elements.degree, f"body '{body.name}'"
        shape = mesh.refdom.__name__
        linear = ("RefQuad",) if degree == 1 else ()
        if shape not in ("RefTri", "RefTet", *linear) or is_curved(mesh):
            raise InputError(
                f"{name}: a bound needs triangles, tetrahedra, or quadrilaterals with linear"
                " displacements, none of them curved."
            )
        if shape == "RefTet":
            return Tetrahedra(mesh)
        halves = Halves(mesh) if shape == "RefTri" else halved(mesh)
        mesh = halves.mesh
        made = Simplices(mesh)
        edges = mesh.p[:, mesh.facets[1]] - mesh.p[:, mesh.facets[0]]
        longest = np.sum(edges**2, axis=0)[made.opposite].max(axis=0)
        if np.any(longest > THIN * 2 * made.volume):
            raise InputError(
                f"{name}: where elements are {THIN:g} times as long as high, rounding leaves no"
                " bound; make the mesh less steeply graded."
            )
        part: Any = self.reduction.scene.parts[number]
        holding = [own for own in part.supports if "z" in (own.displacement or ("z",))]
        plates = [own for own in part.loads if own.level]
        if self.revolved and plates and len(holding) + len(plates) > 1:
            raise InputError(
                f"{name}: no bound is known if a plate and a second plate or support hold it along"
                " the axis; let the plate alone hold it."
            )
        heavy = any(not own.boundary and own.value[1] for own in part.loads)
        order = 2 if self.revolved and heavy else degree
        return EquilibriumElements(mesh, order, self.revolved, halves.corners)

    def limit_of(self, t: np.ndarray) -> np.ndarray:
        """The friction bound (k,) under tractions."""
        bound = self.problem.law.bound(self.forces(t)[:, 0])
        return np.asarray(self.share * np.broadcast_to(bound, len(t)))

    def forces(self, t: np.ndarray) -> np.ndarray:
        """The forces (k, dim) at the contacts of tractions."""
        share = self.share[:, None]
        return np.divide(t, share, out=np.zeros(t.shape), where=share > 0)

    def nodal(self, displaced: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Displacements (dim, vertices and edges) of every body; (dim, 1) of a rigid one."""
        bodies = zip(self.bodies, self.cells, displaced)
        return [
            own.quadratic(U[body.body.unknowns]) if own else U[: self.problem.dim]
            for body, own, U in bodies
        ]

    def _load(self, number: int, body: Any) -> sp.csr_matrix:
        d = self.problem.dim
        entries: list[Any] = []
        for pair in self.pairs:
            points = pair.rule
            contacts = pair.contacts[:, points.facets[0]]  # (v, S)
            places: list[Any] = [
                (sign, None, None) for place, sign in pair.rigid if place == number
            ]
            places += [
                (side.sign, side, i) for i, side in enumerate(pair.sides) if side.body == number
            ]
            for sign, side, i in places:
                if side is None:
                    N = np.ones((1, *points.weights.shape))
                    rows = np.zeros((d, 1, len(contacts.T)), int) + np.arange(d)[:, None, None]
                else:
                    linear = body.body.degree == 1
                    N = points.at[i] if linear else quadratic_shapes(points.at[i])
                    own = side.vertices if linear else side.nodes
                    rows = body.body.unknowns[:, own[:, points.facets[i]]]
                share = np.einsum("Ss,vSs,qSs->vqS", points.weights, points.at[0], N, optimize=True)
                share = sign * self.factor * share * (contacts >= 0)[:, None]
                value = np.einsum("vqS,ci->vciqS", share, pair.frame)
                columns = np.maximum(contacts, 0)[:, None] * d + np.arange(d)[:, None]  # (v, c, S)
                row = np.broadcast_to(rows[None, None], value.shape)
                column = np.broadcast_to(columns[:, :, None, None], value.shape)
                entries.append([part.ravel() for part in (value, row, column)])
        shape = (len(body.at_rest), self.problem.q.size)
        if not entries:
            return sp.csr_matrix(shape)
        value, row, column = (np.concatenate(parts) for parts in zip(*entries))
        return sp.csr_matrix((value, (row, column)), shape)

    def answer(self, number: int) -> ForceResponse:
        """How a body answers nodal forces."""
        body = self.bodies[number]

        def moved(forces: np.ndarray) -> np.ndarray:
            own = np.zeros(len(body.at_rest))
            own[body.body.unknowns] = self.factor * forces
            U = body.displacement(own, np.zeros(len(body.motions.resultants))) - body.at_rest
            return np.asarray(U[body.body.unknowns])

        return ForceResponse(body.body.degree, moved)

    def balanced(self, t: np.ndarray, resultants: np.ndarray) -> np.ndarray:
        """Tractions (k, dim), scaled to balance the resultants (p,) of free motions."""
        bodies = zip(self.bodies, self.loads)
        work = np.concatenate([load.T @ body.motions.fields for body, load in bodies], axis=1)
        if not work.shape[1]:
            return t
        works = (work.reshape(*t.shape, -1) * t[..., None]).sum(axis=1)  # (k, p)
        weight = np.abs(works).sum(axis=1, keepdims=True)
        scaled = np.divide(works, weight, out=np.zeros(works.shape), where=weight > 0)
        missing = -resultants - works.sum(axis=0)
        change = scaled @ np.linalg.lstsq(works.T @ scaled, missing, rcond=1e-12)[0]
        if np.any(change < -1):
            raise InputError("the contact forces do not balance the bodies; solve more accurately.")
        return t * (1 + change)[:, None]

    def admissible(self, nodal: Sequence[np.ndarray]) -> list[np.ndarray]:
        """The displacements, with hats and bubbles that keep the gap from being negative."""
        d = self.problem.dim
        nodes = facet_nodes(d)
        out = [own.copy() for own in nodal]
        for pair in self.pairs:
            shape = (pair.contacts.shape[1], nodes.shape[1])
            missing = -pair.jump(out, pair.nodes)[0].reshape(shape)
            missing[pair.nodes.weights.reshape(shape) == 0] = 0.0
            closed = (pair.of_contacts(self.pressed) > 0).T @ nodes > 1 - CLOSE
            least = np.maximum(missing[:, :d], 0.0) @ nodes
            pair.lift(out, np.where(closed, missing, np.maximum(missing, least)))
            more = np.zeros(len(missing))
            points = pair.ends if pair.joined else pair.rule
            gap = pair.jump(out, points)[0]
            bubble = quadratic_shapes(points.at[0])[d:].sum(axis=0)
            if pair.joined:  # on pieces both are quadratic, and no less than their control points
                gap, bubble = control_points(gap, d), control_points(bubble, d)
            found = np.divide(-gap, bubble, out=np.zeros(gap.shape), where=bubble > CLOSE)
            np.maximum.at(more, points.facets[0], found.max(axis=1))
            more[~closed.all(axis=1)] *= 1.5  # so that facets beside the pressure stay open
            pair.lift(out, more[:, None] * (np.arange(nodes.shape[1]) >= d))
        return out

    def slip_work(self, nodal: Sequence[np.ndarray]) -> float:
        """The work int (g |slip| + t* slip) over all contact surfaces."""
        total = 0.0
        for pair in self.pairs:
            u = pair.jump(nodal, pair.rule)[1:]
            t = np.stack([pair.at_points(own, pair.rule) for own in self.tractions.T[1:]])
            slip = pair.at_points(self.limit, pair.rule) * np.linalg.norm(u, axis=0)
            total += self.factor * float(np.sum(pair.rule.weights * (slip + np.sum(t * u, axis=0))))
        return total

    def work(
        self,
        traction: np.ndarray,
        nodal: Sequence[np.ndarray],
        component: int = 0,
        change: bool = False,
    ) -> float:
        """The work of tractions (k,) of a component in the gap or the slip, or in its change."""
        total = 0.0
        for pair in self.pairs:
            jump = pair.jump(nodal, pair.rule, change)[component]
            total += float(np.sum(pair.rule.weights * pair.at_points(traction, pair.rule) * jump))
        return self.factor * total

    def boundary(
        self, number: int, tractions: np.ndarray, loaded: bool = True
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Body force, held components and moments, as Tetrahedra.equilibrated() takes them."""
        scene, mesh, d = self.reduction.scene, self.cells[number].mesh, self.problem.dim
        part: Any = scene.parts[number]
        force, components = np.zeros(d), scene.components
        held = np.zeros((mesh.facets.shape[1], d), dtype=bool)
        moments = np.zeros((*held.shape, d))
        areas = measures(mesh.p[:, mesh.facets])
        holding = [(own.boundary, own.displacement) for own in part.supports]
        lever = mesh.p[0, mesh.facets] if self.revolved else np.ones(mesh.facets.shape)
        lever = (lever + lever.sum(axis=0)) / (d + 1)  # with the hat functions
        for load in part.loads:
            if load.level:
                holding.append((load.boundary, None if load.glued else load.force))
            elif not isinstance(load, Uniform):
                raise InputError(f"body '{part.name}': a bound does not know a {load.what}.")
            elif load.boundary and loaded:
                own = np.asarray(mesh.boundaries[load.boundary])
                size = (areas * lever).T[own, :, None] / d
                moments[own] += size * np.asarray(load.value, dtype=float)
            elif loaded:
                force += np.asarray(load.value, dtype=float)
        for support in part.supports:
            if support.boundary not in mesh.boundaries:
                raise InputError(
                    f"body '{part.name}': there is no bound with a support at a point or edge."
                )
        for boundary, names in holding:
            for name in components if names is None else names:
                held[np.asarray(mesh.boundaries[boundary]), components.index(name)] = True
        for pair in self.pairs:
            for i, side in enumerate(pair.sides):
                if side.body == number:
                    slot = np.argsort(np.argsort(side.vertices, axis=0), axis=0)
                    np.add.at(moments, (side.facets, slot), pair.moments(i, tractions))
        return force, held, moments
