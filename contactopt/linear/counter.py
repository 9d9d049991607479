"""How much work was done, counted in one place by all forms of an operator that share the work."""

from dataclasses import dataclass


@dataclass(eq=False)
class Counter:
    """Products with Q, or applications of a preconditioner, so far. An operator and those made from
    it share one, so that the work of a solve is known wherever it was asked for.
    """

    total: int = 0
