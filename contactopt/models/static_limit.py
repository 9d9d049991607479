"""The program of limit analysis: the factors on a load that friction may balance."""

import cvxpy as cp
import numpy as np

from contactopt.models.program import Program, columns, components, dual
from contactopt.problem import InterfaceProblem
from contactopt.problem.scaling import isotropic


def static_limit(problem: InterfaceProblem, load: np.ndarray, largest: bool = True) -> Program:
    """max f   subject to  r in Coulomb's cones,  V' r + s + f l = 0.

    This is the static theorem of limit analysis: no larger factor f on the loads l lets the bodies
    rest. With associated friction a smaller one of the interval does; Coulomb's may reach less.
    Where a contact cannot open and friction grows with its force, friction counts as unbounded.

    The load l (p,) is what f = 1 adds to the resultants s; Q and q do not matter. Where not the
    largest is asked for, f is minimised. The variables are r (k dim,), over the largest of s and l,
    and f; the multiplier "motion" is that along which the bodies slide away.
    """
    plain = isotropic(problem)
    law, (n, t) = plain.law, components(plain)
    given = law.bound(np.zeros(plain.contacts))
    slope = np.where(np.isfinite(given), law.bound(np.ones(plain.contacts)) - given, 0.0)
    push = np.flatnonzero(law.lowest == 0)
    rubs = np.flatnonzero(np.isfinite(given) & ((slope == 0) | (law.lowest == 0)))
    size = float(np.abs([plain.s, load]).max(initial=0.0)) or 1.0
    r, f = cp.Variable(plain.q.size, name="r"), cp.Variable(name="f")
    balance = plain.V.T @ r + plain.s / size + f * (load / size) == 0
    rules = [balance, r[n[push]] >= 0]
    if len(rubs):
        bound = given[rubs] / size + cp.multiply(slope[rubs], r[n[rubs]])
        T = columns(r[t], plain.contacts)[:, rubs]
        # in the plane absolute values keep the program linear
        rules.append(cp.abs(T[0]) <= bound if plain.dim == 2 else cp.SOC(bound, T, axis=0))
    return Program(
        cp.Problem(cp.Maximize(f if largest else -f), rules),
        {"r": r, "f": f},
        {},
        {"motion": lambda: dual(balance)},
    )
