"""A body on an elastic half-plane, without a mesh."""

import numpy as np

from contactopt.problem import InterfaceProblem
from contactopt.problem.laws.coulomb import Coulomb


def half_plane(contacts: int = 64, mu: float = 0.5, coupling: float = 0.0) -> InterfaceProblem:
    """A parabola pressed on an elastic half-plane: the dense logarithmic kernel of piecewise
    constant tractions.

    Half the candidate zone and the plane's modulus pi E* / 2 are the units. The load, by a plate,
    makes about half of the candidate nodes touch. `coupling` is Dundurs' constant, in (-.5, .5), by
    which tangential tractions move the surface normally. At 0 friction has nothing to do and only
    the normal problem is left.

    Source: Johnson (1985), Contact Mechanics, eqs (2.30).
    """
    h = 2.0 / contacts
    x = -1.0 + h * (np.arange(contacts) + 0.5)
    distance = x[:, None] - x
    ends = [distance + h / 2, distance - h / 2]
    # at rest 8 away: positive definite on this zone
    a, b = (end * np.log(np.abs(end) / 8.0) for end in ends)
    kernel = (b - a + h) / h
    skew = -coupling * np.pi / 2 * np.sign(distance)
    Q = np.zeros((contacts, 2, contacts, 2))
    Q[:, 0, :, 0] = Q[:, 1, :, 1] = kernel
    Q[:, 0, :, 1], Q[:, 1, :, 0] = skew, skew.T
    V = np.zeros((contacts, 2, 1))
    V[:, 0] = 1.0
    q = np.stack([x**2, np.zeros(contacts)], axis=1)
    return InterfaceProblem(
        Q.reshape(2 * contacts, -1),
        q,
        Coulomb(np.full(contacts, mu)),
        V.reshape(-1, 1),
        np.array([-0.25]),
        np.full(contacts, h),
        x[None],
    )
