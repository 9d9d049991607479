"""Which surfaces of which bodies may touch, and under which law."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contactopt.checks import check_number, real_array
from contactopt.errors import InputError
from contactopt.problem.laws import LAWS, Law, find_law

SIDES = ("upper", "lower")


@dataclass(frozen=True)
class Contact:
    """A pair of surfaces that may touch: `upper` is pressed on `lower`.

    The contact normal is the outward normal of the lower surface; a positive normal reaction pushes
    the upper body away from it. A surface may belong to several pairs. A node in two pairs has two
    contacts, one in each.

    upper, lower  a body's name, or 'name:surface' for another surface than the contact boundary of
                  its Part
    mu            what the law reads: the friction coefficient, for 'tresca' a bound of the
                  tangential traction [stress]; a number >= 0, one per contact (k,), or a function
                  of the contacts' positions (dim, k) that gives either; for 'orthotropic' two
                  coefficients instead of one; a law without friction reads none
    law           a name in contactopt.problem.laws.LAWS
    coupling      a name in contactopt.coupling.coupling.COUPLINGS, or 'auto' for the one that fits
                  the surfaces
    direction     of friction in space, one number per component: the law 'orthotropic' reads
                  mu = (along, across) this direction, which is drawn on the surface
    carrier       the side whose nodes carry the contacts, 'upper' or 'lower', for couplings that
                  can choose; None: the coupling chooses
    """

    upper: str
    lower: str
    # no number stands for a law without friction, and is 0 once the contact is made
    mu: float | Sequence[float] | np.ndarray | Callable[[np.ndarray], Any] = None  # type: ignore
    law: str = "coulomb"
    coupling: str = "auto"
    carrier: str | None = None
    direction: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for side in (self.upper, self.lower):
            if not isinstance(side, str):
                raise InputError(
                    f"a contact names its bodies by text, 'body' or 'body:surface'; got {side!r}."
                )
        if self.bodies[0] == self.bodies[1]:
            raise InputError(f"a contact joins two bodies; '{self.bodies[0]}' cannot touch itself.")
        if self.carrier not in (None, *SIDES):
            raise InputError(
                f"the carrier of contact '{self.name}' must be 'upper', 'lower' or None."
            )
        law = find_law(self.law)
        if self.direction is not None:
            _check_direction(self.name, self.direction, law)
        if self.mu is None and not law.frictional:
            object.__setattr__(self, "mu", 0.0)
        elif self.mu is None:
            raise InputError(
                f"contact '{self.name}' has no mu, which the law '{self.law}' needs; give its"
                " coefficient, or the law 'frictionless' or 'tied'."
            )
        if not callable(self.mu):
            _check_friction(self.mu)

    @property
    def bodies(self) -> tuple[str, str]:
        """Names of the upper and the lower body."""
        return self.upper.partition(":")[0], self.lower.partition(":")[0]

    @property
    def surfaces(self) -> tuple[str | None, str | None]:
        """Names of the upper and the lower surface; None for the contact boundary of a Part."""
        return self.upper.partition(":")[2] or None, self.lower.partition(":")[2] or None

    @property
    def name(self) -> str:
        """The name of the pair, 'upper-lower', fit for file names: BODY:SURFACE is BODY.SURFACE."""
        return f"{self.upper}-{self.lower}".replace(":", ".")

    @property
    def friction(self) -> str:
        """The law and its number as words for titles, such as 'mu = 0.3'."""
        law = find_law(self.law)
        if not law.frictional:
            return self.law
        plain = law.proportional and law.frictional and not law.dilatant
        name = "mu" if plain else f"{self.law}, mu"
        if callable(self.mu):
            return f"{name} varies"
        values = np.ravel(self.mu)
        one = np.ndim(self.mu) == 0 or (self.direction is not None and len(values) == 2)
        return f"{name} = {' and '.join(f'{mu:g}' for mu in values)}" if one else f"{name} varies"


def unread(mu: Any, law: str) -> str:
    """A sentence if a coefficient is given that the law of this name does not read."""
    if find_law(law).frictional or not (callable(mu) or np.any(mu)):
        return ""
    return f"the law '{law}' reads no mu; leave it out or give 0, or name a law with friction."


def _check_direction(name: str, direction: object, law: type[Law]) -> None:
    if not law.directed:
        directed = " or ".join(repr(own) for own in LAWS if find_law(own).directed)
        raise InputError(
            f"the law of contact '{name}' is the same in all directions; leave out the direction,"
            f" or take the law {directed}."
        )
    if not real_array(f"the direction of friction of contact '{name}'", direction).any():
        raise InputError(f"the direction of friction of contact '{name}' is zero.")


def _check_friction(mu: Any) -> None:
    """Raise InputError unless mu is a number, or an array of numbers, that are not negative."""
    name = "the friction coefficient mu"
    if not isinstance(mu, (list, tuple)) and np.ndim(mu) == 0:
        check_number(name, mu, low=0.0, closed=True)
    elif np.any(real_array(name, mu) < 0):
        raise InputError(f"{name} must not be negative; its least value is {np.min(mu):g}.")
