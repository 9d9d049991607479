"""The composite tetrahedron of Johnson and Mercier: it is cut at its centroid into four parts, and
a symmetric stress with continuous tractions is linear on each.

It has as many parameters as there are moments of tractions on the boundary and of body forces on
the parts. Here one body force serves all parts. Sources: as contactopt.bounds.tetrahedra.
"""

from functools import cache

import numpy as np

WEIGHT = 1 / 80  # int l_a l_b = V (1 + delta) / 20 on each of four parts


def components() -> list[tuple[int, int]]:
    """The components of a symmetric matrix."""
    return [(i, j) for i in range(3) for j in range(i, 3)]


@cache
def reference_stress() -> np.ndarray:
    """The stress (value, component, input) by inputs; integrals are WEIGHT times sums."""
    d = 3
    x = np.concatenate([np.zeros((1, d)), np.eye(d)])
    pairs, n = components(), d + 1
    volume = 1 / 6 / n
    slopes = []
    for s in range(n):
        corners = x.copy()
        corners[s] = x.mean(axis=0)
        slopes.append(np.linalg.inv(np.column_stack([np.ones(n), corners]))[1:].T)
    stress = np.zeros((n, n, d, d, n, n, len(pairs)))  # unknowns -> the symmetric stress
    for number, (i, j) in enumerate(pairs):
        for s, v in np.ndindex(n, n):
            stress[s, v, i, j, s, v, number] = stress[s, v, j, i, s, v, number] = 1.0
    stress = stress.reshape(n, n, d, d, -1)
    equations, data, inputs = [], [], n * d * d + d

    def demand(rows: np.ndarray, first: int = -1) -> None:
        """Rows are zero, or equal to the inputs from the first one on."""
        equations.append(rows)
        data.append(np.eye(d, inputs, first) if first >= 0 else np.zeros((d, inputs)))

    for s in range(n):
        demand(-np.einsum("vijk,vj->ik", stress[s], slopes[s]), n * d * d)
        own = [v for v in range(n) if v != s]
        for a, v in enumerate(own):
            tested = (stress[s, v] + stress[s, own].sum(axis=0)) / (d * (d + 1))
            demand(np.einsum("ijk,j->ik", tested, -d * volume * slopes[s][s]), (s * d + a) * d)
        for t in range(s):
            for one, other in [(s, t), *((v, v) for v in own if v != t)]:
                jump = stress[s, one] - stress[t, other]
                demand(np.einsum("ijk,j->ik", jump, slopes[s][t]))
    solved = np.linalg.pinv(np.concatenate(equations), rcond=1e-12) @ np.concatenate(data)
    found = solved.reshape(n, n, len(pairs), inputs)  # part, vertex of the part, component
    # at the vertices of the parts, and their sums
    return np.concatenate([found.reshape(n * n, *found.shape[2:]), found.sum(axis=1)])
