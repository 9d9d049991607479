"""Pairs of surfaces that loads neither open nor make slip, and pairs whose friction hardly acts.

One solve on a coarse mesh tells them apart. What leaving them out changes is measured on the same mesh: the elastic energy, and
the contact forces and largest pressures of all pairs. Whether the assumption holds in the end is read from the solution of the simplified scene,
because the forces of a tied pair say whether it would have opened or slipped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactopt.analysis.constants import COARSEST
from contactopt.analysis.quantities import elastic_energy
from contactopt.simplification.constants import SHARE, SMOOTH
from contactopt.simplification.findings import Simplification
from contactopt.simplification.whole import sizes_of, with_pairs
from contactopt.analysis.solve_scene import Options, Solved, solve_scene
from contactopt.problem import InterfaceProblem, Pair
from contactopt.scenes.scene import Scene

ROUGH = Options(tol=1e-6)


def coarse(scene: Scene) -> Solved:
    """The scene solved with a quarter of its elements across the contact, where its meshes are made for a number of them."""
    return solve_scene(scene, max(COARSEST, scene.elements // 4), options=ROUGH)


def use_of_friction(solved: Solved, pair: Pair, mu: np.ndarray) -> float:
    """The largest |r_t| over mu r_n of a pair's contacts; infinite if one of them is open or pulls."""
    r = solved.solution.reactions[pair.contacts]
    bound = mu * r[:, 0]
    if np.any(r[:, 0] <= 1e-6 * np.abs(r[:, 0]).max(initial=0.0)):
        return float("inf")
    used = np.linalg.norm(r[:, 1:], axis=1) / np.maximum(bound, 1e-300)
    return float(used.max(initial=0.0))


def frictionless_share(solved: Solved, pair: Pair) -> float:
    """The largest tangential traction of a pair over its largest pressure."""
    problem, r = solved.reduction.problem, solved.solution.reactions[pair.contacts]
    areas = problem.areas[pair.contacts]
    traction = np.linalg.norm(r[:, 1:], axis=1) / areas
    return float(traction.max(initial=0.0) / max(float((r[:, 0] / areas).max(initial=0.0)), 1e-300))


def joints(solved: Solved) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the pairs that can be tied, and of those that can be frictionless.

    Only pairs under Coulomb's law are looked at, and a scene keeps at least one pair that is not tied.
    """
    problem, scene = solved.reduction.problem, solved.reduction.scene
    tied, smooth = [], []
    for contact, pair in zip(scene.pairs, problem.pairs):
        if contact.law != "coulomb":
            continue
        mu = problem.law.coefficient[pair.contacts]
        if not np.any(mu > 0):
            continue
        if frictionless_share(solved, pair) <= SMOOTH:
            smooth.append(contact.name)
        elif use_of_friction(solved, pair, mu) <= SHARE:
            tied.append(contact.name)
    return tuple(tied), tuple(smooth)


def with_law(scene: Scene, names: tuple[str, ...], law: str) -> Scene:
    """The scene with another law for some of its pairs."""
    pairs = tuple(replace(pair, law=law, mu=0.0) if pair.name in names else pair for pair in scene.pairs)
    return with_pairs(scene, pairs)


def change(one: Solved, other: Solved) -> float:
    """The largest relative change of the elastic energy, of the contact forces and of the largest pressure of each pair.

    Forces and pressures are compared with the largest ones of the scene.
    """
    changes = []
    for read in (_energy, _forces, _pressures):
        a, b = read(one), read(other)
        scale = float(np.linalg.norm(a, axis=-1).max(initial=0.0))
        changes.append(float(np.linalg.norm(a - b, axis=-1).max(initial=0.0)) / max(scale, 1e-300))
    return max(changes)


def _energy(solved: Solved) -> np.ndarray:
    return np.array([[elastic_energy(solved.reduction, solved.solution)]])


def _forces(solved: Solved) -> np.ndarray:
    """(pairs, dim) in the frames of the contacts."""
    return np.array([solved.solution.reactions[pair.contacts].sum(axis=0) for pair in solved.reduction.problem.pairs])


def _pressures(solved: Solved) -> np.ndarray:
    """(pairs, 1)."""
    pressure = solved.solution.reactions[:, 0] / np.maximum(solved.reduction.problem.areas, 1e-300)
    return np.array([[pressure[pair.contacts].max(initial=0.0)] for pair in solved.reduction.problem.pairs])


def verdict_on_ties(names: tuple[str, ...], friction: dict[str, object]) -> Callable[[Solved], str]:
    """The function that says, of the solution of the scene with these pairs tied, whether they would have held."""

    def check(solved: Solved) -> str:
        broken = []
        for pair in solved.reduction.problem.pairs:
            if pair.name in names:
                used = use_of_friction(solved, pair, _mu(friction[pair.name], solved.reduction.problem, pair))
                if used > 1:
                    broken.append(f"'{pair.name}' would {'open' if np.isinf(used) else 'slip'}")
        if not broken:
            return "The tied contacts stay closed and below their friction bound, as was assumed."
        return f"The assumption is violated: {', '.join(broken)}; solve the scene with friction there."

    return check


def verdict_on_smooth(names: tuple[str, ...]) -> Callable[[Solved], str]:
    """The function that says, of the solution without friction, how far the surfaces slide on each other."""

    def check(solved: Solved) -> str:
        problem, solution = solved.reduction.problem, solved.solution
        u = problem.displacements(solution.reactions, solution.multipliers)
        slides = 0.0
        for pair in problem.pairs:
            if pair.name in names:
                pressed = solution.reactions[pair.contacts, 0] > 0
                slides = max(slides, float(np.linalg.norm(u[pair.contacts][pressed, 1:], axis=1).max(initial=0.0)))
        return f"Without friction the pressed contacts slide by at most {slides:.3g}."

    return check


def _mu(value: object, problem: InterfaceProblem, pair: Pair) -> np.ndarray:
    places = problem.coordinates[:, pair.contacts]
    made = value(places) if callable(value) else value
    return np.broadcast_to(np.asarray(made, dtype=float), places.shape[1:])


def offered_joints(scene: Scene, solved: Solved) -> list[Simplification]:
    """Pairs that can be tied or frictionless, as a solution on a coarse mesh shows them."""
    tied, smooth = joints(solved)
    if len(tied) == len(scene.pairs) == 1:
        tied = ()
    found = []
    friction: dict[str, object] = {pair.name: pair.mu for pair in scene.pairs}
    for names, law in ((tied, "tied"), (smooth, "frictionless")):
        if not names:
            continue
        made = with_law(scene, names, law)
        other = coarse(made)
        if not other.solution.solved:
            continue
        listed = ("contact " if len(names) == 1 else "contacts ") + ", ".join(f"'{each}'" for each in names)
        if law == "tied":
            what = f"The {listed} can be tied."
            why = (
                f"On a coarse mesh they stay closed and use no more than {SHARE:.0%} of their friction "
                "bound at any node."
            )
            check = verdict_on_ties(names, friction)
        else:
            what = f"Friction can be left out at the {listed}."
            why = (
                "On a coarse mesh no tangential traction is more than a hundredth of the largest "
                "pressure."
            )
            check = verdict_on_smooth(names)
        why += " The error is the largest change of energy, contact forces and largest pressures on that mesh."
        sizes, error = (sizes_of(scene), sizes_of(made)), change(solved, other)
        found.append(Simplification(f"{law} contacts", what, why, *sizes, made, error=error, check=check))
    return found
