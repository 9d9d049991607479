"""Hertz's contact on elements of every shape and degree."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from contactopt import reduce_bodies, solve
from contactopt.bodies.elements import FACES
from contactopt.meshes.structured import simplices
from contactopt.solving.zone import solve_zone
from experiments.questions.accuracy.half_space import indenter
from experiments.questions.front.bodies import point, solid_model


@contextmanager
def contacts_at_all_nodes():
    """Quadratic simplices with contacts at the middles of edges too, as bricks have them."""
    kept = dict(FACES)
    quarters = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    FACES["RefTri"] = (*kept["RefTri"][:3], kept["RefQuad"][3])
    FACES["RefTet"] = (*kept["RefTet"][:3], quarters)
    try:
        yield
    finally:
        FACES.update(kept)


def ripple(cut):
    """Scatter of the error of the pressure within .6 a, over the peak, on quadratic elements."""
    known = point()
    scene = solid_model(known, degree=2)

    def pieces(part):
        cells = lambda n, zone: simplices(part.mesh(n, zone))  # noqa: E731
        return replace(part, mesh=cells) if part.meshed and cut else part

    problem = reduce_bodies(scene.with_parts(pieces), elements=2).problem
    pressure = solve(problem, tol=1e-9).reactions[:, 0] / problem.areas
    x = np.linalg.norm(problem.coordinates[:2], axis=0)
    a = known.exact.half_width
    error = (pressure - scene.reference.pressure(x)) / scene.reference.peak
    return np.std(error[x < 0.6 * a])


@pytest.mark.slow
@pytest.mark.parametrize("cut", [False, True])
def test_hertz_does_not_ripple_in_3d(cut):
    """The error is nearly the same at all nodes; contacts at all nodes would alternate."""
    own = ripple(cut)
    assert own < 0.03
    if cut:
        with contacts_at_all_nodes():
            assert ripple(cut) > 2 * own
        assert len(FACES["RefTet"][3]) == 1


@pytest.mark.slow
@pytest.mark.parametrize("cut", [False, True])
def test_quadratic_elements_need_fewer_unknowns_for_hertz(cut):
    """Largest nodal pressure and approach are closer on a quadratic mesh half as fine."""

    def errors(elements, degree):
        scene = indenter("axisymmetric", 1e4, elements)
        build = scene.lower.mesh
        mesh = (lambda n, zone: simplices(build(n, zone))) if cut else build
        scene = replace(scene, lower=replace(scene.lower, mesh=mesh), degree=degree)
        solved, exact = solve_zone(scene), scene.reference
        problem, solution = solved.reduction.problem, solved.solution
        peak = (solution.reactions[:, 0] / problem.areas).max()
        ratios = peak / exact.peak, -solution.multipliers[0] / exact.approach
        return solved.reduction.dofs, np.abs(np.array(ratios) - 1)

    (many, linear), (few, quadratic) = errors(16, 1), errors(8, 2)
    assert few < 1.3 * many
    assert np.all(quadratic < 0.6 * linear)
