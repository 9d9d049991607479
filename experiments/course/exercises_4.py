"""The exercises of chapter 4: from bodies to the interface."""

from functools import cache

import numpy as np
import scipy.linalg as la
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, FacetBasis, MeshTri
from skfem.helpers import div
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import InterfaceProblem, laws, solve
from experiments.course.feedback import Forces, Open
from experiments.course.quantities import Numbers

E, nu = 5.0, 0.3  # MPa, -: the block of the chapter


@cache
def block() -> tuple[np.ndarray, ...]:
    """Stiffness K and integral C of p(U) p(v) h / E of the free unknowns, Q, q, and places x."""
    mesh = MeshTri.init_tensor(np.linspace(-2, 2, 33), np.linspace(0, 2, 17)).with_boundaries(
        {"bottom": lambda x: x[1] == 0, "top": lambda x: x[1] == 2}
    )
    basis = Basis(mesh, ElementVector(ElementTriP1()))
    lam, shear = lame_parameters(E, nu)
    top, bottom = basis.get_dofs("top"), basis.get_dofs("bottom")
    K, down = linear_elasticity(lam, shear).assemble(basis), np.zeros(basis.N)
    down[top.all(["u^2"])] = -0.1
    free = np.setdiff1d(np.arange(basis.N), top.all())
    contact = np.column_stack([bottom.all(["u^2"]), bottom.all(["u^1"])])
    places = np.searchsorted(free, contact.ravel())

    @BilinearForm
    def pressures(U, v, w):
        at = [lam * div(a) + 2 * shear * a.grad[1, 1] for a in (U, v)]
        return at[0] * at[1] * (4 / 32) / E

    edge = FacetBasis(mesh, basis.elem, facets="bottom")
    C = pressures.assemble(edge)[free][:, free].toarray()
    stiff = K[free][:, free].toarray()
    moved = np.linalg.solve(
        stiff, np.column_stack([np.eye(len(free))[:, places], -(K @ down)[free]])
    )
    q = moved[places, -1].reshape(-1, 2)
    x = mesh.p[0, bottom.nodal_ix]
    q[:, 0] += x**2 / 20
    return stiff, C, moved[places, :-1], q, x


def rough(law: laws.Law | float = 0.1) -> InterfaceProblem:
    _, _, Q, q, x = block()
    areas = np.where(np.isclose(abs(x), 2), 0.5, 1.0) * 4 / 32
    return InterfaceProblem(Q, q, law, areas=areas, coordinates=[x])


def forces_of(law: laws.Law | float) -> np.ndarray:
    return solve(rough(law)).reactions


@cache
def stiffest() -> np.ndarray:
    """The eigenvalues of C x = gamma_0 K x [-]."""
    return la.eigh(block()[1], block()[0], eigvals_only=True)


def beam() -> InterfaceProblem:
    """A rigid beam on two points at -1.2 and 2.1 mm, and 7 N downwards at 0.4 mm."""
    V = np.array([[1.0, -1.2], [0.0, 0.0], [1.0, 2.1], [0.0, 0.0]])
    motions = ("the motion upwards", "the rotation")
    return InterfaceProblem(
        np.zeros((4, 4)), np.zeros((2, 2)), 0.0, V, [-7.0, -2.8], motions=motions
    )


def proves(motion: np.ndarray) -> str | None:
    """Whether a motion proves that the block tips over."""
    up, turn = motion
    left, right = up - 2.3 * turn, up + 2.3 * turn
    size = max(abs(left), abs(right))
    if min(left, right) < -1e-6 * size:
        return (
            f"This motion pushes a corner into the floor: corners move by {left:.3g}, {right:.3g}."
        )
    work = -10 * (up + 2.45 * turn) + 0.0  # no -0
    if work <= 1e-6 * size:
        return f"The load does the work {work:.3g}, which is not positive."
    return None


GRADED = {
    "4.3": (
        lambda: Forces(rough()),
        (lambda: forces_of(0.0), "frictionless"),
        (lambda: forces_of(laws.Associated(0.1)), "associated"),
        (lambda: forces_of(0.1) * [1, -1], "along"),
        (lambda: forces_of(0.2), "coefficient"),
        (lambda: forces_of(0.1) / rough().areas[:, None], "pressure"),
    ),
    "4.4": (
        lambda: Numbers(
            float(stiffest()[-1]),
            given={"gamma_0 of the text": 10.0, "E": E, "h": 0.125},
            least=(0.0, "gamma_0 is positive: only a positive gamma pushes."),
        ),
        (lambda: stiffest()[-1] * E * 8, "This is gamma = gamma_0 E / h. Give gamma_0."),
        (lambda: 1 / stiffest()[-1], "This is the inverse: a *large* gamma_0 is safe."),
        (lambda: stiffest()[-1] / 10, "The matrix `fixed` was assembled with gamma_0 = 10."),
    ),
    "4.7": (lambda: Forces(beam()),),
    "4.8": (lambda: Open((2.3, -1.0), proves),),
}
