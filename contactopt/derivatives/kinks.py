"""Weakly active contacts, and the one-sided derivatives of a solution there.

At a weakly active contact the point y lies on an edge between pieces of the map P: between open and
closed, between stick and slip, or at the apex where both meet. P has a directional derivative,
P'(y; dy) = D dy on the piece into which dy leads. With the piece D0 that the other contacts see,

    M (dr, dlambda) = right side + z,   z = (D - D0) dy + (P_mu - P_mu0) dmu,   z zero but at the
                                        weakly active contacts.

The linear system gives dy = dy0 + S z with as many columns as there are unknowns at these contacts.
What is left is a small complementarity problem in z: which contacts open or slip in this direction.
It is solved by Newton's method on the pieces, from many starts if need be, and what comes back has
been checked to satisfy it.

Sources: Robinson (1980), Strongly regular generalized equations; Luo, Pang, Ralph (1996), chapter
4.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.problem.laws.law import Kinks, Law

EXACT = 1e-6  # relative error of a one-sided derivative at the weakly active contacts
STEPS, STARTS = 30, 200

logger = logging.getLogger(__name__)
Response = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Weak:
    """A weakly active contact: its number, and the edge on which it lies."""

    contact: int
    edge: str


def weak_contacts(law: Law, y: np.ndarray, distance: float) -> tuple[Weak, ...]:
    """Contacts whose y (k, dim) lie within a distance [force] of the named kinks."""
    kinks = law.kinks(y, distance)
    names = "", "open / closed", "stick / slip", "apex: open / closed, stick / slip"
    edges = (kinks.normal + 2 * kinks.tangential).tolist()
    return tuple(Weak(i, names[edge]) for i, edge in enumerate(edges) if edge)


def of_kinks(what: str, names: list[str], near: str = "") -> str:
    """What is known of the derivatives of something with these weakly active contacts, in words."""
    if not names:
        return f"the {what} has a gradient here: no contact is weakly active"
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return (
        f"the {what} has no gradient here, only one-sided derivatives:"
        f" {count(len(names), 'contact is', 'contacts are')} weakly active{near}:"
        f" {', '.join(names[:5])}{more}"
    )


class Onesided:
    """The complementarity problem of m weakly active contacts.

    law, y      of these contacts, y (m, d) on the kinks;  contacts  (m,) their numbers;  force
                scale [force]
    D, P_mu     (m, d, d) and (m, d) of the piece that M has
    dr, dlam    (m d, k, d) and (m d, p) responses to a unit of z
    S           (m d, m d) and the dy at these contacts that goes with it

    It is made from the map at all k contacts, and from the response (dr, dlambda, dy) of the linear
    system to an error (k, d).
    """

    def __init__(
        self,
        law: Law,
        y: np.ndarray,
        contacts: np.ndarray,
        D: np.ndarray,
        P_mu: np.ndarray,
        distance: float,
        force: float,
        response: Response,
    ):
        if len(contacts) * y.shape[1] > 600:  # unknowns at weakly active contacts
            raise InputError(
                f"{len(contacts)} contacts are weakly active, too many for one-sided derivatives;"
                " solve the problem with a smaller tol, or give a smaller distance."
            )
        logger.info("one-sided derivative: %d weakly active contacts", len(contacts))
        kinks = law.kinks(y, distance)
        own = Kinks(kinks.normal[contacts], kinks.tangential[contacts])
        self.law, self.contacts, self.force = law.select(contacts), contacts, force
        self.y, self.D, self.P_mu = self.law.on_kinks(y[contacts], own), D[contacts], P_mu[contacts]
        answers = []
        for contact in contacts:
            for component in range(y.shape[1]):
                unit = np.zeros(y.shape)
                unit[contact, component] = 1.0
                answers.append(response(unit))
        self.dr, self.dlam, dy = (np.array(part) for part in zip(*answers))
        self.S = dy[:, contacts].reshape(len(dy), -1).T

    def step(self, dy: np.ndarray, dmu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What to add to dr (k, d), dlambda (p,) of M, from its dy (k, d) and dmu (k,)."""
        dy0, dmu = dy[self.contacts], dmu[self.contacts]
        z = self._solve(dy0, dmu)
        return np.tensordot(z, self.dr, 1), z @ self.dlam

    def _solve(self, dy0: np.ndarray, dmu: np.ndarray) -> np.ndarray:
        """z (m d,) of the complementarity problem; InputError if none is found."""
        rng = np.random.default_rng(0)
        size = float(np.abs(dy0).max(initial=0.0) + self.force * np.abs(dmu).max(initial=0.0))
        for start in range(STARTS):
            guess = dy0 if start == 0 else size * rng.normal(size=dy0.shape)
            for _ in range(STEPS):
                D, moved = self._piece(guess, dmu)
                change, one = block_diag(*(D - self.D)), np.eye(len(self.S))
                try:
                    z = np.linalg.solve(one - change @ self.S, change @ dy0.ravel() + moved.ravel())
                except np.linalg.LinAlgError:
                    break
                guess = dy0 + (self.S @ z).reshape(dy0.shape)
                if self._error(z, guess, dmu) <= EXACT * (size + np.abs(guess).max()):
                    return np.asarray(z)
        raise InputError(
            "no one-sided derivative was found: the complementarity problem of the weakly active"
            " contacts has none."
        )

    def _piece(self, dy: np.ndarray, dmu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """D (m, d, d) of the piece into which dy leads, and (P_mu - P_mu0) dmu (m, d)."""
        sizes = np.abs(dy).max(initial=0.0), self.force * np.abs(dmu).max(initial=0.0)
        t = 1e-7 * self.force / (float(max(sizes)) or 1.0)  # into a piece, over the largest force
        law, place = self.law.shifted(t * dmu), self.y + t * dy
        D = law.project(place)[1].copy()
        D[~law.rough, 1:, :] = 0.0
        if not np.any(dmu):
            return D, np.zeros(dy.shape)
        return D, (law.project_by_parameter(place) - self.P_mu) * dmu[:, None]

    def _error(self, z: np.ndarray, dy: np.ndarray, dmu: np.ndarray) -> float:
        """By how much z misses the problem at dy."""
        D, moved = self._piece(dy, dmu)
        wanted = np.einsum("mab,mb->ma", D - self.D, dy) + moved
        return float(np.abs(wanted - z.reshape(dy.shape)).max(initial=0.0))
