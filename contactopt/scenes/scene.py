"""What to model: bodies, supports, loads and the contact between them. No equations, no degrees of freedom.

Everything here is frozen and checked when it is made. The unit system is the user's; the named scenes
(contactopt.scenes) use newton, millimetre and megapascal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from contactopt.checks import check_name, check_number
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.contact import Contact

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
    contact  the name of the candidate contact boundary; a Contact of the scene can name others.
    curve    function (dim, k) -> (dim, k) that puts points of the contact boundary on the surface that the mesh stands
             for: the gap of a curved body at nodes within its edges (degree 2). None: the edges are the surface. For a
             body with several contact boundaries, a mapping from the name of a boundary to its function.
    """

    name: str
    mesh: Any
    material: Material
    supports: tuple[Support, ...] = ()
    loads: tuple[Traction | BodyForce | Plate, ...] = ()
    contact: str = "contact"
    curve: Callable[[np.ndarray], np.ndarray] | Mapping[str, Callable[[np.ndarray], np.ndarray]] | None = None

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)  # of its VTU file
        if not isinstance(self.material, Material):
            raise InputError(f"body '{self.name}': its material must be a Material(E, nu); got {self.material!r}.")

    def curve_of(self, boundary: str) -> Callable[[np.ndarray], np.ndarray] | None:
        """The function that puts points of that contact boundary on its surface, if there is one."""
        if callable(self.curve):
            return self.curve if boundary == self.contact else None
        return (self.curve or {}).get(boundary)

    def build_mesh(self, elements: int, zone: float | None) -> Any:
        return self.mesh(elements, zone) if callable(self.mesh) else self.mesh


@dataclass(frozen=True)
class Rigid:
    """A rigid body: its compliance is zero.

    normal the contact normal, one value per component; None: the normals of the other body's contact boundary
    gap    function of the other body's contact nodes, coordinates (dim, k) -> initial gap (k,) along the normal
           [length]; None means touching everywhere.
    force  None for an obstacle that does not move; otherwise, as in Plate, the total force on it by component.
    """

    name: str
    normal: tuple[float, ...] | None = None
    gap: Callable[[np.ndarray], np.ndarray] | None = None
    force: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)


