"""What to model: bodies, supports, loads and the contact between them.

No equations, no degrees of freedom. Everything here is frozen and checked when it is made. The unit
system is the user's; the named scenes (contactopt.scenes) use newton, millimetre and megapascal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.checks import check_number, check_size, short
from contactopt.errors import InputError
from contactopt.scenes.body_kinds import HalfSpace, Part, Rigid, Support
from contactopt.scenes.body_shapes import LENGTHS
from contactopt.scenes.contact import Contact
from contactopt.scenes.kinds import KINDS, Kind
from contactopt.scenes.loads.body_force import BodyForce
from contactopt.scenes.loads.bolt import Bolt, BoltEnd, with_bolts
from contactopt.scenes.loads.plate import Plate
from contactopt.scenes.loads.pressure import Pressure
from contactopt.scenes.loads.traction import Traction
from contactopt.scenes.material_library import STRESSES
from contactopt.scenes.matrix_part import AnyPart, MatrixPart

if TYPE_CHECKING:
    from contactopt.analytic import Reference

__all__ = [
    "BodyForce",
    "Bolt",
    "HalfSpace",
    "Part",
    "Plate",
    "Pressure",
    "Rigid",
    "Scene",
    "Support",
    "Traction",
]
MOST_ACROSS = 100_000  # elements across the contact half-width


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
    kind       'plane-strain', 'plane-stress', 'axisymmetric' (coordinates r, z) or 'solid'.
    thickness  depth of a body in the plane [length].
    copies     how many mirror images make the whole body: 2 for a half model, 4 for a quarter.
               Forces, nodal forces and nodal areas are those of all the images together, as on the
               ring of an axisymmetric body.
    mirror     axes across whose planes of symmetry the bodies are halved, as in "x" or "xy";
               `copies` is then 2 for each unless it is given. None: where copies > 1, the planes
               are those on which supports hold the normal alone
    state      name of the step of a load path to which this state belongs
    degree     of the displacement in every element: 1, linear, or 2, quadratic; 2 for nearly
               incompressible bodies, where linear elements lock. By default that of the meshes: 2
               if one that is given has elements of second order, else 1.
    elements   default number of elements across the contact half-width, for parts whose mesh is a
               function.
    zone       first guess of the contact half-width [length]; None when the geometry fixes the
               contact zone.
    units      names of the units of length and stress, for figures and for checks of sizes. Any
               names, but those of contactopt.scenes.body_shapes.LENGTHS and
               contactopt.scenes.material_library.STRESSES are written as there: MPa, not mpa
    reference  an exact solution to compare with (contactopt.analytic.Reference), or None.
    """

    name: str
    upper: AnyPart | None = None
    lower: AnyPart | None = None
    mu: float | Sequence[float] | np.ndarray | Callable[[np.ndarray], Any] | None = None
    kind: str = "plane-strain"
    thickness: float = 1.0
    copies: int = 1
    degree: int = None  # type: ignore[assignment]  # that of the meshes, set when it is made
    law: str = "coulomb"
    elements: int = 16
    zone: float | None = None
    units: tuple[str, str] = ("length", "stress")
    reference: Reference | None = field(default=None, compare=False)
    bodies: tuple[AnyPart, ...] = ()
    contacts: tuple[Contact, ...] = ()
    mirror: str | None = None
    state: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise InputError(f"the scene's name must be a text; got {short(self.name)}.")
        if not isinstance(self.kind, str) or self.kind not in KINDS:
            raise self._wrong(f"unknown kind {self.kind!r}; choose from {', '.join(KINDS)}.")
        self._check_form()
        for part in self.parts:
            if not isinstance(part, AnyPart):
                raise self._wrong(
                    "a body must be a Part, a MatrixPart, a Rigid or a HalfSpace; got"
                    f" {short(part)}."
                )
        check_size("the thickness", self.thickness, low=0.0)
        if self.zone is not None:
            check_number("the contact zone's half-width", self.zone, low=0.0)
        for name, count in (("elements", self.elements), ("copies", self.copies)):
            if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
                raise self._wrong(f"{name} must be a whole number of at least 1; got {count!r}.")
        if self.elements > MOST_ACROSS:
            raise self._wrong(f"elements must be at most {MOST_ACROSS}; got {self.elements}.")
        if self.degree is None:
            object.__setattr__(self, "degree", 2 if any(map(_curved, self.parts)) else 1)
        if type(self.degree) is not int or self.degree not in (1, 2):
            raise self._wrong(
                f"the degree of the displacement must be 1 or 2; got {self.degree!r}."
            )
        check_units(self.units)
        self._check_mirror()
        self._check_pairs()
        for part in self.parts:
            part.check_in(self.kind)
        for name, ends in self.bolt_ends.items():
            if len(ends) != 2:
                raise self._wrong(
                    f"bolt '{name}' has {len(ends)} ends; give each bolt its own name."
                )

    def _repr_html_(self) -> str:
        # the one look upwards of this room, taken only where a notebook shows a scene
        from contactopt.figures.notebook import scene_page

        return scene_page(self)

    def _wrong(self, why: str) -> InputError:
        return InputError(f"scene '{self.name}': {why}")

    @property
    def friction(self) -> str:
        """The laws and their numbers as words for titles, such as 'mu = 0.3'."""
        return "; ".join(dict.fromkeys(pair.friction for pair in self.pairs))

    @property
    def parts(self) -> tuple[AnyPart, ...]:
        """The bodies; in the short form the upper one first."""
        if self.upper is None or self.lower is None:
            return self.bodies
        return self.upper, self.lower

    @property
    def meshed(self) -> dict[str, Part]:
        """The bodies with meshes, by their names."""
        return {part.name: part for part in self.parts if isinstance(part, Part)}

    @property
    def rigid(self) -> dict[str, Rigid]:
        """The rigid bodies, by their names."""
        return {part.name: part for part in self.parts if isinstance(part, Rigid)}

    @property
    def pairs(self) -> tuple[Contact, ...]:
        """The pairs of surfaces that may touch."""
        if self.upper is None or self.lower is None or self.mu is None:
            return self.contacts
        return (Contact(self.upper.name, self.lower.name, self.mu, self.law),)

    def with_parts(self, change: Callable[[Any], Any]) -> Scene:
        """The scene with the bodies that a function makes of its bodies."""
        if self.upper is None or self.lower is None:
            return replace(self, bodies=tuple(change(part) for part in self.bodies))
        return replace(self, upper=change(self.upper), lower=change(self.lower))

    @property
    def bolt_ends(self) -> dict[str, list[tuple[Part, BoltEnd]]]:
        """The loads that are ends of bolts, each with its body, by the name of the bolt."""
        found: dict[str, list[tuple[Part, Any]]] = {}
        for part in self.meshed.values():
            for load in part.loads:
                if load.shared:
                    found.setdefault(load.address(part.name)[0], []).append((part, load))
        return found

    @property
    def bolts(self) -> tuple[Bolt, ...]:
        """The bolts between the bodies, as their loads have them."""
        made = []
        for name, ((one, first), (other, last)) in self.bolt_ends.items():
            faces = f"{one.name}.{first.boundary}", f"{other.name}.{last.boundary}"
            made.append(Bolt(faces, first.pull, name, first.tilting, first.direction))
        return tuple(made)

    def with_bolts(self, bolts: Sequence[Bolt]) -> Scene:
        """The scene with these bolts in place of its own; their ends become loads of the bodies."""
        bolted = {part.name: part for part in with_bolts(self.parts, bolts)}
        return self.with_parts(lambda part: bolted[part.name])

    def surfaces_of(self, part: Part | MatrixPart) -> tuple[str, ...]:
        """The boundaries of a part that contacts use, each once, in the order of the pairs."""
        return tuple(dict.fromkeys(name for name, _ in self._uses(part))) or (part.contact,)

    def laws_of(self, part: Part | MatrixPart, boundary: str) -> set[str]:
        """The contact laws of the pairs that use a boundary; none where no pair uses it."""
        return {pair.law for name, pair in self._uses(part) if name == boundary}

    def _uses(self, part: Part | MatrixPart) -> list[tuple[str, Contact]]:
        """The boundaries of a part that pairs use, each with its pair."""
        return [
            (surface or part.contact, pair)
            for pair in self.pairs
            for body, surface in zip(pair.bodies, pair.surfaces)
            if body == part.name
        ]

    @property
    def analysis(self) -> Kind:
        """What follows from the kind of the scene."""
        return KINDS[self.kind]

    @property
    def components(self) -> tuple[str, ...]:
        return self.analysis.components

    @property
    def dim(self) -> int:
        return len(self.components)

    @property
    def given(self) -> bool:
        """Whether the mesh of a body is given, and not made for a number of elements."""
        return any(part.given for part in self.parts)

    def _check_form(self) -> None:
        """Either the short form is given in full or the long one."""
        for what, items in (("bodies", self.bodies), ("contacts", self.contacts)):
            if not isinstance(items, (tuple, list)):
                raise self._wrong(f"its {what} must be a tuple; got {type(items).__name__}.")
        filled = (self.upper is not None, self.lower is not None, self.mu is not None)
        if self.bodies or self.contacts:
            if any(filled) or self.law != "coulomb":
                raise self._wrong(
                    "give either upper, lower, mu and law, or bodies and contacts, not both."
                )
            if not self.bodies or not self.contacts:
                raise self._wrong("bodies and contacts belong together; one of them is empty.")
        elif not all(filled):
            raise self._wrong("give upper, lower and mu, or bodies and contacts.")

    def _check_mirror(self) -> None:
        """Axes are known and named once. They set the number of copies, or agree with it."""
        if self.mirror is None:
            return
        axes = [name for name in self.components if name != "r"]
        known = isinstance(self.mirror, str) and self.mirror and set(self.mirror) <= set(axes)
        if not known or len(set(self.mirror)) < len(self.mirror):
            raise self._wrong(
                f"mirror names each axis once, of {', '.join(axes)}; got {short(self.mirror)}."
            )
        if self.copies == 1:
            object.__setattr__(self, "copies", 2 ** len(self.mirror))
        if self.copies % 2 ** len(self.mirror):
            raise self._wrong(
                f"mirror = {self.mirror!r} makes {2 ** len(self.mirror)} images, but copies is"
                f" {self.copies}; drop one of them."
            )

    def _check_once(self) -> None:
        """No two surfaces are joined twice: both pairs would carry a part of one force."""
        contact = {part.name: getattr(part, "contact", None) for part in self.parts}
        known: dict[frozenset[tuple[str, str | None]], Contact] = {}
        for pair in self.pairs:
            sides = zip(pair.bodies, pair.surfaces)
            same = known.setdefault(frozenset((b, s or contact[b]) for b, s in sides), pair)
            if same is not pair:
                raise self._wrong(
                    f"contacts '{same.name}' and '{pair.name}' join the same two surfaces, and"
                    " each would carry a part of their force; keep one of them."
                )

    def _check_pairs(self) -> None:
        """Names are known and given once, each body is in a pair, no pair is of rigid bodies."""
        names = [part.name for part in self.parts]
        for name in names:
            if names.count(name) > 1:
                raise self._wrong(f"two bodies are named '{name}'; give each its own name.")
        pairs = self.pairs
        for pair in pairs:
            if not isinstance(pair, Contact):
                raise self._wrong(f"contacts must be Contact objects; got {pair!r}.")
            for name in pair.bodies:
                if name not in names:
                    raise self._wrong(
                        f"contact '{pair.name}' names a body '{name}' that is not there; the"
                        f" bodies are {', '.join(names)}."
                    )
            if [other.name for other in pairs].count(pair.name) > 1:
                raise self._wrong(f"contact '{pair.name}' is given twice.")
            rigid = [not self.parts[names.index(name)].elastic for name in pair.bodies]
            for name, surface, stiff in zip(pair.bodies, pair.surfaces, rigid):
                if stiff and surface is not None:
                    raise self._wrong(
                        f"rigid body '{name}' has no surface {surface!r}; name the body alone."
                    )
            if all(rigid):
                raise self._wrong(
                    f"both bodies of contact '{pair.name}' are rigid; at least one must be elastic."
                )
        self._check_once()
        for name in names:
            if not any(name in pair.bodies for pair in pairs):
                raise self._wrong(f"body '{name}' belongs to no contact; drop it or give it one.")


def check_units(units: object) -> None:
    """Raise InputError unless these are the names of units of length and of stress."""
    if not isinstance(units, (tuple, list)) or len(units) != 2:
        raise InputError(
            f"the units of a scene are two names, as in ('mm', 'MPa'); got {short(units)}."
        )
    length, stress = units
    if length in STRESSES or stress in LENGTHS:
        raise InputError(
            f"the units of a scene are that of length and then that of stress; {short(units)} are"
            " in the other order."
        )
    for what, name, known in zip(("length", "stress"), units, (LENGTHS, STRESSES)):
        if not isinstance(name, str) or not name.strip():
            raise InputError(f"the unit of {what} must have a name; got {short(name)}.")
        same = [own for own in known if own.lower() == name.strip().lower()]
        if same and name not in same:
            raise InputError(f"there is no unit of {what} {name!r}; did you mean {same[0]!r}?")


def _curved(part: AnyPart) -> bool:
    """Whether a body has a given mesh of second order."""
    mesh = getattr(part, "mesh", None)
    if not hasattr(mesh, "nvertices"):
        return False
    from contactopt.meshes.cells import is_curved

    return is_curved(mesh)
