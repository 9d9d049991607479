"""What to model: bodies, supports, loads and the contact between them.

No equations, no degrees of freedom.

Everything here is frozen and checked when it is made. The unit system is the user's; the named
scenes (contactopt.scenes) use newton, millimetre and megapascal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from contactopt.checks import check_name, check_number, real_array, short
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.meshes.given_curves import Curve
from contactopt.scenes.contact import Contact

MOST_ACROSS = 100_000  # across the contact half-width
LARGEST_VALUE = 1e100  # of forces, stresses and lengths: the squares of larger ones are no numbers

# The components of a displacement, in the order of the mesh coordinates.
COMPONENTS = {"plane-strain": ("x", "y"), "axisymmetric": ("r", "z"), "solid": ("x", "y", "z")}


@dataclass(frozen=True)
class Support:
    """Prescribed displacement on a named boundary, eq (3) of the paper.

    `displacement` maps components to values [length]; None clamps every component. A symmetry plane
    is a Support that holds the normal component only.
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

    `force` maps each component in which the plate may move to the total force [force] on the whole
    body (all mirror images, the whole ring). The plate never tilts; its unknown displacement is the
    multiplier of the force balance. In the other components the body is held if the plate is glued
    to it, and slides freely if not.
    """

    boundary: str
    force: Mapping[str, float]
    glued: bool = True


LOADS = (Traction, BodyForce, Plate)


@dataclass(frozen=True)
class Part:
    """An elastic body.

    mesh     a scikit-fem mesh with named boundaries, or a function (elements, zone) -> mesh, where
             `elements` counts elements across the contact half-width and `zone` is the half-width
             the mesh must resolve.
    contact  the name of the candidate contact boundary; a Contact of the scene can name others.
    curve    function (dim, k) -> (dim, k) that puts points of the contact boundary on the surface
             that the mesh stands for: the gap of a curved body at nodes within its edges (degree
             2). None: the edges are the surface. For a body with several contact boundaries, a
             mapping from the name of a boundary to its function.
    """

    name: str
    mesh: Any
    material: Material
    supports: tuple[Support, ...] = ()
    loads: tuple[Traction | BodyForce | Plate, ...] = ()
    contact: str = "contact"
    curve: (
        Callable[[np.ndarray], np.ndarray] | Mapping[str, Callable[[np.ndarray], np.ndarray]] | None
    ) = None

    def __post_init__(self) -> None:
        check_name("the body's name", self.name)  # of its VTU file
        if not isinstance(self.material, Material):
            raise InputError(
                f"body '{self.name}': its material must be a Material(E, nu); got"
                f" {self.material!r}."
            )

        if not isinstance(self.contact, str):
            raise InputError(
                f"body '{self.name}': its contact boundary must be a name; got"
                f" {short(self.contact)}."
            )
        if (
            self.curve is not None
            and not callable(self.curve)
            and not isinstance(self.curve, Mapping)
        ):
            raise InputError(
                f"body '{self.name}': its curve must be a function, or a mapping from boundaries to"
                " functions."
            )
        for what, items, kinds in (
            ("supports", self.supports, (Support,)),
            ("loads", self.loads, LOADS),
        ):
            if not isinstance(items, (tuple, list)) or not all(
                isinstance(item, kinds) for item in items
            ):
                names = " or ".join(kind.__name__ for kind in kinds)
                raise InputError(
                    f"body '{self.name}': its {what} must be a tuple of {names} objects; got"
                    f" {short(items)}."
                )

        for item in (*self.supports, *self.loads):
            boundary = "" if isinstance(item, BodyForce) else item.boundary
            if not isinstance(boundary, str):
                raise InputError(
                    f"body '{self.name}': a boundary is given by its name; got {short(boundary)}."
                )

    def curve_of(self, boundary: str) -> Curve | None:
        """Find the function that puts points of a contact boundary on its surface.

        Parameters
        ----------
        boundary : The name of the boundary.

        Returns
        -------
        A function of points (dim, m) to points (dim, m) [length], if there is one.
        """
        if callable(self.curve):
            found = self.curve if boundary == self.contact else None
        else:
            found = (self.curve or {}).get(boundary)
        if found is None or isinstance(found, Curve):
            return found
        return Curve(found, True, f"the curve of boundary {boundary!r} of body '{self.name}'")

    def build_mesh(self, elements: int, zone: float | None) -> Any:
        """Make the mesh of the body.

        Parameters
        ----------
        elements : Number across the contact half-width.
        zone : Half-width of contact that the mesh resolves [length]; None: the scene's first guess.

        Returns
        -------
        A scikit-fem mesh; the given one, if the part has a mesh and no function.
        """
        return self.mesh(elements, zone) if callable(self.mesh) else self.mesh


@dataclass(frozen=True)
class Rigid:
    """A rigid body: its compliance is zero.

    normal the contact normal, one value per component; None: the normals of the other body's
    contact boundary. Where that is
           curved, a gap that is measured along one direction needs this direction here
    gap    function of the other body's contact nodes, coordinates (dim, k) -> initial gap (k,)
           along the normal [length]; an array of these values, for half-spaces also of the shape of
           their grid; None means touching everywhere.
    force  None for an obstacle that does not move; otherwise, as in Plate, the total force on it by
           component.
    displacement  of the body by component [length]; components that have neither a force nor a
                  displacement are held.
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
    """An elastic half-space (half-plane in 2D) without a mesh: what a body is that is large beside
    its contact.

    The upper body fills the half z >= 0, the lower the half z <= 0 (in 2D: y). It has no support:
    it deforms under the contact forces alone, and as a whole it is held, displaced or pressed by a
    total force. Making and solving a problem in 3D takes about
    1.2 kB of memory per point without friction and 2.8 kB with it (reports/half_spaces).

    points        places of the contact points along each direction of the surface, evenly spaced:
                  (x,) in 2D, (x, y) in 3D [length]; or a function (elements, zone) -> such places.
                  Each point stands for a cell about it
    height        of the surface above its plane, outwards: function of the points (dim - 1, k) ->
                  (k,), or an array of the shape of the grid, indexed [x, y] [length]; None: flat
    force         the total force on the body by component, as in Rigid
    displacement  of the body as a whole by component [length]; components that have neither a force
                  nor a displacement are held
    periodic      whether surface and forces repeat themselves beyond the points. Displacements are
                  then measured from their mean
    depth         in 2D, where displacements grow without end: how far beneath each force the point
                  lies from which the displacements that it makes are measured [length]; by default
                  ten times the length of the points
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
                f"half-space '{self.name}': its material must be a Material(E, nu); got"
                f" {self.material!r}."
            )
        if self.depth is not None:
            check_number(f"the depth of half-space '{self.name}'", self.depth, low=0.0)
        if not isinstance(self.periodic, (bool, np.bool_)):
            raise InputError(
                f"half-space '{self.name}': periodic must be True or False; got"
                f" {short(self.periodic)}."
            )

    def ticks(self, elements: int, zone: float | None, axes: int) -> tuple[np.ndarray, ...]:
        """Compute the places of the points along each of the axes.

        Parameters
        ----------
        elements : Number across the contact half-width, for points that are given by a function.
        zone : Half-width that they resolve [length].
        axes : Number of axes.

        Returns
        -------
        Places (n_i,) along each axis [length].

        Raises
        ------
        InputError : Unless they are evenly spaced and growing, at least four along each axis.
        """
        given = self.points(elements, zone) if callable(self.points) else self.points
        if not isinstance(given, (tuple, list, np.ndarray)) or len(given) == 0:
            raise InputError(
                f"half-space '{self.name}': its points must be given by one row of places per axis;"
                f" got {short(given)}."
            )
        rows = (given,) if np.ndim(given[0]) == 0 else tuple(given)
        if len(rows) != axes:
            raise InputError(
                f"half-space '{self.name}': its points need {axes} rows of places, one per axis;"
                f" got {len(rows)}."
            )
        made = tuple(
            real_array(f"a row of points of half-space '{self.name}'", row) for row in rows
        )
        for row in made:
            steps = np.diff(row)
            if (
                row.ndim != 1
                or len(row) < 4
                or steps.min() <= 0
                or np.ptp(steps) > 1e-6 * steps.mean()
            ):
                raise InputError(
                    f"half-space '{self.name}': its points must be at least 4 growing numbers per"
                    " axis, evenly spaced."
                )
        return made


@dataclass(frozen=True)
class Scene:
    """Bodies that may touch each other.

    The short form Scene(name, upper, lower, mu) is a scene of two bodies: `upper` is pressed on
    `lower`. The long form Scene(name, bodies=(...), contacts=(Contact(...), ...)) holds any number
    of bodies and pairs of surfaces, each pair with its own law. Readers use `parts` and `pairs`,
    which both forms have.

    mu, law    of the short form, as in Contact
    bodies     of the long form
    contacts   of the long form; every body belongs to at least one of them
    kind       'plane-strain', 'axisymmetric' (coordinates r, z) or 'solid'.
    thickness  depth of a plane-strain body [length].
    copies     how many mirror images make the whole body: 2 for a half model, 4 for a quarter.
               Forces, nodal forces and nodal areas are those of all the images together, as on the
               ring of an axisymmetric body.
    mirror     axes across whose planes of symmetry the bodies are halved, as in "x" or "xy";
               `copies` is then 2 for each unless it is given. None: where copies > 1, the planes
               are those on which supports hold the normal alone
    degree     of the displacement in every element: 1, linear, or 2, quadratic; 2 for nearly
               incompressible bodies, where linear elements lock.
    elements   default number of elements across the contact half-width, for parts whose mesh is a
               function.
    zone       first guess of the contact half-width [length]; None when the geometry fixes the
               contact zone.
    units      names of the units of length and stress, for the axes of figures
    reference  an exact solution to compare with (contactopt.analytic.Reference), or None.
    """

    name: str
    upper: Part | Rigid | HalfSpace | None = None
    lower: Part | Rigid | HalfSpace | None = None
    mu: float | Sequence[float] | np.ndarray | Callable[[np.ndarray], Any] | None = None
    kind: str = "plane-strain"
    thickness: float = 1.0
    copies: int = 1
    degree: int = 1
    law: str = "coulomb"
    elements: int = 16
    zone: float | None = None
    units: tuple[str, str] = ("length", "stress")
    reference: Any = field(default=None, compare=False)
    bodies: tuple[Part | Rigid | HalfSpace, ...] = ()
    contacts: tuple[Contact, ...] = ()
    mirror: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InputError(f"the scene's name must be a text; got {short(self.name)}.")
        if not isinstance(self.kind, str) or self.kind not in COMPONENTS:
            raise InputError(
                f"scene '{self.name}': unknown kind {self.kind!r}; choose from"
                f" {', '.join(COMPONENTS)}."
            )
        self._check_form()
        for part in self.parts:
            if not isinstance(part, (Part, Rigid, HalfSpace)):
                raise InputError(
                    f"scene '{self.name}': a body must be a Part, a Rigid or a HalfSpace; got"
                    f" {short(part)}."
                )
        check_number("the thickness", self.thickness, low=0.0)
        if self.zone is not None:
            check_number("the contact zone's half-width", self.zone, low=0.0)
        for name, count in (("elements", self.elements), ("copies", self.copies)):
            if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
                raise InputError(
                    f"scene '{self.name}': {name} must be a whole number of at least 1; got"
                    f" {count!r}."
                )
        if self.elements > MOST_ACROSS:
            raise InputError(
                f"scene '{self.name}': elements must be at most {MOST_ACROSS}; got {self.elements}."
            )
        if (
            isinstance(self.degree, bool)
            or not isinstance(self.degree, int)
            or self.degree not in (1, 2)
        ):
            raise InputError(
                f"scene '{self.name}': the degree of the displacement must be 1 or 2; got"
                f" {self.degree!r}."
            )
        self._check_mirror()
        self._check_pairs()
        for part in self.parts:
            self._check_part(part)

    @property
    def friction(self) -> str:
        """The laws and their numbers, for titles: 'mu = 0.3'."""
        return "; ".join(dict.fromkeys(pair.friction for pair in self.pairs))

    @property
    def parts(self) -> tuple[Part | Rigid | HalfSpace, ...]:
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
        """Change the bodies of a scene.

        Parameters
        ----------
        change : A function of a body that returns another one.

        Returns
        -------
        The scene with the bodies that it returned.
        """
        if self.upper is None or self.lower is None:
            return replace(self, bodies=tuple(change(part) for part in self.bodies))
        return replace(self, upper=change(self.upper), lower=change(self.lower))

    def surfaces_of(self, part: Any) -> tuple[str, ...]:
        """Name the boundaries of a part that contacts use.

        Parameters
        ----------
        part : One of the bodies.

        Returns
        -------
        The names, each once, in the order of the pairs.
        """
        return tuple(dict.fromkeys(name for name, _ in self._uses(part))) or (part.contact,)

    def laws_of(self, part: Any, boundary: str) -> set[str]:
        """Name the contact laws of the pairs that use a boundary.

        Parameters
        ----------
        part : One of the bodies.
        boundary : The name of one of its boundaries.

        Returns
        -------
        Their names; none for a boundary that no pair uses.
        """
        return {pair.law for name, pair in self._uses(part) if name == boundary}

    def _uses(self, part: Any) -> list[tuple[str, Contact]]:
        """The boundaries of a part that pairs use, each with its pair."""
        return [
            (surface or part.contact, pair)
            for pair in self.pairs
            for body, surface in zip(pair.bodies, pair.surfaces)
            if body == part.name
        ]

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
            not callable(m)
            for m in (*meshes, *(part.points for part in self.parts if isinstance(part, HalfSpace)))
        )

    def _check_form(self) -> None:
        """Either the short form is given in full or the long one."""
        for what, items in (("bodies", self.bodies), ("contacts", self.contacts)):
            if not isinstance(items, (tuple, list)):
                raise InputError(
                    f"scene '{self.name}': its {what} must be a tuple; got {type(items).__name__}."
                )
        filled = (self.upper is not None, self.lower is not None, self.mu is not None)
        if self.bodies or self.contacts:
            if any(filled) or self.law != "coulomb":
                raise InputError(
                    f"scene '{self.name}': give either upper, lower, mu and law, or bodies and"
                    " contacts, not both."
                )
            if not self.bodies or not self.contacts:
                raise InputError(
                    f"scene '{self.name}': bodies and contacts belong together; one of them is"
                    " empty."
                )
        elif not all(filled):
            raise InputError(
                f"scene '{self.name}': give upper, lower and mu, or bodies and contacts."
            )

    def _check_mirror(self) -> None:
        """Axes are known, named once, and agree with the number of copies, which they set if it was
        not given.
        """
        if self.mirror is None:
            return
        axes = [name for name in self.components if name != "r"]
        known = isinstance(self.mirror, str) and self.mirror and set(self.mirror) <= set(axes)
        if not known or len(set(self.mirror)) < len(self.mirror):
            raise InputError(
                f"scene '{self.name}': mirror names each axis once, of {', '.join(axes)}; got"
                f" {short(self.mirror)}."
            )
        if self.copies == 1:
            object.__setattr__(self, "copies", 2 ** len(self.mirror))
        if self.copies % 2 ** len(self.mirror):
            raise InputError(
                f"scene '{self.name}': mirror = {self.mirror!r} makes {2 ** len(self.mirror)}"
                f" images, but copies is {self.copies}; drop one of them."
            )

    def _check_pairs(self) -> None:
        """Names of bodies are known and not given twice; no pair twice; no body without a pair; no
        two rigid bodies.
        """
        names = [part.name for part in self.parts]
        for name in names:
            if names.count(name) > 1:
                raise InputError(
                    f"scene '{self.name}': two bodies are named '{name}'; give each its own name."
                )
        pairs = self.pairs
        for pair in pairs:
            if not isinstance(pair, Contact):
                raise InputError(
                    f"scene '{self.name}': contacts must be Contact objects; got {pair!r}."
                )
            for name in pair.bodies:
                if name not in names:
                    raise InputError(
                        f"scene '{self.name}': contact '{pair.name}' names a body '{name}' that is"
                        f" not there; the bodies are {', '.join(names)}."
                    )
            if [other.name for other in pairs].count(pair.name) > 1:
                raise InputError(f"scene '{self.name}': contact '{pair.name}' is given twice.")
            rigid = [isinstance(self.parts[names.index(name)], Rigid) for name in pair.bodies]
            for name, surface, stiff in zip(pair.bodies, pair.surfaces, rigid):
                if stiff and surface is not None:
                    raise InputError(
                        f"scene '{self.name}': rigid body '{name}' has no surface {surface!r}; name"
                        " the body alone."
                    )
            if all(rigid):
                raise InputError(
                    f"scene '{self.name}': both bodies of contact '{pair.name}' are rigid; at least"
                    " one must be elastic."
                )
        for name in names:
            if not any(name in pair.bodies for pair in pairs):
                raise InputError(
                    f"scene '{self.name}': body '{name}' belongs to no contact; drop it or give it"
                    " one."
                )

    def _check_part(self, part: Part | Rigid | HalfSpace) -> None:
        if not isinstance(part, Part):
            force, displacement = part.force or {}, part.displacement or {}
            self._check_components(part.name, force)
            self._check_components(part.name, displacement)
            if set(force) & set(displacement):
                raise InputError(
                    f"body '{part.name}': a component can have a force or a displacement, not both."
                )
        if isinstance(part, HalfSpace):
            return
        if isinstance(part, Rigid):
            if part.normal is not None:
                if len(part.normal) != self.dim or not np.any(part.normal):
                    raise InputError(
                        f"rigid body '{part.name}': its normal needs {self.dim} values, not all"
                        " zero."
                    )
                for value in part.normal:
                    check_number(f"every value of the normal of rigid body '{part.name}'", value)
            return
        for support in part.supports:
            self._check_components(
                part.name, {} if support.displacement is None else support.displacement
            )
        for load in part.loads:
            if isinstance(load, Plate):
                self._check_components(part.name, load.force)
            elif (
                not isinstance(load.value, (tuple, list, np.ndarray))
                or not np.iterable(load.value)
                or len(load.value) != self.dim
            ):
                raise InputError(
                    f"body '{part.name}': a {type(load).__name__} needs a tuple of {self.dim}"
                    f" values ({', '.join(self.components)}); got {short(load.value)}."
                )
            else:
                for value in load.value:
                    check_number(
                        f"every {type(load).__name__} value of body '{part.name}'",
                        value,
                        -LARGEST_VALUE,
                        LARGEST_VALUE,
                    )

    def _check_components(self, body: str, values: Mapping[str, float]) -> None:
        if not isinstance(values, Mapping):
            raise InputError(
                f"body '{body}': a value is given for each component by its name, as in "
                f"{{{self.components[-1]!r}: 0.0}}; got {short(values)}."
            )
        for component, value in values.items():
            if component not in self.components:
                others = [kind for kind, names in COMPONENTS.items() if component in names]
                remedy = f", or give the scene kind={others[-1]!r}" if others else ""
                raise InputError(
                    f"body '{body}': there is no component {component!r}; use"
                    f" {', '.join(self.components)}, which are those of kind {self.kind!r}{remedy}."
                )
            check_number(
                f"the {component} value of body '{body}'", value, -LARGEST_VALUE, LARGEST_VALUE
            )
