import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from conftest import two_blocks
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from contactopt import (
    HalfSpace,
    Material,
    Rigid,
    Scene,
    plots,
    run,
    scenes,
    solve,
)
from contactopt.figures.solids import nearest, picture
from contactopt.figures.style import COLUMN, draw_lines, paper_axes, save_figure


@pytest.mark.parametrize("name,elements", [("punch-2d", 5), ("punch-3d", 3), ("sphere", 8)])
def test_every_axis_is_labelled_with_its_unit(name, elements):
    result = run(name, elements=elements)
    figure = plots.contact_figure(result.scene, result.problem, result.solution)
    bodies = plots.deformed(result.scene, result.problem, result.fields)
    labels = [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel())]
    labels += [bodies.get_xlabel(), bodies.get_ylabel()] if result.scene.dim == 2 else []
    assert all("[" in label and "]" in label for label in labels)
    if result.scene.dim == 3:  # the axes of a picture of solids are drawn in it
        texts = {text.get_text() for text in bodies.texts}
        assert {"x [mm]", "y [mm]", "z [mm]"} <= texts


def test_a_users_scene_is_not_labelled_with_our_units():
    result = run(two_blocks("plane-strain", mu=0.3))
    labels = [plots.traction(result.scene, result.problem, result.solution).get_ylabel()]
    labels.append(plots.deformed(result.scene, result.problem, result.fields).get_xlabel())
    assert not any("mm" in label or "MPa" in label for label in labels)


def test_the_pressure_curve_is_the_pressure():
    result = run("sphere", elements=8)
    line = plots.pressure(result.scene, result.problem, result.solution).lines[0]
    x, p = line.get_data()
    assert np.argmax(p) <= 2 and p[-1] == 0
    assert 1.4 < p.max() < 1.6  # Hertz: 3/2 of the mean
    assert x[-1] == pytest.approx(1.25, rel=0.05)


def test_a_small_contact_zone_is_drawn_alone():
    """A light cylinder on a wide base: what touches fills a third of the picture, not a tenth."""
    cylinder = Rigid("cylinder", gap=lambda x: x[0] ** 2 / 20, force={"y": -0.1})
    base = HalfSpace("base", Material(E=5.0, nu=0.3), (np.linspace(-5, 5, 65),))
    result = run(Scene("line", cylinder, base, mu=0.3))
    touching = result.solution.reactions[:, 0] > 0
    zone = np.ptp(plots.contact_place(result.problem)[touching])
    assert zone < np.ptp(plots.contact_place(result.problem)) / 6
    shown = plots.traction(result.scene, result.problem, result.solution).get_xlim()
    assert np.ptp(shown) <= 3.5 * zone


def test_the_legend_is_above_a_power_of_ten():
    """In pascals the values of an axis have a power of ten in common, which stands above it."""
    result = run("press-fit")
    units = replace(result.scene, units=("m", "Pa"))
    large = replace(result.solution, reactions=1e9 * result.solution.reactions)
    ax = plots.traction(units, result.problem, large)
    FigureCanvasAgg(ax.figure).draw()
    power, legend = ax.yaxis.get_offset_text(), ax.get_legend()
    assert power.get_text()
    assert legend.get_window_extent().y0 >= power.get_window_extent().y1


def test_a_rigid_punch_is_drawn_with_its_exact_curve():
    result = run(scenes.flat_punch(2, elements=6, rigid="punch"))
    labels = [
        line.get_label()
        for line in plots.pressure(result.scene, result.problem, result.solution).lines
    ]
    assert any("rigid punch" in label for label in labels)
    plain = run("punch-2d", elements=6)
    assert len(plots.pressure(plain.scene, plain.problem, plain.solution).lines) == 1


@pytest.mark.parametrize("wide, columns, rows", [(False, 1, 1), (True, 2, 1), (True, 2, 2)])
def test_names_beside_lines_never_meet_and_stay_in_the_figure(wide, columns, rows):
    random, x = np.random.default_rng(rows), np.geomspace(1.0, 1e3, 5)
    figure, axes = paper_axes(columns, rows, wide)
    for ax, spread in zip(axes, (0.0, 0.01, 1.0, 5.0)):
        lines = [
            (f"name of {i}", x[: 2 + i % 4], 10 ** (spread * random.random(2 + i % 4)))
            for i in range(11)
        ]
        draw_lines(ax, lines)
    figure.draw_without_rendering()
    for ax in axes:
        assert {text.get_text() for text in ax.texts} == {f"name of {i}" for i in range(8)}
        assert len(ax.texts) == 8 and len({line.get_color() for line in ax.lines}) == 9
        boxes = [Text.get_window_extent(text) for text in ax.texts]
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
        assert all(box.x0 >= ax.bbox.x1 and box.x1 <= figure.bbox.x1 + 1 for box in boxes)


