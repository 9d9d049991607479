"""Preconditioners of the interface operator Q = S1^-1 + S2^-1: approximate inverses of Q, O(k log
k) per product.

Paper, section 5.2: the H^1/2 seminorm of a function on the contact line, extended by zero (E) to a
closed curve of 2m nodes, is a circulant matrix Q_c (27), the H^1 norm another, L_c (28); with m the
smallest power of two >= k,
    P21 = E' Q_c E   (25),      P22 = (E' L_c^-1 Q_c E)^-1   (26),
up to a factor that no iteration sees. P21 resembles S1 + S2; the matrix that P22 inverts resembles
Q itself. In 3D the sum of P21 along both directions of the contact surface is P31 (29).

P maps a relative displacement, the residual b - Q r of an iteration, to a force. P21 extends that
displacement by zero, which is right only for displacements that vanish at the ends (H00^1/2). They
do not vanish at a free edge. The matrix that P22 inverts, like Q, acts on forces. There are none
outside the contact, so that extending them by zero is right. The third preconditioner, `neumann`,
the square root of the Laplacian of the contact line or surface, needs no extension, for its cosine
transforms leave the ends free. A contact line that is closed by itself needs none for P21 and P22
either: the circulant matrices act on its own nodes. Contacts are found on their line or grid in the
problem's chart, so that it does not matter how the bodies are turned. Each preconditioner acts on
every component by itself. What is left are a few smooth motions of the two bodies against each
other, first of all the sway of a slender body: `deflated` solves for them exactly (balancing,
Mandel 1993).

Restriction to an active set A: the paper takes the rows and columns A of P. Where P = G^-1 with a
cheap product G, which `neumann` has, deflated or not, G_AA is the better model: c1 G <= Q <= c2 G
holds on every subspace with the same constants, so that (G_AA)^-1, by an inner PCG that needs no
body, has the condition number of P on any active set (`restricted`).
"""

from collections.abc import Sequence
from importlib import import_module

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.polynomial.chebyshev import chebvander
from scipy.sparse.linalg import LinearOperator, cg

from contactopt.errors import InputError
from contactopt.linear.operators import Interface, diagonal, held
from contactopt.methods.preconditioners.constants import MOST_WAVES, WAVES
from contactopt.methods.preconditioners.grid import GridMap
from contactopt.problem import InterfaceProblem, part_of

ACTIVE = 1e-10  # relative accuracy of the inner solve of a preconditioner on an active set
# share of a smooth motion's energy, apart from that of others, below which it is one of them
DEPENDENT = 1e-10


class Preconditioner(LinearOperator):
    """P (n, n), an approximate inverse of Q.

    model   G = P^-1 by cheap products, None where there is no such thing
    blocks  the unknowns of each pair of surfaces; P couples none of them with each other, and each
            has a scale of its own
    factors (n,) by what deflation multiplied P: how much stiffer the contacts are than the diagonal
            of Q says, once smooth motions are taken out of it
    """

    def __init__(
        self,
        n: int,
        product: GridMap,
        model: GridMap | None = None,
        blocks: Sequence[slice] = (),
        factors: np.ndarray | None = None,
    ):
        super().__init__(np.dtype(float), (n, n))
        self.factors = np.ones(n) if factors is None else factors
        self.product, self.blocks = product, tuple(blocks) or (slice(0, n),)
        self.model = model and LinearOperator((n, n), matvec=model, rmatvec=model, dtype=float)

    def _matvec(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self.product(x.ravel()))

    _rmatvec = _matvec


# name -> (module, function, what it is). The function of a problem and of a mask (k, dim) of what
# cannot move gives products (k, dim) -> (k, dim) with P and, where it is cheap, with P^-1, else
# None, for a Q of mean diagonal one.
PRECONDITIONERS = {
    "p21": (
        "contactopt.methods.preconditioners.circulant",
        "p21",
        "circulant H^1/2 seminorm, extended by zero (paper, eqs (25) and, in 3D, (29))",
    ),
    "p22": (
        "contactopt.methods.preconditioners.circulant",
        "p22",
        "inverse of the circulant H^-1/2 form, extended by zero (paper, eq (26)), 2D",
    ),
    "neumann": (
        "contactopt.methods.preconditioners.neumann",
        "neumann",
        "square root of the Neumann Laplacian, by the cosine transform",
    ),
    "laplacian": (
        "contactopt.methods.preconditioners.surface",
        "laplacian",
        "square root of the Neumann Laplacian on any contact mesh, by sparse factors",
    ),
}


