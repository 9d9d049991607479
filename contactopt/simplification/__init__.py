"""The cheapest model first: what may be left out of a scene, why, with which error, and what it
saves.

    >>> found = contactopt.simplify(scene)
    >>> print(found)                          # what was found, in sentences
    >>> result = contactopt.run(found.scene)  # all that is exact is applied

Exact are the third dimension of prisms between rollers (`sections`) and one half across planes of
mirror symmetry (`mirrors`), where `proof` certifies the whole from the smaller solution. Slip that
sticks and friction that hardly rubs (`joints`) have an error measured coarsely.
"""

from contactopt.simplification.findings import Simplification, Simplified
from contactopt.simplification.search import simplify

__all__ = ["Simplification", "Simplified", "simplify"]
