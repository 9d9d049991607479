"""What a search for an accuracy knows: one Level for every mesh, and one Estimate at the end."""

from dataclasses import dataclass

from contactopt.bounds.guarantee import Guarantee
from contactopt.cards import count, line
from contactopt.readings.peaks import Reading
from contactopt.readings.quantities import Quantity
from contactopt.solving.solve_scene import Solved


@dataclass(frozen=True)
class Level:
    """What one solve of the search gave.

    unknowns      of the displacement;   contacts  of the interface problem
    value         of the quantity;   uncertainty  of its reading [its unit]
    error         estimated, over the value [-]; None where one mesh says nothing
    seconds       wall time since the search began [s]
    energy_error  estimated, in the energy norm [-]; 0 where it is not estimated
    place, size   of a largest value: where it was read, and the size of the elements there [length]
    elements      across the contact half-width;   splits  how often the mesh was halved everywhere
    rounds        of the zone loop;   zone  half-width that the mesh resolves [length], if any
    """

    unknowns: int
    contacts: int
    value: float
    uncertainty: float
    error: float | None
    seconds: float
    energy_error: float = 0.0
    place: tuple[float, ...] = ()
    size: float = 0.0
    elements: int = 0
    splits: int = 0
    rounds: int = 1
    zone: float | None = None

    @property
    def mesh(self) -> str:
        """What the mesh is, in words."""
        error = "unknown" if self.error is None else f"{self.error:.1e}"
        things = {"element": self.elements, "split": self.splits, "contact": self.contacts}
        made = ", ".join(count(number, thing) for thing, number in things.items() if number)
        return f"{made}, estimated error {error}"


@dataclass(frozen=True, repr=False)
class Estimate:
    """What is known of a quantity after the last solve.

    value           on the last mesh;   extrapolated  the same with its estimated error added
    error           estimated over the value [-], with that of the geometry; None: unknown
    mesh_error      signed part that falls with the size of the elements [-];   grading_error  with
                    their size away from the contact [-]
    geometry_error  part that no refinement removes: the shape is not known, or surfaces overlap [-]
    order           observed order of convergence, if any
    guarantee       what is not estimated but bounded, where that was asked for
    reached         whether the error is at most the target;   message  how the search ended
    levels          all solves, in their order
    """

    quantity: str
    target: float
    value: float
    extrapolated: float | None
    error: float | None
    mesh_error: float | None
    grading_error: float | None
    geometry_error: float
    order: float | None
    guarantee: Guarantee | None
    reached: bool
    message: str
    levels: tuple[Level, ...]

    def __repr__(self) -> str:
        first, last = self.levels[0], self.levels[-1]
        error = "unknown" if self.error is None else f"{self.error:.1e}"
        meshes = count(len(self.levels), "mesh", "meshes")
        return line(
            "Estimate",
            f"{self.quantity} {self.value:.6g}",
            f"error {error} of {self.target:g}",
            f"{first.unknowns} to {last.unknowns} unknowns on {meshes}",
            f"{last.seconds:.1f} s",
        )


@dataclass(frozen=True)
class Judged:
    """What a search says of the value on its last mesh, in the unit of the quantity.

    size      of its error, infinite where one mesh says nothing
    mesh, grading  its signed parts;   order  observed
    energy    error in the energy norm, over the norm of the displacement [-]
    """

    size: float
    mesh: float = 0.0
    grading: float = 0.0
    order: float | None = None
    energy: float = 0.0


def read(quantity: Quantity, solved: Solved) -> Reading:
    """Read a quantity from a solved scene, or from the whole load path if it belongs to that."""
    if quantity.column:
        assert solved.path is not None
        return Reading(float(solved.path.history[quantity.column][-1]))
    return quantity.read(solved.reduction, solved.solution)
