"""The bodies that are solved by iteration, before they are condensed to the interface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.protocol import Body, Equilibrium
from contactopt.problem.coupled import Act, CoupledForm


def coupled_form(bodies: Sequence[Body], maps: Sequence[sp.csr_matrix]) -> CoupledForm:
    """Q by the equilibrium of the iterative bodies, all at once, and by products with the others.

    Parameters
    ----------
    bodies
        All bodies, at least one of them with an `equilibrium`.
    maps
        Their signed maps B (k dim, n), as in contactopt.interface.reduction.
    """
    systems: list[Equilibrium] = []
    traces, left, right, others = [], [], [], []
    for body, B in zip(bodies, maps):
        if body.equilibrium is not None:
            systems.append(body.equilibrium)
            traces.append(B[:, body.equilibrium.free])
            left.append(B @ body.equilibrium.low_rank[0])
            right.append(B @ body.equilibrium.low_rank[1])
        elif body.moved(B).any():
            others.append(body.product(B))
    ends = np.cumsum([len(system.free) for system in systems])[:-1]
    L, R = np.concatenate(left, axis=1), np.concatenate(right, axis=1)

    def all_bodies(acts: Sequence[Act]) -> Act:
        """One body after the other: threads share the products of each, so that a small body never waits for a large one."""

        def act(X: np.ndarray) -> np.ndarray:
            return np.concatenate([own(x) for own, x in zip(acts, np.split(X, ends))])

        return act

    def rest(r: np.ndarray) -> np.ndarray:
        total = L @ (R.T @ r)
        for product in others:
            total += product(r[:, None], None)[:, 0]
        return np.asarray(total)

    return CoupledForm(
        sp.hstack(traces, format="csr"),
        all_bodies([system.stiffness for system in systems]),
        all_bodies([system.cycle for system in systems]),
        rest,
        np.concatenate([system.diagonal for system in systems]),
    )
