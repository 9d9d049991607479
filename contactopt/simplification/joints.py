"""Pairs of surfaces that loads neither open nor make slip, and pairs whose friction hardly acts.

One solve on a coarse mesh tells them apart. What leaving them out changes is measured on the same
mesh: the elastic energy, and the contact forces and largest pressures of all pairs. Whether the
assumption holds in the end is read from the solution of the simplified scene, because the forces of
a tied pair say whether it would have opened or slipped.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from contactopt.problem import Pair
from contactopt.problem.laws import find_law
from contactopt.readings.constants import COARSEST
from contactopt.readings.quantities import elastic_energy
from contactopt.scenes.scene import Scene
from contactopt.simplification.constants import SHARE, SMOOTH
from contactopt.simplification.findings import Simplification
from contactopt.simplification.whole import whole_of, with_pairs
from contactopt.solving.solve_scene import Options, Solved, solve_scene

ROUGH = Options(tol=1e-6)


def coarse(scene: Scene) -> Solved:
    """The scene solved with a quarter of its elements, unless its meshes are given."""
    return solve_scene(scene, max(COARSEST, scene.elements // 4), options=ROUGH)


def offered_joints(scene: Scene, solved: Solved) -> list[Simplification]:
    """Pairs under Coulomb's law, but one, that a coarse solution lets tie or be frictionless."""
    tied, smooth = [], []
    for contact, pair in zip(scene.pairs, solved.reduction.problem.pairs):
        if find_law(contact.law).plain_coulomb() and np.any(
            solved.reduction.problem.mu[pair.contacts] > 0
        ):
            if _rubbing(solved, pair) <= SMOOTH:
                smooth.append(contact.name)
            elif _use_of_friction(solved, pair, contact.mu) <= SHARE:
                tied.append(contact.name)
    mu = {pair.name: pair.mu for pair in scene.pairs}
    use = f"they stay closed and use no more than {SHARE:.0%} of their friction bound at any node"
    slight = "no tangential traction is more than a hundredth of the largest pressure"
    tied = tied if len(scene.pairs) > 1 else []
    ties, out = "The {} can be tied.", "Friction can be left out at the {}."
    offers = [
        _offer(scene, solved, tied, "tied", ties, use, _verdict_on_ties(mu)),
        _offer(scene, solved, smooth, "frictionless", out, slight, _verdict_on_smooth),
    ]
    return [offer for offer in offers if offer is not None]


def _offer(
    scene: Scene,
    solved: Solved,
    names: list[str],
    law: str,
    what: str,
    why: str,
    verdict: Callable[[list[str], Solved], str],
) -> Simplification | None:
    """Another law for some pairs, with what it changes; None without pairs or a solution."""
    if not names:
        return None
    pairs = [replace(pair, law=law, mu=0.0) if pair.name in names else pair for pair in scene.pairs]
    made = with_pairs(scene, scene.parts, tuple(pairs))
    other = coarse(made)
    if not other.solution.solved:
        return None
    listed = ", ".join(f"'{each}'" for each in names)
    what = what.format(f"{'contact' if len(names) == 1 else 'contacts'} {listed}")
    why = (
        f"On a coarse mesh {why}. The error is the largest change of energy, contact forces and"
        " largest pressures on that mesh."
    )
    check: Callable[[Solved], str] = lambda simple: verdict(names, simple)  # noqa: E731
    error, name = _change(solved, other), f"{law} contacts"
    sizes = whole_of(scene).sizes, whole_of(made).sizes
    return Simplification(name, what, why, *sizes, made, error=error, check=check)


def _use_of_friction(
    solved: Solved,
    pair: Pair,
    value: float | Sequence[float] | np.ndarray | Callable[[np.ndarray], Any],
) -> float:
    """The largest |r_t| / (mu r_n) of a pair; infinite if a contact is open or pulls."""
    r = solved.solution.reactions[pair.contacts]
    mu = value(solved.reduction.problem.coordinates[:, pair.contacts]) if callable(value) else value
    if np.any(r[:, 0] <= 1e-6 * np.abs(r[:, 0]).max(initial=0.0)):
        return float("inf")
    bound = np.maximum(np.asarray(mu, dtype=float) * r[:, 0], 1e-300)
    return float((np.linalg.norm(r[:, 1:], axis=1) / bound).max(initial=0.0))


def _rubbing(solved: Solved, pair: Pair) -> float:
    """The largest tangential traction of a pair over its largest pressure."""
    traction = solved.solution.reactions[pair.contacts]
    traction = traction / solved.reduction.problem.areas[pair.contacts][:, None]
    rubs = float(np.linalg.norm(traction[:, 1:], axis=1).max(initial=0.0))
    return rubs / max(float(traction[:, 0].max(initial=0.0)), 1e-300)


def _change(one: Solved, other: Solved) -> float:
    """The largest change of energy, forces and pressures, over the largest of the scene."""
    changes = []
    for a, b in zip(_readings(one), _readings(other)):
        scale = float(np.linalg.norm(a, axis=-1).max(initial=0.0))
        changes.append(float(np.linalg.norm(a - b, axis=-1).max(initial=0.0)) / max(scale, 1e-300))
    return max(changes)


def _readings(solved: Solved) -> tuple[np.ndarray, ...]:
    """Energy (1, 1), and forces (pairs, dim) and largest pressures (pairs, 1)."""
    problem, r = solved.reduction.problem, solved.solution.reactions
    pressure = r[:, 0] / np.maximum(problem.areas, 1e-300)
    return (
        np.array([[elastic_energy(solved.reduction, solved.solution)]]),
        np.array([r[pair.contacts].sum(axis=0) for pair in problem.pairs]),
        np.array([[pressure[pair.contacts].max(initial=0.0)] for pair in problem.pairs]),
    )


def _verdict_on_ties(friction: Mapping[str, Any]) -> Callable[[list[str], Solved], str]:
    """The function that says, of a solution with pairs tied, whether they would have held."""

    def verdict(names: list[str], solved: Solved) -> str:
        broken = []
        for pair in solved.reduction.problem.pairs:
            used = _use_of_friction(solved, pair, friction[pair.name]) if pair.name in names else 0
            if used > 1:
                broken.append(f"'{pair.name}' would {'open' if np.isinf(used) else 'slip'}")
        if not broken:
            return "The tied contacts stay closed and below their friction bound, as was assumed."
        wrong = ", ".join(broken)
        return f"The assumption is violated: {wrong}; solve the scene with friction there."

    return verdict


def _verdict_on_smooth(names: list[str], solved: Solved) -> str:
    """How far the surfaces of frictionless pairs slide on each other."""
    problem, solution = solved.reduction.problem, solved.solution
    u, slides = problem.displacements(solution.reactions, solution.multipliers), 0.0
    for pair in problem.pairs:
        pressed = solution.reactions[pair.contacts, 0] > 0
        if pair.name in names and pressed.any():
            slides = max(slides, float(np.linalg.norm(u[pair.contacts][pressed, 1:], axis=1).max()))
    return f"Without friction the pressed contacts slide by at most {slides:.3g}."
