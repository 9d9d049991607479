"""Sequences of consecutive problems: the states of one structure, along a load or in time."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem, natural_map_residual


@dataclass(frozen=True, eq=False)
class Sequence:
    """Problems of the same contacts, of which a method solves one after the other.

    Seen from outside it has the q (n k, dim) and s (n p,) of its n states below each other, as
    their forces and multipliers are. `warm`: each state is solved from the answer to the last one.
    """

    states: tuple[InterfaceProblem, ...]
    warm: bool = False

    @property
    def first(self) -> InterfaceProblem:
        return self.states[0]

    @property
    def dim(self) -> int:
        return self.first.dim

    @property
    def contacts(self) -> int:
        return self.first.contacts

    @cached_property
    def q(self) -> np.ndarray:
        return np.concatenate([state.q for state in self.states])

    @cached_property
    def s(self) -> np.ndarray:
        return np.concatenate([state.s for state in self.states])

    @property
    def fingerprint(self) -> str:
        text = " ".join(state.fingerprint for state in self.states)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def states_of(problem: InterfaceProblem | Sequence) -> tuple[InterfaceProblem, ...]:
    """The states of a sequence; of a single problem itself."""
    return problem.states if isinstance(problem, Sequence) else (problem,)


def certificate(
    problem: InterfaceProblem | Sequence, r: np.ndarray, multipliers: np.ndarray | None
) -> float:
    """The natural-map residual, the largest of all states; InputError if the forces do not fit."""
    states = states_of(problem)
    n = len(states)
    if r.size != problem.q.size or (multipliers is not None and len(multipliers) % n):
        raise InputError("the answer does not fit its problem")
    lam = [None] * n if multipliers is None else np.split(multipliers, n)
    forces = np.split(r.reshape(problem.q.shape), n)
    return max(natural_map_residual(*one) for one in zip(states, forces, lam))
