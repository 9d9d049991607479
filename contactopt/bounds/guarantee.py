"""What is guaranteed, and not only estimated, of the error of a solved scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from contactopt.bounds.bound import Bound
from contactopt.bounds.interval import interval
from contactopt.errors import InputError
from contactopt.readings.quantities import Quantity
from contactopt.solving.solve_scene import Solved

MOST = {2: 40_000, 3: 25_000}  # elements of a search with a bound, some 1 GB of memory
SMALL = "if friction is small, which contactopt diagnose tests"


@dataclass(frozen=True)
class Guarantee:
    """What is guaranteed on the last mesh, for its own shape (contactopt.bounds.bound).

    bound    of the error of the quantity over its value [-]; None where there is none, and then
             `missing` says why
    energy   `error`, the bound of the error of the displacement in the energy norm over its norm
             [-], and its parts `mesh`, `contact`, `friction`, `moved` and `solver`; empty where
             there is none
    assumed  under which condition both hold; empty if under none
    """

    bound: float | None = None
    energy: Mapping[str, float] = field(default_factory=dict)
    missing: str = ""
    assumed: str = ""

    @property
    def sentence(self) -> str:
        """The same in words."""
        parts = [f"{name} {value:.1e}" for name, value in self.energy.items() if name != "error"]
        energy = ""
        if self.energy:
            energy = f" Bound in the energy norm: {self.energy['error']:.1e} ({', '.join(parts)})."
        if self.assumed and (energy or self.bound is not None):
            energy += f" This holds {self.assumed}."
        if self.bound is None:
            return f"estimate, no bound: {self.missing}{energy}"
        return f"bound: the relative error is at most {self.bound:.1e}.{energy}"


def bounded(solved: Solved, quantity: Quantity, value: float) -> Guarantee:
    """What is guaranteed of the displacement and of a quantity, and why where there is no bound."""
    scene = solved.reduction.scene
    bodies = [getattr(body, "body", None) for body in solved.reduction.bodies]
    meshes = [own.basis.mesh for own in bodies if own is not None]
    elements, most = sum(mesh.nelements for mesh in meshes), MOST[scene.dim]
    if elements > most:
        return Guarantee(missing=f"a search takes no bound of more than {most:,} elements.")
    try:
        bound = Bound(solved)
    except InputError as error:
        return Guarantee(missing=str(error))
    terms = bound.terms if bound.norm > 0 else {}
    law = solved.reduction.problem.law
    assumed = SMALL if law.proportional and np.any(law.rough) else ""
    try:
        middle, width = interval(bound, quantity)
    except InputError as error:
        return Guarantee(energy=terms, missing=str(error), assumed=assumed)
    relative = (abs(middle - value) + width) / (abs(value) or 1.0)
    return Guarantee(relative, terms, assumed=assumed)
