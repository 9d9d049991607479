"""Problems of the named scenes, and problems made from them."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.benchmark.families.half_planes import half_plane
from contactopt.benchmark.families.packings import packing
from contactopt.benchmark.families.rigid_blocks import rigid_blocks
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, Solution
from contactopt.problem.laws.coulomb import Coulomb
from contactopt.scenes import make_scene
from contactopt.scenes.scene import Scene

MATERIALS = ("upper_E", "upper_nu", "lower_E", "lower_nu", "stiffness_ratio")
NORMAL_TOL = 1e-12  # certificate of the frictionless solve behind `tangential`


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


def problem_of(scene: Scene, Q: str = "explicit") -> InterfaceProblem:
    """The interface problem of a scene, with Q in one of its forms."""
    from contactopt.coupling.reduction import reduce

    return reduce(scene, Q=Q)


def reduced(name: str, **parameters: object) -> InterfaceProblem:
    """The interface problem, with explicit Q, of a scene made by `scene`."""
    return problem_of(scene(name, **parameters))


def of_name(of: str, **parameters: object) -> InterfaceProblem:
    """The problem of a scene, of a family in OTHERS, or of two names such as "held punch-2d"."""
    name, _, inner = of.partition(" ")
    if name in OTHERS:
        return OTHERS[name](*([inner] if inner else []), **parameters)
    return reduced(of, **parameters)


def pressing(of: str, **parameters: object) -> tuple[InterfaceProblem, np.ndarray, float]:
    """The problem `of` as if its plate were held at the origin; the displacements (k, dim) that its
    plate makes where it stands without friction, and how far it is pressed in [length].

    InputError unless the plate is one motion along the normals.
    """
    made = of_name(of, **parameters)
    if len(made.s) != 1 or np.abs(made.V.reshape(made.q.shape)[:, 1:]).max() > 1e-12:
        raise InputError(f"'held' needs a plate that moves along the normals; '{of}' has none.")
    lam = _pressed(made.altered(law=Coulomb(np.zeros(made.contacts))), "held").multipliers
    free = InterfaceProblem(
        made.Q, made.q, made.law, areas=made.areas, coordinates=made.coordinates
    )
    return free, (made.V @ lam).reshape(made.q.shape), float(abs(lam[0]))


def held(of: str, depth: float = 1.0, drag: float = 0.0, **parameters: object) -> InterfaceProblem:
    """The problem `of` with its plate held where it is pressed to: a problem without plates.

    The plate stands at `depth` times the place where its load brings it without friction, and is
    moved along the first tangent by `drag` times mu times that depth.
    """
    free, pressed, far = pressing(of, **parameters)
    q = free.q + depth * pressed
    q[:, 1] += drag * depth * far * free.mu
    return replace(free, q=q)


def _pressed(problem: InterfaceProblem, family: str) -> Solution:
    """The solution of the frictionless problem that a family is made of."""
    from contactopt.methods.driver import solve

    found = solve(problem, tol=NORMAL_TOL)
    if not found.solved:
        raise InputError(f"the normal problem behind '{family}' was not solved: {found.message}")
    return found


def tangential(
    of: str, mu: float = 0.5, shear: float = 0.3, **parameters: object
) -> InterfaceProblem:
    """The friction of a scene under given normal forces (Tresca's problem) as a contact problem
    without coupling.

    Normal forces p are those without friction. The scene's Q_tt, and per contact u_n = (r_n - p) c
    with its own normal compliance c, so that r_n = p solves the normal part exactly; plates are
    held. The tangential displacement at no force is that of the scene under p, and a drag along the
    first axis that would need the force shear * mu * p if nothing slipped. `of` and `parameters`
    are the name of the scene and its arguments.
    """
    coupled = reduced(of, mu=0.0, **parameters)
    k, dim = coupled.q.shape
    pressed = _pressed(coupled, "tangential")
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


def redundant(of: str, copies: int = 2, **parameters: object) -> InterfaceProblem:
    """Every contact of the problem `of` listed several times, so that Q is rank-deficient."""
    p = of_name(of, **parameters)
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
    of: str, force: float = 1.0, length: float = 1.0, **parameters: object
) -> InterfaceProblem:
    """The scene in units where one newton is `force` and one millimetre `length`."""
    p = reduced(of, **parameters)
    return replace(
        p,
        Q=np.asarray(p.Q) * (length / force),
        q=p.q * length,
        s=p.s * force,
        areas=p.areas * length**2,
        coordinates=p.coordinates * length,
    )


def by_products(of: str, **parameters: object) -> InterfaceProblem:
    """The scene `of`, with Q known by its products with vectors only."""
    return problem_of(scene(of, **parameters), "implicit")


def skewed(of: str, skew: float = 0.1, seed: int = 0, **parameters: object) -> InterfaceProblem:
    """The problem `of` with D S D added to Q, S random and skew, |S| = skew, D^2 the diagonal."""
    made = of_name(of, **parameters)
    random = np.random.default_rng(seed).normal(size=made.Q.shape)
    S = random - random.T
    D = np.sqrt(np.diag(made.Q))
    return replace(made, Q=made.Q + skew / np.linalg.norm(S, 2) * D[:, None] * S * D)


# families besides scenes that others are made of
OTHERS: dict[str, Callable[..., InterfaceProblem]] = {
    make.__name__: make for make in (half_plane, held, packing, rigid_blocks)
}
