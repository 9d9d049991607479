"""What is wrong with an answer, said in mechanics.

The answer to an exercise is compared with forces, displacements or states of an interface problem
u = Q r + V lambda + q, V' r + s = 0, or with numbers. A verdict has a kind, which tests ask for, and
a sentence, which students read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from contactopt import InterfaceProblem, laws, natural_map_residual, solve
from contactopt.problem.certificate import Yardsticks, fit_multipliers, yardsticks
from experiments.course.quantities import MISSING, UNIT, Numbers
from experiments.course.verdict import CLOSE, DIGITS, RIGHT, Verdict, shortened, wrong

HUGE = 1e100  # from here on numbers count as infinite
REAL = (int, float, np.integer, np.floating, Fraction, Decimal)  # types of numbers
TOLD = 0.2  # a condition is told first if its violation is this share of the largest one


@dataclass(frozen=True)
class Forces:
    """The answer holds the forces (k, dim) of a problem, normal first, or (k,) without friction."""

    problem: InterfaceProblem

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        k, dim = self.problem.q.shape
        if not self.problem.law.rough.any():
            return [(k,), (k, 1), (k, dim), (k * dim,)]
        return [(dim,), (1, dim)] if k == 1 else [(k, dim), (k * dim,)]

    def forces(self, answer: np.ndarray) -> np.ndarray:
        k, dim = self.problem.q.shape
        if answer.size == k < k * dim:
            return np.column_stack([answer.ravel(), np.zeros((k, dim - 1))])
        return answer.reshape(k, dim)

    @cached_property
    def solved(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces and displacements, from contactopt."""
        found = solve(self.problem, tol=1e-10)
        moved = self.problem.displacements(found.reactions, found.multipliers)
        return found.reactions, moved

    def solution(self) -> np.ndarray:
        """The right answer."""
        return self.solved[0]

    def verdict(self, answer: np.ndarray) -> Verdict:
        found = judge_forces(self.problem, self.forces(answer))
        if found.right:
            return found
        return self._digits(answer) or self._unit(answer) or self._other(answer) or found

    def other(self) -> tuple[np.ndarray, str]:
        """What somebody gives who confuses forces and displacements, and what is told."""
        return self.solved[1], "These are the displacements. The forces are asked for."

    def _other(self, answer: np.ndarray) -> Verdict | None:
        other, told = self.other()
        other = other if answer.size == other.size else other[:, :1]
        least = CLOSE * np.abs(other).max()
        same = other.any() and np.allclose(answer.ravel(), other.ravel(), rtol=CLOSE, atol=least)
        return wrong("quantity", told) if same else None

    def _digits(self, answer: np.ndarray) -> Verdict | None:
        """Whether an answer is the right one with three digits, or with fewer."""
        right = self.solution()
        if answer.size != right.size:
            right = right[:, :1]
        pairs = list(zip(answer.ravel(), right.ravel(), strict=True))
        least = CLOSE * np.abs(right).max()
        for digits, ways, verdict in ((3, 1, RIGHT), (3, 2, DIGITS), (2, 2, DIGITS)):
            # numbers as given, rounded or cut off, or all with the same decimal place
            decimals = digits - 1 - int(np.floor(np.log10(np.abs(right).max())))
            if all(
                np.isclose(a, shortened(b, digits)[:ways], rtol=1e-9, atol=least).any()
                or np.isclose(a, round(b, decimals), rtol=1e-9, atol=1e-12)
                for a, b in pairs
            ):
                return verdict
        return None

    def _unit(self, answer: np.ndarray) -> Verdict | None:
        for factor in (1e-6, 1e-3, 1e3, 1e6):
            if judge_forces(self.problem, self.forces(factor * answer)).right:
                return wrong("unit", UNIT.format(1 / factor))
        return None


