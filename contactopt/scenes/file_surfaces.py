"""Half-spaces in scene files, and their surfaces: flat, an expression, measured, or generated."""

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from contactopt.cards import count
from contactopt.files.toml_table import Table
from contactopt.scenes.body_shapes import counts_of, grid_of, scale_of
from contactopt.scenes.expressions import Expression
from contactopt.scenes.rough_surfaces import self_affine

if TYPE_CHECKING:
    from contactopt.scenes.body_kinds import Function

MOST_POINTS = 4_000_000
WAVES = ("hurst", "longest", "shortest", "roll_off", "slope")


def half_space_shape(
    table: Table, folder: Path, axes: tuple[str, ...], length: str
) -> dict[str, Any]:
    """Read where the points of a half-space are, and the height of its surface: the arguments
    points, height, periodic and depth of a HalfSpace.

    The points are the centres of as many cells as `points` says along each axis, which fill the
    ranges of the axes. Names of files are relative to the folder; a unit of theirs is converted to
    the scene's unit of length.
    """
    sides = [
        grid_of(table, axis, f"two coordinates, [least {axis}, largest {axis}]") for axis in axes
    ]
    counts: tuple[int, ...] | None = None
    if table.has("points", list):
        along = tuple(f"along {axis}" for axis in axes)
        counts = counts_of(table, "points", along, least=4, most=MOST_POINTS)
    height: Function | np.ndarray | None = None
    if isinstance(table.data.get("height"), dict):
        surface = table.table("height")
        if surface.has("file", str):
            counts, height = _measured(surface, folder, sides, counts, length)
        elif counts is None:
            raise table.fail("'points' is missing; it is the number of points along each axis.")
        else:
            height = _generated(surface, sides, counts)
    elif isinstance(table.data.get("height"), str):
        with table.about("height"):
            height = Expression(table.take("height", str), axes)
    elif table.has("height"):
        raise table.fail("'height' must be a text like \"0.1 * cos(x)\", or a table.", "height")
    if counts is None:
        raise table.fail("'points' is missing; it is the number of points along each axis.")
    ticks = tuple(_centres(side, count) for side, count in zip(sides, counts))
    periodic = table.take("periodic", bool, False)
    depth = table.take("depth", float, low=0.0)
    return {"points": ticks, "height": height, "periodic": periodic, "depth": depth}


def _centres(side: tuple[float, float], count: int) -> np.ndarray:
    low, high = side
    return low + (np.arange(count) + 0.5) * ((high - low) / count)


def _generated(
    table: Table, sides: list[tuple[float, float]], counts: tuple[int, ...]
) -> np.ndarray:
    """The heights of a self-affine surface, drawn from a seed."""
    waves = {key: value for key in WAVES if (value := table.take(key, float)) is not None}
    seed = table.take("seed", int, 0)
    table.close()
    if len(counts) != 2:
        raise table.fail('a generated surface needs a scene in space, kind = "solid".')
    with table.about():
        lengths = tuple(high - low for low, high in sides)
        return self_affine(counts, lengths, seed=seed, **waves)  # type: ignore[arg-type]


def _measured(
    table: Table,
    folder: Path,
    sides: list[tuple[float, float]],
    counts: tuple[int, ...] | None,
    length: str,
) -> tuple[tuple[int, ...], np.ndarray]:
    """The heights in a file, and the number of points along each axis.

    A text file contains a map or a list of points. A map has one line for each y, the smallest
    first; in the plane it has one height per line. A list has a line with x, y and height for each
    point, and heights between the points are interpolated linearly. An array in a .npy file is
    indexed [x, y].
    """
    name, unit = table.take("file", str, needed=True), table.take("unit", str)
    level = table.take("level", bool, False)
    table.close()
    path, dim = folder / name, len(sides)
    values = _numbers(table, path) * scale_of(table, unit, length)
    places = values.ndim == 2 and values.shape[1] == dim + 1 and values.shape[0] > dim + 1
    if not np.all(np.isfinite(values[:, -1] if places else values)):
        raise table.fail(f"'{name}' lacks heights: not all of its numbers are finite.", "file")
    if places and path.suffix != ".npy":
        if counts is None:
            raise table.fail(
                f"'{name}' holds single places; give the number of points, too.", "file"
            )
        made = _between(table, values, sides, counts)
    else:
        made = values if path.suffix == ".npy" else values.T
        made = made.ravel() if dim == 1 else made
        if made.ndim != dim or counts not in (None, made.shape):
            wanted = "" if counts is None else f", not {' x '.join(map(str, counts))}"
            raise table.fail(
                f"'{name}' is a map of {' x '.join(map(str, made.shape))} heights{wanted}; leave"
                " 'points' out, or give the numbers of the map.",
                "file",
            )
    if level:
        axes = np.meshgrid(*[np.linspace(-1, 1, n) for n in made.shape], indexing="ij")
        plane = np.stack([np.ones(made.size), *(axis.ravel() for axis in axes)], axis=1)
        made = made - (plane @ np.linalg.lstsq(plane, made.ravel(), rcond=None)[0]).reshape(
            made.shape
        )
    return made.shape, made


def _numbers(table: Table, path: Path) -> np.ndarray:
    try:
        if path.suffix == ".npy":
            found = np.asarray(np.load(path, allow_pickle=False), dtype=float)
        else:
            text = re.sub("[,;\t]", " ", path.read_text(encoding="utf-8-sig"))
            found = np.loadtxt(io.StringIO(text), ndmin=2)
        if not found.size:
            raise ValueError("it is empty")
        return found
    except (OSError, ValueError, UnicodeDecodeError, EOFError) as error:
        said = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise table.fail(
            f"'{path.name}' cannot be read as a table of heights ({said}).", "file"
        ) from error


def _between(
    table: Table, values: np.ndarray, sides: list[tuple[float, float]], counts: tuple[int, ...]
) -> np.ndarray:
    """Heights at the points of the grid, linear between measured places (n, dim), height."""
    from scipy.interpolate import griddata

    ticks = [_centres(side, count) for side, count in zip(sides, counts)]
    try:
        grid = tuple(np.meshgrid(*ticks, indexing="ij"))
        made = griddata(values[:, :-1], values[:, -1], grid)
    except (ValueError, RuntimeError) as error:
        raise table.fail("the measured places lie on one line.", "file") from error
    if lost := int(np.isnan(made).sum()):
        ranges = [f"{low:g} to {high:g}" for low, high in zip(values.min(0), values.max(0))]
        raise table.fail(
            f"{count(lost, 'point lies', 'points lie')} outside of the measured places,"
            f" which reach over {' and '.join(ranges[:-1])}.",
            "file",
        )
    return np.asarray(made)