def test_a_figure_as_pdf_is_one_column_wide_and_says_a_status_only_if_it_failed(tmp_path):
    result = run("punch-2d", elements=4)
    figure = plots.contact_figure(result.scene, result.problem, result.solution)
    save_figure(figure, tmp_path / "a.pdf")
    box = re.search(rb"MediaBox \[([\d. ]+)\]", (tmp_path / "a.pdf").read_bytes())
    assert float(box[1].split()[2]) == pytest.approx(72 * COLUMN, abs=0.1)
    assert figure.get_suptitle() == "punch-2d, μ = 0.5"
    assert all(ax.get_legend() is None or _above(ax) for ax in figure.axes)
    failed = replace(result.solution, status=solve(result.problem, "nsgs", max_iterations=1).status)
    words = plots.contact_figure(result.scene, result.problem, failed).get_suptitle()
    assert words.startswith("punch-2d, μ = 0.5: ")


def _above(ax):
    ax.figure.draw_without_rendering()
    return ax.get_legend().get_window_extent().y0 >= ax.bbox.y1


def test_triangles_are_drawn():
    base = two_blocks("plane-strain", mu=0.3)
    up = base.upper.mesh.to_meshtri()
    up = up.with_boundaries(
        {"top": lambda x: x[1] == 1, "bottom": lambda x: x[1] == 0, "side0": lambda x: x[0] == 0}
    )
    scene = replace(base, upper=replace(base.upper, mesh=up))
    result = run(scene)
    assert plots.deformed(scene, result.problem, result.fields).collections


def test_nearer_bodies_hide_those_behind_them_in_every_pixel():
    """Two triangles that pierce each other, and a small one before a large one."""
    big = np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [0.0, 40.0, 0.0]])
    # nearer beyond half of its width
    tilted = big + np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    owner = nearest(np.stack([big, tilted]), (40, 40))
    y, x = np.nonzero(owner >= 0)
    assert abs(len(x) - 800) <= 40 and np.all(x + y + 1 <= 40)
    assert np.array_equal(owner[y, x] == 1, x + 0.5 > 20)
    slope = np.array([[0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [0.0, 40.0, 30.0]])
    small = np.array(
        [[2.0, 2.0, 5.0], [8.0, 2.0, 5.0], [2.0, 8.0, 5.0]]
    )  # behind the middle of the slope, before its foot
    owner = nearest(np.stack([slope, small]), (40, 40))
    assert owner[3, 3] == 1 and owner[7, 2] == 0 and owner[30, 2] == 0


def test_the_picture_of_a_solid_has_its_colours_and_its_outline():
    """A square seen from above, whose values grow along x."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    lined = np.array([[True, False, True], [True, True, False]])  # its sides, not its diagonal
    image, (left, right, bottom, top) = picture(
        corners[cells],
        corners[cells][..., 0],
        lined,
        lambda v: np.stack([v, v, v, np.ones_like(v)], axis=1),
        102,
    )
    assert image.shape[:2] == (102, 102) and np.all(image[[0, -1]] == 0)
    inner = image[3:-3, 3:-3, 0]
    middles = left + (np.arange(3, 99) + 0.5) * (right - left) / 102
    assert np.allclose(inner, middles) and np.allclose(image[1, 3:-3, 0], middles * 0.65)
    assert bottom == pytest.approx(-0.01) and top == pytest.approx(1.01)


def test_a_solid_whose_displacements_are_no_numbers_is_drawn_at_rest():
    result = run("punch-3d", elements=2)
    far = [
        replace(f, displacement=np.full_like(f.displacement, value))
        for f, value in zip(result.fields, (np.nan, np.inf))
    ]
    ax = plots.deformed(result.scene, result.problem, far)
    left, right, bottom, top = ax.images[0].get_extent()
    assert np.all(np.isfinite([left, right, bottom, top])) and right - left < 300
