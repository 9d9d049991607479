"""The cheapest model first: what may be left out of a scene, why, with which error, and what it
saves.

    >>> found = contactopt.simplify(scene)
    >>> print(found)                          # what was found, in sentences
    >>> result = contactopt.run(found.scene)  # all that is exact is applied

Three kinds of simplification are looked for, the exact ones first:

| module | what may be left out | error |
|---|---|---|
| `sections.py` | the third dimension, of prisms between rollers | none |
| `mirrors.py` | one half, across each plane of mirror symmetry | none |
| `joints.py` | slip of pairs that stick, friction of pairs that hardly rub | measured coarsely |

"Exact" means that the certificate of the whole was computed from the solution of the smaller scene,
and is that of a solution (`proof.py`).
"""

from contactopt.simplification.findings import Simplification, Simplified
from contactopt.simplification.search import simplify

__all__ = ["Simplification", "Simplified", "simplify"]
