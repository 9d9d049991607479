"""A guaranteed bound of the discretisation error in the energy norm, and what makes it up.

Let u be the exact displacement with its stress s(u), and J its potential energy,

    J(v) = a(v, v) / 2 - f(v) + int g |[v_t]|,    a(v, v) = int s(v) : C^-1 : s(v) = |v|^2,

smallest under the condition gap(v) >= 0, where [v] is the displacement of the upper surface minus
that of the lower one, gap(v) the initial gap plus [v_n], and g the friction bound: zero without
friction, given for Tresca's law. Take any displacement v that the supports and the contact allow,
gap(v) >= 0, and any stress s* in equilibrium with the loads, whose traction on the contact surface
is a pressure p* >= 0 and a shear |t*| <= g. Then all terms on both sides of

    |u - v|^2 + |s(u) - s*|^2 + 2 C(u, s(u), v, s*)  =  |s* - s(v)|^2
        + 2 int p* gap(v) + 2 int (g |[v_t]| + t* [v_t])                                   (*)

are at least zero; C holds the works of p* in gap(u), of p in gap(v), and likewise of friction. The
right side is the primal-dual gap, 2 (J(v) + J*(s*)): it needs v and s* alone, and bounds |u - v|^2.
It is also the error in the constitutive relations (Ladeveze). Its terms are reported apart: what s*
and s(v) differ by is the mesh's, the second term that of contact, the third that of friction.

s* comes from contactopt.accuracy.equilibrated. Its pressure is the piecewise linear one that has
the values r_i / A_i at the contacts, for the forces r and nodal areas A of the solution. The finite
elements were loaded otherwise, so each body is solved once more under this pressure, with the
factors that are there, and s* is made from that displacement. In bodies of revolution, and of
quadrilaterals, s* comes from contactopt.accuracy.equilibrium_elements. In the former it is the
pressure times the radius that is linear between the contacts. Plates and free motions stay in
balance: the pressures are scaled by what is missing, which also makes the bound hold for a solver
that stopped early. v is the solution, plus quadratic bubbles on the contact surface where it
penetrates between contacts. The bound of the solution is that of v plus the norm of what was added.

A quantity J, linear in contact forces and plates' motions, has an adjoint: displacements z, and a
stress s_z in equilibrium with a unit of what J measures and with a pressure tau at the contact.
Without friction, with weights omega of the pressure in J, s' = (s* + s(v)) / 2 and d = s* - s(v),

    J(u) = J(v) + int omega p* + int (s_z + s(z)) : C^-1 : d / 2 - int p* z_n + int tau gap(v)
           + int (s_z - s(z)) : C^-1 : (s(u) - s') + int p (omega + z_n) - int tau gap(u),

whose first line is known. On the solution's own contact zone omega + z_n = 0, outside tau = 0; that
the exact zone is another one is met by keeping |tau| <= c p* and |omega + z_n| <= c gap(v). Then
by (*) the second line is at most |s_z - s(z)| x + c (rho^2 - x^2) with some x between 0 and rho,
where rho^2 = |d|^2 / 4 + int p* gap(v). With c <= |s_z - s(z)| / (2 rho) another zone costs
nothing. The energy is such a quantity with a(v, u - v) in its place, up to |u - v|^2 / 2.

Coulomb's law is treated as Tresca's with g = mu p*. What follows is that the error of p* changes g:
the left side of (*) loses 2 int mu (p* - p) (|[u_t]| - |[v_t]|). If this is at most
kappa (|u - v|^2 + |s(u) - s*|^2) with kappa < 1, small friction, the bound grows by
1 / (1 - kappa)^1/2. On a mesh kappa is at most 2 mu / mu', where mu' is the friction coefficient
below which `contactopt diagnose` says that the solution is unique.

The bound is of the problem whose boundary is that of the mesh. It does not cover straight edges in
place of a curve. Integrals over contact facets are taken over SPLIT parts of each; there
penetration is looked for as well. Where a mortar coupling joins facets that do not match, what s*
lacks is bounded by contactopt.accuracy.uneven_traction, and nothing penetrates anywhere.

Sources: Prager, Synge (1947); Ladeveze, Leguillon (1983); Coorevits, Hild, Pelle (2000), A
posteriori error estimation for unilateral contact with matching and non-matching meshes, Comput.
Methods Appl. Mech. Eng. 186; Weiss, Wohlmuth (2009), A posteriori error estimator and error control
for contact problems, Math. Comp. 78.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
from skfem.refdom import RefQuad

from contactopt.accuracy.estimate import Guarantee
from contactopt.accuracy.facing_facets import facet_nodes
from contactopt.accuracy.pressed_scene import PressedScene
from contactopt.accuracy.uneven_traction import uneven_traction
from contactopt.coupling.reduction import Reduction
from contactopt.derivatives.states import Duals, duals_of
from contactopt.errors import InputError
from contactopt.readings.quantities import Quantity
from contactopt.readings.state import State
from contactopt.solving.solve_scene import Solved

UNBALANCED = 1e-6  # of the force of an element: so much a vertex may be out of balance
ALL = 1e-9  # by how much shares that add up to one may miss it
TINY, HUGE = 1e-200, 1e200
MOST = {2: 150_000, 3: 25_000}  # elements of a search with a bound, some 1 GB of memory
DEAR = 4  # times what a triangle in plane strain costs: elements of rings, and quadrilaterals
TRIED = 3  # adjoints of a quantity, each with what the one before tells
ENERGY = "energy"
LINEAR = "approach", "shift", "normal_force", "resultant"
Data = list[Any]  # for every body what determines a composite stress; None for a rigid one


class Bound:
    """A guaranteed bound of a solution; all norms are of energy [(force length)^1/2].

    mesh      |s* - s(v)|;   joint  what a mortar coupling adds to it, element by element
    contact   root of twice the work of p* in the gap;   friction  and of that of friction
    solver    root of what these works are at the contacts alone, which a solver could make zero
    moved     |v - u_h|;   norm  |u_h|
    Raises InputError, one sentence, for a scene or a mesh for which there is no bound.
    """

    def __init__(self, solved: Solved):
        self.scene = scene = PressedScene(solved)
        displaced = scene.reduction.displaced(scene.solution)
        before = scene.nodal(displaced)
        self.displacement = scene.admissible(before)
        self.strained = self._strained(self.displacement)
        self.balanced = self._balanced(scene.tractions, scene.solution.multipliers)
        self.missing = _minus(self.balanced, self.strained)
        uneven = np.concatenate(uneven_traction(scene))
        squares = np.concatenate(self.products(self.missing, self.missing))
        self.joint = float(np.linalg.norm(uneven))
        both = 2 * float(uneven @ np.sqrt(np.maximum(squares, 0.0)))  # in each element norms add
        self.mesh = float(np.sqrt(self.size(self.missing) ** 2 + both + self.joint**2))
        added = [new - old for new, old in zip(self.displacement, before)]
        self.moved = self.size(self._strained(added))
        energies = [body.energy(U) for body, U in zip(scene.bodies, displaced)]
        self.norm = float(np.sqrt(2 * sum(energies)))
        works = scene.works(self.displacement)
        self.contact, self.friction = (float(np.sqrt(2 * max(work, 0.0))) for work in works)
        u, r = scene.reduction.seen(displaced), scene.forces(scene.tractions)
        slips = scene.problem.law.bound(r[:, 0]) * np.linalg.norm(u[:, 1:], axis=1)
        left = r[:, 0] * np.maximum(u[:, 0], 0.0) + slips + np.sum(r[:, 1:] * u[:, 1:], axis=1)
        self.solver = float(np.sqrt(2 * np.maximum(left, 0.0).sum()))

    @property
    def error(self) -> float:
        """The bound of |u - u_h|."""
        return float(np.sqrt(self.mesh**2 + self.contact**2 + self.friction**2) + self.moved)

    @property
    def terms(self) -> dict[str, float]:
        """The bound and its parts over the norm of the solution [-]."""
        names = "error", "mesh", "contact", "friction", "moved", "solver"
        return {name: getattr(self, name) / self.norm for name in names}

    def size(self, data: Data) -> float:
        """The norm of a composite stress."""
        square = sum(own.sum() for own in self.products(data, data))
        if not square >= 0:
            raise InputError(
                "rounding leaves no bound: some elements are too long for their height."
            )
        return float(np.sqrt(square))

    def products(self, one: Data, other: Data) -> list[np.ndarray]:
        """For each body (e,) the products of two stresses in its elements."""
        scene, out = self.scene, []
        for body, cells, a, b in zip(scene.bodies, scene.cells, one, other):
            none = cells is None
            out.append(
                np.zeros(0) if none else scene.factor * cells.products(body.body.material, a, b)
            )
        return out

    def _strained(self, nodal: list[np.ndarray]) -> Data:
        """The stresses of displacements."""
        scene = self.scene
        return [
            cells and cells.data_of(cells.stress(body.body.material, own))
            for body, cells, own in zip(scene.bodies, scene.cells, nodal)
        ]

    def _balanced(
        self, tractions: np.ndarray, multipliers: np.ndarray, forces: tuple[Any, ...] | None = None
    ) -> Data:
        """Stresses in equilibrium with contact tractions and the loads of the scene; of an adjoint
        those with the `forces` on its bodies, if any, in place of the loads: the forces A u_h are
        those of the stress of v.
        """
        scene, out = self.scene, list[Any]()
        own = scene.reduction.own_multipliers(multipliers)
        for i, (body, cells) in enumerate(zip(scene.bodies, scene.cells)):
            if cells is None:
                out.append(None)
                continue
            load = scene.loads[i] @ tractions.ravel()
            U = body.displacement(load + forces[i] if forces else load, own[i])
            if forces is not None:
                U = (
                    U
                    - body.at_rest
                    - (scene.reduction.displaced(scene.solution)[i] if forces else 0.0)
                )
            stress = cells.stress(body.body.material, cells.quadratic(U[body.body.unknowns]))
            given = scene.boundary(i, tractions, forces is None)
            made, unbalanced = cells.equilibrated(body.body.material, stress, *given)
            if unbalanced > UNBALANCED:
                raise InputError(
                    f"body '{body.name}' is {unbalanced:.0e} out of balance, too much for a bound:"
                    " take a direct solver."
                )
            out.append(made + self.strained[i] if forces else made)
        return out

    def of(self, quantity: Quantity) -> tuple[float, float]:
        """The exact value of a quantity lies within an interval: its middle and half its width.

        Parameters
        ----------
        quantity : One of LINEAR or the energy, in a scene without friction.

        Returns
        -------
        Both in the unit of the quantity. InputError, one sentence, for another quantity.
        """
        scene, problem = self.scene, self.scene.problem
        kind = quantity.name.partition(":")[0]
        if missing := without_interval(scene.reduction, quantity):
            raise InputError(missing)
        state = State(scene.reduction, scene.solution)
        seeds = quantity.slopes(state)
        duals = duals_of(state, seeds)
        omega, motions = np.zeros(len(problem.q)), np.zeros(len(problem.s))
        if seeds.multipliers is not None:
            motions += seeds.multipliers
        if seeds.reactions is not None and not seeds.bodies:
            omega += seeds.reactions[:, 0]
        value = seeds.value - float(omega @ scene.solution.reactions[:, 0])
        squares, unknown = self.mesh**2 + self.contact**2 + self.friction**2, 0.0
        if kind == ENERGY:
            unknown, value = squares / 4, self.size(self.strained) ** 2 / 2 + squares / 4
        rho = float(np.sqrt(squares / 2 - self.mesh**2 / 4))
        limit, found = HUGE, []
        for _ in range(TRIED):
            stress, z, tau, c = self._adjoint(omega, duals, motions, limit)
            strained = self._strained(z)
            gap = self.size(_minus(stress, strained))
            both = zip(self.products(stress, self.missing), self.products(strained, self.missing))
            middle = value + sum(one.sum() + other.sum() for one, other in both) / 2
            middle += scene.work(tau, self.displacement)
            middle -= scene.work(scene.tractions[:, 0], z, change=True)
            x = min(rho, gap / (2 * c)) if c > 0 else rho
            found.append((gap * x + c * (rho**2 - x**2) + unknown, float(middle)))
            limit = gap / (2 * rho) if rho > 0 else HUGE
        width, middle = min(found)
        return middle, width

    def _adjoint(
        self, omega: np.ndarray, duals: Duals, motions: np.ndarray, limit: float
    ) -> tuple[Data, list[np.ndarray], np.ndarray, float]:
        """The adjoint's stress, displacements z and pressure tau (k,), with the c of the head of
        this module. Both are cut off where c would be more than `limit`.
        """
        scene, d = self.scene, self.scene.problem.dim
        nodes, p = facet_nodes(d), scene.tractions[:, 0]
        t = scene.share[:, None] * duals.dual.q
        t[:, 0] = np.clip(t[:, 0], -limit * p, limit * p)
        t = scene.balanced(t, motions)
        c = float(np.max(np.abs(t[p > 0, 0]) / p[p > 0], initial=0.0))
        z = [own.copy() for own in scene.nodal(duals.fields)]
        for pair in scene.pairs:
            pressed = (pair.of_contacts(scene.pressed) > 0).T  # (f, v)
            gap = np.maximum(pair.jump(self.displacement, pair.nodes)[0], 0.0)
            value = pair.jump(z, pair.nodes, True)[0] + pair.at_points(omega, pair.nodes)
            most = np.where(pressed @ nodes > 1 - ALL, 0.0, limit * gap)
            wanted = np.clip(value, -most, most)
            for node, ends in enumerate(combinations(range(d), 2), d):
                for end, other in (ends, ends[::-1]):  # next to the pressure in proportion
                    share = gap[:, node] / np.maximum(gap[:, end], TINY)
                    beside = pressed[:, other] & ~pressed[:, end]
                    wanted[beside, node] = (share * wanted[:, end])[beside]
            pair.lift(z, wanted - value)
            away = ~pressed.all(axis=1)
            value = (pair.jump(z, pair.rule, True)[0] + pair.at_points(omega, pair.rule))[away]
            gap = pair.jump(self.displacement, pair.rule)[0][away]
            c = max(c, float(np.max(np.abs(value) / np.maximum(gap, TINY), initial=0.0)))
        return self._balanced(t, duals.dual.s, duals.bodies), z, t[:, 0], c


def without_interval(reduction: Reduction, quantity: Quantity) -> str:
    """Why no interval holds the exact value of a quantity; empty if one may."""
    kind, law = quantity.name.partition(":")[0], reduction.problem.law
    if kind not in (*LINEAR, ENERGY):
        return f"there is no bound of the {kind}, only of {', '.join(LINEAR)}, energy."
    if np.any(law.rough):
        small = "; it assumes small friction, which contactopt diagnose tests"
        small = small if law.proportional else ""
        return f"with friction there is no bound of the {kind}, only of the energy norm{small}."
    if any(own.kind == "mortar" for own in reduction.couplings):
        return f"with mortar there is no bound of the {kind}, only of the energy norm."
    return ""


def bounded(solved: Solved, quantity: Quantity, value: float) -> Guarantee:
    """What is guaranteed of a quantity with this value, and of the displacement."""
    scene = solved.reduction.scene
    bodies = [getattr(body, "body", None) for body in solved.reduction.bodies]
    meshes = [own.basis.mesh for own in bodies if own is not None]
    elements, most = sum(mesh.nelements for mesh in meshes), MOST[scene.dim]
    if scene.kind == "axisymmetric" or any(mesh.refdom is RefQuad for mesh in meshes):
        if missing := without_interval(solved.reduction, quantity):
            return Guarantee(missing=missing)  # the energy norm alone is not worth its time
        most //= DEAR
    if elements > most:
        return Guarantee(missing=f"a search takes no bound of more than {most:,} elements.")
    try:
        bound = Bound(solved)
    except InputError as error:
        return Guarantee(missing=str(error))
    terms = bound.terms if bound.norm > 0 else {}
    try:
        middle, width = bound.of(quantity)
    except InputError as error:
        return Guarantee(energy=terms, missing=str(error))
    return Guarantee((abs(middle - value) + width) / (abs(value) or 1.0), terms)


def _minus(one: Data, other: Data) -> Data:
    return [None if a is None else a - b for a, b in zip(one, other)]
