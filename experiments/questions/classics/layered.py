"""A rigid cylinder on layers that are bonded to each other and lie on a rigid base.

Under the pressure cos(kx) the surface of the layers sinks by 2 M(k) cos(kx) / (k E'), with E' = E /
(1 - nu^2) of the uppermost one. In each layer Airy's function is F(s) cos(kx) / k^2 with s = k y
from its upper side down, to its lower side at H, and

    F = (a_1 + a_2 s) e^(-s) + (a_3 + a_4 (H - s)) e^(s - H).

The stresses on level planes are -F cos(kx) and F' sin(kx). The displacements times k E' are (F'' +
m F) sin(kx) and (F''' - (2 + m) F') cos(kx), with m = nu / (1 - nu) for plane strain. All four are
continuous between two layers. On the surface F = 1 and F' = 0. On the base no displacement is
left; one without friction has F' = 0 instead of the first. M is half of F''' on the surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contactopt.material import Material
from experiments.questions.classics.zone_equation import K, W, peak_of, transforms, zone_of

Layers = tuple[tuple[float, Material], ...]  # heights and materials, from the surface down


@dataclass(frozen=True)
class Pressed:
    """Half-width and approach [length], and the largest pressure [stress]."""

    half_width: float
    peak: float
    approach: float


def pressed_cylinder(force: float, radius: float, layers: Layers, bonded: bool) -> Pressed:
    """What a force per length on a rigid cylinder makes of layers on a base that is `bonded` to
    them or without friction. The height of the first layer and the half-width are of the order of
    1.
    """
    stiff = _plane(layers[0][1])[0]
    fading = sinking(K, layers, bonded) - 1
    b, d = zone_of(fading, lambda x: -stiff * x**2 / (4 * radius), force, (0.05, 5.0))
    j = np.arange(1, len(d))
    # int_0^oo (J_0(kb) - e^(-k)) dk / k = ln(2 / b), and int_0^oo J_2j(kb) dk / k = 1 / (2j)
    plane = force * np.log(2 / b) + np.pi * b * np.sum((-1.0) ** j * d[1:] / (2 * j))
    layered = (d @ transforms(b) * fading + force * np.exp(-K)) @ (W / K)
    return Pressed(b, peak_of(d), float(2 * (plane + layered) / (np.pi * stiff)))


def sinking(k: np.ndarray, layers: Layers, bonded: bool) -> np.ndarray:
    """M at wave numbers (n,)."""
    count = 4 * len(layers)
    system, right = np.zeros((len(k), count, count)), np.zeros((len(k), count, 1))
    for number, (height, material) in enumerate(layers):
        E, m = _plane(material)
        at = slice(4 * number, 4 * number + 4)
        above, below = (_states(k * y, k * height, E, m) for y in (0.0, height))
        if number == 0:
            system[:, :2, at] = above[:, :2]
        else:
            system[:, 4 * number - 2 : 4 * number + 2, at] = -above
        if number == len(layers) - 1:
            below = below[:, [2 if bonded else 1, 3]]
        system[:, 4 * number + 2 : 4 * number + 2 + below.shape[1], at] = below
    right[:, 0] = 1.0
    numbers = np.linalg.solve(system, right)[:, :4]
    E, m = _plane(layers[0][1])
    surface = _states(0 * k, layers[0][0] * k, E, m) @ numbers
    return np.asarray(surface[:, 3, 0] * E / 2)


def _plane(material: Material) -> tuple[float, float]:
    return material.E / (1 - material.nu**2), material.nu / (1 - material.nu)


def _states(s: np.ndarray, H: np.ndarray, E: float, m: float) -> np.ndarray:
    """The two stresses and the two displacements that each of the four numbers makes, (n, 4, 4)."""
    down, up = _derivatives(s), _derivatives(H - s) * np.array([[1.0], [-1.0], [1.0], [-1.0]])
    F, F1, F2, F3 = np.moveaxis(np.concatenate([down, up], axis=2), 1, 0)
    return np.stack([F, F1, (F2 + m * F) / E, (F3 - (2 + m) * F1) / E], axis=1)


def _derivatives(s: np.ndarray) -> np.ndarray:
    """e^(-s) and s e^(-s) with three derivatives, (n, 4, 2)."""
    rows = [[1 + 0 * s, s], [-1 + 0 * s, 1 - s], [1 + 0 * s, s - 2], [-1 + 0 * s, 3 - s]]
    return np.asarray(np.moveaxis(np.array(rows), 2, 0) * np.exp(-s)[:, None, None])
