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

s* comes from contactopt.bounds.tetrahedra. Its pressure is the piecewise linear one that has
the values r_i / A_i at the contacts, for the forces r and nodal areas A of the solution. The finite
elements were loaded otherwise, so each body is solved once more under this pressure, with the
factors that are there, and s* is made from that displacement. In bodies of revolution, and of
quadrilaterals, s* comes from contactopt.bounds.equilibrium_elements. In the former it is the
pressure times the radius that is linear between the contacts. Plates and free motions stay in
balance: the pressures are scaled by what is missing, which also makes the bound hold for a solver
that stopped early.

The solution u_h may penetrate between contacts. Let v = u_h + w be allowed, where w is made of
quadratic bubbles on the contact surface. With u_h in place of v the left side of (*) has the term
2 int p gap(u_h), which may be negative. But gap(v) >= 0, and by the equilibrium of both stresses

    int p gap(u_h)  >=  -int p w_n  =  -int p* w_n - int (s(u) - s*) : C^-1 : s(w),

whose last term is at most |s(u) - s*| |w|. Since 2 |s(u) - s*| |w| - |s(u) - s*|^2 <= |w|^2,

    |u - u_h|^2  <=  |s* - s(u_h)|^2 + |w|^2 + 2 int p* gap(v) + the term of friction of u_h,

to which that of w is added, which moves along a surface only where two surfaces meet in an edge.

contactopt.bounds.interval makes intervals of quantities from the same terms.

Coulomb's law is treated as Tresca's with g = mu p*. What follows is that the error of p* changes g:
the left side of (*) loses 2 int mu (p* - p) (|[u_t]| - |[v_t]|). If this is at most
kappa (|u - v|^2 + |s(u) - s*|^2) with kappa < 1, small friction, the bound grows by
1 / (1 - kappa)^1/2, and its part |w| by 1 / (1 - kappa). On a mesh kappa is at most 2 mu / mu',
where mu' is the friction coefficient below which `contactopt diagnose` says that the solution is
unique.

The bound is of the problem whose boundary is that of the mesh. It does not cover straight edges in
place of a curve. Integrals over contact facets are taken over SPLIT parts of each; there
penetration is looked for as well. Where a mortar coupling joins facets that do not match, what s*
lacks is bounded by contactopt.bounds.uneven_traction, and nothing penetrates anywhere.

Sources: Prager, Synge (1947); Ladeveze, Leguillon (1983); Coorevits, Hild, Pelle (2000), A
posteriori error estimation for unilateral contact with matching and non-matching meshes, Comput.
Methods Appl. Mech. Eng. 186; Weiss, Wohlmuth (2009), A posteriori error estimator and error control
for contact problems, Math. Comp. 78.
"""

from typing import Any

import numpy as np

from contactopt.bodies.views import energy
from contactopt.bounds.pressed_scene import PressedScene
from contactopt.bounds.uneven_traction import UNBALANCED, uneven_traction
from contactopt.errors import InputError
from contactopt.solving.solve_scene import Solved

Data = list[Any]  # for every body what determines a composite stress; None for a rigid one


class Bound:
    """A guaranteed bound of a solution; all norms are of energy [(force length)^1/2].

    mesh      |s* - s(u_h)|;   joint  what a mortar coupling adds to it, element by element
    contact   root of twice the work of p* in the gap;   friction  and of that of friction
    solver    root of what these works are at the contacts alone, which a solver could make zero
    moved     |w|, of what keeps the surfaces apart;   norm  |u_h|
    Raises InputError, one sentence, for a scene or a mesh for which there is no bound.
    """

    def __init__(self, solved: Solved):
        self.scene = scene = PressedScene(solved)
        displaced = scene.reduction.displaced(scene.solution)
        before = scene.nodal(displaced)
        self.displacement = scene.admissible(before)
        self.strained = self.strains(self.displacement)
        self.balanced = self.balanced_with(scene.tractions, scene.solution.multipliers)
        self.missing = _sum(self.balanced, self.strained, -1)
        added = [new - old for new, old in zip(self.displacement, before)]
        stretched = self.strains(added)
        self.moved = self.size(stretched)
        left = _sum(self.missing, stretched)  # s* - s(u_h), of the displacement solved for
        uneven = np.concatenate(uneven_traction(scene))
        squares = np.concatenate(self.products(left, left))
        self.joint = float(np.linalg.norm(uneven))
        both = 2 * float(uneven @ np.sqrt(np.maximum(squares, 0.0)))  # in each element norms add
        self.mesh = float(np.sqrt(self.size(left) ** 2 + both + self.joint**2))
        energies = [energy(body, U, 0 * U) for body, U in zip(scene.bodies, displaced)]
        self.norm = float(np.sqrt(2 * sum(energies)))
        gaps = scene.work(scene.tractions[:, 0], self.displacement)
        slips = scene.slip_work(before) + scene.slip_work(added)
        self.contact, self.friction = (float(np.sqrt(2 * max(w, 0.0))) for w in (gaps, slips))
        u, r = scene.reduction.seen(displaced), scene.forces(scene.tractions)
        left = scene.problem.law.bound(r[:, 0]) * np.linalg.norm(u[:, 1:], axis=1)
        left = left + r[:, 0] * np.maximum(u[:, 0], 0.0) + np.sum(r[:, 1:] * u[:, 1:], axis=1)
        self.solver = float(np.sqrt(2 * np.maximum(left, 0.0).sum()))

    @property
    def error(self) -> float:
        """The bound of |u - u_h|."""
        parts = self.mesh, self.contact, self.friction, self.moved
        return float(np.linalg.norm(parts))

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

    def strains(self, nodal: list[np.ndarray]) -> Data:
        """The stresses of displacements."""
        scene = self.scene
        return [
            cells and cells.data_of(cells.stress(body.body.material, own))
            for body, cells, own in zip(scene.bodies, scene.cells, nodal)
        ]

    def balanced_with(
        self, tractions: np.ndarray, multipliers: np.ndarray, forces: tuple[Any, ...] | None = None
    ) -> Data:
        """Stresses in equilibrium with contact tractions and loads, or an adjoint's `forces`."""
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
            answer = scene.answer(i) if scene.problem.dim == 3 else None
            made, unbalanced = cells.equilibrated(body.body.material, stress, *given, answer)
            if unbalanced > UNBALANCED:
                raise InputError(
                    f"body '{body.name}' is {unbalanced:.0e} out of balance, too much for a bound:"
                    " take a direct solver."
                )
            out.append(made + self.strained[i] if forces else made)
        return out


def _sum(one: Data, other: Data, sign: int = 1) -> Data:
    return [None if a is None else a + sign * b for a, b in zip(one, other)]