def find_preconditioner(name: str | None) -> None:
    """Raise InputError unless it is the name of a preconditioner, None or 'none'."""
    if name not in (None, "none", *PRECONDITIONERS):
        raise InputError(
            f"unknown preconditioner {name!r}; choose from {', '.join(PRECONDITIONERS)}."
        )


def preconditioner(problem: InterfaceProblem, name: str) -> Preconditioner:
    """The named approximate inverse of Q, in a block for each pair; InputError if none fits."""
    find_preconditioner(name)
    if len(problem.pairs) > 1:
        return _blocks(
            problem, [preconditioner(part_of(problem, pair), name) for pair in problem.pairs]
        )
    is_held = held(problem.Q)
    mean = float(np.mean(diagonal(problem.Q)[~is_held])) if not is_held.all() else 1.0
    module, function, _ = PRECONDITIONERS[name]
    product, inverse = getattr(import_module(module), function)(
        problem, is_held.reshape(problem.q.shape)
    )

    def beside(act: GridMap, factor: float) -> GridMap:
        def apply(x: np.ndarray) -> np.ndarray:
            made = act(np.where(is_held, 0.0, x).reshape(problem.q.shape))
            return np.where(is_held, x, factor * made.ravel())  # what cannot move is on its own

        return apply

    model = None if inverse is None else beside(inverse, mean)
    return Preconditioner(problem.q.size, beside(product, 1 / mean), model)


def _blocks(problem: InterfaceProblem, parts: list[Preconditioner]) -> Preconditioner:
    """One preconditioner from those of the pairs of surfaces."""
    rows = [slice(pair.start * problem.dim, pair.stop * problem.dim) for pair in problem.pairs]
    models = [part.model for part in parts if part.model is not None]

    def beside(operators: Sequence[LinearOperator]) -> GridMap:
        return lambda x: np.concatenate([act @ x[own] for act, own in zip(operators, rows)])

    model = beside(models) if len(models) == len(parts) else None
    return Preconditioner(problem.q.size, beside(parts), model, rows)


def smooth_motions(problem: InterfaceProblem) -> np.ndarray:
    """Forces (k dim, j) that are polynomials of the place on every pair of surfaces, of a degree
    that grows with its length over the distance to the next pair: longer waves reach that pair.
    """
    parts = [
        _smooth_motions(part_of(problem, pair), degree)
        for pair, degree in zip(problem.pairs, degrees(problem))
    ]
    return np.asarray(la.block_diag(*parts))


def degrees(problem: InterfaceProblem) -> list[int]:
    """The degree of each pair's smooth motions; distances are medians, since pairs may meet."""
    from scipy.spatial import KDTree  # late, since it takes long to import

    points = [problem.coordinates[:, pair.contacts].T for pair in problem.pairs]
    trees = [KDTree(own) for own in points]
    found = []
    for own, tree in zip(points, trees):
        distances = [float(np.median(t.query(own)[0])) for t in trees if t is not tree]
        apart, length = min(distances, default=np.inf), np.linalg.norm(np.ptp(own, axis=0))
        degree = length / (WAVES * apart) if apart > 0 else MOST_WAVES
        found.append(int(np.clip(degree, 1, MOST_WAVES)))
    return found


def _smooth_motions(problem: InterfaceProblem, degree: int) -> np.ndarray:
    """(k dim, j): Chebyshev polynomials, or cosines and sines on a closed line, by component."""
    chart = problem.chart
    if chart.period is not None:
        angle = 2 * np.pi * np.outer(np.arange(degree + 1), chart.places[0]) / chart.period
        functions = [*np.cos(angle), *np.sin(angle[1:])]
    else:
        low, length = chart.places.min(axis=1), np.ptp(chart.places, axis=1)
        place = (chart.places - low[:, None]) / np.where(length > 0, length, 1.0)[:, None]
        waves = [chebvander(2 * x - 1, degree).T for x in place]
        powers: list[tuple[int, ...]] = [(i,) for i in range(degree + 1)]
        if len(waves) == 2:
            powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        functions = [
            np.prod([wave[i] for wave, i in zip(waves, power)], axis=0) for power in powers
        ]
    Z = np.concatenate([np.kron(f[:, None], np.eye(problem.dim)) for f in functions], axis=1)
    Z[held(problem.Q)] = 0.0
    _, R = np.linalg.qr(Z / np.maximum(np.linalg.norm(Z, axis=0), 1e-300))
    return Z[:, np.flatnonzero(np.abs(np.diag(R)) > 1e-3)]