@dataclass(frozen=True)
class Displacements(Forces):
    """The answer holds the displacements (k, dim) of a problem that has an invertible Q and no V."""

    def forces(self, answer: np.ndarray) -> np.ndarray:
        u = answer.reshape(self.problem.q.shape)
        return np.linalg.solve(self.problem.Q, (u - self.problem.q).ravel()).reshape(u.shape)

    def solution(self) -> np.ndarray:
        return self.solved[1]

    def other(self) -> tuple[np.ndarray, str]:
        return self.solved[0], "These are the forces. The displacements are asked for."

    def verdict(self, answer: np.ndarray) -> Verdict:
        found = super().verdict(answer)
        if found.right or found.kind in ("unit", "digits", "quantity"):
            return found
        about = "Your displacements need the forces r = K (u - q). With them: "
        return replace(found, sentence=found.sentence.replace("yet. ", f"yet. {about}", 1))


@dataclass(frozen=True)
class State:
    """The answer is (u, r), the gap and the force of one node without friction, u = Q r + q."""

    Q: float
    q: float
    shapes = ((2,),)

    def verdict(self, answer: np.ndarray) -> Verdict:
        found, right = self._judged(answer), Numbers((max(self.q, 0.0), max(-self.q / self.Q, 0.0)))
        return found if found.right else _simple(right.verdict(answer)) or found

    def _judged(self, answer: np.ndarray) -> Verdict:
        u, r = answer
        length = max(abs(self.q), abs(self.Q * r))
        force = length / self.Q
        missing = (u - self.q) / self.Q - r
        if u < -CLOSE * length:
            return wrong("penetration", f"The node is {-u:.3g} mm below the floor.")
        if r < -CLOSE * force:
            return wrong("tension", f"The floor pulls with {-r:.3g} N, but it can only push.")
        if u > CLOSE * length and r > CLOSE * force:
            return wrong("distance", f"The floor pushes with {r:.3g} N across a gap of {u:.3g} mm.")
        if abs(missing) > CLOSE * force:
            return wrong(
                "balance",
                f"The forces on the node do not balance: spring, load and floor leave"
                f" {abs(missing):.3g} N.",
            )
        return RIGHT


def _simple(verdict: Verdict) -> Verdict | None:
    """A verdict on numbers, where it is more helpful than one on mechanics."""
    return verdict if verdict.kind in ("digits", "unit", "half", "order", "right") else None


@dataclass(frozen=True)
class Open:
    """Many answers are right: `judge` returns None for them, and for others a sentence."""

    example: Any
    judge: Callable[[np.ndarray], str | None]

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        return [np.shape(self.example)]

    def verdict(self, answer: np.ndarray) -> Verdict:
        sentence = self.judge(answer)
        return RIGHT if sentence is None else wrong("open", sentence)


Right = Forces | State | Numbers | Open


def as_numbers(answer: Any, right: Right, asks: str) -> np.ndarray | Verdict:
    """The answer as an array of a shape that the exercise asks for, or what is wrong with it."""
    wanted = f"Give {_size(right.shapes[0])}: {asks}."
    parts = answer if isinstance(answer, (tuple, list)) else [answer]
    if any(type(part).__module__.startswith("cvxpy") for part in parts):
        return wrong("type", f"A part of a cvxpy program has its number in `.value`. {wanted}")
    try:
        given = np.asarray(answer)
        if any(
            isinstance(one, (bool, np.bool_)) or not isinstance(one, REAL) for one in given.flat
        ):
            raise TypeError
        given = given.astype(float)
    except (TypeError, ValueError):
        return wrong(
            "type", f"Your answer has the type {type(answer).__name__}, and is no number. {wanted}"
        )
    if not np.all(np.abs(given) < HUGE):
        return wrong("type", f"Not every number of your answer is finite. {wanted}")
    flat = np.squeeze(given).shape
    for shape in right.shapes:
        if given.shape == shape or flat == tuple(n for n in shape if n > 1):
            return given.reshape(shape)
    return wrong("shape", f"Your answer holds {_size(given.shape)}. {wanted}")


def _size(shape: Sequence[int]) -> str:
    if len(shape) == 0:
        return "one number"
    if len(shape) == 1:
        return f"{shape[0]} number{'' if shape[0] == 1 else 's'}"
    return f"{shape[0]} row{'s' if shape[0] > 1 else ''} of {_size(shape[1:])}"


