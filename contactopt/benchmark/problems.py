"""Problems of an experiment: scenes, FCLib files and generated families, each a name with
parameters.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg as la

from contactopt.benchmark.packings import packing
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.scenes import make_scene
from contactopt.scenes.scene import Scene

KINDS = ("scene", "fclib", "family")
MATERIALS = ("upper_E", "upper_nu", "lower_E", "lower_nu", "stiffness_ratio")
NORMAL_TOL = 1e-12  # certificate of the frictionless solve behind `tangential`


@dataclass(frozen=True)
class ProblemSpec:
    """kind: one of KINDS.

    path: of an FCLib file; not part of the label, which travels with the results.
    """

    kind: str
    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    path: str = ""

    @property
    def label(self) -> str:
        given = ", ".join(f"{key}={short_number(value)}" for key, value in self.parameters.items())
        return f"{self.name}({given})" if given else self.name

    def check(self, declared: Mapping[str, Callable[..., Any]]) -> None:
        """InputError if the name or a parameter is unknown or out of range. Builds nothing.

        declared  functions of the problems that plug-ins declare, by name
        """
        if self.kind == "scene":
            scene(self.name, **self.parameters)
        elif self.kind == "family":
            families = FAMILIES | dict(declared)
            if self.name not in families:
                raise InputError(
                    f"unknown family {self.name!r}; choose from {', '.join(families)}."
                )
            try:
                signature(families[self.name]).bind(**self.parameters)
            except TypeError as error:
                raise InputError(f"family '{self.name}': {error}.") from error

    def build(self, declared: Mapping[str, Callable[..., Any]]) -> InterfaceProblem:
        """The problem; InputError on parameters that make none. `declared` as for `check`."""
        if self.kind == "scene":
            return reduced(self.name, **self.parameters)
        if self.kind == "fclib":
            from contactopt.fclib import read

            return read(self.path)
        problem = (FAMILIES | dict(declared))[self.name](**self.parameters)
        if not isinstance(problem, InterfaceProblem):
            raise InputError(
                f"family '{self.name}' must return an InterfaceProblem; got"
                f" {type(problem).__name__}."
            )
        return problem


def short_number(value: Any) -> str:
    """A float in the fewest characters that give it back, and anything else as text."""
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def scene(name: str, **parameters: Any) -> Scene:
    """A named scene, with other materials if they are given.

    `parameters` are the scene's own arguments, and upper_E, upper_nu, lower_E, lower_nu, and
    stiffness_ratio, which is the lower body's Young's modulus over the upper one's.
    """
    given = {key: parameters.pop(key) for key in MATERIALS if key in parameters}
    made = make_scene(name, **parameters)
    if not given:
        return made
    bodies = {"upper": made.upper, "lower": made.lower}
    if len(made.meshed) < len(bodies):
        raise InputError(
            f"scene '{name}' has a rigid body; give its"
            " deformable material as arguments of the scene."
        )
    if "stiffness_ratio" in given and "lower_E" in given:
        raise InputError("give stiffness_ratio or lower_E, not both.")
    new: dict[str, Any] = {}
    for body, part in bodies.items():
        changes = {key.partition("_")[2]: v for key, v in given.items() if key.startswith(body)}
        new[body] = replace(part.material, **changes)  # type: ignore[union-attr]
    if "stiffness_ratio" in given:
        new["lower"] = replace(new["lower"], E=given["stiffness_ratio"] * new["upper"].E)
    return make_scene(name, **new, **parameters)


def reduced(name: str, **parameters: Any) -> InterfaceProblem:
    """The interface problem, with explicit Q, of a scene made by `scene`."""
    from contactopt.coupling.reduction import reduce

    return reduce(scene(name, **parameters), Q="explicit")


def rigid_bodies(
    bodies: int = 10, contacts: int = 30, mu: float = 0.5, seed: int = 0
) -> InterfaceProblem:
    """Random rigid bodies and contact frames: Q = H' M^-1 H of rank at most 6 bodies, q = H' v, so
    that a solution exists.
    """
    if bodies < 2 or contacts < 1:
        raise InputError("rigid_bodies needs at least two bodies and one contact.")
    rng = np.random.default_rng(seed)
    H = np.zeros((3 * contacts, 6 * bodies))
    for c in range(contacts):
        frame = la.qr(rng.normal(size=(3, 3)))[0]
        pair = rng.choice(bodies, 2, replace=False)
        for body, sign in zip(pair, (1.0, -1.0)):
            arm = rng.normal(size=3)
            force = np.hstack([frame, np.cross(arm, frame)])
            H[3 * c : 3 * c + 3, 6 * body : 6 * body + 6] = sign * force
    inverse_mass = 10 ** rng.uniform(-1, 1, 6 * bodies)
    q = (H @ rng.normal(size=6 * bodies)).reshape(-1, 3)
    return InterfaceProblem((H * inverse_mass) @ H.T, q, Coulomb(np.full(contacts, mu)))


def half_plane(contacts: int = 64, mu: float = 0.5, coupling: float = 0.0) -> InterfaceProblem:
    """A parabola pressed on an elastic half-plane: the dense logarithmic kernel of piecewise
    constant tractions.

    Half the candidate zone and the plane's modulus pi E* / 2 are the units. The load, by a plate,
    makes about half of the candidate nodes touch. `coupling` is Dundurs' constant, in (-.5, .5), by
    which tangential tractions move the surface normally. At 0 friction has nothing to do and only
    the normal problem is left.

    Source: Johnson (1985), Contact Mechanics, eqs (2.30).
    """
    h = 2.0 / contacts
    x = -1.0 + h * (np.arange(contacts) + 0.5)
    distance = x[:, None] - x
    ends = [distance + h / 2, distance - h / 2]
    # at rest 8 away: positive definite on this zone
    a, b = (end * np.log(np.abs(end) / 8.0) for end in ends)
    kernel = (b - a + h) / h
    skew = -coupling * np.pi / 2 * np.sign(distance)
    Q = np.zeros((contacts, 2, contacts, 2))
    Q[:, 0, :, 0] = Q[:, 1, :, 1] = kernel
    Q[:, 0, :, 1], Q[:, 1, :, 0] = skew, skew.T
    V = np.zeros((contacts, 2, 1))
    V[:, 0] = 1.0
    q = np.stack([x**2, np.zeros(contacts)], axis=1)
    return InterfaceProblem(
        Q.reshape(2 * contacts, -1),
        q,
        Coulomb(np.full(contacts, mu)),
        V.reshape(-1, 1),
        np.array([-0.25]),
        np.full(contacts, h),
        x[None],
    )


def tangential(of: str, mu: float = 0.5, shear: float = 0.3, **parameters: Any) -> InterfaceProblem:
    """The friction of a scene under given normal forces (Tresca's problem) as a contact problem
    without coupling.

    Normal forces p are those without friction. The scene's Q_tt, and per contact u_n = (r_n - p) c
    with its own normal compliance c, so that r_n = p solves the normal part exactly; plates are
    held. The tangential displacement at no force is that of the scene under p, and a drag along the
    first axis that would need the force shear * mu * p if nothing slipped. `of` and `parameters`
    are the name of the scene and its arguments.
    """
    from contactopt.methods.driver import solve

    coupled = reduced(of, mu=0.0, **parameters)
    k, dim = coupled.q.shape
    pressed = solve(coupled, tol=NORMAL_TOL)
    if not pressed.solved:
        raise InputError(
            f"the normal problem behind 'tangential' was not solved: {pressed.message}"
        )
    p = np.maximum(pressed.reactions[:, 0], 0.0)
    tangents = np.arange(k * dim).reshape(k, dim)[:, 1:].ravel()
    Q = np.zeros_like(coupled.Q)
    Q[np.ix_(tangents, tangents)] = coupled.Q[np.ix_(tangents, tangents)]
    compliance = np.diag(coupled.Q)[::dim]
    Q[::dim, ::dim] = np.diag(compliance)
    q = coupled.displacements(pressed.reactions, pressed.multipliers)
    drag = np.zeros((k, dim))
    drag[:, 1] = shear * mu * p
    q[:, 1:] -= (Q @ drag.ravel()).reshape(k, dim)[:, 1:]
    q[:, 0] = -compliance * p
    return InterfaceProblem(
        Q, q, Coulomb(np.full(k, mu)), areas=coupled.areas, coordinates=coupled.coordinates
    )


def redundant(of: str, copies: int = 2, **parameters: Any) -> InterfaceProblem:
    """Every contact of the scene `of` listed several times: forces are shared, and Q is
    rank-deficient.
    """
    p = reduced(of, **parameters)
    index = np.repeat(np.arange(p.q.size).reshape(p.q.shape), copies, axis=0).ravel()
    return InterfaceProblem(
        p.Q[np.ix_(index, index)],
        np.repeat(p.q, copies, axis=0),
        p.law.select(np.repeat(np.arange(p.contacts), copies)),
        p.V[index],
        p.s,
        np.repeat(p.areas, copies) / copies,
        np.repeat(p.coordinates, copies, axis=1),
    )


def in_units(
    of: str, force: float = 1.0, length: float = 1.0, **parameters: Any
) -> InterfaceProblem:
    """The numbers of the scene `of` in units in which one newton is `force` and one millimetre
    `length`.
    """
    p = reduced(of, **parameters)
    return replace(
        p,
        Q=np.asarray(p.Q) * (length / force),
        q=p.q * length,
        s=p.s * force,
        areas=p.areas * length**2,
        coordinates=p.coordinates * length,
    )


FAMILIES: dict[str, Callable[..., InterfaceProblem]] = {
    make.__name__: make
    for make in (rigid_bodies, packing, half_plane, tangential, redundant, in_units)
}


def named(kind: str, name: str, parameters: Mapping[str, Any], folder: Path) -> list[ProblemSpec]:
    """The problems of one entry: one, or each file that an FCLib pattern in `folder` matches."""
    if kind != "fclib":
        return [ProblemSpec(kind, name, parameters)]
    pattern = Path(os.path.expandvars(os.path.expanduser(name)))
    if "$" in str(pattern):
        raise InputError(f"'{name}' needs an environment variable that is not set.")
    pattern = folder / pattern
    if pattern.is_dir():
        pattern = pattern / "*.hdf5"
    files = sorted(pattern.parent.glob(pattern.name))
    if not files:
        raise InputError(f"no FCLib file matches '{name}'.")
    return [ProblemSpec("fclib", file.stem, parameters, str(file.resolve())) for file in files]
