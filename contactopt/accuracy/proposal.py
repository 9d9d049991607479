"""What an accuracy takes, before anything is solved: degree, elements and tolerance.

The error of a quantity on n elements across the half-width of contact, which grow away from it, is
about CONSTANTS / n^2 at most. The constants are those of eight scenes with known answers, and the
rule was judged by twenty others: `python -m experiments.questions.front` measures both.
"""

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.coupling.posed import Posed
from contactopt.defaults import CLOSE
from contactopt.scenes.scene import HalfSpace, Part, Scene

# what the edge of contact is: it ends by itself, at a corner of a body, or nowhere;
# degree of the displacement, 0 for a half-space without a mesh -> quantity -> error times n^2
CONSTANTS: dict[tuple[str, int], dict[str, float]] = {
    ("free", 0): {"pressure": 0.1, "width": 0.4, "approach": 0.07, "stick": 0.8},
    ("free", 1): {"pressure": 0.4, "width": 0.8, "approach": 2.0, "stick": 0.8},
    ("free", 2): {"pressure": 0.05, "width": 0.35, "approach": 0.3, "stick": 0.8},
    ("corner", 0): {"approach": 0.7, "stick": 0.8},
    ("corner", 1): {"approach": 1.7, "stick": 6.6},
    ("corner", 2): {"approach": 0.15, "stick": 1.9},
    ("none", 1): {"pressure": 0.8},
    ("none", 2): {"pressure": 0.1},
}
# degree -> elements below which a mesh is hardly cheaper, and seconds of a solution on one core:
# the first without regard to the mesh, the second times n^2
FEWEST = {0: 16, 1: 8, 2: 4}
SECONDS = {0: (0.015, 4e-5), 1: (0.06, 3e-4), 2: (0.06, 1.4e-3)}
# error of a half-space for a body of some half-widths of contact: of the approach it falls with
# this size, of the rest with its square
BODY, SETTLING = 0.4, 0.6
SAFETY = 1.5  # on the constants, for scenes of other shapes and materials


@dataclass(frozen=True)
class Proposal:
    """Degree of the displacement (0: a half-space), elements across the half-width of contact, the
    tolerance of the certificate, and about how many seconds a section of one body takes.
    """

    degree: int
    elements: int
    tolerance: float
    seconds: float


def propose(
    quantity: str, accuracy: float, edge: str, size: float, degrees: tuple[int, ...] = (0, 1, 2)
) -> Proposal | None:
    """The cheapest mesh for a relative accuracy; None where the quantity has no rule.

    edge     'free', 'corner' or 'none', as above
    size     of the smaller body over the half-width of contact
    degrees  that are open
    """
    found = []
    for degree in degrees:
        constant = CONSTANTS.get((edge, degree), {}).get(quantity)
        if constant is None or (degree == 0 and not half_space_fits(quantity, accuracy, size)):
            continue
        elements = max(FEWEST[degree], ceil(sqrt(SAFETY * constant / accuracy)))
        first, growing = SECONDS[degree]
        seconds = first + growing * elements**2
        found.append(Proposal(degree, elements, 0.01 * accuracy, seconds))  # for the solver
    return min(found, key=lambda own: own.seconds, default=None)


def half_space_fits(quantity: str, accuracy: float, size: float) -> bool:
    """Whether a body of a size over the half-width is a half-space to half of the accuracy."""
    error = SETTLING / size if quantity == "approach" else BODY / size**2
    return error <= accuracy / 2


def accuracy_lines(scene: Scene, made: Posed, accuracy: float = 0.01) -> list[str]:
    """One sentence on what an accuracy takes, for a scene of one pair; none without a rule."""
    if len(made.couplings) != 1 or any(part.given for part in scene.parts if part.elastic):
        return []
    own, edge = made.couplings[0], edge_of(scene, made)
    if edge == "corner" and all(part.elastic for part in scene.parts):
        return []  # the rule knows rigid punches alone
    quantity = "stick" if edge == "corner" else "pressure"
    width = scene.zone or float(np.linalg.norm(np.ptp(own.positions, axis=1))) / 2
    if scene.zone is None and (scene.kind == "axisymmetric" or scene.copies > 1):
        width *= 2  # the half that is modelled is as wide as the half-width
    bodies = [body.body for body in made.bodies if isinstance(body, AssembledElastic)]
    sizes = [float(np.ptp(body.locations, axis=1).min()) / width for body in bodies]
    size = min(sizes, default=np.inf)
    flat = all(part.curve is None for part in scene.parts if isinstance(part, Part))
    meshes = (1, 2) if scene.dim == 2 else ()
    found = propose(quantity, accuracy, edge, size, (0, *meshes) if flat else meshes)
    if found is None:
        return []
    what = "stick width" if quantity == "stick" else "largest pressure"
    across = (
        f"{found.elements} {'points' if found.degree == 0 else 'elements'} across the half-width"
    )
    seconds = found.seconds * (max(1, len(bodies)) if found.degree else 1)
    way = {0: "a half-space without a mesh", 1: "linear", 2: "quadratic displacements"}[
        found.degree
    ]
    given = any(isinstance(part, HalfSpace) for part in scene.parts)
    here = f"here {scene.elements}" if given or found.degree else "here there are meshes"
    return [
        f"for {accuracy:.0%} of the {what}: {way}, {across} of contact ({here}), tolerance"
        f" {found.tolerance:.0e}, about {seconds:.1g} s"
    ]


def edge_of(scene: Scene, made: Posed) -> str:
    """Where contact ends: 'free' by itself, 'corner' with a surface, 'none' around a body."""
    own = made.couplings[0]
    size = float(np.ptp(own.positions, axis=1).max(initial=0.0)) or 1.0
    if scene.zone is not None or float(np.ptp(own.gap)) > CLOSE * size:
        return "free"
    normals = own.frames[:, 0]
    turned = float((normals @ normals[0]).min(initial=1.0))
    return (
        "none"
        if turned < CLOSE or (scene.kind == "axisymmetric" and abs(normals[0, 0]) > 0.5)
        else "corner"
    )
