"""What all laws of contact and friction share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache, cached_property
from typing import NamedTuple, Self

import numpy as np

from contactopt.checks import LARGEST, real_array
from contactopt.errors import InputError
from contactopt.problem.cones import lengths, unit
from contactopt.problem.laws.place import Place

PRESSED = 1e-8  # normal forces below this fraction of the largest are rounding: the contact is open
BELOW = 1e-6  # a tangential force sticks if it is below its bound by a larger share of the bound
Projected = tuple[np.ndarray, np.ndarray]  # points (k, dim), generalised derivatives (k, dim, dim)


class Kinks(NamedTuple):
    """Where the map P of a law has no derivative: two masks (k,), of which both hold at the apex of
    a cone.

    normal      on the edge between open and closed;  tangential  on the edge between stick and slip
    """

    normal: np.ndarray
    tangential: np.ndarray


class Law:
    """What all laws share.

    A law of its own needs `bound` and `nearest_derivative`, and `slope` where the bound depends on
    the normal force; the rest has defaults.
    The fields of a law are its parameters: arrays (k,) of numbers that are not negative, or one
    number for all contacts. Methods ask a law for these properties, never for its name:

    convex        solutions minimise r' Q r / 2 + q' r over a fixed convex set, and `project` is the
                  projection on it
    proportional  the friction bound is mu |r_n|, with mu the coefficient
    dilatant      slip opens the gap
    bounded       tangential forces have a bound
    directed      a scene may give it a direction of friction
    opens         contacts may open
    frictional    its parameter is a friction that can be chosen
    """

    convex: bool = False
    proportional: bool = False
    dilatant: bool = False
    bounded: bool = True
    directed: bool = False
    opens: bool = True
    frictional: bool = True

    def __post_init__(self) -> None:
        for name in self.parameters:
            value = real_array(name, getattr(self, name))
            if value.ndim > 1:
                raise InputError(
                    f"{name} must be a number or one number per contact; got shape {value.shape}."
                )
            if np.any(value < 0):
                known = {"mu": "the friction coefficient mu", "limit": "the friction bound"}
                what, least = known.get(name, name), value.min()
                raise InputError(f"{what} must not be negative; its least value is {least:g}.")
            if np.any(value) and not self.frictional:
                raise InputError(
                    f"the law {type(self).__name__} reads no {name}; leave it out or give 0, or"
                    " take a law with friction."
                )
            value = np.minimum(value, LARGEST)  # nothing slips long before
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return _names_of(type(self))  # type: ignore[arg-type]

    @property
    def contacts(self) -> int:
        """Number of contacts k of a law whose parameters are arrays."""
        return len(getattr(self, self.parameters[0]))

    @property
    def lowest(self) -> np.ndarray:
        """The least normal force (k,) [force]: 0 where a contact may open, -inf where it cannot."""
        return np.full(self.contacts, 0.0 if self.opens else -np.inf)

    @classmethod
    def plain_coulomb(cls) -> bool:
        """Whether the bound is mu r_n in all directions and slip does not open the gap."""
        return (
            cls.proportional and cls.frictional and cls.opens and not (cls.dilatant or cls.directed)
        )

    @cached_property
    def unilateral(self) -> bool:
        """Whether every contact may open."""
        return bool(np.all(self.lowest == 0))

    @property
    def coefficient(self) -> np.ndarray:
        """The largest friction coefficients (k,) in any direction: `mu`, or 0 without any."""
        return getattr(self, "mu", np.zeros(self.contacts))

    @property
    def rough(self) -> np.ndarray:
        """The mask (k,) of the contacts that can carry a tangential force."""
        return self.coefficient > 0

    @property
    def plain(self) -> Law:
        """The law that holds in the variables of `stretch`, the same in all directions."""
        return self

    def stretch(self, dim: int) -> np.ndarray | None:
        """Symmetric S (k, dim - 1, dim - 1): where r_t = S y_t and u_t = S^-1 v_t obey this law,
        y_t and v_t obey `plain`, which is the same in all directions. None: S = 1.
        """
        return None

    def bound(self, r_n: np.ndarray) -> np.ndarray:
        """The largest |r_t| (k,) [force] in any direction under normal forces r_n (k,)."""
        raise NotImplementedError

    def slope(self, r_n: np.ndarray) -> np.ndarray:
        """(k,) the derivative of `bound` by the normal force."""
        return np.zeros(len(r_n))

    def bound_along(self, r: np.ndarray) -> np.ndarray:
        """The largest |r_t| (k,) [force] in the direction of r_t, for forces r (k, dim)."""
        return self.bound(r[:, 0])

    def nearest_derivative(self, y: np.ndarray, r_n: np.ndarray) -> Projected:
        """The points (k, dim) of the set K of forces nearest to y, and their generalised
        derivatives (k, dim, dim). Where K depends on the normal force, it is that of r_n (k,),
        taken as given.
        """
        raise NotImplementedError

    def nearest(self, y: np.ndarray, r_n: np.ndarray) -> np.ndarray:
        """The nearest points (k, dim) of the set K of forces; see `nearest_derivative`."""
        return self.nearest_derivative(y, r_n)[0]

    def project(self, y: np.ndarray) -> Projected:
        """The map P(y) (k, dim) of r = P(r - rho u), and its derivatives (k, dim, dim)."""
        P, D = self.nearest_derivative(y, y[:, 0])
        slips = lengths(y[:, 1:]) > self.bound(y[:, 0])
        D[:, 1:, 0] += (slips * self.slope(y[:, 0]))[:, None] * unit(y[:, 1:])
        return P, D

    def mapped(self, y: np.ndarray) -> np.ndarray:
        """The map P(y) (k, dim) of `project` without its derivatives."""
        return self.project(y)[0]

    def project_by_parameter(self, y: np.ndarray) -> np.ndarray:
        """Derivatives (k, dim) of `project` by the parameter; InputError if unknown."""
        raise InputError(
            f"the law {type(self).__name__} has no derivative with respect to its parameter"
            " (project_by_parameter)."
        )

    def kinks(self, y: np.ndarray, distance: float) -> Kinks:
        """The contacts whose point lies within a distance [force] of a kink of `project`."""
        normal = (np.abs(y[:, 0]) <= distance) & ((self.lowest == 0) | self.rough)
        slack = lengths(y[:, 1:]) - self.bound_along(y)
        return Kinks(normal, (np.abs(slack) <= distance) & self.rough & (normal | ~self.idle(y)))

    def on_kinks(self, y: np.ndarray, kinks: Kinks) -> np.ndarray:
        """Points y (k, dim) [force], of which those in the masks are moved onto their kinks."""
        out = y.copy()
        out[kinks.normal, 0] = 0.0
        edge = unit(y[:, 1:]) * self.bound_along(out)[:, None]
        out[:, 1:] = np.where(kinks.tangential[:, None], edge, y[:, 1:])
        return out

    def idle(self, y: np.ndarray) -> np.ndarray:
        """The mask (k,) of the points at which `project` and its derivative are sure to be zero."""
        return np.zeros(len(y), dtype=bool)

    def opening(self, u_t: np.ndarray) -> np.ndarray:
        """The length g (k,) [length] that slip u_t (k, dim - 1) adds to the gap."""
        return np.zeros(len(u_t))

    def natural_map(self, r: np.ndarray, u: np.ndarray, rho: float) -> np.ndarray:
        """proj_K(r - rho (u + g n)) (k, dim), which equals r exactly where r and u obey the law."""
        shifted = r - rho * u
        shifted[:, 0] -= rho * self.opening(u[:, 1:])
        return self.nearest(shifted, r[:, 0])

    def pressed(self, r: np.ndarray) -> np.ndarray:
        """The mask (k,) of contacts that carry a normal force beyond rounding, or cannot open."""
        size = np.abs(r[:, 0])
        return np.asarray((size > PRESSED * size.max(initial=0.0)) | (self.lowest < 0))

    def sticking(self, r: np.ndarray) -> np.ndarray:
        """The mask (k,) of the pressed contacts with a tangential force below its bound."""
        return self.pressed(r) & (lengths(r[:, 1:]) < (1 - BELOW) * self.bound_along(r))

    def scaled(self, force: float) -> Self:
        """The same law with forces in another unit."""
        return self

    def times(self, factor: float) -> Self:
        """The law with its friction multiplied by a factor."""
        return self._mapped(lambda parameter: factor * parameter)

    def shifted(self, change: np.ndarray) -> Self:
        """The law with `change` (k,) added to its parameter, which does not fall below zero."""
        change = change if self.frictional else 0.0 * change
        return self._mapped(lambda parameter: np.maximum(parameter + change, 0.0))

    def select(self, contacts: np.ndarray) -> Law:
        """The law of some contacts, which a mask (k,) or numbers that may repeat choose."""
        return self._mapped(lambda parameter: parameter[contacts])

    def lumped(self, first: np.ndarray, count: int) -> Law:
        """The law of groups of `count` contacts that act as one, each with that of its `first`."""
        return self.select(first)

    def spread(self, k: int) -> Self:
        """The law with a number for each of k contacts; InputError for arrays of another length."""
        shapes = {name: np.shape(getattr(self, name)) for name in self.parameters}
        for name, shape in shapes.items():
            if shape not in ((), (k,)):
                raise InputError(f"{name} must have shape {(k,)}; got {shape}.")
        if all(shapes.values()):
            return self
        return self._mapped(lambda parameter: np.broadcast_to(parameter, (k,)))

    @classmethod
    def of_place(cls, values: np.ndarray, place: Place) -> Law:
        """The law of k contacts from a scene's values, one or (k,); InputError for other shapes.
        A law without friction does not look at them.
        """
        values = values if cls.frictional else np.zeros(place.areas.shape)
        if values.shape not in ((), place.areas.shape):
            raise InputError(
                "the friction of a scene must be one number or one per contact, shape"
                f" {place.areas.shape}; got {values.shape}."
            )
        return cls(values)  # type: ignore[call-arg]

    @property
    def digest(self) -> bytes:
        """The law's name and parameters as bytes, for a problem's fingerprint."""
        values = (np.ascontiguousarray(getattr(self, name)) for name in self.parameters)
        return type(self).__name__.encode() + b"".join(value.tobytes() for value in values)

    def _mapped(self, change: Callable[[np.ndarray], np.ndarray]) -> Self:
        return replace(self, **{name: change(getattr(self, name)) for name in self.parameters})  # type: ignore[type-var]


@cache
def _names_of(law: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(law))
