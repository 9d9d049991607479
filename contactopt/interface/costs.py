"""The choice between the forms of Q by their cost, with every number that it rests on.

`python -m experiments.questions.form_of_q` measures PRODUCTS, SOLVE, DENSE and the entries of the factors on punches of growing size,
and the table of costs of `python -m experiments.questions.preconditioners` shows where the two forms cost the same. MOST_EXPLICIT is not
fitted but chosen: an array of half a gigabyte.
"""

from __future__ import annotations

import numpy as np

PRODUCTS = 60  # with Q, of a solve from cold
SOLVE = {2: 1.2, 3: 0.4}  # time of an operation of a product over one of the elimination, by dimension
DENSE = 10  # speed of dense linear algebra over that of a sparse factorisation
MOST_EXPLICIT = 8000  # interface unknowns of an explicit Q that is chosen without being asked for


def form_of(m: int, n: int, dim: int, iterative: bool) -> str:
    """The cheaper form of Q, 'explicit' or 'implicit', from counts of operations.

    An explicit Q takes m^3 / 3 operations to eliminate the contact unknowns last, at the speed of a sparse factorisation,
    and about 3 m^3 for the inverse and the steps of Newton's method at DENSE times that speed. An implicit Q takes PRODUCTS
    products of 4 operations, at the price SOLVE, for each entry of the factors. Nested dissection leaves 4 n log2 n entries
    in 2D and 17 n^(4/3) in 3D. Bodies without factors would need m solves for an explicit Q, which never pays.

    Parameters
    ----------
    m
        Number of unknowns on the contact surface of the body that has most of them.
    n
        Number of unknowns of the largest body.
    dim
        Dimension of space, 2 or 3.
    iterative
        Whether a body has no factors.
    """
    explicit = m**3 / 3 + 3 * m**3 / DENSE
    entries = 4 * n * np.log2(max(n, 2)) if dim == 2 else 17 * n ** (4 / 3)
    return (
        "implicit" if iterative or m > MOST_EXPLICIT or explicit > 4 * PRODUCTS * SOLVE[dim] * entries else "explicit"
    )
