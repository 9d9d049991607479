"""How much work was done, counted in one place by all forms of an operator that share the work."""

from __future__ import annotations


class Counter:
    """Counts products with Q, or applications of a preconditioner.

    An operator and the operators made from it, such as its normal block or one with less accurate
    products, are handed the same counter. The work that a solve costs is then known wherever it was
    asked for.
    """

    def __init__(self) -> None:
        self._total = 0

    @property
    def total(self) -> int:
        """The number counted so far."""
        return self._total

    def add(self, number: int = 1) -> None:
        """Count some more.

        Parameters
        ----------
        number : How many.
        """
        self._total += number
