"""Hertz on elements of every shape and degree, as the question measures it."""

import pytest

from contactopt.bodies.elements import FACES
from experiments.questions import elements as experiment


@pytest.mark.parametrize("cut", [False, True])
def test_hertz_does_not_ripple_in_3d(cut):
    """Within .6 a the error of the pressure is nearly the same at all nodes; contacts at all nodes
    of P2 would fail.
    """
    row = experiment.solved("sphere 3D", 2, 2, "P" if cut else "Q")
    assert row["ripple"] < 0.03
    if cut:
        with experiment.contacts_at_all_nodes():
            assert experiment.solved("sphere 3D", 2, 2, "P")["ripple"] > 2 * row["ripple"]
        assert len(FACES["RefTet"][3]) == 1


@pytest.mark.parametrize("cut", [False, True])
def test_quadratic_elements_need_fewer_unknowns_for_hertz(cut):
    """Peak pressure and approach: closer on a quadratic mesh half as fine, of about as many
    unknowns.
    """
    shape = "P" if cut else "Q"
    linear, quadratic = (
        experiment.solved("sphere", 8, 1, shape),
        experiment.solved("sphere", 4, 2, shape),
    )
    assert quadratic["unknowns"] < 1.3 * linear["unknowns"]
    for quantity in ("peak", "approach"):
        assert abs(quadratic[quantity]) < 0.9 * abs(linear[quantity])
