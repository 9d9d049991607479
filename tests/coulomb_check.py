"""Coulomb's conditions checked contact by contact in plain loops, without the library: is an answer
one?

u = Q r + V lambda + q, V' r + s = 0; at every contact u_n >= 0, r_n >= 0, u_n r_n = 0, |r_t| <= mu
r_n, and where the contact slips the friction opposes the slip with its full bound.
"""

from __future__ import annotations

from math import fsum, hypot

import numpy as np

CONDITIONS = ("penetration", "tension", "complementarity", "friction bound")
CONDITIONS += ("slip", "direction", "balance")


def violations(Q, q, mu, V, s, r, lam):
    """The largest violation of each condition, forces over a force scale and displacements over a
    displacement scale.

    The displacement scale is the largest displacement that the forces make at a contact with at
    least a millionth of the largest force, or the largest overlap, or the least gap. The force
    scale is the largest force or, where that is less, what the displacement scale or the load on
    the plates amounts to.
    """
    Q, q, V, s, r, lam = (np.asarray(a, dtype=float) for a in (Q, q, V, s, r, lam))
    k, d = q.shape
    moved = [[fsum(Q[i * d + a] * r.ravel()) for a in range(d)] for i in range(k)]
    rest = [[fsum([q[i, a], *(V[i * d + a] * lam)]) for a in range(d)] for i in range(k)]
    force = [hypot(*r[i]) for i in range(k)]
    top = max(force)
    lengths = (
        [hypot(*moved[i]) * min(1.0, force[i] / (1e-6 * top)) for i in range(k)]
        if top > 0
        else [0.0]
    )
    length = max([*lengths, *[max(-w[0], 0.0) for w in rest], min(abs(w[0]) for w in rest)])
    stiff = [(force[i], np.mean([Q[i * d + a, i * d + a] for a in range(d)])) for i in range(k)]
    mean = (
        sum(f * c for f, c in stiff) / sum(f for f, _ in stiff)
        if top > 0
        else np.mean([c for _, c in stiff])
    )
    plates = [abs(s[j]) / max(abs(V[:, j])) for j in range(len(s)) if max(abs(V[:, j])) > 0]
    natural = max([length / mean if mean > 0 else 0.0, *plates])
    scale = max(min(top, natural), 1e-5 * natural) if natural > 0 else top
    out = dict.fromkeys(CONDITIONS, 0.0)
    small = 1e-300
    for i in range(k):
        u_n, u_t = moved[i][0] + rest[i][0], [moved[i][a] + rest[i][a] for a in range(1, d)]
        r_n, r_t = r[i, 0], r[i, 1:]
        bound, slip = mu[i] * max(r_n, 0.0), hypot(*u_t)
        out["penetration"] = max(out["penetration"], -u_n / (length + small))
        out["tension"] = max(out["tension"], -r_n / (scale + small))
        both = min(r_n / (scale + small), u_n / (length + small))
        out["complementarity"] = max(out["complementarity"], both)
        out["friction bound"] = max(out["friction bound"], (hypot(*r_t) - bound) / (scale + small))
        idle = (bound - hypot(*r_t)) / (scale + small) / (1 + mu[i])
        out["slip"] = max(out["slip"], min(idle, slip / (length + small)))
        if slip > 0 and bound > 0:
            across = hypot(*(r_t + bound * np.array(u_t) / slip)) / (scale + small)
            weight = 1 / (1 + mu[i] + bound * length / (scale * slip + small))
            out["direction"] = max(out["direction"], across * weight)
    for j in range(len(s)):
        left = abs(fsum([*(V[:, j] * r.ravel()), s[j]]))
        out["balance"] = max(
            out["balance"], left / max(abs(s[j]), max(abs(V[:, j])) * scale, small)
        )
    return out
