"""An elastic half-space or half-plane that is loaded on a regular grid of points: no mesh, products
by fast Fourier transforms.

Each point stands for a cell of the surface that carries a uniform traction; its displacement is
that of the middle of the cell (contactopt.bodies.influence). The unknowns are the displacements of
the k points, component by component of each, followed by the forces that made them and by the
motion of the body as a whole, which are what energies are computed from:

    U = (u_1 ... u_k, F_1 ... F_k, motion),   elastic energy = F' C F / 2,   external force = -sum F
                                              on the motion.

The body as a whole may be displaced by a given amount, be held, or move freely under a total force;
displacements from deformation vanish far away (in the plane: at the reference depth; on a periodic
surface: in the mean).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.assembled import Surface, UndividedBody
from contactopt.bodies.influence import half_plane_influence, half_space_influence
from contactopt.bodies.protocol import Seen
from contactopt.errors import InputError
from contactopt.linear.convolution import Kernel, embedding, serves_single
from contactopt.material import Material, lame
from contactopt.problem.chart import Chart
from contactopt.scenes.contact import SIDES
from contactopt.scenes.scene import HalfSpace, Scene


@dataclass(frozen=True, eq=False)
class HalfSpaceBody(UndividedBody):
    """A half-space of a scene.

    part        as the scene gives it;  components  of displacements, the normal of the surface last
    ticks       places of the points along each axis of the grid [length]
    outward     1 if the outward normal points along the last component, -1 if against it
    thickness   of a half-plane [length]
    """

    part: HalfSpace
    components: tuple[str, ...]
    ticks: tuple[np.ndarray, ...]
    outward: float
    thickness: float

    @property
    def grid(self) -> tuple[int, ...]:
        return tuple(len(row) for row in self.ticks)

    @property
    def spacing(self) -> tuple[float, ...]:
        return tuple(float(row[-1] - row[0]) / (len(row) - 1) for row in self.ticks)

    @cached_property
    def unknowns(self) -> int:
        return int(np.prod(self.grid)) * len(self.components)

    @property
    def whole(self) -> range:  # type: ignore[override]
        return range(2 * self.unknowns, 2 * self.unknowns + len(self.components))

    @property
    def cell(self) -> float:
        """Area of a cell [length^2]."""
        return float(np.prod(self.spacing)) * self.thickness

    @cached_property
    def kernel(self) -> Kernel:
        """The compliance as a convolution, in components n, t1[, t2] with n the last one."""
        make = _periodic if self.part.periodic else _infinite
        grid_kernel = make(self)
        return grid_kernel.scaled(1 / self.thickness) if len(self.grid) == 1 else grid_kernel

    @cached_property
    def at_rest(self) -> np.ndarray:
        k = int(np.prod(self.grid))
        return np.concatenate([np.tile(self.given, k), np.zeros(self.unknowns), self.given])

    @cached_property
    def fields(self) -> np.ndarray:
        k, still = int(np.prod(self.grid)), np.zeros((self.unknowns, self.shifts.shape[1]))
        return np.concatenate([np.tile(self.shifts, (k, 1)), still, self.shifts])

    def surface(self, name: str | None = None) -> Surface:
        if name not in (None, "contact"):
            raise InputError(
                f"body '{self.name}' has one contact surface, 'contact'; there is no {name!r}."
            )
        k, dim, n = int(np.prod(self.grid)), len(self.components), len(self.at_rest)
        flat = np.stack([row.ravel() for row in np.meshgrid(*self.ticks, indexing="ij")])
        points = np.concatenate([flat, np.zeros((1, k))])
        places = np.concatenate([flat, self.outward * self._height(flat)[None]])
        normals = np.zeros((dim, k))
        normals[-1] = self.outward
        count, ones = np.arange(k + 1, dtype=np.int32), np.ones(k)
        traces = tuple(
            sp.csr_matrix((ones, np.arange(c, k * dim, dim, dtype=np.int32), count), (k, n))
            for c in range(dim)
        )
        middle = flat - (flat.max(axis=1) + flat.min(axis=1))[:, None] / 2
        areas, held = np.full(k, self.cell), np.zeros((dim, k), dtype=bool)
        own = self.name, points, normals, areas, sp.identity(k, format="csr"), places, traces, held
        chart = Chart(middle, (False,) * (dim - 1), grid=self.grid)
        return Surface(*own, self._cells(), chart=chart)

    def _height(self, flat: np.ndarray) -> np.ndarray:
        height = self.part.height
        if height is None:
            return np.zeros(flat.shape[1])
        made = np.asarray(height(flat) if callable(height) else height, dtype=float)
        if made.shape not in (self.grid, flat.shape[1:]) or not np.all(np.isfinite(made)):
            raise InputError(
                f"the height of half-space '{self.name}' must give one finite number per point,"
                f" shape {self.grid}; got shape {made.shape}."
            )
        return made.ravel()

    def _cells(self) -> np.ndarray:
        number = np.arange(np.prod(self.grid), dtype=np.int32).reshape(self.grid)
        if number.ndim == 1:
            return np.stack([number[:-1], number[1:]])
        corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        return np.stack([corner.ravel() for corner in corners])

    def iterates(self, solver: str) -> bool:
        """Its products are so cheap that an array of its compliance never pays."""
        return True

    def _seen_kernel(self, T: sp.csr_matrix) -> Kernel | None:
        """For maps to displacements of all points in their order, in components +-n, +-t1, +-t2."""
        k, dim = int(np.prod(self.grid)), len(self.components)
        own = np.roll(np.arange(dim), 1)  # n is the last component
        if T.shape[0] != k * dim or T.nnz != k * dim or np.any(np.diff(T.indptr) != 1):
            return None
        if np.any(T.indices.reshape(k, dim) != dim * np.arange(k)[:, None] + own):
            return None
        signs = T.data.reshape(k, dim)
        if np.any(signs != signs[0]) or not np.allclose(np.abs(signs[0]), 1.0, rtol=1e-12):
            return None
        sign, known = signs[0], self.kernel.symbols
        symbols = {
            (a, b): -symbol if sign[a] * sign[b] < 0 else symbol for (a, b), symbol in known.items()
        }
        return replace(self.kernel, symbols=symbols)

    def through(self, T: sp.csr_matrix) -> Seen:
        act = self._compliance_product

        def product(X: np.ndarray, accuracy: float | None) -> np.ndarray:
            moved = [act(force, accuracy) for force in (T.T @ X).T]
            return np.asarray(T @ np.stack(moved, axis=1))

        moved = np.asarray(np.diff(T.indptr) > 0)
        return Seen(product, lambda: self._entries(T), moved, self._seen_kernel(T))

    def _compliance_product(self, force: np.ndarray, accuracy: float | None = None) -> np.ndarray:
        """C F (n,) for nodal forces F (n,): displacements, followed by the forces."""
        m, dim = self.unknowns, len(self.components)
        U, every = np.zeros(2 * m + dim), tuple(range(dim))
        F = np.moveaxis(force[:m].reshape(*self.grid, dim), -1, 0)
        turned = [F[(c - 1) % dim] for c in every]  # n is the last component
        moved = self.kernel.act(turned, every, every, serves_single(accuracy))
        for c, own in enumerate(moved):
            U[(c - 1) % dim : m : dim] = own.ravel()
        U[m : 2 * m] = force[:m]
        return U

    def _entries(self, T: sp.csr_matrix) -> np.ndarray:
        k, dim = int(np.prod(self.grid)), len(self.components)
        order = (np.arange(k)[:, None] * dim + np.roll(np.arange(dim), -1)).ravel()
        C = self.kernel.entries()[np.ix_(order, order)]  # in the order of the components
        local = T[:, : k * dim]
        made = local @ (local @ C).T
        return np.asarray((made + made.T) / 2)

    def displacement(
        self, force: np.ndarray, multipliers: np.ndarray, free: np.ndarray | None = None
    ) -> np.ndarray:
        U = self._compliance_product(force)
        if np.any(self.given) or len(multipliers):
            U += self.at_rest + self.fields @ multipliers
        return U

    def material_change(
        self, constant: str, U: np.ndarray, force: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """C is quadratic in nu, over E: central differences by nu are exact."""
        E, nu = self.part.material.E, self.part.material.nu
        change = np.zeros(len(U))
        if constant == "E":
            change[: self.unknowns] = -self._compliance_product(force)[: self.unknowns] / E
            return change, np.zeros(self.shifts.shape[1])
        h = min(0.1, (0.5 - nu) / 2, (1 + nu) / 2)
        for sign in (1.0, -1.0):
            other = replace(self, part=replace(self.part, material=Material(E, nu + sign * h)))
            change[: self.unknowns] += (
                sign * other._compliance_product(force)[: self.unknowns] / (2 * h)
            )
        return change, np.zeros(self.shifts.shape[1])

    def internal_forces(self, U: np.ndarray, force: np.ndarray) -> np.ndarray:
        """The contact forces on the points, and what balances them on the body as a whole."""
        m, dim = self.unknowns, len(self.components)
        F = U[m : 2 * m]
        return np.concatenate([F, np.zeros(m), -F.reshape(-1, dim).sum(axis=0)])

    def loaded(self, scene: Scene, part: HalfSpace) -> HalfSpaceBody:
        """The same body with another total force and another displacement."""
        return replace(self, part=part)


def _infinite(body: HalfSpaceBody) -> Kernel:
    distances = tuple(np.arange(m // 2 + 1) for m in embedding(body.grid))
    if len(body.grid) == 1:
        length = body.spacing[0] * len(body.ticks[0])
        depth = 10 * length if body.part.depth is None else body.part.depth
        if depth < length:
            raise InputError(
                f"half-plane '{body.name}': its depth ({depth:g}) must be at least the length of"
                f" its points ({length:g})."
            )
        coefficients = half_plane_influence(
            body.part.material, body.spacing[0], distances[0], depth
        )
    else:
        coefficients = half_space_influence(body.part.material, body.spacing, distances)
    last = len(body.grid)
    turned = {}
    for (a, b), part in coefficients.items():
        # the displacement under a normal force; the pair wanted is the other way round
        if a < last and b == last:
            turned[0, a + 1] = -body.outward * part
        else:
            turned[(a + 1) % (last + 1), (b + 1) % (last + 1)] = part
    return Kernel.of_coefficients(body.grid, turned)


def _periodic(body: HalfSpaceBody) -> Kernel:
    """The kernel of tractions that are trigonometric polynomials on the grid; their mean makes no
    displacement.

    Under tractions with the wave vector k the surface moves by (1 - nu)/(G |k|) along the normal
    and along k, by 1/(G |k|) across k, and by (1 - 2 nu)/(2 G |k|) along k under normal tractions,
    with a quarter of a period between. Sources: Johnson (1985), section 13.2; Stanley, Kato (1997).
    """
    G, nu = lame(body.part.material)[1], body.part.material.nu
    grid, spacing = body.grid, body.spacing
    waves = [2 * np.pi * np.fft.fftfreq(n, h) for n, h in zip(grid, spacing)]
    waves[-1] = 2 * np.pi * np.fft.rfftfreq(grid[-1], spacing[-1])
    k = np.meshgrid(*waves, indexing="ij")
    size = np.sqrt(sum(part**2 for part in k))
    over = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    cell = np.prod(spacing)
    symbols = {(0, 0): (1 - nu) / (G * cell) * over}
    for axis, part in enumerate(k):
        odd = np.where(np.isclose(np.abs(part), np.pi / spacing[axis]), 0.0, part)
        symbols[0, axis + 1] = body.outward * (1 - 2 * nu) / (2 * G * cell) * odd * over**2
        symbols[axis + 1, axis + 1] = (over - nu * part**2 * over**3) / (G * cell)
    if len(grid) == 2:
        first, second = (
            np.where(np.isclose(np.abs(part), np.pi / h), 0.0, part) for part, h in zip(k, spacing)
        )
        symbols[1, 2] = -nu * first * second * over**3 / (G * cell)
    return Kernel(grid, grid, symbols)


def assemble_half_space(
    scene: Scene, part: HalfSpace, elements: int, zone: float | None
) -> HalfSpaceBody:
    """A half-space on its grid; InputError in an axisymmetric or mirrored scene."""
    if scene.analysis.revolved or scene.analysis.stretches or scene.copies > 1:
        raise InputError(
            f"half-space '{part.name}': scene '{scene.name}' must be 'plane-strain' or 'solid' with"
            " copies = 1, because the forces between its points have no symmetry."
        )
    sides = {
        side for pair in scene.pairs for side, name in zip(SIDES, pair.bodies) if name == part.name
    }
    if len(sides) > 1:
        raise InputError(
            f"half-space '{part.name}' is the upper body of one contact and the lower one of"
            " another; give all of its contacts the same side, because it fills one half of space."
        )
    outward = -1.0 if "upper" in sides else 1.0
    thickness = scene.thickness if scene.dim == 2 else 1.0
    return HalfSpaceBody(
        part, scene.components, part.ticks(elements, zone, scene.dim - 1), outward, thickness
    )
