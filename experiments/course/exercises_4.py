"""The exercises of chapter 4: from bodies to the interface."""

from functools import cache

import numpy as np
import scipy.linalg as la
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementVector,
    FacetBasis,
    MeshTri,
)
from skfem.helpers import div
from skfem.models.elasticity import lame_parameters, linear_elasticity

from contactopt import InterfaceProblem, laws, solve
from experiments.course.feedback import Forces, Open
from experiments.course.grader import Exercise

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
    return InterfaceProblem(Q, q, law, coordinates=[x])


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
    if -10 * (up + 2.45 * turn) <= 1e-6 * size:
        return f"The load does the work {-10 * (up + 2.45 * turn):.3g}, which is not positive."
    return None


EXERCISES = (
    Exercise(
        "4.1",
        1,
        "unknowns of the primal problem, of the dual problem",
        lambda: (2 * 41 * 20, 2 * 41),
        (
            ((2 * 41 * 21, 82), "The top row is held: its displacements are no unknowns."),
            ((1640, 41), "With friction each node of the bottom has two components of force."),
            ((820, 41), "Every node has two components."),
            ((82, 1640), "order"),
        ),
        (
            "Count the rows of nodes that are free to move.",
            "20 rows of 41 nodes are free, and each node has two displacements.",
            "Forces act at the bottom row alone, with two components at each node.",
        ),
        """
# All 41 * 21 nodes but those of the top row; and the 41 nodes of the bottom.
nodes = MeshTri.init_tensor(np.linspace(-2, 2, 41), np.linspace(0, 2, 21)).p
answer = (2 * int(np.sum(nodes[1] < 2)), 2 * int(np.sum(nodes[1] == 0)))
""",
    ),
    Exercise(
        "4.2",
        1,
        "distance from the middle [mm]",
        lambda: 4.6 / 2,
        (
            (4.6, "This is the width. The ends are half of it away from the middle."),
            (4.6 / 6, "This is the middle third, where a *linear* pressure stays positive."),
            (4.6 / 4, "The forces may gather at the very edge."),
        ),
        (
            "The floor can only push. Where can the resultant of its forces lie?",
            "It lies between the ends of the block.",
            "In balance it stands on the line of the load.",
        ),
        """
# A linear program: forces of the floor at 201 places, whose resultant stands as far out as possible.
places_4 = np.linspace(-2.3, 2.3, 201)
force = cp.Variable(201, nonneg=True)
answer = cp.Problem(cp.Maximize(places_4 @ force), [cp.sum(force) == 1]).solve(solver=cp.CLARABEL)
""",
    ),
    Exercise(
        "4.3",
        2,
        "33 rows r_n, r_t [N]",
        lambda: Forces(rough()),
        (
            (lambda: forces_of(0.0), "frictionless"),
            (lambda: forces_of(laws.Associated(0.1)), "associated"),
            (lambda: forces_of(0.1) * [1, -1], "along"),
            (lambda: forces_of(0.1)[:, ::-1], "order"),
            (lambda: forces_of(0.2), "bound"),
        ),
        (
            "Make the bound a cp.Parameter in the program with a given bound.",
            "Solve, set the bound to 0.1 max(r_n, 0), and solve again.",
            "Ten steps suffice. Then r.value.reshape(-1, 2) holds the forces.",
        ),
        """
limit = cp.Parameter(len(x), nonneg=True, value=np.zeros(len(x)))
y = cp.Variable(2 * len(x))
cost = cp.quad_form(y, cp.psd_wrap(Q)) / 2 + q.ravel() @ y
program = cp.Problem(cp.Minimize(cost), [y[::2] >= 0, cp.abs(y[1::2]) <= limit])
for _ in range(12):
    program.solve(solver=cp.CLARABEL)
    limit.value = 0.1 * np.maximum(y.value[::2], 0)
answer = y.value.reshape(-1, 2)
""",
    ),
    Exercise(
        "4.4",
        3,
        "gamma_0 [-]",
        lambda: float(stiffest()[-1]),
        (
            (lambda: stiffest()[-1] * E * 8, "This is gamma = gamma_0 E / h. Give gamma_0."),
            (lambda: 1 / stiffest()[-1], "This is the inverse: a *large* gamma_0 is safe."),
            (lambda: stiffest()[-1] / 10, "The matrix `fixed` was assembled with gamma_0 = 10."),
        ),
        (
            "K - C / gamma_0 must be positive definite on the free unknowns. What is C?",
            "C = -10 * fixed[free][:, free], because `fixed` was assembled with gamma_0 = 10.",
            "The limit is the largest eigenvalue of C x = gamma_0 K x (scipy.linalg.eigh).",
        ),
        """
# C acts on few unknowns, those of the elements at the bottom. So a small problem is enough.
C = -10 * fixed[free][:, free].toarray()
some = np.flatnonzero(np.abs(C).sum(axis=0))
part = np.linalg.solve(K_free, np.eye(len(free))[:, some])[some]
answer = np.linalg.eigvals(part @ C[np.ix_(some, some)]).real.max()
""",
    ),
    Exercise(
        "4.5",
        1,
        "stiffness of the contact [N/mm]",
        lambda: 1.7 - 1.7**2 / (3 + 1.7),
        (
            (4.7, "The springs stand in a row: the same force goes through both."),
            (1 / 3 + 1 / 1.7, "This is the compliance Q. The Schur complement is its inverse."),
            (1.7, "The inner node moves, too."),
        ),
        (
            "Write K for the inner and the outer node, and eliminate the inner one.",
            "K = [[3 + 1.7, -1.7], [-1.7, 1.7]] with the inner node first.",
            "S = K_oo - K_oi K_ii^-1 K_io.",
        ),
        """
# The compliances of springs in a row add.
answer = 1 / (1 / 3 + 1 / 1.7)
""",
    ),
    Exercise(
        "4.6",
        1,
        "factor of Q [-]",
        lambda: 1 / (1.7 * 2.5),
        (
            (1 / 1.7, "In three dimensions a larger body is stiffer, too."),
            (1.7 * 2.5, "This is the factor of the stiffness."),
            (2.5 / 1.7, "The compliance falls with the length, and does not grow."),
            (1 / (1.7 * 2.5**2), "Q is a length over a force; stress is a force over an area."),
        ),
        (
            "What is the unit of Q? Which combination of E and a length has this unit?",
            "Q is in mm/N, and E in N/mm^2. So Q is proportional to 1 / (E L).",
            "E grows by 1.7 and L by 2.5.",
        ),
        """
# A point load on a half-space moves the surface by (1 - nu^2) F / (pi E r) at the distance r.
def moved(E, r):
    return (1 - 0.3**2) / (np.pi * E * r)
answer = moved(1.7 * 5.0, 2.5 * 3.0) / moved(5.0, 3.0)
""",
    ),
    Exercise(
        "4.7",
        2,
        "forces of the left and of the right point [N]",
        lambda: Forces(beam()),
        (
            ((3.5, 3.5), "balance"),
            ((3.394, 3.606), "balance"),
            ((7 * 0.4 / 2.1, 0.0), "balance"),
            ((-3.606, -3.394), "sign"),
        ),
        (
            "Two motions: upwards, and the rotation about x = 0. V has two columns.",
            "A rotation lifts the place x by x. The load has the moment -7 * 0.4 N mm.",
            "r_1 + r_2 = 7 and -1.2 r_1 + 2.1 r_2 = 2.8.",
        ),
        """
# V' r + s = 0 determines both forces, so that no elasticity is needed.
V_n = np.array([[1.0, -1.2], [1.0, 2.1]])
answer = np.linalg.solve(V_n.T, [7.0, 7.0 * 0.4])
""",
    ),
    Exercise(
        "4.8",
        3,
        "motion upwards [mm], rotation [-]",
        lambda: Open((2.3, -1.0), proves),
        (
            ((1.0, 0.0), "The load does the work"),
            ((-1.0, 0.0), "pushes a corner"),
            ((2.3, 1.0), "The load does the work"),
            ((0.0, -1.0), "pushes a corner"),
        ),
        (
            "Think of the block as it tips over. Which corner stays on the floor?",
            "The right corner stays: up + 2.3 turn = 0. The rotation is clockwise, negative.",
            "Choose turn = -1, and test: no corner goes down, and the load at 2.45 mm does.",
        ),
        """
# The right corner stays, the left one rises, and the load does 10 (2.45 - 2.3) N mm of work. If forces
# balanced the load, their work would be minus that. But a floor that pushes does no negative work.
answer = (2.3, -1.0)
""",
    ),
)
