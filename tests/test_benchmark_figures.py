"""Figures of reports: names that never meet, labels, and what is not drawn."""

from itertools import combinations, pairwise

import numpy as np
from matplotlib.text import Text
from test_benchmark_report import lines, table

from contactopt.benchmark import report_figures as figures


def test_performance_profile_by_hand():
    times = {"a": [1.0, 2.0, 9.0], "b": [2.0, 1.0, 3.0]}
    rows = table(
        method=["a"] * 3 + ["b"] * 3,
        problem=["x", "y", "z"] * 2,
        solve_seconds=times["a"] + times["b"],
        success=[True, True, False, True, True, True],
    )
    curves = lines(figures.performance_profile(rows))
    a, b = curves["a (2)"], curves["b (3)"]
    np.testing.assert_allclose(a[:-1], [[1, 0], [1, 1 / 3], [2, 2 / 3]])
    np.testing.assert_allclose(b[:-1], [[1, 0], [1, 1 / 3], [1, 2 / 3], [2, 1]])


def test_a_profile_names_the_eight_best_and_draws_the_others_grey():
    names = [f"m{i}" for i in range(10)]
    rows = table(method=names, solve_seconds=[1.0 + i for i in range(10)], success=[True] * 10)
    figure = figures.performance_profile(rows)
    figure.draw_without_rendering()
    ax = figure.axes[0]
    texts = {text.get_text(): Text.get_window_extent(text) for text in ax.texts}
    assert set(texts) == {f"{name} (1)" for name in names[:8]}
    heights = sorted((box.y0, box.y1) for box in texts.values())
    assert all(below[1] <= above[0] for below, above in pairwise(heights))
    assert max(box.x1 for box in texts.values()) <= figure.bbox.x1
    grey = [line.get_label() for line in ax.get_lines() if line.get_color() == "#cccccc"]
    assert grey == ["m8 (1)", "m9 (1)"]


def test_of_sixteen_methods_eight_have_colours_marks_and_names_that_never_meet():
    names = [f"m{i:02}" for i in range(16)]
    rows = table(
        method=names, solve_seconds=[0.01 * 1.3**i for i in range(16)], residual=[1e-7] * 16
    )
    figure = figures.speed_accuracy(rows)
    figure.draw_without_rendering()
    ax = figure.axes[0]
    marked = [line for line in ax.get_lines() if line.get_label() in names[:8]]
    assert len({line.get_marker() for line in marked}) == 8
    assert len({line.get_color() for line in marked}) == 8
    grey = {line.get_color() for line in ax.get_lines() if line.get_label() in names[8:]}
    assert grey == {"#cccccc"}
    assert sorted(text.get_text() for text in ax.texts) == names[:8]
    boxes = [Text.get_window_extent(text) for text in ax.texts]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    assert all(box.x0 >= ax.bbox.x1 and box.x1 <= figure.bbox.x1 for box in boxes)


def test_long_labels_are_shortened_and_can_be_set():
    long = "normal_qp(backend='clarabel', exact=True)"
    rows = table(
        method=[long, "normal_qp(backend='clarabel', exact=False)"],
        solve_seconds=[1.0, 2.0],
        contacts=[1, 1],
    )
    curves = lines(figures.performance_profile(rows))
    assert {"normal_qp clarabel exact (1)", "normal_qp clarabel (1)"} <= set(curves)
    for draw in (figures.performance_profile, figures.speed_accuracy, figures.time_against_size):
        assert any(label.startswith("mine") for label in lines(draw(rows, labels={long: "mine"})))


def test_nothing_is_drawn_below_a_hundredth_of_the_tolerance():
    rows = table(method=["a"], solve_seconds=[1.0], residual=[1e-16])
    np.testing.assert_allclose(lines(figures.speed_accuracy(rows))["a"], [[1.0, 1e-8]])


def test_the_cells_of_a_map_hold_their_numbers():
    rows = table(
        **{"problem.nu": [0.1, 1.0], "problem.elements": [1.0, 1.0], "iterations": [1.0, 40.0]}
    )
    ax = figures.stability_map(rows, x="problem.nu", y="problem.elements", value="iterations").axes[
        0
    ]
    assert [text.get_text() for text in ax.texts] == ["1", "40"]
    rows["success"] = [True, False]
    ax = figures.stability_map(rows, x="problem.nu", y="problem.elements", value="iterations").axes[
        0
    ]
    assert [text.get_text() for text in ax.texts] == ["1"] and ax.patch.get_hatch()


def test_the_axis_of_a_profile_is_called_a_ratio():
    rows = table(solve_seconds=[1.0])
    assert (
        figures.performance_profile(rows)
        .axes[0]
        .get_xlabel()
        .startswith("ratio: time of the method / the best method")
    )
