"""The bodies that are solved by iteration, before they are condensed to the interface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from contactopt.bodies.protocol import Body
from contactopt.linear.saddle_point import BodyTerm, CoupledForm


def coupled_form(bodies: Sequence[Body], maps: Sequence[sp.csr_matrix]) -> CoupledForm:
    """Make Q from the equilibrium of the iterative bodies, all at once, and from products with the
    others.

    Parameters
    ----------
    bodies : All bodies, at least one of them with an `equilibrium`.
    maps : Their signed maps B (k dim, n), as in contactopt.coupling.reduction.

    Returns
    -------
    Q before condensation.
    """
    terms: list[BodyTerm] = []
    others = []
    for body, B in zip(bodies, maps):
        if body.equilibrium is not None:
            terms.append(body.equilibrium.term(B))
        elif body.moved(B).any():
            others.append(body.product(B))
    L, R = (np.concatenate([term.low_rank[side] for term in terms], axis=1) for side in (0, 1))

    def rest(r: np.ndarray) -> np.ndarray:
        total = L @ (R.T @ r)
        for product in others:
            total += product(r[:, None], None)[:, 0]
        return np.asarray(total)

    return CoupledForm(tuple(terms), rest)
