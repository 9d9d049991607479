"""Sequences of problems: load paths, growing friction, and packings that settle. Their Q is that of
one structure. A state may depend on the answer to the last one, which is computed here.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from contactopt.benchmark.families.of_scenes import NORMAL_TOL, of_name, pressing
from contactopt.benchmark.families.packings import parts_of_packing
from contactopt.benchmark.sequences import Sequence
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb

PRESSING = 0.3  # share of a load path in which the body is pressed, before it is moved to and fro


def load_path(
    of: str,
    steps: int = 40,
    mu: float = 0.5,
    drag: float = 0.8,
    warm: bool = False,
    **given: object,
) -> Sequence:
    """A plate presses the scene, and then moves to and fro along the first tangent, in space around
    a loop: quasi-static friction, u_t the slip since the last state.

    drag  largest motion over mu times the depth by which the plate presses
    """
    free, pressed, far = pressing(of, mu=mu, **given)
    here, slid = free.q, np.zeros_like(free.q)  # without forces; since the beginning

    def state(i: int, r: np.ndarray | None) -> InterfaceProblem:
        nonlocal here, slid
        if r is not None:
            slid = (free.Q @ r.ravel()).reshape(r.shape) + here
        t = (i + 1) / steps
        turn = 2 * np.pi * max(t - PRESSING, 0.0) / (1 - PRESSING)
        here = free.q + min(t / PRESSING, 1.0) * pressed
        moved = drag * mu * far * np.array([np.sin(turn), (1 - np.cos(turn)) / 2])
        here[:, 1:] += moved[: free.dim - 1]
        q = here.copy()
        q[:, 1:] -= slid[:, 1:]
        return replace(free, q=q)

    return Sequence(_followed(state, steps), warm)


def growing_friction(
    of: str, steps: int = 40, mu: float = 0.8, warm: bool = False, **given: object
) -> Sequence:
    """The problem `of`, with friction that grows from mu / steps to mu."""
    made = of_name(of, mu=mu, **given)
    values = [mu * (i + 1) / steps for i in range(steps)]
    laws = [Coulomb(np.full(made.contacts, value)) for value in values]
    return Sequence(tuple(replace(made, law=law) for law in laws), warm)


def settling(
    dim: int = 2,
    bodies: int = 16,
    steps: int = 40,
    seed: int = 0,
    mu: float = 0.5,
    points: int = 1,
    warm: bool = False,
) -> Sequence:
    """A shaken packing that comes to rest: implicit steps of time one at its first contacts."""
    W, fall, shaken, gaps = parts_of_packing(dim, bodies, seed, points=points)
    velocity, law = shaken, Coulomb(np.full(len(gaps), mu))

    def state(i: int, r: np.ndarray | None) -> InterfaceProblem:
        nonlocal velocity, gaps
        if r is not None:
            velocity = velocity + fall + (W @ r.ravel()).reshape(r.shape)
            gaps = gaps + velocity[:, 0]
        q = velocity + fall
        q[:, 0] += gaps
        return InterfaceProblem(W, q, law)

    return Sequence(_followed(state, steps), warm)


def _followed(
    state: Callable[[int, np.ndarray | None], InterfaceProblem], steps: int
) -> tuple[InterfaceProblem, ...]:
    """The states, each made from the forces that solve the last one."""
    from contactopt.methods.driver import solve

    made: list[InterfaceProblem] = []
    found = None
    for i in range(steps):
        made.append(state(i, None if found is None else found.reactions))
        found = solve(made[-1], tol=NORMAL_TOL, start=found)
        if not found.solved:
            raise InputError(f"state {i + 1} of the sequence was not solved: {found.message}")
    return tuple(made)
