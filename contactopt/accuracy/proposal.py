"""What an accuracy takes, before anything is solved: degree, elements and tolerance.

The error of a quantity on n elements across the half-width of contact, which grow away from it, is
about CONSTANTS / n^2 at most. The constants are those of eight scenes with known answers, and the
rule was judged by others: `python -m experiments.questions.front` measures both.

A profile x^m presses hardest at about a / (2 (m - 1)) from the edge of a contact of half-width a.
This is the length that the points have to resolve, so that the error of the pressure grows with
(m - 1)^2, relative to a parabola. The approach is an average and grows with m. Below a profile with
m < 2 the pressure has a cusp or is infinite, and a width next to a steep edge cannot be fitted:
there is no rule for these.

The errors of strain with linear elements cost energy by their shear and by their change of volume.
The latter weighs f = (1 - nu) / (1 - 2 nu) times as much (the uniaxial modulus over 2 G), so that
errors of pressure and approach grow like 1 + f.

A body that is pressed all around, as a shaft in a hub, has no half-width. Outside a hole of radius
R in a thick wall the strain is B / r^2. Linear elements of size h miss a share f (h / R)^2 / 12 of
its energy, and of the pressure. There n counts elements of size h along the surface.

The points of a half-space under a disc fill an area with steps along its edge, whose mean distance
from the circle falls like 1 / n: so do the errors of the approach and of the zone of stick.

Under a flat punch elements shrink towards the corner. At a zone of stick that ends at a share c of
the half-width they are 2 sqrt(1 - c) / n long, so that the error of c grows like (1 - c) / c^2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil, inf, pi, sqrt
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import ellipk, ellipkm1

from contactopt.bodies.assembled_elastic import AssembledElastic
from contactopt.coupling.posed import Posed
from contactopt.defaults import CLOSE
from contactopt.errors import InputError
from contactopt.scenes.scene import HalfSpace, Part, Scene

# what the edge of contact is: it ends by itself, at a corner of a body, or nowhere;
# degree of the displacement, 0 for a half-space without a mesh -> quantity -> error times n^2;
# where it ends nowhere, times (R / h)^2
CONSTANTS: dict[tuple[str, int], dict[str, float]] = {
    ("free", 0): {"pressure": 0.1, "width": 0.4, "approach": 0.07, "stick": 2.2},
    ("free", 1): {"pressure": 0.4, "width": 0.8, "approach": 2.0, "stick": 2.1},
    ("free", 2): {"pressure": 0.05, "width": 0.35, "approach": 0.3, "stick": 0.8},
    ("corner", 1): {"approach": 1.7, "stick": 6.6},
    ("corner", 2): {"approach": 0.15, "stick": 1.9},
    ("none", 1): {"pressure": 0.15},
    ("none", 2): {"pressure": 0.04},
}
POISSON = 0.3  # Poisson's ratio of the scenes with these constants
# around a contact in three dimensions many points say where the stick zone ends, and their errors
# cancel
AROUND = {"stick": 0.3}
DISC = {"approach": 0.12, "stick": 0.25}  # error times n of a disc on the points of a half-space
# of (1 - c) / c^2, where this is more than one; share of stick for which points under a disc do
SMALL, MOST = 0.73, 0.75
# seconds of a solution on one core: the first without regard to the mesh, the second times n^2;
# of a half-space by (three dimensions?, friction?)
POINTS = {
    (False, False): (0.012, 1e-5),
    (False, True): (0.027, 2.5e-5),
    (True, False): (0.022, 6e-5),
    (True, True): (0.045, 3e-4),
}
# of a mesh in two dimensions: the first by its degree, for each unknown, and how often it is solved
# until the zone of a contact that ends by itself has settled
FIRST, UNKNOWN, ROUNDS = {1: 0.045, 2: 0.065}, 1.4e-5, 1.7
FREE = 1 / 3  # by this share of the first seconds a mesh may be finer than an accuracy asks for
# error of a half-space for a body of some half-widths of contact: of the approach it falls with
# this size, of the rest with its square
BODY, SETTLING = 0.4, 0.6
SAFETY = 1.5  # on the constants, for scenes of other shapes and materials
POWERS = (1.8, 6.5)  # exponents of a profile, between which the pressure and width are known
PARABOLA = 2.2  # exponent up to which a width can be fitted


@dataclass(frozen=True)
class Proposal:
    """Degree of the displacement (0: a half-space), elements across the half-width of contact, the
    tolerance of the certificate, and about how many seconds a section of one body takes.
    """

    degree: int
    elements: int
    tolerance: float
    seconds: float


@dataclass(frozen=True)
class ContactFacts:
    """What the rule knows of a contact.

    edge      'free', 'corner' or 'none', as above
    size      of the smaller body over the half-width of contact
    power     m of the profile x^m, where the edge is free
    solid     whether the scene has three dimensions
    friction  whether there is friction
    poisson   the largest Poisson's ratio of the bodies, in plane stress nu / (1 + nu)
    stuck     share c of the half-width that sticks, where the edge is a corner
    turn      length of the surface that is modelled over its radius, where the edge is 'none'
    unknowns  of the mesh with n linear elements, infinite where it cannot be made
    """

    edge: str
    size: float = np.inf
    power: float = 2.0
    solid: bool = False
    friction: bool = False
    poisson: float = POISSON
    stuck: float = 1.0
    turn: float = pi / 2
    unknowns: Callable[[int], float] = lambda n: 11.0 * n**2  # of a half-space

    def elements(self, quantity: str, degree: int, accuracy: float) -> int | None:
        """How many an accuracy needs; None where there is no rule."""
        if self.edge == "corner" and degree == 0:
            few = quantity == "stick" and self.stuck < MOST
            steps = DISC.get(quantity) if self.solid and not few else None
            return None if steps is None else ceil(SAFETY * steps / accuracy)
        own = CONSTANTS.get((self.edge, degree), {}).get(quantity)
        if own is None:
            return None
        if self.edge == "free":
            own = AROUND.get(quantity, own) if self.solid and degree == 0 else own
            if quantity == "approach":
                own *= max(1.0, self.power / 2)
            elif POWERS[0] <= self.power <= (POWERS[1] if quantity == "pressure" else PARABOLA):
                own *= max(1.0, self.power - 1) ** 2
            else:
                return None
        if self.edge == "corner" and quantity == "stick":
            own *= max(1.0, SMALL * (1 - self.stuck) / self.stuck**2)
        elif self.edge == "none":
            own *= self.turn**2 * max(1.0, _volume(self.poisson) / _volume(POISSON))
        elif degree == 1 and quantity in ("pressure", "approach"):
            own *= max(1.0, (1 + _volume(self.poisson)) / (1 + _volume(POISSON)))
        return ceil(sqrt(SAFETY * own / accuracy))

    def seconds(self, degree: int, elements: int) -> tuple[float, float]:
        """The two numbers of the cost, about a number of elements."""
        if degree == 0:
            return POINTS[self.solid, self.friction]
        rounds = ROUNDS if self.edge == "free" else 1.0
        growing = UNKNOWN * self.unknowns(elements) * (degree / elements) ** 2
        return rounds * FIRST[degree], rounds * growing


def _volume(nu: float) -> float:
    """The uniaxial modulus over 2 G."""
    return (1 - nu) / (1 - 2 * nu)


def stuck_share(mu: float, nu: float, plane: bool) -> float:
    """The share c of the half-width of a rigid flat punch that sticks, within 20 %.

    The exact share (contactopt.analytic.spence.stick_ratio) would take up to a second, longer than
    most of the solutions that are proposed.
    K(sqrt(1 - c^2)) / K(c) is proportional to beta / mu, with the complete elliptic integral K and
    Dundurs' beta = (1 - 2 nu) / (2 - 2 nu).
    """
    from scipy.optimize import brentq

    wanted = (1.13 if plane else 0.78) / (2 * _volume(nu)) / mu
    low, high = 1e-3, 1 - 1e-9

    def excess(c: float) -> float:
        return float(ellipkm1(c**2) / ellipk(c**2)) - wanted

    return (
        low if excess(low) < 0 else high if excess(high) > 0 else float(brentq(excess, low, high))
    )


def propose(
    quantity: str, accuracy: float, contact: ContactFacts, degrees: tuple[int, ...] = (0, 1, 2)
) -> Proposal | None:
    """The cheapest mesh for a relative accuracy, of the degrees that are open; None where the
    quantity has no rule.
    """
    found = []
    for degree in degrees:
        needed = contact.elements(quantity, degree, accuracy)
        fits = degree > 0 or half_space_fits(quantity, accuracy, contact.size)
        if needed is None or not fits:
            continue
        first, growing = contact.seconds(degree, needed)
        if growing == inf:
            continue
        elements = max(int(sqrt(FREE * first / growing)), needed)
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
    bodies = [body for body in made.bodies if isinstance(body, AssembledElastic)]
    sizes = [float(np.ptp(body.body.locations, axis=1).min()) / width for body in bodies]
    size = min(sizes, default=np.inf)
    meshed: dict[str, Any] = {}
    if bodies:
        unknowns = partial(unknowns_of, scene)
        meshed = {"poisson": _poisson(scene), "turn": turn_of(scene, made), "unknowns": unknowns}
    mu = scene.pairs[0].mu
    if edge == "corner" and bodies and isinstance(mu, float) and mu > 0:
        meshed["stuck"] = stuck_share(mu, meshed["poisson"], scene.kind != "axisymmetric")
    flat = all(part.curve is None for part in scene.parts if isinstance(part, Part))
    meshes = (1, 2) if scene.dim == 2 else ()
    power = power_of(own.positions, own.gap, width) if edge == "free" else 2.0
    contact = ContactFacts(edge, size, power, scene.dim == 3, _rubs(scene), **meshed)
    found = propose(quantity, accuracy, contact, (0, *meshes) if flat else meshes)
    if found is None:
        return []
    what = "stick width" if quantity == "stick" else "largest pressure"
    across = (
        f"{found.elements} {'points' if found.degree == 0 else 'elements'}"
        f" {'along the surface' if edge == 'none' else 'across the half-width'}"
    )
    way = {0: "a half-space without a mesh", 1: "linear", 2: "quadratic displacements"}[
        found.degree
    ]
    given = any(isinstance(part, HalfSpace) for part in scene.parts)
    here = f"here {scene.elements}" if given or found.degree else "here there are meshes"
    return [
        f"for {100 * accuracy:.3g} % of the {what}: {way}, {across} of contact ({here}), tolerance"
        f" {found.tolerance:.0e}, about {found.seconds:.1g} s"
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


def turn_of(scene: Scene, made: Posed) -> float:
    """The length of the modelled contact surface over its radius: the angle by which it turns, or
    the length along the axis over the distance from it.
    """
    own = made.couplings[0]
    if scene.kind == "axisymmetric":
        return float(np.ptp(own.positions[1]) / np.abs(own.positions[0]).mean())
    normals = own.frames[:, 0]
    return float(np.arccos(np.clip((normals @ normals[0]).min(initial=1.0), -1, 1)))


def unknowns_of(scene: Scene, elements: int) -> float:
    """Of its meshes with linear displacements; infinite where they cannot be made."""
    parts = [part for part in scene.parts if isinstance(part, Part)]
    try:
        return sum(float(part.build_mesh(elements, scene.zone).p.size) for part in parts)
    except InputError:
        return inf


def _poisson(scene: Scene) -> float:
    """The largest Poisson's ratio of the bodies; in plane stress that of their strain in plane."""
    ratios = [part.material.nu for part in scene.parts if isinstance(part, Part)]
    largest = max(ratios, default=POISSON)
    return largest / (1 + largest) if scene.kind == "plane-stress" else largest


def power_of(positions: np.ndarray, gap: np.ndarray, width: float) -> float:
    """The exponent m of a gap that grows like |x|^m from its least value, on positions (dim, k).

    It is the median over the places x beyond half of the width, each compared with the node next to
    x / 2; nan where the middle half of them spreads by more than one, as on a rough surface.
    """
    low = int(gap.argmin())
    x, rise = (positions - positions[:, [low]]).T, gap - gap[low]
    far = np.linalg.norm(x, axis=1)
    outer = np.flatnonzero((far > width / 2) & (far <= 1.01 * width))
    inner = cKDTree(x).query(x[outer] / 2)[1]
    outer, inner = (
        own[(rise[inner] > 0) & (rise[outer] > 0) & (inner != low)] for own in (outer, inner)
    )
    if not len(outer):
        return float("nan")
    powers = np.log(rise[outer] / rise[inner]) / np.log(far[outer] / far[inner])
    first, middle, last = np.quantile(powers, (0.25, 0.5, 0.75))
    return float(middle) if last - first < 1 else float("nan")


def _rubs(scene: Scene) -> bool:
    """Whether there is friction."""
    mu = scene.pairs[0].mu
    return callable(mu) or bool(np.any(np.asarray(mu, dtype=float) > 0))
