"""What a notebook shows of a result and of a scene: tables, and a picture made when shown."""

import base64
import html
import io
import tempfile
from pathlib import Path

import numpy as np

from contactopt.cards import card
from contactopt.errors import InputError
from contactopt.figures.output import not_drawable
from contactopt.outcome import Outcome, pair_rows, remark_rows, summary_rows, titled
from contactopt.problem import alone
from contactopt.scenes.scene import Scene

HEIGHT = 520  # of the page of a scene [pixels]


def result_card(result: Outcome) -> str:
    """The tables of a result, its remarks and its largest pressure, as HTML."""
    s = result.summary
    rows, title = summary_rows(s) | remark_rows(s), titled(s | {"scene": result.scene.name})
    title += f", {result.scene.friction}"
    return card(title, rows, pair_rows(s)) + _pressure(result)


def _pressure(result: Outcome) -> str:
    """The largest pressure's pair of surfaces as HTML with a picture; empty without a figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from contactopt.figures.plots import pressure

    if not_drawable(result):
        return ""
    problem = result.problem
    largest = [result.pressure[pair.contacts].max(initial=0.0) for pair in problem.pairs]
    pair = problem.pairs[int(np.argmax(largest))]
    figure = pressure(result.scene, *alone(problem, result.shown, pair)).figure
    figure.dpi, file = 120, io.BytesIO()  # per inch of a picture
    FigureCanvasAgg(figure).print_png(file)
    name = html.escape(f"pressure of {pair.name}")
    data = base64.b64encode(file.getvalue()).decode()
    return f'<img alt="{name}" title="{name}" src="data:image/png;base64,{data}">'


def scene_page(scene: Scene) -> str:
    """The page of `contactopt check` in a frame of a notebook, or what is wrong with the scene."""
    from contactopt.figures.check_page import write_check_page
    from contactopt.figures.scene_check import check_scene

    try:
        check = check_scene([scene])
    except InputError as error:
        return card(scene.name, {"cannot be solved": error})
    with tempfile.TemporaryDirectory() as folder:
        page = write_check_page(check, Path(folder) / "scene.html").read_text("utf-8")
    look = f'style="width:100%;height:{HEIGHT}px;border:0"'
    return (
        f'<iframe title="{html.escape(scene.name)}" {look} srcdoc="{html.escape(page)}"></iframe>'
    )
