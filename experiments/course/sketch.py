"""Arrows of the chapters' sketches."""

from __future__ import annotations

from typing import Any

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
    beside = (tail[0] + head[0]) / 2 + 0.07, (tail[1] + head[1]) / 2 + 0.09
    ax.text(*(at or beside), name, color=color)
