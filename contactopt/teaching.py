"""What the notebooks of the course share: exercises that grade themselves, and figures with a
slider.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import numpy as np

from contactopt.problem import InterfaceProblem, natural_map_residual

# relative error of a number that still counts as right: three digits from pen and paper
CLOSE = 1e-3
# residual of forces that still counts as right: what a cone solver reaches without further settings
CERTIFIED = 1e-4


def check(exercise: str, answer: Any, right: Any) -> bool | None:
    """Grade an answer to an exercise, given by its number, and print the verdict.

    Parameters
    ----------
    exercise, answer : The number of the exercise, and the reader's answer; `...` says that there is
        none yet.
    right : An InterfaceProblem: the answer holds contact forces (k, dim), and the certificate of
        the problem judges them. A number or an array: the answer has to agree to three digits. A
        function: it is given the answer and says True or False.

    Returns
    -------
    Whether the answer is right; None where there is none yet.
    """
    if answer is ...:
        print(f"Exercise {exercise}: not answered yet.")
        return None
    verdict = _judge(answer, right)
    print(f"Exercise {exercise}: {'right.' if verdict else 'not right yet.'}")
    return verdict


def _judge(answer: Any, right: Any) -> bool:
    if callable(right):
        return bool(right(answer))
    try:
        given = np.asarray(answer, dtype=float)
    except (TypeError, ValueError):  # no numbers at all
        return False
    if isinstance(right, InterfaceProblem):
        return (
            given.size == right.q.size
            and natural_map_residual(right, given.reshape(right.q.shape)) <= CERTIFIED
        )
    exact = np.asarray(right, dtype=float)
    size = float(np.abs(exact).max(initial=0.0))
    return given.shape == exact.shape and bool(
        np.allclose(given, exact, rtol=CLOSE, atol=CLOSE * size)
    )


class Slider:
    """A figure for every value of a parameter, and a slider that chooses one; it needs neither a
    network nor Python.

    Parameters
    ----------
    label : str What stands above the slider, the name of the parameter with its unit.
    values : sequence of float The values of the parameter, in the order of the slider.
    draw : function It is given one value and returns a matplotlib figure.
    start : int The index of the value that is shown first.
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


def _picture(figure: Any) -> str:
    """The figure as PNG in base64; the figure is closed."""
    import matplotlib.pyplot as plt

    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=80)
    plt.close(figure)
    return base64.b64encode(stream.getvalue()).decode()
