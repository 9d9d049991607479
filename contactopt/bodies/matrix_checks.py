"""Whether a stiffness that another code has assembled is that of a body, and how it is numbered:
found by its rigid motions, which need no force, and by its extreme eigenvalues.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from contactopt.bodies.assembly import Matrices
from contactopt.bodies.elastic import ElasticBody
from contactopt.bodies.motions import Motions, kernel, motion_labels, rigid_fields
from contactopt.bodies.solvers.system import Act
from contactopt.cards import count
from contactopt.checks import real_array
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.scenes.kinds import Kind
from contactopt.scenes.matrix_part import MatrixPart

PIVOT = 1e-13  # of the largest eigenvalue: one below it belongs to a motion without stiffness
STEPS = 12  # of Lanczos's method
FEW = 2  # of its steps find a motion without stiffness, which the first one makes large
SAME = 1e-8  # x' K^-1 y and y' K^-1 x of a function that solves may differ by this fraction


class Numbering(NamedTuple):
    """A way to number the unknowns of the points.

    numbers   (dim, N) of each point;   R  (n, m) rigid motions of the unknowns
    resisted  (rows, m) forces, and gaps in the constraints, that they make, each row of size one
    share     of the unknowns whose rows of K no rigid motion loads
    turned    the first of those that a rotation loads and no translation does, if there is one
    """

    numbers: np.ndarray
    R: np.ndarray
    resisted: np.ndarray
    share: float
    turned: tuple[int, ...]


def _numbering(
    kind: Kind, K: sp.csr_matrix, D: sp.csr_matrix, x: np.ndarray, numbers: np.ndarray
) -> Numbering:
    fields = rigid_fields(x)[:, :, slice(1, 2) if kind.revolved else slice(None)]
    points = np.zeros((D.shape[0], fields.shape[2]))
    points[numbers] = fields
    R = np.zeros((K.shape[0], fields.shape[2]))
    R[: len(points)] = points
    R[np.bincount(D.indices, minlength=len(R)) == 0] = 0.0
    gaps = D @ R - points
    forces, sizes = K @ R, abs(K) @ np.abs(R)
    loaded = np.divide(forces, sizes, out=np.zeros(forces.shape), where=sizes > 0)
    loaded[np.abs(loaded) < 1e-7] = 0.0  # rounding of the forces' sizes
    tried = (np.diff(K.indptr) > 1) & sizes.any(axis=1)
    rows = loaded[tried & loaded.any(axis=1)]
    rows = rows / np.abs(rows).max(axis=1, keepdims=True)
    gaps = gaps[np.abs(gaps).max(axis=1, initial=0.0) > EQUAL]
    rows = np.concatenate([rows, gaps])
    share = np.sum(tried & ~loaded.any(axis=1)) / max(tried.sum(), 1)
    still = ~loaded[:, : len(x)].any(axis=1)
    told = not (kind.revolved or len(gaps))
    turned = np.flatnonzero(tried & still & loaded.any(axis=1) & told)
    return Numbering(numbers, R, rows, float(share), tuple(turned[:1].tolist()))


def numbered(
    kind: Kind, part: MatrixPart, K: sp.csr_matrix, D: sp.csr_matrix, x: np.ndarray
) -> Numbering:
    """The numbering of a part, which its rigid motions prove; InputError where they do not."""
    (dim, count), every = x.shape, np.arange(x.size)
    ways = {"node": every.reshape(count, dim).T, "component": every.reshape(dim, count)}
    stated, name = part.order, f"body '{part.name}'"
    if not isinstance(stated, str):
        given = real_array(f"the order of {name}", stated)
        given = given.T if given.shape == (count, dim) else given
        if given.shape != x.shape or not np.array_equal(np.sort(given, axis=None), every):
            raise InputError(
                f"{name}: its order needs each number from 0 to {x.size - 1} once, in the shape"
                f" {(count, dim)}; got the shape {given.shape}."
            )
        ways, stated = {"given": given.astype(int)}, "given"
    found = {way: _numbering(kind, K, D, x, numbers) for way, numbers in ways.items()}
    if part.solves is not None:
        if stated == "auto":
            raise InputError(
                f"{name}: of a function that solves nobody knows the numbering; say order = 'node'"
                " or 'component', or give the numbers (N, dim)."
            )
        return found[stated]
    best = max(found, key=lambda way: found[way].share)
    own = found[best if stated == "auto" else stated]
    reduced = bool(np.any(np.diff(K.indptr) <= 1))  # nothing may be left that nothing holds
    if own.share < found[best].share:
        raise InputError(
            f"{name}: K resists rigid motions of the points in the order '{stated}', and fewer of"
            f" them in the order '{best}'; take that one, or 'auto'."
        )
    if own.turned:
        raise InputError(
            f"{name}: K resists rotations of the points and no translations, as at unknown"
            f" {own.turned[0]}: coordinates have another unit along one axis, lack an offset or are"
            " in another order than the unknowns."
        )
    if own.share == 0 and (stated == "auto" or not reduced):
        raise InputError(
            f"{name}: K resists rigid motions of the points at all of its unknowns: the points, the"
            " components or the order of the unknowns are not those of K, or it stands on springs"
            " everywhere; say order = 'node' or 'component', or give the numbers (N, dim)."
        )
    return own


def check_isolated(name: str, K: sp.csr_matrix, held: np.ndarray) -> None:
    """Refuse unknowns (n,) that K couples to no others and that nothing holds."""
    filled = np.bincount(K.nonzero()[0], minlength=len(held))
    lost = np.flatnonzero((filled <= (K.diagonal() != 0)) & ~held)
    if len(lost):
        value = K[lost[0], lost[0]]
        why = "and has no stiffness there; leave out points that belong to no element"
        if value:
            why = "which is what a boundary condition leaves there; name the unknown in fixed"
        raise InputError(
            f"body '{name}': K couples unknown {lost[0]} to no other, with {value:g} on its"
            f" diagonal, {why}."
        )


def free_motions_of(
    part: MatrixPart, K: sp.csr_matrix, held: np.ndarray, way: Numbering, names: tuple[str, ...]
) -> Motions:
    """The given free motions, or the rigid ones that neither K nor what is held resists."""
    if part.solves is not None:
        return Motions(np.zeros((len(held), 0)), (), np.zeros(0, int), np.zeros((len(held), 0)))
    if part.motions is not None:
        Z = real_array(f"the motions of body '{part.name}'", part.motions)
        if Z.ndim != 2 or len(Z) != len(held) or not Z.any(axis=0).all():
            raise InputError(
                f"body '{part.name}': its motions need {count(len(held), 'row')}, and none"
                f" may be zero; got the shape {Z.shape}."
            )
        words = tuple(f"motion {number}" for number in range(1, 1 + Z.shape[1]))
        error = np.abs(K @ Z).max(axis=0) / (abs(K) @ np.abs(Z)).max(axis=0)
        if np.any(error > EQUAL) or np.any(Z[held]):
            raise InputError(
                f"body '{part.name}': {words[int(np.argmax(error))]} is not free: K or what is held"
                " resists it; give motions with K Z = 0, zero where unknowns are held."
            )
    else:
        labels = motion_labels(names)
        labels = labels if way.R.shape[1] == len(labels) else labels[1:2]
        rows = np.concatenate([way.R[held & way.R.any(axis=1)], way.resisted])
        combined, words = kernel(rows, labels)
        Z = way.R @ combined
        Z[held] = 0.0
    if not words:
        return Motions(Z, (), np.zeros(0, int), Z.copy())
    free = np.flatnonzero(~held)
    fixing = free[la.qr(Z[free].T, pivoting=True, mode="r")[1][: len(words)]]
    return Motions(Z, words, np.sort(fixing), Z @ np.linalg.inv(Z.T @ Z))


def check_definite(body: Matrices, made: ElasticBody, known: bool) -> None:
    """Refuse a stiffness with a negative eigenvalue or without stiffness against some motion, as
    far as a few steps of Lanczos's method with K and with its inverse find one; where K is not
    `known`, also a solver that is not linear and symmetric.
    """
    kept, solve = made.kept, made.solver.solve
    start = np.random.default_rng(0).standard_normal(len(kept))
    if not known:
        a, b = np.random.default_rng(1).standard_normal((2, len(kept)))
        x, y = solve(a), solve(b)
        size = np.linalg.norm(a) * np.linalg.norm(y) + np.linalg.norm(b) * np.linalg.norm(x)
        both = np.linalg.norm(solve(a + b) - x - y) / np.linalg.norm(np.abs(x) + np.abs(y))
        if abs(a @ y - b @ x) > SAME * size or both > SAME or min(a @ x, b @ y) <= 0:
            raise InputError(
                f"body '{body.name}': its function does not solve K U = F with a symmetric positive"
                " definite K; it must hold the fixed unknowns at 0 and be linear."
            )
        return
    K = body.A[kept][:, kept]
    d = np.sqrt(K.diagonal())  # scaled by it, small elements and large ones count alike
    # conjugate gradients refuse negative curvature themselves
    steps = FEW if made.solver.definite or made.solver.iterative else STEPS
    low, high = _extremes(lambda x: np.asarray(K @ (x / d)) / d, start, STEPS)
    softest = _extremes(lambda x: d * solve(d * x), start, steps)
    if min(low, 0.0) < -PIVOT * high or softest[0] < -SAME * softest[1]:
        raise indefinite(
            body,
            f", since {low:.3g} is among its scaled eigenvalues, or {softest[0]:.3g} among those of"
            " its inverse",
        )
    if not softest[1] * high * PIVOT < 1:
        raise without_stiffness(body)


def _extremes(act: Act, x: np.ndarray, steps: int) -> tuple[float, float]:
    """The least and the largest Ritz value of a symmetric matrix after some steps from x (n,)."""
    basis = [x / np.linalg.norm(x)]
    moved: list[np.ndarray] = []
    while len(moved) < min(steps, len(x)):
        moved.append(act(basis[-1]))
        if not np.isfinite(moved[-1]).all():
            return 0.0, np.inf
        Q = np.stack(basis, axis=1)
        rest = moved[-1] - Q @ (Q.T @ moved[-1])
        rest -= Q @ (Q.T @ rest)
        if np.linalg.norm(rest) <= SAME * np.linalg.norm(moved[-1]):
            break
        basis.append(rest / np.linalg.norm(rest))
    H = np.stack(basis[: len(moved)]) @ np.stack(moved, axis=1)
    values = np.linalg.eigvalsh((H + H.T) / 2)
    return float(values[0]), float(values[-1])


def indefinite(body: Matrices, why: str = "") -> InputError:
    """What to raise where K is found to have a negative eigenvalue."""
    return InputError(
        f"body '{body.name}': K is not positive semidefinite{why}; Lagrange multipliers, mixed"
        " elements and buckling loads have no place in it."
    )


def without_stiffness(body: Matrices) -> InputError:
    """What to raise where more than the known free motions costs no force."""
    known = ", ".join(body.rigid_motions.names) or "none"
    return InputError(
        f"body '{body.name}': K has no stiffness against some motion beside its free motions"
        f" ({known}); name what holds it in fixed, give motions with K Z = 0, or leave out"
        " points that no element holds."
    )
