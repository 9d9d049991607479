"""A bolt or clamp: two faces are pulled together with a given force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.checks import check_name, check_size, real_array, short
from contactopt.defaults import ROUNDED
from contactopt.errors import InputError
from contactopt.scenes.kinds import KINDS
from contactopt.scenes.loads.load import Face, Load
from contactopt.scenes.loads.plate import Plate
from contactopt.scenes.loads.traction import Traction

if TYPE_CHECKING:
    from contactopt.scenes.matrix_part import AnyPart
    from contactopt.scenes.scene import Part

SLANTED = 1e-3  # cosine between a normal and a direction that lies in the face


@dataclass(frozen=True)
class Bolt:
    """A bolt or clamp that pulls two faces of meshed bodies together.

    It is a pair of equal and opposite forces on the faces, which do not change as the bodies move.

    between    the two faces, each 'BODY.BOUNDARY'
    force      with which they are pulled together, at least 0 [force]; that of all mirror images
               together, or of the whole ring
    name       in the parameter bolt:NAME and in messages; '': bolt1 for the first of the scene, ...
    tilting    whether a face may tilt and bend: the force is spread evenly over its area. If not,
               the face is stiff and stays parallel, as under a stiff head
    direction  of the axis, one number per component; None: the mean normals of the faces, which
               are then opposite to each other
    """

    between: tuple[str, str]
    force: float
    name: str = ""
    tilting: bool = True
    direction: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        faces = self.between
        pair = isinstance(faces, (tuple, list)) and len(faces) == 2 and faces[0] != faces[1]
        if not pair or not all(isinstance(face, str) for face in faces):
            raise InputError(
                "a bolt is between two faces, as in between = ('upper.top', 'lower.bottom'); got"
                f" {short(faces)}."
            )
        if self.name:
            check_name("the bolt's name", self.name)

    def ends(self, parts: Sequence[Any], name: str) -> list[tuple[str, BoltEnd]]:
        """Its two loads, each with its body's name. InputError unless both have meshes."""
        made = []
        for face in self.between:
            found = [p for p in parts if face.startswith((f"{p.name}.", f"{p.name}:"))]
            if not found:
                names = ", ".join(part.name for part in parts)
                raise InputError(
                    f"bolt '{self.name or name}': {face!r} begins with the name of no body; write"
                    f" 'BODY.BOUNDARY' with one of the bodies {names}."
                )
            body = max((part for part in found), key=lambda part: len(part.name))
            if not body.meshed:
                raise InputError(
                    f"bolt '{self.name or name}': body '{body.name}' has no mesh and no faces; give"
                    " it a force instead."
                )
            boundary = face[len(body.name) + 1 :]
            end = BoltEnd(boundary, self.name or name, self.force, self.tilting, self.direction)
            made.append((body.name, end))
        return made


@dataclass(frozen=True)
class BoltEnd(Load):
    """What a bolt does to one of its faces, which it pulls against the outward normal; a scene
    makes it of a Bolt.
    """

    what = "bolt"
    form = "bolt:NAME"
    total = True
    shared = True
    boundary: str
    name: str
    pull: float
    tilting: bool = True
    direction: tuple[float, ...] | None = None

    def address(self, body: str) -> tuple[str, ...]:
        return (self.name,)

    def values(self, components: tuple[str, ...]) -> dict[str, float]:
        return {"": self.pull}

    def with_values(self, values: Mapping[str, float]) -> BoltEnd:
        return replace(self, pull=values.get("", self.pull))

    def check(self, body: str, kind: str) -> None:
        check_size(f"the force of bolt '{self.name}'", self.pull)
        if self.pull < 0:
            raise InputError(
                f"bolt '{self.name}' pulls its faces together, so that its force is at least 0; got"
                f" {self.pull:g}. A pressure on each face pushes them apart."
            )
        if self.direction is None:
            return
        way = real_array(f"the direction of bolt '{self.name}'", self.direction)
        if way.shape != (len(KINDS[kind].components),) or not way.any():
            raise InputError(
                f"the direction of bolt '{self.name}' needs {len(KINDS[kind].components)} values,"
                f" not all zero; got {short(self.direction)}."
            )

    def resultant(self, components: tuple[str, ...], n: np.ndarray) -> np.ndarray:
        if self.direction is None:
            n = np.where(np.abs(n) > ROUNDED, n, 0.0)  # rounding may move a face that nothing holds
            return np.asarray(-self.pull * n)
        way = np.asarray(self.direction, dtype=float)
        way = way / np.linalg.norm(way)
        if abs(way @ n) < SLANTED:
            raise InputError(
                f"the direction of bolt '{self.name}' lies in the face {self.boundary!r}; give one"
                " that points out of it."
            )
        return np.asarray(-self.pull * np.sign(way @ n) * way)

    def on(self, face: Face) -> Load:
        force = self.resultant(face.components, face.normal)
        if self.tilting:
            return Traction(self.boundary, tuple(force / face.area))
        own = {c: float(f) for c, f in zip(face.components, force)}
        held = [c for c in own if c in face.held and abs(own[c]) > ROUNDED * self.pull]
        if held:
            raise InputError(
                f"bolt '{self.name}' keeps the face {self.boundary!r} parallel and moves it along"
                f" {held[0]}, but a support holds one of its nodes along {held[0]}; let the bolt"
                " tilt, or name another face."
            )
        return Plate(self.boundary, {c: f for c, f in own.items() if c not in face.held})

    def words(self, components: tuple[str, ...]) -> str:
        stiff = "" if self.tilting else ", and stays parallel"
        return f"bolt '{self.name}' on '{self.boundary}': pulls with {self.pull:g}{stiff}"


def with_bolts(parts: Sequence[Any], bolts: Sequence[Bolt]) -> tuple[Any, ...]:
    """The bodies with these bolts in place of those that they had."""
    if not isinstance(bolts, (tuple, list)) or not all(isinstance(own, Bolt) for own in bolts):
        raise InputError(f"bolts must be a tuple of Bolt objects; got {short(bolts)}.")
    ends = [end for i, own in enumerate(bolts, 1) for end in own.ends(parts, f"bolt{i}")]

    def bolted(part: AnyPart) -> AnyPart:
        if not part.meshed:
            return part
        own = tuple(load for load in part.loads if not load.shared)
        return replace(part, loads=own + tuple(end for name, end in ends if name == part.name))

    return tuple(map(bolted, parts))


def stiff_faces(ends: Mapping[str, Sequence[tuple[Part, BoltEnd]]], body: str) -> dict[str, str]:
    """In words the bolts that keep faces of a body parallel, by the plates there."""
    found: dict[str, str] = {}
    for name, both in ends.items():
        for part, end in both:
            if part.name == body and not end.tilting:
                plate = f"plate '{end.boundary}'"
                before = found.get(plate, "").partition(", whose")[0]
                names = f"{before} and bolt '{name}'" if before else f"bolt '{name}'"
                found[plate] = f"{names}, whose face {end.boundary!r} stays parallel,"
    return found
