"""A body that is given by its matrices, which another code has assembled.

Signs. At rest under its loads f and the contact forces F, the displacements U of the unknowns obey

    K U = f + F,       K = K' >= 0 [force / length],  f and F [force], positive along the axes.

A component of U, f and F is that of space: x, y[, z], or r, z. Nothing is turned, nothing has its
sign changed. K and f are those of the thickness of the scene; where it has mirror images, or a ring
about an axis, they are those of all images, or of the whole ring, together.

With constraints T the points move by u = T U, and the contact forces F = T' B' r follow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
import scipy.sparse as sp

from contactopt.cards import count
from contactopt.checks import check_name, check_size, real_array, short
from contactopt.defaults import EQUAL
from contactopt.errors import InputError
from contactopt.scenes.body_kinds import Body, Support
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.loads.plate import Plate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

ORDERS = ("auto", "node", "component")
SIZES = {2: (2, 3), 3: (3, 4, 6, 8, 9)}  # dimension -> how many points a facet may have
# stiffness against itself of an unknown over the median of all: conditions by penalty are above
PENALTY = 1e9


@dataclass(frozen=True, eq=False)
class MatrixPart:
    """An elastic body given by its stiffness K and loads f, as at the top of this module.

    K            (n, n) sparse or dense, without boundary conditions, n = dim N for N points; or a
                 function (n,) -> (n,) that solves K U = F, or an object with such a method `solve`,
                 both with U = 0 at the unknowns in `fixed`
    f            (n,) loads [force]
    points       (N, dim) or (dim, N) coordinates [length]
    facets       name -> (m, j) numbers of points, from 0 on, of the m facets of a surface, corners
                 first and then those in the middle of edges; j is 2 or 3 in the plane, 3, 4, 6, 8
                 or 9 in space
    fixed        numbers of the unknowns that are held, or a mapping from numbers to displacements
                 [length]
    supports     Support objects on surfaces in `facets`, instead of `fixed` or besides
    loads        Plate objects on surfaces in `facets`; all other loads are in f
    contact      the name of the candidate contact surface; a Contact can name others
    order        'node': the unknowns of a point follow each other; 'component': all x come first,
                 then all y; or their numbers (N, dim); 'auto': that of the first two in which rigid
                 motions need no force
    constraints  T (dim N, n) sparse: the displacements of the points, in this order, from the
                 unknowns of K, for multi-point constraints and unknowns that are left out. K and f
                 may then also be those before the constraints, of dim N unknowns. `fixed` counts
                 the unknowns of the points
    motions      (n, p) free motions, K motions = 0; None: those rigid motions that nothing resists
    stress       a function that takes displacements of the points (dim, N) [length] and returns the
                 stresses there (N, 4), in space (N, 6), xx, yy, zz, xy[, yz, xz] [stress], or in
                 an axisymmetric scene rr, zz, tt, rz, for files
    """

    name: str
    K: Any
    f: Any
    points: Any
    facets: Mapping[str, Any]
    fixed: Any = None
    supports: tuple[Support, ...] = ()
    loads: tuple[Plate, ...] = ()
    contact: str = "contact"
    order: Any = "auto"
    constraints: Any = None
    motions: Any = None
    stress: Callable[[np.ndarray], np.ndarray] | None = None
    solves: Callable[[np.ndarray], np.ndarray] | None = field(default=None, init=False)

    elastic: ClassVar[Literal[True]] = True
    meshed: ClassVar[Literal[False]] = False
    given = True

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)
        f = np.atleast_1d(real_array(f"the loads f of body '{self.name}'", self.f).squeeze())
        T = None if self.constraints is None else self._matrix("its constraints", self.constraints)
        if callable(self.K) or hasattr(self.K, "solve"):
            object.__setattr__(self, "solves", getattr(self.K, "solve", self.K))
            if T is not None or self.loads or self.motions is not None:
                raise self._wrong(
                    "a function that solves knows no plates, constraints or free motions; give K"
                    " itself as a sparse matrix."
                )
            K = sp.csr_matrix((f.size, f.size))
        else:
            K = self._checked_stiffness(self._matrix("K", self.K))
        if f.shape != K.shape[:1]:
            raise self._wrong(
                f"f needs {count(K.shape[0], 'number')} in one row, as K has rows; got the shape"
                f" {f.shape}."
            )
        points = real_array(f"the points of body '{self.name}'", self.points)
        if points.ndim != 2:
            raise self._wrong(f"its points need the shape (N, dim); got {points.shape}.")
        for what, value in (("K", K), ("f", f), ("constraints", T), ("points", points)):
            object.__setattr__(self, what, value)
        if not isinstance(self.facets, Mapping) or self.contact not in self.facets:
            raise self._wrong(
                f"its facets must be a mapping that names {self.contact!r}, the contact surface;"
                f" got {short(self.facets)}."
            )
        self._check_holders()
        if isinstance(self.order, str) and self.order not in ORDERS:
            raise self._wrong(
                f"its order must be one of {', '.join(ORDERS)}, or the numbers of the unknowns"
                f" (N, dim); got {self.order!r}."
            )

    def _wrong(self, why: str) -> InputError:
        return InputError(f"body '{self.name}': {why}")

    def _check_holders(self) -> None:
        for what, items, kind in (
            ("supports", self.supports, Support),
            ("loads", self.loads, Plate),
        ):
            for item in items:
                if not isinstance(item, kind):
                    raise self._wrong(
                        f"its {what} must be {kind.__name__} objects, and all other loads belong in"
                        f" f; got {short(item)}."
                    )
                names = item.boundary.split("/")
                if not set(names) <= set(self.facets):
                    raise self._wrong(
                        f"there are no facets {item.boundary!r} to hold or drive; it has"
                        f" {', '.join(self.facets)}."
                    )

    def _matrix(self, what: str, given: sp.spmatrix | np.ndarray) -> sp.csr_matrix:
        if not sp.issparse(given):
            given = real_array(f"{what} of body '{self.name}'", given)
            if given.ndim != 2:
                raise self._wrong(f"{what} must be a matrix; got an array of shape {given.shape}.")
        made = sp.csr_matrix(given)
        if made.dtype.kind == "c":
            raise self._wrong(f"{what} must be real; got complex numbers.")
        if not np.isfinite(made.data).all():
            raise self._wrong(f"{what} holds a number that is not finite.")
        return made.astype(float)

    def _checked_stiffness(self, K: sp.csr_matrix) -> sp.csr_matrix:
        """K, symmetric to the last digit; InputError for what is no stiffness of a body."""
        if K.shape[0] != K.shape[1] or not K.nnz:
            raise self._wrong(f"K must be square and not empty; got the shape {K.shape}.")
        if min(abs(sp.tril(K, -1)).sum(), abs(sp.triu(K, 1)).sum()) == 0 < K.nnz - K.shape[0]:
            raise self._wrong(
                "K has entries on one side of its diagonal only, as symmetric matrices are often"
                " stored; give K + K.T - diags(K.diagonal())."
            )
        lack = abs(K - K.T)
        if lack.max() > EQUAL * abs(K).max():
            i, j = (int(each) for each in np.unravel_index(lack.argmax(), K.shape))
            raise self._wrong(
                f"K is not symmetric: entry ({i}, {j}) is {K[i, j]:.6g} and ({j}, {i}) is"
                f" {K[j, i]:.6g}; give it without boundary conditions, or with those that change"
                " columns as they change rows, and without follower loads."
            )
        size = K.diagonal()
        low, high = int(np.argmin(size)), int(np.argmax(size))
        if size[low] < 0:
            raise self._wrong(
                f"K is not positive semidefinite: its entry ({low}, {low}) is {size[low]:.3g}; a"
                " stiffness resists displacements, so turn its sign, or take Lagrange multipliers"
                " out of it."
            )
        usual = float(np.median(size[size > 0])) if np.any(size > 0) else 0.0
        if size[high] > PENALTY * usual:
            many = np.count_nonzero(size > PENALTY * usual)
            raise self._wrong(
                f"K has {size[high]:.1e} at unknown {high} and {many} such unknowns in all, where"
                f" {usual:.1e} is usual: this is a boundary condition by penalty, or another unit;"
                " give K without it, or with a usual number in its place, which nothing but the"
                " force of the support depends on, and name these unknowns in fixed."
            )
        return sp.csr_matrix((K + K.T) / 2)

    def check_in(self, kind: str) -> None:
        """Check what depends on the kind of the scene; InputError on values that do not fit it."""
        dim, shape = len(KINDS[kind].components), self.points.shape
        if dim not in shape or not self.points.size:
            raise self._wrong(
                f"its points need {dim} coordinates each in a {kind} scene; got an array of shape"
                f" {shape}."
            )
        for length in np.ptp(self.coordinates(dim), axis=1):
            check_size(f"the length of body '{self.name}'", float(length))
        for name, given in self.facets.items():
            self._check_facets(name, given, dim)
        self.stresses(kind, np.zeros((dim, self.points.size // dim)))
        for load in self.loads:
            load.check(self.name, kind)

    def stresses(self, kind: str, u: np.ndarray) -> np.ndarray | None:
        """(N, 4 or 6) stresses at the points under displacements u (dim, N), if they are known."""
        if self.stress is None:
            return None
        shape = u.shape[1], len(KINDS[kind].stresses)
        made = real_array(f"the stresses of body '{self.name}'", self.stress(u))
        if made.shape != shape:
            raise self._wrong(
                f"its stress must take displacements {u.shape} to stresses {shape}, that is"
                f" {', '.join(KINDS[kind].stresses)} at each point; got the shape {made.shape}."
            )
        return made

    def coordinates(self, dim: int) -> np.ndarray:
        """(dim, N) the points [length]."""
        x = self.points
        return np.asarray(x.T if x.shape[1] == dim else x)

    def _check_facets(self, name: str, given: ArrayLike, dim: int) -> None:
        own = f"facets {name!r} of body '{self.name}'"
        facets = real_array(own, given)
        count = self.coordinates(dim).shape[1]
        if facets.ndim != 2 or facets.shape[1] not in SIZES[dim] or not len(facets):
            raise InputError(
                f"{own} need one row of {', '.join(map(str, SIZES[dim]))} points for each facet;"
                f" got the shape {facets.shape}."
            )
        if np.any(facets != np.round(facets)):
            raise InputError(f"{own} need whole numbers of points.")
        if facets.min() < 0 or facets.max() >= count:
            wrong = int(facets.max() if facets.max() >= count else facets.min())
            raise InputError(
                f"{own} name point {wrong}, but points are numbered from 0 to {count - 1}; codes"
                " that count from 1 need 1 subtracted."
            )
        if any(len(set(row)) < len(row) for row in facets.tolist()):
            raise InputError(f"{own} name a point twice in one facet.")
        if len(np.unique(np.sort(facets, axis=1), axis=0)) < len(facets):
            raise InputError(f"{own} name a facet twice.")


AnyPart = Body | MatrixPart
