"""Rigid blocks that rest on each other: stacks, walls, arches, wedges and chains.

One implicit time step from rest under gravity and a load: W = H M^-1 H', q = step H M^-1 f, with H
the contact velocities of the bodies' velocities (rigid_motion). Faces touch at `points` points
each, which two (in space four) would describe: with more of them, and in walls, forces are
redundant, and W is singular.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from contactopt.benchmark.families.packings import velocities
from contactopt.errors import InputError
from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb


@dataclass
class _Blocks:
    """places (n, dim), sizes (n, dim) along the axes of each block, faces: first body, second
    body, middle of the face, normal, half length. Body 0 is fixed.
    """

    places: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, -0.5)])
    sizes: list[tuple[float, float]] = field(default_factory=lambda: [(1.0, 1.0)])
    faces: list[tuple[int, int, tuple[float, float], tuple[float, float], float]] = field(
        default_factory=list
    )
    loads: dict[int, tuple[float, float]] = field(default_factory=dict)

    def add(self, place: tuple[float, float], size: tuple[float, float] = (1.0, 1.0)) -> int:
        self.places.append(place)
        self.sizes.append(size)
        return len(self.places) - 1

    def touch(
        self,
        first: int,
        second: int,
        middle: tuple[float, float],
        normal: tuple[float, float] = (0.0, 1.0),
        half: float = 0.5,
    ) -> None:
        self.faces.append((first, second, middle, normal, half))


def _stack(size: int) -> _Blocks:
    made = _Blocks()
    for i in range(size):
        made.touch(i, made.add((0.0, i + 0.5)), (0.0, float(i)))
    return made


def _wall(size: int) -> _Blocks:
    """Rows of bricks of width two, each row half a brick further."""
    made, below = _Blocks(), dict[float, int]()
    for row in range(size):
        x = [2.0 * i + row % 2 for i in range(size)]
        here = {at: made.add((at, row + 0.5), (2.0, 1.0)) for at in x}
        for at, brick in here.items():
            for side in (-0.5, 0.5):
                under = below.get(at + 2 * side) if row else 0
                if under is not None:
                    made.touch(under, brick, (at + side, float(row)))
        below = here
    return made


def _arch(size: int) -> _Blocks:
    """Half a circle of stones of radius 5 and thickness 1.2 on two springings."""
    made, turn = _Blocks(), np.pi / size
    for i in range(size):
        middle = (i + 0.5) * turn
        made.add((5 * np.cos(middle), 5 * np.sin(middle)), (5 * turn, 1.2))
    for i in range(size + 1):
        at = i * turn
        made.touch(
            i,
            i + 1 if i < size else 0,
            (5 * np.cos(at), 5 * np.sin(at)),
            (-np.sin(at), np.cos(at)),
            0.6,
        )
    return made


def _wedge(size: int) -> _Blocks:
    """Blocks on the floor, and between each two of them a wedge that is pressed down."""
    made, slope = _Blocks(), (np.cos(0.25), np.sin(0.25))
    blocks = [made.add((3.0 * i, 0.5), (2.0, 1.0)) for i in range(size + 1)]
    for i, block in enumerate(blocks):
        made.touch(0, block, (3.0 * i, 0.0), half=1.0)
    for i in range(size):
        wedge = made.add((3.0 * i + 1.5, 0.8), (1.0, 1.0))
        made.loads[wedge] = (0.0, -5.0)
        made.touch(blocks[i], wedge, (3.0 * i + 1.1, 0.7), slope, 0.3)
        made.touch(blocks[i + 1], wedge, (3.0 * i + 1.9, 0.7), (-slope[0], slope[1]), 0.3)
    return made


def _chain(size: int) -> _Blocks:
    """A row of blocks that friction carries, pressed against a wall from its free end."""
    made = _Blocks()
    for i in range(size):
        made.touch(i, made.add((i + 0.5, 0.5)), (float(i), 0.5), (1.0, 0.0))
    made.loads[size] = (-4.0 * size, 0.0)
    return made


def _row(size: int) -> _Blocks:
    """Blocks between two walls, held by any pressure that is large enough: many solutions."""
    made = _chain(size)
    made.touch(size, 0, (float(size), 0.5), (1.0, 0.0))
    made.loads = {}
    return made


SHAPES: dict[str, Callable[[int], _Blocks]] = {
    "stack": _stack,
    "wall": _wall,
    "arch": _arch,
    "wedge": _wedge,
    "chain": _chain,
    "row": _row,
}


def rigid_blocks(
    shape: str = "stack",
    size: int = 4,
    points: int = 2,
    mu: float = 0.5,
    tilt: float = 0.0,
    heavier: float = 1.0,
    narrow: float = 0.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> InterfaceProblem:
    """Rigid blocks in the plane.

    shape    a key of SHAPES;  size: how many blocks it has, in a row or in all
    points   contact points of each face
    tilt     angle of gravity to the vertical [rad]
    heavier  density of the last block over that of the first; those between are graded
    narrow   overlap of all faces, over what gravity closes in the step
    jitter   random part of the gaps, over that which gravity closes in the step
    """
    if shape not in SHAPES or size < 1 or points < 1:
        raise InputError(
            f"rigid_blocks needs a shape of {', '.join(SHAPES)}, size and points at least 1."
        )
    made = SHAPES[shape](size)
    places, sizes = np.array(made.places), np.array(made.sizes)
    first, second, middle, normal, half = (np.array(part) for part in zip(*made.faces))
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    along = np.linspace(-1, 1, points) if points > 1 else np.zeros(1)
    where = middle[:, None] + along[:, None] * (half[:, None] * tangent)[:, None]
    frame = np.repeat(np.stack([normal, tangent], axis=2), points, axis=0)
    pairs = np.repeat(np.stack([first, second], axis=1), points, axis=0)
    H = velocities(places, pairs, where.reshape(-1, 2), frame)
    mass = np.prod(sizes, axis=1) * np.geomspace(1, heavier, len(sizes))
    inverse = 1 / np.stack([mass, mass, mass * np.sum(sizes**2, axis=1) / 12], axis=1)
    force = np.zeros((len(places), 3))
    force[:, :2] = mass[:, None] * np.array([np.sin(tilt), -np.cos(tilt)])
    for body, load in made.loads.items():
        force[body, :2] += load
    inverse[0] = 0.0
    W = H @ sp.diags_array(inverse.ravel()) @ H.T
    q = (H @ (inverse * force).ravel()).reshape(-1, 2)
    q[:, 0] += jitter * np.abs(np.random.default_rng(seed).normal(size=len(q))) - narrow
    return InterfaceProblem(
        sp.csr_array(W), q, Coulomb(np.full(len(q), mu)), coordinates=where.reshape(-1, 2).T
    )
