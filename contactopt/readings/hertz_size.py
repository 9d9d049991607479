"""The size of elements that a contact of curved surfaces needs, from Hertz's half-widths, before
anything is solved.

Near the place where the surfaces are nearest to each other their gap is y' H y / 2, of the tangents
y. A quadratic fit through the nearest contacts gives H, and its eigenvalues are the relative
curvatures. An ellipse that would be longer than the surface is a line along it. The force of each
pair is the one that balances the loads, where one normal force at each of these places can do that.
Source: Johnson (1985), Contact Mechanics, sections 4.1 and 4.2.
"""

from typing import NamedTuple

import numpy as np

from contactopt.coupling.coupling import Coupling
from contactopt.coupling.posed import Posed
from contactopt.defaults import EQUAL
from contactopt.problem import InterfaceProblem
from contactopt.scenes.scene import Scene

NEAREST = {2: 5, 3: 16}  # contacts that are fitted, by the dimension
ROUND, LONG = 1.001, 1e4  # ratios of curvatures between which a contact is an ellipse
STRAIGHT = 1e-2  # of the larger curvature: below, the smaller one may be that of facets alone
COARSEST, WANTED = 4.0, 8.0  # elements along the smallest half-width: too few, and enough
ALONG = 0.9  # cosine of the angle between a direction and a plane's normal that are the same
BALANCED = 1e-3  # share of the loads that the forces of the pairs may leave


class Hertz(NamedTuple):
    """What is predicted of a pair: its place (dim,), force, half-widths, the smallest last, the
    size of the elements there [length], and directions (dim - 1, dim) of the half-widths.
    """

    place: np.ndarray
    force: float
    widths: tuple[float, ...]
    size: float
    axes: np.ndarray

    def away(self, points: np.ndarray) -> np.ndarray:
        """Distances (m,) of points (dim, m) from the rectangle around the contact [length]."""
        offset = points - self.place[:, None]
        along = self.axes @ offset
        widths = np.resize(self.widths, len(along))[:, None]
        beyond = np.maximum(np.abs(along) - widths, 0.0)
        across = offset - self.axes.T @ along
        return np.asarray(np.sqrt(np.sum(beyond**2, axis=0) + np.sum(across**2, axis=0)))

    def words(self, length: str, face: str, area: float) -> list[str]:
        """What is predicted, and the command that makes elements small enough, unless they are."""
        if self.size <= self.widths[-1] / COARSEST:
            return []
        widths = " and ".join(f"{width:.3g}" for width in self.widths)
        wanted = self.widths[-1] / WANTED
        place = ",".join(f"{x:.6g}" for x in np.round(self.place, 9) + 0.0)
        many = area > 20_000 * wanted ** (len(self.place) - 1)  # else they grow from a point
        fine = f"{place}:{wanted / 2:.2g}" if many else f"{face}:{wanted:.2g}"
        return [
            f"  Hertz predicts half-widths of {widths} {length} under a force of {self.force:.4g};"
            f" elements there are {self.size:.2g} long",
            f"  contactopt mesh PART --fine {fine} makes finer ones from the CAD file PART",
        ]


def ellipse(force: float, modulus: float, small: float, large: float) -> tuple[float, ...]:
    """The half-widths of a contact with two relative curvatures [1 / length], the larger first."""
    from scipy.optimize import brentq  # late, since it takes long to import
    from scipy.special import ellipe, ellipkm1

    if large <= ROUND * small:
        return ((3 * force / (2 * modulus * (small + large))) ** (1 / 3),)

    def excess(square: float) -> float:  # of the ratio of curvatures, by (b / a)^2
        K, E = ellipkm1(square), ellipe(1 - square)
        return float((E / square - K) / (K - E) - large / small)

    square = brentq(excess, 1e-12, 1 - 1e-9)
    K, E = ellipkm1(square), ellipe(1 - square)
    a = (3 * force * (K - E) / (np.pi * modulus * (1 - square) * small)) ** (1 / 3)
    return float(a), float(a * np.sqrt(square))