def deflated(P: Preconditioner, Q: Interface, Z: np.ndarray) -> Preconditioner:
    """Make a preconditioner exact on some columns: (I - Z Z'Q) c P (I - Q Z Z') + Z Z', with Z'QZ =
    I.

    The columns are made orthonormal in the energy first. The factors c, one for each block of P,
    put the mean eigenvalue of P Q on what is not exact about 1, where those of the exact part are.
    It needs j products with Q once, and another one for each block; each application adds O(n j).
    Its inverse is the block secant update of P^-1 = G, G/c - G/c Z (Z'G/c Z)^-1 Z'G/c + QZ (QZ)'.

    Sources: Mandel (1993), Balancing domain decomposition; Schnabel (1983), Quasi-Newton methods
    using multiple secant equations.
    """
    Z, QZ = _orthonormal(Z, np.asarray(Q @ Z))
    c = _scales(P, Q, QZ) if len(P.blocks) > 1 else _scale(P, Q, Z, QZ)

    def apply(x: np.ndarray) -> np.ndarray:
        coarse = Z.T @ x
        y = c * (P @ (x - QZ @ coarse))
        return np.asarray(y + Z @ (coarse - QZ.T @ y))

    model = P.model
    if model is None:
        return Preconditioner(len(Z), apply, None, P.blocks, c)
    GZ = np.stack([model @ z for z in Z.T], axis=1) / c[:, None]
    B = np.linalg.inv(Z.T @ GZ)

    def inverse(x: np.ndarray) -> np.ndarray:
        return np.asarray(model @ x / c - GZ @ (B @ (GZ.T @ x)) + QZ @ (QZ.T @ x))

    return Preconditioner(len(Z), apply, inverse, P.blocks, c)


def _orthonormal(Z: np.ndarray, QZ: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Z (n, j) on the same columns with Z'QZ = I, and QZ, without columns that move nothing."""
    energy = np.einsum("ij,ij->j", Z, QZ)
    each = energy / np.maximum(np.einsum("ij,ij->j", Z, Z), 1e-300)
    acts = each > DEPENDENT * each.max(initial=0.0)
    Z, QZ, size = Z[:, acts], QZ[:, acts], np.sqrt(energy[acts])
    values, vectors = np.linalg.eigh((Z.T @ QZ / size).T / size)
    kept = values > DEPENDENT
    change = vectors[:, kept] / np.sqrt(values[kept]) / size[:, None]
    return Z @ change, QZ @ change


def _scale(P: Preconditioner, Q: Interface, Z: np.ndarray, QZ: np.ndarray) -> np.ndarray:
    """The factor (n,) of a P of one block: x'Qx over (Qx)'P(Qx) of a random force x."""
    x = np.random.default_rng(0).normal(size=len(Z))
    x -= Z @ (QZ.T @ x)
    Qx = np.asarray(Q @ x)
    return np.full(len(Z), float(x @ Qx) / float(Qx @ (P @ Qx)))


def _scales(P: Preconditioner, Q: Interface, QZ: np.ndarray) -> np.ndarray:
    """The factor (n,) of every block of P: a random force x = P y of a block does the work y'P y by
    the model, and by Q the work x'Q x less what the exact part does of it, |QZ'x|^2.
    """
    random = np.where(held(Q), 0.0, np.random.default_rng(0).normal(size=len(QZ)))
    made = P @ random
    X = np.zeros((len(QZ), len(P.blocks)))
    for i, own in enumerate(P.blocks):
        X[own, i] = made[own]
    X[held(Q)] = 0.0
    whole = np.einsum("ij,ij->j", X, np.asarray(Q @ X))
    rest = whole - np.sum((QZ.T @ X) ** 2, axis=0)
    c = np.ones(len(QZ))
    for i, own in enumerate(P.blocks):
        work = rest[i] if rest[i] > 1e-6 * whole[i] else whole[i]  # enough to scale by
        c[own] = float(random[own] @ made[own]) / work if work > 0 else 1.0
    return c


def restricted(P: Preconditioner, U: sp.csr_matrix, added: np.ndarray) -> LinearOperator:
    """An approximate inverse (m, m) of U'QU + diag(added), for orthonormal columns U (n, m) of the
    directions that are free: by an inner PCG with a model G of Q, else U'PU (paper, section 5.2).
    """
    m = U.shape[1]
    rows = LinearOperator((m, m), matvec=lambda x: U.T @ (P @ (U @ x.ravel())), dtype=float)
    if P.model is None:
        return rows
    model = P.model
    system = LinearOperator(
        (m, m), matvec=lambda x: U.T @ (model @ (U @ x.ravel())) + added * x.ravel(), dtype=float
    )
    return LinearOperator(
        (m, m), matvec=lambda x: cg(system, x.ravel(), rtol=ACTIVE, M=rows)[0], dtype=float
    )