@dataclass(frozen=True)
class Scene:
    """Bodies that may touch each other.

    The short form Scene(name, upper, lower, mu) is a scene of two bodies: `upper` is pressed on `lower`. The long form
    Scene(name, bodies=(...), contacts=(Contact(...), ...)) holds any number of bodies and pairs of surfaces, each pair with
    its own law. Readers use `parts` and `pairs`, which both forms have.

    mu, law    of the short form, as in Contact
    bodies     of the long form
    contacts   of the long form; every body belongs to at least one of them
    kind       'plane-strain', 'axisymmetric' (coordinates r, z) or 'solid'.
    thickness  depth of a plane-strain body [length].
    copies     how many mirror images make the whole body: 2 for a half model, 4 for a quarter. Forces, nodal
               forces and nodal areas are those of all the images together, as on the ring of an axisymmetric body.
    degree     of the displacement in every element: 1, linear, or 2, quadratic; 2 for nearly incompressible bodies,
               where linear elements lock.
    elements   default number of elements across the contact half-width, for parts whose mesh is a function.
    zone       first guess of the contact half-width [length]; None when the geometry fixes the contact zone.
    units      names of the units of length and stress, for the axes of figures
    reference  an exact solution to compare with (contactopt.analytic.Reference), or None.
    """

    name: str
    upper: Part | Rigid | None = None
    lower: Part | Rigid | None = None
    mu: float | np.ndarray | Callable[[np.ndarray], Any] | None = None
    kind: str = "plane-strain"
    thickness: float = 1.0
    copies: int = 1
    degree: int = 1
    law: str = "coulomb"
    elements: int = 16
    zone: float | None = None
    units: tuple[str, str] = ("length", "stress")
    reference: Any = field(default=None, compare=False)
    bodies: tuple[Part | Rigid, ...] = ()
    contacts: tuple[Contact, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in COMPONENTS:
            raise InputError(f"scene '{self.name}': unknown kind {self.kind!r}; choose from {', '.join(COMPONENTS)}.")
        self._check_form()
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
        self._check_pairs()
        for part in self.parts:
            self._check_part(part)

    @property
    def friction(self) -> str:
        """The laws and their numbers, for titles: 'mu = 0.3'."""
        return "; ".join(dict.fromkeys(pair.friction for pair in self.pairs))

    @property
    def parts(self) -> tuple[Part | Rigid, ...]:
        """The bodies; in the short form the upper one first."""
        if self.upper is None or self.lower is None:
            return self.bodies
        return self.upper, self.lower

    @property
    def pairs(self) -> tuple[Contact, ...]:
        """The pairs of surfaces that may touch."""
        if self.upper is None or self.lower is None or self.mu is None:
            return self.contacts
        return (Contact(self.upper.name, self.lower.name, self.mu, self.law),)

    def with_parts(self, change: Callable[[Any], Any]) -> Scene:
        """The scene with `change` applied to each of its bodies."""
        if self.upper is None or self.lower is None:
            return replace(self, bodies=tuple(change(part) for part in self.bodies))
        return replace(self, upper=change(self.upper), lower=change(self.lower))

    def surfaces_of(self, part: Any) -> tuple[str, ...]:
        """Names of the boundaries of a part that contacts use, each once, in the order of the pairs."""
        found = [
            surface or part.contact
            for pair in self.pairs
            for body, surface in zip(pair.bodies, pair.surfaces)
            if body == part.name
        ]
        return tuple(dict.fromkeys(found)) or (part.contact,)

    @property
    def components(self) -> tuple[str, ...]:
        return COMPONENTS[self.kind]

    @property
    def dim(self) -> int:
        return len(self.components)

    @property
    def given(self) -> bool:
        """Whether the mesh of a body is given, not made for a number of elements."""
        return any(isinstance(part, Part) and not callable(part.mesh) for part in self.parts)

    def _check_form(self) -> None:
        """Either the short form is given in full or the long one."""
        short = (self.upper is not None, self.lower is not None, self.mu is not None)
        if self.bodies or self.contacts:
            if any(short) or self.law != "coulomb":
                raise InputError(
                    f"scene '{self.name}': give either upper, lower, mu and law, or bodies and contacts, not both."
                )
            if not self.bodies or not self.contacts:
                raise InputError(f"scene '{self.name}': bodies and contacts belong together; one of them is empty.")
        elif not all(short):
            raise InputError(f"scene '{self.name}': give upper, lower and mu, or bodies and contacts.")

    def _check_pairs(self) -> None:
        """Names of bodies are known and not given twice; no pair twice; no body without a pair; no two rigid bodies."""
        names = [part.name for part in self.parts]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"scene '{self.name}': two bodies are named '{name}'; give each its own name.")
        pairs = self.pairs
        for pair in pairs:
            if not isinstance(pair, Contact):
                raise InputError(f"scene '{self.name}': contacts must be Contact objects; got {pair!r}.")
            for name in pair.bodies:
                if name not in names:
                    raise InputError(
                        f"scene '{self.name}': contact '{pair.name}' names a body '{name}' that is not there; "
                        f"the bodies are {', '.join(names)}."
                    )
            if [other.name for other in pairs].count(pair.name) > 1:
                raise InputError(f"scene '{self.name}': contact '{pair.name}' is given twice.")
            rigid = [isinstance(self.parts[names.index(name)], Rigid) for name in pair.bodies]
            for name, surface, stiff in zip(pair.bodies, pair.surfaces, rigid):
                if stiff and surface is not None:
                    raise InputError(
                        f"scene '{self.name}': rigid body '{name}' has no surface {surface!r}; name the body alone."
                    )
            if all(rigid):
                raise InputError(
                    f"scene '{self.name}': both bodies of contact '{pair.name}' are rigid; at least one must be elastic."
                )
        for name in names:
            if not any(name in pair.bodies for pair in pairs):
                raise InputError(f"scene '{self.name}': body '{name}' belongs to no contact; drop it or give it one.")

    def _check_part(self, part: Part | Rigid) -> None:
        if isinstance(part, Rigid):
            self._check_components(part.name, part.force or {})
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
