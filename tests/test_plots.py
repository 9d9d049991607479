import numpy as np
import pytest
from conftest import two_blocks

from contactopt import plots, reduce_bodies, run, scenes, solve


@pytest.mark.parametrize("name,elements", [("punch-2d", 5), ("punch-3d", 3), ("sphere", 8)])
def test_every_axis_is_labelled_with_its_unit(name, elements):
    result = run(name, elements=elements)
    figure = plots.contact_figure(result.scene, result.problem, result.solution)
    axes = [*figure.axes, plots.deformed(result.scene, result.problem, result.fields)]
    for ax in axes:
        for label in (ax.get_xlabel(), ax.get_ylabel()):
            assert "[" in label and "]" in label


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


def test_a_rigid_punch_is_drawn_with_its_exact_curve():
    result = run(scenes.flat_punch(2, elements=6, rigid="punch"))
    labels = [line.get_label() for line in plots.pressure(result.scene, result.problem, result.solution).lines]
    assert any("rigid punch" in label for label in labels)
    plain = run("punch-2d", elements=6)
    assert len(plots.pressure(plain.scene, plain.problem, plain.solution).lines) == 1


def test_triangles_and_convergence_are_drawn():
    from dataclasses import replace

    base = two_blocks("plane-strain", mu=0.3)
    up = base.upper.mesh.to_meshtri()
    up = up.with_boundaries({"top": lambda x: x[1] == 1, "bottom": lambda x: x[1] == 0, "side0": lambda x: x[0] == 0})
    scene = replace(base, upper=replace(base.upper, mesh=up))
    result = run(scene)
    assert plots.deformed(scene, result.problem, result.fields).collections
    ax = plots.convergence({"one": result.solution, "two": solve(reduce_bodies(scene).problem, tol=1e-4)})
    assert len(ax.lines) == 2 and ax.get_yscale() == "log"
