"""Several laws, each at contacts of its own: what a problem with several contact pairs carries."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contactopt.cards import count
from contactopt.errors import InputError
from contactopt.problem.laws.law import Kinks, Law, Projected


@dataclass(frozen=True, eq=False)
class Mixed(Law):
    """Laws, `parts`, of disjoint contacts, `members` (k_i,), which together are 0 ... k - 1."""

    parts: tuple[Law, ...]
    members: tuple[np.ndarray, ...]

    def __post_init__(self) -> None:
        together = np.concatenate([np.zeros(0, dtype=int), *self.members]).astype(int)
        if not np.array_equal(np.sort(together), np.arange(len(together))):
            raise InputError(
                "every contact needs exactly one law; the contacts of the laws overlap or leave"
                " some out."
            )
        for law, own in zip(self.parts, self.members, strict=True):
            if law.contacts != len(own):
                raise InputError(
                    f"a law of {count(law.contacts, 'contact')} was given for {len(own)} of them."
                )
        for flag in ("convex", "proportional", "bounded", "opens"):
            object.__setattr__(self, flag, all(getattr(law, flag) for law in self.parts))
        object.__setattr__(self, "dilatant", any(law.dilatant for law in self.parts))

    @property
    def contacts(self) -> int:
        return sum(len(own) for own in self.members)

    @property
    def lowest(self) -> np.ndarray:
        return self._gathered(lambda law, own: law.lowest)

    @property
    def coefficient(self) -> np.ndarray:
        return self._gathered(lambda law, own: law.coefficient)

    @property
    def rough(self) -> np.ndarray:
        return self._gathered(lambda law, own: law.rough)

    @property
    def plain(self) -> Law:
        return join([(law.plain, own) for law, own in zip(self.parts, self.members)])

    def stretch(self, dim: int) -> np.ndarray | None:
        made = [law.stretch(dim) for law in self.parts]
        if all(S is None for S in made):
            return None
        out = np.tile(np.eye(dim - 1), (self.contacts, 1, 1))
        for S, own in zip(made, self.members):
            out[own] = np.eye(dim - 1) if S is None else S
        return out

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        return self._gathered(lambda law, own: law.bound(r_n[own]))

    def bound_along(self, r: np.ndarray) -> np.ndarray:
        return self._gathered(lambda law, own: law.bound_along(r[own]))

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        return self._gathered(lambda law, own: law.nearest(y[own], r_n[own]))

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        return self._projected(y, lambda law, own: law.nearest_derivative(y[own], r_n[own]))

    def project(self, y: np.ndarray) -> Projected:
        return self._projected(y, lambda law, own: law.project(y[own]))

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        return self._gathered(lambda law, own: law.project_by_parameter(y[own]))

    def kinks(self, y: np.ndarray, distance: float) -> Kinks:
        both = self._gathered(lambda law, own: np.stack(law.kinks(y[own], distance), axis=1))
        return Kinks(*both.T)

    def on_kinks(self, y: np.ndarray, kinks: Kinks) -> np.ndarray:
        return self._gathered(
            lambda law, own: law.on_kinks(y[own], Kinks(*(mask[own] for mask in kinks)))
        )

    def shifted(self, change: np.ndarray) -> Mixed:
        return replace(
            self,
            parts=tuple(law.shifted(change[own]) for law, own in zip(self.parts, self.members)),
        )

    def opening(self, u_t: np.ndarray) -> np.ndarray:
        return self._gathered(lambda law, own: law.opening(u_t[own]))

    def scaled(self, force: float) -> Mixed:
        return replace(self, parts=tuple(law.scaled(force) for law in self.parts))

    def times(self, factor: float) -> Mixed:
        return replace(self, parts=tuple(law.times(factor) for law in self.parts))

    def select(self, contacts: np.ndarray) -> Law:
        chosen = np.arange(self.contacts)[contacts]
        pieces = []
        for law, own in zip(self.parts, self.members):
            place = np.full(self.contacts, -1)
            place[own] = np.arange(len(own))
            here = np.flatnonzero(place[chosen] >= 0)
            if len(here):
                pieces.append((law.select(place[chosen[here]]), here))
        return join(pieces) if pieces else self.parts[0].select(np.zeros(0, dtype=int))

    def spread(self, k: int) -> Mixed:
        if self.contacts != k:
            raise InputError(
                f"the laws rule {count(self.contacts, 'contact')}; the problem has {k}."
            )
        return self

    @property
    def digest(self) -> bytes:
        return b"".join(law.digest + own.tobytes() for law, own in zip(self.parts, self.members))

    def _gathered(self, read: Callable[[Law, np.ndarray], np.ndarray]) -> np.ndarray:
        """What `read` gives for each part, put at the contacts of that part."""
        values = [read(law, own) for law, own in zip(self.parts, self.members)]
        out = np.empty((self.contacts, *values[0].shape[1:]), dtype=values[0].dtype)
        for value, own in zip(values, self.members):
            out[own] = value
        return out

    def _projected(self, y: np.ndarray, act: Callable[[Law, np.ndarray], Projected]) -> Projected:
        P, D = np.empty_like(y), np.empty((*y.shape, y.shape[1]))
        for law, own in zip(self.parts, self.members):
            P[own], D[own] = act(law, own)
        return P, D


def join(parts: Sequence[tuple[Law, np.ndarray]]) -> Law:
    """Make one law for all contacts from laws of disjoint contacts.

    Parts of one kind become one: contact pairs that differ only in mu give a single Coulomb law.

    Parameters
    ----------
    parts : For each part its law and the numbers (k_i,) of its contacts, together 0 ... k - 1.

    Returns
    -------
    The law of the k contacts; a Mixed law where the parts are of several kinds.

    Raises
    ------
    InputError : If a contact has no law or two.
    """
    kinds: dict[type[Law], list[tuple[Law, np.ndarray]]] = {}
    for law, own in parts:
        contacts = np.asarray(own, dtype=int)
        pieces = (
            zip(law.parts, law.members)
            if isinstance(law, Mixed)
            else [(law, np.arange(len(contacts)))]
        )
        for piece, inner in pieces:
            kinds.setdefault(type(piece), []).append((piece, contacts[inner]))
    merged = [_merged(group) for group in kinds.values()]
    mixed = Mixed(tuple(law for law, _ in merged), tuple(own for _, own in merged))
    if len(merged) != 1:
        return mixed
    law, own = merged[0]
    return law.select(np.argsort(own))


def _merged(group: list[tuple[Law, np.ndarray]]) -> tuple[Law, np.ndarray]:
    """Laws of one kind as one law, and its contacts."""
    first = group[0][0]
    together = {
        name: np.concatenate([getattr(law, name) for law, _ in group]) for name in first.parameters
    }
    return replace(first, **together), np.concatenate([own for _, own in group])  # type: ignore[type-var]
