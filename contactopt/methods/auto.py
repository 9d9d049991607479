"""The default: Newton's method while it gets anywhere, then the proximal loop from the best point it reached.

No number to choose. Newton's method is left when it fails to solve its linear system, when its residual has not improved
for PATIENCE steps, or after LIMIT steps. Cost where Newton converges (elastic bodies): 2 to 10 dense linear systems.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from contactopt.methods import NATIVE, Iterate
from contactopt.methods.newton import Newton, bonded, coulomb_equations
from contactopt.methods.proximal import Proximal
from contactopt.problem import InterfaceProblem

LIMIT = 25
PATIENCE = 6


@dataclass(frozen=True)
class Auto:
    """No settings."""

    def backends(self, dim: int) -> tuple[str, str]:
        return NATIVE, NATIVE

    def iterate(self, problem: InterfaceProblem, start: Iterate | None = None) -> Iterator[Iterate]:
        equations = coulomb_equations(problem)
        best, reached, since = np.inf, start, 0
        for count, point in enumerate(Newton().iterate(problem, start)):
            yield point
            residual = equations.evaluate(*point)[0]
            best, reached, since = (residual, point, 0) if residual < best else (best, reached, since + 1)
            if since >= PATIENCE or count >= LIMIT:
                break
        yield from Proximal().iterate(problem, reached if best < np.inf else bonded(problem))
