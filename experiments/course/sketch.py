"""Arrows and springs of the chapters' sketches."""

from __future__ import annotations

from typing import Any

import numpy as np

Point = tuple[float, float]


def arrow(
    ax: Any,
    tail: Point,
    head: Point,
    name: str = "",
    color: str = "k",
    at: Point | None = None,
    style: str = "-|>",
) -> None:
    """Draw an arrow, and its name at a place, by default beside its middle."""
    ax.annotate("", head, tail, arrowprops={"arrowstyle": style, "color": color, "lw": 1.8})
    wide, high = abs(head[0] - tail[0]), abs(head[1] - tail[1])
    place, offset = ((tail[0] + head[0]) / 2, (tail[1] + head[1]) / 2), (6.0, 0.0)  # beside
    sides = {"ha": "left", "va": "center"}
    if wide > 5 * high:  # above
        offset, sides = (0.0, 3.0), {"ha": "center", "va": "bottom"}
    elif high < 5 * wide:  # at the head
        place = head
    if at is not None:
        place, offset, sides = at, (0.0, 0.0), {"ha": "left", "va": "baseline"}
    ax.annotate(name, place, offset, textcoords="offset points", color=color, size=13, **sides)


def spring(ax: Any, tail: Point, head: Point) -> None:
    """Draw a spring."""
    way = np.subtract(head, tail)
    side = 0.14 * np.array([-way[1], way[0]]) / np.hypot(*way)
    zigzag = np.concatenate([[0], (-1.0) ** np.arange(11), [0]])[:, None]
    ax.plot(*(tail + np.linspace(0, 1, 13)[:, None] * way + zigzag * side).T, "C0", lw=1.5)