def judge_forces(problem: InterfaceProblem, r: np.ndarray) -> Verdict:
    """What is wrong with forces: another problem that they solve, or the worst contact."""
    if natural_map_residual(problem, r) <= CLOSE:
        return RIGHT
    for kind, other, forces, sentence in _others(problem, r):
        if r.any() and natural_map_residual(other, forces) <= CLOSE:
            return wrong(kind, sentence)
    return _worst(problem, r)


def _others(problem: InterfaceProblem, r: np.ndarray) -> list[tuple[str, Any, np.ndarray, str]]:
    """Kind, problem, forces, sentence: if these forces solve this problem, the sentence fits."""
    flipped = r * np.where(np.arange(r.shape[1]) == 0, 1.0, -1.0)
    areas = problem.areas[:, None]
    found = [
        ("sign", problem, -r, "All signs are wrong: r is the force on the upper body."),
        ("order", problem, np.roll(r, 1, axis=1), "The normal component comes first."),
        (
            "along",
            problem,
            flipped,
            "The friction force has the right size, but it acts along the slip. It must act"
            " against it.",
        ),
        ("pressure", problem, r * areas, "These are forces per area; forces are asked for."),
        ("half", problem, 2 * r, MISSING.format("two")),
        ("half", problem, r / 2, MISSING.format("two")),
        ("order", problem, r[::-1], "These are the right forces in the reverse order."),
    ]
    if problem.dim == 3:
        told = "The two tangential directions are exchanged."
        found.append(("order", problem, r[:, [0, 2, 1]], told))
    if isinstance(problem.law, laws.Coulomb) and problem.law.rough.any():
        pushes = r[:, 0] > CLOSE * np.abs(r).max()
        if np.sum(pushes) > 2 and r[:, 1:].any():
            mu = float(np.max(np.linalg.norm(r[pushes, 1:], axis=1) / r[pushes, 0]))
            told = f"These forces belong to the friction coefficient {mu:.3g}."
            found.append(("coefficient", _with_law(problem, laws.Coulomb(mu)), r, told))
        found += [
            (
                "associated",
                _with_law(problem, laws.Associated(problem.law.coefficient)),
                r,
                "This is the solution of associated friction, the minimum over the cones. In it"
                " slip lifts the contacts by mu |u_t|. Coulomb's law has no such lift.",
            ),
            (
                "frictionless",
                _with_law(problem, laws.Frictionless(np.zeros(problem.contacts))),
                r,
                "This is the solution without friction: contacts slip, and nothing resists.",
            ),
        ]
    return found


def _with_law(problem: InterfaceProblem, law: Any) -> InterfaceProblem:
    return InterfaceProblem(problem.Q, problem.q, law, problem.V, problem.s)


def _worst(problem: InterfaceProblem, r: np.ndarray) -> Verdict:
    """The first condition that the forces violate, and the contact where it is violated most."""
    lam = fit_multipliers(problem, r)
    d = np.asarray(problem.Q @ r.ravel()).reshape(r.shape)
    w = problem.q + (problem.V @ lam).reshape(r.shape)
    u, measure = d + w, yardsticks(problem, r, d, w)
    missing = np.abs(problem.V.T @ r.ravel() + problem.s)
    if np.any(missing > CLOSE * np.maximum(abs(problem.s), problem.reach * measure.force)):
        j = int(np.argmax(missing))
        what = problem.motions[j] if problem.motions else f"the rigid motion {j + 1}"
        return wrong(
            "balance",
            f"The contact forces do not balance the load in {what}: V' r + s is {missing[j]:.3g}.",
        )
    conditions = _conditions(problem, r, u, measure)
    least = max(CLOSE, TOLD * max(float(size.max()) for _, size, _ in conditions))
    for kind, size, tell in conditions:
        i = int(np.argmax(size))
        if size[i] > least:
            more = int(np.sum(size > CLOSE)) - 1
            where = "The node" if problem.contacts == 1 else f"Contact {i}"
            also = f" So {'do' if more > 1 else 'does'} {more} more." if more else ""
            return wrong(kind, f"{where} {tell(i)}{also}", i)
    return wrong("precision", "It is nearly right. Give more digits, or solve more accurately.")


