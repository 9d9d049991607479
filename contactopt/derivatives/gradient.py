"""The gradient of a quantity of a solved scene with respect to the parameters of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from contactopt.cards import count
from contactopt.derivatives.kinks import Weak, of_kinks
from contactopt.derivatives.states import Chain, along, chain_of
from contactopt.errors import InputError
from contactopt.readings.quantities import seeds_of
from contactopt.readings.state import Seeds
from contactopt.scenes.parameters import parameters as parameters_of

if TYPE_CHECKING:
    from contactopt.runner import Result
    from contactopt.solving.paths import PathResult

GROUND = (
    "; a soft ground holds a thin body, whose pull is taken as constant, so that the derivatives"
    " are less accurate than the solution"
)


@dataclass(frozen=True, eq=False)
class Gradient:
    """A quantity and its derivatives.

    value  of the quantity;  by  name of a parameter -> derivative, a number or for a field (k,)
    weak   (number of the state, contact) for every weakly active contact. Where there is one, the
           quantity has no gradient: `by` is that of the piece at which the solver ended, and
           `onesided` gives the derivative along a direction
    """

    value: float
    by: dict[str, Any]
    weak: tuple[tuple[int, Weak], ...]
    chain: Chain
    quantity: object

    @property
    def differentiable(self) -> bool:
        return not self.weak

    @property
    def sentence(self) -> str:
        """What the derivatives are, for people."""
        names = [f"{weak.contact} ({weak.edge}) in state {number}" for number, weak in self.weak]
        ground = any(step.reduction.on_ground for step in self.chain.steps)
        return of_kinks("quantity", names) + ground * GROUND

    def onesided(self, direction: dict[str, Any]) -> float:
        """The one-sided derivative along a direction, name of a parameter -> amount."""
        scene = self.chain.steps[0].reduction.scene
        chosen = {which: direction[which.name] for which in parameters_of(tuple(direction), scene)}
        *_, moved = self.chain.forward(chosen)  # of the last state, at which the quantity is read
        return along(seeds_of(self.quantity, self.chain.steps[-1]), moved, chosen)


def gradient(
    result: Result | PathResult,
    quantity: object,
    parameters: str | Sequence[str],
    state: int = -1,
    distance: float | None = None,
) -> Gradient:
    """The gradient of a quantity of a solved scene, or of one state of a load path, with
    respect to the parameters of the scene.

    One adjoint solve of the interface problem and one of each body serve all parameters; on a path,
    those of every state.

    Parameters
    ----------
    result : what contactopt.run or contactopt.follow returned
    quantity : a name of contactopt.readings.quantities, such as 'approach', 'energy', 'pressure:12'
        or 'shear_force', or a Functional
    parameters : names of contactopt.scenes.parameters, such as 'mu', 'E:upper',
        'force:upper:y' or 'gap'. A load of a path is changed by the same amount in all states
    state : of a load path, the number of the state at which the quantity is read; by default the
        last
    distance : to a kink within which a contact is weakly active, as for sensitivity()

    Returns
    -------
    Gradient : value, `by` (name -> derivative), and whether there is a gradient at all

    Raises
    ------
    InputError : for a result that is not certified, an unknown quantity, and a parameter that does
        not enter the scene

    Sources: those of contactopt.derivatives.
    """
    chain = chain_of(result, distance)
    if not -len(chain.steps) <= state < len(chain.steps):
        raise InputError(
            f"the path has {count(len(chain.steps), 'state')}; there is no state {state}."
        )
    state %= len(chain.steps)
    chain = Chain(chain.steps[: state + 1])
    which = parameters_of(parameters, chain.steps[0].reduction.scene)
    seeds: list[Seeds | None] = [None] * len(chain.steps)
    own = seeds[-1] = seeds_of(quantity, chain.steps[-1])
    return Gradient(own.value, chain.adjoint(seeds, which), chain.weak, chain, quantity)