def _line(force_per_length: float, modulus: float, curvature: float) -> float:
    """The half-width of a contact with one relative curvature [1 / length]."""
    return float(np.sqrt(4 * force_per_length / (np.pi * modulus * curvature)))


def _nearest(made: Coupling) -> int:
    """The contact with the least gap, of those along a line the one in the middle."""
    equal = np.flatnonzero(made.gap - made.gap.min() <= EQUAL * np.ptp(made.gap))
    x = made.positions[:, equal]
    return int(equal[np.argmin(np.linalg.norm(x - x.mean(axis=1, keepdims=True), axis=0))])


def hertz(scene: Scene, posed: Posed, free: InterfaceProblem) -> dict[str, Hertz]:
    """The prediction, by name, for each curved pair whose force follows from statics."""
    from scipy.optimize import nnls  # late, since it takes long to import

    pairs = zip(free.pairs, posed.couplings)
    nearest = [pair.contacts.start + _nearest(made) for pair, made in pairs]
    work = free.V.reshape(free.contacts, scene.dim, -1)[nearest, 0]  # (pairs, motions)
    if np.linalg.matrix_rank(work) < len(nearest):
        return {}
    pushed = np.abs(work).max(axis=0) > BALANCED * np.abs(work).max()  # friction takes the others
    forces, left = nnls(work.T[pushed], -free.s[pushed])
    if left > BALANCED * np.linalg.norm(free.s[pushed]):
        return {}
    parts, found = {part.name: part for part in scene.parts}, {}
    for pair, made, force in zip(scene.pairs, posed.couplings, forces):
        materials = [getattr(parts[name], "material", None) for name in pair.bodies]
        modulus = 1 / sum((1 - own.nu**2) / own.E for own in materials if own is not None)
        at = _nearest(made)
        apart = made.positions - made.positions[:, at : at + 1]
        y = made.frames[at, 1:] @ apart
        order = np.argsort(np.linalg.norm(apart, axis=0))[: NEAREST[scene.dim]]
        rows, columns = np.triu_indices(len(y))
        near = y[:, order]
        terms = np.vstack([np.ones(len(order)), near, near[rows] * near[columns]])
        fit, _, rank, _ = np.linalg.lstsq(terms.T, made.gap[order], rcond=1e-8)
        H = np.zeros((len(y), len(y)))
        H[rows, columns] = fit[1 + len(y) :]
        curvatures, ways = np.linalg.eigh(H + H.T)
        small, *_, large = [*curvatures] * (3 - len(y))
        if abs(small) < STRAIGHT * large:
            small = max(small, 2 * large / LONG)
        if rank < len(terms) or not (force > 0 and large < LONG * small):
            continue
        if scene.copies > 1:  # of one of the images, where they are apart
            force *= 2 ** len(made.planes) / scene.copies
        place, axes = made.positions[:, at], ways.T @ made.frames[at, 1:]
        size = float(np.linalg.norm(apart[:, order[1]]))
        if scene.dim == 3:
            widths = ellipse(force, modulus, small, large)
            cut = any(abs(plane.inward @ axes[0]) > ALONG for plane in made.planes)
            ends = axes[0] @ made.positions
            length = float(np.ptp(ends)) * (1 + cut)
            if widths[0] > length / 2:
                widths = length / 2, _line(force / length, modulus, large)
                place = place + axes[0] * ((ends.min() + ends.max()) / 2 - ends[at])
        elif scene.analysis.revolved and place[0] <= size:
            widths = ellipse(force, modulus, large, large)
        else:
            depth = 2 * np.pi * place[0] if scene.analysis.revolved else scene.thickness
            widths = (_line(force / depth, modulus, large),)
        if widths[-1] < np.ptp(made.positions, axis=1).max():
            found[pair.name] = Hertz(place, force, widths, size, axes)
    return found