def _conditions(
    problem: InterfaceProblem, r: np.ndarray, u: np.ndarray, measure: Yardsticks
) -> list[tuple[str, np.ndarray, Callable[[int], str]]]:
    """Kind, relative violation (k,), and what contact i does, in the order of telling."""
    F, L = measure.force, measure.length or 1.0
    (r_n, r_t), (u_n, u_t) = (r[:, 0], r[:, 1:]), (u[:, 0], u[:, 1:])
    shear, slip = np.linalg.norm(r_t, axis=1), np.linalg.norm(u_t, axis=1)
    bound, slips = problem.law.bound_along(r), slip > CLOSE * L
    power = np.sum(r_t * u_t, axis=1) / np.where(slips, slip, 1.0)
    across = np.sqrt(np.maximum(shear**2 - power**2, 0.0))
    unused = np.minimum(bound - shear, bound)
    opens = problem.law.lowest == 0
    return [
        (
            "tension",
            np.where(opens, -r_n, 0) / F,
            lambda i: f"pulls with {-r_n[i]:.3g} N, but contact can only push.",
        ),
        (
            "bound",
            (shear - bound) / F,
            lambda i: (
                f"carries the friction force {shear[i]:.3g} N, beyond its bound {bound[i]:.3g} N."
                " Before it carries so much, it slips."
            ),
        ),
        (
            "penetration",
            np.where(opens, -u_n, abs(u_n)) / L,
            lambda i: f"goes {-u_n[i]:.3g} mm into the other body: it needs a larger normal force.",
        ),
        (
            "distance",
            np.where(opens, np.minimum(r_n / F, u_n / L), 0),
            lambda i: f"pushes with {r_n[i]:.3g} N across a gap of {u_n[i]:.3g} mm.",
        ),
        (
            "along",
            np.where(slips, power, 0) / F,
            lambda i: f"has friction along its slip of {slip[i]:.3g} mm, and not against it.",
        ),
        (
            "direction",
            np.where(slips, across, 0) / F,
            lambda i: (
                "slips in one direction and rubs in another: they differ from opposite by"
                f" {np.degrees(np.arctan2(across[i], -power[i])):.0f} degrees."
            ),
        ),
        (
            "loose",
            np.where(slips, unused, 0) / F,
            lambda i: (
                f"slips by {slip[i]:.3g} mm, but its friction force {shear[i]:.3g} N is below the"
                f" bound {bound[i]:.3g} N."
            ),
        ),
    ]


def draw(problem: InterfaceProblem, r: np.ndarray, contact: int) -> Any:
    """The forces with their bound, and the worst contact; one node is drawn with its cone."""
    import matplotlib.pyplot as plt

    fig, ax = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
    shear = r[:, 1] if problem.dim == 2 else np.linalg.norm(r[:, 1:], axis=1)
    if problem.contacts == 1:
        height = 1.2 * max(abs(r).max(), 1e-12)
        wide = float(problem.law.bound_along(np.array([[height] + [0.0] * (problem.dim - 1)]))[0])
        ax.fill([0, -wide, wide], [0, height, height], color="C0", alpha=0.15, lw=0)
        ax.annotate(
            "", (shear[0], r[0, 0]), (0, 0), arrowprops={"arrowstyle": "-|>", "color": "C3"}
        )
        ax.set(xlim=(-height, height), ylim=(min(1.2 * r[0, 0], -0.1 * height), height))
        ax.set(xlabel="friction force $r_t$ [N]", ylabel="normal force $r_n$ [N]")
        return fig
    x = problem.coordinates[0]
    order, bound = np.argsort(x), problem.law.bound_along(r)
    ax.plot(x[order], r[order, 0], "C0.-", label="normal force")
    ax.plot(x[order], shear[order], "C1.-", label="friction force")
    ax.plot(x[order], bound[order], "k--", lw=1, label="bound of friction")
    ax.plot(x[order], -bound[order], "k--", lw=1)
    ax.axvline(x[contact], color="C3", lw=1, label=f"contact {contact}")
    ax.set(xlabel="place of the contact", ylabel="force [N]")
    ax.legend(frameon=False, fontsize=7, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4)
    return fig
