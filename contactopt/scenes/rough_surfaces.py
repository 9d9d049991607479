"""Self-affine rough surfaces, made from a seed."""

import math

import numpy as np

from contactopt.checks import check_count, check_number, check_positive
from contactopt.defaults import ROUNDED
from contactopt.errors import InputError


def self_affine(
    points: tuple[int, int],
    lengths: tuple[float, float],
    *,
    hurst: float = 0.8,
    longest: float | None = None,
    shortest: float | None = None,
    roll_off: float | None = None,
    slope: float = 0.1,
    seed: int = 0,
) -> np.ndarray:
    """Draw heights (nx, ny) [length] of a periodic self-affine rough surface from a seed.
    InputError on cut-offs that are out of order or that the points do not resolve.

    The heights are Gaussian, with Hurst's exponent from 0 to 1, and `slope` is the root mean square
    of their gradient. Their power spectrum falls with the wave number k as k^(-2 (1 + hurst))
    between the wavelengths `roll_off` and `shortest`, is constant from `longest` to `roll_off`, and
    zero beyond. By default `longest` and `roll_off` are the shorter of the lengths, and `shortest`
    is eight spacings of the points. The same seed gives the same waves on every grid that resolves
    `shortest`.

    Source: Persson et al. (2005), On the nature of surface roughness with application to contact
    mechanics, J. Phys.: Condens. Matter 17, R1-R62.
    """
    for name, pair in (("points", points), ("lengths", lengths)):
        if np.shape(pair) != (2,):
            raise InputError(f"{name} must be two numbers, along x and y; got {pair!r}.")
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InputError(f"the seed must be a whole number of at least 0; got {seed!r}.")
    for axis, count in zip("xy", points):
        check_count(f"the number of points along {axis}", count)
    check_positive(**{"length along x": lengths[0], "length along y": lengths[1], "slope": slope})
    check_number("Hurst's exponent", hurst, low=0.0, high=1.0 + ROUNDED)
    longest, shortest, roll_off = _wavelengths(points, lengths, longest, shortest, roll_off)
    reach = [math.floor(size / shortest * (1 + ROUNDED)) for size in lengths]
    orders = np.meshgrid(*[np.arange(-m, m + 1) for m in reach], indexing="ij")
    k = np.hypot(orders[0] / lengths[0], orders[1] / lengths[1])
    passed = (k >= (1 - ROUNDED) / longest) & (k <= (1 + ROUNDED) / shortest)
    if not passed.any():
        raise InputError(
            "no wave of the period lies between the shortest and the longest wavelength; widen the"
            " band."
        )
    size = np.where(passed, np.maximum(k, 1 / roll_off) ** -(1 + hurst), 0.0)
    return slope * _of_unit_slope(size, k, points, seed)


def _wavelengths(
    points: tuple[int, int],
    lengths: tuple[float, float],
    longest: float | None,
    shortest: float | None,
    roll_off: float | None,
) -> tuple[float, float, float]:
    """The three wavelengths, usual ones where none are given; InputError for what is no band."""
    spacing = max(size / count for size, count in zip(lengths, points))
    longest = min(lengths) if longest is None else longest
    shortest = 8 * spacing if shortest is None else shortest
    roll_off = longest if roll_off is None else roll_off
    for name, value in (("longest", longest), ("shortest", shortest), ("roll-off", roll_off)):
        check_number(f"{name} wavelength", value, low=0.0)
    if not 2 * spacing * (1 - ROUNDED) <= shortest <= roll_off <= longest:
        raise InputError(
            f"the wavelengths must grow from two spacings ({2 * spacing:g}) to shortest, roll_off"
            f" and longest; got {shortest:g}, {roll_off:g} and {longest:g}."
        )
    if any(2 * math.floor(L / shortest * (1 + ROUNDED)) >= n for L, n in zip(lengths, points)):
        raise InputError(
            f"the shortest wavelength ({shortest:g}) must be longer than two spacings"
            f" ({2 * spacing:g})."
        )
    return longest, shortest, roll_off


def _of_unit_slope(
    size: np.ndarray, k: np.ndarray, points: tuple[int, int], seed: int
) -> np.ndarray:
    """Heights on a grid whose waves have random phases, given the sizes of the waves and their wave
    numbers k, both of the orders -m to m along each axis. The gradient's root mean square is one.
    """
    random = np.random.default_rng(seed)
    waves = size * (random.normal(size=k.shape) + 1j * random.normal(size=k.shape))
    at = (np.arange(-(length // 2), length // 2 + 1) for length in k.shape)
    spectrum = np.zeros(points, dtype=complex)
    spectrum[np.ix_(*(orders % n for orders, n in zip(at, points)))] = waves
    heights = np.fft.ifft2(spectrum).real * np.prod(points)
    # The real part keeps the even half of every pair of opposite waves.
    even = (waves + np.conj(waves[::-1, ::-1])) / 2
    return np.asarray(heights / np.sqrt(np.sum((2 * np.pi * k) ** 2 * np.abs(even) ** 2)))
