"""How much work was done, counted in one place by all forms of an operator that share the work."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(eq=False)
class Counter:
    """Products with Q, or applications of a preconditioner, so far.

    An operator and the operators made from it, such as its normal block or one with less accurate
    products, are handed the same counter. The work that a solve costs is then known wherever it was
    asked for.
    """

    total: int = 0
