"""The parameters of a scene by name: what a gradient is taken by, and what is fitted or designed.

    E, E:BODY                                Young's modulus of all elastic bodies together, or of
                                             one [stress]
    nu, nu:BODY                              Poisson's ratio [-]
    mu, mu:PAIR                              friction of all pairs of surfaces together, or of one,
                                             where it is a number
    force:BODY:COMPONENT                     total force of the plate of a body, or on a rigid body
                                             or half-space [force]
    displacement:BODY:BOUNDARY:COMPONENT     of a support [length]; of a rigid body or half-space
                                             without the boundary
    traction:BODY:BOUNDARY:COMPONENT         surface force per area [stress]
    pressure:BODY:BOUNDARY                   pressure along the normals [stress]
    bolt:NAME                                force with which it pulls its faces together [force]
    weight:BODY:COMPONENT                    force per volume [force / length^3]
    gap                                      the initial gap, one number per contact (k,) [length];
                                             gradients only
    friction                                 the parameter of the law, one number per contact (k,);
                                             gradients only

A body with several plates needs the boundary in force:BODY:BOUNDARY:COMPONENT as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.problem.laws import find_law
from contactopt.scenes.body_kinds import Support
from contactopt.scenes.loads import Load, load_classes
from contactopt.scenes.loads.bolt import BoltEnd
from contactopt.scenes.scene import Scene

if TYPE_CHECKING:
    from contactopt.scenes.contact import Contact
    from contactopt.scenes.matrix_part import AnyPart

MATERIAL = ("E", "nu")
FIELDS = ("gap", "friction")
# of what holds and loads bodies
FORM = {
    form.partition(":")[0]: form
    for form in (Support.form, BoltEnd.form, *(load.form for load in load_classes().values()))
}


@dataclass(frozen=True)
class Parameter:
    """One parameter by the parts of its name, as at the top of this module.

    owner  the name of a body or of a pair; empty for all of them
    """

    name: str
    kind: str
    owner: str = ""
    boundary: str = ""
    component: str = ""

    @property
    def is_field(self) -> bool:
        """Whether it has one number per contact."""
        return self.kind in FIELDS

    def concerns(self, part: AnyPart) -> bool:
        """Whether it is a constant of the material of that body, or one of its loads."""
        return self.kind in (*MATERIAL, *FORM) and self.owner in ("", part.name)

    def read(self, scene: Scene) -> float:
        """Its value in a scene; InputError where it does not enter."""
        found = [value for part in scene.parts for value in self._in_part(part, scene)[0]]
        if self.kind == "mu":
            found = [self._friction(pair) for pair in self.pairs(scene)]
        if not found:
            raise InputError(
                f"parameter '{self.name}' does not enter scene '{scene.name}':"
                f" {self._missing(scene)}."
            )
        if len(set(found)) > 1:
            raise InputError(
                f"parameter '{self.name}' has different values in scene '{scene.name}':"
                f" {', '.join(f'{v:g}' for v in found)}; name one body or pair, as in"
                f" '{self.kind}:{(scene.pairs if self.kind == 'mu' else scene.parts)[0].name}'."
            )
        return found[0]

    def put(self, scene: Scene, value: float) -> Scene:
        """The scene with another value of the parameter; its meshes stay as they are."""
        self.read(scene)
        if self.kind != "mu":
            return scene.with_parts(lambda part: self._in_part(part, scene, value)[1])
        if scene.upper is not None:
            return replace(scene, mu=value)
        named = {pair.name for pair in self.pairs(scene)}
        changed = (
            replace(pair, mu=value) if pair.name in named else pair for pair in scene.contacts
        )
        return replace(scene, contacts=tuple(changed))

    def pairs(self, scene: Scene) -> list[Any]:
        """The pairs of surfaces whose friction it is."""
        rough = [pair for pair in scene.pairs if find_law(pair.law).frictional]
        return [pair for pair in rough if self.owner in ("", pair.name)]

    def _friction(self, pair: Any) -> float:
        if np.ndim(pair.mu) or callable(pair.mu):
            raise InputError(
                f"the friction of contact '{pair.name}' is no single number; take the parameter"
                " 'friction', which has one number per contact."
            )
        return float(pair.mu)

    def _in_part(
        self, part: Any, scene: Scene, value: float | None = None
    ) -> tuple[list[float], Any]:
        """Its values in one body, one unless its name is ambiguous; the body with another value."""
        material: Any = getattr(part, "material", None)
        if not self.concerns(part) or (self.kind in MATERIAL and material is None):
            return [], part
        if self.kind in MATERIAL:
            if value is not None:
                check_number(self.kind, value)
                part = replace(part, material=replace(material, **{self.kind: value}))
            return [float(getattr(material, self.kind))], part
        if not hasattr(part, "supports"):
            return self._in_item(part, self._held_as_one(part), value)
        found: list[float] = []
        changes = {}
        for name in ("supports", "loads"):
            items = getattr(part, name)
            held = (self._held(item, part.name, scene) for item in items)
            rows = [self._in_item(item, own, value) for item, own in zip(items, held)]
            found += [known for own, _ in rows for known in own]
            changes[name] = tuple(item for _, item in rows)
        return found, replace(part, **changes) if found and value is not None else part

    def _in_item(
        self, item: Any, held: Mapping[str, float], value: float | None
    ) -> tuple[list[float], Any]:
        """Its value in what holds or loads a body by component, and that with another value."""
        if self.component not in held:
            return [], item
        if value is not None:
            made = dict(held) | {self.component: value}
            whole = not hasattr(item, "boundary")  # a body
            item = replace(item, **{self.kind: made}) if whole else item.with_values(made)
        return [float(held[self.component])], item

    def _held_as_one(self, part: Any) -> Mapping[str, float]:
        """The force or the displacement of a rigid body or a half-space, if it is one of them."""
        force, held = part.force or {}, part.displacement or {}
        if self.kind == "force":
            return dict(force)
        if self.kind != "displacement" or self.boundary or self.component in force:
            return {}
        return {self.component: 0.0} | dict(held)

    def _held(self, item: Support | Load, body: str, scene: Scene) -> Mapping[str, float]:
        """The values of a support or load of a body by component, if it is one of them."""
        there = item.address(body) == tuple(filter(None, (self.owner, self.boundary)))
        there |= self.kind == "force" and not self.boundary
        own = item.form.partition(":")[0] == self.kind
        return item.values(scene.components) if own and there else {}

    def _missing(self, scene: Scene) -> str:
        named: Sequence[Contact | AnyPart] = scene.pairs if self.kind == "mu" else scene.parts
        names = [one.name for one in named]
        if self.owner and self.owner not in names:
            return (
                f"it has no {'contact' if self.kind == 'mu' else 'body'}"
                f" '{self.owner}', only {', '.join(names)}"
            )
        if self.kind == "mu":
            return "its contacts have no friction"
        if self.kind in MATERIAL:
            if not self.owner:
                return "it has no elastic body"
            rigid = self.owner in scene.rigid
            return f"body '{self.owner}' {'is rigid' if rigid else 'has matrices and no material'}"
        whose = f"body '{self.owner}'" if self.owner else "it"
        return f"{whose} has no such {self.kind}"


def parameter(name: object, scene: Scene) -> Parameter:
    """Find one parameter of a scene by its name, in a form listed at the top.

    InputError if the name is unknown or what it names does not enter the scene.
    """
    if not isinstance(name, str) or not name:
        raise InputError(
            f"a parameter is given by its name, such as 'mu' or 'E:upper'; got {name!r}."
        )
    kind, *rest = name.split(":")
    if kind in FIELDS and not rest:
        return Parameter(name, kind)
    plain = kind in FORM and "COMPONENT" not in FORM[kind]  # a number without a direction
    if len(rest) == FORM[kind].count(":") if plain else kind in (*MATERIAL, "mu") and len(rest) < 2:
        made = Parameter(name, kind, *(["", *rest] if plain else rest)[-2:])
    elif "COMPONENT" in FORM.get(kind, "") and len(rest) in (2, 3):
        made = Parameter(name, kind, rest[0], rest[1] if len(rest) == 3 else "", rest[-1])
        if made.component not in scene.components:
            raise InputError(
                f"parameter '{name}': there is no component {made.component!r}; write {FORM[kind]}"
                f" with one of {', '.join(scene.components)}."
            )
    else:
        forms = ", ".join(
            ("E", "nu", "mu", "gap", "friction", *(form.rstrip(",") for form in FORM.values()))
        )
        raise InputError(f"unknown parameter {name!r}; choose from {forms}.")
    made.read(scene)
    return made


def parameters(names: str | Iterable[str], scene: Scene) -> tuple[Parameter, ...]:
    """Find the parameters of a scene by their names, one or several, in their order.

    InputError if a parameter is named twice or does not enter the scene, or if none is named.
    """
    if isinstance(names, str):
        names = (names,)
    found = tuple(parameter(name, scene) for name in names)
    if len({one.name for one in found}) < len(found) or not found:
        raise InputError("name at least one parameter, and each of them once.")
    return found


def put_all(scene: Scene, values: Mapping[Parameter, float]) -> Scene:
    """Give a scene other values of several parameters, in the units of each."""
    for which, value in values.items():
        scene = which.put(scene, float(value))
    return scene
