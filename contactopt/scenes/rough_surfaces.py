"""Rough surfaces: self-affine ones made from a seed, and measured ones read from files."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import numpy as np

from contactopt.checks import check_count, check_number, check_positive, real_array
from contactopt.errors import InputError

INSTRUMENTS = (
    # what surfalize reads
    "sur, x3p, vk4, vk6, vk7, plu, plux, al3d, opd, nms, sdf, gwy, os3d, zmg, zon, mnt"
)


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
    """Draw heights of a periodic self-affine rough surface from a seed.

    The heights are Gaussian. Their power spectrum falls with the wave number k as k^(-2 (1 +
    hurst)) between the wavelengths `roll_off` and `shortest`, is constant from `longest` to
    `roll_off`, and zero beyond. The same seed gives the same waves on every grid that resolves
    `shortest`.

    Source: Persson et al. (2005), On the nature of surface roughness with application to contact
    mechanics, J. Phys.: Condens. Matter 17, R1-R62.

    Parameters
    ----------
    points, lengths : Number of points, and length of the period, along x and y [length].
    hurst : Hurst's exponent, from 0 to 1 [-].
    longest, shortest : Cut-off wavelengths [length]; by default the shorter of the lengths, and
        eight spacings of the points.
    roll_off : Wavelength above which the spectrum is constant [length]; by default `longest`.
    slope : Root mean square of the gradient of the heights [-].
    seed : Of the random numbers.

    Returns
    -------
    (nx, ny) heights [length].

    Raises
    ------
    InputError : On cut-offs that are out of order or that the points do not resolve.
    """
    for name, pair in (("points", points), ("lengths", lengths)):
        if np.shape(pair) != (2,):
            raise InputError(f"{name} must be two numbers, along x and y; got {pair!r}.")
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InputError(f"the seed must be a whole number of at least 0; got {seed!r}.")
    for name, value in (
        ("the number of points along x", points[0]),
        ("the number of points along y", points[1]),
    ):
        check_count(name, value)
    check_positive(**{"length along x": lengths[0], "length along y": lengths[1], "slope": slope})
    check_number("Hurst's exponent", hurst, low=0.0, high=1.0 + 1e-12)
    spacing = max(size / count for size, count in zip(lengths, points))
    longest = min(lengths) if longest is None else longest
    shortest = 8 * spacing if shortest is None else shortest
    roll_off = longest if roll_off is None else roll_off
    check_positive(
        **{
            "longest wavelength": longest,
            "shortest wavelength": shortest,
            "roll-off wavelength": roll_off,
        }
    )
    if not 2 * spacing * (1 - 1e-12) <= shortest <= roll_off <= longest:
        raise InputError(
            f"the wavelengths must grow from two spacings ({2 * spacing:g}) to shortest, roll_off"
            f" and longest; got {shortest:g}, {roll_off:g} and {longest:g}."
        )
    reach = [math.floor(size / shortest * (1 + 1e-12)) for size in lengths]
    if any(2 * m >= n for m, n in zip(reach, points)):
        raise InputError(
            f"the shortest wavelength ({shortest:g}) must be longer than two spacings"
            f" ({2 * spacing:g})."
        )
    orders = np.meshgrid(*[np.arange(-m, m + 1) for m in reach], indexing="ij")
    k = np.hypot(orders[0] / lengths[0], orders[1] / lengths[1])
    passed = (k >= (1 - 1e-12) / longest) & (k <= (1 + 1e-12) / shortest)
    size = np.where(passed, np.maximum(k, 1 / roll_off) ** -(1 + hurst), 0.0)
    if not passed.any():
        raise InputError(
            "no wave of the period lies between the shortest and the longest wavelength; widen the"
            " band."
        )
    random = np.random.default_rng(seed)
    waves = size * (random.normal(size=k.shape) + 1j * random.normal(size=k.shape))
    spectrum = np.zeros(points, dtype=complex)
    spectrum[np.ix_(*(np.arange(-m, m + 1) % n for m, n in zip(reach, points)))] = waves
    heights = np.fft.ifft2(spectrum).real * np.prod(points)
    # The real part keeps the even half of every pair of opposite waves.
    even = (waves + np.conj(waves[::-1, ::-1])) / 2
    gradient = np.sqrt(np.sum((2 * np.pi * k) ** 2 * np.abs(even) ** 2))
    return np.asarray(heights * (slope / gradient))


def rms_slope(heights: np.ndarray, lengths: tuple[float, float]) -> float:
    """Compute the root mean square of the gradient of a periodic rough surface.

    Parameters
    ----------
    heights : (nx, ny) heights [length].
    lengths : Lengths of the period along x and y [length].

    Returns
    -------
    The root mean square [-].
    """
    spectrum = np.fft.fft2(heights) / heights.size
    k = np.meshgrid(
        *(np.fft.fftfreq(n, size / n) for n, size in zip(heights.shape, lengths)), indexing="ij"
    )
    return float(
        np.sqrt(np.sum((2 * np.pi) ** 2 * (k[0] ** 2 + k[1] ** 2) * np.abs(spectrum) ** 2))
    )


def read_surface(path: str | Path) -> tuple[np.ndarray, tuple[float, float] | None]:
    """Read a measured rough surface from a file.

    A `.npy` file and a table of numbers in text (`.txt`, `.csv`, `.asc`, `.dat`) hold the heights
    alone, with x along the rows. Files of instruments are read by the package surfalize, if it is
    installed; their heights and lengths are in micrometres.

    Parameters
    ----------
    path : The file.

    Returns
    -------
    Heights (nx, ny), and the lengths along x and y, or None where the file does not hold them.

    Raises
    ------
    InputError : On files that cannot be read, and on heights that are missing: fill them in first.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"there is no file '{path}' to read a surface from.")
    lengths: tuple[float, float] | None = None
    kind = path.suffix.lower()
    try:
        if kind == ".npy":
            heights = np.load(path, allow_pickle=False)
        elif kind in (".txt", ".csv", ".asc", ".dat"):
            heights = np.loadtxt(path, delimiter="," if kind == ".csv" else None, ndmin=2)
        else:
            heights, lengths = _measured(path)
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' holds no table of heights: {error}.") from error
    if (
        np.size(heights)
        and np.asarray(heights).dtype.kind in "fiu"
        and not np.all(np.isfinite(heights))
    ):
        missing = int(np.count_nonzero(~np.isfinite(heights)))
        raise InputError(
            f"'{path}' misses {missing} heights; fill them in before the surface is used."
        )
    heights = real_array(f"the heights in '{path}'", heights)
    if heights.ndim != 2 or min(heights.shape) < 4:
        raise InputError(
            f"'{path}' must hold a table of at least 4 x 4 heights; got shape {heights.shape}."
        )
    return heights, lengths


def _measured(path: Path) -> tuple[np.ndarray, tuple[float, float]]:
    """The file of an instrument, by surfalize, whose rows lie along y."""
    if importlib.util.find_spec("surfalize") is None:
        raise InputError(
            f"'{path}' is neither .npy nor text; install the package 'surfalize' to read files of"
            f" instruments ({INSTRUMENTS})."
        )
    import surfalize

    try:
        surface = surfalize.Surface.load(path)
    except Exception as error:  # the package raises errors of its own for every format
        raise InputError(f"the package surfalize cannot read '{path}': {error}.") from error
    heights = np.asarray(surface.data).T
    return heights, (
        float(surface.step_x) * heights.shape[0],
        float(surface.step_y) * heights.shape[1],
    )
