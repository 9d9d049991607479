"""The largest pressure of long and narrow zones, as of a ball in a groove."""

from types import SimpleNamespace

import numpy as np
import pytest
import skfem

from contactopt.problem import InterfaceProblem
from contactopt.problem.chart import Chart
from contactopt.readings.peaks import pressure_reading


def ellipse(across, ratio=0.15, shift=(0.31, 0.17)):
    """Hertz's pressure with the largest value 1 as forces of nodes, `across` of them over the short
    half-axis.
    """
    h = ratio / across
    x, y = (h * (np.arange(-n, n + 1) + s) for n, s in zip((int(1.1 / h), across + 2), shift))
    basis = skfem.Basis(skfem.MeshTri.init_tensor(x, y), skfem.ElementTriP1(), intorder=8)
    load = skfem.LinearForm(
        lambda v, w: v * np.sqrt(np.maximum(1 - w.x[0] ** 2 - (w.x[1] / ratio) ** 2, 0))
    ).assemble(basis)
    areas = skfem.LinearForm(lambda v, w: v).assemble(basis)
    k, places = len(areas), basis.mesh.p
    forces = np.zeros((k, 3))
    forces[:, 0] = load
    problem = InterfaceProblem(
        Q=np.eye(3 * k), q=np.zeros((k, 3)), mu=0.0, areas=areas,
        coordinates=np.vstack([places, 0 * places[:1]]), chart=Chart(places, (False, False)),
    )  # fmt: skip
    solution = SimpleNamespace(reactions=forces, residual=0.0)
    kind = SimpleNamespace(kind="solid", analysis=SimpleNamespace(revolved=False))
    return SimpleNamespace(problem=problem, scene=kind), solution


@pytest.mark.parametrize("across, most", [(1, 0.5), (2, 0.15)])
def test_the_peak_of_a_narrow_ellipse_is_as_uncertain_as_it_is_wrong(across, most):
    """Claimed was the whole value wherever fewer than four contacts lay across the ellipse."""
    found = pressure_reading(*ellipse(across))
    assert abs(found.value - 1) < found.uncertainty < most


def test_rounding_does_not_choose_among_equal_peaks():
    """A pressure that alternates was read at another place in another unit of length."""
    k, rng = 17, np.random.default_rng(0)
    places = np.arange(float(k))[None]
    kind = SimpleNamespace(kind="plane-strain", analysis=SimpleNamespace(revolved=False))
    found = set()
    for _ in range(10):
        forces = np.zeros((k, 2))
        forces[:, 0] = np.where(np.arange(k) % 2, 0.9, 1.0) * (1 + 1e-15 * rng.normal(size=k))
        problem = InterfaceProblem(
            Q=np.eye(2 * k), q=np.zeros((k, 2)), mu=0.0, areas=np.ones(k),
            coordinates=np.vstack([places, 0 * places]), chart=Chart(places, (False,)),
        )  # fmt: skip
        reduction = SimpleNamespace(problem=problem, scene=kind)
        solution = SimpleNamespace(reactions=forces, residual=0.0)
        found.add(round(pressure_reading(reduction, solution).value, 9))
    assert len(found) == 1
