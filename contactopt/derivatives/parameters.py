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
    weight:BODY:COMPONENT                    force per volume [force / length^3]
    gap                                      the initial gap, one number per contact (k,) [length];
                                             gradients only
    friction                                 the parameter of the law, one number per contact (k,);
                                             gradients only

A body with several plates needs the boundary in force:BODY:BOUNDARY:COMPONENT as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contactopt.checks import check_number
from contactopt.errors import InputError
from contactopt.material import Material
from contactopt.scenes.scene import BodyForce, HalfSpace, Plate, Rigid, Scene, Support, Traction

MATERIAL = ("E", "nu")
LOADS = ("force", "displacement", "traction", "weight")
FIELDS = ("gap", "friction")
FORM = {
    "force": "force:BODY:COMPONENT",
    "displacement": (
        "displacement:BODY:BOUNDARY:COMPONENT, or displacement:BODY:COMPONENT of a rigid body,"
    ),
    "traction": "traction:BODY:BOUNDARY:COMPONENT",
    "weight": "weight:BODY:COMPONENT",
}


@dataclass(frozen=True)
class Parameter:
    """One parameter by the parts of its name, as in the head of this module.

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

    def concerns(self, part: Any) -> bool:
        """Whether it is a constant of the material of that body, or one of its loads."""
        return self.kind in (*MATERIAL, *LOADS) and self.owner in ("", part.name)

    def read(self, scene: Scene) -> float:
        """Its value in a scene; InputError where it does not enter."""
        found = [value for part in scene.parts for value in self._values(part, scene)]
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
            return scene.with_parts(lambda part: self._changed(part, scene, value))
        if scene.upper is not None:
            return replace(scene, mu=value)
        named = {pair.name for pair in self.pairs(scene)}
        changed = (
            replace(pair, mu=value) if pair.name in named else pair for pair in scene.contacts
        )
        return replace(scene, contacts=tuple(changed))

    def pairs(self, scene: Scene) -> list[Any]:
        """The pairs of surfaces whose friction it is."""
        return [
            pair
            for pair in scene.pairs
            if self.owner in ("", pair.name) and pair.law not in ("frictionless", "tied")
        ]

    def _friction(self, pair: Any) -> float:
        if np.ndim(pair.mu) or callable(pair.mu):
            raise InputError(
                f"the friction of contact '{pair.name}' is no single number; take the parameter"
                " 'friction', which has one number per contact."
            )
        return float(pair.mu)

    def _values(self, part: Any, scene: Scene) -> list[float]:
        """Its values in one body: none or one, unless the name is ambiguous."""
        if self.kind in MATERIAL:
            named = self.owner in ("", part.name) and not isinstance(part, Rigid)
            return [float(getattr(part.material, self.kind))] if named else []
        if self.kind not in LOADS or part.name != self.owner:
            return []
        if isinstance(part, (Rigid, HalfSpace)):
            held: Mapping[str, float] = (
                part.force if self.kind == "force" else part.displacement
            ) or {}
            movable = (
                self.kind == "displacement"
                and self.component not in (part.force or {})
                and not self.boundary
            )
            given = self.kind == "force" and self.component in held
            return [float(held.get(self.component, 0.0))] if given or movable else []
        place = scene.components.index(self.component)
        return [
            self._value_of(item, scene, place)
            for item in (*part.supports, *part.loads)
            if self._is(item)
        ]

    def _is(self, item: Any) -> bool:
        """Whether a support or load of the body is the one that is meant."""
        kind = {"force": Plate, "displacement": Support, "traction": Traction, "weight": BodyForce}[
            self.kind
        ]
        if not isinstance(item, kind):
            return False
        if isinstance(item, Plate):
            return self.component in item.force and self.boundary in ("", item.boundary)
        if isinstance(item, Support):
            known = item.displacement is None or self.component in item.displacement
            return known and item.boundary == self.boundary
        return isinstance(item, BodyForce) or (
            isinstance(item, Traction) and item.boundary == self.boundary
        )

    def _value_of(self, item: Any, scene: Scene, place: int) -> float:
        if isinstance(item, Plate):
            return float(item.force[self.component])
        if isinstance(item, Support):
            return float((item.displacement or {}).get(self.component, 0.0))
        return float(item.value[place])

    def _changed(self, part: Any, scene: Scene, value: float) -> Any:
        if not self._values(part, scene):
            return part
        if self.kind in MATERIAL:
            return replace(part, material=_material(part.material, self.kind, value))
        if isinstance(part, (Rigid, HalfSpace)):
            old = (part.force if self.kind == "force" else part.displacement) or {}
            values = dict(old) | {self.component: value}
            return (
                replace(part, force=values)
                if self.kind == "force"
                else replace(part, displacement=values)
            )
        place = scene.components.index(self.component)

        def put(item: Any) -> Any:
            if not self._is(item):
                return item
            if isinstance(item, Plate):
                return replace(item, force=dict(item.force) | {self.component: value})
            if isinstance(item, Support):
                held = (
                    dict.fromkeys(scene.components, 0.0)
                    if item.displacement is None
                    else dict(item.displacement)
                )
                return replace(item, displacement=held | {self.component: value})
            return replace(
                item, value=tuple(value if i == place else v for i, v in enumerate(item.value))
            )

        return replace(
            part, supports=tuple(map(put, part.supports)), loads=tuple(map(put, part.loads))
        )

    def _missing(self, scene: Scene) -> str:
        names = (
            [pair.name for pair in scene.pairs]
            if self.kind == "mu"
            else [part.name for part in scene.parts]
        )
        if self.owner and self.owner not in names:
            return (
                f"it has no {'contact' if self.kind == 'mu' else 'body'} '{self.owner}', only"
                f" {', '.join(names)}"
            )
        if self.kind == "mu":
            return "its contacts have no friction"
        if self.kind in MATERIAL:
            return f"body '{self.owner}' is rigid" if self.owner else "it has no elastic body"
        return f"body '{self.owner}' has no such {self.kind}"


def parameter(name: Any, scene: Scene) -> Parameter:
    """Find one parameter of a scene by its name.

    Parameters
    ----------
    name : A name in the form that this module's head lists.
    scene : The scene that the parameter belongs to.

    Returns
    -------
    The parameter.

    Raises
    ------
    InputError : If the name is unknown or what it names does not enter the scene.
    """
    if not isinstance(name, str) or not name:
        raise InputError(
            f"a parameter is given by its name, such as 'mu' or 'E:upper'; got {name!r}."
        )
    kind, *rest = name.split(":")
    if kind in FIELDS and not rest:
        return Parameter(name, kind)
    if kind in (*MATERIAL, "mu") and len(rest) <= 1:
        made = Parameter(name, kind, *rest)
    elif kind in LOADS and len(rest) in (2, 3):
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


def parameters(names: Any, scene: Scene) -> tuple[Parameter, ...]:
    """Find the parameters of a scene by their names.

    Parameters
    ----------
    names : One name or several, in the form that this module's head lists.
    scene : The scene that they belong to.

    Returns
    -------
    The parameters in the order of the names.

    Raises
    ------
    InputError : If a parameter is named twice or does not enter the scene, or if none is named.
    """
    if isinstance(names, str):
        names = (names,)
    found = tuple(parameter(name, scene) for name in names)
    if len({one.name for one in found}) < len(found) or not found:
        raise InputError("name at least one parameter, and each of them once.")
    return found


def put_all(scene: Scene, values: Mapping[Parameter, float]) -> Scene:
    """Give a scene other values of several parameters.

    Parameters
    ----------
    scene : The scene, which stays as it is.
    values : The values by their parameters, in the units of each.

    Returns
    -------
    The scene with these values.
    """
    for which, value in values.items():
        scene = which.put(scene, float(value))
    return scene


def _material(old: Material, constant: str, value: float) -> Material:
    check_number(constant, value)
    return Material(value, old.nu) if constant == "E" else Material(old.E, value)
