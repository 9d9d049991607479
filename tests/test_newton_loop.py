"""There is one loop of Newton's method: whoever solves a step's linear system is a system of it."""

import numpy as np
import pytest

from contactopt.methods.kernels.newton_loop import newton_iterates


class Root:
    """atan(x) = 0, where full steps from 2 diverge and damped ones converge."""

    def evaluate(self, point):
        return type("At", (), {"point": point, "residual": abs(float(np.arctan(point[0])))})()

    def change(self, at):
        x = at.point[0]
        return (-(1 + x**2) * np.arctan(x),)


@pytest.mark.parametrize("damped", [False, True])
def test_a_line_search_makes_it_converge(damped):
    root = Root()
    residuals = [
        at.residual
        for at, _ in zip(newton_iterates(root, root.evaluate((np.float64(2.0),)), damped), range(8))
    ]
    assert (residuals[-1] < 1e-12) == damped
    assert residuals[1] < residuals[0] or not damped
