"""The cheapest model first: what may be left out of a scene, why, with which error, and what it saves.

    >>> found = contactopt.simplify(scene)
    >>> print(found)                          # what was found, in sentences
    >>> result = contactopt.run(found.scene)  # all that is exact is applied

Four kinds of simplification are looked for, the exact ones first:

| module | what may be left out | error |
|---|---|---|
| `prisms.py`, `revolution.py` | the third dimension, of prisms between rollers and of bodies of revolution | none |
| `mirrors.py`, `cutting.py` | one half, across each plane of mirror symmetry | none |
| `joints.py` | slip and opening of pairs that stick everywhere, friction of pairs that hardly rub | measured on a coarse mesh |
| `large_bodies.py` | the mesh, where the contact is small beside the bodies | estimated, as measured on Hertz's contact |

"Exact" means: every solution of the smaller scene is one of the whole scene, and the whole scene has no other solution if its
solution is unique. On meshes with the symmetry of the scene the discrete solutions agree, too; on others they differ by
the error of the mesh.
"""

from contactopt.analysis.simplest.report import Simplification, Simplified
from contactopt.analysis.simplest.search import simplify

__all__ = ["Simplification", "Simplified", "simplify"]
