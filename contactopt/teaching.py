"""Figures with a slider, for notebooks that teach."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Slider:
    """A figure for every value of a parameter, drawn by the function `draw` of one value, and a
    slider that chooses one. It needs neither a network nor Python.

    `label` stands above the slider: the name of the parameter with its unit. `start` is the index
    of the value that is shown first.
    """

    def __init__(
        self, label: str, values: Sequence[float], draw: Callable[[float], Any], start: int = 0
    ) -> None:
        self.label, self.values, self.start = label, list(values), start
        self.frames = [_picture(draw(value)) for value in self.values]

    def _repr_html_(self) -> str:
        images = "".join(
            f'<img alt="{escape(self.label)} = {value:.4g}" src="data:image/png;base64,{frame}"'
            f' style="max-width: 100%; display: {"block" if number == self.start else "none"}">'
            for number, (value, frame) in enumerate(zip(self.values, self.frames))
        )
        shown = (
            "[...box.querySelectorAll('img')].forEach((i, k) =>"
            " i.style.display = k == this.value ? 'block' : 'none')"
        )
        return (
            f'<div class="slider" style="max-width: 40em"><label>{escape(self.label)}<br><input'
            ' type="range" min="0"'
            f' max="{len(self.values) - 1}" value="{self.start}" style="width: 100%"'
            f" oninput=\"const box = this.closest('.slider'); {shown}\"></label>{images}</div>"
        )


def _picture(figure: Figure) -> str:
    """The figure as PNG in base64; the figure is closed."""
    import matplotlib.pyplot as plt

    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=80)
    plt.close(figure)
    return base64.b64encode(stream.getvalue()).decode()
