"""What to model: bodies, supports, loads and the contact between them. No equations, no degrees of freedom.

Everything here is frozen and checked when it is made. The unit system is the user's; the named scenes
(contactopt.scenes) use newton, millimetre and megapascal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from contactopt.checks import check_name, check_number, real_array
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.problem.laws import find_law

MOST_ELEMENTS = 100_000  # across the contact half-width
LARGEST = 1e100  # of forces, stresses and lengths: the squares of larger ones are no numbers

# The components of a displacement, in the order of the mesh coordinates.
COMPONENTS = {"plane-strain": ("x", "y"), "axisymmetric": ("r", "z"), "solid": ("x", "y", "z")}


@dataclass(frozen=True)
class Support:
    """Prescribed displacement on a named boundary, eq (3) of the paper.

    `displacement` maps components to values [length]; None clamps every component. A symmetry plane is a
    Support that holds the normal component only.
    """

    boundary: str
    displacement: Mapping[str, float] | None = None


@dataclass(frozen=True)
class Traction:
    """Surface force per area on a named boundary, eq (4): one value [stress] per component."""

    boundary: str
    value: tuple[float, ...]


@dataclass(frozen=True)
class BodyForce:
    """Force per volume: one value [force / length^3] per component."""

    value: tuple[float, ...]


@dataclass(frozen=True)
class Plate:
    """A rigid plate on a named boundary, loaded by a total force.

    `force` maps each component in which the plate may move to the total force [force] on the whole body (all
    mirror images, the whole ring). The plate never tilts; its unknown displacement is the multiplier of the force
    balance. In the other components the body is held if the plate is glued to it, and slides freely if not.
    """

    boundary: str
    force: Mapping[str, float]
    glued: bool = True


@dataclass(frozen=True)
class Part:
    """An elastic body.

    mesh     a scikit-fem mesh with named boundaries, or a function (elements, zone) -> mesh, where `elements`
             counts elements across the contact half-width and `zone` is the half-width the mesh must resolve.
    contact  the name of the candidate contact boundary.
    curve    function (dim, k) -> (dim, k) that puts points of the contact boundary on the surface that the mesh stands
             for: the gap of a curved body at nodes within its edges (degree 2). None: the edges are the surface.
    """

    name: str
    mesh: Any
    material: Material
    supports: tuple[Support, ...] = ()
    loads: tuple[Traction | BodyForce | Plate, ...] = ()
    contact: str = "contact"
    curve: Callable[[np.ndarray], np.ndarray] | None = None

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)  # of its VTU file
        if not isinstance(self.material, Material):
            raise InputError(f"body '{self.name}': its material must be a Material(E, nu); got {self.material!r}.")

    def build_mesh(self, elements: int, zone: float | None) -> Any:
        return self.mesh(elements, zone) if callable(self.mesh) else self.mesh


@dataclass(frozen=True)
class Rigid:
    """A rigid body: its compliance is zero.

    normal the contact normal, one value per component; None: the normals of the other body's contact boundary
    gap    function of the other body's contact nodes, coordinates (dim, k) -> initial gap (k,) along the normal
           [length]; an array of these values, for half-spaces also of the shape of their grid; None means touching everywhere.
    force  None for an obstacle that does not move; otherwise, as in Plate, the total force on it by component.
    displacement  of the body by component [length]; components that have neither a force nor a displacement are held.
    """

    name: str
    normal: tuple[float, ...] | None = None
    gap: Callable[[np.ndarray], np.ndarray] | np.ndarray | None = None
    force: Mapping[str, float] | None = None
    displacement: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)


@dataclass(frozen=True)
class HalfSpace:
    """An elastic half-space (half-plane in 2D) without a mesh: what a body is that is large beside its contact.

    The upper body fills the half z >= 0, the lower the half z <= 0 (in 2D: y). It has no support: it deforms under the contact
    forces alone, and as a whole it is held, displaced or pressed by a total force.

    points        places of the contact points along each direction of the surface, evenly spaced: (x,) in 2D, (x, y) in 3D
                  [length]; or a function (elements, zone) -> such places. Each point stands for a cell about it
    height        of the surface above its plane, outwards: function of the points (dim - 1, k) -> (k,), or an array of the shape
                  of the grid, indexed [x, y] [length]; None: flat
    force         the total force on the body by component, as in Rigid
    displacement  of the body as a whole by component [length]; components that have neither a force nor a displacement are held
    periodic      whether surface and forces repeat themselves beyond the points. Displacements are then measured from their mean
    depth         in 2D, where displacements grow without end: how far beneath each force the point lies from which the
                  displacements that it makes are measured [length]; by default ten times the length of the points
    """

    name: str
    material: Material
    points: Any
    height: Callable[[np.ndarray], np.ndarray] | np.ndarray | None = None
    force: Mapping[str, float] | None = None
    displacement: Mapping[str, float] | None = None
    periodic: bool = False
    depth: float | None = None

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)
        if not isinstance(self.material, Material):
            raise InputError(
                f"half-space '{self.name}': its material must be a Material(E, nu); got {self.material!r}."
            )
        if self.depth is not None:
            check_number(f"the depth of half-space '{self.name}'", self.depth, low=0.0)

    def ticks(self, elements: int, zone: float | None, axes: int) -> tuple[np.ndarray, ...]:
        """Places along each of the axes; InputError unless they are evenly spaced and growing."""
        given = self.points(elements, zone) if callable(self.points) else self.points
        rows = (given,) if np.ndim(given[0]) == 0 else tuple(given)
        if len(rows) != axes:
            raise InputError(
                f"half-space '{self.name}': its points need {axes} rows of places, one per axis; got {len(rows)}."
            )
        made = tuple(real_array(f"the points of half-space '{self.name}'", row) for row in rows)
        for row in made:
            steps = np.diff(row)
            if row.ndim != 1 or len(row) < 4 or steps.min() <= 0 or np.ptp(steps) > 1e-6 * steps.mean():
                raise InputError(
                    f"half-space '{self.name}': its points must be at least 4 growing numbers per axis, evenly spaced."
                )
        return made


@dataclass(frozen=True)
class Scene:
    """Two bodies that may touch: `upper` is pressed on `lower`.

    The contact normal is the outward normal of `lower`; a positive normal reaction pushes `upper` away from it.

    mu         what the law reads: the friction coefficient, for 'tresca' a bound of the tangential traction [stress]; a
               number >= 0, one per contact node (k,), or a function of the nodes' positions (dim, k) that gives either.
    kind       'plane-strain', 'axisymmetric' (coordinates r, z) or 'solid'.
    thickness  depth of a plane-strain body [length].
    copies     how many mirror images make the whole body: 2 for a half model, 4 for a quarter. Forces, nodal
               forces and nodal areas are those of all the images together, as on the ring of an axisymmetric body.
    degree     of the displacement in every element: 1, linear, or 2, quadratic; 2 for nearly incompressible bodies,
               where linear elements lock.
    law        a name in contactopt.problem.laws.LAWS: 'coulomb'; 'bilateral', contact that cannot open; 'tresca', 'associated' or
               'frictionless'.
    elements   default number of elements across the contact half-width, for parts whose mesh is a function.
    zone       first guess of the contact half-width [length]; None when the geometry fixes the contact zone.
    units      names of the units of length and stress, for the axes of figures
    reference  an exact solution to compare with (contactopt.analytic.Reference), or None.
    """

    name: str
    upper: Part | Rigid | HalfSpace
    lower: Part | Rigid | HalfSpace
    mu: float | np.ndarray | Callable[[np.ndarray], Any]
    kind: str = "plane-strain"
    thickness: float = 1.0
    copies: int = 1
    degree: int = 1
    law: str = "coulomb"
    elements: int = 16
    zone: float | None = None
    units: tuple[str, str] = ("length", "stress")
    reference: Any = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if self.kind not in COMPONENTS:
            raise InputError(f"scene '{self.name}': unknown kind {self.kind!r}; choose from {', '.join(COMPONENTS)}.")
        find_law(self.law)
        if not callable(self.mu):
            _check_friction(self.mu)
        check_number("the thickness", self.thickness, low=0.0)
        if self.zone is not None:
            check_number("the contact zone's half-width", self.zone, low=0.0)
        for name, count in (("elements", self.elements), ("copies", self.copies)):
            if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
                raise InputError(f"scene '{self.name}': {name} must be a whole number of at least 1; got {count!r}.")
        if self.elements > MOST_ELEMENTS:
            raise InputError(f"scene '{self.name}': elements must be at most {MOST_ELEMENTS}; got {self.elements}.")
        if self.degree not in (1, 2):
            raise InputError(
                f"scene '{self.name}': the degree of the displacement must be 1 or 2; got {self.degree!r}."
            )
        if isinstance(self.upper, Rigid) and isinstance(self.lower, Rigid):
            raise InputError(f"scene '{self.name}': both bodies are rigid; at least one must be elastic.")
        if self.upper.name == self.lower.name:
            raise InputError(f"scene '{self.name}': both bodies are called '{self.upper.name}'; rename one.")
        for part in (self.upper, self.lower):
            self._check_part(part)

    @property
    def friction(self) -> str:
        """The law and its number, for titles: 'mu = 0.3'."""
        name = "mu" if self.law in ("coulomb", "bilateral") else f"{self.law}, mu"
        return f"{name} = {self.mu:g}" if isinstance(self.mu, (int, float)) else f"{name} varies"

    @property
    def parts(self) -> tuple[Part | Rigid | HalfSpace, ...]:
        """The bodies, upper first."""
        return self.upper, self.lower

    @property
    def components(self) -> tuple[str, ...]:
        return COMPONENTS[self.kind]

    @property
    def dim(self) -> int:
        return len(self.components)

    @property
    def given(self) -> bool:
        """Whether the mesh of a body is given, not made for a number of elements."""
        meshes = [part.mesh for part in self.parts if isinstance(part, Part)]
        return any(
            not callable(m) for m in (*meshes, *(part.points for part in self.parts if isinstance(part, HalfSpace)))
        )

    def _check_part(self, part: Part | Rigid | HalfSpace) -> None:
        if not isinstance(part, Part):
            force, displacement = part.force or {}, part.displacement or {}
            self._check_components(part.name, force)
            self._check_components(part.name, displacement)
            if set(force) & set(displacement):
                raise InputError(f"body '{part.name}': a component can have a force or a displacement, not both.")
        if isinstance(part, HalfSpace):
            return
        if isinstance(part, Rigid):
            if part.normal is not None:
                if len(part.normal) != self.dim or not np.any(part.normal):
                    raise InputError(f"rigid body '{part.name}': its normal needs {self.dim} values, not all zero.")
                for value in part.normal:
                    check_number(f"every value of the normal of rigid body '{part.name}'", value)
            return
        for support in part.supports:
            self._check_components(part.name, support.displacement or {})
        for load in part.loads:
            if isinstance(load, Plate):
                self._check_components(part.name, load.force)
            elif len(load.value) != self.dim:
                raise InputError(
                    f"body '{part.name}': a {type(load).__name__} needs {self.dim} values "
                    f"({', '.join(self.components)}); got {len(load.value)}."
                )
            else:
                for value in load.value:
                    check_number(f"every {type(load).__name__} value of body '{part.name}'", value, -LARGEST, LARGEST)

    def _check_components(self, body: str, values: Mapping[str, float]) -> None:
        for component, value in values.items():
            if component not in self.components:
                raise InputError(
                    f"body '{body}': there is no component {component!r}; use {', '.join(self.components)}."
                )
            check_number(f"the {component} value of body '{body}'", value, -LARGEST, LARGEST)


def _check_friction(mu: Any) -> None:
    """Raise InputError unless mu is a number, or an array of numbers, that are not negative."""
    name = "the friction coefficient mu"
    if np.ndim(mu) == 0:
        check_number(name, mu, low=0.0, closed=True)
    elif np.any(real_array(name, mu) < 0):
        raise InputError(f"{name} must not be negative; its least value is {np.min(mu):g}.")
